"""What the launch files start, with a launch system of which only the arguments are looked at; and the nodes run."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

from .launching import ROOT, Started, as_printed, launched

FILES = sorted((ROOT / "config" / "launch").glob("*.launch.py"))
MINE = """/**:
  ros__parameters:
    plant: dc_motor
    with_position: true
    parameters: {R_a: 1.2, L_a: 0.0015, K_t: 0.05, K_m: 0.05, B: 0.0001, J: 0.0009}
    effects:
      coulomb_friction: {mu: 0.02}
    update_period: 0.1
    joint_name: wheel
"""


@pytest.fixture
def mine(tmp_path: Path) -> str:
    """A parameter file that names its joint."""
    file = tmp_path / "mine.yaml"
    file.write_text(MINE)
    return str(file)


def test_the_shipped_motor_gets_a_controller_that_starts() -> None:
    from signlin_ros.control.controller import Controller, ControllerSettings
    from signlin_ros.model import Model

    started = launched("live.launch.py")
    assert set(started.nodes) == {"plant_simulator", "linearizer", "monitor", "controller"}
    file = started.nodes["controller"].named["parameters"][1]
    assert Path(file).is_file()
    assert started.parameters("controller")["state_source"] == "joint_state"
    Controller(Model.load(Path(file)), ControllerSettings(started.parameters("controller")["limit"]))


def test_a_simulated_drive_has_a_watchdog_where_a_controller_drives_it(mine: str) -> None:
    def watchdog(**given: str) -> float | None:
        return launched("live.launch.py", **given).parameters("plant_simulator").get("watchdog")

    assert watchdog() == 0.1
    assert watchdog(controller="false") is None
    assert watchdog(params_file=mine) is None  # no limit, no controller
    Path(mine).write_text(MINE + "    control_period: 0.05\n")
    assert watchdog(params_file=mine, limit="9") == 0.25
    Path(mine).write_text(MINE + "    watchdog: 0.0\n")
    assert watchdog(params_file=mine, limit="9") == 0.0


@pytest.mark.parametrize("limit", ["", "0"])
def test_a_drive_of_which_no_limit_is_known_gets_no_controller_and_a_line_that_says_so(mine: str, limit: str) -> None:
    for file in (mine, "/somewhere/mine.yaml"):
        started = launched("live.launch.py", params_file=file, limit=limit)
        assert "controller" not in started.nodes
        assert {"linearizer", "monitor"} <= set(started.nodes)
        assert "limit:=" in started.said[0]


def test_a_limit_that_is_given_counts_and_one_in_the_file_does_too(mine: str) -> None:
    for file in ({}, {"params_file": "/somewhere/mine.yaml"}, {"params_file": mine}):
        assert launched("live.launch.py", limit="5.5", **file).parameters("controller")["limit"] == 5.5
    Path(mine).write_text(MINE + "    limit: 9\n")
    assert launched("live.launch.py", params_file=mine).parameters("controller")["limit"] == 9.0


def test_what_the_file_says_holds_until_an_argument_says_otherwise(mine: str) -> None:
    """A default of an argument would override the file: a joint of another name, an input of another size."""
    started = launched("live.launch.py", params_file=mine, limit="12")
    assert {started.parameters(name).get("joint_name") for name in started.nodes} == {"wheel"}
    other = launched("live.launch.py", params_file=mine, limit="12", joint_name="arm", state_source="array")
    assert {other.parameters(name).get("joint_name") for name in other.nodes} == {"arm"}
    assert other.parameters("linearizer")["state_source"] == "array"
    Path(mine).write_text(MINE + "    amplitude: 7.0\n    rate: 2.0\n    state_source: array\n")
    assert launched("live.launch.py", params_file=mine).parameters("monitor")["state_source"] == "array"
    simulated = launched("simulation.launch.py", params_file=mine)
    assert simulated.parameters("plant_simulator")["amplitude"] == 7.0
    assert simulated.parameters("plant_simulator")["input_signal"] == "square"
    assert launched("replay.launch.py", params_file=mine, record="run.csv").parameters("replay")["rate"] == 2.0
    given = launched("simulation.launch.py", params_file=mine, amplitude="3", use_sim_time="true")
    assert given.parameters("plant_simulator")["amplitude"] == 3.0
    assert given.parameters("linearizer")["use_sim_time"] is True


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.name)
def test_the_line_that_a_launch_file_prints_has_arguments_that_it_takes(file: Path) -> None:
    (line,) = re.findall(r"^ros2 launch .*", file.read_text(), re.MULTILINE)
    name, given = as_printed(line)
    assert name == file.name
    assert "linearizer" in launched(name, **given).nodes


def start(graph: Any, started: Started) -> None:
    """Start the nodes as processes."""
    from .conftest import BIN

    for name in started.nodes:
        graph.run([str(BIN / name), *started.arguments(name, graph.folder)], name)


def test_the_nodes_of_a_joint_start_and_hear_each_other(graph: Any, mine: str) -> None:
    from diagnostic_msgs.msg import DiagnosticArray

    start(graph, launched("live.launch.py", params_file=mine, limit="12", namespace="left"))
    messages = graph.collect(DiagnosticArray, "/diagnostics")
    models = graph.models("/left/linearizer")
    graph.wait(lambda: len(models) >= 3, "models")
    monitor = graph.diagnostics(messages, "learning what is usual", "/left/monitor")
    linearizer = graph.diagnostics(messages, "", "/left/linearizer")
    assert (monitor.hardware_id, linearizer.hardware_id) == ("left/wheel", "left/wheel")
    assert graph.diagnostics(messages, "stopped: no reference yet", "/left/controller").level == b"\x01"


def test_a_simulated_plant_starts(graph: Any, mine: str) -> None:
    start(graph, launched("simulation.launch.py", params_file=mine))
    models = graph.models()
    graph.wait(lambda: len(models) >= 3, "models")
