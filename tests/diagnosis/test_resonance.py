"""Light damping, a few samples in every period: what the loop's integration adds must not be taken for physics."""

from __future__ import annotations

import numpy as np
import pytest

from signlin_ros.diagnosis import diagnose
from signlin_ros.follow.equations import equations, neutral_sensors
from signlin_ros.follow.tracking import Tracker
from signlin_ros.model import Model
from signlin_ros.records import ModelData
from signlin_ros.simulation import simulate

OWN, DT, SAMPLES = 2 * np.pi * 40.0, 1 / 320.0, 1500
PLANT = Model.load("mass_spring_damper").without_effect("coulomb_friction")
BASE = PLANT.with_parameters({"m": 2.0, "c": 2 * 0.02 * 2.0 * OWN, "k": 2.0 * OWN**2})
TIMES = np.arange(SAMPLES) * DT


def force(seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    tones = np.linspace(4.0, 90.0, 60)
    return 4.0 * np.sin(2 * np.pi * tones * TIMES[:, None] + rng.uniform(0, 6.3, 60)).sum(axis=1)[:, None]


def record(model: Model, seed: int) -> ModelData:
    u, rng = force(seed), np.random.default_rng(seed + 100)
    x = simulate(model, TIMES, u).x
    x = x + 0.002 * np.std(x, axis=0) * rng.normal(size=x.shape)
    measured, units = {"displacement": x[:, 0], "velocity": x[:, 1]}, {"force": "N", "displacement": "m"}
    return ModelData(TIMES, u, measured, None, model.inputs, model.states, {**units, "velocity": "m/s"})


def nominal() -> Model:
    factors = {"m": 1.02, "c": 0.96, "k": 0.98}
    return BASE.with_parameters({n: v * BASE.parameters[n] for n, v in factors.items()})


@pytest.mark.parametrize("damping", [0.01, 0.1, 0.5])
def test_eight_samples_a_period_are_enough(damping):
    model = BASE.with_parameters({"c": 2 * damping * 2.0 * OWN})
    u = force(1)
    exact = simulate(model, TIMES, u, rtol=1e-9).x
    nothing = np.full((SAMPLES, 1), np.nan)
    found = Tracker(model, TIMES, u, nothing, ("displacement",), np.std(exact, axis=0)).run(np.zeros(2)).state
    error = np.sqrt(np.mean((found - exact) ** 2, axis=0)) / np.std(exact, axis=0)
    assert error.max() < 2e-3


def test_what_does_not_ring_is_left_alone():
    scale = np.ones(3)
    motor = Model.load("dc_motor")
    eq = equations(motor.structure, ("speed",), ())
    assert eq.ringing(np.concatenate([motor.p, neutral_sensors(1)]), scale[: eq.sizes[0]]) == np.inf
    # a bristle is stiff at rest, but what it does there does not last
    bristle = motor.with_effect("dahl_presliding", F_c=0.03, sigma=30.0)
    eq = equations(bristle.structure, ("speed",), ())
    assert eq.ringing(np.concatenate([bristle.p, neutral_sensors(1)]), scale[: eq.sizes[0]]) == np.inf


def test_nothing_is_missing_where_nothing_is():
    found = diagnose(nominal(), record(BASE, 1), record(BASE, 2))
    assert found.verdict == "adequate"
