"""When the rows of a table were taken: from a column, from two, from a formula, or evenly.

A time that counts from 1970 (in s, ms, µs or ns, which its size tells) counts from the first row here.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from signlin_ros import units
from signlin_ros.errors import RecordError
from signlin_ros.records import grammar
from signlin_ros.records.header import TIME_KEYS, Heading, clock, heading, names_a_time, pair, unit_of_time
from signlin_ros.records.notes import Note
from signlin_ros.records.table import Rows, listing, nearest

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
_STEPS = re.compile(
    r"(?i)(?:dt|ts|t_s|delta_?t(?:ime)?|(?:sample|sampling|step|cycle)[ _]?(?:time|period)|time[ _]?step)\Z"
)
"""Names of columns that hold the time from row to row."""
_PARTS = re.compile(r"(?i)(?:.*[\W_])?(?:milli(?:s|secs?|seconds?)?|m(?:s|secs?))\Z")
"""Names of columns that hold the ms beyond the whole seconds of another one."""
_UNIT_ALONE = re.compile(r"(?:m|u|µ|μ|n)s(?:ecs?)?|(?i:milli|micro|nano)(?:seconds?|secs?)")
"""Names of columns that are a unit of time and nothing else."""
_ALSO_A_SPEED = "ms"
"""The one of them that stands for m/s as well; a speed does not only rise."""
_SLOWEST = 60.0
"""A recorder does not take longer from row to row, in s."""
_FASTEST = 1e-7
"""Nor is one of a drive faster than this: steps that would be shorter are not in the unit that is stated."""
_LARGEST_SECONDS = 1e11
"""A stamp without a unit beyond this is surely not in seconds: 3000 years, or milliseconds since 1970."""
CALENDAR = 1e8
"""A time in s that begins later than this (3 years) counts from its first stamp: its clock is the calendar's."""
HOW = "state it: --signal 't = COLUMN [ms]', or --dt 0.01 where the rows are 0.01 s apart"


@dataclass(frozen=True, eq=False)
class Times:
    """``t`` (R,) s, in the order of the rows; ``used``: labels of the columns it was made of; ``label``: its name."""

    t: Array
    label: str
    used: frozenset[str] = frozenset()
    notes: tuple[Note, ...] = ()


def times_of(table: RawTable, signals: Mapping[str, str]) -> Times:
    """The times of a table's rows; `signals` may say what they are under the key ``t``.

    Where another clock of the file goes on by far more or less, that is asked for.

    Raises
    ------
    RecordError
        No time, with the columns listed and what may be said of it; a unit that is none of time.
    """
    spec = next((signals[key].strip() for key in sorted(signals.keys() & TIME_KEYS)), "")
    if spec:
        return _as_said(table, spec)
    times = _found(table)
    return replace(times, notes=(*times.notes, *_contradicted(table, times)))


def one_clock(table: RawTable) -> RawTable:
    """The table with one time where every signal has its own in front of it, ``Time, a, Time, b``: a row for each stamp
    of any, cells empty in between; others as they are.

    Times that are the same to a part of a step are one.
    """
    stems = [_NUMBERED.sub(r"\1", head.name).lower() for head in table.headings]
    timed = [k for k, head in enumerate(table.headings) if heading(stems[k]).time is not None and head.label]
    same = len({(stems[k], table.headings[k].unit) for k in timed}) == 1
    if (
        len(timed) < 2
        or timed[0] != 0
        or not same
        or table.columns[0].size < 2
        or min(np.diff([*timed, len(stems)])) < 2
    ):
        return table
    first = _column(
        _only(table, 0), table.headings[0], (heading(stems[0]).time or (0, ""))[1] or table.headings[0].unit
    )
    raw = [table.columns[k] for k in timed]
    known = [np.isfinite(column) for column in raw]
    if not known[0].all() or any(
        (np.diff(column[there]) <= 0.0).any() for column, there in zip(raw, known, strict=True)
    ):
        return table
    steps = np.diff(first.t)
    scale = float((first.t[-1] - first.t[0]) / (raw[0][-1] - raw[0][0]))
    clocks = [(column - raw[0][0]) * scale + first.t[0] for column in raw]
    ends = [*timed[1:], len(stems)]
    groups = list(zip(clocks, known, timed, ends, strict=True))
    if all(
        np.array_equal(there, known[0]) and np.abs(t - clocks[0]).max() < NEAR * np.median(steps)
        for t, there, *_ in groups
    ):
        return _without(table, timed[1:], "all times are the same to a part of a step: the first is taken")
    stamps = np.unique(np.concatenate([t[there] for t, there, *_ in groups]))
    columns, heads = [stamps], [Heading("t [s]", "t", "s")]
    for t, there, begin, end in groups:
        place = np.searchsorted(stamps, t[there])
        for k in range(begin + 1, end):
            column = np.full(stamps.shape, np.nan)
            column[place] = table.columns[k][there]
            columns.append(column)
            heads.append(table.headings[k])
    said = (
        f"every signal has a time of its own in front of it: {', '.join(repr(table.headings[k].label) for k in timed)}"
    )
    rows = Rows(np.arange(1, stamps.size + 1))
    return replace(
        table, headings=heads, columns=columns, rows=rows, notes=(*table.notes, Note(said, "assumed")), exact={}
    )


