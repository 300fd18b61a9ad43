"""rosbag2 recordings: folders and single files, mcap and sqlite3, several topics with stamps of their own."""

import shutil
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from signlin_ros.errors import RecordError
from signlin_ros.model import Model
from signlin_ros.records import Record, read_for_model, read_record

STORE = get_typestore(Stores.ROS2_JAZZY)
TYPES: Any = STORE.types
ARRAY, NUMBER, JOINTS, ODOMETRY = (
    "std_msgs/msg/Float64MultiArray",
    "std_msgs/msg/Float64",
    "sensor_msgs/msg/JointState",
    "nav_msgs/msg/Odometry",
)
MS = 1_000_000
Messages = list[tuple[str, int, Any]]


def array(values: Iterable[float], label: str = "") -> Any:
    data = np.array(list(values), dtype=np.float64)
    dim = [TYPES["std_msgs/msg/MultiArrayDimension"](label=label, size=data.size, stride=data.size)] if label else []
    return TYPES[ARRAY](layout=TYPES["std_msgs/msg/MultiArrayLayout"](dim=dim, data_offset=0), data=data)


def number(value: float) -> Any:
    return TYPES[NUMBER](data=value)


def header(stamp: int) -> Any:
    sec, nanosec = divmod(stamp, 1_000_000_000)
    return TYPES["std_msgs/msg/Header"](
        stamp=TYPES["builtin_interfaces/msg/Time"](sec=sec, nanosec=nanosec), frame_id=""
    )


def joints(stamp: int, names: list[str], position: Iterable[float] = (), velocity: Iterable[float] = ()) -> Any:
    q, v = (np.array(list(values), dtype=np.float64) for values in (position, velocity))
    return TYPES[JOINTS](header=header(stamp), name=names, position=q, velocity=v, effort=np.zeros(0))


def write_bag(path: Path, messages: Messages, plugin: StoragePlugin = StoragePlugin.MCAP) -> Path:
    with Writer(path, version=9, storage_plugin=plugin) as writer:
        connections: dict[str, Any] = {}
        for topic, stamp, message in messages:
            kind = message.__msgtype__
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=STORE)
            writer.write(connections[topic], stamp, STORE.serialize_cdr(message, kind))
    return path


@pytest.fixture
def bag(tmp_path: Path) -> Callable[[Messages], Path]:
    return lambda messages: write_bag(tmp_path / "bag", messages)


