"""Records of real arms: what they do not tell is not told."""

import os
from pathlib import Path

import pytest

from signlin_ros.arms.data import read_data, sides
from signlin_ros.arms.faults import delays
from signlin_ros.arms.notes import bent
from signlin_ros.arms.told import effects_named, sentences
from signlin_ros.arms.verbs import diagnose
from signlin_ros.model import Model

SHARED = Path(os.environ.get("SIGNLIN_DATA", "../shared/data")) / "joints"
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not SHARED.is_dir(), reason=f"no records at {SHARED} (set SIGNLIN_DATA)"),
]


def read(robot, record, joints):
    """Return a model with nothing but a URDF, and a record in its terms."""
    model = Model.from_dict({"plant": "arm", "robot": str(SHARED / robot), "joints": joints})
    return model, read_data(model, [str(SHARED / record)], {})


@pytest.mark.parametrize("swapped", [False, True], ids=["first half fitted", "second half fitted"])
def test_friction_is_not_told_of_torques_on_the_links_side(swapped):
    """Franka Panda: whichever half is fitted, nothing is named."""
    model, records = read("panda.urdf", "panda_250hz.csv", [f"panda_joint{k}" for k in range(1, 8)])
    halves = sides(model, records, [], 0.5)
    found = diagnose(model, *(reversed(halves) if swapped else halves))
    assert found.found == found.missing == found.couplings == ()
    assert all("measured on the link's side" in line for line in sentences(found)[:-1])
    assert any("say side: link" in note for note in found.comparison.study.notes)
    (note,) = bent(found)
    assert "panda_joint4: the fit asks for a pseudo-inertia" in note
    assert "of panda_joint4's effort are left, and not" in note


def test_currents_of_few_steps_are_refused_and_a_delay_that_explains_nothing_is_none():
    """PAL TIAGo: the wrist's currents have 40 levels. One effort looks 0.7 s early; put in time, it fits worse."""
    joints = ["torso_lift_joint", *(f"arm_{k}_joint" for k in range(1, 8))]
    model, records = read("tiago.urdf", "tiago_100hz.csv", joints)
    found = diagnose(model, *sides(model, records, []))
    told = dict(line.split(": ", 1) for line in sentences(found))
    wrist = joints[5:]
    assert all("refused" in told[name] for name in wrist)
    assert not set(effects_named(found)) & {joints.index(name) for name in wrist}
    assert not delays(found).any()
    (note,) = bent(found)
    assert note.startswith("torso_lift_joint: the fit asks for a motor's inertia of -")
    assert "of torso_lift_joint's effort are left, and not" in note
    table = found.comparison.table
    assert (table.model <= 1.05 * table.basic).all()
