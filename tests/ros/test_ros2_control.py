"""The example chain with ros2_control; the test plays its controller manager: the topics, and what it takes."""

from __future__ import annotations

from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
import pytest
import yaml

from .launching import ROOT, launched

EXAMPLE = ROOT / "config" / "ros2_control"
CONTROLLERS = yaml.safe_load((EXAMPLE / "controllers.yaml").read_text())
WANTED = 6.0
"""Speed in rad/s."""


def test_the_files_of_the_example_name_one_joint_one_interface_and_one_topic() -> None:
    from signlin_ros.model import Model

    model = Model.load(EXAMPLE / "wheel.yaml")
    (joint,) = CONTROLLERS["drive"]["ros__parameters"]["joints"]
    robot = ET.parse(EXAMPLE / "wheel.urdf").getroot()
    assert model.node_options["joint_name"] == joint
    assert [j.get("name") for j in robot.iter("joint")] == [joint, joint]
    interface = CONTROLLERS["drive"]["ros__parameters"]["interface_name"]
    assert [i.get("name") for i in robot.iter("command_interface")] == [interface]
    assert {i.get("name") for i in robot.iter("state_interface")} == {"position", "velocity", "effort"}
    assert model.units[model.inputs[0]] == "N·m"  # an effort
    started = launched("ros2_control.launch.py")
    for node in ("linearizer", "monitor", "controller"):
        assert ("input", "/drive/commands") in started.nodes[node].named["remappings"]
    spawned = [node["arguments"] for node in started.others if node["executable"] == "spawner"]
    manager = CONTROLLERS["controller_manager"]["ros__parameters"]
    assert [name for (name,) in spawned] == [name for name, value in manager.items() if isinstance(value, dict)]
    assert launched("ros2_control.launch.py", manager="false").others == []


@pytest.mark.slow
def test_the_chain_drives_a_joint_behind_a_forward_command_controller(graph: Any) -> None:
    """Of a controller manager here are the two topics: a stand-in takes commands as ForwardCommandController does."""
    pytest.importorskip("rclpy")
    from sensor_msgs.msg import JointState
    from std_msgs.msg import Float64MultiArray

    from signlin_ros.model import Model
    from signlin_ros.nodes import convert
    from signlin_ros.simulation import Stepper

    from .conftest import BIN

    started = launched("ros2_control.launch.py", manager="false")
    for name in started.nodes:
        graph.run([str(BIN / name), *started.arguments(name, graph.folder)], name)
    model = Model.load(EXAMPLE / "wheel.yaml")
    plant, commands, refused = Stepper(model, model.x0.copy()), [0.0], []

    def on_command(message: Any) -> None:
        (commands if len(message.data) == 1 else refused).append(message.data[0])  # as many values as joints

    graph.node.create_subscription(Float64MultiArray, "/drive/commands", on_command, 10)
    states = graph.publisher(JointState, "/joint_states")
    reference = graph.publisher(Float64MultiArray, "/reference")
    clock, speeds, last = graph.node.get_clock(), [], [None]

    def on_update() -> None:
        now = clock.now().nanoseconds
        if last[0] is not None:
            plant.advance((now - last[0]) / 1e9, [commands[-1]])
        last[0] = now
        x = dict(zip(model.states, plant.x.tolist(), strict=True))
        speeds.append(x["velocity"])
        message = JointState(name=["other", "wheel"])  # a broadcaster has all joints, in an order of its own
        message.header.stamp = convert.stamp_of(now)
        message.position, message.velocity = [0.5, x["displacement"]], [0.0, x["velocity"]]
        message.effort = [0.0, commands[-1]]
        states.publish(message)
        reference.publish(Float64MultiArray(data=[WANTED, 0.0]))

    timer = graph.node.create_timer(0.005, on_update)
    graph.wait(lambda: len(speeds) > 100 and np.median(speeds[-100:]) > 0.9 * WANTED, "the reference's speed")
    assert np.max(np.abs(commands)) <= 0.5
    assert not refused
    graph.node.destroy_timer(timer)