def run(n: int = 20, start: int = 0) -> Messages:
    """A motor's states at 200 Hz and its input at 50 Hz, 1 ms after the state of that time."""
    states = [("/state", start + 5 * i * MS, array((0.1 * i, 10.0 * i))) for i in range(n)]
    inputs = [("/input", start + (20 * i + 1) * MS, array([float(i)])) for i in range(n // 4)]
    return sorted(states + inputs, key=lambda entry: entry[1])


MOTOR = {
    "plant": "dc_motor",
    "parameters": {"R_a": 0.764, "L_a": 0.0026, "K_t": 0.0805, "K_m": 0.0805, "B": 0.0, "J": 0.0022},
}
OSCILLATOR = {"plant": "mass_spring_damper", "parameters": {"m": 1.0, "c": 0.6, "k": 40.0}}


def motor(**more: object) -> Model:
    return Model.from_dict({**MOTOR, **more})


def oscillator(**more: object) -> Model:
    return Model.from_dict({**OSCILLATOR, **more})


@pytest.mark.parametrize("plugin", list(StoragePlugin))
@pytest.mark.parametrize("single", [False, True])
@pytest.mark.parametrize("metadata", [False, True])
def test_storage(tmp_path: Path, plugin: StoragePlugin, single: bool, metadata: bool) -> None:
    path = write_bag(tmp_path / "bag", run(), plugin)
    if not metadata:
        (path / "metadata.yaml").unlink()
    if single:
        path = next(path.glob("bag.*"))
    record = read_record(path)
    assert set(record.signals) == {"/state.data[0]", "/state.data[1]", "/input.data[0]"}
    np.testing.assert_array_equal(record.t, np.arange(20) / 200)
    np.testing.assert_array_equal(record.signals["/state.data[1]"].values, 10.0 * np.arange(20))


def test_sqlite_without_message_definitions(tmp_path: Path) -> None:
    import sqlite3

    path = write_bag(tmp_path / "bag", run(), StoragePlugin.SQLITE3)
    with sqlite3.connect(next(path.glob("*.db3"))) as base:
        base.execute("DELETE FROM message_definitions")
    base.close()
    assert len(read_record(path)) == 20


def test_the_nodes_topics_are_known(bag: Callable[[Messages], Path]) -> None:
    data = read_for_model(bag(run()), motor())
    # The first input comes 1 ms after the first state.
    np.testing.assert_array_equal(data.t, np.arange(1, 20) / 200)
    assert data.acts is not None
    np.testing.assert_array_equal(data.u[:, 0], np.arange(1, 20) // 4)
    np.testing.assert_allclose(data.acts[3::4], data.t[3::4] + 1e-3)
    np.testing.assert_array_equal(data.measured["speed"], 10.0 * np.arange(1, 20))
    assert data.x0 is not None
    np.testing.assert_array_equal(data.x0, [0.1, 10.0])
    assert any("held" in note and "/input" in note for note in data.notes)
    assert any("the inputs' first message" in note for note in data.notes)
    assert not any("interpolated" in note for note in data.notes)


def test_a_shorter_state_is_taken_from_the_front_with_a_note(bag: Callable[[Messages], Path]) -> None:
    data = read_for_model(bag(run()), motor(with_position=True))
    assert list(data.measured) == ["current", "speed"]
    assert data.x0 is None
    assert any("/state has 2 values, the model 3" in note for note in data.notes)


@pytest.mark.parametrize("label", ["", "input", "values"])
def test_labels_that_name_nothing_of_the_model_do_no_harm(bag: Callable[[Messages], Path], label: str) -> None:
    messages = [("/input", 5 * i * MS, array([1.0 * i], label)) for i in range(5)]
    np.testing.assert_array_equal(read_for_model(bag(messages), motor()).u[:, 0], np.arange(5))


def test_labels_name_the_values(bag: Callable[[Messages], Path]) -> None:
    messages = [("/state", 5 * i * MS, array((10.0 * i, 0.1 * i), "speed,current")) for i in range(5)]
    messages += [("/input", 5 * i * MS, array([1.0], "voltage")) for i in range(5)]
    path = bag(sorted(messages, key=lambda entry: entry[1]))
    assert set(read_record(path).signals) == {"speed", "current", "voltage"}
    np.testing.assert_array_equal(read_for_model(path, motor()).measured["speed"], 10.0 * np.arange(5))
    mapped = read_record(path, {"omega": "/state.data[0]"})
    np.testing.assert_array_equal(mapped.signals["omega"].values, 10.0 * np.arange(5))


def test_a_unit_may_stand_behind_a_topic(bag: Callable[[Messages], Path]) -> None:
    signals = {"voltage": "/input.data[0]", "speed": "/state.data[1] [rpm]"}
    path = bag(run())
    plain = read_for_model(path, motor(), {**signals, "speed": "/state.data[1]"})
    data = read_for_model(path, motor(), signals)
    np.testing.assert_allclose(data.measured["speed"], plain.measured["speed"] * np.pi / 30)


def test_mapping(bag: Callable[[Messages], Path]) -> None:
    messages: Messages = []
    for i in range(10):
        messages.append(("/cmd", 10 * i * MS, array((7.0, float(i)))))
        messages.append(
            (
                "/joint_states",
                10 * i * MS,
                joints(10 * i * MS + 1, ["arm", "wheel"], (0.0, 1.0 * i), (0.0, 2.0 * i)),
            )
        )
    path = bag(messages)
    signals = {"voltage": "/cmd.data[1]", "velocity": "/joint_states.velocity[wheel]"}
    by_reading = read_record(path, signals)
    np.testing.assert_array_equal(by_reading.signals["velocity"].values, 2.0 * np.arange(10))
    for data in (read_for_model(path, motor(), signals), read_for_model(path, motor(signals=signals))):
        np.testing.assert_array_equal(data.measured["speed"], 2.0 * np.arange(10))
        np.testing.assert_array_equal(data.u[:, 0], np.arange(10))
    with pytest.raises(
        RecordError,
        match=r"'/joint_states.velocity\[wheal\]'.*did you mean '/joint_states.velocity\[wheel\]'",
    ):
        read_record(path, {"speed": "/joint_states.velocity[wheal]"})
    with pytest.raises(RecordError, match=r"'/joint_states.velocity\[1\]'"):
        read_record(path, {"speed": "/joint_states.velocity[1]"})
    with pytest.raises(RecordError, match=r"'voltage'.*'/cmd.data\[0\]'.*--signal voltage="):
        read_for_model(path, motor())


def test_joints_by_name_in_any_order_and_company(bag: Callable[[Messages], Path]) -> None:
    messages: Messages = []
    for i in range(12):
        stamp = 10 * i * MS
        if i % 3 == 2:
            messages.append(("/joint_states", stamp, joints(stamp, ["gripper"], [9.0])))
        elif i % 3 == 1:
            messages.append(("/joint_states", stamp, joints(stamp, ["b", "a"], [20.0 + i, 10.0 + i])))
        else:
            messages.append(("/joint_states", stamp, joints(stamp, ["a", "b"], [10.0 + i, 20.0 + i])))
    record = read_record(bag(messages))
    seen = [i for i in range(12) if i % 3 != 2]
    series = record.series["/joint_states.position[a]"]
    np.testing.assert_array_equal(series.t, np.array(seen) / 100)
    np.testing.assert_array_equal(series.values, 10.0 + np.array(seen))
    assert "/joint_states.velocity[a]" not in record.signals


def test_a_joint_state_alone_serves_by_aliases(bag: Callable[[Messages], Path]) -> None:
    messages: Messages = []
    for i in range(10):
        messages.append(("/input", 10 * i * MS, array([1.0])))
        velocity = [] if i == 4 else [0.2 * i]
        messages.append(("/joint_states", 10 * i * MS, joints(10 * i * MS + 1, ["slide"], [0.1 * i], velocity)))
    data = read_for_model(bag(messages), oscillator())
    np.testing.assert_array_equal(data.measured["displacement"], 0.1 * np.arange(10))
    assert np.flatnonzero(np.isnan(data.measured["velocity"])).tolist() == [4]


def test_numbers_by_topic_name(bag: Callable[[Messages], Path]) -> None:
    messages: Messages = []
    for i in range(10):
        messages.append(("/voltage", 10 * i * MS, number(float(i))))
        messages.append(("/speed", (10 * i + 5) * MS, number(2.0 * i)))
    data = read_for_model(bag(messages), motor())
    np.testing.assert_array_equal(data.u[:, 0], np.arange(10))
    np.testing.assert_array_equal(data.measured["speed"], 2.0 * np.arange(10))
    np.testing.assert_array_equal(data.t, (10 * np.arange(10) + 5) / 1000)


def test_slower_measurements_are_interpolated_but_not_across_holes(bag: Callable[[Messages], Path]) -> None:
    messages: Messages = [("/input", 0, array([1.0]))]
    for i in range(101):
        messages.append(("/current", 10 * i * MS, number(0.0)))
        if i % 4 == 0 and not 40 <= i <= 60:
            messages.append(("/speed", 10 * i * MS, number(float(i))))
    path = bag(messages)
    data = read_for_model(path, motor())
    speed = data.measured["speed"]
    there = ~np.isnan(speed)
    np.testing.assert_allclose(speed[there], np.arange(101.0)[there], atol=1e-12)
    assert np.flatnonzero(~there).tolist() == list(range(37, 64))
    assert any("interpolated linearly" in note and "speed" in note for note in data.notes)
    np.testing.assert_array_equal(data.u[:, 0], 1.0)
    slow = read_for_model(path, motor(), base="/speed")
    np.testing.assert_array_equal(slow.t, [i / 100 for i in range(0, 101, 4) if not 40 <= i <= 60])


def test_any_numeric_field(bag: Callable[[Messages], Path]) -> None:
    def odometry(i: int) -> Any:
        def vector(x: float) -> Any:
            return TYPES["geometry_msgs/msg/Vector3"](x=x, y=0.0, z=0.0)

        pose = TYPES["geometry_msgs/msg/Pose"](
            position=TYPES["geometry_msgs/msg/Point"](x=0.5 * i, y=0.0, z=0.0),
            orientation=TYPES["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0),
        )
        return TYPES[ODOMETRY](
            header=header(10 * i * MS + 1),
            child_frame_id="",
            pose=TYPES["geometry_msgs/msg/PoseWithCovariance"](pose=pose, covariance=np.arange(36.0)),
            twist=TYPES["geometry_msgs/msg/TwistWithCovariance"](
                twist=TYPES["geometry_msgs/msg/Twist"](linear=vector(2.0 * i), angular=vector(0.0)),
                covariance=np.zeros(36),
            ),
        )

    path = bag([("/odom", 10 * i * MS, odometry(i)) for i in range(5)])
    signals = {
        "v": "/odom.twist.twist.linear.x",
        "c": "/odom.pose.covariance[7]",
        "q": "odom.pose.pose.position.x",
    }
    record = read_record(path, signals)
    np.testing.assert_array_equal(record.signals["v"].values, 2.0 * np.arange(5))
    np.testing.assert_array_equal(record.signals["c"].values, 7.0)
    np.testing.assert_array_equal(record.signals["q"].values, 0.5 * np.arange(5))
    with pytest.raises(RecordError, match="has no 'twisst'; it has header, child_frame_id, pose, twist"):
        read_record(path, {"v": "/odom.twisst.x"})
    with pytest.raises(RecordError, match="/odom is no number; it has header"):
        read_record(path, {"v": "/odom"})
    with pytest.raises(RecordError, match="message 1 has no"):
        read_record(path, {"v": "/odom.pose.covariance[36]"})
    with pytest.raises(RecordError, match=r"no topic holds numbers.*/odom \(nav_msgs/msg/Odometry\)"):
        read_record(path)


def test_late_messages_are_sorted_and_repeated_ones_dropped(bag: Callable[[Messages], Path]) -> None:
    stamps = [0, 10, 30, 20, 40, 40, 50]
    messages: Messages = [
        ("/joint_states", i * MS, joints(s * MS + 1, ["w"], [float(s)])) for i, s in enumerate(stamps)
    ]
    record = read_record(bag(messages))
    np.testing.assert_array_equal(record.signals["/joint_states.position[w]"].values, [0, 10, 20, 30, 40, 50])
    assert any("sorted by time" in note for note in record.notes)
    assert any("1 repeated messages" in note for note in record.notes)


@pytest.mark.parametrize(("received", "empty"), [(0, False), (5, True)])
def test_header_stamps_of_0_are_empty_ones_except_at_0(
    bag: Callable[[Messages], Path], received: int, empty: bool
) -> None:
    messages: Messages = [
        ("/joint_states", (received + 10 * i) * MS, joints(10 * i * MS, ["w"], [float(i)])) for i in range(5)
    ]
    record = read_record(bag(messages))
    assert any("header stamps of 0; times of reception" in note for note in record.notes) is empty
    np.testing.assert_allclose(record.t, 0.001 * received + 0.01 * np.arange(5), rtol=1e-12)


def test_messages_that_contradict_each_other(bag: Callable[[Messages], Path]) -> None:
    messages: Messages = [("/a", 10 * i * MS, number(float(i))) for i in range(5)]
    messages += [("/b", 10 * (i // 2) * MS, number(float(i))) for i in range(5)]
    path = bag(sorted(messages, key=lambda entry: entry[1]))
    record = read_record(path)
    assert set(record.signals) == {"a"}
    assert any("/b" in note and "left out" in note for note in record.notes)
    with pytest.raises(RecordError, match=r"/b\.data: messages 1 and 2 have the same stamp.* 0 and 1"):
        read_record(path, {"x": "/b"})


def test_arrays_of_changing_length_and_infinite_values(bag: Callable[[Messages], Path]) -> None:
    messages: Messages = [("/a", 10 * i * MS, number(float(i))) for i in range(4)]
    messages += [("/b", 10 * i * MS, array(range(1 + i // 2))) for i in range(4)]
    messages += [("/c", 10 * i * MS, number(np.inf)) for i in range(4)]
    path = bag(messages)
    assert set(read_record(path).signals) == {"a"}
    with pytest.raises(RecordError, match="/b: message 3 has 2 values, the first has 1"):
        read_record(path, {"x": "/b.data[0]"})
    with pytest.raises(RecordError, match=r"/c\.data: message 1, t = 0 s: .*inf"):
        read_record(path, {"x": "/c"})


def test_calendar_time_counts_from_the_start(bag: Callable[[Messages], Path]) -> None:
    record: Record = read_record(bag(run(start=1_700_000_000_000_000_000)))
    np.testing.assert_array_equal(record.t, np.arange(20) / 200)
    assert any("1700000000.000 s" in note for note in record.notes)


def test_headers_of_another_clock(bag: Callable[[Messages], Path]) -> None:
    start = 1_700_000_000_000_000_000
    messages: Messages = []
    for i in range(10):
        messages.append(("/joint_states", start + 10 * i * MS, joints(7 * i * MS + 1, ["w"], [float(i)])))
        messages.append(("/input", start + 10 * i * MS, array([float(i)])))
    record = read_record(bag(messages))
    np.testing.assert_array_equal(record.t, np.arange(10) / 100)
    assert any("another clock" in note for note in record.notes)


def test_the_input_must_begin_before_the_measurements_end(bag: Callable[[Messages], Path]) -> None:
    messages: Messages = [("/state", 5 * i * MS, array((0.0, 1.0))) for i in range(10)]
    messages.append(("/input", 60 * MS, array([1.0])))
    with pytest.raises(RecordError, match="after the measurements have ended"):
        read_for_model(bag(messages), motor())


def test_no_bag_and_damaged_bags(tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    with pytest.raises(RecordError, match=r"no metadata\.yaml"):
        read_record(tmp_path / "empty")
    whole = next(write_bag(tmp_path / "bag", run()).glob("*.mcap")).read_bytes()
    for name, content in (
        ("cut.mcap", whole[: len(whole) // 2]),
        ("rubbish.mcap", b"rubbish"),
        ("empty.mcap", b""),
        ("x.db3", b"x" * 5000),
    ):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(RecordError, match="not a readable rosbag2 recording"):
            read_record(tmp_path / name)
    shutil.rmtree(tmp_path / "bag")
    write_bag(tmp_path / "bag", [])
    with pytest.raises(RecordError, match="bag: "):
        read_record(tmp_path / "bag")


def test_formulas_of_topics(bag: Callable[[Messages], Path]) -> None:
    messages: Messages = []
    for i in range(20):
        messages.append(("/pwm", 10 * i * MS, number(1.0 + i)))
        messages.append(("/dir", 10 * i * MS, number(float(i % 2))))
        messages.append(("/speed", 10 * i * MS, number(60.0 * i)))
    signals = {"voltage": "12 * sign(/dir) * /pwm.data / 255", "speed": "-/speed.data [rpm]"}
    data = read_for_model(bag(messages), motor(), signals)
    pwm = 1.0 + np.arange(20)
    np.testing.assert_allclose(data.u[:, 0], np.where(np.arange(20) % 2, 12.0, -12.0) * pwm / 255)
    np.testing.assert_allclose(data.measured["speed"], -60.0 * np.arange(20) * np.pi / 30)


def test_any_field_may_stand_in_a_formula(bag: Callable[[Messages], Path]) -> None:
    messages: Messages = [("/voltage", 10 * i * MS, number(1.0)) for i in range(20)]
    messages += [("/speed", 10 * i * MS, number(2.0 * i)) for i in range(20)]
    data = read_for_model(bag(messages), motor(), {"speed": "0.5 * speed + 0.5*/speed.data"})
    np.testing.assert_allclose(data.measured["speed"], 2.0 * np.arange(20))


def test_the_time_of_a_bag_is_its_own(bag: Callable[[Messages], Path]) -> None:
    messages: Messages = [("/voltage", 10 * i * MS, number(1.0)) for i in range(20)]
    data = read_for_model(bag(messages), motor(), {"t": "0.5"})
    np.testing.assert_allclose(np.diff(data.t), 0.01)
    assert any(note.kind == "clock" and "own clock" in note for note in data.notes)