def _only(table: RawTable, k: int) -> RawTable:
    return replace(table, headings=[table.headings[k]], columns=[table.columns[k]])


def _without(table: RawTable, lost: Sequence[int], why: str) -> RawTable:
    kept = [k for k in range(len(table.headings)) if k not in lost]
    heads, columns = [table.headings[k] for k in kept], [table.columns[k] for k in kept]
    return replace(table, headings=heads, columns=columns, notes=(*table.notes, Note(why, "left_out")))


def _contradicted(table: RawTable, times: Times) -> list[Note]:
    """A question after the time where another clock of the file, in a unit that is known, goes on otherwise."""
    others = dict(table.dated)
    for head in table.headings:
        if head.label not in times.used and head.time is not None and head.time[1]:
            column = table.columns[table.headings.index(head)]
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


def _gone(t: Array) -> float:
    """By how much times (R,) go on, in s, without what they go back."""
    return float(np.maximum(np.diff(t), 0.0).sum())


def _found(table: RawTable) -> Times:
    """The times of a table's rows, of which nothing is said."""
    best, two = clock(table.headings), pair(table.headings)
    if two is not None and (best is None or best in two):
        return _two(table, *two)
    if best is not None and best.time is not None:
        return _finer(table, best)
    timed = [head for head in table.headings if _counts(table, head)]
    if timed:
        return _taken(table, timed)
    if table.step is not None:
        return _even(table, table.step[1], f"the sampling time {table.step[0]}")
    stepped = next((head for head in table.headings if _STEPS.match(head.name)), None)
    summed = None if stepped is None else _by_steps(table, stepped)
    if summed is not None:
        return summed
    if not table.named:
        found = _without_names(table)
        if found is not None:
            return found
    labels = [head.label for head in table.headings]
    kind = (
        "no header, so no time column"
        if not table.named
        else "no time column (t, time, timestamp or stamp, with a unit like 't [ms]')"
    )
    text = [repr(note.channel) for note in table.notes if note.kind == "left_out" and note.channel]
    kind += f" (text is left out: {', '.join(text)})" if text else ""
    if table.rows.number.size < len(labels) / 10:
        shape = f"{len(labels)} columns of {table.rows.number.size} rows"
        kind += f"; there are {shape}: if the signals are in rows, transpose the table"
    raise RecordError(
        f"{table.source}: {kind}; {listing(labels)}; name it with --signal t=COLUMN (or signals: {{t: COLUMN}}), "
        "or say --dt 0.01 where the rows are 0.01 s apart"
    )


def _counts(table: RawTable, head: Heading) -> bool:
    """Whether a column is a time by its unit, and goes on from row to row: ``Source [Second]``, ``in s``; a unit that
    may be none, at the end of a name, needs a name that ends as one of times: ``Teensy_time_s``. A name may be the unit
    and nothing else, ``ms``; without a unit it must be one of a time, ``pi_time``, ``TimeUS``.
    """
    alone = bool(_UNIT_ALONE.fullmatch(head.name)) and not head.unit
    called = names_a_time(head.name)
    if not (alone or head.unit or called) or (head.suffix and not called):
        return False
    column = table.columns[table.headings.index(head)]
    if column.size < 2 or not np.isfinite(column).all():
        return False
    if alone or head.unit:
        parsed = units.parse(head.name if alone else head.unit)
        if parsed is None or parsed[1] != (0, 0, 1, 0, 0, 0):
            return False
    steps = np.diff(column)
    if alone and head.name == _ALSO_A_SPEED:
        return bool((steps > 0).all())
    return bool((steps >= 0).mean() > 0.9 and (steps > 0).mean() > MIN_RISING)


