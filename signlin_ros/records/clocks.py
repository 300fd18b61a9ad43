"""Several clocks in one table: a time in front of every signal, and another one that contradicts the one taken."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from signlin_ros import units
from signlin_ros.records.counted import Times, column_of
from signlin_ros.records.header import Heading, heading
from signlin_ros.records.notes import Note
from signlin_ros.records.table import Rows

if TYPE_CHECKING:
    from signlin_ros.records.clean import RawTable

Array = npt.NDArray[np.float64]

DAY, MILLISECOND, MILLIONTH, DAYS = 86400.0, 1e-3, 1e-6, (2e4, 8e4)
"""Seconds of a day, of a millisecond, a millionth; dates of this time, in days since 1899."""
_NUMBERED = re.compile(r"(.*?)[ _]?(?:\(column \d+\)|\d+)?\Z")
"""A name, and the number behind it that tells it from others."""
MAX_CLOCK_DIFFERENCE = 0.1
"""Part of a step by which two clocks differ that are one."""
MIN_TICKS, CLOCKS_APART = 5.0, 10.0
"""A clock has gone on by so many of its steps before it is held against another, and by which factor two differ that
are not in the units taken: a simulator's time and the calendar's may differ, too.
"""


@dataclass(frozen=True, eq=False)
class _Clock:
    """A time column of a table: ``t`` (R,) s where it is ``known`` (R,), and the columns that it stands in front of."""

    t: Array
    known: npt.NDArray[np.bool_]
    columns: range

    @property
    def stamps(self) -> Array:
        """The times that it says (K,)."""
        return self.t[self.known]


def one_clock(table: RawTable) -> RawTable:
    """The table with one time where every signal has its own in front of it, ``Time, a, Time, b``: a row for each stamp
    of any, cells empty in between; others as they are.

    Times that are the same to a part of a step are one.
    """
    places = _time_columns(table)
    clocks = _clocks(table, places)
    if not clocks:
        return table
    first = clocks[0]
    apart = MAX_CLOCK_DIFFERENCE * float(np.median(np.diff(first.t)))
    if all(np.array_equal(c.known, first.known) and np.abs(c.t - first.t).max() < apart for c in clocks):
        return _without(table, places[1:], "all times are the same to a part of a step: the first is taken")
    names = ", ".join(repr(table.headings[k].label) for k in places)
    note = Note(f"every signal has a time of its own in front of it: {names}", "assumed")
    stamps = np.unique(np.concatenate([c.stamps for c in clocks]))
    pairs = [(c, k) for c in clocks for k in c.columns]
    columns = [stamps, *(_at(stamps, c, table.columns[k]) for c, k in pairs)]
    heads = [Heading("t [s]", "t", "s"), *(table.headings[k] for _, k in pairs)]
    rows = Rows(np.arange(1, stamps.size + 1))
    return replace(table, headings=heads, columns=columns, rows=rows, notes=(*table.notes, note), exact={})


def contradicted(table: RawTable, times: Times) -> list[Note]:
    """A question after the time where another clock of the file, in a unit that is known, goes on otherwise."""
    others = dict(table.dated)
    for head, column in zip(table.headings, table.columns, strict=True):
        if head.label not in times.used and head.time is not None and head.time[1]:
            how = units.conversion(head.time[1], "s")
            others |= {} if how is None or not np.isfinite(column).all() else {head.label: units.scaled(column, how[0])}
    gone = _gone(times.t)
    for label, seconds in others.items():
        told, tick = _gone(seconds), float(np.min(np.diff(np.unique(seconds)), initial=np.inf))
        if told > MIN_TICKS * tick and gone > 0.0 and not 1.0 / CLOCKS_APART < gone / told < CLOCKS_APART:
            said = (
                f"the time {times.label!r} goes on by {gone:.4g} s, and {label!r} by {told:.4g} s: say which is right, "
                f"--signal 't = {label}', or --signal 't = {times.label} [UNIT]'"
            )
            return [Note(said, "unit_of_time", "t")]
    return []


def of_days(table: RawTable, times: Times) -> Times | None:
    """The time where it counts millionths of a day of the calendar, as archives of Siemens' panels do under the name of
    ``Time_ms``: told by dates in the file that go on so, and by its size; None where it does not.
    """
    gone, begin = _gone(times.t), float(times.t[0]) / MILLISECOND if times.t.size else 0.0
    if not (gone > 0.0 and DAYS[0] < begin * MILLIONTH < DAYS[1]):
        return None
    for label, seconds in table.dated.items():
        told, tick = _gone(seconds), float(np.min(np.diff(np.unique(seconds)), initial=np.inf))
        if told > MIN_TICKS * tick and abs(gone / MILLISECOND * MILLIONTH * DAY - told) < tick:
            said = f"{times.label!r} counts millionths of a day, as {label!r} says"
            t = (times.t - times.t[0]) / MILLISECOND * MILLIONTH * DAY
            return replace(times, t=np.asarray(t), notes=(Note(said, "clock", "t"),))
    return None


def _time_columns(table: RawTable) -> list[int]:
    """The places of the time columns that stand in front of signals, the first of all in front; none where there are
    fewer than two, or they differ in name or unit.
    """
    stems = _stems(table)
    found = [k for k, head in enumerate(table.headings) if heading(stems[k]).time is not None and head.label]
    alike = len({(stems[k], table.headings[k].unit) for k in found}) == 1
    in_front = len(found) > 1 and found[0] == 0 and min(np.diff([*found, len(stems)])) > 1
    return found if alike and in_front and table.columns[0].size > 1 else []


def _stems(table: RawTable) -> list[str]:
    """The names of the columns without the number that tells one from another."""
    return [_NUMBERED.sub(r"\1", head.name).lower() for head in table.headings]


def _clocks(table: RawTable, places: Sequence[int]) -> list[_Clock]:
    """The clocks at some columns, in s; none where one of them goes back or hardly on, or the first has no value."""
    if not places:
        return []
    raw = [table.columns[k] for k in places]
    known = [np.isfinite(column) for column in raw]
    if (
        not known[0].all()
        or min(there.sum() for there in known) <= MIN_TICKS
        or any((np.diff(c[there]) <= 0.0).any() for c, there in zip(raw, known, strict=True))
    ):
        return []
    head = table.headings[0]
    unit = (heading(_stems(table)[0]).time or (0, ""))[1] or head.unit
    t = column_of(replace(table, headings=[head], columns=raw[:1]), head, unit).t
    scale = float((t[-1] - t[0]) / (raw[0][-1] - raw[0][0]))
    ends = [*places[1:], len(table.headings)]
    return [
        _Clock((column - raw[0][0]) * scale + t[0], there, range(begin + 1, end))
        for column, there, begin, end in zip(raw, known, places, ends, strict=True)
    ]


def _at(stamps: Array, of: _Clock, column: Array) -> Array:
    """A column of a clock at all stamps (S,), NaN where that clock has none."""
    found = np.full(stamps.shape, np.nan)
    found[np.searchsorted(stamps, of.stamps)] = column[of.known]
    return found


def _without(table: RawTable, lost: Sequence[int], why: str) -> RawTable:
    kept = [k for k in range(len(table.headings)) if k not in lost]
    heads, columns = [table.headings[k] for k in kept], [table.columns[k] for k in kept]
    return replace(table, headings=heads, columns=columns, notes=(*table.notes, Note(why, "left_out")))


def _gone(t: Array) -> float:
    """By how much times (R,) go on, in s, without what they go back."""
    return float(np.maximum(np.diff(t), 0.0).sum())


__all__ = ["contradicted", "of_days", "one_clock"]
