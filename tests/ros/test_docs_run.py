"""What the pages of the nodes and of their how-tos print runs: model files, commands, launches and service calls."""

from __future__ import annotations

import importlib
import re
import shlex
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from click.testing import CliRunner

from signlin_ros.cli import main, signlin
from signlin_ros.model import Model
from signlin_ros.simulation import simulate

from .launching import ROOT, as_printed, launched

DOCS = ROOT / "docs"
NODE_PAGES = sorted((DOCS / "nodes").glob("*.md"))
OWN_FILES = {"my_model.yaml", "my_motor.yaml", "my_joint.yaml", "other.yaml"}
"""Model files that pages name and do not print."""


def text_of(page: Path) -> str:
    return page.read_text(encoding="utf-8")


def blocks(page: Path, language: str) -> list[str]:
    """The fenced blocks of a language on a page, without their indentation."""
    found = re.findall(rf"^( *)```{language}\n(.*?)^ *```", text_of(page), re.MULTILINE | re.DOTALL)
    return [re.sub(rf"^{indent}", "", body, flags=re.MULTILINE) for indent, body in found]


def commands(page: Path, *beginnings: str) -> list[str]:
    """The commands on a page, of a line each where they go on after a backslash, that begin with certain words."""
    joined = re.sub(r"\\\n\s*", "", text_of(page))
    lines = (re.sub(r"\s\s+#.*", "", line.strip()) for line in joined.splitlines() if line.startswith("    "))
    return [line for line in lines if line.startswith(beginnings)]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with the files that pages name, in which commands run."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "config").symlink_to(ROOT / "config")
    (drive,) = [b for b in blocks(DOCS / "howto" / "my_own_model.md", "yaml") if "/**" in b]
    (tmp_path / "my_drive.yaml").write_text(drive)
    (motor,) = [b for b in blocks(DOCS / "howto" / "live.md", "yaml") if "/**" in b]
    (tmp_path / "motor.yaml").write_text(motor)
    for name in OWN_FILES:
        (tmp_path / name).write_text(motor)
    t = 0.005 * np.arange(2000)
    u = 4.0 * np.sin(3.0 * t) + 2.0 * np.sin(11.0 * t)
    run = simulate(Model.load(tmp_path / "my_drive.yaml"), t, u[:, None])
    speed = run["speed"] + 0.01 * np.random.default_rng(1).standard_normal(t.size)
    table = np.column_stack([t, u, run["current"], speed, run["position"]])
    header = "t [s],voltage [V],current [A],speed [rad/s],position [rad]"
    np.savetxt(tmp_path / "run.csv", table, delimiter=",", header=header, comments="")
    return tmp_path


# ------------------------------------------------------------------ a model of my own


