"""Security asked for and not there: refused; and the policy names what the nodes use."""

from __future__ import annotations

from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import pytest

pytest.importorskip("rclpy", reason="ROS 2 is not installed: pip install 'signlin_ros[ros]'")

from signlin_ros.errors import InputError
from signlin_ros.nodes.security import check_security

POLICIES = Path(__file__).parents[2] / "config" / "security" / "policies.xml"


@pytest.mark.parametrize("node", ["linearizer", "monitor", "plant_simulator", "replay", "play"])
def test_without_a_keystore_every_node_refuses_in_one_line(graph: Any, node: str) -> None:
    environment = {k: v for k, v in graph.env.items() if not k.startswith("ROS_SECURITY")}
    graph.env = {**environment, "ROS_SECURITY_ENABLE": "true"}
    process = graph.start(node)
    assert process.popen.wait(60.0) == 2
    lines = [line for line in process.output.splitlines() if line.strip()]
    assert len(lines) == 1
    assert "ROS_SECURITY_KEYSTORE" in lines[0]


def test_what_is_enforced(tmp_path: Path) -> None:
    check_security({})
    (tmp_path / "enclaves").mkdir()
    environment = {"ROS_SECURITY_ENABLE": "true", "ROS_SECURITY_KEYSTORE": str(tmp_path)}
    check_security(environment)
    assert environment["ROS_SECURITY_STRATEGY"] == "Enforce"
    with pytest.raises(InputError, match="Permissive"):
        check_security({**environment, "ROS_SECURITY_STRATEGY": "Permissive"})


@pytest.mark.parametrize("name", ["linearizer", "monitor"])
def test_the_policy_names_every_topic_and_service_of_a_node(graph: Any, name: str) -> None:
    graph.start(name)
    found: set[str] = set()

    def seen() -> bool:
        node = graph.node
        for kind in (node.get_publisher_names_and_types_by_node, node.get_subscriber_names_and_types_by_node):
            found.update(topic for topic, _ in kind(name, "/"))
        found.update(service for service, _ in node.get_service_names_and_types_by_node(name, "/"))
        return f"/{name}/get_state" in found and "/input" in found

    graph.wait(lambda: name in graph.node.get_node_names() and seen(), "the node's topics")
    unknown = {topic for topic in found if topic not in _allowed(name)}
    assert not unknown


def _allowed(node: str) -> set[str]:
    entries: list[str] = []
    for file in (POLICIES, POLICIES.with_name("common_node.xml")):
        for profile in ET.parse(file).getroot().iter("profile"):
            if profile.get("node", node) == node:
                entries += [element.text or "" for element in profile.iter() if element.tag in ("topic", "service")]
    return {("/" + entry.replace("~", node)).replace("//", "/") for entry in entries}
