"""All nodes of one or several joints, each a process of its own, without ROS's launch: ``signlin ros up MODEL``.

One process for all would be one executor and one interpreter's lock for all: while one node computes, the others stand
still, and a controller that stands still drives on with its last input.
"""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from signlin_ros.control import CONTROL_PERIOD
from signlin_ros.errors import InputError, choices, suggest
from signlin_ros.model import Model, find_model_file
from signlin_ros.nodes.start import FOLLOWED

NODES = {
    "plant_simulator": "sim_nodes.plant_simulator",
    "replay": "sim_nodes.replay",
    "linearizer": "signlin_ros.nodes.linearizer",
    "monitor": "signlin_ros.nodes.monitor",
    "controller": "signlin_ros.nodes.controller",
}
"""Where each node stands."""
OF_ONE_JOINT = ("monitor", "controller")
"""Nodes that take no arm."""
FIRST_TO_END = "controller"
"""What ends before the others: its last input is a 0, and somebody has to be there to take it."""
OF_A_NAMESPACE = re.compile(r"(?:([A-Za-z_/][\w/]*)=)?(.+)")
"""A model, with the namespace that it is for before it."""
NO_LIMIT = "no controller: give -p controller.limit=..., the largest |input| that the drive may be given"
WATCHDOG_PERIODS = 5
"""Control periods without an input after which a simulated drive's watchdog ends the last one."""
POLL_PERIOD = 0.05
"""Seconds between two looks at whether all still run."""
PATIENCE = 15.0
"""Seconds that a node has for its end; then it is killed."""
CODE = "import sys; from signlin_ros.nodes.start import start; sys.exit(start({!r}))"
"""What runs a node in a process of its own."""


@dataclass(frozen=True)
class StartPlan:
    """What is started: ``model`` for all nodes, ``truth`` for the simulator in its place, one set for each namespace.

    ``models``: those of namespaces that have one of their own. ``parameters``: ``node.name=value``, or ``name=value``
    for all nodes, of one namespace with it and a slash before (``left/joint_name=wheel``). With a ``record``, replay
    takes the place of the simulator; without ``simulated`` neither is started: a real machine is there.
    """

    model: str
    truth: str = ""
    record: str = ""
    namespaces: tuple[str, ...] = ("",)
    simulated: bool = True
    without: tuple[str, ...] = ()
    parameters: tuple[str, ...] = field(default=())
    models: Mapping[str, str] = field(default_factory=dict)

    @classmethod
    def of(cls, models: Sequence[str], namespaces: Sequence[str] = (), **more: Any) -> StartPlan:
        """Make a plan of models as they are given: one, or ``NAMESPACE=MODEL`` for each joint."""
        pairs = [(found[1] or "", found[2]) for one in models if (found := OF_A_NAMESPACE.fullmatch(one))]
        own = {space.strip("/"): model for space, model in pairs if space}
        if len(pairs) > len(own) + (len(pairs) == 1 and not own):
            raise InputError(f"{' '.join(models)}: one MODEL, or NAMESPACE=MODEL for each joint, each namespace once")
        if own and namespaces:
            raise InputError("--namespace: each MODEL has its namespace before it already")
        return cls(pairs[0][1], namespaces=tuple(own or namespaces or ("",)), models=own, **more)

    def model_of(self, namespace: str) -> str:
        """Return the model of a namespace."""
        return self.models.get(namespace.strip("/"), self.model)

    def names(self, namespace: str = "") -> list[str]:
        """Return the nodes of one namespace; raise `InputError` on an unknown one."""
        unknown = [name for name in self.without if name not in NODES]
        if unknown:
            raise InputError(f"{unknown[0]}: no node; known: {choices(NODES)}{suggest(unknown[0], NODES)}")
        source = ["replay"] if self.record else ["plant_simulator"] if self.simulated else []
        found = [*source, "linearizer", "monitor", *(["controller"] if self.is_limited(namespace) else [])]
        if Model.load(self.model_of(namespace)).plant.name == "arm":
            found = [name for name in found if name not in OF_ONE_JOINT]
        return [name for name in found if name not in self.without]

    def is_limited(self, namespace: str = "") -> bool:
        """Tell whether a limit of the input was given, here or in the model; without one no controller starts."""
        given = [part.partition(":=")[0] for part in self._given("controller", namespace)]
        return "limit" in given or "limit" in Model.load(self.model_of(namespace)).node_options

    def watchdog(self, namespace: str = "") -> list[str]:
        """Return what gives the simulated drive of a controller a watchdog, as a real one has; nothing where it is set.

        Without one a drive goes on with its last input while its controller is kept waiting.
        """
        own = [*self._given("plant_simulator", namespace), *Model.load(self.model_of(namespace)).node_options]
        if "controller" not in self.names(namespace) or any(part.startswith("watchdog") for part in own):
            return []
        given = [part.partition(":=") for part in self._given("controller", namespace)]
        options = Model.load(self.model_of(namespace)).node_options | {name: value for name, _, value in given}
        return ["-p", f"watchdog:={WATCHDOG_PERIODS * float(options.get('control_period', CONTROL_PERIOD)):g}"]

    def _given(self, node: str, namespace: str) -> list[str]:
        """Return the parameters of a node in a namespace, as a command line has them."""
        found = [_in_namespace(text, self.namespaces) for text in self.parameters]
        there = [text for space, text in found if space in (None, namespace.strip("/"))]
        return [part for text in there for part in _parameter(text, node)]

    def arguments(self, name: str, namespace: str) -> list[str]:
        """Return the arguments of a node, as a command line has them."""
        model = self.truth if name == "plant_simulator" and self.truth else self.model_of(namespace)
        file = find_model_file(model)
        own = [*self._given(name, namespace), *(self.watchdog(namespace) if name == "plant_simulator" else [])]
        record = ["-p", f"record:={Path(self.record).resolve()}"] if name == "replay" else []
        place = ["-r", f"__ns:=/{namespace.strip('/')}"] if namespace.strip("/") else []
        return ["--ros-args", "--params-file", str(file), *place, *record, *own]

    def commands(self) -> dict[str, list[str]]:
        """Return the command line of every process by its name, ``/left/controller``."""
        found = {}
        for namespace in self.namespaces:
            place = f"/{namespace.strip('/')}".rstrip("/")
            for name in self.names(namespace):
                start = [sys.executable, "-c", CODE.format(NODES[name])]
                found[f"{place}/{name}"] = [*start, *self.arguments(name, namespace)]
        return found


