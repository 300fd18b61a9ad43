"""What moves a machine beside its input: noise in that, loads that nobody recorded, vibration of what it stands on."""

from __future__ import annotations

import re

import numpy as np
import pytest
from signlin_ros.diagnosis.disturbance import Disturbance, disturbance
from signlin_ros.diagnosis.findings import mere_noise
from signlin_ros.diagnosis.verdict import diagnose

from benchmarks.hidden.generator import draw, write
from signlin_ros.diagnosis.fit import candidate, fit
from signlin_ros.diagnosis.problem import Problem, prepare
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


def found(record: ModelData) -> tuple[Problem, Disturbance]:
    problem = prepare(STAGE, [record])
    f = fit(problem, candidate(problem, problem.base, ()), problem.levels[0], None, 10)
    assert f is not None
    return problem, disturbance(problem, f, problem.noise, np.zeros(1))


@pytest.mark.parametrize("seed", range(4))
def test_noise_in_the_input_is_as_large_as_it_is(seed):
    count = 3000
    noise = np.random.default_rng(100 + seed).normal(0.0, NOISE, count)
    problem, one = found(sliding(seed, np.zeros(count), noise))
    assert one.input == pytest.approx(NOISE, rel=0.15)
    assert one.doubt < 10.0
    assert mere_noise(problem, one)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("time", [0.05, 0.5])
def test_a_force_that_lasts_is_no_noise_in_the_input(seed, time):
    problem, one = found(sliding(seed, 0.8 * lasting(seed, time), np.zeros(3000)))
    assert one.force == pytest.approx(0.8, rel=0.4)
    assert time / 3 < one.lasts < 3 * time
    assert one.lasting > 0.0
    assert not mere_noise(problem, one)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("time", [0.05, 0.5])
def test_a_sensor_that_drifts_is_no_force(seed, time):
    quiet = np.zeros(3000)
    _, drifting = found(sliding(seed, quiet, quiet, 20 * SENSOR * lasting(seed, time)))
    assert drifting.rather > 10.0
    _, pushed = found(sliding(seed, 0.8 * lasting(seed, time), quiet))
    assert pushed.rather < -10.0


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
    assert "noise in the force" in d.sentence


def test_a_force_that_is_another_one_at_every_sample_is_no_missing_load():
    white = np.random.default_rng(8).normal(0.0, 0.4, (2, 3000))
    d = diagnose(STAGE, *(sliding(seed, force, np.zeros(3000)) for seed, force in enumerate(white)))
    assert d.verdict == "adequate"
    assert "noise in the force" in d.sentence


def test_a_load_that_comes_and_goes_is_told_as_one():
    d = diagnose(STAGE, *(sliding(seed, 0.25 * lasting(seed, 0.1), np.zeros(3000)) for seed in (0, 1)))
    assert d.verdict == "unexplained"
    told = re.search(r"a force of about (\S+) N, lasting about (\S+) s at a time, that no simple function", d.sentence)
    assert told
    assert [float(x) for x in told.groups()] == pytest.approx([0.25, 0.1], rel=0.3)


@pytest.mark.parametrize("index", [6, 25, 27])
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
