"""Where the sign of an input stands that never changes its own: another column of the same file."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping

import numpy as np

from signlin_ros.checks.run import check
from signlin_ros.checks.unsigned_input import UnsignedInput
from signlin_ros.errors import InputError
from signlin_ros.model import Model
from signlin_ros.records import Note, Record, read_for_model, read_record

_IDENTIFIER = re.compile(r"[^\W\d]\w*\Z")


def with_direction(
    model: Model, path: str | os.PathLike[str], signals: Mapping[str, str], name: str
) -> dict[str, str] | None:
    """Return the mapping that gives an input the sign of another column, such as ``{"voltage": "sign(dir) * pwm"}``.

    Every column of two values, and of text, is tried, both ways round: the first with which nothing about the input is
    found that must be decided. None where there is no such column.
    """
    base = signals.get(name) or model.signals.get(name) or name
    for label in _two_valued(read_record(path, wanted=())):
        column = label if _IDENTIFIER.match(label) else f'"{label}"'
        for sign in ("", "-"):
            spec = f"{sign}sign({column}) * {base}"
            if _fits(model, path, {**signals, name: spec}, name):
                return {name: spec}
    return None


def _two_valued(record: Record) -> Iterator[str]:
    """Yield the labels of the columns that may hold a direction: text, and what has two values."""
    for note in record.notes:
        if isinstance(note, Note) and note.kind == "left_out" and note.channel:
            yield note.channel
    for key, label in record.labels.items():
        values = record.signals[key].values
        if np.unique(values[np.isfinite(values)]).size == 2:
            yield label


def _fits(model: Model, path: str | os.PathLike[str], signals: Mapping[str, str], name: str) -> bool:
    """Tell whether the check asks nothing more about an input."""
    try:
        _, findings = check(model, [read_for_model(path, model, signals)])
    except InputError:  # text that is no direction
        return False
    return not any(f.check == UnsignedInput.name or (f.doubtful and name in f.about) for f in findings)


__all__ = ["with_direction"]
