"""A diagnosis, or a first word of what has changed, in a process of its own: callbacks keep their rate."""

from __future__ import annotations

import json
import os
import pickle
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from signlin_ros.errors import SignlinError
from signlin_ros.model import Model
from signlin_ros.names import PROGRESS_ASKED
from signlin_ros.observe.naming import Question
from signlin_ros.records import Record, write_record

NICE = 5
POLITELY = f"import os, sys; os.nice({NICE}); from signlin_ros.%s import main; sys.exit(main())"
"""What a process runs: the ``main`` of a module, with all others before it."""

STAGE = re.compile(r"^\s*(\d+) %  (.*)$", re.MULTILINE)
"""How a verb tells how far it is."""


class DiagnosisProcess:
    """``signlin refine`` on a record, started at once; files stand in ``folder``."""

    def __init__(self, model: Model, record: Record, folder: Path) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self.folder, self.begun = folder, time.monotonic()
        self.model_file, self.better_file = folder / "model.yaml", folder / "better.yaml"
        self.data_file, self.report_file = folder / "record.csv", folder / "report.html"
        model.save(self.model_file)
        write_record(record, self.data_file, with_units=True)
        for file in (self.better_file, self.report_file):
            file.unlink(missing_ok=True)
        self._out, self._errors = (folder / "verdict.json").open("wb"), (folder / "errors.txt").open("wb")
        verb = ["refine", str(self.model_file), str(self.data_file), "-o", str(self.better_file)]
        self._process = self._started(*verb, "--json", "--report", str(self.report_file))
        self._warming: subprocess.Popen[bytes] | None = None

    def _started(self, *verb: str) -> subprocess.Popen[bytes]:
        """Start a verb as a process that leaves the processor to whoever has times to keep."""
        out = self._errors if self._out.closed else self._out
        return _politely("cli", verb, stdin=subprocess.DEVNULL, stdout=out, stderr=self._errors)

    @property
    def running(self) -> bool:
        """Whether a process is at work: the diagnosis, then what compiles ahead that the better model will need."""
        if self._process.poll() is None:
            return True
        if self._warming is None and self._process.returncode == 0 and self.better_file.is_file():
            self._out.close()
            self._warming = self._started("warm", str(self.better_file))
        return self._warming is not None and self._warming.poll() is None

    @property
    def seconds(self) -> float:
        """How long it has been running."""
        return time.monotonic() - self.begun

    @property
    def stage(self) -> tuple[float, str]:
        """How far it is: the share of the work that is done, and what is being done."""
        if self._warming is not None:
            return 1.0, "compiling the better model"
        said = STAGE.findall((self.folder / "errors.txt").read_text(errors="replace"))
        return (float(said[-1][0]) / 100, said[-1][1].strip()) if said else (0.0, "reading the record")

    def result(self) -> dict[str, Any]:
        """Return the verdict as ``signlin refine --json`` gives it; raise `SignlinError` where there is none."""
        self._out.close()
        self._errors.close()
        try:
            if self._process.returncode == 0:
                return dict(json.loads((self.folder / "verdict.json").read_text(encoding="utf-8")))
        except ValueError:
            pass
        why = _last_line(self.folder / "errors.txt") or f"it ended with exit code {self._process.returncode}"
        raise SignlinError(f"no diagnosis: {why}")

    def stop(self) -> None:
        """End it, if it is still running."""
        for process in (self._process, self._warming):
            if process is not None:
                _end(process)
        self._out.close()
        self._errors.close()


class Planning:
    """``signlin experiment`` for a diagnosis that has ended in ``folder``, started at once; limits are what its record
    visited.
    """

    def __init__(self, folder: Path) -> None:
        self.folder, self.file, self.report_file = folder, folder / "next.csv", folder / "next.html"
        verb = ["experiment", str(folder / "verdict.json"), "-o", str(self.file), "--report", str(self.report_file)]
        self._out, self._errors = (folder / "plan.json").open("wb"), (folder / "plan_errors.txt").open("wb")
        self._process = _politely(
            "cli", [*verb, "--json"], stdin=subprocess.DEVNULL, stdout=self._out, stderr=self._errors
        )

    @property
    def running(self) -> bool:
        """Whether the process is at work."""
        return bool(self._process.poll() is None)

    def result(self) -> dict[str, Any]:
        """Return the plan as ``signlin experiment --json`` gives it; raise `SignlinError` where there is none."""
        self._out.close()
        self._errors.close()
        if self._process.returncode == 0:
            return dict(json.loads((self.folder / "plan.json").read_text(encoding="utf-8")))
        why = _last_line(self.folder / "plan_errors.txt")
        raise SignlinError(why or f"no plan: it ended with exit code {self._process.returncode}")

    def stop(self) -> None:
        """End it, if it is still running."""
        _end(self._process)
        self._out.close()
        self._errors.close()


class Naming:
    """A `Question` put to a process, started at once."""

    def __init__(self, question: Question) -> None:
        with tempfile.TemporaryFile() as asked:
            pickle.dump(question, asked)
            asked.seek(0)
            self._process = _politely("observe.naming", [], stdin=asked, stdout=subprocess.PIPE, stderr=subprocess.PIPE)

    @property
    def running(self) -> bool:
        """Whether the process is at work."""
        return self._process.poll() is None

    def result(self) -> list[dict[str, Any]]:
        """Return the possible changes, the likeliest first: name, value, unit, gain and sentence of each.

        Raises `SignlinError` where the process gave no answer.
        """
        said, errors = self._process.communicate()
        try:
            return list(json.loads(said))
        except ValueError:
            last = errors.decode(errors="replace").strip().splitlines()
            raise SignlinError(f"what has changed was not found: {last[-1] if last else 'no answer'}") from None

    def stop(self) -> None:
        """End it, if it is still running."""
        _end(self._process)
        self._process.communicate()


def _last_line(file: Path) -> str:
    """Return the last line that a verb wrote into a file besides how far it is; empty where there is none."""
    return next(iter(reversed(STAGE.sub("", file.read_text(errors="replace")).strip().splitlines())), "")


def _politely(module: str, arguments: Sequence[str], **streams: Any) -> subprocess.Popen[bytes]:
    """Start the ``main`` of a module as a process with all others before it, and with what it starts in a group."""
    command = [sys.executable, "-c", POLITELY % module, *arguments]
    env = {**os.environ, PROGRESS_ASKED: "1"}
    return subprocess.Popen(command, env=env, start_new_session=True, **streams)


def _end(process: subprocess.Popen[bytes]) -> None:
    """End a process and all that it has started, if it is still running."""
    if process.poll() is None:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()


__all__ = ["DiagnosisProcess", "Naming", "Planning"]
