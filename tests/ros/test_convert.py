"""Messages to arrays and back, without any process."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="ROS 2 is not installed: pip install 'signlin_ros[ros]'")

from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, MultiArrayDimension

from signlin_ros.linearization import Linearizer
from signlin_ros.model import Model
from signlin_ros.nodes import convert
from signlin_ros.nodes.linearizer_logic import LinearizerLogic
from signlin_ros.nodes.told import Refusal, Update

sys.path.insert(0, str(Path(__file__).parent))
from malformed import malformed

sys.path.pop(0)

pytestmark = pytest.mark.ros


def dims(*pairs: tuple[int, int]) -> list[MultiArrayDimension]:
    return [MultiArrayDimension(size=size, stride=stride) for size, stride in pairs]


@pytest.mark.parametrize("layout", [[], [(3, 3)], [(3, 3), (1, 1)], [(1, 3), (3, 3)]])
def test_vectors_with_an_empty_or_a_right_layout(layout: list[tuple[int, int]]) -> None:
    message = Float64MultiArray(data=[1.0, 2.0, 3.0])
    message.layout.dim = dims(*layout)
    np.testing.assert_array_equal(convert.read_vector(message, 3), [1.0, 2.0, 3.0])


@pytest.mark.parametrize(
    "layout",
    [[(2, 2)], [(3, 2)], [(3, 0)], [(65536, 0), (65536, 2**32 - 1), (3, 3)], [(0, 0)], [(3, 9), (3, 3)]],
)
def test_wrong_layouts(layout: list[tuple[int, int]]) -> None:
    message = Float64MultiArray(data=[1.0, 2.0, 3.0])
    message.layout.dim = dims(*layout)
    refusal = convert.read_vector(message, 3)
    assert isinstance(refusal, Refusal)
    assert refusal.kind == "layout"


def test_what_is_refused_and_why() -> None:
    message = Float64MultiArray(data=[1.0, float("nan")])
    assert convert.read_vector(message, 2) == Refusal("not_finite", "value 1 is not finite")
    assert convert.read_vector(message, 3) == Refusal("length", "2 values, not 3")
    message.layout.data_offset = 1
    assert convert.read_vector(message, 2) == Refusal("layout", "data_offset 1, not 0")


def test_joints_are_found_by_name() -> None:
    message = JointState(name=["a", "wheel", "b"], position=[1.0, 2.0, 3.0], velocity=[4.0, float("nan")])
    assert convert.read_joint(message, "wheel") == {"position": 2.0}
    assert convert.read_joint(message, "b") == {"position": 3.0}
    assert convert.read_joint(message, "c") == Refusal("missing", "no joint 'c' among ['a', 'wheel', 'b']")
    message.position[1] = float("inf")
    assert convert.read_joint(message, "wheel") == Refusal("not_finite", "position is not finite")
    message.position[1] = 1e300
    assert convert.read_joint(message, "wheel") == Refusal("not_finite", "position 1e+300 squared")


def test_matrices_are_row_major_with_labelled_dimensions() -> None:
    message = convert.matrix([[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]], "rows", "columns")
    assert list(message.data) == [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]
    assert [(d.label, d.size, d.stride) for d in message.layout.dim] == [("rows", 3, 6), ("columns", 2, 2)]
    assert message.layout.data_offset == 0


def test_a_model_survives_its_message() -> None:
    result = Linearizer(Model.load("bouc_wen"))([0.1, 0.2, 0.3], [0.4])
    stamp = 1_795_238_182_484_504_130
    message = convert.model_message(Update(stamp, 7, result))
    assert len(message.data) == 6 + 9 + 3 + 3 + 3 + 1
    assert message.layout.dim[0].label.split(", ")[2:4] == ["sequence", "in_valid_range"]
    back = convert.read_model(message)
    assert (back.stamp, back.sequence, back.result.in_valid_range) == (stamp, 7, result.in_valid_range)
    for name in ("A", "B", "c", "x", "u"):
        np.testing.assert_array_equal(getattr(back.result, name), getattr(result, name))
    np.testing.assert_allclose(back.result.f, result.f, rtol=1e-12)


def test_1000_malformed_messages_in_process() -> None:
    """Whatever comes as state or as input, nothing is raised, and what goes out is finite."""
    logic = LinearizerLogic(Model.load("dc_motor"), 0)
    period, updates = logic.period, []
    for k, message in enumerate(malformed(2000)):
        logic.take_state(convert.read_vector(message, 2), k * period)
        logic.take_input(convert.read_vector(message, 1), k * period)
        updates += logic.updates(k * period + period // 2)
    for update in updates:
        assert np.isfinite(convert.model_message(update).data).all()
    assert sum(logic.refused.values()) > 3000
    logic.take_state(np.array([0.1, 1.0]), 3000 * period)
    logic.updates(3000 * period)
    logic.take_state(np.array([0.1, 1.0]), 3001 * period)
    logic.take_input(np.array([1.0]), 3001 * period)
    assert logic.updates(3001 * period)[-1].result.x.tolist() == [0.1, 1.0]
