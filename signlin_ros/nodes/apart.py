"""A controller made in a process of its own first: what it has to compile is compiled there, and read here.

Compiling in a thread would hold the interpreter's lock for seconds at a time, and with it the loop.
"""

from __future__ import annotations

import pickle
import subprocess
import sys

from signlin_ros.control.controller import ControllerSettings
from signlin_ros.model import Model

CODE = """
import os, pickle, sys
if hasattr(os, "sched_setscheduler"):
    os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
os.nice(5)
from signlin_ros.control.controller import Controller
from signlin_ros.model import Model
text, folder, settings = pickle.load(sys.stdin.buffer)
Controller(Model.from_yaml(text, "model", folder), settings)
"""
"""What the process does, without the priority of the loop."""


class MadeApart:
    """A process that makes a controller of a model, started at once."""

    def __init__(self, model: Model, settings: ControllerSettings) -> None:
        self._asked = pickle.dumps((model.to_yaml(), model.folder, settings))
        pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.DEVNULL, "stderr": subprocess.PIPE}
        self._process = subprocess.Popen([sys.executable, "-c", CODE], **pipes)  # type: ignore[call-overload]

    def wait(self) -> bool:
        """Wait for its end; return whether it made the controller."""
        self._process.communicate(self._asked)
        return bool(self._process.returncode == 0)

    def stop(self) -> None:
        """End it, if it is still running."""
        if self._process.poll() is None:
            self._process.kill()


__all__ = ["MadeApart"]
