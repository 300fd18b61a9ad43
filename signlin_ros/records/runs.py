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
Mask = npt.NDArray[np.bool_]

MAX_OUT_OF_PLACE = 3
"""So many rows in succession may have come late, or early; more are a run of their own."""
MAX_DISTANCE = 50
"""A row that came late or early belongs at most so many rows from where it stands; another has a wrong stamp."""
MAX_EARLY_ROUNDS = 10
"""Times that the rows are looked through for early ones: what one of them hides shows when it is out."""
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
    early = _early(t)
    for first, last in _parts(t, early, breaks, fault):
        index, moved, left = _in_order(t, early, first, last)
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
        count, moved = ("1 row", "was") if late == 1 else (f"{late} rows", "were")
        notes.append(Note(f"sorted by time: {count} that had come late, or early, {moved} put in place", "sorted", "t"))
    if lost:
        count = "1 row has a stamp" if lost == 1 else f"{lost} rows have stamps"
        notes.append(Note(f"{count} far from those around: left out", "left_out", "t"))
    return notes


def _parts(t: Array, early: Mask, breaks: Sequence[int], fault: Callable[[int], RecordError]) -> list[tuple[int, int]]:
    """First and last (exclusive) rows of every run: it ends where the time goes back for more than a few rows."""
    parts: list[tuple[int, int]] = []
    first = 0
    known = sorted(i for i in breaks if t[i] < t[i - 1])
    while first < t.size:
        limit = next((i for i in known if i > first), t.size)
        cut = min(_restart(t, early, first), limit)
        parts.append((first, cut))
        first = cut
        if len(parts) > MAX_RUNS + len(known):
            raise fault(parts[1][0])
    sizes = [last - begin for begin, last in parts]
    if len(parts) > 2 and float(np.median(sizes)) < 10:
        raise fault(parts[1][0])
    return parts


def _restart(t: Array, early: Mask, first: int) -> int:
    """The first row from `first` on that is before an earlier one, and so are more than a few behind it, rows that came
    early aside; else T.
    """
    rows = first + np.flatnonzero(~early[first:])
    begins, _, _ = _long_behind(t[rows])
    return int(t.size) if not begins.size else int(rows[begins[0]])


def _early(t: Array) -> Mask:
    """The rows (R,) that came early: few in succession are ahead of more than a few that stand behind them, which are
    in order without them.
    """
    early = np.zeros(t.size, dtype=np.bool_)
    for _ in range(MAX_EARLY_ROUNDS):
        rows = np.flatnonzero(~early)
        begins, ahead, rising = _long_behind(t[rows])
        before = int(early.sum())
        for begin, count in zip(begins.tolist(), ahead.tolist(), strict=True):
            behind = t[rows[begin : begin + 2 * MAX_OUT_OF_PLACE]]
            if count <= MAX_OUT_OF_PLACE and 2 * np.count_nonzero(_rising(behind)) > behind.size:
                early[rows[:begin][rising[:begin]][-count:]] = True
        if before == early.sum():
            break
    return early


def _rising(t: Array) -> Mask:
    """The times (R,) that are not before an earlier one."""
    return np.asarray(t >= np.maximum.accumulate(t))


def _long_behind(t: Array) -> tuple[Index, Index, Mask]:
    """Where more than a few rows (R,) in succession are before an earlier one: the first of each such stretch (k,), how
    many rows in front of it, of those in order, are ahead of it (k,), and which rows are in order (R,).
    """
    rising = _rising(t)
    begins, ends = ends_of_runs(~rising)
    long = ends - begins > MAX_OUT_OF_PLACE
    begins, ends = begins[long], ends[long]
    if not begins.size:
        return begins, begins, rising
    inside = np.stack([begins, ends], axis=1).ravel()
    least = np.minimum.reduceat(np.append(t, np.inf), inside)[::2]
    in_front = np.cumsum(rising)[begins - 1]
    return begins, in_front - np.minimum(np.searchsorted(t[rising], least, side="right"), in_front), rising


def _in_order(t: Array, early: Mask, first: int, last: int) -> tuple[Index, int, int]:
    """The rows of one run in order; how many were moved, how many are left out because they belong nowhere near."""
    index = np.arange(first, last)
    part = t[first:last]
    rest = np.where(early[first:last], -np.inf, part)
    odd = rest < np.maximum.accumulate(rest)
    odd |= early[first:last]
    if not odd.any():
        return index, 0, 0
    inside = part[~odd]
    before = np.cumsum(~odd)[odd]
    far = np.abs(before - np.searchsorted(inside, part[odd])) > MAX_DISTANCE
    if inside.size > 1:  # beyond the last there are no rows to count
        far |= part[odd] - inside[-1] > MAX_DISTANCE * float(np.median(np.diff(inside)))
    kept = np.ones(part.size, dtype=np.bool_)
    kept[np.flatnonzero(odd)[far]] = False
    index = index[kept]
    order = np.argsort(t[index], kind="stable")
    return index[order], int(odd.sum() - far.sum()), int(far.sum())
