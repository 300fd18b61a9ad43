"""A long table, with a row for every joint at every stamp: each quantity of a joint gets a column of its own."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from signlin_ros.records.formats.cells import EMPTY_CELLS, is_number, is_value
from signlin_ros.records.formats.labels import header_cell
from signlin_ros.records.formats.layout import Layout
from signlin_ros.records.formats.stamps import times_of_day
from signlin_ros.records.header import Heading, clock, heading, names_a_time
from signlin_ros.records.notes import Note

Cells = NDArray[np.str_]

MAX_JOINTS = 64
"""Rows that share a stamp at most."""
NAMES = ["topic", "name", "signal", "channel", "variable", "tag", "key", "field", "varname", "sensor", "metric", "path"]
VALUES = ("value", "val", "varvalue", "data", "reading")
"""What the columns of names and of values are called in a table that has both."""
GROUPS_LOOKED = 4
"""Stamps whose rows tell whether a table may be long."""
VALUE = ("value", "values", "val", "_value", "data", "reading", "wert", "messwert")
"""What the column of numbers is called where names alone say what they are of."""


def widened(shape: Layout, asked: Sequence[str] = ()) -> Layout:
    """Return a table with one row for each stamp where every stamp has a row for each of the same names or numbers,
    ``joint`` 1 and 2 in turn; its columns are ``joint1.torque``, ``joint2.torque``, of a table of names and values the
    names; others as they are.
    """
    shape = _interleaved(shape)
    place = _rows_at_a_stamp(shape)
    if place is None:
        return _by_names(shape, asked)
    at, count = place
    rows = _rows(shape, len(shape.body))
    names = None if rows is None else _names_of(rows, at, count)
    if rows is None or names is None:
        return shape
    column, values = names
    groups = rows[: len(rows) // count * count].reshape(-1, count, rows.shape[1])
    order = np.argsort(groups[:, :, column], axis=1)
    groups = np.take_along_axis(groups, order[:, :, None], axis=1)
    label = heading(shape.header[column]).name
    called = [f"{label}{value}" if is_number(value) else value for value in values]
    others = [k for k in range(rows.shape[1]) if k not in (at, column) and shape.header[k]]
    alone = [shape.header[k].strip().lower() in VALUE for k in others] == [True] and not is_number(values[0])
    header = [shape.header[at], *(name if alone else f"{name}.{shape.header[k]}" for name in called for k in others)]
    wide = np.concatenate([groups[:, :1, at], groups[:, :, others].reshape(len(groups), -1)], axis=1)
    lines = [shape.separator.join(map(header_cell, row)) for row in wide.tolist()]
    said = f"each time has a row for every {label!r}: columns are called {header[1]} and so on"
    numbers = shape.numbers[: len(groups) * count : count]
    return replace(shape, header=header, body=lines, numbers=numbers, notes=(*shape.notes, Note(said, "format")))


def is_long(shape: Layout) -> bool:
    """Tell whether the first rows of a table are those of a long one."""
    return _rows_at_a_stamp(_interleaved(shape)) is not None or _named_values(shape) is not None


def _named_values(shape: Layout) -> tuple[int, int, int] | None:
    """Return the columns of the time, of names and of their values in a table that says so, ``time,topic,value``."""
    heads = [heading(label, i + 1) for i, label in enumerate(shape.header)]
    names = [i for i, head in enumerate(heads) if head.name.lower().strip("_") in NAMES]
    values = [i for i, head in enumerate(heads) if head.name.lower().strip("_") in VALUES]
    timed = clock(heads) or next((head for head in heads if names_a_time(head.name)), None)
    ok = shape.named and shape.separator != " " and not shape.runs and timed and len(names) == 1 and len(values) == 1
    return (timed.number - 1, names[0], values[0]) if ok and timed is not None else None


def _by_names(shape: Layout, asked: Sequence[str]) -> Layout:
    """Return a table with a column for each of the names in a table of times, names and values, empty where it has none
    at a time; of too many names those that are ``asked`` for, and the most frequent. Others as they are.
    """
    place = _named_values(shape)
    rows = _rows(shape, len(shape.body)) if place is not None else None
    if place is None or rows is None:
        return shape
    stamps, names, values = (rows[:, k] for k in place)
    called, begins, which, counts = np.unique(names, return_index=True, return_inverse=True, return_counts=True)
    if called.size < 2 or any(map(is_number, called)):
        return shape
    wanted = np.array([any(name in spec for spec in asked) for name in called.tolist()])
    words = np.array([not is_value(one) and one.lower() not in EMPTY_CELLS for one in values[begins].tolist()])
    numbers = np.flatnonzero(wanted | ~words)
    best = np.sort(numbers[np.lexsort((-counts[numbers], ~wanted[numbers]))[:MAX_JOINTS]])
    left = called.size - best.size
    if not best.size:
        return shape
    if left:
        kept = np.isin(which, best)
        rows, stamps, values, which = rows[kept], stamps[kept], values[kept], np.searchsorted(best, which[kept])
        called, shape = called[best], replace(shape, numbers=shape.numbers[kept])
    counted = all(map(is_number, stamps))
    dated = None if counted else times_of_day(stamps.tolist())
    if not counted and dated is None:
        return shape
    t = np.char.replace(stamps, ",", ".").astype(np.float64) if dated is None else dated.seconds
    order = np.argsort(t, kind="stable") if _rise_by_name(t, which) else np.arange(t.size)
    stamps, which, values = stamps[order], which[order], values[order]
    row = np.concatenate([[0], np.cumsum(stamps[1:] != stamps[:-1])])
    wide = np.full((int(row[-1]) + 1, called.size), "", dtype=values.dtype)
    wide[row, which] = values
    first = np.concatenate([[True], stamps[1:] != stamps[:-1]])
    told = shape.header[place[2]]
    header = [shape.header[place[0]], *(f"{name}.{told}" for name in called)]
    lines = [shape.separator.join(map(header_cell, cells)) for cells in np.column_stack([stamps[first], wide]).tolist()]
    said = f"each row names its value: columns are called {called[0]}.{told} and so on"
    said += f"; {left} others, of words or more seldom, are left out" if left else ""
    places = shape.numbers[order][first]
    return replace(shape, header=header, body=lines, numbers=places, notes=(*shape.notes, Note(said, "format")))


def _rise_by_name(t: NDArray[np.float64], which: NDArray[np.intp]) -> bool:
    """Whether the times (R,) of no name (R,) go back, as where a log begins anew: then rows are in blocks by name."""
    order = np.argsort(which, kind="stable")
    return not bool(((np.diff(t[order]) < 0.0) & (np.diff(which[order]) == 0)).any())


def _interleaved(shape: Layout) -> Layout:
    """Return a table that holds one block of rows for each of some names, all of the same stamps (a database's answer,
    a field after the other), with the rows of each stamp together; others as they are.
    """
    timed = clock([heading(label, i + 1) for i, label in enumerate(shape.header)])
    if timed is None or not shape.named or shape.separator == " " or shape.runs or len(shape.body) < 2 * GROUPS_LOOKED:
        return shape
    ends = _rows(replace(shape, body=[shape.body[0], shape.body[-1]]), 2)
    if ends is None or not any(
        a != b and not is_number(a) for a, b in zip(*ends[:, _others(ends, timed)], strict=True)
    ):
        return shape
    rows, at = _rows(shape, len(shape.body)), timed.number - 1
    if rows is None:
        return shape
    for column in range(len(shape.header)):
        values = rows[:, column]
        starts = np.concatenate([[0], np.flatnonzero(values[1:] != values[:-1]) + 1])
        size, count = len(rows) // starts.size, starts.size
        if column == at or is_number(values[0]) or not 1 < count <= MAX_JOINTS or size * count != len(rows):
            continue
        stamps = rows[:, at].reshape(count, size)
        if np.array_equal(starts, np.arange(count) * size) and np.all(stamps == stamps[0]):
            order = np.arange(len(rows)).reshape(count, size).T.ravel()
            return replace(shape, body=[shape.body[i] for i in order], numbers=shape.numbers[order])
    return shape


def _others(rows: Cells, timed: Heading) -> list[int]:
    return [k for k in range(rows.shape[1]) if k != timed.number - 1]


def _rows_at_a_stamp(shape: Layout) -> tuple[int, int] | None:
    """Return the column of the time, and how many rows share a stamp, as the first show; None of another table."""
    timed = clock([heading(label, i + 1) for i, label in enumerate(shape.header)])
    if timed is None or not shape.named or shape.separator == " " or shape.runs:
        return None
    at, first = timed.number - 1, _rows(shape, MAX_JOINTS * GROUPS_LOOKED)
    count = 0 if first is None else int(np.argmax(first[:, at] != first[0, at]))
    return (at, count) if first is not None and count > 1 and _names_of(first, at, count) is not None else None


def _rows(shape: Layout, most: int) -> Cells | None:
    """Return the cells (R, C) of the first rows; None where a row has another number of them."""
    try:
        rows = [[cell.strip() for cell in row] for row in csv.reader(shape.body[:most], delimiter=shape.separator)]
    except csv.Error:
        return None
    even = rows and all(len(row) == len(shape.header) for row in rows) and len(shape.header) > 2
    return np.array(rows) if even else None


def _names_of(rows: Cells, at: int, count: int) -> tuple[int, list[str]] | None:
    """Return the column that tells the rows of a stamp apart, and its values; None where none does in every stamp."""
    groups = rows[: len(rows) // count * count].reshape(-1, count, rows.shape[1])
    if len(groups) < GROUPS_LOOKED or np.any(groups[:, :, at] != groups[:, :1, at]):
        return None
    if np.any(groups[1:, 0, at] == groups[:-1, 0, at]):
        return None
    for column in sorted(range(rows.shape[1]), key=lambda k: is_number(rows[0, k])):  # names before numbers
        values = np.sort(groups[:, :, column], axis=1)
        distinct = np.unique(values[0]).size == count and np.all(values == values[0])
        whole = all(not is_number(value) or value.lstrip("+-").isdigit() for value in values[0])
        if column != at and distinct and whole:
            return column, values[0].tolist()
    return None


__all__ = ["is_long", "widened"]
