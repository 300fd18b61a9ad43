"""Text of loggers that is no plain table, made one: LabVIEW, TwinCAT Scope, CODESYS, oscilloscopes, labels with values.

Each is known by what stands at its beginning. What comes out is a table with names, units and the time in front, for
`signlin_ros.records.formats.layout`; where signals have clocks of their own, cells are empty in between.

- LabVIEW measurement file (.lvm): headers that end with ``***End_of_Header***``
  [https://www.ni.com/en/support/documentation/supplemental/06/specification-for-the-labview-measurement-file---lvm-.html].
- TwinCAT Scope: keys and values by channel, then time and value by channel.
- CODESYS and ctrlX traces: ``[key]; [value]``, then time and value in a block for each variable.
- Rigol (X, CH1, ..., Start, Increment), Tektronix TDS (keys in the first columns, beside the samples).
- ``t:0.005, u:1.2`` and ``{"t": 0.005, "m": {"u": 1.2}}``: a name before every value, also a line for each; ``m.u`` of
  objects in objects.
  What a monitor or a program's log puts in front of a line, ``10:05:03.125 -> ``, is its ``stamp``.
- LabChart and Yokogawa: names, units and the step behind keys, ``ChannelTitle=``, ``"TraceName"``, above the numbers.
- Signs apart from their digits, ``+   1.25`` (Graphtec).
- Tables whose cells hold lists, ``"[0.1, 0.2]"``, as data frames of robots are written: ``q[0]``, ``q[1]``.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from signlin_ros.records.formats.cells import is_number
from signlin_ros.records.formats.labels import blocks, header_cell, labelled, stamped, table_text, with_unit
from signlin_ros.records.header import heading
from signlin_ros.records.notes import Note

Array = npt.NDArray[np.float64]
Plain = tuple[str, Note]
"""A table as text, and what is said of it."""
Track = tuple[str, Array, Array]
"""Name (with its unit), times (N,) s and values (N,) of a signal."""

END = "***End_of_Header***"
_FRAMES = re.compile(
    r"^\s*\(\d+\.\d+\)\s+\w+\s+[0-9A-Fa-f]{3,8}(?:#|\s+\[\d+\])|^base (?:hex|dec)\s+timestamps ", re.MULTILINE
)
_TUPLE, LABEL_ROWS = re.compile(r"[ \t]*[(\[][^()\[\]\n]*[)\]],?[ \t]*", re.MULTILINE), 50
"""A row in brackets, as a program prints a tuple; so many of them tell."""
_LISTS = re.compile(r'^[^"\[{]+\n(?:[^\n]*?[,;\t])?"[\[(]\s*[-+.\d]')
_SIGN_APART = re.compile(r"(?<=[,;\t])[ ]*([-+])[ ]+(\d)")
NAMES_KEYS, UNITS_KEYS, STEP_KEYS = ("channeltitle", "tracename"), ("unitname", "vunit"), ("interval", "hresolution")
"""Keys in front of the names of columns, of their units, and of the step in s."""
VOLTS = ("volt", "volts", "v")
"""What an oscilloscope calls what a probe shows, whatever that measures: no unit of it."""
MAX_WRITES = 50
"""Times that the X of a LabVIEW file begins anew at most: of more writes it counts each by itself."""
TICKS = 1e-7
"""What the stamps of TwinCAT count in, in s, where it is not ms."""


def raw_frames(text: str) -> bool:
    """Tell whether a text is a log of a CAN bus whose frames nobody has decoded, of candump or Vector (.asc)."""
    return bool(_FRAMES.search(text[:4000]))


def plain(text: str) -> Plain | None:
    """Return the text of a logger as a table; None where it is none of those that are known here."""
    start = text[:200].lstrip("\ufeff \n")
    if start.startswith("LabVIEW Measurement"):
        return _labview(text.split("\n"))
    if start.startswith("[key]"):
        return _codesys(text.split("\n"))
    if start.startswith("Name") and re.search(r"^Start ?time of export", text[:4000], re.MULTILINE):
        return _twincat(text.split("\n"))
    first = start.split("\n", 1)[0]
    if re.search(r"\bIncrement\b|\btInc\s*=", first):
        return _rigol(text.split("\n"))
    if first.startswith("Record Length,") and len(first.split(",")) >= 5:
        return _tektronix(text.split("\n"))
    if _LISTS.search(text[:4000]):
        return _listed(text)
    if _TUPLE.match(start) and all(_TUPLE.fullmatch(line) for line in text.split("\n")[:LABEL_ROWS] if line.strip()):
        rows = [line.strip().rstrip(",")[1:-1] for line in text.split("\n") if _TUPLE.fullmatch(line)]
        return "\n".join(rows) + "\n", Note("rows in brackets", "format")
    return labelled(text) or stamped(text) or blocks(text) or _keyed(text) or _signs_apart(text)


# -------------------------------------------------------------------- what all of them become


def _number(cell: str) -> float:
    try:
        return float(cell.strip().replace(",", "."))
    except ValueError:
        return np.nan


def _table(tracks: Sequence[Track], what: str, time: str = "t [s]") -> Plain | None:
    """Return signals as a table: at one time base where they have one, else each in rows of its own stamps."""
    tracks = [one for one in tracks if one[1].size]
    if not tracks:
        return None
    first = tracks[0][1]
    said = f"{what}: {', '.join(name for name, _, _ in tracks)}"
    header = ",".join([time, *(header_cell(name) for name, _, _ in tracks)])
    if all(t.size == first.size and np.array_equal(t, first) for _, t, _ in tracks):
        rows, columns = first, [y for _, _, y in tracks]
    else:
        rows = np.unique(np.concatenate([t for _, t, _ in tracks]))
        columns = []
        for _, t, y in tracks:
            column = np.full(rows.shape, np.nan)
            column[np.searchsorted(rows, t)] = y
            columns.append(column)
    return table_text(header, [rows, *columns]), Note(said, "format")


# -------------------------------------------------------------------- names behind keys, signs apart


def _keyed(text: str) -> Plain | None:
    """Return rows of numbers below keys, of which one names the columns, others give their units and the step."""
    if not any(key in text[:4000].lower() for key in NAMES_KEYS):
        return None
    mark = "\t" if "\t" in text[:4000] else ","
    lines = [row for row in csv.reader(text.split("\n"), delimiter=mark) if any(cell.strip() for cell in row)]
    first = next((k for k, row in enumerate(lines) if all(is_number(cell.strip()) for cell in row if cell.strip())), 0)
    keys = {row[0].strip(" =:").lower(): [cell.strip() for cell in row[1:] if cell.strip()] for row in lines[:first]}
    names = next((keys[key] for key in NAMES_KEYS if keys.get(key)), [])
    rows = [[cell.strip() for cell in row if cell.strip()] for row in lines[first:]]
    widths = {len(row) for row in rows}
    if not names or widths not in ({len(names)}, {len(names) + 1}):
        return None
    units = next((keys[key] for key in UNITS_KEYS if len(keys.get(key, ())) == len(names)), [""] * len(names))
    header = [header_cell(with_unit(name, unit)) for name, unit in zip(names, units, strict=True)]
    step = next((_number(keys[key][0].split()[0]) for key in STEP_KEYS if keys.get(key)), np.nan)
    if widths == {len(names)} and step > 0.0:
        rows = [[repr(k * step), *row] for k, row in enumerate(rows)]
    head = ["t [s]", *header] if len(rows[0]) > len(names) else header
    return "\n".join(map(",".join, [head, *rows])) + "\n", Note("names of columns behind a key", "format")


def _signs_apart(text: str) -> Plain | None:
    """Return a table with the signs at their digits; None where none is apart."""
    if not _SIGN_APART.search(text[:4000]):
        return None
    return _SIGN_APART.sub(r"\1\2", text), Note("signs stand apart from their digits", "format")


# -------------------------------------------------------------------- LabVIEW


def _labview(lines: Sequence[str]) -> Plain | None:
    """Return the segments of a measurement file, one below the other."""
    keys = {cells[0]: cells[1].strip() for line in lines[:40] if len(cells := re.split("[\t,]", line)) > 1}
    mark = "," if keys.get("Separator", "Tab") == "Comma" else "\t"
    tracks: dict[str, tuple[list[Array], list[Array]]] = {}
    ends = [i for i, line in enumerate(lines) if line.startswith(END)]
    for first, after in zip(ends[1:] or ends, [*ends[2:], len(lines)], strict=False):
        top = max((i for i in ends if i < first), default=-1) + 1
        for name, t, y in _segment(lines[top:first], lines[first + 1 : after], mark):
            both = tracks.setdefault(name, ([], []))
            both[0].append(t)
            both[1].append(y)
    whole = [(name, np.concatenate(t), np.concatenate(y)) for name, (t, y) in tracks.items()]
    whole = [track for track in whole if track[1].size]
    one = bool(whole) and all(np.array_equal(t, whole[0][1]) for _, t, _ in whole)
    if one:
        t, falls = whole[0][1], int(np.count_nonzero(np.diff(whole[0][1]) <= 0.0))
        said = f"a LabVIEW measurement file: {', '.join(name for name, _, _ in whole)}"
        heads, columns = [header_cell(name) for name, _, _ in whole], [y for _, _, y in whole]
        if falls > MAX_WRITES:
            said = f"{said}; its X begins anew {falls + 1} times, at every write, and is no time"
            return table_text(",".join(heads), columns), Note(said, "left_out", "X_Value")
        return table_text(",".join(["t [s]", *heads]), [t, *columns]), Note(said, "format")
    return _table(whole, "a LabVIEW measurement file")


def _segment(head: Sequence[str], body: Sequence[str], mark: str) -> list[Track]:
    """Return the signals of one segment: its header's lines, then the names and the rows."""
    keys = {cells[0]: [c.strip() for c in cells[1:]] for line in head if (cells := line.split(mark))[0]}
    apart = len(keys.get("Samples", [])) > 1 and keys["Samples"][1] == ""  # each signal has a column of X of its own
    keys = {key: found[::2] if apart else found for key, found in keys.items()}
    rows = [line.split(mark) for line in body if line.strip() and not line.startswith("Channels")]
    if not rows:
        return []
    names = [name.strip() for name in rows[0]]
    numbers = np.array([[_number(c) for c in (*row, *[""] * len(names))[: len(names)]] for row in rows[1:]])
    numbers = numbers[np.isfinite(numbers).any(axis=1)] if numbers.size else np.zeros((0, len(names)))
    units, steps, starts = keys.get("Y_Unit_Label", []), keys.get("Delta_X", []), keys.get("X0", [])
    found, t, channel = list[Track](), None, 0
    for j, name in enumerate(names):
        if name == "X_Value":
            t = numbers[:, j] if np.isfinite(numbers[:, j]).any() else None
        elif name not in ("Comment", "") and j < numbers.shape[1]:
            begin, step = (_number(x[channel]) if channel < len(x) else np.nan for x in (starts, steps))
            own = t if t is not None else np.nan_to_num(begin) + step * np.arange(len(numbers))
            there = np.isfinite(numbers[:, j]) & np.isfinite(own)
            unit = units[channel] if channel < len(units) else ""
            found.append((with_unit(name, unit), own[there], numbers[there, j]))
            channel += 1
    return found


