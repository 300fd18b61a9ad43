"""Arms in the nodes, without processes: parameters, joints by name, names in the order of A and B."""

import json
import math
from pathlib import Path

import numpy as np
import pytest

from signlin_ros.errors import InputError
from signlin_ros.model import Model
from signlin_ros.nodes import overrides
from signlin_ros.nodes.joint import measured_states
from signlin_ros.nodes.linearizer_logic import LinearizerLogic
from signlin_ros.nodes.told import Refusal

pytest.importorskip("rclpy")

SMALL = Path(__file__).parents[2] / "config/arm/small_arm.yaml"
MODEL = Model.load(SMALL)
SECOND = 1_000_000_000


def flat(model):
    return {name: entry.value for name, entry in overrides.entries_of(model).items()}


def test_the_parameters_of_a_node_are_the_model_file():
    values = flat(MODEL)
    assert values["elbow.effects.coulomb_friction.mu"] == 0.6
    assert values["elbow.parameters.motor_inertia"] == 0.03
    assert values["joints"] == ["waist", "shoulder", "elbow"]
    arguments = ["--ros-args", "--params-file", str(SMALL)]
    again = overrides.model_of(values, arguments)
    assert again.to_dict() == MODEL.to_dict()


def test_friction_of_a_joint_changes_while_a_node_runs():
    new = overrides.changed(MODEL, {"elbow.effects.coulomb_friction.mu": 0.9, "update_period": 0.05})
    assert (new.value("elbow.coulomb_friction.mu"), new.update_period) == (0.9, 0.05)
    with pytest.raises(InputError, match="found -1"):
        overrides.changed(MODEL, {"elbow.effects.coulomb_friction.mu": -1.0})


def message(names, positions, velocities, efforts=()):
    from sensor_msgs.msg import JointState

    return JointState(name=list(names), position=list(positions), velocity=list(velocities), effort=list(efforts))


def test_joints_are_found_by_name_whatever_their_order():
    from signlin_ros.nodes.convert import read_joints

    joints = ("waist", "shoulder", "elbow")
    found = read_joints(message(("elbow", "gripper", "waist", "shoulder"), (3, 9, 1, 2), (6, 9, 4, 5)), joints)
    shown = measured_states(MODEL, found)
    assert [shown[name] for name in MODEL.states] == [1, 2, 3, 4, 5, 6]


@pytest.mark.parametrize(
    ("names", "positions", "velocities", "said"),
    [
        (("waist", "shoulder"), (1, 2), (1, 2), "no joint 'elbow'"),
        (("waist", "shoulder", "elbow"), (1, 2, math.nan), (1, 2, 3), "no position of joint 'elbow'"),
        (("waist", "shoulder", "elbow"), (1, 2, 3), (), "no velocity of joint 'waist'"),
        (("waist", "shoulder", "elbow"), (1, math.inf, 3), (1, 2, 3), "shoulder: position is not finite"),
    ],
)
def test_a_joint_that_is_missing_is_named(names, positions, velocities, said):
    from signlin_ros.nodes.convert import read_joints

    found = read_joints(message(names, positions, velocities), ("waist", "shoulder", "elbow"))
    assert isinstance(found, Refusal)
    assert said in found.detail


def test_a_whole_arm_is_linearized_every_period():
    logic = LinearizerLogic(MODEL, 0)
    shown = dict(zip(MODEL.states, np.linspace(-0.5, 0.5, 6), strict=True))
    logic.take_measured(shown, SECOND, SECOND)
    (update,) = logic.updates(SECOND + logic.period)
    r = update.result
    assert r.A.shape == (6, 6)
    assert r.B.shape == (6, 3)
    assert np.allclose(r.A @ r.x + r.B @ r.u + r.c, r.f)


def test_the_names_are_those_of_the_rows_of_a():
    from signlin_ros.nodes.linearizer import names_text

    said = json.loads(names_text(MODEL))
    assert said == {"states": list(MODEL.states), "inputs": list(MODEL.inputs)}


def test_a_simulated_arm_publishes_all_its_joints():
    from signlin_ros.nodes.convert import joints_state, read_joints

    values = dict(zip((*MODEL.states, *MODEL.inputs), range(9), strict=True))
    joints = [name.removesuffix(".effort") for name in MODEL.inputs]
    assert read_joints(joints_state(values, joints, 5 * SECOND), joints) == values
