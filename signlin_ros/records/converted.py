"""Columns in a model's units: converted, refused where they cannot be, and said where it is only assumed."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from signlin_ros import units
from signlin_ros.errors import RecordError
from signlin_ros.records.grammar import is_formula, split_unit
from signlin_ros.records.header import heading
from signlin_ros.records.notes import Note
from signlin_ros.records.table import Record, Signal

if TYPE_CHECKING:
    from signlin_ros.model import Model

Array = npt.NDArray[np.float64]

MAX_SI_VALUE = 1e15
"""Larger values, in SI units, are no measurements; squares of sums of them would overflow."""
COLDEST = 150.0
"""A temperature in K below which it is rather in another unit: nothing on Earth is as cold out of doors (184 K)."""
MAX_HUGE_SHARE = 0.01
"""Share of such values up to which they are taken for missing: of a column that is full of them nothing is known."""
NO_VALUE, CODE_DIGITS = (9.91e37, 9.9e37, 3.4028235e38, 1.7976931348623157e308), 1e-4
"""Numbers that stand for no value, and how exactly: not a number and infinity of instruments [IEEE 488.2 and SCPI 1999,
7.2.1], the largest number of a memory that was never written."""
SMALLEST = 1e-30
"""Smaller values are none either: no sensor resolves them, and their squares underflow."""


def converted(
    record: Record, model: Model, chosen: Mapping[str, str], notes: list[Note], numbers: Collection[str] = ()
) -> tuple[dict[str, Array], dict[str, str]]:
    """The chosen columns in the model's units, and the units: name -> (T,), name -> unit. `numbers`: the inputs that
    are no columns but said to be a number.
    """
    values: dict[str, Array] = {}
    unit_of: dict[str, str] = dict(model.units)
    kinds: dict[str, str] = {}
    formulas, turns = _mapped(record), _turns(record, model, chosen)
    for name, key in chosen.items():
        signal, wanted = record.signals[key], model.units[name]
        unit, how = _how(record, name, key, wanted, name in formulas, turns)
        zero = units.zero(unit) if unit else 0.0
        values[name], unit_of[name] = units.scaled(signal.values, how[0]) + zero, how[1]
        if how[0] != 1.0 or zero:
            notes.append(Note(f"{name} is converted from {unit} to {how[1]}", "converted", name))
        _check_temperature(record, name, signal, values[name], wanted)
        values[name] = _without_codes(name, signal.values, values[name], notes)
        values[name] = _without_huge(record, name, signal, values[name], notes)
        values[name] = _without_tiny(name, values[name], unit_of[name], notes)
        if unit and units.kind(wanted.split(" or ")[0]) == "linear":
            kinds[name] = units.kind(how[1])  # of what was made of it: nm may be N·m
    _check_kinds(record, chosen, kinds)
    rotary = "rotary" in kinds.values()
    columns = {name: key for name, key in chosen.items() if name not in numbers}
    notes += _assumed(record, model, columns, rotary or (not kinds and model.is_rotary is True))
    if rotary:
        notes.append(Note("the record is rotary (rad, N·m): so are the model's parameters", "assumed"))
        unit_of = {name: units.rotary(unit) for name, unit in unit_of.items()}
    return values, unit_of


def _check_temperature(record: Record, name: str, signal: Signal, values: Array, wanted: str) -> None:
    """Refuse a temperature in K that no drive has: what states no unit is most often in degrees Celsius."""
    usual = float(np.nanmedian(values)) if wanted == "K" and np.isfinite(values).any() else COLDEST
    if usual < COLDEST:
        column = quoted(signal.label or name)
        raise RecordError(
            f"{record.source}: the {name} is {usual:.4g} K, as no drive is; if it is in degrees Celsius, "
            f"say so: --signal '{name} = {column} [degC]'"
        )


def _assumed(record: Record, model: Model, chosen: Mapping[str, str], rotary: bool) -> list[Note]:
    """What is said of columns without a unit beside others that have one; a formula states its own conversion."""
    silent = [n for n, key in chosen.items() if not record.signals[key].unit and model.units[n] not in ("", "-", "1")]
    if len(silent) == len(chosen):
        return []
    formulas = _mapped(record)
    said = "no unit is stated for {} beside others that have one: taken in {}"
    taken = {n: units.rotary(model.units[n]) if rotary else model.units[n] for n in silent if n not in formulas}
    return [Note(said.format(name, unit), "assumed", name) for name, unit in taken.items()]


def _mapped(record: Record) -> set[str]:
    """The signals that were said to be a formula, or a column in another unit than its own."""
    return {note.channel for note in record.notes if isinstance(note, Note) and note.kind == "mapped"}


def _turns(record: Record, model: Model, chosen: Mapping[str, str]) -> bool:
    """Whether the record is rotary: by the units of its columns, else as the model says."""
    linear = [name for name in chosen if units.kind(model.units[name].split(" or ")[0]) == "linear"]
    pairs = [(record.signals[chosen[name]].unit, model.units[name]) for name in linear]
    found = (units.conversion(unit, wanted) for unit, wanted in pairs if unit)
    kinds = {units.kind(how[1]) for how in found if how is not None}
    return kinds == {"rotary"} or (not kinds and model.is_rotary is True)


def _how(record: Record, name: str, key: str, wanted: str, mapped: bool, turns: bool) -> tuple[str, tuple[float, str]]:
    """The unit of a column, and how to bring it to the one that is wanted: see `signlin_ros.units.conversion`.

    `mapped`: it is what was said, perhaps a formula; `turns`: the record is rotary.
    """
    signal = record.signals[key]
    label = signal.label or key
    how = units.conversion(signal.unit, wanted)
    if how is not None:
        return signal.unit, how
    if len(signal.unit) == 1 and heading(label).suffix:  # one letter at the end of a name is a unit where it fits
        return "", (1.0, wanted)
    known = f"in {signal.unit!r}" + ("" if units.parse(signal.unit) is not None else ", which is no unit that is known")
    formula = mapped and is_formula(label)
    term = split_unit(label)[0] if formula else quoted(label)
    factor = f"FACTOR * ({term})" if formula else f"FACTOR * {term}"
    needed = units.rotary(wanted) if turns else wanted
    what = f"{'formula' if formula else 'column'} {label!r}"
    raise RecordError(
        f"{record.source}: {name} is {known} ({what}), the model in {needed!r}; say what it is: "
        f"--signal '{name} = {term} [UNIT]', or --signal '{name} = {factor}'"
    )


def quoted(label: str) -> str:
    """A column's name as a formula takes it."""
    bare = heading(label).name
    plain = re.fullmatch(r"[\w./\[\]]+", bare) and not re.fullmatch(r"[\d.]+(?:[eE]\d+)?", bare)
    return bare if plain else f'"{bare}"'


