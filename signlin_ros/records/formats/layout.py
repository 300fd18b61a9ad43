"""How a text file is laid out: what separates its cells, where its table begins, which line names the columns.

Before the table there may be a preamble of any lines, and between the names and the numbers a row of units. A file
whose first line is numbers has no names: its columns are called ``c1``, ``c2``, ... A header that returns begins a new
run.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from signlin_ros import units
from signlin_ros.errors import RecordError
from signlin_ros.records.formats.cells import (
    EMPTY_CELLS,
    TEXT_SEPARATORS,
    cells,
    is_number,
    is_value,
    opened,
    shortened,
)
from signlin_ros.records.grammar import words
from signlin_ros.records.header import heading, names_a_time
from signlin_ros.records.notes import Note

Integers = npt.NDArray[np.int64]

MOST_FOOT_LINES = 20
"""Lines below the table that are looked for."""
LAYOUT_LINES_LOOKED = 200
"""So many lines at the end and as many from the start tell the layout."""
_COMMENT = re.compile(r"\s*(?:#|//|%(?!time\b))")
_WORDS = re.compile(r"\s*(?:[^\W\d_]|[-=*<>\[{(]{2})")
"""How a line begins that a program prints among its rows."""
_BY_NUMBER = re.compile(r"c\d+")


@dataclass(frozen=True)
class Layout:
    """A file split up: header cells, the lines of data and their numbers in the file (from 1).

    ``separator``: between cells; ``named``: whether the file names its columns; ``unit_row``: the cells of a row of
    units; ``runs``: the rows at which a new run begins, because the header returned.
    """

    source: str
    header: list[str]
    body: list[str]
    numbers: Integers
    separator: str
    named: bool = True
    unit_row: tuple[str, ...] = ()
    runs: tuple[int, ...] = ()
    notes: tuple[Note, ...] = field(default=())


_TYPE = re.compile(
    r"(?i:[iuf][1248]|[us]?int(?:8|16|32|64)?|float(?:32|64)?|double|single|l?real|d?word|byte|u?[dls]int|numeric)"
)
"""What a row below the header may hold that says how each column is stored."""


def layout(text: str, source: str) -> Layout:
    """Find the table in a text; raise `RecordError` where there is none."""
    ended = text.endswith("\n")
    lines = text.split("\n")
    while lines and not lines[-1].strip():
        lines.pop()
    if not lines:
        raise RecordError(f"{source}: the file is empty")
    kept = _rows_of_text(text, lines)
    if not kept:
        raise RecordError(f"{source}: nothing but comments: no header and no rows")
    separator, width = _separator([lines[i] for i in kept])
    kept = [i for i in kept[:LAYOUT_LINES_LOOKED] if lines[i].strip(f"{separator} ")] + [*kept[LAYOUT_LINES_LOOKED:]]
    if not kept:
        raise RecordError(f"{source}: nothing but separators: no header and no rows")
    first = _first_row(lines, kept, separator, width)
    if first is None:
        raise _no_rows(source, lines[kept[0]], kept, separator)
    names, unit_row, notes = _names(lines, kept, first, separator, width, source)
    if names is not None and len(names) < 2 <= width:
        if _divided_otherwise(names[0], width, separator):
            how = "separate columns by comma, semicolon, tab or blanks"
            raise RecordError(f"{source}: the header has one column, {names[0]!r}; {how}")
        called = (
            f"the columns are called c1 to c{width}: the line before the numbers names none, {shortened(names[0])!r}"
        )
        names, unit_row, notes = None, (), [Note(called, "format")]
    body, numbers = _without_comments(lines, kept[first:], separator, width)
    body, numbers = _without_empty(body, numbers, separator)
    header_line = lines[kept[first - 1 - bool(unit_row)]] if names is not None and first else None
    body, numbers, runs = _without_headers(
        body, numbers, header_line, lines[kept[first - 1]] if unit_row and first else None
    )
    before = numbers
    body, numbers, told = _without_messages(body, numbers, separator, width, names or [], source)
    runs = tuple(int(np.searchsorted(numbers, before[i])) for i in runs)
    body, numbers, foot = _without_foot(lines, body, numbers, separator)
    body, numbers, cut = _without_cut(body, numbers, separator, width, ended)
    cut = [*told, *foot, *cut]
    if not body:
        raise RecordError(f"{source}: a header but no rows of data")
    header = names if names is not None else [f"c{i + 1}" for i in range(width)]
    header = _fitted(header, body, separator)
    return Layout(source, header, body, numbers, separator, names is not None, unit_row, runs, (*notes, *cut))


def _divided_otherwise(line: str, width: int, separator: str) -> bool:
    """Whether a line may be a header that another mark divides than the rows: as many words as these have cells."""
    return any(len(cells(line, mark)) == width for mark in TEXT_SEPARATORS if mark != separator)


def _rows_of_text(text: str, lines: Sequence[str]) -> Sequence[int]:
    """The places of the lines that are neither blank nor comments."""
    if any(mark in text for mark in "#%") or "//" in text:
        return [i for i, line in enumerate(lines) if line.strip() and not _COMMENT.match(line)]
    if all(lines):
        blank = {i for i, line in enumerate(lines) if line[0].isspace() and not line.strip()}
        return [i for i in range(len(lines)) if i not in blank] if blank else range(len(lines))
    return [i for i, line in enumerate(lines) if line.strip()]


def _separator(lines: Sequence[str]) -> tuple[str, int]:
    """The separator that splits most lines into equally many values, and how many cells those have."""
    looked = (
        lines
        if len(lines) <= 2 * LAYOUT_LINES_LOOKED
        else [*lines[:LAYOUT_LINES_LOOKED], *lines[-LAYOUT_LINES_LOOKED:]]
    )
    best, chosen = (-1.0, 0), (",", 1)
    for mark in TEXT_SEPARATORS:
        rows = [cells(line, mark) for line in looked if opened(line, mark) is None]
        rows = [row for row in rows if sum(map(is_value, row)) > len(row) / 4] or rows
        width = Counter(_width(row) for row in rows).most_common(1)[0][0] if rows else 1
        same = [row for row in rows if _width(row) == width]
        there = [cell for row in same for cell in row if cell.lower() not in EMPTY_CELLS]
        share = sum(map(is_value, there)) / max(len(there), 1)
        score = (round(share * len(same) / max(len(rows), 1), 2), width) if width > 1 else (0.0, 0)
        if score[0] > best[0] + 0.05 or (abs(score[0] - best[0]) <= 0.05 and score[1] > best[1]):
            best, chosen = score, (mark, width)
    return chosen


def _width(row: Sequence[str]) -> int:
    """How many cells a row has; an empty one after a last separator counts, since it may be a missing sample."""
    return len(row)


def _first_row(lines: Sequence[str], kept: Sequence[int], separator: str, width: int) -> int | None:
    """The place in `kept` of the first row of values; None where no line is one."""
    for k, i in enumerate(kept):
        row = cells(lines[i], separator) if opened(lines[i], separator) is None else []
        there = [cell for cell in row if cell.lower() not in EMPTY_CELLS]
        values = sum(map(is_value, there))
        if (
            len(row) in (width, width + 1)
            and values
            and values >= len(there) / 3
            and _not_a_preamble(lines, kept, k, separator, width)
            and (values == len(there) or not _named_below(lines, kept, k, separator, width))
        ):
            return k
    return None


def _not_a_preamble(lines: Sequence[str], kept: Sequence[int], k: int, separator: str, width: int) -> bool:
    """Whether what follows a row of values is one more, or nothing."""
    if k + 1 >= len(kept):
        return True
    row = cells(lines[kept[k + 1]], separator)
    return any(map(is_value, row)) or len(row) != width or all(cell.lower() in EMPTY_CELLS for cell in row)


def _named_below(lines: Sequence[str], kept: Sequence[int], k: int, separator: str, width: int) -> bool:
    """Whether a row with words is a key and its values, ``Vertical Scale,2,2``: below it all cells of a line are names
    that stand nowhere above it, as those of a header that returns do.
    """
    above = {lines[i].strip() for i in kept[:k]}
    for i in kept[k + 1 : k + LAYOUT_LINES_LOOKED]:
        row = cells(lines[i], separator) if lines[i].strip() not in above else []
        if len(row) == width and all(row) and not any(map(is_value, row)):
            return True
    return False


def _names(
    lines: Sequence[str], kept: Sequence[int], first: int, separator: str, width: int, source: str
) -> tuple[list[str] | None, tuple[str, ...], list[Note]]:
    """The names of the columns, None where the file has none; a row of units; what is said of both."""
    above = [cells(lines[i], separator) for i in kept[:first]]
    notes = []
    unit_row: tuple[str, ...] = ()
    typed = _without_types(above)
    _without_unnamed(above, cells(lines[kept[first]], separator))
    if _holds_units(above) and len(above[-2]) >= len(above[-1]) - 1 and not _are_units(above[-2]):
        unit_row = tuple(_unit_in(cell) for cell in above.pop())
        notes.append(Note("the row below the header was taken for units", "format"))
        typed = typed or _without_types(above)
    if typed:
        notes.append(Note("the row of data types below the header is left out", "format"))
    levels = _levels(above)
    if levels is not None:
        return *levels, [Note(f"a header of {len(above)} rows, as a data frame of several levels has", "format")]
    comments = [lines[i] for i in sorted({*range(kept[first])} - {*kept[:first]}) if lines[i].strip()]
    found = None if above and len(above[-1]) >= width else _header_in_comment(comments, width, separator)
    if found is not None:
        return *found, [Note("the header was found in a comment", "format")]
    if above:
        if len(above) > 1:
            lines_of = "1 line" if len(above) == 2 else f"{len(above) - 1} lines"
            notes.append(Note(f"{lines_of} before the header are no part of the table", "format"))
        return above[-1], unit_row, notes
    start = lines[kept[first]].strip()
    called = f"no header: the columns are called c1 to c{width}; the first row is {shortened(start)!r}"
    return None, (), [Note(called, "format")]


def _without_types(above: list[list[str]]) -> bool:
    """Leave out a row of data types that stands last below names; tell whether there is one."""
    found = len(above) > 1 and all(map(_TYPE.fullmatch, above[-1])) and len(above[-2]) >= len(above[-1])
    if found:
        above.pop()
    return found


def _without_unnamed(above: list[list[str]], row: Sequence[str]) -> None:
    """Leave out what stands below the names and names not every column of values: channels, ``data:``."""
    if _levels(above) is not None or not any(_names_all(names, len(row)) for names in above):
        return
    while any(is_value(cell) and not name for cell, name in zip(row, above[-1], strict=False)):
        above.pop()
        while not _names_all(above[-1], len(row)) and not _holds_units(above):
            above.pop()


def _names_all(names: Sequence[str], width: int) -> bool:
    """Whether a row may name columns: its cells are words that differ."""
    there = [name for name in names if name]
    return len(there) >= width and len(set(there)) == len(there) and not any(map(is_value, there))


def _levels(above: list[list[str]]) -> tuple[list[str], tuple[str, ...]] | None:
    """The names of columns of several levels, joined by a point, and a row of units: below them a row names the index
    alone, above it nothing does.
    """
    if len(above) < 2 or not above[-1][0] or any(above[-1][1:]):
        return None
    *levels, last = above
    if any(row[0] or not all(row[1:]) or len(row) != len(last) for row in levels):
        return None
    unit_row = levels.pop() if len(levels) > 1 and _are_units(levels[-1]) else []
    names = [".".join(parts) for parts in zip(*levels, strict=True)]
    return [last[0], *names[1:]], tuple(unit_row)


def _unit_in(cell: str) -> str:
    """A unit as it stands in a row of units, without brackets; nothing for what is none beside them."""
    bare = cell.strip("[]() ")
    return bare if bare == "-" or _is_unit(bare) or not bare[:1].isalpha() else ""


def _is_unit(cell: str) -> bool:
    return units.parse(cell) is not None or cell in ("C", "degC", "counts", "ticks")


def _repeats_units(row: Sequence[str], names: Sequence[str]) -> bool:
    """Whether a row holds a unit twice, as no header does, below names that all differ: what else it holds is the
    first column's, ``NO.``, or that of the time.
    """
    twice = [cell for cell, count in Counter(cell for cell in row if cell).items() if count > 1]
    differ = len({name for name in names if name}) == sum(map(bool, names))
    return len(names) >= len(row) and differ and any(map(_is_unit, twice))


def _holds_units(above: Sequence[Sequence[str]]) -> bool:
    """Whether the last one of some rows holds the units of the names in the row before it."""
    if len(above) < 2:
        return False
    names, row = above[-2:]
    return _are_units(row) or _repeats_units(row, names) or _is_below_a_time(row, names)


def _is_below_a_time(row: Sequence[str], names: Sequence[str]) -> bool:
    """Whether a unit of time stands below the name of a time, in a row below names: a row of units, known or not."""
    over = [unit for name, unit in zip(names, row, strict=False) if names_a_time(name)]
    return _names_all(names, len(row)) and any(units.parse(unit) == units.parse("s") for unit in over)


def _are_units(row: Sequence[str]) -> bool:
    """Whether a row holds units, brackets or nothing, and units at least."""
    found = [cell.strip("[]() ") for cell in row]
    known = [cell for cell in found if cell and _is_unit(cell)]
    return bool(known) and all(cell in known or cell in ("", "-") for cell in found)


def _header_in_comment(comments: Sequence[str], width: int, separator: str) -> tuple[list[str], tuple[str, ...]] | None:
    """The last comment with as many cells as the rows (numpy.savetxt writes the header there), and a row of units that
    stands below it.
    """
    unit_row: list[str] = []
    for line in reversed(comments):
        bare = line.strip().lstrip("#%/").strip()
        for mark in dict.fromkeys((separator, *TEXT_SEPARATORS)):
            found = cells(bare, mark)
            if len(found) != width or width < 2 or any(map(is_number, found)):
                continue
            if unit_row or not _are_units(found):
                return found, tuple(cell.strip("[]() ") for cell in unit_row)
            unit_row = found
            break
    return (unit_row, ()) if unit_row else None


def _without_comments(
    lines: Sequence[str], kept: Sequence[int], separator: str, width: int
) -> tuple[list[str], Integers]:
    """The lines of data and their numbers in the file; what follows a ``#`` behind a whole row is cut off."""
    body = list(lines[kept[0] : kept[-1] + 1]) if len(kept) == kept[-1] - kept[0] + 1 else [lines[i] for i in kept]
    if any("#" in line for line in body):
        body = [_uncommented(line, separator, width) if "#" in line else line for line in body]
    return body, np.array(kept, dtype=np.int64) + 1


