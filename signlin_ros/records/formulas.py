"""A record with what a mapping makes of its columns: another unit, a factor, a product of two."""

from __future__ import annotations

import functools
import re
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from signlin_ros import units
from signlin_ros.errors import RecordError
from signlin_ros.records.align import align, looks_held
from signlin_ros.records.grammar import Node, is_formula, parse, split_unit, words
from signlin_ros.records.header import heading
from signlin_ros.records.notes import Note
from signlin_ros.records.table import Record, Series, Signal

Array = npt.NDArray[np.float64]

_COUNT = re.compile(r"\s*0*[1-9]\d*\s*")
_UNNAMED = re.compile(r"[cC][1-9]\d*")


def made(record: Record, name: str, spec: str, wanted: str = "") -> tuple[Record, str]:
    """The record with the quantity that `spec` says `name` is, and its key there; `wanted`: the model's unit of it.

    A text that is a column's name as a whole is that column; else a unit at its end is what the rest is in, unless it
    is the end of a column's heading; else it is a formula.

    Raises
    ------
    RecordError
        Neither a column nor a formula of columns.
    """
    key = record.find(spec)
    if key is not None:
        return record, key
    body, unit = split_unit(spec)
    key = record.find(body) if unit else None
    if key is not None:
        said = f"{name}: the column {record.labels[key]!r} is in {unit}, as said"
        return _with(record, spec, record.signals[key].values, unit, record.series.get(key), Note(said, "mapped", name))
    if unit and any(spec.endswith(label) for label in record.labels.values()):
        body, unit = spec, ""  # ``0.12 * i [A]`` of the column ``i [A]`` is a torque
    if not is_formula(spec):
        record.require(spec, f"signal (mapped to {name})", by_number(record, name, spec))
    return _formula(record, name, spec, body, unit, wanted)


def by_number(record: Record, name: str, spec: str) -> str:
    """What to say in place of ``c2``, which only a file without names has, where the file has names; or nothing.

    `name`: what `spec` is said to be.
    """
    numbers = {signal.number for signal in record.signals.values() if signal.number}
    lost = [word for word in words(spec) if _UNNAMED.fullmatch(word) and record.find(word) is None]
    if not lost or not numbers or all(_UNNAMED.fullmatch(label) for label in record.labels.values()):
        return ""
    said = f"; the file has names, and none of them is {lost[0]}"
    if not {int(word[1:]) for word in lost} <= numbers:
        return f"{said}; a column may be taken by its number, as in {name}: {min(numbers)}"
    alone = split_unit(spec)[0] == lost[0]
    instead = functools.reduce(lambda text, word: re.sub(rf"\b{word}\b", f"#{word[1:]}", text), lost, spec)
    instead = instead.removeprefix("#") if alone else instead
    return f"{said}; a column may be taken by its number, {name}: {instead if instead.isdigit() else repr(instead)}"


def constant(record: Record, spec: str) -> tuple[float, str] | None:
    """The number that `spec` is, and its unit or ""; None where it is a column or made of columns.

    A whole number from 1 on is that of a column.
    """
    try:
        body, unit = split_unit(spec)
        if (
            any(record.find(text) is not None for text in (spec, body))
            or not is_formula(spec)
            or _COUNT.fullmatch(body)
        ):
            return None
        node = parse(body, _names(record), record.source)
    except RecordError:
        return None
    return (float(node.evaluate({})), unit) if node.constant else None


def sole(record: Record, spec: str) -> str | None:
    """The key of the one column that `spec` is made of; None where it is made of several, or of none that is there."""
    body, unit = split_unit(spec)
    key = record.find(spec) or (record.find(body) if unit else None)
    if key is not None or not is_formula(spec):
        return key
    used = set(parse(body, _names(_with_time(record)), record.source).columns())
    key = used.pop() if len(used) == 1 else None
    return key if key in record.signals else None


def _with_time(record: Record) -> Record:
    """The record with what a formula may use beside its signals: the columns of the time, as they stand, and ``t`` in s
    where nothing else is called so. A bag has no time of its own.
    """
    if record.series:
        return record
    clocks = {key: signal for key, signal in record.clocks.items() if signal.values.shape == record.t.shape}
    return replace(record, signals={"t": Signal(record.t, "s", "t"), **clocks, **record.signals})


