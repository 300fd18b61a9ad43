"""What the monitor is asked for and does beside its watch, without rclpy: a diagnosis, a plan of the next record."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from signlin_ros.errors import SignlinError
from signlin_ros.nodes.diagnosing import DiagnosisProcess, Planning
from signlin_ros.nodes.monitor_logic import MonitorLogic
from signlin_ros.records import write_record

Answer = tuple[bool, str]
Tell = Callable[[dict[str, Any]], None]


class Diagnoses:
    """One diagnosis and one plan at a time, each in a process of its own.

    Parameters
    ----------
    folder : where their files, and records, are written.
    most_rows : of a record that is diagnosed: a fit takes as long as there are rows.
    tell, tell_plan : told of how a diagnosis and a plan stand, as mappings with ``state`` and ``sentence``.
    log : told of what has ended, in a sentence.
    """

    def __init__(self, folder: Path, most_rows: int, tell: Tell, tell_plan: Tell, log: Callable[[str], None]) -> None:
        self._most_rows = most_rows
        self._folder, self._tell, self._tell_plan, self._log = folder, tell, tell_plan, log
        self.better: Path | None = None
        """The model that the last diagnosis found."""
        self._diagnosed: Path | None = None
        self._diagnosis: DiagnosisProcess | None = None
        self._planning: Planning | None = None

    # ---------------------------------------------------------------- what is asked for

    def diagnose(self, logic: MonitorLogic, since: int) -> Answer:
        """Start a diagnosis of what is kept since a time in ns."""
        if self._diagnosis is not None:
            return False, "a diagnosis is running already"
        try:
            record = logic.record(since=since, most=self._most_rows)
            if logic.model is None:
                return False, "there is no model yet"
            self._diagnosis = DiagnosisProcess(logic.model, record, self._new_folder("diagnosis"))
        except (SignlinError, OSError) as error:
            return False, str(error)
        self.tell_running()
        return True, f"{record.t[-1]:.1f} s of data, {len(record)} rows; files in {self._diagnosis.folder}"

    def experiment(self) -> Answer:
        """Start a plan of the next record, from the last diagnosis."""
        if self._diagnosed is None:
            return False, "there is no diagnosis: call ~/diagnose first"
        if self._planning is not None:
            return False, "a plan is being made already"
        self._planning = Planning(self._diagnosed)
        self._tell_plan({"state": "running", "sentence": "a plan is being made"})
        return True, f"see ~/plan; files in {self._diagnosed}"

    def cancel(self) -> Answer:
        """End a diagnosis and a plan that are being made."""
        said = []
        if self._diagnosis is not None:
            said.append(f"the diagnosis was cancelled after {self._diagnosis.seconds:.0f} s")
            self._tell({"state": "cancelled", "sentence": said[-1]})
        if self._planning is not None:
            said.append("the plan was cancelled")
            self._tell_plan({"state": "cancelled", "sentence": said[-1]})
        self.stop()
        return bool(said), "; ".join(said) or "neither a diagnosis nor a plan is being made"

    def record(self, logic: MonitorLogic) -> Answer:
        """Write what is kept as an mcap file."""
        try:
            file = self._new_folder("record") / "record.mcap"
            write_record(logic.record(), file, model=logic.model)
        except (SignlinError, OSError) as error:
            return False, str(error)
        return True, str(file)

    # ---------------------------------------------------------------- how it goes on

    def look(self) -> None:
        """Tell of what has ended since."""
        self._look_after_diagnosis()
        self._look_after_plan()

    def tell_running(self) -> None:
        """Tell how far a diagnosis is, if one is running."""
        if self._diagnosis is None:
            return
        (share, stage), seconds = self._diagnosis.stage, self._diagnosis.seconds
        sentence = f"a diagnosis is running, for {seconds:.0f} s: {100 * share:.0f} %, {stage}"
        told = {"seconds": round(seconds, 1), "progress": share, "stage": stage, "sentence": sentence}
        self._tell({"state": "running", **told})

    def stop(self) -> None:
        """End what is running."""
        for process in (self._diagnosis, self._planning):
            if process is not None:
                process.stop()
        self._diagnosis = self._planning = None

    def _look_after_diagnosis(self) -> None:
        if self._diagnosis is None or self._diagnosis.running:
            return
        found, self._diagnosis = self._diagnosis, None
        try:
            verdict = found.result()
        except SignlinError as error:
            self._tell({"state": "failed", "why": str(error), "sentence": str(error)})
            self._log(str(error))
            return
        self.better, self._diagnosed = found.better_file if found.better_file.is_file() else None, found.folder
        files = {"model_file": str(self.better or ""), "report": str(found.report_file)}
        self._tell({"state": "done", **files, **verdict})
        self._log(f"diagnosis: {verdict.get('verdict')}; {found.folder}")

    def _look_after_plan(self) -> None:
        if self._planning is None or self._planning.running:
            return
        found, self._planning = self._planning, None
        try:
            plan = {"state": "done", "file": str(found.file), "report": str(found.report_file), **found.result()}
        except SignlinError as error:
            plan = {"state": "failed", "why": str(error), "sentence": str(error)}
        self._tell_plan(plan)
        self._log(f"plan: {plan['sentence']}")

    def _new_folder(self, what: str) -> Path:
        folder = self._folder / f"{what}_{time.strftime('%Y%m%d_%H%M%S')}_{os.getpid()}"
        folder.mkdir(parents=True, exist_ok=True)
        return folder


__all__ = ["Diagnoses"]
