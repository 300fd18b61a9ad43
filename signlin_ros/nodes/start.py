"""What the executables call: import a node's module, or say which extra is missing."""

from __future__ import annotations

import importlib
import os
import signal
import sys

from signlin_ros.errors import MissingExtraError

FOLLOWED = "SIGNLIN_FOLLOWED"
"""Variable with the process that a node belongs to (``signlin ros up``): where that is gone, the node ends."""
_ROS = ("rclpy", "rcl_interfaces", "std_msgs", "sensor_msgs", "diagnostic_msgs", "rosgraph_msgs", "std_srvs")


def start(module: str) -> int:
    """Run ``main()`` of a node's module and return its exit code; 2 where ROS 2 is not installed.

    A signal before the node takes care of signals itself ends the process at once: nothing is there to take down.
    """
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: os._exit(0))
    try:
        node = importlib.import_module(module)
    except ModuleNotFoundError as error:
        if error.name not in _ROS:
            raise
        sys.stderr.write(f"{MissingExtraError('A ROS 2 node', 'ros')}\n")
        return 2
    return int(node.main())
