"""CSV files: a header, then numbers. The numbers go through NumPy's C parser; Python looks at cells only to
find a bad one.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from signlin_ros.errors import RecordError

from .clean import Keep, Table
from .header import Heading, heading
from .table import Rows

Array = npt.NDArray[np.float64]

_SEPARATORS = ("\t", ";", ",")
_MISSING = frozenset({"", "nan", "na", "n/a", "null", "none"})


@dataclass(frozen=True)
class _Text:
    """A file split up: header cells, the lines of data and their numbers in the file (from 1)."""

    source: str
    header: list[str]
    body: list[str]
    numbers: npt.NDArray[np.int64]
    separator: str
    notes: tuple[str, ...] = ()

    @property
    def rows(self) -> Rows:
        return Rows(np.arange(1, len(self.body) + 1), self.numbers)


def read_table(path: Path, source: str, keep: Keep) -> Table:
    """Read the columns of a CSV file.

    Separator: comma, semicolon (then decimal commas are understood) or tab. Lines that start with ``#`` and
    blank lines are skipped. `keep` says what to do with a column that does not read: refuse the file (True),
    leave the column out if all of it is text (None), leave it out in any case (False).

    Raises
    ------
    RecordError
        Empty, no header, no rows, ragged rows, a cell that is not a number: with row, line and column named.
    """
    text = _split(_decoded(path, source), source)
    headings = [heading(cell) for cell in text.header]
    values = _fast(text)
    if values is None:
        return _careful(text, headings, keep)
    chosen = [i for i, head in enumerate(headings) if head.label or not np.isnan(values[:, i]).all()]
    columns = [np.ascontiguousarray(values[:, i]) for i in chosen]
    return Table(source, [headings[i] for i in chosen], columns, text.rows, text.notes)


def _decoded(path: Path, source: str) -> str:
    raw = path.read_bytes()
    if raw.startswith((b"\xff\xfe", b"\xfe\xff")):
        text = raw.decode("utf-16", errors="replace")
    else:
        try:
            text = raw.decode("utf-8-sig")
        except UnicodeDecodeError:
            text = raw.decode("cp1252", errors="replace")
    if "\0" in text:
        raise RecordError(f"{source}: this is no text file")
    if "\r" in text:
        text = text.replace("\r\n", "\n").replace("\r", "\n")
    return text


def _split(text: str, source: str) -> _Text:
    lines = text.split("\n")
    count = len(lines)
    while count and not lines[count - 1].strip():
        count -= 1
    if not count:
        raise RecordError(f"{source}: the file is empty")
    del lines[count:]
    head = next((i for i, line in enumerate(lines) if not _skipped(line)), None)
    if head is None:
        raise RecordError(f"{source}: nothing but comments: no header and no rows")
    body, numbers = _without_comments(lines, head + 1)
    separator = _separator(lines[head], body[0] if body else "")
    header = _cells(lines[head], separator)
    notes: tuple[str, ...] = ()
    if all(_is_number(cell) for cell in header):
        header, notes = _header_in_comment(lines[:head], len(header), separator, source)
        body, numbers = _without_comments(lines, head)
    body, numbers = _without_empty(body, numbers, separator)
    if not body:
        raise RecordError(f"{source}: a header but no rows of data")
    if len(header) < 2:
        raise RecordError(
            f"{source}: the header has one column, {header[0]!r}; separate columns by comma, semicolon or tab"
        )
    if separator != "," and _decimal_commas(body, separator):
        body = "\n".join(body).replace(",", ".").split("\n")
        notes = (*notes, "decimal commas read as points")
    return _Text(source, header, body, numbers, separator, notes)


def _decimal_commas(body: list[str], separator: str) -> bool:
    """Whether numbers are written with commas, anywhere, and none with a point: then a comma may mean thousands."""
    text = "\n".join(body)
    edge, number = rf"[{separator}\n]", r'[ "]*[-+]?\d*{}\d+(?:[eE][-+]?\d+)?[ "]*'
    with_comma, with_point = (
        re.compile(rf"(?:\A|(?<={edge})){number.format(mark)}(?={edge}|\Z)") for mark in (",", r"\.")
    )
    return "," in text and bool(with_comma.search(text)) and not with_point.search(text)


def _skipped(line: str) -> bool:
    start = line.lstrip()
    return not start or start.startswith("#")


def _without_comments(lines: list[str], start: int) -> tuple[list[str], npt.NDArray[np.int64]]:
    """The lines of data from `start` on, with their numbers in the file; what follows a ``#`` is cut off."""
    body = lines[start:]
    if all(body) and not any("#" in line for line in body):
        return body, np.arange(start + 1, len(lines) + 1)
    kept = [i for i in range(start, len(lines)) if not _skipped(lines[i])]
    return [lines[i].split("#", 1)[0] for i in kept], np.array(kept, dtype=np.int64) + 1


