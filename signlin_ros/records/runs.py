"""Rows whose time goes back: a few that came late are put in their place, a restart cuts the record in two."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import numpy.typing as npt

from signlin_ros.errors import RecordError
from signlin_ros.masks import ends_of_runs
from signlin_ros.records.notes import Note
from signlin_ros.records.table import Rows

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.intp]

MAX_LATE_ROWS = 3
"""So many rows in succession may have come late; more are a run of their own."""
MAX_LATE_DISTANCE = 50
"""A row that came late belongs at most so many rows before where it stands; another has a wrong stamp."""
MAX_RUNS = 50
"""More runs in one file are rows in no order."""


def runs_of(t: Array, breaks: Sequence[int], rows: Rows, source: str) -> tuple[list[Index], list[Note]]:
    """The rows of every run, in the order of their times.

    Parameters
    ----------
    t : (R,) finite times in the order of the rows.
    breaks : rows before which the header returned.

    Raises
    ------
    RecordError
        The rows are in no order; the first that goes back is named.
    """

    def fault(i: int) -> RecordError:
        return RecordError(
            f"{source}: {rows.name(i)}: time stamp {t[i]:.9g} comes after {t[i - 1]:.9g}, and so it goes on: the rows "
            "are in no order of time; sort them, map the time's column with --signal t=COLUMN, or say --dt where they "
            "are evenly spaced"
        )

    found, late, lost = [], 0, 0
    for first, last in _parts(t, breaks, fault):
        index, moved, left = _in_order(t, first, last)
        found.append(index)
        late, lost = late + moved, lost + left
    backs = [int(part.min()) for part in found[1:]]
    notes = _said(backs, late, lost, rows.name)
    return found, notes


def _said(backs: Sequence[int], late: int, lost: int, where: Callable[[int], str]) -> list[Note]:
    notes = []
    if backs:
        more = "" if len(backs) == 1 else f", the first at {where(backs[0])}"
        place = f" at {where(backs[0])}" if len(backs) == 1 else f" {len(backs)} times"
        notes.append(Note(f"the time begins anew{place}{more}: cut into {len(backs) + 1} runs", "cut", "t"))
    if late:
        count = "1 row that had come late was" if late == 1 else f"{late} rows that had come late were"
        notes.append(Note(f"sorted by time: {count} put in place", "sorted", "t"))
    if lost:
        count = "1 row has a stamp" if lost == 1 else f"{lost} rows have stamps"
        notes.append(Note(f"{count} far from those around: left out", "left_out", "t"))
    return notes


def _parts(t: Array, breaks: Sequence[int], fault: Callable[[int], RecordError]) -> list[tuple[int, int]]:
    """First and last (exclusive) rows of every run: it ends where the time goes back for more than a few rows."""
    parts: list[tuple[int, int]] = []
    first = 0
    known = sorted(i for i in breaks if t[i] < t[i - 1])
    while first < t.size:
        limit = next((i for i in known if i > first), t.size)
        cut = min(_restart(t, first), limit)
        parts.append((first, cut))
        first = cut
        if len(parts) > MAX_RUNS + len(known):
            raise fault(parts[1][0])
    sizes = [last - begin for begin, last in parts]
    if len(parts) > 2 and float(np.median(sizes)) < 10:
        raise fault(parts[1][0])
    return parts


def _restart(t: Array, first: int) -> int:
    """The first row from `first` on that is before an earlier one, and so are more than a few behind it; else T."""
    late = t[first:] < np.maximum.accumulate(t[first:])
    if not late.any():
        return int(t.size)
    begins, ends = ends_of_runs(late)
    long = np.flatnonzero(ends - begins > MAX_LATE_ROWS)
    return int(t.size) if not long.size else int(first + begins[long[0]])


def _in_order(t: Array, first: int, last: int) -> tuple[Index, int, int]:
    """The rows of one run in order; how many were moved, how many are left out because they belong nowhere near."""
    index = np.arange(first, last)
    part = t[first:last]
    top = np.maximum.accumulate(part)
    late = part < top
    if not late.any():
        return index, 0, 0
    place = np.searchsorted(part[~late], part[late])
    far = np.arange(part.size)[late] - place > MAX_LATE_DISTANCE
    kept = np.ones(part.size, dtype=np.bool_)
    kept[np.flatnonzero(late)[far]] = False
    index = index[kept]
    order = np.argsort(t[index], kind="stable")
    return index[order], int(late.sum() - far.sum()), int(far.sum())