def _taken(table: RawTable, timed: Sequence[Heading]) -> Times:
    """The time of the first of the columns that may be it, and which others may."""
    best, *others = timed
    times = _column(table, best, _unit(best))
    said = f"no column is called a time: {best.label!r} is taken for it, as it goes on from row to row"
    if others:
        names = ", ".join(repr(head.label) for head in others)
        said += f"; so {'does' if len(others) == 1 else 'do'} {names}: --signal t=COLUMN takes another one"
    return replace(times, notes=(Note(said, "assumed", "t"), *times.notes))


def _unit(head: Heading) -> str:
    """The unit that the name of a time states, or nothing."""
    if head.time is not None:
        return head.time[1]
    return head.unit or unit_of_time(head.name) or (head.name if _UNIT_ALONE.fullmatch(head.name) else "")


def _finer(table: RawTable, best: Heading) -> Times:
    """The time of the column that is called so; where rows share its stamps, with the ms beyond them in another column,
    or of another time that tells all rows apart.
    """
    times = _column(table, best, (best.time or (0, best.unit))[1])
    if times.t.size < 2 or not (np.diff(times.t) == 0).any():
        return times
    pairs = zip(table.headings, table.columns, strict=True)
    others = [(head, column) for head, column in pairs if head is not best and np.isfinite(column).all()]
    for head, column in others:
        if (head.time is not None or _counts(table, head)) and (np.diff(column) > 0).all():
            said = f"rows share stamps of {best.label!r}: the time is {head.label!r}, which tells them apart"
            found = _column(table, head, _unit(head))
            return replace(found, notes=(Note(said, "assumed", "t"), *found.notes))
    for head, column in others:
        if _PARTS.match(head.name) and column.min() >= 0.0 and column.max() < 1000.0:
            t = times.t - (times.t[0] if times.t[0] > CALENDAR else 0.0) + 1e-3 * column
            if (np.diff(t) > 0).all():
                note = Note(f"the ms in {head.label!r} are added to the time in {best.label!r}", "assumed", "t")
                return replace(times, t=t, used=times.used | {head.label}, notes=(*times.notes, note))
    return times


def _by_steps(table: RawTable, head: Heading) -> Times | None:
    """The time where a column holds the step from row to row: one value, in all rows or the first alone, or each
    row's own; None where it holds something else.
    """
    column = table.columns[table.headings.index(head)]
    how = units.conversion(head.unit, "s")
    known = column[np.isfinite(column)]
    if how is None or not known.size or known.min() <= 0.0:
        return None
    if known.size == 1 or np.ptp(known) == 0.0:
        times = _even(table, float(known[0]) * how[0], f"as {head.label!r} says")
        return replace(times, used=frozenset({head.label}))
    if known.size < column.size:
        return None
    t = np.cumsum(column * how[0])
    said = f"no time column: it is summed up from the steps in {head.label!r}"
    return Times(t - t[0], head.label, frozenset({head.label}), (Note(said, "assumed", "t"), *_asked(head, t)))


def _as_said(table: RawTable, spec: str) -> Times:
    """The time that a mapping describes: a column, a step, or a formula."""
    found = [head for head in table.headings if head.whole(spec) or head.bare(spec)]
    number = re.fullmatch(r"\+?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?(\s*\[(?P<unit>[^\]]+)\])?", spec)
    if len(found) != 1 and number is not None and not (spec.isdigit() and not table.named):
        scale = units.conversion(number["unit"] or "", "s")
        if scale is None:
            raise RecordError(f"{table.source}: t = {spec}: {number['unit']!r} is no unit of time")
        return _even(table, float(spec.split("[", maxsplit=1)[0]) * scale[0], "as said")
    body, unit = grammar.split_unit(spec)
    for text in (spec, body):
        found = [head for head in table.headings if head.whole(text)] or [h for h in table.headings if h.matches(text)]
        if len(found) == 1:
            stated = unit if text == body and unit else ""
            head = found[0]
            unit = stated or (head.time[1] if head.time is not None else head.unit)
            times = _column(table, head, unit, said=bool(stated))
            said = (Note(f"the time {head.label!r} is in {stated}, as said", "clock", "t"),) if stated else ()
            return replace(times, notes=times.notes or said)
    labels = [head.label for head in table.headings]
    if not grammar.is_formula(spec):
        own = clock(table.headings)
        if own is not None and re.fullmatch(r"[cC]\d+", spec):
            raise RecordError(
                f"{table.source}: no time column {spec!r}: the file has names, and its time is {own.label!r}; leave "
                f"--signal t={spec} out, and name the others as the file does: {listing(labels)}"
            )
        missing = f"no time column {spec!r}; {listing(labels)}{nearest(spec, labels)}"
        raise RecordError(f"{table.source}: {missing}; or say --dt 0.01 where the rows are 0.01 s apart")
    return _formula(table, spec, body, unit)


