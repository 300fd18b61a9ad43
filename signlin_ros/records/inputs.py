"""The inputs of a model in a record: from where they are known, held where they are missing."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from signlin_ros import units
from signlin_ros.errors import RecordError
from signlin_ros.records.notes import Note, as_notes
from signlin_ros.records.table import Record, Signal, frozen

if TYPE_CHECKING:
    from signlin_ros.model import Model

Array = npt.NDArray[np.float64]

_SOURCES = {"velocity": ("displacement",)}
"""What an input of an imposed motion may be derived from."""
_DIVISOR = "add a small number to the divisor, ... / (COLUMN + 0.001), or leave these rows out of the file"

JOIN = "`paste -d, a.csv b.csv > both.csv` joins rows that belong together"
"""What is to be done where the signals of one record are in two files."""

LONGEST_HOLD = 5
"""So many missing samples of an input in a row are filled; more are refused."""


def check_inputs(
    record: Record, model: Model, found: set[str], require: str, notes: list[Note], why_not: Mapping[str, str]
) -> None:
    """Refuse a record without an input, and say where the model's own mapping of it (`why_not`) does not hold."""
    for name in model.inputs:
        if name in found:
            continue
        if name in model.plant.optional_inputs or require == "none":
            taken = model.u0[model.inputs.index(name)]
            unit = f" {model.units[name]}".removesuffix(" -") if taken else ""
            notes.append(Note(f"no input {name} in the record: taken as {taken:g}{unit}", "assumed", name))
            continue
        out = [note for note in record.notes if "left out" in note]
        said = next((one for one in (name, *_SOURCES.get(name, ())) if one in why_not), None)
        if said is not None:
            other = f"said in the model file's signals; --signal {said}=COLUMN says it otherwise"
            raise RecordError(f"{why_not[said]} ({other})" + "".join(f" ({note})" for note in out))
        raise RecordError(
            f"{record.source}: no column for input {name!r}; {record.listing()}{_hint(record, model, name)}; "
            f"map it with --signal {name}=COLUMN or signals: {{{name}: COLUMN}} in the model file, "
            f"or say that it is 0: --signal {name}=0{'' if record.series else f'; where another file holds it, {JOIN}'}"
            + "".join(f" ({note})" for note in out)
        )


def _hint(record: Record, model: Model, name: str) -> str:
    """The nearest name, else the columns that at least have the right unit."""
    near = record.nearest(name)
    if near:
        return near
    fits = [
        signal.label
        for signal in record.signals.values()
        if signal.unit and units.conversion(signal.unit, model.units[name]) is not None
    ]
    return f"; in {model.units[name]} or the like: {', '.join(map(repr, fits))}" if fits else ""


def with_inputs(
    record: Record, model: Model, values: Mapping[str, Array], measured: dict[str, Array], notes: list[Note]
) -> tuple[Record, Array, dict[str, Array]]:
    """The inputs u (T, m), in a bag from the first message of all of them on."""
    zeros = zip(model.inputs, model.u0.tolist(), strict=True)
    columns = [values[name] if name in values else np.full(record.t.shape, taken) for name, taken in zeros]
    pairs = zip(model.inputs, columns, strict=True)
    loose = [column for name, column in pairs if record.series or _logged_when_new(record, name, column)]
    start = max((_leading(column) for column in loose), default=0)
    if start > record.t.size - 2:
        raise RecordError(f"{record.source}: the first message of an input comes after the measurements have ended")
    if start:
        late = record.t[start] - record.t[0]
        notes.append(Note(f"starts with the inputs' first message, {late:.4g} s after the others'", "started"))
        acts = None if record.acts is None else record.acts[start:]
        record = replace(record, t=record.t[start:], signals=_cut(record.signals, start), acts=acts)
        measured = {name: frozen(column[start:]) for name, column in measured.items()}
        columns = [column[start:] for column in columns]
    filled = [_inputs_filled(record, name, column, notes) for name, column in zip(model.inputs, columns, strict=True)]
    u = np.stack(filled, axis=1) if filled else np.empty((record.t.size, 0))
    return record, frozen(u), measured


def _cut(signals: Mapping[str, Signal], start: int) -> dict[str, Signal]:
    return {name: replace(signal, values=signal.values[start:]) for name, signal in signals.items()}


def _logged_when_new(record: Record, name: str, values: Array) -> bool:
    """Whether most samples of an input are missing, as where a command is logged when it is given."""
    return bool(np.isnan(values).mean() > 0.5 and np.isfinite(values).sum() > 1) and not _undefined(record, name)


def _undefined(record: Record, name: str) -> str:
    """What is said of an input whose formula divides by zero, or nothing."""
    return next((str(note) for note in as_notes(record.notes) if (note.kind, note.channel) == ("undefined", name)), "")


def _leading(values: Array) -> int:
    """How many NaN stand at the front."""
    there = np.flatnonzero(~np.isnan(values))
    return int(there[0]) if there.size else int(values.size)


def _inputs_filled(record: Record, name: str, values: Array, notes: list[Note]) -> Array:
    """The values with up to `LONGEST_HOLD` NaN in a row filled: a command is held, a measured input interpolated."""
    missing = np.isnan(values)
    if not missing.any():
        return values
    index = np.arange(values.size)
    last = np.maximum.accumulate(np.where(missing, -1, index))
    age = index - last
    bad = (last < 0) | (age > LONGEST_HOLD)
    if _logged_when_new(record, name, values) and last[0] >= 0:
        notes.append(Note(f"input {name}: logged where it changes only, held from there on", "held", name))
        return values[last]
    if bad.any():
        first = int(last[np.argmax(bad)]) + 1
        why = "before its first value" if first == 0 else f"more than {LONGEST_HOLD} times in a row"
        divided = _undefined(record, name)
        lacks, more = ("has no value", f": {divided}; {_DIVISOR}") if divided else ("is missing", "")
        if missing.all() and not divided:
            more = ", and has none: nothing measures it; map the column of what drives it, --signal "
            more += f"{name}=COLUMN, or say that nothing does, --signal {name}=0"
        raise RecordError(f"{record.source}: {record.where(first)}: the input {name!r} {lacks} {why}{more}")
    place = record.where(int(np.argmax(missing)))
    filled, smooth = filled_in(record.t, values, missing)
    how = "lie on the line between their neighbours" if smooth else "hold the value before them"
    said = f"input {name}: {int(missing.sum())} missing samples {how}, the first at {place}"
    notes.append(Note(said, "filled", name))
    return filled


def filled_in(t: Array, values: Array, missing: npt.NDArray[np.bool_]) -> tuple[Array, bool]:
    """Return values (T,) at times t (T,) where some are missing, and whether these lie on the line between their
    neighbours; else each is the value before it.
    """
    if _lies_between(np.where(missing, np.nan, values)):
        return np.interp(t, t[~missing], values[~missing]), True
    return values[np.maximum.accumulate(np.where(missing, 0, np.arange(values.size)))], False


def _lies_between(values: Array) -> bool:
    """Whether the mean of its neighbours is nearer to a known value than the one before it, by the median: so it is of
    what is measured; a command, which is held for some samples, is the same as the one before.
    """
    before, value, after = values[:-2], values[1:-1], values[2:]
    known = np.isfinite(before + value + after)
    if not known.any():
        return False
    apart = np.abs(value - (before + after) / 2)[known], np.abs(value - before)[known]
    return bool(np.median(apart[0]) < np.median(apart[1]))
