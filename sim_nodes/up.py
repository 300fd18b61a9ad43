"""All nodes of one or several joints in one process, without ROS's launch: ``signlin ros up MODEL``."""

from __future__ import annotations

import importlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from rclpy.logging import get_logger
from rclpy.node import Node

from signlin_ros.errors import InputError, choices, suggest
from signlin_ros.model import Model, find_model_file
from signlin_ros.nodes.parameters import given
from signlin_ros.nodes.runner import run

NODES = {
    "plant_simulator": "sim_nodes.plant_simulator:PlantSimulatorNode",
    "replay": "sim_nodes.replay:ReplayNode",
    "linearizer": "signlin_ros.nodes.linearizer:LinearizerNode",
    "monitor": "signlin_ros.nodes.monitor:MonitorNode",
    "controller": "signlin_ros.nodes.controller:ControllerNode",
}
"""Where each node stands."""
OF_ONE_JOINT = ("monitor", "controller")
"""Nodes that take no arm."""
NO_LIMIT = "no controller: give -p controller.limit=..., the largest |input| that the drive may be given"


@dataclass(frozen=True)
class StartPlan:
    """What is started: ``model`` for all nodes, ``truth`` for the simulator in its place, one set for each namespace.

    ``parameters``: ``node.name=value``, or ``name=value`` for all nodes. With a ``record``, replay takes the place of
    the simulator; without ``simulated`` neither is started: a real machine is there.
    """

    model: str
    truth: str = ""
    record: str = ""
    namespaces: tuple[str, ...] = ("",)
    simulated: bool = True
    without: tuple[str, ...] = ()
    parameters: tuple[str, ...] = field(default=())

    def names(self) -> list[str]:
        """Return the nodes of one namespace; raise `InputError` on an unknown one."""
        unknown = [name for name in self.without if name not in NODES]
        if unknown:
            raise InputError(f"{unknown[0]}: no node; known: {choices(NODES)}{suggest(unknown[0], NODES)}")
        source = ["replay"] if self.record else ["plant_simulator"] if self.simulated else []
        found = [*source, "linearizer", "monitor", *(["controller"] if self.is_limited else [])]
        if Model.load(self.model).plant.name == "arm":
            found = [name for name in found if name not in OF_ONE_JOINT]
        return [name for name in found if name not in self.without]

    @property
    def is_limited(self) -> bool:
        """Whether a limit of the input was given: a controller does not start without one."""
        given = [part.partition(":=")[0] for text in self.parameters for part in _parameter(text, "controller")]
        return "limit" in given

    def arguments(self, name: str, namespace: str) -> list[str]:
        """Return the arguments of a node, as a command line has them."""
        model = self.truth if name == "plant_simulator" and self.truth else self.model
        file = find_model_file(model)
        own = [part for text in self.parameters for part in _parameter(text, name)]
        record = ["-p", f"record:={Path(self.record).resolve()}"] if name == "replay" else []
        place = ["-r", f"__ns:=/{namespace.strip('/')}"] if namespace.strip("/") else []
        return ["--ros-args", "--params-file", str(file), *place, *record, *own]


def _parameter(text: str, node: str) -> Iterator[str]:
    key, equals, value = text.partition("=")
    target, dot, name = key.partition(".")
    if not equals:
        raise InputError(f"-p: found {text!r}; allowed: NODE.NAME=VALUE, or NAME=VALUE for all nodes")
    if target == node and dot:
        yield from ("-p", f"{name}:={value}")
    elif not dot or target not in NODES:
        yield from ("-p", f"{key}:={value}")


def nodes(plan: StartPlan) -> list[Node]:
    """Make all nodes; raise `InputError` for what the user gave."""
    found: list[Node] = []
    try:
        for namespace in plan.namespaces:
            for name in plan.names():
                with given(plan.arguments(name, namespace)):
                    found.append(_class(name)())
    except BaseException:
        for node in found:
            node.destroy_node()
        raise
    return found


def _class(name: str) -> type[Node]:
    module, _, kind = NODES[name].partition(":")
    return getattr(importlib.import_module(module), kind)  # type: ignore[no-any-return]


def up(plan: StartPlan, arguments: Sequence[str] = ()) -> int:
    """Run all nodes until a signal, or the end of the record; return the exit code."""
    if not plan.is_limited and "controller" not in plan.without:
        get_logger("signlin").warning(NO_LIMIT)
    return run("signlin", lambda: nodes(plan), ["signlin", *arguments])


__all__ = ["NODES", "StartPlan", "up"]
