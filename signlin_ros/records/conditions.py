"""Known conditions of a record: values of the model's parameters that belong to it, as a gain, a mass or a supply.

They are said (``--set FILE:kp=400``), a column that is the same all through, or a field of the file; the first that is
there counts.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from signlin_ros.errors import ModelError, RecordError
from signlin_ros.par import Par
from signlin_ros.records.notes import Note
from signlin_ros.records.table import Record

if TYPE_CHECKING:
    from signlin_ros.model import Model
    from signlin_ros.records.mapping import ModelData

MAX_CONDITION_DIFFERENCE = 1e-6
"""Relative difference of two values of a condition that are the same."""


def parameters_of(model: Model) -> dict[str, Par]:
    """Return the parameters of a model that may be a condition of a record, by name: those of numbers."""
    own = {name.split(".", 1)[1]: par for name, par in model.par_declarations().items()}
    signals = {*model.states, *model.inputs, *model.outputs}
    return {name: par for name, par in own.items() if not (par.structural or par.words or name in signals)}


def apart(model: Model, signals: Mapping[str, str]) -> tuple[dict[str, str], dict[str, str]]:
    """Return the parts of a mapping that name signals, and those that set the model's parameters."""
    known = parameters_of(model)
    named = {name: (name if name in known else name.removeprefix("parameters.")) for name in signals}
    said = {named[name]: spec for name, spec in signals.items() if named[name] in known}
    return {name: spec for name, spec in signals.items() if named[name] not in known}, said


def conditions_of(record: Record, model: Model, said: Mapping[str, str], notes: list[Note]) -> dict[str, float]:
    """Return the values of the model's parameters that are known of a record; notes say where each is from.

    Raises `RecordError` where a value is not allowed, a column varies, or the value would change the equations.
    """
    found: dict[str, float] = {}
    for name, par in parameters_of(model).items():
        value, origin = _value(record, name, said.get(name))
        if value is None:
            continue
        where = f"{record.source}: {name} ({origin})"
        try:
            found[name] = par.check(value, where)
        except ModelError as error:
            raise RecordError(str(error)) from None
        given = model.value(name)
        if name in model.plant.zero_matters and (found[name] == 0.0) != (given == 0.0):
            raise RecordError(
                f"{where}: found {value:g}, in the model it is {given:g}: what is 0 is no part of the equations; write"
                f" {name}: {value:g} into the model file"
            )
        unit = f" {par.unit}".removesuffix(" -")
        notes.append(Note(f"{name} is {found[name]:g}{unit} in this record ({origin})", "condition", name))
    return found


def held_apart(
    known: Sequence[ModelData], unseen: Sequence[ModelData] | None, said: Mapping[str, float]
) -> tuple[list[ModelData], list[ModelData]]:
    """Return the records without a condition, and those that have it, beside those that were unseen before.

    Raises `RecordError` where no record has it, or all do.
    """
    chosen = [all(_is(record, name, value) for name, value in said.items()) for record in known]
    if not any(chosen) or all(chosen):
        words = ", ".join(f"{name}={value:g}" for name, value in said.items())
        there = {name: sorted({r.conditions[name] for r in known if name in r.conditions}) for name in said}
        have = "; ".join(f"{name} is known to be {', '.join(f'{v:g}' for v in v_)}" for name, v_ in there.items() if v_)
        fault = "no record has it" if not any(chosen) else "all records have it: none is left to fit to"
        raise RecordError(f"hold out {words}: {fault}; {have or 'nothing of this name is known of these records'}")
    pairs = list(zip(known, chosen, strict=True))
    return [r for r, out in pairs if not out], [*(r for r, out in pairs if out), *(unseen or ())]


def _is(record: ModelData, name: str, value: float) -> bool:
    return name in record.conditions and abs(record.conditions[name] - value) <= MAX_CONDITION_DIFFERENCE * abs(value)


def _value(record: Record, name: str, spec: str | None) -> tuple[float | None, str]:
    """Return a parameter's value in a record, None where nothing says it, and what says it."""
    if spec is not None:
        try:
            return float(spec), "as said"
        except ValueError:
            return _constant(
                record, record.require(spec, f"{name} (a known condition)"), name, True
            ), f"column {spec!r}"
    key = record.find(name, further=False)
    value = None if key is None else _constant(record, key, name, False)
    if value is not None:
        return value, "a column of it"
    return record.fields.get(name), "its file says so"


def _constant(record: Record, key: str, name: str, asked: bool) -> float | None:
    """Return the value of a column that is the same all through; None, or refused if it was ``asked`` for, if not."""
    values = record.signals[key].values
    values = values[np.isfinite(values)]
    if values.size and np.ptp(values) == 0.0:
        return float(values[0])
    if not asked:
        return None
    reach = f"goes from {values.min():g} to {values.max():g}" if values.size else "holds no value"
    raise RecordError(f"{record.source}: {name}: the column {key!r} {reach}; a known condition is one number a record")


__all__ = ["apart", "conditions_of", "held_apart", "parameters_of"]
