"""Timing, and the lines that a benchmark prints."""

from __future__ import annotations

import gc
import json
import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path


@dataclass(frozen=True)
class Timing:
    """Seconds per call: the median and the smallest of ``repeats`` rounds of ``calls`` calls each."""

    median: float
    best: float
    repeats: int
    calls: int

    def text(self, unit: str = "µs", points: int = 1) -> str:
        """Return the median in a unit, per point of a batch, with the smallest and the counts."""
        factor = {"µs": 1e6, "ms": 1e3, "s": 1.0}[unit] / points
        counts = f"median of {self.repeats} x {self.calls}"
        return f"{self.median * factor:10.4g} {unit}   (best {self.best * factor:.4g}, {counts})"


def timed(calls: dict[str, tuple[Callable[[], object], int]], repeats: int = 9, warm: bool = True) -> dict[str, Timing]:
    """Time several functions against each other: in every round each is called its number of times.

    The rounds interleave, so that a machine that is busy for a while slows all of them and leaves their ratios.
    ``warm``: call each once before.
    """
    rounds: dict[str, list[float]] = {name: [] for name in calls}
    for function, _ in calls.values() if warm else ():
        function()
    gc.disable()
    try:
        for _ in range(repeats):
            for name, (function, count) in calls.items():
                start = time.perf_counter()
                for _ in range(count):
                    function()
                rounds[name].append((time.perf_counter() - start) / count)
    finally:
        gc.enable()
    return {
        name: Timing(statistics.median(found), min(found), repeats, calls[name][1]) for name, found in rounds.items()
    }


@dataclass
class Report:
    """Prints sections, figures and verdicts as they come, and keeps the figures for a JSON file."""

    figures: dict[str, float] = field(default_factory=dict)
    verdicts: list[tuple[bool, str]] = field(default_factory=list)

    def section(self, title: str) -> None:
        print(f"\n{title}\n{'-' * len(title)}", flush=True)

    def line(self, label: str, text: str) -> None:
        print(f"  {label:<46} {text}", flush=True)

    def timing(self, key: str, label: str, timing: Timing, unit: str = "µs", points: int = 1) -> None:
        self.figures[f"{key} [s]"] = timing.median / points
        self.line(label, timing.text(unit, points))

    def ratio(self, key: str, label: str, value: float) -> None:
        self.figures[key] = value
        self.line(label, f"{value:10.3g} x")

    def target(self, label: str, value: float, low: float = 0.0, high: float = float("inf"), unit: str = "") -> None:
        """Say whether low <= value <= high."""
        good = low <= value <= high
        wanted = f">= {low:g}" if high == float("inf") else f"<= {high:g}" if low == 0.0 else f"{low:g} ... {high:g}"
        text = f"{label}: {value:.4g} {unit}".rstrip() + f" (target {wanted} {unit}".rstrip() + ")"
        self.verdicts.append((good, text))
        print(f"  {'PASS' if good else 'FAIL'}  {text}", flush=True)

    def summary(self) -> None:
        self.section("Targets")
        for good, text in self.verdicts:
            print(f"  {'PASS' if good else 'FAIL'}  {text}")

    def save(self, file: Path) -> None:
        """Write the figures and the verdicts as JSON."""
        file.parent.mkdir(parents=True, exist_ok=True)
        verdicts = [{"pass": good, "target": text} for good, text in self.verdicts]
        content = {"figures": self.figures, "targets": verdicts}
        file.write_text(json.dumps(content, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")
