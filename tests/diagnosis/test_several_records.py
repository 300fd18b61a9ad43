"""Several records at once: pendulums that were let go, and servos on closed loops whose input changes unseen."""

from __future__ import annotations

import math

import numpy as np
import pytest

from signlin_ros.diagnosis.problem import fourth_difference_noise, prepare
from signlin_ros.diagnosis.verdict import diagnose
from signlin_ros.model import Model
from signlin_ros.records import ModelData
from signlin_ros.simulate import simulate

QUANTUM, NOISE = 0.00153, 5e-4
UNITS = {"force": "N·m", "displacement": "rad"}
PENDULUM = Model.from_dict(
    {
        "plant": "mass_spring_damper",
        "parameters": {"m": 0.0125, "c": 4e-4, "k": 0.0},
        "effects": {"gravity_load": {"A": 0.62, "q0": 0.0}},
    }
)


def record(t, u, q) -> ModelData:
    return ModelData(t, u[:, None], {"displacement": q}, None, PENDULUM.inputs, PENDULUM.states, UNITS)


def let_go(seed: int, *effects: tuple[str, dict[str, float]]) -> ModelData:
    """Return a record of a pendulum that swings until it hardly moves, seen by an encoder."""
    rng, t = np.random.default_rng(seed), np.arange(1500) * 0.01
    model = PENDULUM
    for name, values in effects:
        model = model.with_effect(name, **values)
    q = simulate(model, t, np.zeros((t.size, 1)), x0=[1.2 + 0.2 * rng.random(), 0.0]).x[:, 0]
    return record(t, np.zeros(t.size), QUANTUM * np.round((q + NOISE * rng.normal(size=t.size)) / QUANTUM))


def test_noise_is_not_told_from_where_one_record_ends_and_another_begins():
    rng = np.random.default_rng(1)
    first, second = rng.normal(size=2000), 1e4 + rng.normal(size=2000)
    assert fourth_difference_noise(first, second) == pytest.approx(1.0, rel=0.1)
    data = [let_go(seed) for seed in (1, 2)]
    alone = [prepare(PENDULUM, [d]).noise[0] for d in data]
    assert min(alone) <= prepare(PENDULUM, data).noise[0] <= max(alone)


def test_two_frictions_of_a_pendulum_that_nothing_drives_are_told_apart():
    drag, dry = ("quadratic_drag", {"c2": 6e-4}), ("coulomb_friction", {"mu": 0.004})
    data = [let_go(seed, drag, dry) for seed in (1, 2, 3)]
    found = diagnose(PENDULUM.with_parameters({"m": 0.0125 * 1.02}), data[:2], data[2:])
    assert found.verdict == "missing"
    assert set(found.ladder[-1].effects) == {"quadratic_drag", "coulomb_friction"}
    assert found.parameters["quadratic_drag.c2"].value == pytest.approx(6e-4, rel=0.1)
    assert found.parameters["quadratic_drag.c2"].unit == "N·m·s²/rad²"
    assert found.parameters["coulomb_friction.mu"].value == pytest.approx(0.004, rel=0.1)


def served(goal, seconds: float, seed: int) -> ModelData:
    """Return a record of a geared servo with dry friction that swings a weight.

    Its position loop runs at 1 kHz on a coarse encoder; its torque is written down every 5 ms or so only, as the mean
    of two readings.
    """
    m, c, weight, dry, gain, most, h = 0.0716, 1.655, 2.943, 0.1035, 56.0, 11.0, 2e-4
    rng, q, v, torque, at, rows = np.random.default_rng(seed), 0.0, 0.0, 0.0, 0.0036, []
    step = 2 * math.pi / 4096
    for n in range(int(seconds / h)):
        if n % 5 == 0:
            torque = max(-most, min(most, 0.01 * round(gain * (goal(n * h) - step * round(q / step)) / 0.01)))
        if n * h >= at:
            rows.append((n * h, step * round(q / step), torque))
            at = n * h + 0.0053 + abs(rng.normal(0.0, 2e-4))
        free = v + h * (torque - c * v - weight * math.sin(q)) / m
        held = dry * h / m
        v = free - max(-held, min(held, free))
        q += h * v
    t, shown, u = np.array(rows).T
    u[:-1] = (u[:-1] + u[1:]) / 2
    return record(t, u, shown)


def test_friction_that_holds_only_what_is_corrected_is_not_named():
    """Breakaway of a hundred times the sliding level fitted best at the middle gain, and stood still left alone."""
    goals = [
        (lambda t: -0.785 * (1 - math.cos(1.57 * t)), 2.0),
        (lambda t: math.sin(t) * math.pi / 2 + math.sin(5 * t) * 0.5 * math.sin(2 * t), 6.0),
        (lambda t: math.sin(t * t), 6.0),
        (lambda t: 0.785 * (1 - math.cos(1.05 * t)), 6.0),
    ]
    data = [served(goal, seconds, seed) for seed, (goal, seconds) in enumerate(goals)]
    rig = PENDULUM.with_parameters({"m": 0.0716 * 0.98, "c": 1.655 * 1.02}).without_effect("gravity_load")
    found = diagnose(rig.with_effect("gravity_load", A=2.943 * 1.01, q0=0.0), data[:3], data[3:])
    assert found.ladder[-1].effects == ("coulomb_friction",)
    assert found.parameters["coulomb_friction.mu"].value == pytest.approx(0.1035, rel=0.15)
