"""The inputs of a model in a record: from where they are known, held where they are missing."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from signlin_ros.errors import RecordError
from signlin_ros.records.notes import Note
from signlin_ros.records.table import Record, Signal, frozen

if TYPE_CHECKING:
    from signlin_ros.model import Model

Array = npt.NDArray[np.float64]

LONGEST_HOLD = 5
"""So many missing samples of an input in a row are filled with the value before them; more are refused."""


def with_inputs(
    record: Record, model: Model, values: Mapping[str, Array], measured: dict[str, Array], notes: list[Note]
) -> tuple[Record, Array, dict[str, Array]]:
    """The inputs u (T, m), in a bag from the first message of all of them on."""
    columns = [values.get(name, np.zeros(record.t.shape)) for name in model.inputs]
    loose = [column for column in columns if record.series or _logged_when_new(column)]
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


def _logged_when_new(values: Array) -> bool:
    """Whether most samples of an input are missing, as where a command is logged when it is given."""
    return bool(np.isnan(values).mean() > 0.5 and np.isfinite(values).sum() > 1)


def _leading(values: Array) -> int:
    """How many NaN stand at the front."""
    there = np.flatnonzero(~np.isnan(values))
    return int(there[0]) if there.size else int(values.size)


def _inputs_filled(record: Record, name: str, values: Array, notes: list[Note]) -> Array:
    """The values with up to `LONGEST_HOLD` NaN in a row replaced by the value before them."""
    missing = np.isnan(values)
    if not missing.any():
        return values
    index = np.arange(values.size)
    last = np.maximum.accumulate(np.where(missing, -1, index))
    age = index - last
    bad = (last < 0) | (age > LONGEST_HOLD)
    if _logged_when_new(values) and last[0] >= 0:
        notes.append(Note(f"input {name}: logged where it changes only, held from there on", "held", name))
        return values[last]
    if bad.any():
        first = int(last[np.argmax(bad)]) + 1
        why = "before its first value" if first == 0 else f"more than {LONGEST_HOLD} times in a row"
        raise RecordError(f"{record.source}: {record.where(first)}: the input {name!r} is missing {why}")
    place = record.where(int(np.argmax(missing)))
    said = f"input {name}: {int(missing.sum())} missing samples hold the value before them, the first at {place}"
    notes.append(Note(said, "filled", name))
    return values[last]