def _without_huge(record: Record, name: str, signal: Signal, values: Array, notes: list[Note]) -> Array:
    """The values without what no sensor says, where it is seldom: memory that was not yet written; else refused."""
    huge = np.flatnonzero(np.abs(values) > MAX_SI_VALUE)
    if not huge.size:
        return values
    first = (
        f"{record.where(int(huge[0]))}, column {signal.label or name!r}: {signal.values[huge[0]]:g} is no measurement"
    )
    if huge.size > MAX_HUGE_SHARE * values.size:
        allowed = f"up to {MAX_SI_VALUE:g} in size; leave the cell empty where a sample is missing"
        raise RecordError(f"{record.source}: {first}; allowed: {allowed}")
    what = "it is taken" if huge.size == 1 else f"it and {huge.size - 1} more are taken"
    notes.append(Note(f"{name}: {first}: {what} for missing", "nothing", name))
    return np.where(np.abs(values) > MAX_SI_VALUE, np.nan, values)


def _without_codes(name: str, raw: Array, values: Array, notes: list[Note]) -> Array:
    """The values with what instruments write where there is none left out: it says so by a number."""
    coded = np.any([np.abs(np.abs(raw) / code - 1.0) < CODE_DIGITS for code in NO_VALUE], axis=0)
    if not coded.any():
        return values
    said = f"{name}: {int(coded.sum())} values are {raw[coded][0]:.3g}, which stands for none: missing samples"
    notes.append(Note(said, "nothing", name))
    return np.where(coded, np.nan, values)


def _without_tiny(name: str, values: Array, unit: str, notes: list[Note]) -> Array:
    """The values with 0 for what is smaller than any measurement: memory that was never written reads 1e-310."""
    tiny = (np.abs(values) < SMALLEST) & (values != 0.0)
    if not tiny.any():
        return values
    said = f"{name}: {int(tiny.sum())} values smaller than {SMALLEST:g} {unit} are no measurements, and taken as 0"
    notes.append(Note(said, "nothing", name))
    return np.where(tiny, 0.0, values)


def _check_kinds(record: Record, chosen: Mapping[str, str], kinds: Mapping[str, str]) -> None:
    """Refuse a record that mixes newtons and radians."""
    first: dict[str, str] = {}
    for name, kind in kinds.items():
        first.setdefault(kind, name)
    if len(first) > 1:
        stated = " but ".join(f"{name} is in {record.signals[chosen[name]].unit!r}" for name in first.values())
        raise RecordError(f"{record.source}: {stated}: either all is linear (m, N) or all is rotary (rad, N·m)")
