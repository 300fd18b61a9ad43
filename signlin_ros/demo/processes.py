"""Plant and linearizers as processes over ROS 2, and what is heard of them."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import sysconfig
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from signlin_ros.errors import MissingExtraError, SignlinError

if TYPE_CHECKING:
    from signlin_ros.nodes.listen import Heard, Listener

MODEL = "dc_motor"
AMPLITUDE, INPUT_PERIOD, PUBLISH_RATE = 2.0, 2.23, 200.0
"""Of the plant: voltage in V, period of the square in s, published states per second.

The seven reversals, 1.115 s apart, spread evenly over the update period of 0.2 s, so that the result hardly
depends on when a linearizer happened to start."""
LINEARIZERS = {"start": "linearizer", "midpoint": "linearizer_midpoint"}
"""Operating point and name of each linearizer."""
START_PATIENCE, RUN_PATIENCE, STOP_PATIENCE = 180.0, 30.0, 15.0
"""Seconds to wait: for a node to be there (the first run on a machine compiles), beyond the run, for an end."""


class DemoError(SignlinError):
    """The demo cannot go on; the message says why."""


def prefix() -> Path:
    """Return where the executables, the models and the discovery profile are installed."""
    places = [sys.prefix, sysconfig.get_path("data"), *os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)]
    for place in places:
        if place and (Path(place) / "lib" / "signlin_ros" / "linearizer").is_file():
            return Path(place)
    raise DemoError(f"no lib/signlin_ros/linearizer below {sys.prefix} or AMENT_PREFIX_PATH: install the package first")


class Processes:
    """Executables from ``lib/signlin_ros`` in one namespace, each with its output in a file; all are ended."""

    def __init__(self, place: Path, namespace: str, logs: Path) -> None:
        self._place, self._namespace, self._logs = place, namespace, logs
        self._running: dict[str, subprocess.Popen[bytes]] = {}

    def start(self, executable: str, name: str, *parameters: str) -> None:
        """Start an executable as ``ros2 run`` would, as node ``name``, with parameters ``key:=value``."""
        file = self._place / "share" / "signlin_ros" / "config" / f"{MODEL}.yaml"
        remap = ["-r", f"__ns:={self._namespace}", "-r", f"__node:={name}"]
        options = [part for parameter in parameters for part in ("-p", parameter)]
        program = str(self._place / "lib" / "signlin_ros" / executable)
        with (self._logs / name).open("wb") as out:
            self._running[name] = subprocess.Popen(
                [program, "--ros-args", "--params-file", str(file), *remap, *options], stdout=out, stderr=out
            )

    def check(self) -> None:
        """Raise `DemoError` with the last of its output if one has ended."""
        for name, process in self._running.items():
            if process.poll() is not None:
                raise DemoError(f"{name} has ended with exit code {process.returncode}:\n{self.tail(name)}")

    def tail(self, name: str) -> str:
        """Return the last lines of a process's output."""
        return "\n".join((self._logs / name).read_text(errors="replace").splitlines()[-15:])

    def stop(self) -> dict[str, int]:
        """Interrupt all, wait for their ends, return their exit codes; what does not end is killed."""
        for process in self._running.values():
            if process.poll() is None:
                process.send_signal(signal.SIGINT)
        return {name: _end(process) for name, process in self._running.items()}


def _end(process: subprocess.Popen[bytes]) -> int:
    try:
        return process.wait(STOP_PATIENCE)
    except subprocess.TimeoutExpired:
        process.kill()
        return process.wait()


@contextlib.contextmanager
def _processes(place: Path, namespace: str) -> Iterator[Processes]:
    with tempfile.TemporaryDirectory(prefix="signlin_demo_") as logs:
        processes = Processes(place, namespace, Path(logs))
        try:
            yield processes
        finally:
            codes = processes.stop()
        for name, code in codes.items():
            if code != 0:
                raise DemoError(f"{name} ended with exit code {code} when asked to stop:\n{processes.tail(name)}")


def _listener(namespace: str) -> Listener:
    try:
        from signlin_ros.nodes.listen import Listener
    except ModuleNotFoundError as error:
        if error.name is None or error.name.startswith("signlin_ros"):
            raise
        raise MissingExtraError("The demo", "ros") from error
    return Listener(namespace, LINEARIZERS.values())


def _stay_on_this_machine(place: Path) -> None:
    """Set discovery for this process and its children: quick, and local unless the user says otherwise."""
    profile = place / "share" / "signlin_ros" / "config" / "fastdds_profile.xml"
    os.environ.setdefault("FASTRTPS_DEFAULT_PROFILES_FILE", str(profile))
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")


def listen(seconds: float, say: Callable[[str], None]) -> Heard:
    """Run plant and linearizers for some seconds after the plant's first state; return what they published."""
    place = prefix()
    _stay_on_this_machine(place)
    namespace = f"/signlin_demo_{os.getpid()}"
    with _listener(namespace) as listener, _processes(place, namespace) as processes:

        def wait(condition: Callable[[], bool], patience: float, what: str) -> None:
            end = time.monotonic() + patience
            while not listener.wait(condition, 1.0):
                processes.check()
                if time.monotonic() > end:
                    raise DemoError(f"waited {patience:g} s in vain for {what}")

        say("starting two linearizers (the first run on a machine compiles: half a minute) ...")
        for point, name in LINEARIZERS.items():
            processes.start("linearizer", name, f"operating_point:={point}")
        wait(lambda: listener.linearizers_ready, START_PATIENCE, "the linearizers")
        say("starting the plant simulator ...")
        drive = ("input_signal:=square", f"amplitude:={AMPLITUDE}", f"input_period:={INPUT_PERIOD}")
        processes.start("plant_simulator", "plant_simulator", *drive, f"publish_rate:={PUBLISH_RATE}")
        wait(
            lambda: listener.span > 0 and listener.all_publish, START_PATIENCE, "the plant's state and the first models"
        )
        listener.forget()
        say(f"listening for {seconds:g} s ...")
        wait(lambda: listener.span >= seconds, seconds + RUN_PATIENCE, "the plant's states")
        return listener.heard()


__all__ = [
    "AMPLITUDE",
    "INPUT_PERIOD",
    "LINEARIZERS",
    "MODEL",
    "PUBLISH_RATE",
    "RUN_PATIENCE",
    "START_PATIENCE",
    "STOP_PATIENCE",
    "DemoError",
    "Processes",
    "listen",
    "prefix",
]