def _in_namespace(text: str, namespaces: Sequence[str]) -> tuple[str | None, str]:
    """Return the namespace that a parameter is for, None for all, and the parameter without it."""
    space, slash, rest = text.partition("=")[0].rpartition("/")
    if not slash:
        return None, text
    known = [name.strip("/") for name in namespaces]
    if space.strip("/") not in known:
        raise InputError(f"-p {text}: {space!r} is no namespace; there are: {choices(known)}{suggest(space, known)}")
    return space.strip("/"), rest + text[len(space) + 1 + len(rest) :]


def _parameter(text: str, node: str) -> Iterator[str]:
    key, equals, value = text.partition("=")
    target, dot, name = key.partition(".")
    if not equals:
        raise InputError(f"-p: found {text!r}; allowed: NODE.NAME=VALUE, or NAME=VALUE for all nodes")
    if target == node and dot:
        yield from ("-p", f"{name}:={value}")
    elif not dot or target not in NODES:
        yield from ("-p", f"{key}:={value}")


class ProcessGroup:
    """Processes that run together: one that ends by itself is the end of all.

    The controllers end first, so that their last input, a 0, is taken; then the others.
    """

    def __init__(self, commands: dict[str, list[str]]) -> None:
        self.asked = False
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._ask)
        env = {**os.environ, FOLLOWED: str(os.getpid())}
        self.running: dict[str, subprocess.Popen[bytes]] = {}
        for name, command in commands.items():
            self.running[name] = subprocess.Popen(command, stdin=subprocess.DEVNULL, env=env)

    def _ask(self, *_: Any) -> None:
        self.asked = True

    def run(self) -> int:
        """Wait until a signal, or the end of one; end all, and return the exit code: that of the one that ended."""
        while not self.asked and all(process.poll() is None for process in self.running.values()):
            time.sleep(POLL_PERIOD)
        ended = {name: p.returncode for name, p in self.running.items() if p.poll() is not None}
        for name, code in ended.items():
            if code and not self.asked:
                sys.stderr.write(f"signlin: {name} has ended with exit code {code}: all nodes end\n")
        last = [name for name in self.running if not name.endswith(f"/{FIRST_TO_END}")]
        self._end([name for name in self.running if name not in last])
        self._end(last)
        return 0 if self.asked else max((code if code >= 0 else 1 for code in ended.values()), default=0)

    def _end(self, names: Sequence[str]) -> None:
        for name in names:
            if self.running[name].poll() is None:
                self.running[name].send_signal(signal.SIGINT)
        until = time.monotonic() + PATIENCE
        while time.monotonic() < until and any(self.running[name].poll() is None for name in names):
            time.sleep(POLL_PERIOD)
        for name in names:
            if self.running[name].poll() is None:
                sys.stderr.write(f"signlin: {name} does not end: killed\n")
                self.running[name].kill()
                self.running[name].wait()


def up(plan: StartPlan) -> int:
    """Run all nodes until a signal, the end of the record, or of a node; return the exit code."""
    commands = plan.commands()
    for namespace in plan.namespaces:
        if not plan.is_limited(namespace) and "controller" not in plan.without:
            sys.stderr.write(f"{namespace or 'signlin'}: {NO_LIMIT}\n")
    return ProcessGroup(commands).run()


__all__ = ["NODES", "ProcessGroup", "StartPlan", "up"]