def _formula(record: Record, name: str, spec: str, body: str, unit: str, wanted: str) -> tuple[Record, str]:
    columns, record = record, _with_time(record)
    try:
        node = parse(body, _names(record), f"{record.source}: {name}")
    except RecordError as error:
        raise RecordError(f"{error}{by_number(columns, name, spec)}") from None
    used = list(dict.fromkeys(node.columns()))
    if not used:
        number = f", and a number that it is throughout has a decimal point, {body}.0" if _COUNT.fullmatch(body) else ""
        raise RecordError(f"{record.source}: {name} = {spec}: names no column; {columns.listing()}{number}")
    units_of = {key: _unit(record, key) for key in used}
    stated = node.unit(units_of)
    if stated is None or units.conversion(stated, wanted) is None:
        stated = node.unit(units_of, ones=False)
    if stated is None and not unit:
        listed = ", ".join(f"{record.labels[key]!r} in {units_of[key] or 'no unit'}" for key in used)
        raise RecordError(
            f"{record.source}: {name} = {spec} adds different units ({listed}); state the result's: ... [UNIT]"
        )
    unit = unit or stated or ""
    taken = f"in {unit}" if unit else "the columns' numbers as they stand"
    notes = [Note(f"{name} = {spec}, {taken}", "mapped", name), *_pins(record, node, name)]
    series = _series(record, node, used) if all(key in record.series for key in used) else None
    values, lost = _evaluated(node, {key: record.signals[key].values for key in used})
    if lost.any():
        rows = f"{int(lost.sum())} rows, the first {record.where(int(np.argmax(lost)))}"
        said = f"{name} = {spec} has no value where it divides by zero, in {rows}"
        notes.append(Note(said, "undefined", name))
    return _with(columns, spec, values, unit, series, *notes)


def _with(
    record: Record, spec: str, values: Array, unit: str, series: Series | None, *notes: Note
) -> tuple[Record, str]:
    signals = {**record.signals, spec: Signal(values, unit, spec, of_mapping=True)}
    every = record.series
    if series is not None:
        every = {**record.series, spec: replace(series, unit=unit, label=spec, names=())}
    return replace(record, signals=signals, series=every, notes=(*record.notes, *notes)), spec


def _unit(record: Record, key: str) -> str:
    """The unit of a column, unless it is one letter at the end of its name, which may mean anything."""
    unit = record.signals[key].unit
    return "" if len(unit) == 1 and heading(record.labels[key]).suffix else unit


def _names(record: Record) -> dict[str, str]:
    """All that the signals may be called -> their keys; names that two have are left out."""
    found: dict[str, set[str]] = {}
    for key, signal in record.signals.items():
        if signal.of_mapping:  # of `0.1 * (a - 5)` the heading would be `0.1 *`, with which another formula may begin
            continue
        head = heading(record.labels[key])
        further = record.series[key].names if key in record.series else ()
        number = (f"#{signal.number}",) if signal.number else ()
        for name in (key, head.label, head.name, *further, *number):
            found.setdefault(name, set()).add(key)
    return {
        name: name if name in record.signals else min(keys)
        for name, keys in found.items()
        if len(keys) == 1 or name in record.signals
    }


def _series(record: Record, node: Node, used: list[str]) -> Series:
    """The formula on the stamps of the fastest of its signals; commands are held, others interpolated."""
    parts = {key: record.series[key] for key in used}
    held = {key for key, one in parts.items() if looks_held(one)}
    one = align(parts, held)
    return Series(one.t, _evaluated(node, {key: signal.values for key, signal in one.signals.items()})[0])


def _evaluated(node: Node, columns: Mapping[str, Array]) -> tuple[Array, npt.NDArray[np.bool_]]:
    """The values (T,), NaN where a division by zero leaves none, and where that is."""
    values = node.evaluate(columns)
    lost = node.undefined(columns) & ~np.isfinite(values)
    return np.where(lost, np.nan, values), lost


def _pins(record: Record, node: Node, name: str) -> list[Note]:
    """What is said where ``sign`` is taken of a column of 0 and 1."""
    notes = []
    if node.op == "sign" and node.parts[0].op == "column":
        values = record.signals[node.parts[0].name].values
        there = values[np.isfinite(values)]
        if there.size and set(np.unique(there).tolist()) == {0.0, 1.0}:
            label = record.labels[node.parts[0].name]
            notes.append(Note(f"{label!r} holds only 0 and 1: its sign is -1 and 1", "assumed", name))
    for part in node.parts:
        notes += _pins(record, part, name)
    return notes
