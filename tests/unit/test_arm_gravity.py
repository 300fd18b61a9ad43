"""A base that stands otherwise than the file says: gravity is turned, keeps its size, and all else is said of that."""

import numpy as np
import pytest

from signlin_ros.arms.data import ArmRun, read_data
from signlin_ros.arms.gravity import turned
from signlin_ros.arms.laws import across_gravity
from signlin_ros.arms.notes import study_notes
from signlin_ros.arms.verbs import compare, diagnose
from signlin_ros.errors import RecordError
from signlin_ros.model import Model
from tests.arm_records import record, small

MODEL, BAND, ANGLE = small(), 6.0, np.radians(14.0)
N = MODEL.robot.n
GRAVITY = 9.81 * np.array([np.sin(ANGLE), 0.0, -np.cos(ANGLE)])


def on_a_slope(seed):
    """Return a run of the small arm on a base that stands on a slope."""
    content = {**MODEL.to_dict(), "robot": str(MODEL.folder / MODEL.arm.robot), "gravity": GRAVITY.tolist()}
    return ArmRun(*record(Model.from_dict(content), seed), f"{seed}.csv", np.zeros(N))


@pytest.mark.parametrize("tilt", [(0.0, 0.0), (0.3, -0.1), (-1.0, 2.0)])
def test_gravity_is_turned_and_keeps_its_size(tilt):
    across, _ = across_gravity(MODEL.robot)
    found, own = turned(MODEL.robot, np.array(tilt)), MODEL.robot.gravity
    assert np.linalg.norm(found) == pytest.approx(np.linalg.norm(own))
    np.testing.assert_allclose(across @ found / (own @ found) * np.linalg.norm(own), tilt, atol=1e-12)


@pytest.mark.slow
def test_a_slope_is_told_and_nothing_else_is_said_of_it():
    known, unseen = on_a_slope(31), on_a_slope(32)
    found = diagnose(MODEL, [known], [unseen], BAND)
    assert [law.key.law for law in found.found] == ["tilt"]
    gravity = found.proposal.model.robot.gravity
    assert np.linalg.norm(gravity) == pytest.approx(np.linalg.norm(MODEL.robot.gravity))
    off = np.degrees(np.arccos(gravity @ GRAVITY / np.linalg.norm(gravity) / np.linalg.norm(GRAVITY)))
    assert off < 0.05 * np.degrees(ANGLE)
    assert np.hypot(*found.found[0].values) == pytest.approx(np.tan(ANGLE), rel=0.05)
    assert found.witnesses[0].says == "confirmed"
    assert not any("payload" in note for note in study_notes(found.comparison.study))
    # what is written is as good as the file of an arm that stands upright
    upright = [ArmRun(*record(MODEL, seed), f"{seed}.csv", np.zeros(N)) for seed in (31, 32)]
    clean = compare(MODEL, upright[:1], upright[1:], BAND)
    assert (found.comparison.table.model < 1.1 * clean.table.basic).all()


def test_goals_without_efforts_are_told_so(tmp_path):
    t = np.arange(0.0, 4.0, 0.01)
    names = [f"{n}.{what}" for what in ("position", "goal_position") for n in MODEL.robot.names]
    head = ",".join(["t [s]", *names])
    path = tmp_path / "goals.csv"
    np.savetxt(path, np.column_stack([t, *[np.sin(t)] * (2 * N)]), delimiter=",", header=head, comments="")
    with pytest.raises(RecordError, match=r"without efforts .torques, currents. nothing is told of an arm"):
        read_data(MODEL, [str(path)], {})


def test_the_gain_of_a_motor_that_turns_two_joints_is_its_ratio(tmp_path):
    names = MODEL.robot.names
    couplings = {"belt": {"joints": list(names[1:]), "position": [45, 0, 32, 32], "effort": "motor"}}
    content = {**MODEL.to_dict(), "robot": str(MODEL.folder / MODEL.arm.robot), "couplings": couplings}
    t = np.arange(0.0, 4.0, 0.01)
    units = {"position": "rad", "effort": "A"}
    head = ",".join(["t [s]", *(f"{n}.{what} [{unit}]" for n in names for what, unit in units.items())])
    path = tmp_path / "amperes.csv"
    np.savetxt(path, np.column_stack([t, *[np.sin(t)] * (2 * N)]), delimiter=",", header=head, comments="")
    content = {**content, names[0]: {**content.get(names[0], {}), "effort": {"gain": 2.0, "unit": "A"}}}
    with pytest.raises(RecordError, match=rf"{names[1]}: {{effort: {{gain: 45}}}}"):
        read_data(Model.from_dict(content), [str(path)], {})
