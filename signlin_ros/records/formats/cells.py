"""The cells of a line of text: taken apart, and what a single one holds."""

from __future__ import annotations

import csv
import re

from signlin_ros import units

csv.field_size_limit(1 << 30)  # a longer line is no fault of its own: its cells are counted as those of any other
TEXT_SEPARATORS = ("\t", ";", ",", "|", " ")
"""A blank stands for any run of white space."""
_SPREADSHEETS = "#n/a #na #nv #div/0! #value! #wert! #valeur! #valor! #valore! #ref! #bezug! #num! #zahl! #null! #name?"
_INSTRUMENTS = "∞ +∞ -∞ ol o.l. overload overflow overrange ovf"
EMPTY_CELLS = frozenset(
    {"", "nan", "na", "n/a", "null", "none", "-", "--", "?", "-nan", "nan(ind)", "-nan(ind)", "missing", "<na>", "nil"}
    | {*_SPREADSHEETS.split(), *_INSTRUMENTS.split()}
)
"""What a cell without a value holds, in small letters: the errors of spreadsheets and what instruments write beyond
their range, too."""
MEASURED = re.compile(r"([-+]?(?:\d+(?:[.,]\d*)?|[.,]\d+)(?:[eE][-+]?\d+)?)\s*([^\d\s.,+/-][^\s]*)")
"""A number and its unit in one cell: ``0.005 sec``, ``12.1V``; ``1/min`` is a unit alone."""
GROUPED = re.compile(r"[-+]?[1-9]\d{0,2}(?:(?:[.'\u00a0\u202f ]\d{3})+,\d+|(?:[,'\u00a0\u202f ]\d{3})+\.\d+)")
"""A number in groups of three digits, ``1.234,5`` and ``1'234.5``: its last mark is the decimal one. Without that a
mark may be either.
"""
_TIMELIKE = re.compile(
    r"(?:\d{1,4}[-/.]\d{1,2}[-/.]\d{1,4}[T /_,-]?)?\s*(?:\d+ days? )?"
    r"(?:\d{1,3}:(?:\d\d?:\d\d?|\d\d)(?:[.,;]\d*)?)?"
    r"\s*(?:[APap][Mm]|Z|[-+]\d\d:?\d\d)?"
)


def cells(line: str, separator: str) -> list[str]:
    """The cells of a line, stripped."""
    if separator == " " and '"' not in line:
        return line.split()
    row = next(csv.reader([line.strip() if separator == " " else line], delimiter=separator, skipinitialspace=True), [])
    return [cell.strip() for cell in row]


def is_number(cell: str) -> bool:
    """Whether a cell reads as a number, with a point or a comma."""
    try:
        float(cell.replace(",", "."))
    except ValueError:
        return bool(GROUPED.fullmatch(cell))
    return "_" not in cell


def is_value(cell: str) -> bool:
    """Whether a cell holds a number, a number with its unit, a date or a time of day."""
    if is_number(cell) or ((":" in cell or cell.count("-") == 2) and _TIMELIKE.fullmatch(cell)):
        return True
    match = MEASURED.fullmatch(cell)
    return match is not None and units.parse(match[2]) is not None


def opened(line: str, separator: str) -> int | None:
    """The cell, from 0, of a line that opens a quote and does not close it; None where there is none."""
    if line.count('"') % 2 == 0:
        return None
    found = re.search(rf'(?:^|{re.escape(separator)})\s*"', line)
    return None if found is None else line[: found.start() + 1].count(separator)


def shortened(text: str, most: int = 60) -> str:
    """A text, or its beginning with dots."""
    text = " ".join(text.split())
    return text if len(text) <= most else f"{text[: most - 4]} ..."


__all__ = [
    "EMPTY_CELLS",
    "GROUPED",
    "MEASURED",
    "TEXT_SEPARATORS",
    "cells",
    "is_number",
    "is_value",
    "opened",
    "shortened",
]
