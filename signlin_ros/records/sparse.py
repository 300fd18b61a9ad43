"""Tables that merge several clocks: in every row only some columns have a value, as PlotJuggler exports them."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np
import numpy.typing as npt

from signlin_ros.records.notes import Note, as_notes
from signlin_ros.records.table import Record, Series

Array = npt.NDArray[np.float64]

MIN_EMPTY_SHARE = 0.1
"""A column with more than this share of empty cells may have a clock of its own."""
MIN_OWN_SHARE = 0.1
"""Two columns have clocks of their own where each has more than this share of its values without the other's."""


MIN_SPARSE_ROWS = 20
"""Rows from which on this is looked at."""


def sparse(record: Record) -> Record:
    """The record with every column on stamps of its own, if it merges several clocks; else as it is."""
    if len(record) < MIN_SPARSE_ROWS:
        return record
    there = {name: np.isfinite(signal.values) for name, signal in record.signals.items()}
    masks = [mask for mask in there.values() if mask.any() and mask.mean() < 1.0 - MIN_EMPTY_SHARE]
    different = list({mask.tobytes(): mask for mask in masks}.values())[:20]
    if not any(_apart(a, b) for a, b in combinations(different, 2)):
        return record
    series = {}
    for name, signal in record.signals.items():
        rows = there[name]
        series[name] = Series(record.t[rows], signal.values[rows], signal.unit, signal.label)
    said = "columns have values in rows of their own: each is taken with a clock of its own, as in a bag"
    kept = (note for note in as_notes(record.notes) if note.kind not in ("uneven", "gap"))  # of the rows of all
    return replace(record, series=series, notes=(*kept, Note(said, "format")))


def _apart(a: npt.NDArray[np.bool_], b: npt.NDArray[np.bool_]) -> bool:
    both = np.count_nonzero(a & b)
    return bool(both < (1.0 - MIN_OWN_SHARE) * min(np.count_nonzero(a), np.count_nonzero(b)))
