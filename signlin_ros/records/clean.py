"""From columns as they stand in a file to records: faults are repaired with a note, or refused by row.

===========================  =================================================================
fault                        what is done
===========================  =================================================================
no time column               refused, the columns listed
time stamp not finite        refused, row named
a few rows came late         sorted in, with a note
time begins anew             cut into runs, with a note
rows in no order             refused, row named
equal stamps                 identical rows, or few: all but one dropped, with a note; else refused
infinite value               refused, row and column named
NaN, empty cell              a missing sample, kept as NaN
missing rows, uneven steps   kept, with a note; after a long gap everything starts anew
fewer than two rows          refused
===========================  =================================================================
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from signlin_ros.errors import RecordError
from signlin_ros.records.clocks import one_clock
from signlin_ros.records.counted import Times
from signlin_ros.records.grammar import is_formula, split_unit, words
from signlin_ros.records.header import TIME_KEYS, Heading, clock, heading
from signlin_ros.records.notes import Note
from signlin_ros.records.runs import runs_of
from signlin_ros.records.sparse import sparse
from signlin_ros.records.table import Record, Rows, Signal, at
from signlin_ros.records.times import times_of

Array = npt.NDArray[np.float64]

GAP = 1.5
"""A step longer than this many median steps is a gap: rows are missing."""
MIN_NOTED_DEVIATION = 0.01
"""Steps that differ by more than this share of the median step are worth a note."""
MIN_HOLE_STEPS = 5.0
"""A step of more than this many median steps: what drove the model in it is not known. What comes after it is taken by
itself, from a start of its own."""
MANY_GAPS = 0.05
"""Where more than this share of the steps is long, the record is unevenly sampled rather than full of gaps.
"""

MIN_STAMPS, MIN_ROWS_A_STAMP, COUNTED = 20, 1.2, 1.2
"""Stamps and rows for each of these by which a clock is coarser than the rows, and by how many of its steps evenly
spaced times may differ from it, from end to end: all of them, or those of the first or of the last row of each stamp.
"""

Keep = Callable[[Heading, Sequence[Heading]], "bool | None"]
"""What to do with a column that cannot be used: see `keeper`."""


@dataclass(frozen=True, eq=False)
class RawTable:
    """Columns as read: a heading and (R,) values each, and where the rows stood.

    ``named``: whether the file names them; ``runs``: rows before which its header returned; ``exact``: columns of whole
    numbers that doubles do not hold, by label; ``step``: name and value of a sampling time in s that the file states;
    ``fields``: numbers that it states of all of it; ``dated``: what columns of dates that are left out say, (R,) s from
    the first row, by label; ``words``: what columns say that hold one word throughout, by label.
    """

    source: str
    headings: list[Heading]
    columns: list[Array]
    rows: Rows
    notes: tuple[Note, ...] = ()
    named: bool = True
    runs: tuple[int, ...] = ()
    exact: Mapping[str, npt.NDArray[np.int64]] = field(default_factory=dict)
    step: tuple[str, float] | None = None
    fields: Mapping[str, float] = field(default_factory=dict)
    dated: Mapping[str, Array] = field(default_factory=dict)
    words: Mapping[str, str] = field(default_factory=dict)

    def take(self, index: npt.NDArray[np.intp] | npt.NDArray[np.bool_], *notes: Note) -> RawTable:
        """The rows at `index`, an index array or a mask, with further notes."""
        columns = [column[index] for column in self.columns]
        dated = {label: seconds[index] for label, seconds in self.dated.items()}
        return replace(self, columns=columns, rows=self.rows.take(index), notes=(*self.notes, *notes), dated=dated)


def keeper(signals: Mapping[str, str] | None, wanted: Iterable[str] | None) -> Keep:
    """What to do with a column that cannot be used (text, infinite values).

    True (refuse the file) for the time and for columns asked for by `signals` or `wanted`; for the others
    False (leave the column out) where `wanted` is given, else None (leave it out only if all of it is text).
    """
    asked = [*(wanted or ()), *(signals or {}).values()]
    asked += [word for spec in asked if is_formula(spec) or split_unit(spec)[1] for word in words(spec)]
    mapped_time = not TIME_KEYS.isdisjoint(signals or {})
    other = None if wanted is None else False

    def keep(head: Heading, headings: Sequence[Heading]) -> bool | None:
        best = None if mapped_time else clock(headings)
        return True if head is best or any(head.matches(spec) for spec in asked) else other

    return keep


def records_of(table: RawTable, signals: Mapping[str, str] | None, keep: Keep) -> list[Record]:
    """The runs in a table, each a record; `signals` gives columns new names, and under the key ``t`` says what the time
    is.

    Raises
    ------
    RecordError
        See the table at the top of this module.
    """
    table = _named_apart(table)
    table = table if TIME_KEYS & (signals or {}).keys() else one_clock(table)
    times = times_of(table, signals or {})
    table = replace(table, notes=(*table.notes, *times.notes))
    _check_stamps(table, times)
    runs, notes = runs_of(times.t, table.runs, table.rows, table.source)
    if sum(index.size for index in runs) < 2:
        raise RecordError(f"{table.source}: only {table.rows.number.size} row of data; at least 2 are needed")
    mapped = {key: spec for key, spec in (signals or {}).items() if key not in TIME_KEYS}
    found = []
    for number, index in enumerate(runs):
        source = f"{table.source}, run {number + 1} of {len(runs)}" if len(runs) > 1 else table.source
        part = replace(table.take(index, *notes), source=source)
        found.append(renamed(_record(part, times, times.t[index], keep), mapped))
    return found


def _record(table: RawTable, times: Times, t: Array, keep: Keep) -> Record:
    """One run as a record; its t (R,) does not decrease."""
    table, t = _without_repeats(table, t)
    table = _finite(table, keep)
    if t.size < 2:
        raise RecordError(f"{table.source}: only {t.size} row of data; at least 2 are needed")
    name = Rows.name
    notes = (*table.notes, *spacing(t, lambda i: name(table.rows, i)))
    found = _signals(table)
    signals = {key: signal for key, signal in found.items() if signal.label not in times.used}
    clocks = {key: signal for key, signal in found.items() if signal.label in times.used}
    fields, words = table.fields, table.words
    return sparse(Record(t, signals, table.source, notes, table.rows, clocks=clocks, fields=fields, words=words))


def _check_stamps(table: RawTable, times: Times) -> None:
    bad = np.flatnonzero(~np.isfinite(times.t))
    if bad.size:
        where, shown = table.rows.name(bad[0]), _shown(times.t[bad[0]])
        raise RecordError(f"{table.source}: {where}: the time stamp is {shown}, not a finite number")


def renamed(record: Record, signals: Mapping[str, str]) -> Record:
    """The record with signals renamed: `signals` maps the new name to what stands over the column, or to a formula."""
    if not signals:
        return record
    from signlin_ros.records.formulas import made  # which puts signals on one clock with what is below

    keys = {}
    for name, spec in signals.items():
        if record.find(spec) is None and (is_formula(spec) or split_unit(spec)[1]):
            record, keys[name] = made(record, name, spec)
        else:
            keys[name] = record.require(spec, "signal")
    kept = {key: key for key in record.signals if key not in keys.values()}
    lost = [key for key in kept if key in keys]
    order = {**keys, **{key: key for key in kept if key not in keys}}
    why = "is left out, because {key} is mapped to"
    notes = tuple(Note(f"column {key!r} {why.format(key=key)} {signals[key]!r}", "left_out", key) for key in lost)
    return replace(
        record,
        signals={name: record.signals[key] for name, key in order.items()},
        series={name: record.series[key] for name, key in order.items() if key in record.series},
        notes=(*record.notes, *notes),
    )


def gaps(t: Array) -> list[int]:
    """Return the samples of t (T,) at which stretches without a gap begin, and T."""
    steps = np.diff(t)
    long = np.flatnonzero(steps > MIN_HOLE_STEPS * np.median(steps)) + 1
    return [0, *(long.tolist() if long.size <= max(1.0, MANY_GAPS * steps.size) else []), t.size]


def spacing(t: Array, where: Callable[[int], str]) -> list[Note]:
    """Notes on gaps and uneven steps of the increasing stamps t (T,)."""
    steps = np.diff(t)
    median = float(np.median(steps))
    long = np.flatnonzero(steps > GAP * median)
    long = long if long.size <= max(1, MANY_GAPS * steps.size) else long[:0]
    notes = []
    if long.size:
        worst = int(long[np.argmax(steps[long])])
        count = "1 gap" if long.size == 1 else f"{long.size} gaps"
        longest = f"the longest, {steps[worst]:.4g} s, after {at(t[worst])}"
        said = (
            f"{count} in the time stamps (steps over {GAP:g} times the median of {median:.4g} s): "
            f"the first after {where(int(long[0]))}, {longest}"
        )
        anew = len(gaps(t)) - 2
        many = f"; what follows {anew} of them, over {MIN_HOLE_STEPS:g} times it, starts anew" if anew else ""
        notes.append(Note(f"{said}{many}", "gap", "t"))
    regular = np.delete(steps, long)
    if np.ptp(regular) > MIN_NOTED_DEVIATION * median:
        said = f"unevenly sampled: steps of {regular.min():.4g} to {regular.max():.4g} s, median {median:.4g} s"
        notes.append(Note(said, "uneven", "t"))
    return notes


def _named_apart(table: RawTable) -> RawTable:
    """The table with a name for every column: of two that are the same one is left out, others get their number."""
    first: dict[str, int] = {}
    count = Counter(head.label for head in table.headings)
    kept, headings, notes = [], [], []
    for i, head in enumerate(table.headings):
        if not head.label and i == 0 and _counts_rows(table.columns[0]):
            notes.append(Note("the first column counts the rows and is left out", "left_out"))
            continue
        if not head.label:
            where = f"column {head.number or i + 1}"
            raise RecordError(f"{table.source}: {where} has values but no name; write one into the header")
        before = first.setdefault(head.label, i)
        if before != i and np.array_equal(table.columns[before], table.columns[i], equal_nan=True):
            said = f"column {head.label!r} is there twice, alike: one is left out"
            notes.append(Note(said, "repeated", head.label))
            continue
        alone = count[head.label] == 1 or _same(table, head.label)
        number = "" if alone else f" (column {head.number or i + 1})"
        kept.append(i)
        headings.append(replace(head, label=f"{head.label}{number}"))
    twice = {head.label for i, head in zip(kept, headings, strict=True) if head.label != table.headings[i].label}
    if twice:
        notes.append(
            Note(f"two columns have one name: {', '.join(map(repr, sorted(twice)))} are called so here", "format")
        )
    return replace(table, headings=headings, columns=[table.columns[i] for i in kept], notes=(*table.notes, *notes))


def _counts_rows(column: Array) -> bool:
    """Tell whether a column counts the rows, from 0 or 1."""
    return bool(column.size and column[0] in (0.0, 1.0) and np.all(np.diff(column) == 1.0))


def _same(table: RawTable, label: str) -> bool:
    """Tell whether all columns of a label are the same."""
    first, *others = (column for head, column in zip(table.headings, table.columns, strict=True) if head.label == label)
    return all(np.array_equal(first, other, equal_nan=True) for other in others)


def _without_repeats(table: RawTable, t: Array) -> tuple[RawTable, Array]:
    again = np.flatnonzero(np.diff(t) == 0) + 1
    if not again.size:
        return table, t
    whole = all(np.array_equal(column[again], column[again - 1], equal_nan=True) for column in table.columns)
    merged = None if whole else _completed(table, t)
    if merged is not None:
        return merged
    even = None if whole else _counted(t)  # rows that are there twice say nothing of the clock
    if even is not None:
        tick, step = float(np.median(np.diff(np.unique(t)))), float(even[1] - even[0])
        said = f"its clock counts in steps of {tick:.3g} s, or its rows come in bursts, and rows share a stamp"
        said = f"{said}: taken as evenly spaced, {step:.4g} s apart"
        return replace(table, notes=(*table.notes, Note(said, "assumed", "t"))), even
    apart = [(head, column, _differ(column[again], column[again - 1])) for head, column in _pairs(table)]
    either = np.any([differ for *_, differ in apart], axis=0) if apart else np.zeros(again.size, dtype=np.bool_)
    if either.sum() > MANY_GAPS * t.size:
        head, column, differ = next(one for one in apart if one[2].any())
        i = int(again[np.argmax(differ)])
        where = f"{table.rows.name(i - 1)} and {table.rows.name(i)}"
        values = f"{head.label!r} is {_shown(column[i - 1])} and {_shown(column[i])}"
        others = int(np.count_nonzero(differ)) - 1
        more = f"; so do {others} more" if others else ""
        way = "where the rows are evenly spaced, --dt says by how much"
        raise RecordError(f"{table.source}: {where} have the same time stamp but differ: {values}{more}; {way}")
    keep = np.ones(t.size, dtype=np.bool_)
    keep[again] = False
    notes = []
    for rows, why in (
        (again[~either], "same stamp, same values"),
        (again[either], "the stamp of the row before, others"),
    ):
        if rows.size:
            count = "1 repeated row" if rows.size == 1 else f"{rows.size} repeated rows"
            notes.append(Note(f"{count} dropped ({why}), the first {table.rows.name(rows[0])}", "repeated"))
    return table.take(keep, *notes), t[keep]


def _completed(table: RawTable, t: Array) -> tuple[RawTable, Array] | None:
    """Return one row for each stamp where rows that share one have values in different columns, and those that both
    have are the same; None where any differ.
    """
    group = np.concatenate([[0], np.cumsum(np.diff(t) != 0)])
    first = np.concatenate([[True], np.diff(group) > 0])
    columns = []
    for column in table.columns:
        there = np.flatnonzero(np.isfinite(column))
        values = np.full(int(group[-1]) + 1, np.nan)
        values[group[there]] = column[there]
        if not np.array_equal(values[group[there]], column[there]):
            return None
        columns.append(values)
    said = f"{t.size - len(columns[0])} rows are part of the row before, whose stamp they have: put together"
    return replace(table.take(first, Note(said, "format")), columns=columns), t[first]


def _pairs(table: RawTable) -> Iterable[tuple[Heading, Array]]:
    return zip(table.headings, table.columns, strict=True)


def _differ(now: Array, before: Array) -> npt.NDArray[np.bool_]:
    return np.asarray((now != before) & ~(np.isnan(now) & np.isnan(before)))


def _counted(t: Array) -> Array | None:
    """Return evenly spaced times (T,) for stamps of a clock that is coarser than the rows, or of bursts of rows, each
    within a step of the clock, or all first or all last rows of a stamp; None where they are not even so far, or seldom
    the same.
    """
    stamps, first = np.unique(t, return_index=True)
    if stamps.size < MIN_STAMPS or t.size < MIN_ROWS_A_STAMP * stamps.size:
        return None
    k, tick = np.arange(t.size), float(np.median(np.diff(stamps)))
    for of in (k, np.append(first[1:], t.size) - 1, first):
        slope, start = np.polyfit(of, t[of], 1)
        if slope > 0.0 and np.ptp(start + slope * of - t[of]) < COUNTED * tick:
            return np.asarray(t[0] + slope * k)
    return None


def _finite(table: RawTable, keep: Keep) -> RawTable:
    """The table without infinite columns that nobody asked for; refuses infinite values in the others."""
    infinite = [i for i, column in enumerate(table.columns) if np.isinf(column).any()]
    for i in infinite:
        head, column = table.headings[i], table.columns[i]
        row = int(np.argmax(np.isinf(column)))
        if keep(head, table.headings) is not False:
            fault = f"{_shown(column[row])} is not a finite number"
            way = "leave the cell empty where a sample is missing"
            raise RecordError(f"{table.source}: {table.rows.name(row)}, column {head.label!r}: {fault}; {way}")
    kept = [i for i in range(len(table.columns)) if i not in infinite]
    labels = [table.headings[i].label for i in infinite]
    notes = [Note(f"column {label!r} holds infinite values and is left out", "left_out", label) for label in labels]
    headings, columns = [table.headings[i] for i in kept], [table.columns[i] for i in kept]
    return replace(table, headings=headings, columns=columns, notes=(*table.notes, *notes))


def _signals(table: RawTable) -> dict[str, Signal]:
    """Signals keyed by their bare names, or by the whole labels where several share a name or where what ends the name
    may be a unit or none.
    """
    count = Counter(head.name for head in table.headings)
    signals = {}
    for head, column in zip(table.headings, table.columns, strict=True):
        own = head.suffix and heading(head.label).name == head.name
        key = head.label if own or count[head.name] > 1 else head.name
        signals[key] = Signal(column, head.unit, head.label, head.number)
    return signals


def _shown(value: float | np.floating) -> str:
    return "nan" if np.isnan(value) else repr(float(value))