@pytest.mark.slow
def test_every_command_on_the_page_of_a_model_of_my_own_runs(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    page = DOCS / "howto" / "my_own_model.md"
    lines = commands(page, "signlin ")
    assert len(lines) > 6
    for line in lines:
        if line.startswith("signlin: "):
            continue  # an answer
        code = main(shlex.split(line)[1:])
        assert code == 0, f"{line}\n{capsys.readouterr().err}"
    for block in blocks(page, "python"):
        exec(compile(block, str(page), "exec"), {})
    assert "cogging_torque" in Model.load("with_cogging.yaml").effects


def test_the_model_file_that_is_printed_has_gains_and_a_controller(folder: Path) -> None:
    from signlin_ros.control.controller import Controller, ControllerSettings
    from signlin_ros.nodes.controller_logic import ControllerLogic

    model = Model.load("my_drive.yaml")
    ran = CliRunner().invoke(signlin, ["gains", "my_drive.yaml", "--limit", "12"], catch_exceptions=False)
    assert ran.exit_code == 0
    Controller(model, ControllerSettings(12.0))
    logic = ControllerLogic(Model.load("dc_motor"), ControllerSettings(12.0))
    logic.take_yaml(model.to_yaml())  # as the linearizer tells of a model that it was given while it runs
    assert logic.refused == {}
    assert logic.model.states == model.states


# ------------------------------------------------------------------ nodes


@pytest.fixture
def starts(graph: Any, folder: Path) -> Any:
    """Starts the command of a node as a page prints it, ``ros2 run signlin_ros NAME ...`` or by its path."""
    from .conftest import BIN

    def start(line: str, *more: str) -> Any:
        words = shlex.split(line)
        words = words[3:] if words[:3] == ["ros2", "run", "signlin_ros"] else [Path(words[0]).name, *words[1:]]
        node = words[0] != "signlin"
        run = [str(BIN / words[0])] if node else [sys.executable, "-m", "signlin_ros.cli"]
        return graph.run([*run, *words[1:], *more], str(len(graph.processes)), copied=node)

    return start


PRINTED = [
    (page.stem, line) for page in NODE_PAGES if page.stem != "play" for line in commands(page, "ros2 run signlin_ros ")
]


def test_every_page_of_a_node_prints_how_it_is_started() -> None:
    assert {page for page, _ in PRINTED} == {page.stem for page in NODE_PAGES} - {"play"}
    assert commands(DOCS / "nodes" / "play.md", "ros2 run signlin_ros play ")  # tests/ros/test_play.py plays one


@pytest.mark.slow
@pytest.mark.parametrize(("page", "line"), PRINTED, ids=[page for page, _ in PRINTED])
def test_the_command_that_starts_a_node_starts_it(graph: Any, starts: Any, page: str, line: str) -> None:
    process = starts(line)
    graph.wait(lambda: page in graph.node.get_node_names() or not process.running, f"the node {page}")
    assert process.running, process.output


@pytest.mark.slow
def test_the_nodes_of_a_model_of_my_own_give_models(graph: Any, starts: Any) -> None:
    for line in commands(DOCS / "howto" / "my_own_model.md", ".venv/lib/signlin_ros/"):
        starts(line)
    models = graph.models()
    graph.wait(lambda: len(models) >= 3, "models")


@pytest.mark.slow
def test_the_page_of_a_running_machine_starts_its_nodes_and_its_services_are_there(graph: Any, starts: Any) -> None:
    from std_srvs.srv import Trigger

    page = DOCS / "howto" / "live.md"
    one, *_ = commands(page, "signlin ros up ")
    starts("plant_simulator --ros-args --params-file motor.yaml -p joint_name:=wheel")  # the machine
    process = starts(one)
    models = graph.models()
    graph.wait(lambda: len(models) >= 3 or not process.running, "models")
    assert process.running, process.output
    graph.wait(lambda: {"controller", "monitor"} <= set(graph.node.get_node_names()), "all nodes")
    called = [shlex.split(line)[3:5] for line in commands(page, "ros2 service call ")]
    assert called
    for service, kind in called:
        assert kind == "std_srvs/srv/Trigger"
        there = graph.wait(lambda s=service: dict(graph.node.get_service_names_and_types()).get(s), service)
        assert there == [kind]
    assert not graph.call(Trigger, "/monitor/apply", Trigger.Request()).success  # there is no diagnosis yet


@pytest.mark.parametrize("line", [line for page in sorted((DOCS / "howto").glob("*.md"))
                                  for line in commands(page, "signlin ros up ")])  # fmt: skip
def test_nodes_that_are_started_together_have_arguments_that_they_take(
    folder: Path, monkeypatch: pytest.MonkeyPatch, line: str
) -> None:
    pytest.importorskip("rclpy")
    up, plans = importlib.import_module("sim_nodes.up"), []
    monkeypatch.setattr(up, "up", lambda plan: plans.append(plan) or 0)
    assert CliRunner().invoke(signlin, shlex.split(line)[1:], catch_exceptions=False).exit_code == 0
    (plan,) = plans
    for namespace in plan.namespaces:
        for name in plan.names(namespace):
            module, _, _ = up.NODES[name].partition(":")
            given = [part.partition(":=")[0] for part in plan.arguments(name, namespace) if ":=" in part]
            known = {*importlib.import_module(module).OPTIONS, "__ns"}
            assert set(given) <= known | set(plan_model(plan, namespace)), (name, given)


def plan_model(plan: Any, namespace: str) -> dict[str, Any]:
    """The parameters in the file of a plan's model."""
    content = yaml.safe_load(Path(plan.model_of(namespace)).read_text())
    return dict(next(iter(content.values()))["ros__parameters"])


LAUNCHES = [line for page in sorted(DOCS.rglob("*.md")) for line in commands(page, "ros2 launch signlin_ros ")]


@pytest.mark.parametrize("line", LAUNCHES)
def test_every_launch_that_a_page_prints_has_arguments_that_the_file_takes(folder: Path, line: str) -> None:
    for name in ("my_robot.urdf", "my_controllers.yaml"):
        (folder / name).write_text("")
    name, given = as_printed(line)
    assert "linearizer" in launched(name, **given).nodes