# -------------------------------------------------------------------- controllers


def _twincat(lines: Sequence[str]) -> Plain | None:
    """Return the channels of a Scope export: their names stand in the row that has several ``Name``, or the second."""
    mark = next((m for m in "\t;," if m in lines[0]), "\t")
    rows = [[c.strip() for c in line.split(mark)] for line in lines]
    at = next((i for i, row in enumerate(rows) if i and row[0] == "Name"), None)
    if at is None:
        return None
    keys: dict[str, list[str]] = {}
    data: list[list[str]] = []
    for row in rows[at:]:
        cells = row[:-1] if len(row) % 2 and not row[-1] else row
        if np.isfinite(_number(cells[0])) if cells else False:
            data.append(cells)
        elif cells and cells[0] and not data:
            keys.setdefault(cells[0].split("[")[0].strip(), cells[1::2])
    names, units = keys.get("Name", []), keys.get("Unit", [])
    width = 2 * len(names)
    table = np.array([[_number(c) for c in (*row, *[""] * width)[:width]] for row in data])
    if not table.size:
        return None
    stated = _number((keys.get("SampleTime") or [""])[0])
    tracks = []
    for j, name in enumerate(names):
        t, y = table[:, 2 * j], table[:, 2 * j + 1]
        there = np.isfinite(t) & np.isfinite(y)
        unit = units[j].strip("()[]") if j < len(units) else ""
        tracks.append((with_unit(name, unit), t[there] * _scope_unit(t[there], stated), y[there]))
    return _table(tracks, "an export of TwinCAT Scope")


