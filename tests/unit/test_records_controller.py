"""Bags of a trajectory controller of ros2_control: its reference is a servo's goal position."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from signlin_ros import compare
from signlin_ros.errors import RecordError
from signlin_ros.model import Model
from signlin_ros.records import read_for_model, read_record
from signlin_ros.simulation import simulate

KIND, TOPIC = "control_msgs/msg/JointTrajectoryControllerState", "/arm_controller/controller_state"
JAZZY = ("reference", "feedback", "error", "output")
HUMBLE = (*JAZZY, "desired", "actual")
STEP = 10_000_000


def typestore(names: tuple[str, ...], last: str) -> Any:
    """Return the types of a distribution: parts of the message, and what ends it."""
    store = get_typestore(Stores.ROS2_JAZZY)
    points = [f"trajectory_msgs/JointTrajectoryPoint {name}" for name in names]
    dofs = [f"trajectory_msgs/MultiDOFJointTrajectoryPoint multi_dof_{name}" for name in names]
    lines = ["std_msgs/Header header", "string[] joint_names", *points, "string[] multi_dof_joint_names", *dofs]
    store.register(get_types_from_msg("\n".join([*lines, last]), KIND))
    return store


def written(path: Path, store: Any, names: tuple[str, ...], joints: dict[str, tuple[Any, ...]], plugin: Any) -> Path:
    """Write goals and positions (T,) of some joints as a controller publishes them, every 10 ms; velocities where a
    joint has them.
    """
    types = store.types
    point, dof = (types[f"trajectory_msgs/msg/{n}JointTrajectoryPoint"] for n in ("", "MultiDOF"))
    stamp, duration = types["builtin_interfaces/msg/Time"], types["builtin_interfaces/msg/Duration"]

    def one(positions: list[float], velocities: list[float]) -> Any:
        none = np.zeros(0)
        rest = {"accelerations": none, "effort": none, "time_from_start": duration(sec=0, nanosec=0)}
        return point(positions=np.array(positions), velocities=np.array(velocities), **rest)

    with Writer(path, version=9, storage_plugin=plugin) as writer:
        connection = writer.add_connection(TOPIC, KIND, typestore=store)
        for k in range(len(next(iter(joints.values()))[0])):
            goal, q = ([float(rows[i][k]) for rows in joints.values()] for i in (0, 1))
            v = [float(rows[2][k]) for rows in joints.values() if len(rows) > 2]
            parts = {"reference": one(goal, []), "feedback": one(q, v), "error": one([], []), "output": one([], [])}
            parts |= {n: one([], []) for n in names if n not in parts}
            sec, nanosec = divmod(k * STEP, 1_000_000_000)
            header = types["std_msgs/msg/Header"](stamp=stamp(sec=sec, nanosec=nanosec), frame_id="")
            empty = dof(transforms=[], velocities=[], accelerations=[], time_from_start=duration(sec=0, nanosec=0))
            dofs = {f"multi_dof_{n}": empty for n in names}
            more = {"speed_scaling_factor": 1.0} if len(names) == len(JAZZY) else {}
            message = types[KIND](
                header=header, joint_names=list(joints), **parts, multi_dof_joint_names=[], **dofs, **more
            )
            writer.write(connection, k * STEP, store.serialize_cdr(message, KIND))
    return path


@pytest.fixture(scope="module")
def moved() -> tuple[Any, ...]:
    model = Model.load("xl330_servo")
    t = np.arange(0.0, 3.0, 0.01)
    goal = 0.8 * np.sin(2.0 * t)
    u = np.column_stack([goal, *(np.full(t.size, 1.0 if n == "torque_enable" else 7.4) for n in model.inputs[1:])])
    run = simulate(model, t, u, np.zeros(len(model.states)))
    return goal, run["position"], run["speed"]


def test_a_servo_is_compared_with_its_controllers_bag(tmp_path: Path, moved: tuple[Any, ...]) -> None:
    store = typestore(JAZZY, "float64 speed_scaling_factor")
    path = written(tmp_path / "bag", store, JAZZY, {"elbow": moved}, StoragePlugin.MCAP)
    data = read_for_model(path, Model.load("xl330_servo"))
    np.testing.assert_allclose(data.u[:, 0], moved[0])
    np.testing.assert_allclose(data.measured["position"], moved[1])
    np.testing.assert_allclose(data.measured["speed"], moved[2])
    found = compare("xl330_servo", path)
    free = found.channels["position"].free_run
    assert free is not None
    assert free.rmse < 1e-3


def test_a_bag_of_humble_holds_no_types(tmp_path: Path, moved: tuple[Any, ...]) -> None:
    import sqlite3

    path = written(tmp_path / "bag", typestore(HUMBLE, ""), HUMBLE, {"elbow": moved[:2]}, StoragePlugin.SQLITE3)
    with sqlite3.connect(next(path.glob("*.db3"))) as base:
        base.execute("DELETE FROM message_definitions")
    base.close()
    data = read_for_model(path, Model.load("xl330_servo"))
    np.testing.assert_allclose(data.u[:, 0], moved[0])
    np.testing.assert_allclose(data.measured["position"], moved[1])


def test_of_several_joints_one_is_named(tmp_path: Path, moved: tuple[Any, ...]) -> None:
    store = typestore(JAZZY, "float64 speed_scaling_factor")
    still = tuple(0.0 * column for column in moved)
    path = written(tmp_path / "bag", store, JAZZY, {"elbow": moved, "wrist": still}, StoragePlugin.MCAP)
    assert f"{TOPIC}.reference.positions[wrist]" in read_record(path).signals
    with pytest.raises(RecordError, match=r"reference\.positions\[elbow\]"):
        read_for_model(path, Model.load("xl330_servo"))
    names = {"goal_position": "reference.positions", "position": "feedback.positions"}
    signals = {name: f"{TOPIC}.{what}[elbow]" for name, what in names.items()}
    data = read_for_model(path, Model.load("xl330_servo"), signals)
    np.testing.assert_allclose(data.measured["position"], moved[1])
