"""What moves a machine beside its input: noise in that, loads that nobody recorded, vibration of what it stands on."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.hidden.generator import draw, write
from signlin_ros.diagnosis import diagnose
from signlin_ros.model import Model
from signlin_ros.records import ModelData
from tests.diagnosis.test_hidden_effects import records
from tests.diagnosis.test_traps import proposed

M, C, FORCE, NOISE, SENSOR, STEP = 2.0, 3.0, 4.0, 0.2, 2e-4, 0.005
STAGE = Model.from_dict({"plant": "mass_spring_damper", "parameters": {"m": M, "c": C, "k": 0.0}})


def sliding(seed: int, beside: np.ndarray, off: np.ndarray, drift: np.ndarray | float = 0.0) -> ModelData:
    """Return a record of a stage that a force ``beside`` (T,) acts on; that of the drive is recorded with an error, and
    its sensor drifts.
    """
    rng, count = np.random.default_rng(seed), beside.size
    u = np.repeat(rng.uniform(-FORCE, FORCE, count // 60 + 1), 60)[:count]
    decay = np.exp(-C / M * STEP)
    q, v = np.zeros(count), 0.0
    for k in range(count - 1):
        end = (u[k] + beside[k]) / C
        q[k + 1] = q[k] + end * STEP + (v - end) * (1.0 - decay) * M / C
        v = end + (v - end) * decay
    shown = q + rng.normal(0.0, SENSOR, count) + drift
    t, units = STEP * np.arange(count), {"displacement": "m", "force": "N"}
    return ModelData(t, (u + off)[:, None], {"displacement": shown}, None, ("force",), ("displacement",), units)


def lasting(seed: int, time: float, count: int = 3000) -> np.ndarray:
    """Return a force of size 1 with a correlation time in s."""
    rng, rho = np.random.default_rng(seed), np.exp(-STEP / time)
    force = rng.normal(size=count)
    for k in range(1, count):
        force[k] = rho * force[k - 1] + np.sqrt(1.0 - rho**2) * force[k]
    return force


def test_a_drift_that_the_record_holds_often_enough_is_noise():
    """A tenth of a second, and white noise of the sensor beside it; a force lasts as long, and is none."""
    quiet = np.zeros(3000)
    drift = [30 * SENSOR * lasting(seed, 0.15) for seed in (1, 2)]
    assert diagnose(STAGE, *(sliding(seed, quiet, quiet, one) for seed, one in enumerate(drift))).verdict == "adequate"
    force = [0.4 * lasting(seed, 0.15) for seed in (1, 2)]
    d = diagnose(STAGE, *(sliding(seed, one, quiet) for seed, one in enumerate(force)))
    assert d.verdict == "unexplained"


def test_what_is_missing_is_found_beside_a_drift():
    bare = Model.from_dict({"plant": "mass_spring_damper", "parameters": {"m": M, "c": 0.4 * C, "k": 0.0}})
    quiet = np.zeros(3000)
    drift = [30 * SENSOR * lasting(seed, 0.15) for seed in (1, 2)]
    d = diagnose(bare, *(sliding(seed, quiet, quiet, one) for seed, one in enumerate(drift)))
    assert d.verdict == "missing"
    assert proposed(d) == {"viscous_friction"}


def test_noise_of_a_force_that_the_record_shows_is_no_missing_load():
    noise = np.random.default_rng(7).normal(0.0, NOISE, (2, 3000))
    d = diagnose(STAGE, *(sliding(seed, np.zeros(3000), off) for seed, off in enumerate(noise)))
    assert d.verdict == "adequate"


def test_a_load_that_comes_and_goes_is_told_as_one():
    d = diagnose(STAGE, *(sliding(seed, 0.25 * lasting(seed, 0.1), np.zeros(3000)) for seed in (0, 1)))
    assert d.verdict == "unexplained"


@pytest.mark.parametrize("index", [6])
def test_vibration_is_no_load_on_a_spring(tmp_path, index):
    """A load that swings on and on, undamped, or in a play of nothing, makes a force that goes with the time."""
    record = draw("outside", index, 42)
    assert record.truth["laws"] == ["vibration"]
    d = diagnose(*records(write(record, tmp_path / "record")))
    assert d.verdict == "unexplained"
    assert not proposed(d) & {"backlash", "compliant_load"}


def test_what_unseen_data_do_not_show_is_not_explained_there(tmp_path):
    """A ripple that wanders along the shaft looks like cogging in one record, and hardly acts in the other."""
    record = draw("outside", 8, 42)
    assert record.truth["laws"] == ["wandering_ripple"]
    assert diagnose(*records(write(record, tmp_path / "record"))).verdict == "unexplained"
