"""Which column may be the time of a record whose reader finds none."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from signlin_ros import units
from signlin_ros.records import Record, Signal

Array = NDArray[np.float64]
MAX_LOOKED_AT_COLUMNS = 200
"""The time is one of the first columns."""
MIN_ROWS = 20
"""Rows from which on steps tell a clock."""
MAX_CLOCK_STEP_RATIO = 20.0
"""The longest step of a clock over the usual one: beyond it a column is no clock, or one with a gap."""
GUESSED_UNITS = ((2e4, "ns"), (200.0, "us"), (0.5, "ms"))
"""The unit of a clock that states none, by its usual step."""


def asked_time(record: Record) -> str:
    """Return what would be said of the column that may be the time (``stamp [us]``); empty where none is, or two are.

    A clock never goes back and takes steps of about one size; one in a unit of time is it before one without a unit,
    and what only counts the rows is none.
    """
    every = [(s.label or name, s) for name, s in record.signals.items()][:MAX_LOOKED_AT_COLUMNS]
    clocks = [(label, s) for label, s in every if _runs(s.values)]
    stated = [(label, s.unit) for label, s in clocks if units.conversion(s.unit, "s") and s.unit]
    bare = [(label, _unit(s)) for label, s in clocks if not s.unit and not _counts(s.values)]
    found = stated or bare
    return f"{found[0][0].split(' [')[0]} [{found[0][1]}]" if len(found) == 1 else ""


def _runs(values: Array) -> bool:
    steps = np.diff(values)
    if steps.size < MIN_ROWS or not np.isfinite(steps).all():
        return False
    usual = float(np.median(steps))
    return usual > 0.0 and bool(steps.min() >= 0.0) and float(steps.max()) <= MAX_CLOCK_STEP_RATIO * usual


def _counts(values: Array) -> bool:
    """Tell whether a column only counts the rows."""
    return bool((np.diff(values) == 1.0).all())


def _unit(signal: Signal) -> str:
    step = float(np.median(np.diff(signal.values)))
    return next((unit for least, unit in GUESSED_UNITS if step >= least), "s")


__all__ = ["asked_time"]