def _uncommented(line: str, separator: str, width: int) -> str:
    head = re.split(r"(?<=\s)#|#(?=\s)", line, maxsplit=1)[0].rstrip()
    last = head.rsplit(separator if separator != " " else None, 1)[-1].strip()
    whole = len(cells(head, separator)) >= width and (is_value(last) or last.lower() in EMPTY_CELLS)
    return head if whole else line


def _without_empty(body: list[str], numbers: Integers, separator: str) -> tuple[list[str], Integers]:
    """The lines that hold anything but separators: spreadsheets leave such lines at the end."""
    if not any(line.startswith((separator, " ")) for line in (body[0], body[-1])) and separator != " ":
        joined = "\n".join(body)
        if f"\n{separator}" not in joined and "\n " not in joined:
            return body, numbers
    blank = f"{separator} "
    kept = [i for i, line in enumerate(body) if line.strip(blank)]
    return (body, numbers) if len(kept) == len(body) else ([body[i] for i in kept], numbers[kept])


def _without_headers(
    body: list[str], numbers: Integers, header: str | None, unit_row: str | None
) -> tuple[list[str], Integers, tuple[int, ...]]:
    """The rows without headers that stand among them, and the rows before which these stood."""
    again = {line.strip() for line in (header, unit_row) if line is not None}
    if not again or not any(mark in "\n".join(body) for mark in again):
        return body, numbers, ()
    there = np.array([line.strip() in again for line in body])
    starts = np.unique(np.cumsum(~there)[there])
    kept = np.flatnonzero(~there)
    return [body[i] for i in kept], numbers[kept], tuple(int(i) for i in starts if 0 < i < kept.size)