def _scope_unit(t: Array, stated: float) -> float:
    """Return the unit of times in s: ms, or ticks where steps are as many of these as the sample time says."""
    step = float(np.median(np.diff(t))) if t.size > 1 else 0.0
    ticks = np.isfinite(stated) and stated > 0.0 and abs(step * TICKS / (1e-3 * stated) - 1.0) < 0.1
    return TICKS if ticks else 1e-3


def _codesys(lines: Sequence[str]) -> Plain | None:
    """Return the variables of a trace. Its times are in ms, or in µs where the steps would be longer than a second."""
    names: dict[str, str] = {}
    data: dict[str, list[tuple[float, float]]] = {}
    now = ""
    for line in lines:
        cells = [c.strip() for c in line.split(";")]
        match = re.match(r"(\d+)\.(Variable|Data)$", cells[0])
        if match and match[2] == "Variable":
            names[match[1]] = cells[1] if len(cells) > 1 else match[1]
        elif match:
            now = match[1]
        if now and len(cells) >= 3 and (not cells[0] or match):
            data.setdefault(now, []).append((_number(cells[1]), _number(cells[2])))
    tracks = []
    for key, rows in data.items():
        pairs = np.array(rows)
        pairs = pairs[np.isfinite(pairs).all(axis=1)]
        step = float(np.median(np.diff(pairs[:, 0]))) if len(pairs) > 1 else 0.0
        size = 1e-3 if step < 1000.0 else 1e-6
        tracks.append((names.get(key, key), pairs[:, 0] * size, pairs[:, 1]))
    return _table(tracks, "a trace of CODESYS, a block of times and values for each variable, read with times in ms")


