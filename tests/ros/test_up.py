"""All nodes together, each a process of its own, for several joints."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="ROS 2 is not installed: pip install 'signlin_ros[ros]'")

from diagnostic_msgs.msg import DiagnosticArray
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from signlin_ros.errors import InputError
from signlin_ros.model import find_model_file
from sim_nodes.up import StartPlan

ARM = Path(__file__).parents[2] / "config" / "arm" / "small_arm.yaml"


def test_two_joints(graph: Any) -> None:
    command = [sys.executable, "-m", "signlin_ros.cli", "ros", "up", "dc_motor", "--namespace", "left"]
    command += ["--namespace", "right", "--without", "controller", "-p", "plant_simulator.input_signal=sine"]
    with (graph.folder / "up.log").open("wb") as out:
        process = subprocess.Popen(command, stdout=out, stderr=out, env=graph.env)
    try:
        left, right = graph.models("/left/linearizer"), graph.models("/right/linearizer")
        graph.wait(lambda: len(left) > 3 and len(right) > 3, "models of both joints")
        wanted = {("plant_simulator", "/left"), ("linearizer", "/left"), ("monitor", "/left")}
        graph.wait(lambda: wanted <= set(graph.node.get_node_names_and_namespaces()), "all nodes of a joint")
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


def test_a_simulated_drive_has_a_watchdog_where_a_controller_drives_it(tmp_path: Path) -> None:
    limited = ("controller.limit=12.0",)

    def given(*more: str, name: str = "plant_simulator", **plan: Any) -> list[str]:
        return [
            part
            for part in StartPlan("dc_motor", parameters=(*limited, *more), **plan).arguments(name, "")
            if part.startswith("watchdog")
        ]

    assert given() == ["watchdog:=0.1"]
    assert given("controller.control_period=0.001") == ["watchdog:=0.005"]
    assert given("plant_simulator.watchdog=0") == ["watchdog:=0"]
    assert given(name="controller") == []
    assert given(without=("controller",)) == []
    slow = tmp_path / "slow.yaml"
    slow.write_text(find_model_file("dc_motor").read_text() + "    control_period: 0.05\n")
    assert "watchdog:=0.25" in StartPlan(str(slow), parameters=limited).arguments("plant_simulator", "")


def test_no_node_shares_a_process_with_another_one() -> None:
    plan = StartPlan("dc_motor", namespaces=("left", "right"), parameters=("controller.limit=12.0",))
    nodes = {"plant_simulator", "linearizer", "monitor", "controller"}
    assert set(plan.commands()) == {f"/{place}/{name}" for place in ("left", "right") for name in nodes}
    assert all(command[0] == sys.executable for command in plan.commands().values())


WAITS = """
import os, pathlib, signal, sys, time
name, folder, follows = sys.argv[1], pathlib.Path(sys.argv[2]), os.environ["SIGNLIN_FOLLOWED"]
def end(*_):
    (folder / f"{name}.ended").write_text(str(time.monotonic_ns()))
    sys.exit(0)
signal.signal(signal.SIGINT, end)
(folder / f"{name}.begun").write_text(str(os.getpid()))
while str(os.getppid()) == follows:
    if name == "linearizer" and (folder / "fail").exists():
        sys.exit(3)
    time.sleep(0.02)
