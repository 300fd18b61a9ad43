"""Large tables of plain numbers, alike from the first line to the last: read at once, no line looked at by itself.

The first and the last lines tell the layout; that all between are laid out alike the parser sees (pyarrow where it is
installed, else NumPy). Whatever it does not take is left to `signlin_ros.records.formats.csv`, which also says what
is wrong.
"""

from __future__ import annotations

import io
from dataclasses import dataclass
from importlib.util import find_spec
from typing import Any

import numpy as np
import numpy.typing as npt

from signlin_ros.errors import RecordError
from signlin_ros.records.formats.layout import Layout, layout
from signlin_ros.records.formats.long import is_long
from signlin_ros.records.table import Rows

Array = npt.NDArray[np.float64]

MIN_REGULAR_LENGTH = 4 << 20
"""Characters from which on a text is worth it."""
LAYOUT_LINES = 1000
"""So many lines at either end tell the layout."""
_MAX_INTEGER = 2.0**53


@dataclass(frozen=True)
class Regular:
    """The layout (its lines are those of both ends only), all columns (R,), and where the rows stood."""

    shape: Layout
    columns: list[Array]
    rows: Rows


def regular(text: str, source: str) -> Regular | None:
    """Return a large table of plain numbers; None where the text is none, or may be something else as well."""
    if len(text) < MIN_REGULAR_LENGTH or '"' in text:
        return None
    sample = _ends(text)
    shape = _layout(sample, source) if sample else None
    if shape is None or is_long(shape):
        return None
    first = int(shape.numbers[0])  # of the lines, from 1
    if not np.array_equal(shape.numbers, np.arange(first, sample.rstrip("\n").count("\n") + 2)) or first > LAYOUT_LINES:
        return None
    body = text[_start(text, first) :].rstrip("\n")
    columns = _parsed(body, shape.separator, len(shape.header))
    if columns is None or columns[0].size != body.count("\n") + 1:
        return None
    if any(np.nanmax(np.abs(column), initial=0.0) >= _MAX_INTEGER for column in columns):
        return None  # whole numbers that no double holds are read as integers
    count = columns[0].size
    return Regular(shape, columns, Rows(np.arange(1, count + 1), np.arange(first, first + count)))


def _ends(text: str) -> str:
    """Return the lines at both ends of a text; nothing where there are not more than those."""
    whole = text.rstrip("\n")
    low, high = 0, len(whole)
    for _ in range(LAYOUT_LINES):
        low = whole.find("\n", low) + 1
        high = whole.rfind("\n", 0, high)
        if low == 0 or high <= low:
            return ""
    return text[:low] + text[high + 1 :]


def _layout(sample: str, source: str) -> Layout | None:
    try:
        return layout(sample, source)
    except RecordError:
        return None


def _start(text: str, line: int) -> int:
    """Return where a line (from 1) begins."""
    at = 0
    for _ in range(line - 1):
        at = text.index("\n", at) + 1
    return at


def _parsed(body: str, separator: str, width: int) -> list[Array] | None:
    """Return the columns (R,) of a text of numbers and empty cells; None where it is none, or a row is empty."""
    if separator != " " and find_spec("pyarrow") is not None:
        return _by_pyarrow(body, separator, width)
    try:
        values = np.loadtxt(io.StringIO(body), np.float64, None, None if separator == " " else separator, ndmin=2)
    except ValueError:
        return None
    return [np.ascontiguousarray(column) for column in values.T] if values.shape[1] == width else None


def _by_pyarrow(body: str, separator: str, width: int) -> list[Array] | None:
    import pyarrow as pa
    from pyarrow import csv

    names = [str(i) for i in range(width)]
    types = dict.fromkeys(names, pa.float64())
    try:
        table = csv.read_csv(
            io.BytesIO(body.encode()),
            csv.ReadOptions(column_names=names),
            csv.ParseOptions(delimiter=separator, quote_char=False),
            csv.ConvertOptions(column_types=types, null_values=[""]),
        )
    except pa.ArrowInvalid:
        return None
    if all(column.null_count for column in table.columns):
        return None  # a row may hold nothing at all
    return [np.concatenate([_values(chunk) for chunk in column.chunks]) for column in table.columns]


def _values(chunk: Any) -> Array:
    """Return the values of an Arrow array of doubles, NaN where there is none; its own way imports pandas."""
    valid, data = chunk.buffers()
    part = slice(chunk.offset, chunk.offset + len(chunk))
    values = np.frombuffer(data, np.float64)[part]
    if not chunk.null_count:
        return values
    there = np.unpackbits(np.frombuffer(valid, np.uint8), bitorder="little")[part]
    return np.where(there, values, np.nan)


__all__ = ["Regular", "regular"]
