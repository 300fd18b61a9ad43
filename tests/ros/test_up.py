"""All nodes in one process, for several joints."""

from __future__ import annotations

import signal
import subprocess
import sys
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="ROS 2 is not installed: pip install 'signlin_ros[ros]'")

from signlin_ros.errors import InputError
from sim_nodes.up import StartPlan


def test_two_joints_in_one_process(graph: Any) -> None:
    command = [sys.executable, "-m", "signlin_ros.cli", "ros", "up", "dc_motor", "--namespace", "left"]
    command += ["--namespace", "right", "--without", "controller", "-p", "plant_simulator.input_signal=sine"]
    with (graph.folder / "up.log").open("wb") as out:
        process = subprocess.Popen(command, stdout=out, stderr=out, env=graph.env)
    try:
        left, right = graph.models("/left/linearizer"), graph.models("/right/linearizer")
        graph.wait(lambda: len(left) > 3 and len(right) > 3, "models of both joints")
        names = {name for name, space in graph.node.get_node_names_and_namespaces() if space == "/left"}
        assert {"plant_simulator", "linearizer", "monitor"} <= names
    finally:
        process.send_signal(signal.SIGINT)
        assert process.wait(60) == 0


def test_what_a_plan_says() -> None:
    plan = StartPlan("dc_motor", without=("controller",), parameters=("monitor.learn=5.0", "update_period=0.1"))
    assert plan.names() == ["plant_simulator", "linearizer", "monitor"]
    assert "learn:=5.0" in plan.arguments("monitor", "")
    assert "learn:=5.0" not in plan.arguments("linearizer", "")
    assert "update_period:=0.1" in plan.arguments("linearizer", "joint1")
    assert "__ns:=/joint1" in plan.arguments("linearizer", "joint1")
    assert "controller" not in StartPlan("dc_motor").names()  # nobody has said what the drive may be given
    assert "controller" in StartPlan("dc_motor", parameters=("controller.limit=12.0",)).names()
    with pytest.raises(InputError, match="no node"):
        StartPlan("dc_motor", without=("monitr",)).names()
    with pytest.raises(InputError, match=r"NODE\.NAME=VALUE"):
        StartPlan("dc_motor", parameters=("learn",)).arguments("monitor", "")
