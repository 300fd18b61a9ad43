"""Text files: names, then numbers. The numbers go through NumPy's C parser; Python looks at cells only where one is
no plain number.
"""

from __future__ import annotations

import bz2
import csv
import gzip
import lzma
import re
import zipfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from signlin_ros import units
from signlin_ros.errors import RecordError
from signlin_ros.files import TEXT
from signlin_ros.records import limits
from signlin_ros.records.clean import Keep, RawTable
from signlin_ros.records.formats.cells import EMPTY_CELLS, GROUPED, MEASURED, is_number, is_value, opened, shortened
from signlin_ros.records.formats.echo import joint_states, messages
from signlin_ros.records.formats.encodings import decoded
from signlin_ros.records.formats.layout import Layout, by_number, labelled, layout
from signlin_ros.records.formats.loggers import plain, raw_frames
from signlin_ros.records.formats.long import widened
from signlin_ros.records.formats.regular import regular
from signlin_ros.records.formats.stamps import directions, times_of_day
from signlin_ros.records.header import Heading, clock, heading
from signlin_ros.records.notes import Note
from signlin_ros.records.table import Rows

Array = npt.NDArray[np.float64]

UNPACKERS: dict[str, Callable[[Path], Any]] = {".gz": gzip.open, ".bz2": bz2.open, ".xz": lzma.open}
"""What unpacks a file, by its suffix."""
MOST_NAMED = 3
"""So many files of an archive are named."""
_NUMBER_PATTERN = r"^[-+]?\d*{}\d+(?:[eE][-+]?\d+)?$"
_WITH_COMMA, _WITH_POINT = (re.compile(_NUMBER_PATTERN.format(mark), re.MULTILINE) for mark in (",", r"\."))
_THOUSANDS = re.compile(r"[-+]?[1-9]\d{0,2},\d{3}")
_FORTRAN, EXPONENTS_LOOKED = re.compile(r"(?<=\d)[dD](?=[-+]\d{1,3}\b)"), 4000
"""Exponents as Fortran writes them, ``1.5D-03``; so many characters tell."""
_MINUS = re.compile("\u2212(?=[\\d.,])")
"""The sign that typesetting takes for a minus."""
_BROKEN, HEADER_LOOKED = re.compile(r'(?:(?<=[,;\t\n])|\A)"[^"\n]{0,60}(?:\n[^"\n]{0,60}){1,3}"(?=[,;\t\n])'), 4000
"""Names in quotes over several lines, as spreadsheets have them; so many characters hold them."""
_HEX = re.compile(r"(?<![^\s,;|\"])0[xX]([0-9a-fA-F]{1,8})(?![^\s,;|\"])")
"""A cell that is a whole number of base 16."""
_MAX_WHOLE = 2.0**53
"""Whole numbers beyond this are no doubles: they are read as integers, and counted from the first."""


@dataclass(frozen=True)
class _Text:
    """A table of text.

    ``commas``: the columns, from 0, with decimal commas; ``points``: whether any column has decimal points; ``plain``:
    the lines with points for commas, or as they are where a comma means something else.
    """

    shape: Layout
    plain: list[str]
    commas: frozenset[int] = frozenset()
    points: bool = False
    notes: tuple[Note, ...] = ()

    @property
    def rows(self) -> Rows:
        return Rows(np.arange(1, len(self.shape.body) + 1), self.shape.numbers)