def _without_messages(
    body: list[str], numbers: Integers, separator: str, width: int, names: Sequence[str], source: str
) -> tuple[list[str], Integers, list[Note]]:
    """The rows without lines that a program printed among them: these have another number of cells and begin with a
    word, or hold nothing but words. A row of other cells beside one was cut off by it. Names for as many columns as
    there are begin another table, which is refused.
    """
    counts = np.array([len(line.split()) if separator == " " else line.count(separator) + 1 for line in body])
    odd = (counts != width) & (counts != np.bincount(counts).argmax())
    begins = np.array([bool(_WORDS.match(line)) for line in body])
    looked = np.flatnonzero(odd | begins if 2 * begins.sum() < len(body) else odd)
    if not looked.size or 2 * looked.size > len(body):
        return body, numbers, []
    messages = np.zeros(len(body), dtype=np.bool_)
    messages[looked] = [_is_message(body[i], separator, width) for i in looked]
    for i in np.flatnonzero(messages & (counts == width)):
        row = cells(body[i], separator)
        if i + 1 < len(body) and len(set(row)) == width > 1 and (separator != " " or set(row) & set(names)):
            raise RecordError(
                f"{source}: line {numbers[i]}, {shortened(body[i])!r}, names the columns of another table: put it, and "
                "the rows below it, into a file of their own"
            )
    beside = np.concatenate([messages[1:], [False]]) | np.concatenate([[False], messages[:-1]])
    gone = messages | (odd & beside)
    if not gone.any():
        return body, numbers, []
    first = int(np.argmax(gone))
    count = "1 line" if gone.sum() == 1 else f"{int(gone.sum())} lines"
    said = (
        f"{count} among the rows are no rows and left out, the first (line {numbers[first]}) {shortened(body[first])!r}"
    )
    kept = np.flatnonzero(~gone)
    return [body[i] for i in kept], numbers[kept], [Note(said, "truncated")]