"""
"""Stands for a node: it ends when it is asked, when its parent is gone, or fails."""
TOGETHER = """
import sys
from sim_nodes.up import ProcessGroup
names = ["linearizer", "controller", "plant_simulator"]
waits, folder = sys.argv[1:]
sys.exit(ProcessGroup({f"/{n}": [sys.executable, "-c", waits, n, folder] for n in names}).run())
"""


@pytest.fixture
def together(tmp_path: Path) -> Any:
    process = subprocess.Popen([sys.executable, "-c", TOGETHER, WAITS, str(tmp_path)], stderr=subprocess.PIPE)
    _until(lambda: sum(bool(f.read_text()) for f in tmp_path.glob("*.begun")) == 3)  # a file is there before its text
    yield process
    process.kill()
    process.communicate()


def _until(condition: Any) -> None:
    end = time.monotonic() + 60.0
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.02)


def _alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def test_the_controller_ends_first(together: Any, tmp_path: Path) -> None:
    together.send_signal(signal.SIGINT)
    assert together.wait(60) == 0
    ended = {f.stem: int(f.read_text()) for f in tmp_path.glob("*.ended")}
    assert min(ended, key=lambda name: ended[name]) == "controller"
    assert len(ended) == 3


def test_where_one_ends_by_itself_all_end_and_that_is_said(together: Any, tmp_path: Path) -> None:
    (tmp_path / "fail").touch()
    assert together.wait(60) == 3
    assert b"/linearizer has ended with exit code 3: all nodes end" in together.stderr.read()
    assert {f.stem for f in tmp_path.glob("*.ended")} == {"controller", "plant_simulator"}


def test_nodes_do_not_outlive_what_has_started_them(together: Any, tmp_path: Path) -> None:
    nodes = [int(f.read_text()) for f in tmp_path.glob("*.begun")]
    os.kill(together.pid, signal.SIGKILL)
    _until(lambda: not any(_alive(pid) for pid in nodes))


def test_a_node_ends_where_what_it_belongs_to_is_gone(graph: Any) -> None:
    graph.env["SIGNLIN_FOLLOWED"] = str(2**22 + 1)  # no process has such a number
    process = graph.start("plant_simulator")
    graph.wait(lambda: not process.running, "its end")
    assert process.popen.returncode == 0


def test_joints_with_models_names_and_limits_of_their_own(tmp_path: Path) -> None:
    text = find_model_file("dc_motor").read_text()
    (tmp_path / "limited.yaml").write_text(text + "    limit: 6.0\n")
    models = ("left=dc_motor", f"right={tmp_path / 'limited.yaml'}", f"arm={ARM}")
    given = ("left/joint_name=wheel_l", "right/joint_name=wheel_r", "left/monitor.learn=5.0", "update_period=0.1")
    plan = StartPlan.of(models, parameters=given)
    assert plan.namespaces == ("left", "right", "arm")
    assert "joint_name:=wheel_l" in plan.arguments("linearizer", "left")
    assert "joint_name:=wheel_r" in plan.arguments("controller", "right")
    assert "joint_name:=wheel_l" not in plan.arguments("controller", "right")
    assert "learn:=5.0" in plan.arguments("monitor", "left")
    assert "learn:=5.0" not in plan.arguments("monitor", "right")
    assert "update_period:=0.1" in plan.arguments("linearizer", "arm")
    assert str(tmp_path / "limited.yaml") in plan.arguments("linearizer", "right")
    assert plan.names("left") == ["plant_simulator", "linearizer", "monitor"]
    assert plan.names("right") == ["plant_simulator", "linearizer", "monitor", "controller"]
    assert plan.names("arm") == ["plant_simulator", "linearizer"]


@pytest.mark.parametrize(
    ("models", "namespaces", "words"),
    [
        (("dc_motor", "emps"), (), "NAMESPACE=MODEL for each joint"),
        (("a=dc_motor", "a=emps"), (), "each namespace once"),
        (("a=dc_motor",), ("b",), "has its namespace before it already"),
    ],
)
def test_models_that_stand_for_no_joint_are_refused(models: Any, namespaces: Any, words: str) -> None:
    with pytest.raises(InputError, match=words):
        StartPlan.of(models, namespaces)


def test_a_parameter_of_an_unknown_namespace_is_refused() -> None:
    plan = StartPlan.of(("left=dc_motor", "right=dc_motor"), parameters=("rihgt/limit=3.0",))
    with pytest.raises(InputError, match=r"'rihgt' is no namespace; there are: left, right.*did you mean 'right'"):
        plan.names("left")


def test_a_node_of_the_loop_gets_the_priority_that_is_asked_for_and_no_other_one_does(tmp_path: Path) -> None:
    script = """
import os, sys
from signlin_ros.nodes import start
os.sched_setscheduler = lambda pid, policy, param: print(pid, policy == os.SCHED_RR, param.sched_priority)
for module in ("sim_nodes.plant_simulator", "signlin_ros.nodes.controller", "signlin_ros.nodes.monitor"):
    start._hurry(module)
"""
    for asked, said in (("20", "0 True 20\n" * 2), ("", "")):
        env = {**os.environ, "SIGNLIN_REALTIME": asked}
        run = subprocess.run([sys.executable, "-c", script], env=env, capture_output=True, text=True, check=True)
        assert (run.stdout, run.stderr) == (said, "")
    env = {**os.environ, "SIGNLIN_REALTIME": "soon"}
    run = subprocess.run([sys.executable, "-c", script], env=env, capture_output=True, text=True, check=True)
    assert "SIGNLIN_REALTIME=soon: no priority" in run.stderr


def test_with_joint_states_it_starts_tracks_and_says_so(graph: Any) -> None:
    command = [sys.executable, "-m", "signlin_ros.cli", "ros", "up", "dc_motor", "-p", "controller.limit=12"]
    command += ["-p", "state_source=joint_state", "--without", "monitor"]
    with (graph.folder / "up.log").open("wb") as out:
        process = subprocess.Popen(command, stdout=out, stderr=out, env=graph.env)
    try:
        graph.wait(lambda: graph.node.count_subscribers("/reference"), "the controller", 300.0)
        reference, states = graph.publisher(Float64MultiArray, "/reference"), graph.collect(JointState, "/joint_states")
        diagnostics = graph.collect(DiagnosticArray, "/diagnostics")
        graph.node.create_timer(0.05, lambda: reference.publish(Float64MultiArray(data=[2.0, 0.0])))
        assert graph.diagnostics(diagnostics, "tracking", "/controller").level in (b"\x00", b"\x01")
        graph.wait(lambda: abs(states[-1].velocity[0] - 2.0) < 0.1, "the speed")
    finally:
        process.send_signal(signal.SIGINT)
        assert process.wait(60) == 0
