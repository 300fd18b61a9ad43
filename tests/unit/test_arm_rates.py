"""Velocities that are recorded later than positions: told, and taken at one time; efforts as late as they say."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from signlin_ros.arms.check import check
from signlin_ros.arms.data import read_data, runs_of, sides
from signlin_ros.arms.notes import lag_notes
from signlin_ros.arms.rates import Lags, lags_of
from signlin_ros.arms.told import verdict
from signlin_ros.arms.verbs import compare, diagnose
from tests.arm_records import STEP, record, small, written

MODEL, BAND, LATE, TRIP = small(), 6.0, 0.06, 0.02
NAMES = MODEL.robot.names


def late(values, by):
    """Return columns (T, n) through a filter of the first order, which is late by its time constant."""
    k = np.exp(-STEP / by)
    return np.stack([c[0] + lfilter([1.0 - k], [1.0, -k], c - c[0]) for c in values.T], axis=1)


def _late_again(runs):
    """Return runs with their velocities as they were recorded, of which no lag is known."""
    return [replace(run, v=run.shown, lags=None) for run in runs]


def read(path, seed, by=0.0, effort=0.0):
    """Return a record of the small arm whose velocities, and efforts, are late."""
    t, q, v, u = record(MODEL, seed)
    v, u = late(v, by) if by else v, late(u, effort) if effort else u
    return read_data(MODEL, [written(path, NAMES, t, q, v, u)], {})


def test_a_lag_is_told_joint_by_joint_and_a_jump_does_not_spoil_it():
    _, q, v, _ = record(MODEL, 1)
    slow = late(v, LATE)
    assert lags_of(q, slow, STEP).seconds == pytest.approx(np.full(3, LATE), abs=0.008)
    jumping = q.copy()
    jumping[1200:, 1] += 0.4
    assert lags_of(jumping, slow, STEP).seconds[1] == pytest.approx(LATE, abs=0.012)
    assert (np.abs(lags_of(q, v, STEP).seconds) < 0.2 * STEP).all()
    assert not lags_of(q, v[:, ::-1], STEP).seconds.any()  # those of other joints are not late
    assert not lags_of(q, -slow, STEP).seconds.any()
    assert not lags_of(q, 57.3 * slow, STEP).seconds.any()


@pytest.mark.parametrize("lag", [0.05, -0.05])
def test_of_position_and_velocity_the_late_one_is_moved(lag):
    t = np.arange(0.0, 8.0, STEP)
    q, v = np.sin(t)[:, None], np.cos(t - lag)[:, None]
    rows = slice(20, -20)
    moved = Lags(np.array([lag]), np.zeros((1, 2))).in_one_time(q, v, STEP)
    at = t if lag > 0.0 else t - lag
    np.testing.assert_allclose(moved[0][rows, 0], np.sin(at)[rows], atol=1e-6)
    np.testing.assert_allclose(moved[1][rows, 0], np.cos(at)[rows], atol=1e-6)


def test_check_and_notes_tell_a_lag(tmp_path):
    (data,) = read(tmp_path / "late.csv", 2, by=LATE)
    _, found = check(MODEL, [data])
    (told,) = [f for f in found if f.check == "late_motion"]
    assert told.severity == "note"
    assert "of 3 of 3 joints velocity is recorded later than position, by 0.0" in told.sentence
    (clean,) = read(tmp_path / "clean.csv", 2)
    assert "late_motion" not in [f.check for f in check(MODEL, [clean])[1]]
    (run,) = runs_of(MODEL, clean)
    assert (np.abs(run.lags) < 0.2 * STEP).all()


@pytest.mark.slow
@pytest.mark.parametrize("effort", [0.0, TRIP])
def test_filtered_velocities_and_efforts_cost_little(effort, tmp_path):
    """What drives filter is no law of the arm; efforts are put in time with positions as late as they are."""
    clean = compare(MODEL, *sides(MODEL, read(tmp_path / "clean.csv", 3), []), BAND)
    found = diagnose(MODEL, *sides(MODEL, read(tmp_path / "late.csv", 3, by=LATE, effort=effort), []), BAND)
    assert verdict(found) == "adequate"
    assert found.found == ()
    (note,) = lag_notes(found.comparison.study)
    assert "velocity is recorded later than position" in note
    late_by = found.comparison.study.runs[0][0].late
    assert late_by == pytest.approx(effort, abs=0.006)
    blunt = np.linalg.norm(compare(MODEL, *(_late_again(runs) for runs in found.comparison.study.runs), BAND).basic.rms)
    own = np.linalg.norm(found.comparison.table.model)
    assert np.linalg.norm(clean.table.basic) < own < 0.2 * blunt
