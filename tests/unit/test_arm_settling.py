"""Dry friction that sets in over a distance after a reversal is told, and makes no law of what it leaves."""

import numpy as np
import pytest

from signlin_ros.arms.data import ArmRun
from signlin_ros.arms.notes import settling_notes
from signlin_ros.arms.piece import ArmSegment
from signlin_ros.arms.told import effects_named
from signlin_ros.arms.verbs import compare, diagnose
from tests.arm_records import record, small

MODEL, ELBOW, LENGTH, MU, BAND = small(), 2, 0.02, 2.0, 4.0


def dahl(q, length):
    """Return the state of friction (T,) that sets in exponentially with distance, step by step."""
    state = np.zeros(q.size)
    for k, step in enumerate(np.diff(q)):
        state[k + 1] = np.sign(step) + (state[k] - np.sign(step)) * np.exp(-abs(step) / length)
    return state


def run(seed, length):
    """Return a record of the small arm, whose elbow rubs more than its file says, at once or over a length."""
    t, q, v, u = record(MODEL, seed)
    u[:, ELBOW] += MU * (dahl(q[:, ELBOW], length) if length else np.tanh(v[:, ELBOW] / 2e-3))
    return ArmRun(t, q, v, u, "simulated", np.zeros(q.shape[1]))


@pytest.mark.slow
def test_friction_that_sets_in_over_a_distance_is_told_and_explained_by_no_law():
    known, unseen = run(51, LENGTH), run(52, LENGTH)
    found = diagnose(MODEL, [known], [unseen], BAND)
    study = found.comparison.study
    assert np.flatnonzero(study.settling).tolist() == [ELBOW]
    assert study.settling[ELBOW] == pytest.approx(LENGTH, rel=0.6)
    (said,) = settling_notes(study)
    assert f"{study.names[ELBOW]} over 0.0" in said
    assert effects_named(found) == {}
    # what everybody fits is as right as it was before the reversals
    assert found.comparison.basic[f"{ELBOW}.coulomb_friction.mu"] == pytest.approx(MU + 0.6, rel=0.05)


def test_friction_that_is_there_at_once_keeps_its_rows():
    known, unseen = run(53, 0.0), run(54, 0.0)
    study = compare(MODEL, [known], [unseen], BAND).study
    assert study.settling is None
    assert settling_notes(study) == []


def test_the_way_since_a_reversal_is_measured_from_the_farthest_point():
    t = np.arange(0.0, 8.0, 0.01)
    q = np.stack([np.cos(t), 0.0 * t + 0.1 * t, np.zeros(t.size)], axis=1)
    v = np.stack([-np.sin(t), 0.0 * t + 0.1, np.zeros(t.size)], axis=1)
    piece = ArmSegment(MODEL.robot, MODEL.arm_plant.places, ArmRun(t, q, v, 0.0 * q, "made", np.zeros(3)), BAND)
    at = np.arange(piece.q.shape[0]) * piece.step
    inner = (at > 3.3) & (at < 6.0)  # between the turns at pi and at 2 pi
    assert piece.travelled(0)[inner] == pytest.approx(np.cos(at[inner]) + 1.0, abs=2e-3)
    assert piece.travelled(1)[inner] == pytest.approx(0.1 * at[inner], abs=2e-3)
    assert (piece.travelled(2) == 0.0).all()