def read_table(path: Path, source: str, keep: Keep, asked: Sequence[str] = ()) -> RawTable:
    """Read the columns of a CSV file.

    Separator: comma, semicolon, tab or blanks (with all but the first, decimal commas are understood, column by
    column). Lines that start with ``#``, ``%`` or ``//`` and blank lines are skipped; see
    `signlin_ros.records.formats.layout` for what may stand before the table. `keep` says what to do with a column that
    does not read: refuse the file (True), leave the column out if all of it is text (None), leave it out in any case
    (False).
    `asked`: the columns that matter, as they are called; by their numbers they are there below a broken header too.

    Raises
    ------
    RecordError
        Empty, no rows, ragged rows, a cell that is not a number: with row, line and column named.
    """
    letters, notes = decoded(_unpacked(path, source), source, asked)
    if raw_frames(letters):
        raise RecordError(
            f"{source}: frames of a CAN bus, not decoded: {shortened(letters.split(chr(10), 1)[0])!r}; decode them "
            "first with the bus's database (cantools, SavvyCAN, asammdf), into a table with a column for the time and "
            "one for each signal"
        )
    told = plain(letters) or joint_states(letters, asked) or messages(letters)
    if told is not None:
        letters, notes = told[0], (*notes, told[1])
    letters = _MINUS.sub("-", letters) if "\u2212" in letters else letters
    letters = _BROKEN.sub(lambda cell: " ".join(cell[0].split()), letters[:HEADER_LOOKED]) + letters[HEADER_LOOKED:]
    if _FORTRAN.search(letters[:EXPONENTS_LOOKED]):
        letters = _FORTRAN.sub("e", letters)
    if _HEX.search(letters[:EXPONENTS_LOOKED]):
        letters = _HEX.sub(lambda match: str(int(match[1], 16)), letters)
        signed = "numbers of base 16 are read without a sign; int16(COLUMN) in a formula reads one"
        notes = (*notes, Note(signed, "format"))
    limits.check_cells(letters, source)
    found = regular(letters, source)
    if found is not None:
        shape, columns, rows = found.shape, found.columns, found.rows
        headings = [heading(cell, i + 1) for i, cell in enumerate(labelled(shape))]
        chosen = _told(headings, columns)
        said = (*notes, *shape.notes)
        return RawTable(source, [headings[i] for i in chosen], [columns[i] for i in chosen], rows, said, shape.named)
    shape = by_number(widened(layout(letters, source), asked), asked)
    if '"' in letters:
        _check_quotes(shape)
    text = _with_commas(_Text(replace(shape, notes=(*notes, *shape.notes)), shape.body))
    headings = [heading(cell, i + 1) for i, cell in enumerate(labelled(shape))]
    values = _fast(text)
    if values is None:
        table = _careful(text, headings, keep)
    else:
        columns = [np.ascontiguousarray(column) for column in values.T]
        chosen = _told(headings, columns)
        said = (*text.shape.notes, *text.notes)
        table = RawTable(source, [headings[i] for i in chosen], [columns[i] for i in chosen], text.rows, said)
    exact = _exact(text, table.headings, table.columns)
    return replace(table, named=shape.named, runs=shape.runs, exact=exact)


def _told(headings: Sequence[Heading], columns: Sequence[Array]) -> list[int]:
    """The columns that have a name or a value."""
    pairs = enumerate(zip(headings, columns, strict=True))
    return [i for i, (head, column) in pairs if head.label or not np.isnan(column).all()]


def _unpacked(path: Path, source: str) -> bytes:
    """The bytes of a file, or of what is packed in it."""
    suffix = path.suffix.lower()
    try:
        if suffix == ".zip":
            return _from_zip(path, source)
        if suffix not in UNPACKERS:
            return path.read_bytes()
        with UNPACKERS[suffix](path) as stream:
            return limits.unpacked(stream, path.stat().st_size, source)
    except RecordError:
        raise
    except (EOFError, zipfile.BadZipFile, lzma.LZMAError, gzip.BadGzipFile, ValueError, RuntimeError) as error:
        raise RecordError(f"{source}: cannot be unpacked: {error}") from error


def _from_zip(path: Path, source: str) -> bytes:
    with zipfile.ZipFile(path) as archive:
        limits.check_names(archive.namelist(), source)
        names = [n for n in archive.namelist() if not n.endswith("/") and not n.startswith("__MACOSX")]
        texts = [n for n in names if Path(n).suffix.lower() in TEXT]
        if len(texts) != 1:
            shown = shortened(", ".join(map(shortened, names[:MOST_NAMED])) or "nothing", 100)
            more = f" and {len(names) - MOST_NAMED} more" if len(names) > MOST_NAMED else ""
            raise RecordError(f"{source}: an archive must hold one text file; it has {shown}{more}")
        with archive.open(texts[0]) as stream:
            return limits.unpacked(stream, path.stat().st_size, source)