# -------------------------------------------------------------------- oscilloscopes


def _rigol(lines: Sequence[str]) -> Plain | None:
    """Return the channels of a Rigol oscilloscope, at the times that the header states."""
    names = [c.strip() for c in lines[0].split(",")]
    stated = {k.lower(): _number(v) for k, v in re.findall(r"\b(t0|tInc)\s*=\s*([-+\d.eE]+)", lines[0])}
    if stated:
        start, step, units, body = stated.get("t0", 0.0), stated.get("tinc", np.nan), list[str](), lines[1:]
        names = [n for n in names if "=" not in n]
    else:
        second = [c.strip() for c in lines[1].split(",")]
        pairs = dict(zip(names, second, strict=False))
        start, step = _number(pairs.get("Start", "0")), _number(pairs.get("Increment", ""))
        units, body = second, lines[2:]
    if not np.isfinite(step):
        return None
    rows = [[_number(c) for c in (*line.split(","), *[""] * len(names))[: len(names)]] for line in body if line.strip()]
    table = np.array(rows)
    if not table.size:
        return None
    t = np.nan_to_num(start) + step * np.arange(len(table))
    tracks = []
    for j, label in enumerate(names):
        head = heading(label)
        name = head.name if head.unit.lower() in VOLTS else label
        known = name and name not in ("X", "Start", "Increment") and not name.lower().startswith("time")
        if known and np.isfinite(table[:, j]).any():
            unit = units[j] if j < len(units) and np.isnan(_number(units[j])) else ""
            unit = "" if unit.lower() in VOLTS else unit
            tracks.append((with_unit(name, unit), t, table[:, j]))
    return _table(tracks, f"an oscilloscope's table, a sample every {step:g} s")


