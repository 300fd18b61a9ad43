"""Joints in a position loop that is five times as fast as its log, which is taken at times of its own.

What the torque does between two samples is not in the log: it acts sooner or later than that tells, by another part of
a step each time. The encoder is coarse, so that within a step this is lost in its steps; over a second it is not.
Integrated here, in small steps, with the set-valued law.
"""

from __future__ import annotations

import numpy as np
import pytest

from signlin_ros.diagnosis import diagnose
from signlin_ros.model import Model
from signlin_ros.records import ModelData

TICK, FINE, QUANTUM, STEP, JITTER = 1e-3, 20, 1.5e-3, 5.2e-3, 1.5e-4
M, C, LIMIT = 0.033, 0.9, 7.5
UNKNOWN = "a log that is slower than its loop: unexplained, since nothing allows for a torque that acts sooner or later"
JOINT = {
    "plant": "mass_spring_damper",
    "parameters": {"m": 0.035, "c": 0.85, "k": 0.0},
    "tolerance": {"m": 0.12, "c": 0.25},
}


def logged(seed: int, dry: float) -> ModelData:
    """Return a record of a joint with dry friction, while its loop follows steps and a fast sine."""
    rng = np.random.default_rng(seed)
    count = round(16.0 / TICK)
    t = np.arange(count) * TICK
    steps = np.repeat(rng.uniform(-1.0, 1.0, count // 400 + 1), 400)[:count]
    wanted = np.where(t < 9.0, steps, np.sin(rng.uniform(3.0, 4.0) * t) + 0.4 * np.sin(rng.uniform(9.0, 12.0) * t))
    position, torque = np.empty(count), np.empty(count)
    q, v, h = 0.0, 0.0, TICK / FINE
    for k in range(count):
        position[k] = q
        torque[k] = np.clip(14.0 * (wanted[k] - np.round(q / QUANTUM) * QUANTUM), -LIMIT, LIMIT)
        for _ in range(FINE):
            free = v + h * (torque[k] - C * v) / M
            v = float(np.copysign(max(abs(free) - h * dry / M, 0.0), free))
            q += h * v
    times = np.arange(STEP, t[-1] - STEP, STEP)
    times += rng.normal(0.0, JITTER, times.size)
    held = torque[np.floor(times / TICK).astype(int)]
    shown = np.round(np.interp(times, t, position) / QUANTUM) * QUANTUM
    units = {"displacement": "rad", "force": "N·m"}
    return ModelData(times, held[:, None], {"displacement": shown}, None, ("force",), ("displacement",), units)


def known(**effects: dict[str, float]) -> Model:
    return Model.from_dict(JOINT | {"effects": effects})


@pytest.mark.limit(UNKNOWN)
def test_friction_is_named_where_the_torque_acts_sooner_or_later_than_its_log_tells():
    found = diagnose(known(), logged(1, 0.1), logged(2, 0.1))
    assert found.verdict == "missing"
    assert found.ladder[-1].effects == ("coulomb_friction",)
    assert found.parameters["coulomb_friction.mu"].value == pytest.approx(0.1, rel=0.05)


@pytest.mark.limit(UNKNOWN)
def test_a_right_model_lacks_nothing_but_when_the_torque_acts():
    found = diagnose(known(coulomb_friction={"mu": 0.11}), logged(3, 0.1), logged(4, 0.1))
    assert found.verdict == "adequate"
