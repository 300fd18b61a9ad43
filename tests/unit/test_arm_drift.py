"""Friction that changes within a record: told, and neither taken for a law nor in the way of one."""

import numpy as np
import pytest

from signlin_ros.arms.data import ArmRun
from signlin_ros.arms.drift import Drift
from signlin_ros.arms.notes import drift_notes
from signlin_ros.arms.told import diagnosed_json
from signlin_ros.arms.verbs import diagnose
from tests.arm_records import record, small

MODEL, BAND, FALL = small(), 6.0, 0.2


def run(source, seed, fall, kappa=0.0):
    """Return a record over which all friction falls by a part of what it is in the middle."""
    truth = MODEL.with_effect("shoulder.load_dependent_friction", kappa_d=0.0, kappa_e=kappa)
    smooth = MODEL.with_parameters(
        {f"{key}.{name}": 0.0 for key in MODEL.effects for name in ("mu", "b") if name in MODEL.effects[key].parameters}
    )
    (t, q, v, u), (_, _, _, body) = record(truth, seed), record(smooth, seed)
    changing = (u - body) * fall * (0.5 - t / t[-1])[:, None]
    return ArmRun(t, q, v, u + changing, source, np.zeros(q.shape[1]))


@pytest.mark.parametrize("kappa", [0.0, 0.12])
def test_friction_that_falls_within_records_is_told_beside_laws(kappa):
    found = diagnose(MODEL, [run("a.csv", 31, FALL, kappa)], [run("b.csv", 32, FALL, kappa)], BAND)
    told = dict(found.comparison.study.drift.told())
    assert set(told) == set(range(MODEL.robot.n))
    for change in told.values():
        assert change == pytest.approx(-FALL, abs=0.03)
    note = next(note for note in diagnosed_json(found, "", "", [])["notes"] if "changes within" in note)
    assert "shoulder falls by" in note
    named = [(law.key.at, law.key.law) for law in found.found]
    assert named == ([(1, "load_dependent_friction")] if kappa else [])


def test_friction_that_stays_has_no_change():
    found = diagnose(MODEL, [run("a.csv", 31, 0.0)], [run("b.csv", 32, 0.0)], BAND)
    study = found.comparison.study
    assert study.drift.size == 0.0
    assert drift_notes(study) == []
    assert not any(name.endswith(".change") for name in found.estimate.design.names)


def test_a_record_that_tells_nothing_of_a_joint_does_not_count():
    changes, errors = np.array([[0.1, 5.0], [0.01, 0.01]]), np.array([[0.01, np.inf], [0.01, 0.01]])
    ((joint, told),) = Drift(("a", "b"), changes, errors).told()
    assert joint == 0
    np.testing.assert_allclose(told, [0.1, np.nan])