def _is_message(line: str, separator: str, width: int) -> bool:
    """Whether a line is no row, not even one with a fault: it begins with a word and has other cells, or only words."""
    if opened(line, separator) is not None:
        return False
    row = cells(line, separator)
    nothing = [not is_value(cell) and cell.lower() not in EMPTY_CELLS for cell in row]
    return nothing[0] and (len(row) != width or all(nothing))


def _without_foot(
    lines: Sequence[str], body: list[str], numbers: Integers, separator: str
) -> tuple[list[str], Integers, list[Note]]:
    """The rows without what stands below an empty line at the end and begins with a word where all others begin with a
    value: sums and means of a spreadsheet, a signature.
    """
    empty = next(
        (
            i
            for i in range(len(lines) - 1, len(lines) - 2 - MOST_FOOT_LINES, -1)
            if i > 0 and not lines[i].strip(f"{separator} ")
        ),
        0,
    )
    first = int(np.searchsorted(numbers, empty + 1))
    foot = body[first:] if empty else []
    if not 0 < len(foot) < len(body) or any(is_value(cells(line, separator)[0]) for line in foot):
        return body, numbers, []
    if not is_value(cells(body[first - 1], separator)[0]):
        return body, numbers, []
    said = f"what stands below the empty line {empty + 1} is no row of values and left out: {shortened(foot[0])!r}"
    return body[:first], numbers[:first], [Note(said, "truncated")]


