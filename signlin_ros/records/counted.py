"""The times of rows in one column: its unit, where it counts from, and whether its counter began anew.

A time that counts from 1970 (in s, ms, µs or ns, which its size tells) counts from the first row here.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from signlin_ros import units
from signlin_ros.errors import RecordError
from signlin_ros.records.converted import quoted
from signlin_ros.records.header import Heading
from signlin_ros.records.notes import Note

if TYPE_CHECKING:
    from signlin_ros.records.clean import RawTable

Array = npt.NDArray[np.float64]

_EPOCHS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
_SINCE, _UNTIL = 1e9, 4.2e9
"""Times in s since 1970, 2001 to 2103."""
_TICKS = (11_644_473_600.0, 62_135_596_800.0)
"""From the years 1601 (file times of Windows) and 1 (ticks of .NET) to 1970, in s; both count in 100 ns."""
_DATES = ((2e4, 8e4), (6.9e5, 7.7e5))
"""Dates of this time in days: of spreadsheets, since 1900 or 1904; of MATLAB, since the year 0."""
_LONGEST_DATED_STEP = 1e-5
"""A time that reads as such a date, with smaller steps than this, is in days: in s it would be one of 100 kHz."""
_COUNTERS, _MOST_STEPS_OVER = (8, 16, 24, 32), 3.0
"""Bits of counters that a time may be of; steps from row to row, in usual ones, over which one overflows."""
MAX_ROW_TIME = 60.0
"""A recorder does not take longer from row to row, in s."""
_FASTEST = 1e-7
"""Nor is one of a drive faster than this: steps that would be shorter are not in the unit that is stated."""
_LARGEST_SECONDS = 1e11
"""A stamp without a unit beyond this is surely not in seconds: 3000 years, or milliseconds since 1970."""
CALENDAR = 1e8
"""A time in s that begins later than this (3 years) counts from its first stamp: its clock is the calendar's."""
HOW = "state it: --signal 't = COLUMN [ms]', or --dt 0.01 where the rows are 0.01 s apart"
SLOW_STEPS = ((1e5, "ns"), (500.0, "us"), (0.5, "ms"))
"""Steps in s from which on a time without a unit is rather in another one."""
MIN_UNIT_ROWS = 20
"""Rows from which on the steps of a time tell whether its unit has to be asked for."""


@dataclass(frozen=True, eq=False)
class Times:
    """``t`` (R,) s, in the order of the rows; ``used``: labels of the columns it was made of; ``label``: its name."""

    t: Array
    label: str
    used: frozenset[str] = frozenset()
    notes: tuple[Note, ...] = ()


def column_of(table: RawTable, head: Heading, unit: str, said: bool = False) -> Times:
    """The time in one column; its unit is the one that the file states, or ``said`` by the user."""
    raw = table.columns[table.headings.index(head)]
    _check_finite(table, raw)
    since = from_first(table, head.label, raw)
    steps = np.diff(since)
    step = float(np.median(steps[steps > 0])) if (steps > 0).any() else 0.0
    notes: list[Note] = []
    found, how = unit, units.conversion(unit, "s")
    if how is None:
        raise RecordError(
            f"{table.source}: the time column {head.label!r} is in {unit!r}; allowed: s, ms, us, ns, min, h; {HOW}"
        )
    if raw.size:
        raw, since, wrapped = _unwrapped(raw, since, step)
        notes += [Note(f"{head.label!r} {wrapped}", "clock", "t")] if wrapped else []
    if not unit:
        found = _epoch(float(raw[0]), step) if raw.size else ""
        if not found and np.abs(raw).max(initial=0.0) > _LARGEST_SECONDS:
            raise RecordError(
                f"{table.source}: the time column {head.label!r} reads {raw[0]:.10g}, which is not in seconds; "
                f"state its unit, e.g. '{head.label} [ns]' in the header or --signal 't = {head.label} [ns]'"
            )
        how = units.conversion(found, "s") or (1.0, "s")
        if found == "day":
            notes.append(Note(f"{head.label!r} is taken for dates in days, as its numbers say", "clock", "t"))
        elif found == "100ns":
            notes.append(Note(f"{head.label!r} is taken for ticks of 100 ns, as its numbers say", "clock", "t"))
        elif found not in ("", "s"):
            notes.append(Note(f"{head.label!r} is taken for {found} since 1970, as its numbers say", "clock", "t"))
    begin = float(raw[0]) * how[0] if raw.size else 0.0
    counted = abs(begin) > CALENDAR and (how[0] != 1.0 or head.label in table.exact)
    if counted and found not in ("day", "100ns"):
        notes.append(Note(f"time counts from the first row, {begin:.3f} s after 1970", "clock", "t"))
    t = units.scaled(since if counted else raw, how[0])
    if not found:
        notes += asked(head, t)
    elif how[0] != 1.0 and not notes:
        notes.append(Note(f"time from {head.label!r}, converted from {found} to s", "clock", "t"))
    if unit and how[0] != 1.0 and not said:
        notes += _doubted(head, unit, t.size, step * how[0])
    return Times(t, head.label, frozenset({head.label}), tuple(notes))


