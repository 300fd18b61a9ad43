"""Motion that sticks and slips: what is known of friction has many minima there, and one of them is right."""

from __future__ import annotations

import numpy as np
import pytest

from signlin_ros.diagnosis import diagnose
from signlin_ros.model import Model
from signlin_ros.records import ModelData
from signlin_ros.simulation import simulate

DT, SAMPLES, NOISE = 0.004, 5000, 1.6e-4
VALVE = Model.load("mass_spring_damper").without_effect("coulomb_friction")
VALVE = VALVE.with_parameters({"m": 1.31, "c": 74.2, "k": 3340.0})
LAW = {"mu": 4.1, "excess": 6.3, "v_s": 0.0117}


def stroked(seed: int) -> ModelData:
    """Return a record of a valve's stem, which is stuck most of the time, moved by slow strokes and small steps."""
    rng, t = np.random.default_rng(seed), np.arange(SAMPLES) * DT
    w, phase = 2 * np.pi * np.array([0.11, 0.23, 0.41]), rng.uniform(0, 6.3, 3)
    strokes = (np.array([25.0, 20.0, 12.0]) * np.sin(w * t[:, None] + phase)).sum(axis=1)
    u = strokes + np.repeat(rng.uniform(-6, 6, SAMPLES // 125), 125)
    model = VALVE.with_effect("stribeck_friction", **LAW)
    q = simulate(model, t, u[:, None]).x[:, 0] + NOISE * rng.normal(size=SAMPLES)
    units = {"force": "N", "displacement": "m"}
    return ModelData(t, u[:, None], {"displacement": q}, None, model.inputs, model.states, units)


@pytest.mark.long
@pytest.mark.parametrize("seed", [1])
def test_friction_that_falls_from_breakaway_is_named(seed):
    nominal = VALVE.with_parameters({"m": 1.4, "c": 78.0, "k": 3450.0}).with_options(tolerance=0.1)
    found = diagnose(nominal, stroked(seed), stroked(seed + 10))
    assert found.verdict == "missing"
    assert found.ladder[-1].effects == ("stribeck_friction",)
    for name, value in LAW.items():
        assert found.parameters[f"stribeck_friction.{name}"].value == pytest.approx(value, rel=0.05)
    assert found.ladder[-1].validation.over_noise < 1.1