def _formula(table: RawTable, spec: str, body: str, unit: str) -> Times:
    names = {f"#{head.number}": head.label for head in table.headings if head.number}
    names |= {name: head.label for head in reversed(table.headings) for name in (head.name, head.label)}
    node = grammar.parse(body, names, f"{table.source}: t")
    used = frozenset(node.columns())
    if not used:
        raise RecordError(f"{table.source}: t = {spec} names no column")
    columns = {h.label: c for h, c in zip(table.headings, table.columns, strict=True) if h.label in used}
    how = units.conversion(unit, "s")
    if how is None:
        raise RecordError(f"{table.source}: t = {spec}: {unit!r} is no unit of time")
    if node.affine:  # counted from the first row, where a clock of the calendar would lose its digits
        moved = {name: _from_first(table, name, column) for name, column in columns.items()}
        t = node.evaluate(moved) - node.evaluate(dict.fromkeys(columns, np.zeros(1)))
        begin = float(node.evaluate({name: column[:1] for name, column in columns.items()})[0]) * how[0]
        t = t * how[0] + (0.0 if abs(begin) > CALENDAR else begin)
    else:
        t = node.evaluate(columns) * how[0]
    return Times(np.asarray(t, dtype=np.float64), "t", used, (Note(f"t = {spec}", "clock", "t"),))


def _from_first(table: RawTable, label: str, column: Array) -> Array:
    """A column less its first value, exactly where it holds whole numbers beyond what a double does."""
    exact = table.exact.get(label)
    return column - column[0] if exact is None else np.asarray(exact - exact[0], dtype=np.float64)


def _even(table: RawTable, step: float, why: str) -> Times:
    if not (np.isfinite(step) and step > 0.0):
        raise RecordError(f"{table.source}: the time from row to row is {step:g} s; allowed: more than 0")
    t = np.asarray(np.arange(table.rows.number.size) * step, dtype=np.float64)
    return Times(t, "t", frozenset(), (Note(f"rows are {step:g} s apart, {why}", "clock", "t"),))


def _two(table: RawTable, whole: Heading, part: Heading, size: float) -> Times:
    """Whole seconds and what is beyond them, in two columns."""
    columns = {head.label: column for head, column in zip(table.headings, table.columns, strict=True)}
    begin = float(columns[whole.label][0])
    offset = 0.0 if begin > CALENDAR else begin
    t = np.asarray((columns[whole.label] - begin) + columns[part.label] * size + offset, dtype=np.float64)
    said = f"time from {whole.label!r} and {part.label!r}"
    return Times(t, whole.label, frozenset({whole.label, part.label}), (Note(said, "clock", "t"),))


def _column(table: RawTable, head: Heading, unit: str, said: bool = False) -> Times:
    """The time in one column; its unit is the one that the file states, or ``said`` by the user."""
    raw = table.columns[table.headings.index(head)]
    _check_finite(table, raw)
    from_first = _from_first(table, head.label, raw)
    steps = np.diff(from_first)
    step = float(np.median(steps[steps > 0])) if (steps > 0).any() else 0.0
    notes: list[Note] = []
    found, how = unit, units.conversion(unit, "s")
    if how is None:
        raise RecordError(
            f"{table.source}: the time column {head.label!r} is in {unit!r}; allowed: s, ms, us, ns, min, h; {HOW}"
        )
    if raw.size:
        raw, from_first, wrapped = _unwrapped(raw, from_first, step)
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
    t = units.scaled(from_first if counted else raw, how[0])
    if not found:
        notes += _asked(head, t)
    elif how[0] != 1.0 and not notes:
        notes.append(Note(f"time from {head.label!r}, converted from {found} to s", "clock", "t"))
    if unit and how[0] != 1.0 and not said:
        notes += _doubted(head, unit, t.size, step * how[0])
    return Times(t, head.label, frozenset({head.label}), tuple(notes))