def _without_cut(
    body: list[str], numbers: Integers, separator: str, width: int, ended: bool
) -> tuple[list[str], Integers, list[Note]]:
    """The rows without a last one that a crash cut off: it alone has fewer cells, or the file ends within one."""
    if len(body) < 3 or not _is_cut(body[-1], body[-2], separator, width, ended):
        return body, numbers, []
    said = f"the last line ({numbers[-1]}) is cut off and left out: {shortened(body[-1])!r}"
    return body[:-1], numbers[:-1], [Note(said, "truncated")]


def _is_cut(last: str, before: str, separator: str, width: int, ended: bool) -> bool:
    if opened(last, separator) is not None:
        return not ended and opened(before, separator) is None
    found, whole = cells(last, separator), cells(before, separator)
    if len(found) < min(width, len(whole)):
        return True
    there = found[-1] if found and len(found) == len(whole) else ""
    return bool(
        not ended and there and is_value(whole[-1]) and not is_value(there) and there.lower() not in EMPTY_CELLS
    )


def _fitted(header: list[str], body: Sequence[str], separator: str) -> list[str]:
    """The header without, or with, an empty cell at its end that the rows have not, or have."""
    width = Counter(len(cells(line, separator)) for line in body[:LAYOUT_LINES_LOOKED]).most_common(1)[0][0]
    while len(header) > max(width, 1) and not header[-1]:
        header = header[:-1]
    if len(header) == width - 1 and not any(
        cells(line, separator)[width - 1 :] not in ([], [""]) for line in body[:LAYOUT_LINES_LOOKED]
    ):
        header = [*header, ""]
    return header


