"""JSON that is no log of a servo: columns as lists, ``{"t": [...], "motor": {"u": [...]}}``, or rows as objects,
``[{"t": 0.0, "motor": {"u": 1.2}}, ...]``, at any depth; or lists of rows without names, ``{"forward": [[0.0, 1.2]]}``,
each a run of its own.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from signlin_ros.records.clean import RawTable
from signlin_ros.records.header import heading
from signlin_ros.records.notes import Note
from signlin_ros.records.table import Rows


def arrays(content: Any) -> dict[str, Any]:
    """Return what is in it as named arrays, objects as mappings; what holds no numbers as text."""
    found = _value(content)
    return dict(found) if isinstance(found, Mapping) else {"data": found}


def rows_without_names(content: Any, source: str) -> RawTable | None:
    """Return lists of rows of equally many numbers, the first of which rises, as a table of columns ``c1``, ``c2``, a
    run for each list; None where there are none, or lists of another kind.
    """
    lists = content if isinstance(content, Mapping) else {"data": content}
    found = {str(name): _value(rows) for name, rows in lists.items() if isinstance(rows, list) and rows}
    if not found or any(isinstance(a, Mapping) or a.ndim != 2 or a.dtype.kind != "f" for a in found.values()):
        return None
    widths = {array.shape[1] for array in found.values()}
    if len(widths) > 1 or min(widths) < 2 or not all((np.diff(array[:, 0]) > 0).all() for array in found.values()):
        return None
    table = np.concatenate(list(found.values()))
    starts = np.cumsum([len(array) for array in found.values()])[:-1].tolist()
    called = f"rows of numbers without names: the columns are called c1 to c{table.shape[1]}"
    runs = f"; a run for each of {', '.join(found)}" if starts else ""
    heads = [heading(f"c{k + 1}", k + 1) for k in range(table.shape[1])]
    rows = Rows(np.arange(1, len(table) + 1))
    columns = list(np.ascontiguousarray(table.T))
    return RawTable(source, heads, columns, rows, (Note(called + runs, "format"),), named=False, runs=tuple(starts))


def _value(content: Any) -> Any:
    if isinstance(content, Mapping):
        return {str(name): _value(value) for name, value in content.items()}
    if isinstance(content, list) and content and all(isinstance(row, dict) for row in content):
        return _rows(content)
    try:
        values = np.array(content, dtype=np.float64) if not isinstance(content, str) else np.array(["text"])
    except (TypeError, ValueError):
        return np.array(["text"])
    return values if values.ndim else values.reshape(1)


def _rows(content: list[dict[str, Any]]) -> dict[str, npt.NDArray[np.float64]]:
    """Return the numbers of objects (R,) by their names, NaN where one has none."""
    rows = [dict(leaves(row)) for row in content]
    names = dict.fromkeys(name for row in rows for name in row)
    return {name: np.array([row.get(name, np.nan) for row in rows], dtype=np.float64) for name in names}


def leaves(value: Any, name: str = "") -> Iterator[tuple[str, float]]:
    """Yield the numbers of what JSON holds: ``motor.u`` of an object in another one, ``q[0]`` of a list."""
    if isinstance(value, dict):
        for key, one in value.items():
            yield from leaves(one, f"{name}.{key}" if name else str(key))
    elif isinstance(value, list):
        for k, one in enumerate(value):
            yield from leaves(one, f"{name}[{k}]")
    elif isinstance(value, (int, float)) and not isinstance(value, bool):
        yield name, float(value)


__all__ = ["arrays", "leaves", "rows_without_names"]
