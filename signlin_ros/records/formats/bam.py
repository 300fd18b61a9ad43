"""Logs of servos as Rhoban's BAM writes them: JSON with what was set (``kp``, ``mass`` ...) and a list of ``entries``.

Raw logs have jittered stamps, processed ones an even grid (``dt``).   [github.com/Rhoban/bam, bam/process.py]
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from signlin_ros.errors import RecordError
from signlin_ros.records.clean import RawTable
from signlin_ros.records.header import heading
from signlin_ros.records.notes import Note
from signlin_ros.records.table import Rows

Array = npt.NDArray[np.float64]

ENTRIES = {
    "timestamp": ("t", "s"),
    "position": ("position", "rad"),
    "speed": ("speed", "rad/s"),
    "goal_position": ("goal_position", "rad"),
    "input_volts": ("input_volts", "V"),
    "torque_enable": ("torque_enable", ""),
}
"""What entries hold, what it is called here, and its unit."""
SIGNED, WORD = 2**15, 2**16
"""From which on a number of 16 bits is negative, and what is taken off it then."""
ALLOWED = 'a log of BAM: {"kp": ..., "mass": ..., "entries": [{"timestamp": ..., "position": ...}, ...]}'


def read(path: Path, source: str) -> Any:
    """Return what a file of JSON holds; raise `RecordError` where it is none."""
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except (ValueError, UnicodeDecodeError) as error:
        raise RecordError(f"{source}: not a readable .json file ({error})") from error


def is_log(content: Any) -> bool:
    """Tell whether JSON is such a log: it has entries."""
    return isinstance(content, dict) and "entries" in content


def table_of(content: Any, source: str) -> RawTable:
    """Return a log as a table; raise `RecordError` where it is no such log."""
    entries = content.get("entries") if isinstance(content, dict) else None
    if not (isinstance(entries, list) and entries and all(isinstance(entry, dict) for entry in entries)):
        raise RecordError(f"{source}: found JSON without a list of entries; allowed: {ALLOWED}")
    names = dict.fromkeys(name for entry in entries for name in entry)
    notes: list[Note] = []
    headings, columns = [], []
    for number, name in enumerate(names, 1):
        column = _column(entries, name)
        if column is None:
            notes.append(Note(f"entry {name!r} holds no numbers and is left out", "left_out", name))
            continue
        plain, unit = ENTRIES.get(name, (name, ""))
        headings.append(heading(f"{plain} [{unit}]" if unit else plain, number))
        columns.append(_signed(name, column, notes))
    if not columns:
        raise RecordError(f"{source}: its entries hold no numbers; allowed: {ALLOWED}")
    rows = Rows(np.arange(1, len(entries) + 1))
    return RawTable(source, headings, columns, rows, tuple(notes), fields=_numbers(content))


def _numbers(content: Mapping[str, Any]) -> dict[str, float]:
    """Return the numbers that the log states of all of it."""
    found = {name: value for name, value in content.items() if isinstance(value, (int, float))}
    return {name: float(value) for name, value in found.items() if not isinstance(value, bool)}


def _column(entries: list[dict[str, Any]], name: str) -> Array | None:
    """Return one kind of entry (R,), NaN where it is missing; None where it is no number."""
    values = [entry.get(name) for entry in entries]
    if not all(value is None or isinstance(value, (bool, int, float)) for value in values):
        return None
    return np.array([np.nan if value is None else float(value) for value in values])


def _signed(name: str, column: Array, notes: list[Note]) -> Array:
    """Return a column with what was a negative number of 16 bits as that."""
    whole = bool(np.all(np.isfinite(column)) and np.all(column == np.round(column)))
    if not (whole and column.min() >= 0.0 and SIGNED <= column.max() < WORD):
        return column
    said = f"{name}: whole numbers up to {column.max():g} are signed ones of 16 bits: {WORD - 1} is read as -1"
    notes.append(Note(said, "decoded", name))
    return np.where(column >= SIGNED, column - WORD, column)


__all__ = ["is_log", "read", "table_of"]