def _with_commas(text: _Text) -> _Text:
    """Find the columns with decimal commas: numbers with a comma, none with a point.

    Where there are points in other columns, and every comma may mean thousands, none is one.
    """
    joined = "\n".join(text.shape.body)
    if "," not in joined or (text.shape.separator == "," and '"' not in joined):
        return text
    rows = _rows(text.shape)
    if any(len(row) != len(text.shape.header) for row in rows):
        return text
    columns = ["\n".join(cells) for cells in zip(*rows, strict=True)]
    points = [bool(_WITH_POINT.search(column)) for column in columns]
    numbers = [[] if point else _WITH_COMMA.findall(column) for column, point in zip(columns, points, strict=True)]
    if any(points) and all(_THOUSANDS.fullmatch(number) for found in numbers for number in found):
        return replace(text, points=True)
    commas = frozenset(i for i, found in enumerate(numbers) if found)
    if text.shape.separator == "," or any("," in column for i, column in enumerate(columns) if i not in commas):
        plain = text.shape.body
    else:
        plain = joined.replace(",", ".").split("\n")
    notes = (*text.notes, Note("decimal commas read as points", "format")) if commas else text.notes
    return replace(text, commas=commas, points=any(points), plain=plain, notes=notes)


def _fast(text: _Text) -> Array | None:
    """All cells at once, (R, C); None if any cell is not a plain number or any row has another length."""
    separator = text.shape.separator
    for filled in (False, True):
        lines = _filled(text.plain, separator) if filled else text.plain
        try:
            mark = None if separator == " " else separator
            values = np.loadtxt(lines, np.float64, None, mark, quotechar='"', ndmin=2)
        except ValueError:
            continue
        if values.shape == (len(text.plain), len(text.shape.header)):
            return values
    return None


def _filled(body: list[str], separator: str) -> list[str]:
    """The lines with ``nan`` in empty cells."""
    if separator == " ":
        return body
    joined = "\n" + "\n".join(body) + "\n"
    for _ in range(2):
        joined = joined.replace(2 * separator, f"{separator}nan{separator}")
    joined = joined.replace(f"\n{separator}", f"\nnan{separator}").replace(f"{separator}\n", f"{separator}nan\n")
    return joined[1:-1].split("\n")


def _exact(text: _Text, headings: Sequence[Heading], columns: Sequence[Array]) -> dict[str, npt.NDArray[np.int64]]:
    """The columns of whole numbers that no double holds (times in ns since 1970), as integers, by label."""
    found = {}
    mark = None if text.shape.separator == " " else text.shape.separator
    for head, column in zip(headings, columns, strict=True):
        if np.isfinite(column).all() and np.abs(column).max(initial=0.0) >= _MAX_WHOLE:
            try:
                whole = np.loadtxt(text.plain, np.int64, None, mark, usecols=head.number - 1, quotechar='"', ndmin=1)
            except (ValueError, OverflowError):
                continue
            found[head.label] = whole
    return found


def _careful(text: _Text, headings: list[Heading], keep: Keep) -> RawTable:
    """Cell by cell: understands quotes and marks of missing samples, leaves text columns out, names the first
    bad cell.
    """
    shape = text.shape
    rows = _rows(shape)
    if len(rows) != len(shape.body):
        raise RecordError(f"{shape.source}: a quoted cell runs over the end of its line")
    _check_widths(shape, text.rows, rows)
    chosen, columns, notes, dated = [], [], [*shape.notes, *text.notes], dict[str, Array]()
    words = dict[str, str]()
    untimed = clock(headings) is None
    for i, (head, column_cells) in enumerate(zip(headings, zip(*rows, strict=True), strict=True)):
        if not head.label and not any(column_cells):
            continue
        told, column = _column(text, i, head, column_cells, keep(head, headings), untimed, notes)
        if column is None:
            notes.append(Note(f"column {head.label!r} holds text and is left out", "left_out", head.label))
            found = times_of_day(column_cells) if is_value(column_cells[0]) else None
            dated |= {} if found is None else {head.label: found.seconds}
            words |= {head.label: column_cells[0]} if len(set(column_cells)) == 1 else {}
            continue
        chosen.append(told)
        columns.append(column)
    return RawTable(shape.source, chosen, columns, text.rows, tuple(notes), dated=dated, words=words)


def _rows(shape: Layout) -> list[list[str]]:
    if shape.separator == " ":
        return [line.split() for line in shape.body]
    try:
        return [[cell.strip() for cell in row] for row in csv.reader(shape.body, delimiter=shape.separator)]
    except csv.Error as error:
        raise RecordError(f"{shape.source}: the cells cannot be told apart: {error}") from error


def _check_quotes(shape: Layout) -> None:
    """Refuse a quote that opens a cell and is not closed on its line."""
    for i, line in enumerate(shape.body):
        at = opened(line, shape.separator) if '"' in line else None
        if at is not None:
            label = shape.header[at] if at < len(shape.header) else f"{at + 1}"
            place = f"row {i + 1} (line {shape.numbers[i]}), column {label!r}"
            raise RecordError(f"{shape.source}: {place}: a quote is opened and not closed: {shortened(line)!r}")


