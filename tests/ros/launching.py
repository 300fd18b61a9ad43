"""Launch files without a launch system: what they would start, as command lines, as `launch_ros` makes them."""

from __future__ import annotations

import runpy
import shlex
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any
from unittest import mock

import yaml

ROOT = Path(__file__).parents[2]
KINDS = {
    "launch": ("LaunchContext", "LaunchDescription"),
    "launch.actions": (
        *("DeclareLaunchArgument", "ExecuteProcess", "LogInfo", "OpaqueFunction"),
        "SetEnvironmentVariable",
    ),
    "launch.conditions": ("IfCondition",),
    "launch.substitutions": ("LaunchConfiguration",),
    "launch_ros": (),
    "launch_ros.actions": ("LifecycleNode", "Node"),
}


class Told:
    """Anything of the launch system: keeps what it was made of."""

    def __init__(self, *given: Any, **named: Any) -> None:
        self.given, self.named = given, named

    def perform(self, context: Mapping[str, str]) -> str:
        return context[self.given[0]]


@dataclass(frozen=True)
class Started:
    """What a launch file starts: nodes of this package, commands, and what it says."""

    nodes: dict[str, Any]
    commands: list[list[str]]
    said: list[str]
    others: list[dict[str, Any]]
    """Nodes of other packages: what they are made of."""

    def parameters(self, node: str) -> dict[str, Any]:
        """What a node is given beside files: the last one wins."""
        found: dict[str, Any] = {}
        for part in self.nodes[node].named["parameters"]:
            found |= part if isinstance(part, dict) else from_file(part)
        return found

    def arguments(self, node: str, folder: Path) -> list[str]:
        """The arguments of a node, as `launch_ros` makes them."""
        named, found = self.nodes[node].named, ["--ros-args"]
        if named.get("name"):
            found += ["-r", f"__node:={named['name']}"]
        if named.get("namespace"):
            found += ["-r", f"__ns:=/{named['namespace'].strip('/')}"]
        found += [word for pair in named.get("remappings", ()) for word in ("-r", ":=".join(pair))]
        for k, part in enumerate(named["parameters"]):
            file = part
            if isinstance(part, dict):
                assert part, "an empty mapping: ROS's parser stumbles over it"
                file = folder / f"{node}_{k}.yaml"
                file.write_text(yaml.safe_dump({"/**": {"ros__parameters": part}}))
            found += ["--params-file", str(file)]
        return found


def from_file(file: str) -> dict[str, Any]:
    """The parameters in a file."""
    path = Path(file)
    content = yaml.safe_load(path.read_text()) if path.is_file() else {"": {"ros__parameters": {}}}
    return dict(next(iter(content.values()))["ros__parameters"])


def launched(name: str, share: Path = ROOT, **given: str) -> Started:
    """Return what a launch file starts under arguments; an argument that it does not declare is an error."""
    made = {module: ModuleType(module) for module in KINDS}
    for module, kinds in KINDS.items():
        for kind in kinds:
            setattr(made[module], kind, type(kind, (Told,), {}))
    index = ModuleType("ament_index_python.packages")
    index.get_package_share_directory = lambda _: str(share)  # type: ignore[attr-defined]
    made |= {"ament_index_python": ModuleType("ament_index_python"), "ament_index_python.packages": index}
    with mock.patch.dict(sys.modules, made):
        file = runpy.run_path(str(ROOT / "config" / "launch" / name))
        actions = file["generate_launch_description"]().given[0]
        declared = {a.given[0]: a.named.get("default_value") for a in actions if kind_of(a) == "DeclareLaunchArgument"}
        unknown = given.keys() - declared.keys()
        assert not unknown, f"{name} declares no {unknown}"
        context = declared | given
        lost = [argument for argument, value in context.items() if value is None]
        assert not lost, f"{name} must be given {lost}"
        late = [one for a in actions if kind_of(a) == "OpaqueFunction" for one in a.named["function"](context)]
    said = [a.named["msg"] for a in late if kind_of(a) == "LogInfo"]
    found = [a for a in (*actions, *late) if kind_of(a) in ("Node", "LifecycleNode")]
    nodes = {a.named["executable"]: a for a in found if a.named["package"] == "signlin_ros"}
    others = [a.named for a in found if a.named["package"] != "signlin_ros"]
    commands = [[part if isinstance(part, str) else part.perform(context) for part in a.named["cmd"]]
                for a in actions if kind_of(a) == "ExecuteProcess"]  # fmt: skip
    return Started(nodes, commands, said, others)


def kind_of(action: Any) -> str:
    return type(action).__name__


def as_printed(line: str) -> tuple[str, dict[str, str]]:
    """Return file and arguments of ``ros2 launch signlin_ros FILE NAME:=VALUE ...``."""
    ros2, launch, package, name, *arguments = shlex.split(line)
    assert (ros2, launch, package) == ("ros2", "launch", "signlin_ros")
    pairs = (one.partition(":=") for one in arguments)
    return name, {key: value for key, _, value in pairs}
