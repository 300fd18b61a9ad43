"""Arms in processes: joint logs replayed by name, a robot from its topic, and nodes that take no arm."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="ROS 2 is not installed: pip install 'signlin_ros[ros]'")

from diagnostic_msgs.msg import DiagnosticArray
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from signlin_ros.model import Model
from signlin_ros.nodes import convert
from signlin_ros.nodes.joints import outside
from tests.arm_records import SMALL, record, small, written

pytestmark = pytest.mark.ros
MODEL = small()
NAMES = MODEL.robot.names


def test_a_joint_outside_the_valid_range_is_named() -> None:
    x, u = MODEL.x0.copy(), MODEL.u0
    assert outside(MODEL, x, u) == []
    x[4] = 10.0
    assert outside(MODEL, x, u) == ["shoulder"]


def test_a_log_of_joints_is_replayed_by_their_names(graph: Any, tmp_path: Path) -> None:
    data = written(tmp_path / "run.csv", NAMES, *record(MODEL, 1, duration=4.0))
    models, joints = graph.models(), graph.collect(JointState, "/joint_states")
    told = graph.collect(DiagnosticArray, "/diagnostics")
    graph.start("linearizer", "state_source:=joint_state", "update_period:=0.1", model=SMALL)
    graph.start("replay", f"record:={data}", "loop:=true", model=SMALL)
    graph.wait(lambda: len(models) >= 5, "five models")
    assert list(joints[-1].name) == list(NAMES)
    update = convert.read_model(models[-1])
    assert update.result.A.shape == (6, 6)
    assert update.result.u.any()

    def by_joint() -> dict[str, str]:
        values = {v.key: v.value for message in told for status in message.status for v in status.values}
        return {key: value for key, value in values.items() if key.startswith("elbow: ")}

    graph.wait(lambda: "elbow: in_valid_range" in by_joint(), "the range of the elbow")
    assert by_joint()["elbow: messages refused"] == "0"


def test_a_robot_comes_from_its_topic(graph: Any, tmp_path: Path) -> None:
    from rclpy.qos import DurabilityPolicy, QoSProfile

    lines = SMALL.read_text(encoding="utf-8").replace("robot: small_arm.urdf", "robot: /robot_description")
    (tmp_path / "arm.yaml").write_text(lines, encoding="utf-8")
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    publisher = graph.node.create_publisher(String, "/robot_description", latched)
    publisher.publish(String(data=SMALL.with_suffix(".urdf").read_text(encoding="utf-8")))
    names = graph.collect(String, "/linearizer/names", latched=True)
    texts = graph.collect(String, "/linearizer/model_yaml", latched=True)
    graph.start("linearizer", "state_source:=joint_state", model=tmp_path / "arm.yaml")
    graph.wait(lambda: names and texts, "the names and the model")
    assert json.loads(names[-1].data)["states"] == list(MODEL.states)
    assert Model.from_yaml(texts[-1].data, "model_yaml").robot.names == NAMES


@pytest.mark.parametrize(("node", "way"), [("monitor", "signlin diagnose"), ("controller", "signlin gains")])
def test_a_node_that_takes_no_arm_says_so_in_one_line(graph: Any, node: str, way: str) -> None:
    process = graph.start(node, model=SMALL)
    graph.wait(lambda: not process.running, f"the end of {node}")
    assert process.popen.returncode == 2
    (line,) = [one for one in process.output.splitlines() if "does not take an arm" in one]
    assert way in line
    assert "Traceback" not in process.output
