"""Lists and words as ROS parameters of a running node: one parameter each, changed whole, refused with a reason."""

import sys

import pytest

rclpy = pytest.importorskip("rclpy", reason="ROS 2 is not installed: pip install 'signlin_ros[ros]'")

from rclpy.parameter import Parameter  # noqa: E402

from signlin_ros.model import Model  # noqa: E402
from signlin_ros.nodes.linearizer import LinearizerNode  # noqa: E402

CURVE = {"over": ["speed", "load"], "knots": [-1.0, 1.0], "knots_2": [0.0, 1.0], "values": [0.0, 0.1, 0.2, 0.3]}


@pytest.fixture
def node(tmp_path, monkeypatch):
    model = Model.load("dc_motor").with_effect("torque_ripple", orders=[72.0, 18.0], A=[0.01, 0.02])
    file = tmp_path / "ripple.yaml"
    text = model.with_effect("learned_force", **CURVE).to_yaml()
    file.write_text(text.replace("[72.0, 18.0]", "[72, 18]"))  # whole numbers, as a person writes them
    arguments = ["linearizer", "--ros-args", "--params-file", str(file)]
    monkeypatch.setattr(sys, "argv", arguments)
    rclpy.init(args=arguments)
    node = LinearizerNode()
    yield node
    node.destroy_node()
    rclpy.shutdown()


def test_lists_are_declared_changed_and_refused_as_a_whole(node):
    assert list(node.get_parameter("effects.torque_ripple.orders").value) == [72.0, 18.0]
    assert list(node.get_parameter("effects.learned_force.over").value) == CURVE["over"]
    assert "amplitude of each [N·m]" in node.describe_parameter("effects.torque_ripple.A").description
    for name, value, words in (
        ("torque_ripple.A", [0.5, 0.25], ""),
        ("torque_ripple.A", [1, 2], ""),
        ("torque_ripple.A", [0.5], "A: found 1 numbers; allowed: 2, one for each of effects.torque_ripple.orders"),
        ("torque_ripple.orders", [72.5, 18.0], "allowed: a whole number, the axis is rotary"),
        ("learned_force.values", [1.0, 2.0, 3.0, 4.0], ""),
        ("learned_force.knots", [0.0, 2.0], "read-only"),
    ):
        before = list(node.get_parameter(f"effects.{name}").value)
        result = node.set_parameters([Parameter(f"effects.{name}", value=value)])[0]
        assert result.successful == (not words), result.reason
        assert words in result.reason
        assert list(node.get_parameter(f"effects.{name}").value) == (before if words else value)
    assert node.logic.model.value("torque_ripple.A[1]") == 2.0
    assert node.logic.model.value("learned_force.values[3]") == 4.0


def test_every_option_of_every_node_may_stand_in_a_model_file():
    """What a node is given on its command line is read as a model first: an unknown key would end it."""
    from signlin_ros.model.options import NODE_KEYS
    from signlin_ros.nodes import controller, linearizer, managed, monitor
    from sim_nodes import plant_simulator, play, replay

    modules = (controller, linearizer, monitor, plant_simulator, play, replay)
    options = {name for module in modules for name in module.OPTIONS} | set(managed.AUTOSTART)
    assert options - set(NODE_KEYS) == set()
