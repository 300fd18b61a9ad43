"""Records of real arms: what they do not tell is not told."""

import os
from pathlib import Path

import numpy as np
import pytest

from signlin_ros.arms.data import read_data, sides
from signlin_ros.arms.faults import delays
from signlin_ros.arms.keys import GAIN, Key
from signlin_ros.arms.notes import bent, lag_notes, unwritten
from signlin_ros.arms.told import effects_named, sentences
from signlin_ros.arms.verbs import diagnose
from signlin_ros.model import Model
from signlin_ros.robots.inertia import TEN, least_eigenvalue

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
    note, relieved = bent(found)
    assert "panda_joint4: the fit asks for a pseudo-inertia" in note
    assert "of panda_joint4's effort are left, and not" in note
    # what holds the links from outside, and the sensor's gain, are told: each half says the same
    assert found.relief is not None
    told = {(key.law, key.at): (value, error) for key, value, error in found.relief.laws}
    for key, size in ((("linear_stiffness", 3), 0.32), (("linear_stiffness", 5), 0.043), (("sensor_gain", 5), 0.1)):
        value, error = told[key]
        assert abs(value - size) < 2.5 * error < value
    assert "in panda_joint4" in relieved
    assert "panda_joint6's effort is 1." in relieved
    # what is written has them; beside that, bodies that exist are better than any bodies without it
    assert found.relief.rms[3] < 0.75 * found.estimate.rms[3]
    assert (found.comparison.table.model == found.relief.rms).all()
    assert np.log(found.relief.rms / found.relief.without).sum() < -1.0
    written, gain = found.proposal.model, 1.0 + told["sensor_gain", 5][0]
    assert written.parameters["panda_joint6.gain"] == pytest.approx(1.0 / gain)
    assert written.effects["panda_joint4.linear_stiffness"].parameters["k"] == pytest.approx(0.3, abs=0.1)
    assert min(least_eigenvalue(body) for body in written.robot.pi.reshape(-1, TEN)) > 0.0


def left_by_bodies(halves, band):
    """Return what is left of the half that no fit saw (7,), by bodies that exist and by any bodies, beside the same
    springs and gain of a sensor.
    """
    model, known, unseen = halves
    beside = diagnose(model, known, unseen, band).relief
    assert beside is not None
    shown = np.ones(7)
    for key, value, _ in (law for law in beside.laws if law[0].law == GAIN):
        shown[key.at] += value
    return beside.rms, beside.estimate.rms * shown


@pytest.mark.parametrize(("band", "most"), [(20.0, 1.02), (3.0, 1.15)])
def test_bodies_that_exist_are_held_against_any_bodies_on_halves_that_no_fit_saw(band, most):
    """Franka Panda: each half is foretold from the other. In the band of the jumps of its friction bodies that exist
    cost 2 % at most; below 3 Hz, of what is left of joint 2, 12 % of 0.1 N·m.
    """
    model, records = read("panda.urdf", "panda_250hz.csv", [f"panda_joint{k}" for k in range(1, 8)])
    first, second = sides(model, records, [], 0.5)
    ways = [left_by_bodies((model, *pair), band) for pair in ((first, second), (second, first))]
    existing, any_ = (np.sqrt(sum(way[k] ** 2 for way in ways)) for k in (0, 1))
    assert (existing < most * any_).all()
    assert (existing - any_ < 0.002 * np.std(first[0].tau, axis=0)).all()


def test_currents_of_few_steps_are_refused_and_a_delay_that_explains_nothing_is_none():
    """PAL TIAGo: the wrist's currents have 40 levels. Velocities are 0.19 s late, and efforts less; in time with the
    positions they need bodies and motors that exist.
    """
    joints = ["torso_lift_joint", *(f"arm_{k}_joint" for k in range(1, 8))]
    model, records = read("tiago.urdf", "tiago_100hz.csv", joints)
    found = diagnose(model, *sides(model, records, []))
    told = dict(line.split(": ", 1) for line in sentences(found))
    wrist = joints[5:]
    assert all("refused" in told[name] for name in wrist)
    assert not set(effects_named(found)) & {joints.index(name) for name in wrist}
    assert not delays(found).any()
    # the lift's effort has nothing of what acts: a screw holds it
    (lift,) = (law for law in found.found if law.key == Key("sensor_gain", 0))
    assert abs(1.0 + lift.values[0]) < 4.0 * lift.errors[0] < 0.3
    assert any("torso_lift_joint: its effort hardly shows what acts" in note for note in unwritten(found))
    assert bent(found) == []
    (note,) = lag_notes(found.comparison.study)
    assert "of 8 of 8 joints velocity is recorded later than position, by 0.19" in note
    assert note.endswith("s late")
    table = found.comparison.table
    assert (table.model <= 1.05 * table.basic)[1:].all()
    assert (table.model <= 1.02 * found.estimate.rms)[1:].all()