def _without_empty(
    body: list[str], numbers: npt.NDArray[np.int64], separator: str
) -> tuple[list[str], npt.NDArray[np.int64]]:
    """The lines that hold anything but separators: spreadsheets leave such lines at the end."""
    blank = f"{separator} "
    kept = [i for i, line in enumerate(body) if line.strip(blank)]
    return (body, numbers) if len(kept) == len(body) else ([body[i] for i in kept], numbers[kept])


def _separator(header: str, row: str) -> str:
    """The separator that gives the header and the first row equally many cells, more than one."""
    counts = {mark: (len(_cells(header, mark)), len(_cells(row, mark))) for mark in _SEPARATORS}
    for mark, (above, below) in counts.items():
        if above == below > 1:
            return mark
    return max(reversed(_SEPARATORS), key=lambda mark: counts[mark][0])


def _cells(line: str, separator: str) -> list[str]:
    row = next(csv.reader([line], delimiter=separator, skipinitialspace=True), [])
    return [cell.strip() for cell in row]


def _is_number(cell: str) -> bool:
    try:
        float(cell.replace(",", "."))
    except ValueError:
        return False
    return True


def _header_in_comment(
    comments: Sequence[str], width: int, separator: str, source: str
) -> tuple[list[str], tuple[str, ...]]:
    """The header of a file whose first row is numbers: the last comment before it (numpy.savetxt writes it
    there).
    """
    for line in reversed(comments):
        cells = _cells(line.lstrip().lstrip("#"), separator)
        if len(cells) == width and width > 1 and not any(_is_number(cell) for cell in cells):
            return cells, ("the header was found in a comment",)
    raise RecordError(
        f"{source}: no header: the first row holds numbers; it must name the columns, e.g. t,voltage,speed"
    )


def _fast(text: _Text) -> Array | None:
    """All cells at once, (R, C); None if any cell is not a plain number or any row has another length."""
    body = text.body
    for filled in (False, True):
        lines = _filled(body, text.separator) if filled else body
        try:
            values = np.loadtxt(lines, np.float64, None, text.separator, quotechar='"', ndmin=2)
        except ValueError:
            continue
        if values.shape == (len(body), len(text.header)):
            return values
    return None


def _filled(body: list[str], separator: str) -> list[str]:
    """The lines with ``nan`` in empty cells."""
    joined = "\n" + "\n".join(body) + "\n"
    for _ in range(2):
        joined = joined.replace(2 * separator, f"{separator}nan{separator}")
    joined = joined.replace(f"\n{separator}", f"\nnan{separator}").replace(f"{separator}\n", f"{separator}nan\n")
    return joined[1:-1].split("\n")


def _careful(text: _Text, headings: list[Heading], keep: Keep) -> Table:
    """Cell by cell: understands quotes and marks of missing samples, leaves text columns out, names the first
    bad cell.
    """
    rows = [[cell.strip() for cell in row] for row in csv.reader(text.body, delimiter=text.separator)]
    if len(rows) != len(text.body):
        raise RecordError(f"{text.source}: a quoted cell runs over the end of its line")
    _check_widths(text, rows)
    chosen, columns, notes = [], [], list(text.notes)
    for head, cells in zip(headings, zip(*rows, strict=True), strict=True):
        if not head.label and not any(cells):
            continue
        column = _column(text, head, cells, keep(head, headings))
        if column is None:
            notes.append(f"column {head.label!r} holds text and is left out")
            continue
        chosen.append(head)
        columns.append(column)
    return Table(text.source, chosen, columns, text.rows, tuple(notes))


def _check_widths(text: _Text, rows: list[list[str]]) -> None:
    for i, row in enumerate(rows):
        if len(row) != len(text.header):
            raise RecordError(
                f"{text.source}: {text.rows.name(i)} has {len(row)} cells, the header {len(text.header)} columns"
            )


def _column(text: _Text, head: Heading, cells: tuple[str, ...], keep: bool | None) -> Array | None:
    """The numbers of a column (R,), None for a column of text. A missing sample is NaN."""
    try:
        return np.array([float("nan") if cell.lower() in _MISSING else _number(cell) for cell in cells])
    except ValueError:
        given = [(i, cell) for i, cell in enumerate(cells) if cell.lower() not in _MISSING]
    if keep is False or (keep is None and not any(_is_number(cell) for _, cell in given)):
        return None
    bad, cell = next((i, cell) for i, cell in given if not _is_number(cell) or "_" in cell or "," in cell)
    hint = "; other numbers have a decimal point" if "," in cell and text.separator != "," else ""
    raise RecordError(f"{text.source}: {text.rows.name(bad)}, column {head.label!r}: {cell!r} is not a number{hint}")


def _number(cell: str) -> float:
    if "_" in cell:
        raise ValueError(cell)
    return float(cell)
