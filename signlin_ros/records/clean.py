"""From columns as they stand in a file to a `Record`: faults are repaired with a note, or refused by row.

===========================  =================================================================
fault                        what is done
===========================  =================================================================
no time column               refused, the columns listed
time stamp not finite        refused, row named
stamps out of order          refused, row named; sorted with a note where the caller allows it
equal stamps                 identical rows: all but one dropped, with a note; else refused
infinite value               refused, row and column named
NaN, empty cell              a missing sample, kept as NaN
missing rows, uneven steps   kept, with a note
fewer than two rows          refused
===========================  =================================================================
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from signlin_ros import units
from signlin_ros.errors import RecordError

from .header import TIME_KEYS, Heading, clock
from .table import Record, Rows, Signal, listing, nearest

Array = npt.NDArray[np.float64]

GAP = 1.5
"""A step longer than this many median steps is a gap: rows are missing."""
UNEVEN = 0.01
"""Steps that differ by more than this share of the median step are worth a note."""
_MANY_GAPS = 0.05
"""Where more than this share of the steps is long, the record is unevenly sampled rather than full of gaps.
"""
_LARGEST_SECONDS = 1e11
"""A stamp without a unit beyond this is surely not in seconds: 3000 years, or milliseconds since 1970."""

Keep = Callable[[Heading, Sequence[Heading]], "bool | None"]
"""What to do with a column that cannot be used: see `keeper`."""


@dataclass(frozen=True, eq=False)
class Table:
    """Columns as read: a heading and (R,) values each, and where the rows stood."""

    source: str
    headings: list[Heading]
    columns: list[Array]
    rows: Rows
    notes: tuple[str, ...] = ()

    def take(self, index: npt.NDArray[np.intp] | npt.NDArray[np.bool_], *notes: str) -> Table:
        """The rows at `index`, an index array or a mask, with further notes."""
        columns = [column[index] for column in self.columns]
        return replace(self, columns=columns, rows=self.rows.take(index), notes=(*self.notes, *notes))


def keeper(signals: Mapping[str, str] | None, wanted: Iterable[str] | None) -> Keep:
    """What to do with a column that cannot be used (text, infinite values).

    True (refuse the file) for the time and for columns asked for by `signals` or `wanted`; for the others
    False (leave the column out) where `wanted` is given, else None (leave it out only if all of it is text).
    """
    asked = [*(wanted or ()), *(signals or {}).values()]
    mapped_time = not TIME_KEYS.isdisjoint(signals or {})
    other = None if wanted is None else False

    def keep(head: Heading, headings: Sequence[Heading]) -> bool | None:
        best = None if mapped_time else clock(headings)
        return True if head is best or any(head.matches(spec) for spec in asked) else other

    return keep


def record_of(table: Table, signals: Mapping[str, str] | None, keep: Keep, sort: bool = False) -> Record:
    """The record in a table; `signals` gives columns new names, and under the key ``t`` the time column.

    Raises
    ------
    RecordError
        See the table at the top of this module.
    """
    _check_names(table)
    at, unit = _time_column(table, signals or {})
    table, label = _increasing(table, at, sort), table.headings[at].label
    table = _finite(table, keep)
    at = [head.label for head in table.headings].index(label)
    if table.rows.number.size < 2:
        raise RecordError(f"{table.source}: only {table.rows.number.size} row of data; at least 2 are needed")
    t = _seconds(table, at, unit)
    name = Rows.name
    notes = (*table.notes, *spacing(t, lambda i: name(table.rows, i)))
    record = Record(t, _signals(table, at), table.source, notes, table.rows)
    return renamed(record, {key: spec for key, spec in (signals or {}).items() if key not in TIME_KEYS})


def renamed(record: Record, signals: Mapping[str, str]) -> Record:
    """The record with signals renamed: `signals` maps the new name to what stands over the column."""
    if not signals:
        return record
    keys = {name: record.require(spec, "signal") for name, spec in signals.items()}
    kept = {key: key for key in record.signals if key not in keys.values()}
    lost = [key for key in kept if key in keys]
    order = {**keys, **{key: key for key in kept if key not in keys}}
    notes = tuple(f"column {key!r} is left out, because {key} is mapped to {signals[key]!r}" for key in lost)
    return replace(
        record,
        signals={name: record.signals[key] for name, key in order.items()},
        series={name: record.series[key] for name, key in order.items() if key in record.series},
        notes=(*record.notes, *notes),
    )


def spacing(t: Array, where: Callable[[int], str]) -> list[str]:
    """Notes on gaps and uneven steps of the increasing stamps t (T,)."""
    steps = np.diff(t)
    median = float(np.median(steps))
    gaps = np.flatnonzero(steps > GAP * median)
    gaps = gaps if gaps.size <= max(1, _MANY_GAPS * steps.size) else gaps[:0]
    notes = []
    if gaps.size:
        worst = int(gaps[np.argmax(steps[gaps])])
        count = "1 gap" if gaps.size == 1 else f"{gaps.size} gaps"
        longest = f"the longest, {steps[worst]:.4g} s, after t = {t[worst]:.6g} s"
        notes.append(
            f"{count} in the time stamps (steps over {GAP:g} times the median of {median:.4g} s): "
            f"the first after {where(int(gaps[0]))}, {longest}"
        )
    regular = np.delete(steps, gaps)
    if np.ptp(regular) > UNEVEN * median:
        notes.append(f"unevenly sampled: steps of {regular.min():.4g} to {regular.max():.4g} s, median {median:.4g} s")
    return notes


def _check_names(table: Table) -> None:
    seen: dict[str, int] = {}
    for i, head in enumerate(table.headings):
        if not head.label:
            raise RecordError(f"{table.source}: column {i + 1} has values but no name")
        if head.label in seen:
            places = f"columns {seen[head.label] + 1} and {i + 1}"
            raise RecordError(f"{table.source}: two columns are called {head.label!r} ({places})")
        seen[head.label] = i


def _time_column(table: Table, signals: Mapping[str, str]) -> tuple[int, str]:
    """Index and unit of the time column: the one mapped under ``t``, else ``t``, ``time``, ``timestamp`` or
    ``stamp``.
    """
    labels = [head.label for head in table.headings]
    for key in signals.keys() & TIME_KEYS:
        spec = signals[key]
        found = [i for i, head in enumerate(table.headings) if head.matches(spec)]
        if len(found) != 1:
            raise RecordError(f"{table.source}: no time column {spec!r}; {listing(labels)}{nearest(spec, labels)}")
        return found[0], table.headings[found[0]].unit
    best = clock(table.headings)
    if best is None or best.time is None:
        raise RecordError(
            f"{table.source}: no time column (t, time, timestamp or stamp, with a unit like 't [ms]'); "
            f"{listing(labels)}; map one with signals: {{t: COLUMN}}"
        )
    return table.headings.index(best), best.time[1]


def _increasing(table: Table, at: int, sort: bool) -> Table:
    """The table with strictly increasing stamps, or a refusal that names the row."""
    t = table.columns[at]
    bad = np.flatnonzero(~np.isfinite(t))
    if bad.size:
        where = table.rows.name(bad[0])
        raise RecordError(f"{table.source}: {where}: the time stamp is {_shown(t[bad[0]])}, not a finite number")
    back = np.flatnonzero(np.diff(t) < 0)
    if back.size and not sort:
        i = int(back[0])
        raise RecordError(
            f"{table.source}: {table.rows.name(i + 1)}: time stamp {t[i + 1]:.9g} comes after {t[i]:.9g}; "
            "sort the rows by time"
        )
    if back.size:
        order = np.argsort(t, kind="stable")
        table = table.take(order, f"rows sorted by time: {back.size} stamps were out of order")
    return _without_repeats(table, at)


def _without_repeats(table: Table, at: int) -> Table:
    again = np.flatnonzero(np.diff(table.columns[at]) == 0) + 1
    if not again.size:
        return table
    for head, column in zip(table.headings, table.columns, strict=True):
        now, before = column[again], column[again - 1]
        differ = (now != before) & ~(np.isnan(now) & np.isnan(before))
        if differ.any():
            i = int(again[np.argmax(differ)])
            rows = f"{table.rows.name(i - 1)} and {table.rows.name(i)}"
            values = f"{head.label!r} is {_shown(column[i - 1])} and {_shown(column[i])}"
            raise RecordError(f"{table.source}: {rows} have the same time stamp but differ: {values}")
    keep = np.ones(table.rows.number.size, dtype=np.bool_)
    keep[again] = False
    count = "1 repeated row" if again.size == 1 else f"{again.size} repeated rows"
    return table.take(keep, f"{count} dropped (same stamp, same values), the first {table.rows.name(again[0])}")


def _finite(table: Table, keep: Keep) -> Table:
    """The table without infinite columns that nobody asked for; refuses infinite values in the others."""
    infinite = [i for i, column in enumerate(table.columns) if np.isinf(column).any()]
    for i in infinite:
        head, column = table.headings[i], table.columns[i]
        row = int(np.argmax(np.isinf(column)))
        if keep(head, table.headings) is not False:
            fault = f"{_shown(column[row])} is not a finite number"
            raise RecordError(f"{table.source}: {table.rows.name(row)}, column {head.label!r}: {fault}")
    kept = [i for i in range(len(table.columns)) if i not in infinite]
    notes = [f"column {table.headings[i].label!r} holds infinite values and is left out" for i in infinite]
    headings, columns = [table.headings[i] for i in kept], [table.columns[i] for i in kept]
    return replace(table, headings=headings, columns=columns, notes=(*table.notes, *notes))


def _seconds(table: Table, at: int, unit: str) -> Array:
    t, label = table.columns[at], table.headings[at].label
    how = units.conversion(unit, "s")
    if how is None:
        raise RecordError(f"{table.source}: the time column {label!r} is in {unit!r}; allowed: s, ms, us, ns, min, h")
    if not unit and np.abs(t).max() > _LARGEST_SECONDS:
        hint = f"state its unit, e.g. '{label} [ns]'"
        raise RecordError(
            f"{table.source}: the time column {label!r} reads {t[0]:.10g}, which is not in seconds; {hint}"
        )
    seconds = units.scaled(t, how[0])
    if np.any(np.diff(seconds) <= 0):
        where = table.rows.name(np.argmax(np.diff(seconds) <= 0) + 1)
        raise RecordError(
            f"{table.source}: {where}: the time stamp does not differ from the one before in double precision"
        )
    return seconds


def _signals(table: Table, at: int) -> dict[str, Signal]:
    """Signals keyed by their bare names, or by the whole labels where several share a name."""
    names = [head.name for head in table.headings]
    signals = {}
    for i, (head, column) in enumerate(zip(table.headings, table.columns, strict=True)):
        if i != at:
            key = head.name if names.count(head.name) == 1 else head.label
            signals[key] = Signal(column, head.unit, head.label)
    return signals


def _shown(value: float | np.floating) -> str:
    return "nan" if np.isnan(value) else repr(float(value))
