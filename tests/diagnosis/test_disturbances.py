"""What is in a record beside the motion that the input makes: a sensor that drifts."""

from __future__ import annotations

import numpy as np

from signlin_ros.diagnosis import diagnose
from signlin_ros.model import Model
from signlin_ros.records import ModelData
from tests.diagnosis.test_traps import proposed

M, C, FORCE, SENSOR, STEP = 2.0, 3.0, 4.0, 2e-4, 0.005
STAGE = Model.from_dict({"plant": "mass_spring_damper", "parameters": {"m": M, "c": C, "k": 0.0}})


def sliding(seed: int, drift: np.ndarray) -> ModelData:
    """Return a record of a stage whose sensor drifts (T,)."""
    rng, count = np.random.default_rng(seed), drift.size
    u = np.repeat(rng.uniform(-FORCE, FORCE, count // 60 + 1), 60)[:count]
    decay = np.exp(-C / M * STEP)
    q, v = np.zeros(count), 0.0
    for k in range(count - 1):
        end = u[k] / C
        q[k + 1] = q[k] + end * STEP + (v - end) * (1.0 - decay) * M / C
        v = end + (v - end) * decay
    shown = q + rng.normal(0.0, SENSOR, count) + drift
    t, units = STEP * np.arange(count), {"displacement": "m", "force": "N"}
    return ModelData(t, u[:, None], {"displacement": shown}, None, ("force",), ("displacement",), units)


def lasting(seed: int, time: float, count: int = 3000) -> np.ndarray:
    """Return a drift of size 1 with a correlation time in s."""
    rng, rho = np.random.default_rng(seed), np.exp(-STEP / time)
    force = rng.normal(size=count)
    for k in range(1, count):
        force[k] = rho * force[k - 1] + np.sqrt(1.0 - rho**2) * force[k]
    return force


def test_a_drift_that_the_record_holds_often_enough_is_noise():
    """A tenth of a second, and white noise of the sensor beside it."""
    drift = [30 * SENSOR * lasting(seed, 0.15) for seed in (1, 2)]
    assert diagnose(STAGE, *(sliding(seed, one) for seed, one in enumerate(drift))).verdict == "adequate"


def test_what_is_missing_is_found_beside_a_drift():
    bare = Model.from_dict({"plant": "mass_spring_damper", "parameters": {"m": M, "c": 0.4 * C, "k": 0.0}})
    drift = [30 * SENSOR * lasting(seed, 0.15) for seed in (1, 2)]
    d = diagnose(bare, *(sliding(seed, one) for seed, one in enumerate(drift)))
    assert d.verdict == "missing"
    assert proposed(d) == {"viscous_friction"}
