"""A robot's URDF from a latched topic, as ``robot_state_publisher`` publishes it."""

from __future__ import annotations

import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from std_msgs.msg import String

from signlin_ros.errors import InputError
from signlin_ros.nodes.joints import TOPIC
from signlin_ros.nodes.qos import LATCHED

PATIENCE = 10.0
"""Seconds to wait for the description of a robot."""
LOOK = 0.1
"""Seconds between two looks."""


def with_description(node: Node, given: Mapping[str, Any]) -> dict[str, Any]:
    """Return parameters in which the robot is the text of a URDF where they name a topic, as ``/robot_description``.

    Raises `InputError` where nothing comes from it.
    """
    robot = given.get("robot")
    named = given.get("plant") == "arm" and isinstance(robot, str) and robot.startswith(TOPIC)
    if not named or Path(str(robot)).suffix or Path(str(robot)).exists():
        return dict(given)
    heard: list[str] = []
    subscription = node.create_subscription(String, str(robot), lambda m: heard.append(m.data), LATCHED)
    executor = SingleThreadedExecutor(context=node.context)
    executor.add_node(node)
    end = time.monotonic() + PATIENCE
    try:
        while not heard and time.monotonic() < end:
            executor.spin_once(timeout_sec=LOOK)
    finally:
        executor.remove_node(node)
        executor.shutdown()
        node.destroy_subscription(subscription)
    if not heard:
        who = "is robot_state_publisher running?"
        raise InputError(f"robot: nothing came from the topic {robot} within {PATIENCE:g} s; {who}")
    return {**given, "robot": heard[-1]}


__all__ = ["with_description"]
