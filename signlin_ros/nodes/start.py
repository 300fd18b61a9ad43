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


REALTIME = "SIGNLIN_REALTIME"
"""Variable with a priority, 1 to 99, that nodes of the loop get before all that is not in real time (SCHED_RR)."""
OF_THE_LOOP = ("controller", "plant_simulator")
"""Nodes that other work on the machine must not keep waiting."""


def _hurry(module: str) -> None:
    """Give a node of the loop the priority that is asked for, and all threads that it starts; say where that fails."""
    asked = os.environ.get(REALTIME, "")
    if not asked or module.rpartition(".")[2] not in OF_THE_LOOP:
        return
    try:
        os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(int(asked)))
    except (OSError, ValueError, AttributeError) as error:
        sys.stderr.write(f"{REALTIME}={asked}: no priority ({error}); allowed: 1 to 99, where ulimit -r is as much\n")


def start(module: str) -> int:
    """Run ``main()`` of a node's module and end the process with its exit code; return 2 where ROS 2 is not installed.

    A signal before the node takes care of signals itself ends the process at once: nothing is there to take down. Nor
    is anything left to do once ``main()`` has taken the node down: the interpreter's own end would run destructors of
    the middleware and of compiled code in an order that nobody controls, and wait for a thread that still compiles.
    """
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: os._exit(0))
    _hurry(module)
    try:
        node = importlib.import_module(module)
    except ModuleNotFoundError as error:
        if error.name not in _ROS:
            raise
        sys.stderr.write(f"{MissingExtraError('A ROS 2 node', 'ros')}\n")
        return 2
    code = int(node.main())
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)