def _check_finite(table: RawTable, t: Array) -> None:
    bad = np.flatnonzero(~np.isfinite(t))
    if bad.size:
        where, shown = table.rows.name(bad[0]), "nan" if np.isnan(t[bad[0]]) else repr(float(t[bad[0]]))
        raise RecordError(f"{table.source}: {where}: the time stamp is {shown}, not a finite number")


def _epoch(first: float, step: float) -> str:
    """The unit in which a time counts from 1970, or the days of a spreadsheet's dates; "" where it does neither."""
    for unit, size in _EPOCHS.items():
        if _SINCE < first * size < _UNTIL and step * size < _SLOWEST:
            return unit
    if any(_SINCE < first * 1e-7 - before < _UNTIL for before in _TICKS) and step * 1e-7 < _SLOWEST:
        return "100ns"
    dated = any(least < first < most for least, most in _DATES)
    return "day" if dated and 0.0 < step < _LONGEST_DATED_STEP else ""


def _unwrapped(raw: Array, from_first: Array, step: float) -> tuple[Array, Array, str]:
    """A time (R,) as it is and from its first row, and what was done to it: one of a counter of so many bits goes on
    where it begins at 0 again.
    """
    backs, exact = np.diff(from_first), step > 0.0 and not (raw % 1).any() and raw.min() >= 0.0
    falls = np.flatnonzero(backs < 0.0)
    if not (exact and falls.size):
        return raw, from_first, ""
    for bits in _COUNTERS:
        ahead = backs[falls] + 2.0**bits
        if raw.max() < 2.0**bits and np.all((ahead > 0.0) & (ahead < _MOST_STEPS_OVER * step)):
            added = 2.0**bits * np.cumsum(np.concatenate([[0.0], backs < 0.0]))
            return raw + added, from_first + added, f"is of a counter of {bits} bits: it goes on where that overflows"
    return raw, from_first, ""


SLOW_STEPS = ((1e5, "ns"), (500.0, "us"), (0.5, "ms"))
"""Steps in s from which on a time without a unit is rather in another one."""


NEAR = 0.1
"""Part of a step by which two clocks differ that are one."""
MIN_RISING = 0.2
"""Part of the rows at which a time goes on at least: several may share a stamp."""
_NUMBERED = re.compile(r"(.*?)[ _]?(?:\(column \d+\)|\d+)?\Z")
"""A name, and the number behind it that tells it from others."""
MIN_TICKS, CLOCKS_APART = 5.0, 10.0
"""A clock has gone on by so many of its steps before it is held against another, and by which factor two differ that
are not in the units taken: a simulator's time and the calendar's may differ, too.
"""
MIN_UNIT_ROWS = 20
"""Rows from which on the steps of a time tell whether its unit has to be asked for."""


def _asked(head: Heading, t: Array) -> list[Note]:
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
        "where it counts samples, --dt"
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


def _are_two(first: Array, second: Array) -> bool:
    """Whether two columns of whole numbers are seconds, and nanoseconds beyond them."""
    steps = np.diff(first)
    within = second.min() >= 0 and second.max() < 1e9 and second.max() >= 1e3
    return bool(within and (steps >= 0).mean() > 0.9 and np.median(steps) <= _SLOWEST)


def _without_names(table: RawTable) -> Times | None:
    """The time in a table without a header: whole seconds and nanoseconds in front, as ``ros2 topic echo --csv`` writes
    them, or a first column that increases.
    """
    if len(table.columns) < 2 or table.columns[0].size < 2:
        return None
    first, second = table.columns[:2]
    whole = np.isfinite(first).all() and np.isfinite(second).all() and not (first % 1).any() and not (second % 1).any()
    if whole and _are_two(first, second):
        return _two(table, table.headings[0], table.headings[1], 1e-9)
    if np.isfinite(first).all() and (np.diff(first) > 0).mean() > 0.99:
        times = _column(table, table.headings[0], "")
        said = f"no header: {times.label!r} is taken for the time, as it goes on from row to row"
        return replace(times, notes=(Note(said, "assumed", "t"), *times.notes))
    return None