def from_first(table: RawTable, label: str, column: Array) -> Array:
    """A column less its first value, exactly where it holds whole numbers beyond what a double does."""
    exact = table.exact.get(label)
    return column - column[0] if exact is None else np.asarray(exact - exact[0], dtype=np.float64)


def _check_finite(table: RawTable, t: Array) -> None:
    bad = np.flatnonzero(~np.isfinite(t))
    if bad.size:
        where, shown = table.rows.name(bad[0]), "nan" if np.isnan(t[bad[0]]) else repr(float(t[bad[0]]))
        raise RecordError(f"{table.source}: {where}: the time stamp is {shown}, not a finite number")


def _epoch(first: float, step: float) -> str:
    """The unit in which a time counts from 1970, or the days of a spreadsheet's dates; "" where it does neither."""
    for unit, size in _EPOCHS.items():
        if _SINCE < first * size < _UNTIL and step * size < MAX_ROW_TIME:
            return unit
    if any(_SINCE < first * 1e-7 - before < _UNTIL for before in _TICKS) and step * 1e-7 < MAX_ROW_TIME:
        return "100ns"
    dated = any(least < first < most for least, most in _DATES)
    return "day" if dated and 0.0 < step < _LONGEST_DATED_STEP else ""


def _unwrapped(raw: Array, since: Array, step: float) -> tuple[Array, Array, str]:
    """A time (R,) as it is and from its first row, and what was done to it: one of a counter of so many bits goes on
    where it begins at 0 again.
    """
    backs, exact = np.diff(since), step > 0.0 and not (raw % 1).any() and raw.min() >= 0.0
    falls = np.flatnonzero(backs < 0.0)
    if not (exact and falls.size):
        return raw, since, ""
    for bits in _COUNTERS:
        ahead = backs[falls] + 2.0**bits
        if raw.max() < 2.0**bits and np.all((ahead > 0.0) & (ahead < _MOST_STEPS_OVER * step)):
            added = 2.0**bits * np.cumsum(np.concatenate([[0.0], backs < 0.0]))
            return raw + added, since + added, f"is of a counter of {bits} bits: it goes on where that overflows"
    return raw, since, ""


def asked(head: Heading, t: Array) -> list[Note]:
    """A question after the unit of a time that states none and whose steps, taken as s, are long."""
    if t.size < MIN_UNIT_ROWS:
        return []
    step = float(np.median(np.abs(np.diff(t))))
    unit = next((unit for least, unit in SLOW_STEPS if step >= least), "")
    if not unit:
        return []
    label = head.label
    said = (
        f"the time {label!r} states no unit and its steps would be {step:g} s: is it in {unit}? "
        f"Then say --signal 't = {label} [{unit}]' (or name the column '{label} [{unit}]'), else 't = {label} [s]'; "
        f"where it counts samples, --dt; where ticks of 0.1 ms, --signal 't = 1e-4 * {quoted(label)}'"
    )
    return [Note(said, "unit_of_time", "t")]


def _doubted(head: Heading, unit: str, rows: int, step: float) -> list[Note]:
    """A question after the unit of a time that states one in which its steps, in s, are shorter than any recorder's."""
    if rows < MIN_UNIT_ROWS or not 0.0 < step < _FASTEST:
        return []
    said = (
        f"the time {head.label!r} states {unit}, in which its steps would be {step:.3g} s: is it in s? Then say "
        f"--signal 't = {head.label} [s]', else 't = {head.label} [{unit}]'"
    )
    return [Note(said, "unit_of_time", "t")]


__all__ = ["CALENDAR", "MAX_ROW_TIME", "Times", "asked", "column_of", "from_first"]
