"""What the executables call: import a node's module, or say which extra is missing."""

from __future__ import annotations

import importlib
import sys

from signlin_ros.errors import MissingExtraError

_ROS = ("rclpy", "rcl_interfaces", "std_msgs", "sensor_msgs", "diagnostic_msgs", "rosgraph_msgs")


def start(module: str) -> int:
    """Run ``main()`` of a node's module and return its exit code; 2 where ROS 2 is not installed."""
    try:
        node = importlib.import_module(module)
    except ModuleNotFoundError as error:
        if error.name not in _ROS:
            raise
        sys.stderr.write(f"{MissingExtraError('A ROS 2 node', 'ros')}\n")
        return 2
    return int(node.main())
