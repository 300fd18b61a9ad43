"""MATLAB files up to version 7: vectors, matrices and structs of them, through scipy.io."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from signlin_ros.errors import RecordError

from .clean import Table
from .header import TIME_KEYS, Heading, clock
from .table import Rows, listing

Array = npt.NDArray[np.float64]


def read_table(path: Path, source: str, signals: Mapping[str, str]) -> Table:
    """Read the vectors that are as long as the time vector.

    A field of a struct is called ``data.speed``, and ``speed`` for short; the columns of a matrix ``q[0]``,
    ``q[1]``. What else there is (scalars, text, complex numbers, vectors of another length) is left out with a note.

    Raises
    ------
    RecordError
        Not a MAT file, version 7.3, no time vector.
    """
    found = dict(_variables(_load(path, source)))
    out = {name: why for name, why in ((name, _no_vector(value)) for name, value in found.items()) if why}
    vectors = {name: value.astype(np.float64) for name, value in found.items() if name not in out}
    headings = _headings(list(vectors))
    time = _time(headings, signals)
    if time is None or max(vectors[time.label].shape) != vectors[time.label].size:
        heads = "no time vector (t, time, timestamp or stamp)"
        raise RecordError(f"{source}: {heads}; {listing(found)}; map one with signals: {{t: NAME}}")
    length, columns = vectors[time.label].size, []
    for head in headings:
        parts = _columns(head, vectors[head.label], length)
        columns += parts
        if not parts:
            shape = "x".join(map(str, vectors[head.label].shape))
            out[head.label] = f"{shape}, the time has {length} values"
    rows = Rows(np.arange(1, length + 1))
    return Table(source, [head for head, _ in columns], [values for _, values in columns], rows, _notes(out))


def _notes(out: Mapping[str, str]) -> tuple[str, ...]:
    """Return what is said of the variables that are left out, those for the same reason together."""
    notes = []
    for why in dict.fromkeys(out.values()):
        names = [repr(name) for name, its in out.items() if its == why]
        notes.append(f"{', '.join(names)} {'is left out: it is' if len(names) == 1 else 'are left out: each is'} {why}")
    return tuple(notes)


def _load(path: Path, source: str) -> dict[str, Any]:
    from scipy.io import loadmat

    try:
        return dict(loadmat(str(path)))
    except NotImplementedError:
        advice = "save it in MATLAB with save(..., '-v7')"
        raise RecordError(f"{source}: MAT files of version 7.3 (HDF5) cannot be read; {advice}") from None
    except Exception as error:  # scipy raises nearly anything on a damaged file
        raise RecordError(f"{source}: not a readable MAT file ({error})") from error


def _variables(variables: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """All variables, structs opened."""
    for name, value in variables.items():
        if name.startswith("__"):
            continue
        if isinstance(value, np.ndarray) and value.dtype.names and value.size == 1:
            fields = {field: value.reshape(-1)[0][field] for field in value.dtype.names}
            yield from _variables(fields, f"{prefix}{name}.")
        else:
            yield prefix + name, value


def _no_vector(value: Any) -> str:
    """Why a variable is no real vector or matrix, or an empty text."""
    if not isinstance(value, np.ndarray) or value.dtype.kind not in "fiub":
        kind = value.dtype.kind if isinstance(value, np.ndarray) else ""
        return {"c": "complex", "U": "text", "S": "text"}.get(kind, "no array of numbers")
    if value.size < 2:
        return "one number" if value.size else "empty"
    return f"of {value.ndim} dimensions" if value.ndim > 2 else ""


def _headings(labels: list[str]) -> list[Heading]:
    """Short names for the fields of structs, where they are unique."""
    short = [label.rsplit(".", 1)[-1] for label in labels]
    count = Counter(short)
    return [Heading(label, name if count[name] == 1 else label) for label, name in zip(labels, short, strict=True)]


def _time(headings: list[Heading], signals: Mapping[str, str]) -> Heading | None:
    for key in signals.keys() & TIME_KEYS:
        return next((head for head in headings if head.matches(signals[key])), None)
    return clock(headings)


def _columns(head: Heading, values: Array, length: int) -> list[tuple[Heading, Array]]:
    """The (T,) columns of a vector or matrix; none if no side of it is as long as the time."""
    if values.size == length:
        return [(head, values.reshape(-1))]
    if values.ndim < 2 or length not in values.shape:
        return []
    table = values if values.shape[0] == length else values.T
    heads = [Heading(f"{head.label}[{i}]", f"{head.name}[{i}]") for i in range(table.shape[1])]
    return [(part, np.ascontiguousarray(table[:, i])) for i, part in enumerate(heads)]
