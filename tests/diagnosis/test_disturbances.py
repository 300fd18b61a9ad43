"""What is in a record beside the motion that the input makes: sensors that drift, loads nobody recorded, vibration."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.hidden.generator import draw, write
from signlin_ros.diagnosis import diagnose
from signlin_ros.model import Model
from signlin_ros.records import ModelData
from tests.diagnosis.test_hidden_effects import records
from tests.diagnosis.test_traps import proposed

M, C, FORCE, SENSOR, STEP = 2.0, 3.0, 4.0, 2e-4, 0.005
STAGE = Model.from_dict({"plant": "mass_spring_damper", "parameters": {"m": M, "c": C, "k": 0.0}})


def sliding(seed: int, drift: np.ndarray, beside: np.ndarray | None = None) -> ModelData:
    """Return a record of a stage whose sensor drifts (T,); a force ``beside`` the input, N (T,), acts on it too."""
    rng, count = np.random.default_rng(seed), drift.size
    acting = np.zeros(count) if beside is None else beside
    u = np.repeat(rng.uniform(-FORCE, FORCE, count // 60 + 1), 60)[:count]
    decay = np.exp(-C / M * STEP)
    q, v = np.zeros(count), 0.0
    for k in range(count - 1):
        end = (u[k] + acting[k]) / C
        q[k + 1] = q[k] + end * STEP + (v - end) * (1.0 - decay) * M / C
        v = end + (v - end) * decay
    shown = q + rng.normal(0.0, SENSOR, count) + drift
    t, units = STEP * np.arange(count), {"displacement": "m", "force": "N"}
    return ModelData(t, u[:, None], {"displacement": shown}, None, ("force",), ("displacement",), units)


def lasting(seed: int, time: float, count: int = 1500) -> np.ndarray:
    """Return a drift or a force of size 1 with a correlation time in s."""
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


@pytest.mark.long
def test_a_load_that_comes_and_goes_is_told_as_one():
    d = diagnose(STAGE, *(sliding(seed, np.zeros(3000), 0.25 * lasting(seed, 0.1, 3000)) for seed in (0, 1)))
    assert d.verdict == "unexplained"


@pytest.mark.long
@pytest.mark.parametrize(("index", "seed"), [(6, 42), (18, 83)])
def test_vibration_is_no_load_on_a_spring(tmp_path, index, seed):
    """A load that swings on and on, undamped, in a play of nothing, or since before the record, makes a force that goes
    with the time.
    """
    record = draw("outside", index, seed)
    assert record.truth["laws"] == ["vibration"]
    d = diagnose(*records(write(record, tmp_path / "record")))
    assert d.verdict == "unexplained"
    assert not proposed(d) & {"backlash", "compliant_load"}


@pytest.mark.long
def test_what_unseen_data_do_not_show_is_not_explained_there(tmp_path):
    """A ripple that wanders along the shaft looks like cogging in one record, and hardly acts in the other."""
    record = draw("outside", 8, 42)
    assert record.truth["laws"] == ["wandering_ripple"]
    assert diagnose(*records(write(record, tmp_path / "record"))).verdict == "unexplained"
