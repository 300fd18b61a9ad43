"""What a diagnosis has tried so far, best first, for a page that watches."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from signlin_ros.diagnosis.equation_error.estimate import EquationErrorResult
    from signlin_ros.diagnosis.output_error import FittedModel

MAX_RANKED = 15
"""So many models are told."""


class Ranking:
    """The models that were tried, with what each leaves of validation data; ``say`` is told of every stage and model.

    ``force``: what is left of the missing force, in per cent of the effort; ``error``: that of the motion over the
    noise, of the worst channel. Called from several threads.
    """

    def __init__(self, say: Callable[[dict[str, Any]], None]) -> None:
        self._say, self._turn = say, threading.Lock()
        self._now: dict[str, Any] = {"what": "reading", "share": 0.0}
        self._rows: dict[frozenset[str], dict[str, Any]] = {}

    def stage(self, what: str, share: float) -> None:
        """Tell what is done now, and how much of all is done."""
        with self._turn:
            self._now = {"what": what, "share": share}
            self._tell()

    def seen(self, found: FittedModel | EquationErrorResult) -> None:
        """Tell of a model that was fitted, or of all that the equation-error estimate tried."""
        from signlin_ros.diagnosis.equation_error.estimate import EquationErrorResult

        with self._turn:
            if isinstance(found, EquationErrorResult):
                for names, fit in found.sets.items():
                    self._put(sorted(names), force=found.percent(fit))
            else:
                self._put(found.effects, error=_worst(found))
            self._tell()

    def _put(self, effects: Any, **left: float) -> None:
        row = self._rows.setdefault(frozenset(effects), {"effects": list(effects), "force": None, "error": None})
        row.update({name: value for name, value in left.items() if np.isfinite(value)})

    def _tell(self) -> None:
        rows = sorted(self._rows.values(), key=_place)
        self._say({**self._now, "found": {"tried": rows[:MAX_RANKED], "count": len(rows)}})


def _worst(f: FittedModel) -> float:
    """Return the error on validation data over the noise, of the worst channel."""
    rms = f.validation_rmse
    return float(np.nanmax(rms / np.maximum(f.noise, 1e-300)))


def _place(row: dict[str, Any]) -> tuple[bool, float, int, float]:
    """Return by what a row is sorted: what was simulated first, of equals the simplest; then by the force it leaves."""
    error, force, size = row["error"], row["force"], len(row["effects"])
    left = np.inf if force is None else force
    return (True, 0.0, 0, left) if error is None else (False, round(error, 2), size, left)


__all__ = ["MAX_RANKED", "Ranking"]
