"""What the launch files start, with a launch system of which only the arguments are looked at."""

from __future__ import annotations

import runpy
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest

ROOT = Path(__file__).parents[2]


class Told:
    """Anything of the launch system: keeps what it was made of."""

    def __init__(self, *given: Any, **named: Any) -> None:
        self.given, self.named = given, named

    def perform(self, context: dict[str, str]) -> str:
        return context[self.given[0]]


@pytest.fixture
def live(monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
    names = {
        "launch": ("LaunchContext", "LaunchDescription"),
        "launch.actions": (
            "DeclareLaunchArgument",
            "ExecuteProcess",
            "LogInfo",
            "OpaqueFunction",
            "SetEnvironmentVariable",
        ),
        "launch.conditions": ("IfCondition",),
        "launch.substitutions": ("LaunchConfiguration",),
        "launch_ros": (),
        "launch_ros.actions": ("LifecycleNode", "Node"),
    }
    for module, kinds in names.items():
        made = ModuleType(module)
        for kind in kinds:
            setattr(made, kind, type(kind, (Told,), {}))
        monkeypatch.setitem(sys.modules, module, made)
    index = ModuleType("ament_index_python.packages")
    index.get_package_share_directory = lambda _: str(ROOT)  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "ament_index_python", ModuleType("ament_index_python"))
    monkeypatch.setitem(sys.modules, "ament_index_python.packages", index)
    return SimpleNamespace(**runpy.run_path(str(ROOT / "config" / "launch" / "live.launch.py")))


def settled(live: SimpleNamespace, **given: str) -> tuple[list[Any], dict[str, str]]:
    """Return what is started for the controller, under these arguments and the defaults of the others."""
    actions = live.generate_launch_description().given[0]
    arguments = {a.given[0]: a.named["default_value"] for a in actions if type(a).__name__ == "DeclareLaunchArgument"}
    (late,) = (a for a in actions if type(a).__name__ == "OpaqueFunction")
    return late.named["function"](arguments | given), arguments


def test_the_shipped_motor_gets_a_controller_that_starts(live: SimpleNamespace) -> None:
    from signlin_ros.control.controller import Controller, ControllerSettings
    from signlin_ros.model import Model

    (node,), arguments = settled(live)
    file, options = node.named["parameters"]
    assert node.named["executable"] == "controller"
    assert options["joint_name"] == arguments["joint_name"]
    assert Path(file).is_file()
    Controller(Model.load(Path(file)), ControllerSettings(options["limit"]))


@pytest.mark.parametrize("limit", ["", "0"])
def test_a_drive_of_which_no_limit_is_known_gets_no_controller_and_a_line_that_says_so(
    live: SimpleNamespace, limit: str
) -> None:
    (told,), _ = settled(live, params_file="/somewhere/mine.yaml", limit=limit)
    assert type(told).__name__ == "LogInfo"
    assert "limit:=" in told.named["msg"]


def test_a_limit_that_is_given_counts(live: SimpleNamespace) -> None:
    for file in ({}, {"params_file": "/somewhere/mine.yaml"}):
        (node,), _ = settled(live, limit="5.5", **file)
        assert node.named["parameters"][1]["limit"] == 5.5
