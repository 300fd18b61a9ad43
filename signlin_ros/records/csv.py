"""CSV files: a header, then numbers. The numbers go through NumPy's C parser; Python looks at cells only to
find a bad one.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from signlin_ros.errors import RecordError

from .clean import Keep, Table
from .header import Heading, heading
from .table import Rows

Array = npt.NDArray[np.float64]

_SEPARATORS = ("\t", ";", ",")
_NUMBER = r"^[-+]?\d*{}\d+(?:[eE][-+]?\d+)?$"
_WITH_COMMA, _WITH_POINT = (re.compile(_NUMBER.format(mark), re.MULTILINE) for mark in (",", r"\."))
_THOUSANDS = re.compile(r"[-+]?[1-9]\d{0,2},\d{3}")
_MISSING = frozenset({"", "nan", "na", "n/a", "null", "none"})


@dataclass(frozen=True)
class _Text:
    """A file split up: header cells, the lines of data and their numbers in the file (from 1).

    ``commas``: the columns, from 0, with decimal commas; ``points``: whether any column has decimal points; ``plain``:
    the lines with points for commas, or as they are where a comma means something else.
    """

    source: str
    header: list[str]
    body: list[str]
    numbers: npt.NDArray[np.int64]
    separator: str
    plain: list[str]
    commas: frozenset[int] = frozenset()
    points: bool = False
    notes: tuple[str, ...] = ()

    @property
    def rows(self) -> Rows:
        return Rows(np.arange(1, len(self.body) + 1), self.numbers)


def read_table(path: Path, source: str, keep: Keep) -> Table:
    """Read the columns of a CSV file.

    Separator: comma, semicolon or tab (with these two, decimal commas are understood, column by column). Lines
    that start with ``#`` and blank lines are skipped. `keep` says what to do with a column that does not read:
    refuse the file (True), leave the column out if all of it is text (None), leave it out in any case (False).

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
    return _with_commas(_Text(source, header, body, numbers, separator, body, notes=notes))


def _with_commas(text: _Text) -> _Text:
    """Find the columns with decimal commas: numbers with a comma, none with a point.

    Where there are points in other columns, and every comma may mean thousands, none is one.
    """
    joined = "\n".join(text.body)
    if text.separator == "," or "," not in joined:
        return text
    rows = _rows(text)
    if any(len(row) != len(text.header) for row in rows):
        return text
    columns = ["\n".join(cells) for cells in zip(*rows, strict=True)]
    points = [bool(_WITH_POINT.search(column)) for column in columns]
    numbers = [[] if point else _WITH_COMMA.findall(column) for column, point in zip(columns, points, strict=True)]
    if any(points) and all(_THOUSANDS.fullmatch(number) for found in numbers for number in found):
        return replace(text, points=True)
    commas = frozenset(i for i, found in enumerate(numbers) if found)
    if any("," in column for i, column in enumerate(columns) if i not in commas):
        plain = text.body
    else:
        plain = joined.replace(",", ".").split("\n")
    notes = (*text.notes, "decimal commas read as points") if commas else text.notes
    return replace(text, commas=commas, points=any(points), plain=plain, notes=notes)


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
    body = text.plain
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
    rows = _rows(text)
    if len(rows) != len(text.body):
        raise RecordError(f"{text.source}: a quoted cell runs over the end of its line")
    _check_widths(text, rows)
    chosen, columns, notes = [], [], list(text.notes)
    for i, (head, cells) in enumerate(zip(headings, zip(*rows, strict=True), strict=True)):
        if not head.label and not any(cells):
            continue
        column = _column(text, i, cells, keep(head, headings))
        if column is None:
            notes.append(f"column {head.label!r} holds text and is left out")
            continue
        chosen.append(head)
        columns.append(column)
    return Table(text.source, chosen, columns, text.rows, tuple(notes))


def _rows(text: _Text) -> list[list[str]]:
    return [[cell.strip() for cell in row] for row in csv.reader(text.body, delimiter=text.separator)]


def _check_widths(text: _Text, rows: list[list[str]]) -> None:
    for i, row in enumerate(rows):
        if len(row) != len(text.header):
            raise RecordError(
                f"{text.source}: {text.rows.name(i)} has {len(row)} cells, the header {len(text.header)} columns"
            )


def _column(text: _Text, at: int, cells: tuple[str, ...], keep: bool | None) -> Array | None:
    """The numbers of column `at` (R,), None for a column of text. A missing sample is NaN."""
    comma = at in text.commas
    try:
        return np.array([float("nan") if cell.lower() in _MISSING else _number(cell, comma) for cell in cells])
    except ValueError:
        given = [(i, cell) for i, cell in enumerate(cells) if cell.lower() not in _MISSING]
    if keep is False or (keep is None and not any(_is_number(cell) for _, cell in given)):
        return None
    bad, cell = next((i, cell) for i, cell in given if not _reads(cell, comma))
    other = "comma" if comma and "." in cell else "point" if not comma and text.points and "," in cell else ""
    hint = f"; other numbers have a decimal {other}" if other else ""
    label = heading(text.header[at]).label
    raise RecordError(f"{text.source}: {text.rows.name(bad)}, column {label!r}: {cell!r} is not a number{hint}")


def _number(cell: str, comma: bool) -> float:
    if "_" in cell:
        raise ValueError(cell)
    return float(cell.replace(",", ".") if comma else cell)


def _reads(cell: str, comma: bool) -> bool:
    try:
        _number(cell, comma)
    except ValueError:
        return False
    return True