def by_number(shape: Layout, asked: Iterable[str]) -> Layout:
    """The layout with ``c1``, ``c2``, ... for its names, where there are fewer of these than cells in the rows, so that
    none is known to be right, and what is asked for is columns by such numbers, none by a name of the header.
    """
    specs = list(asked)
    width = Counter(len(cells(line, shape.separator)) for line in shape.body[:LAYOUT_LINES_LOOKED]).most_common(1)[0][0]
    numbers = any(_BY_NUMBER.fullmatch(word) for spec in specs for word in words(spec))
    named = any(heading(cell).matches(spec) for cell in shape.header for spec in specs)
    if len(shape.header) >= width or not numbers or named:
        return shape
    said = f"the header has {len(shape.header)} cells, the rows {width}: the columns are called c1 to c{width}"
    header = [f"c{i + 1}" for i in range(width)]
    return replace(shape, header=header, named=False, unit_row=(), notes=(*shape.notes, Note(said, "format")))


def _no_rows(source: str, first: str, kept: Sequence[int], separator: str) -> RecordError:
    if len(kept) == 1:
        names = cells(first, separator)
        if len(names) < 2:
            return RecordError(
                f"{source}: the header has one column, {first.strip()!r}; "
                "separate columns by comma, semicolon, tab or blanks"
            )
        return RecordError(f"{source}: a header but no rows of data")
    place = f"line {kept[0] + 1} is {shortened(first)!r}"
    return RecordError(f"{source}: no rows of numbers below a header; {place}")


def labelled(shape: Layout) -> list[str]:
    """The header with the row of units in it."""
    if not shape.unit_row:
        return shape.header
    row = [*shape.unit_row, *[""] * len(shape.header)]
    return [_with_unit(name, unit) for name, unit in zip(shape.header, row, strict=False)]


def _with_unit(name: str, unit: str) -> str:
    """A name with the unit below it, where it does not state one itself, or ends as one that this is not."""
    own = heading(name)
    stated = bool(own.unit) and not (own.suffix and units.parse(own.unit) != units.parse(unit))
    return name if unit in ("", "-") or stated else f"{name} [{unit}]"
