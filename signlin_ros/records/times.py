"""When the rows of a table were taken: from a column, from two, from a formula, or evenly."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from signlin_ros import units
from signlin_ros.errors import RecordError
from signlin_ros.records import grammar
from signlin_ros.records.clocks import contradicted, of_days
from signlin_ros.records.counted import CALENDAR, MAX_ROW_TIME, Times, asked, column_of, from_first
from signlin_ros.records.header import TIME_KEYS, Heading, clock, names_a_time, pair, unit_of_time
from signlin_ros.records.notes import Note
from signlin_ros.records.table import listing, nearest

if TYPE_CHECKING:
    from signlin_ros.records.clean import RawTable

Array = npt.NDArray[np.float64]

_STEPS = re.compile(
    r"(?i)(?:dt|ts|t_s|delta_?t(?:ime)?|(?:sample|sampling|step|cycle)[ _]?(?:time|period)|time[ _]?step)\Z"
)
"""Names of columns that hold the time from row to row."""
_PARTS = re.compile(r"(?i)(?:.*[\W_])?(?:milli(?:s|secs?|seconds?)?|m(?:s|secs?))\Z")
"""Names of columns that hold the ms beyond the whole seconds of another one."""
NANOSECOND = 1e-9
"""In s."""
MIN_RISING = 0.2
"""Part of the rows at which a time goes on at least: several may share a stamp."""
_UNIT_ALONE = re.compile(r"(?:m|u|µ|μ|n)s(?:ecs?)?|(?i:milli|micro|nano)(?:seconds?|secs?)")
"""Names of columns that are a unit of time and nothing else."""
_ALSO_A_SPEED = "ms"
"""The one of them that stands for m/s as well; a speed does not only rise."""


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
    times = of_days(table, times) or times
    return replace(times, notes=(*times.notes, *contradicted(table, times)))


def _found(table: RawTable) -> Times:
    """The times of a table's rows, of which nothing is said."""
    best, two = clock(table.headings), pair(table.headings)
    if two is not None and (best is None or best in two):
        if _beyond(table, *two[1:]):
            return _two(table, *two)
        if _one_clock(table, *two):
            return column_of(table, two[1], "ns" if two[2] == NANOSECOND else "us")
    if best is not None and best.time is not None:
        return _finer(table, best)
    dated = _with_milliseconds(table)
    if dated is not None:
        return dated
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
    times = column_of(table, best, _unit(best))
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
    times = column_of(table, best, (best.time or (0, best.unit))[1])
    if times.t.size < 2 or not (np.diff(times.t) == 0).any():
        return times
    pairs = zip(table.headings, table.columns, strict=True)
    others = [(head, column) for head, column in pairs if head is not best and np.isfinite(column).all()]
    for head, column in others:
        if (head.time is not None or _counts(table, head)) and (np.diff(column) > 0).all():
            said = f"rows share stamps of {best.label!r}: the time is {head.label!r}, which tells them apart"
            found = column_of(table, head, _unit(head))
            return replace(found, notes=(Note(said, "assumed", "t"), *found.notes))
    for head, column in others:
        if _PARTS.match(head.name) and column.min() >= 0.0 and column.max() < 1000.0:
            t = times.t - (times.t[0] if times.t[0] > CALENDAR else 0.0) + 1e-3 * column
            if (np.diff(t) > 0).all():
                note = Note(f"the ms in {head.label!r} are added to the time in {best.label!r}", "assumed", "t")
                return replace(times, t=t, used=times.used | {head.label}, notes=(*times.notes, note))
    return times


def _with_milliseconds(table: RawTable) -> Times | None:
    """The time of a column of dates and the ms beyond its seconds in another one; None where there are none."""
    pairs = list(zip(table.headings, table.columns, strict=True))
    whole = {**table.dated, **{head.label: column for head, column in pairs if head.unit == "s"}}
    for head, column in pairs:
        if not (_PARTS.match(head.name) and column.size > 1 and column.min() >= 0.0 and column.max() < 1000.0):
            continue
        for label, seconds in whole.items():
            t = seconds + 1e-3 * column
            if (np.diff(t) > 0).all():
                note = Note(f"the ms in {head.label!r} are added to the time in {label!r}", "assumed", "t")
                return Times(t - t[0], label, frozenset({label, head.label}), (note,))
    return None


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
    return Times(t - t[0], head.label, frozenset({head.label}), (Note(said, "assumed", "t"), *asked(head, t)))


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
            times = column_of(table, head, unit, said=bool(stated))
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
        moved = {name: from_first(table, name, column) for name, column in columns.items()}
        t = node.evaluate(moved) - node.evaluate(dict.fromkeys(columns, np.zeros(1)))
        begin = float(node.evaluate({name: column[:1] for name, column in columns.items()})[0]) * how[0]
        t = t * how[0] + (0.0 if abs(begin) > CALENDAR else begin)
    else:
        t = node.evaluate(columns) * how[0]
    return Times(np.asarray(t, dtype=np.float64), "t", used, (Note(f"t = {spec}", "clock", "t"),))


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


def _beyond(table: RawTable, part: Heading, size: float) -> bool:
    """Whether a column is what is beyond the whole seconds of another, and no clock by itself."""
    column = table.columns[table.headings.index(part)]
    return bool(column.size and np.nanmin(column) >= 0.0 and np.nanmax(column) * size < 1.0)


def _one_clock(table: RawTable, whole: Heading, part: Heading, size: float) -> bool:
    """Whether two columns say the same time in two units."""
    first, second = (table.columns[table.headings.index(head)] for head in (whole, part))
    scale = max(float(np.abs(np.diff(second)).max(initial=0.0)), 1.0)
    return bool(first.size > 1 and np.abs(first - first[0] - (second - second[0]) * size).max() < scale * size)


def _are_two(first: Array, second: Array) -> bool:
    """Whether two columns of whole numbers are seconds, and nanoseconds beyond them."""
    steps = np.diff(first)
    within = second.min() >= 0 and second.max() < 1e9 and second.max() >= 1e3
    return bool(within and (steps >= 0).mean() > 0.9 and np.median(steps) <= MAX_ROW_TIME)


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
        times = column_of(table, table.headings[0], "")
        said = f"no header: {times.label!r} is taken for the time, as it goes on from row to row"
        return replace(times, notes=(Note(said, "assumed", "t"), *times.notes))
    return None
