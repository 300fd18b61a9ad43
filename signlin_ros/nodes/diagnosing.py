"""A diagnosis in a process of its own, so that callbacks keep their rate; nothing here waits."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

from signlin_ros.errors import SignlinError
from signlin_ros.model import Model
from signlin_ros.records import Record, write_record


class Diagnosis:
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
        self._process = subprocess.Popen(
            self._command(), stdout=self._out, stderr=self._errors, stdin=subprocess.DEVNULL
        )

    def _command(self) -> list[str]:
        verb = ["refine", str(self.model_file), str(self.data_file), "-o", str(self.better_file)]
        return [sys.executable, "-m", "signlin_ros.cli", *verb, "--json", "--report", str(self.report_file)]

    @property
    def running(self) -> bool:
        """Whether the process is at work."""
        return self._process.poll() is None

    @property
    def seconds(self) -> float:
        """How long it has been running."""
        return time.monotonic() - self.begun

    def result(self) -> dict[str, Any]:
        """Return the verdict as ``signlin refine --json`` gives it; raise `SignlinError` where there is none."""
        self._out.close()
        self._errors.close()
        try:
            if self._process.returncode == 0:
                return dict(json.loads((self.folder / "verdict.json").read_text(encoding="utf-8")))
        except ValueError:
            pass
        last = (self.folder / "errors.txt").read_text(errors="replace").strip().splitlines()
        why = last[-1] if last else f"it ended with exit code {self._process.returncode}"
        raise SignlinError(f"no diagnosis: {why}")

    def stop(self) -> None:
        """End it, if it is still running."""
        if self.running:
            self._process.kill()
            self._process.wait()


__all__ = ["Diagnosis"]
