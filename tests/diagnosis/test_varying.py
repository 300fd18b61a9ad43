"""Friction that varies along the way has no name in the list."""

from __future__ import annotations

import numpy as np
import pytest

from signlin_ros.diagnosis import diagnose
from signlin_ros.model import Model
from signlin_ros.records import ModelData

M, C, FORCE, STEP, FINE, COUNT = 2.0, 3.0, 12.0, 0.005, 10, 2400
VISCOUS, WAVE = 2.0, 0.25
"""Friction that varies between nothing and twice as much, N·s/m; length of its wave, m."""
STAGE = Model.from_dict({"plant": "mass_spring_damper", "parameters": {"m": M, "c": C, "k": 0.0}})


def slid(seed: int) -> ModelData:
    """Return a record of a stage with viscous friction that varies along the way; integrated with tiny steps."""
    rng, dt = np.random.default_rng(seed), STEP / FINE
    t = STEP * np.arange(COUNT)
    tones = 2 * np.pi * rng.uniform(0.1, 1.2, 6)
    u = FORCE / 3 * np.sin(tones * t[:, None] + rng.uniform(0, 6, 6)).sum(axis=1)
    shown, q, v = np.zeros((COUNT, 2)), 0.0, 0.0
    for k in range(COUNT):
        shown[k] = q, v
        for _ in range(FINE):
            along = np.sin(2 * np.pi * q / WAVE + 1.0)
            v += dt * (u[k] - (C + VISCOUS * (1.0 + along)) * v) / M
            q += dt * v
    shown += 0.01 * shown.std(axis=0) * rng.normal(size=shown.shape)
    measured, units = {"displacement": shown[:, 0], "velocity": shown[:, 1]}, {"displacement": "m", "force": "N"}
    return ModelData(t, u[:, None], measured, None, ("force",), ("displacement", "velocity"), units)


@pytest.mark.long
def test_waves_of_viscous_friction_are_no_listed_effect():
    d = diagnose(STAGE, slid(1), slid(2))
    assert d.verdict == "unexplained"