def _tektronix(lines: Sequence[str]) -> Plain | None:
    """Return the channels of a Tektronix TDS, whose samples stand beside its keys: three columns, time and volts."""
    rows = [[c.strip() for c in line.split(",")] for line in lines if line.strip()]
    tracks = []
    for first in range(0, len(rows[0]) - 4, 6):
        keys = {row[first]: row[first + 1] for row in rows if len(row) > first + 1 and row[first]}
        pairs = np.array([[_number(c) for c in row[first + 3 : first + 5]] for row in rows if len(row) >= first + 5])
        there = np.isfinite(pairs).all(axis=1)
        name = with_unit(keys.get("Source", f"CH{first // 6 + 1}"), keys.get("Vertical Units", ""))
        tracks.append((name, pairs[there, 0], pairs[there, 1]))
    return _table(tracks, "an oscilloscope's table")


# -------------------------------------------------------------------- lists in cells


def _listed(text: str) -> Plain | None:
    """Return a table some cells of which hold lists of numbers, ``"[0.1, 0.2]"``, with a column for each of these,
    called by its place or, where another cell lists as many names, ``"['elbow', 'wrist']"``, by its name.
    """
    head, *rows = [row for row in csv.reader(text.split("\n")) if row]
    if not rows or len(rows[0]) != len(head):
        return None
    lists = {k: _numbers_in(cell) for k, cell in enumerate(rows[0]) if cell.strip().startswith(("[", "("))}
    named = next((k for k, parts in lists.items() if len(parts) > 1 and not any(map(is_number, parts))), None)
    called = lists.pop(named) if named is not None else []
    if not lists:
        return None
    names = []
    for k, name in enumerate(head):
        if k != named:
            by = called if len(called) == len(lists.get(k, ())) else [str(i) for i in range(len(lists.get(k, ())))]
            names += [f"{name}[{i}]" for i in by] if k in lists else [name]
    lines = [",".join(map(header_cell, names))]
    for row in rows:
        order = _numbers_in(row[named]) if named is not None and named < len(row) else called
        good = len(row) == len(head) and sorted(order) == sorted(called)
        cells = []
        for k, cell in enumerate(row):
            parts = _numbers_in(cell) if k in lists else [header_cell(cell)]
            good = good and (k not in lists or len(parts) == len(lists[k]))
            if k in lists and len(parts) == len(called) and order != called and good:
                parts = [parts[order.index(name)] for name in called]
            cells += parts if k != named else []
        lines.append(",".join(cells) if good else "")
    lost = lines.count("")
    told = f"lists in cells, a column for each value: {', '.join(head[k] for k in lists)}"
    return "\n".join(lines), Note(told + (f"; {lost} rows of other lengths are left out" if lost else ""), "format")


def _numbers_in(cell: str) -> list[str]:
    return [part.strip("'\"") for part in re.split(r"[\s,;]+", cell.strip().strip("[]()")) if part]


__all__ = ["plain", "raw_frames"]