def _check_widths(shape: Layout, where: Rows, rows: list[list[str]]) -> None:
    for i, row in enumerate(rows):
        if len(row) != len(shape.header):
            raise RecordError(
                f"{shape.source}: {where.name(i)} has {len(row)} cells, the header {len(shape.header)} columns "
                f"({shortened(', '.join(shape.header), 120)}); the line is {shortened(shape.body[i], 120)!r}; "
                + (_nameless(len(row)) if i == 0 else "mend or delete the line")
            )


def _nameless(width: int) -> str:
    """What is to be done about a header that has another number of cells than the rows."""
    return f"the header must name every cell, divided alike; or call the columns c1 to c{width}: --signal NAME=c2"


def _column(
    text: _Text, at: int, head: Heading, found: tuple[str, ...], keep: bool | None, untimed: bool, notes: list[Note]
) -> tuple[Heading, Array | None]:
    """The heading and numbers of column `at` (R,), None for a column of text. A missing sample is NaN. Where no column
    is called a time (``untimed``), one of dates and times is it.
    """
    comma = at in text.commas
    try:
        numbers = [float("nan") if cell.lower() in EMPTY_CELLS else _number(cell, comma) for cell in found]
        return head, np.array(numbers)
    except ValueError:
        given = [(i, cell) for i, cell in enumerate(found) if cell.lower() not in EMPTY_CELLS]
    measured = _with_units(found, comma)
    if measured is not None:
        notes.append(Note(f"column {head.label!r} states its unit in every cell: {measured[0]}", "format", head.label))
        return replace(head, unit=head.unit or measured[0]), measured[1]
    times = times_of_day(found) if keep is True or untimed else None
    if times is not None:
        notes.append(Note(f"{head.label!r} holds {times.what}; it counts in s from {times.start}", "clock", head.label))
        named = head if head.label else replace(head, label="time", name="time")
        return replace(named, unit="s"), times.seconds
    told = directions(found) if keep is True else None
    if told is not None:
        notes.append(Note(f"column {head.label!r} holds directions: {told.said}", "mapped", head.label))
        return head, told.values
    if keep is False or (keep is None and not any(is_number(cell) for _, cell in given)):
        return head, None
    bad, cell = next((i, cell) for i, cell in given if not _reads(cell, comma))
    other = "comma" if comma and "." in cell else "point" if not comma and text.points and "," in cell else ""
    hint = f"; other numbers have a decimal {other}" if other else ""
    words = sorted(set(found))
    if keep is True and len(words) <= 4 and not any(map(is_number, words)):
        hint = f"; it holds {', '.join(map(repr, words))}: directions are known as F/R, forward/reverse, +/-, CW/CCW"
    where = f"{text.shape.source}: {text.rows.name(bad)}, column {head.label!r}"
    raise RecordError(f"{where}: {shortened(cell)!r} is not a number{hint}")


def _with_units(found: Sequence[str], comma: bool) -> tuple[str, Array] | None:
    """The unit that every cell of a column states behind its number, ``0.005 sec``, and the numbers (R,); else None."""
    given = {cell for cell in found if cell.lower() not in EMPTY_CELLS}
    parts = {cell: MEASURED.fullmatch(cell) for cell in given}
    marks = {match[2] for match in parts.values() if match}
    unit = next(iter(marks), "")
    if len(marks) != 1 or not all(parts.values()) or units.parse(unit) is None:
        return None
    written = "".join(match[1] for match in parts.values() if match)
    comma = comma or ("," in written and "." not in written)
    numbers = {cell: _number(match[1], comma) for cell, match in parts.items() if match}
    return unit, np.array([numbers.get(cell, np.nan) for cell in found])


def _number(cell: str, comma: bool) -> float:
    if "_" in cell:
        raise ValueError(cell)
    if GROUPED.fullmatch(cell):
        last = max(cell.rfind(","), cell.rfind("."))
        return float(re.sub(r"[^\d+-]", "", cell[:last]) + "." + cell[last + 1 :])
    return float(cell.replace(",", ".") if comma else cell)


def _reads(cell: str, comma: bool) -> bool:
    try:
        _number(cell, comma)
    except ValueError:
        return False
    return True
