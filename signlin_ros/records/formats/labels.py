"""Lines with a name before every value, ``t:0.005,u:1.2`` or ``{"t": 0.005, "m": {"u": 1.2}}``, made a table.

What ROS, a serial monitor or a program's log puts in front of a line is its stamp, ``stamp [s]``, from the first one
on. Lines of another kind are left out.
"""

from __future__ import annotations

import datetime as dt
import json
import re
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from typing import Any

import numpy as np
import numpy.typing as npt

from signlin_ros.records.formats.objects import leaves
from signlin_ros.records.notes import Note
from signlin_ros.units import conversion

Array = npt.NDArray[np.float64]
Labelled = dict[str, tuple[float, str]]
"""Names of a line's values, each with its number and its unit."""

_LABELLED = re.compile(
    r"\s*(?P<name>[A-Za-z_][\w./\[\]]*)\s*[:=]\s*"
    r"(?P<value>[-+]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?|[-+]?(?:nan|inf|ovf)\b)"
    r"\s*(?P<unit>(?:[A-Za-zµ°%/]+(?=[,;\s]|\Z))(?!\s*[:=]))?\s*"
)
_PART = re.compile(
    r"\s*(?P<name>[^\W\d][^:=,;]*?)\s*[:=]\s*(?P<value>[-+]?(?:\d+(?:[.,]\d*)?|[.,]\d+)(?:[eE][-+]?\d+)?|[-+]?(?:nan|inf|ovf)\b)"
    r"\s*(?P<unit>[^\s\d:=][^\s:=]*)?\s*"
)
"""A label with blanks, a value and a unit, between marks: ``Motor speed: 12.5 rpm``."""
_FIRST = re.compile(r"\s*([-+]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?)[,;\s]+(?=[A-Za-z_])")
_PREFIX = re.compile(
    r"\s*(?:\[[A-Z]+\]\s*\[(?P<seconds>\d+\.\d+)\](?:\s*\[[^\]]*\])?:?"
    r"|\[?(?:(?P<day>\d{4}-\d\d-\d\d)[ T])?(?P<hour>\d\d):(?P<minute>\d\d):(?P<second>\d\d[.,]\d+)\]?"
    r"(?:\s*[-|:]*\s*\[?[A-Z]{4,8}\]?)?(?:\s*[-|]*\s*\[?[\w.]+\]?(?=\s*[:|-]))?)\s*(?:->|[|:-])?\s*"
)
"""What ROS, a serial monitor or a program's log puts in front of a line: ``[INFO] [1719000000.5] [node]: ``,
``10:05:03.125 -> ``, ``2024-07-01 10:05:03,125 - INFO - ``.
"""
_TOPIC = re.compile(r"Z?\s*([\w/.-]*[A-Za-z][\w/.-]*)\s+(?=\{)")
"""A topic in front of an object, as a client of MQTT prints it."""
_NUMBER = r"(?:[-+]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?|[-+]?nan)"
_VALUES = re.compile(rf"{_NUMBER}(?:(?:\s*[,;\t]\s*| +){_NUMBER})*")
ENDS_OF_PREFIX = (">", "|", ":", "-", "]")
"""What stands between a stamp in front of a line and its values: else it is a cell of a table."""
_MEMBER = re.compile(r"<(?:\w+\.)*(\w+): [^<>]*>")
_WRAPPED = re.compile(r"\bnp\.\w+\(([^()]*)\)")
_PYTHON = re.compile(r"\b(?:True|False|None|nan|inf)\b")
"""How Python shows the member of an enumeration, a number of NumPy's, and what JSON writes otherwise."""
_PAIRS = re.compile(r"[,;\s]*")
LONGEST_LABELLED = 200
"""Characters of a line of one label and its value."""
LABEL_LINES = 50
"""Lines that tell whether values have labels."""


def labelled(text: str) -> tuple[str, Note] | None:
    """Return rows of labels with values, as ``t:0.005,u:1.2``, or of JSON; other lines are left out, and a last one
    that a crash cut off.
    """
    lines = [line for line in text.split("\n") if line.strip()]
    read: Callable[[str], Labelled | None] = (
        _json if any(line.rstrip().endswith("}") for line in lines[-2:]) else _pairs
    )
    looked = [read(line) for line in lines[-LABEL_LINES:]]
    good = [one for one in looked if one]
    if len(lines) < 3 or len(good) < 0.8 * len(looked) or len(good[0]) < 2:
        return None
    found = [one for one in map(read, lines) if one]
    cut = not text.endswith("\n") and len(found) > 1 and _cut(found[-1], found[-2])
    found = _from_first(found[:-1] if cut else found)
    names = list(dict.fromkeys(name for one in found for name in one))
    columns, heads = [], []
    for name in names:
        values, unit = _of_label([one.get(name) for one in found])
        columns.append(values)
        heads.append(header_cell(with_unit(name, unit)))
    lost = len(lines) - len(found)
    said = f"values with labels: {', '.join(heads)}" + (f"; {lost} other lines are left out" if lost else "")
    return table_text(",".join(heads), columns), Note(said, "format")


def stamped(text: str) -> tuple[str, Note] | None:
    """Return lines of values behind the stamps of a serial monitor or a log, ``10:05:03.125 -> 1.2,0.3``, as a table
    with these in front; None where they are none, or the stamp is a cell of its own.
    """
    lines = [line for line in text.split("\n") if line.strip()]
    if sum(_after(line) is not None for line in lines[:LABEL_LINES]) < 0.8 * len(lines[:LABEL_LINES]):
        return None
    found = [one for one in map(_after, lines) if one is not None]
    rows = [(match, rest) for match, rest in found if _VALUES.fullmatch(rest)]
    if len(rows) < max(3, 0.8 * len(lines)):
        return None
    mark = next((mark for mark in ("\t", ";", ",") if mark in rows[0][1]), " ")
    first, width = _stamp(rows[0][0]), len(rows[0][1].split(None if mark == " " else mark))
    heads = [rest for match, rest in found[:3] if not _VALUES.fullmatch(rest)]
    named = [head for head in heads if len(head.split(None if mark == " " else mark)) == width]
    head = named[-1] if named else mark.join(f"c{k + 2}" for k in range(width))
    body = [f"{(_stamp(match) - first) * 1e-9:.9f}{mark}{rest}" for match, rest in rows]
    lost = len(lines) - len(rows) - len(named)
    said = "values behind the stamps of a monitor or a log" + (f"; {lost} other lines are left out" if lost else "")
    return "\n".join([f"t{mark}{head}", *body]) + "\n", Note(said, "format")


def blocks(text: str) -> tuple[str, Note] | None:
    """Return lines of one label with a value each, ``Bus Voltage:  12.1 V``, as rows that end where a label returns;
    None where they are none.
    """
    lines = [line for line in text.split("\n") if line.strip()]
    if any(len(line) > LONGEST_LABELLED for line in lines[:LABEL_LINES]):
        return None
    looked = [_PART.fullmatch(line) for line in lines[:LABEL_LINES]]
    labels = Counter(match["name"] for match in looked if match)
    if sum(labels.values()) < 0.8 * len(looked) or len(labels) < 2 or max(labels.values()) < 2 or "---" in lines:
        return None
    rows: list[dict[str, str]] = []
    for match in (_PART.fullmatch(line[:LONGEST_LABELLED]) for line in lines):
        if match is not None and (not rows or match["name"] in rows[-1]):
            rows.append({})
        if match is not None:
            rows[-1][match["name"]] = match[0].strip()
    found = labelled("\n".join(";".join(row.values()) for row in rows) + "\n")
    if found is None:
        return None
    return found[0], Note(f"a line for each value, a row wherever the first label returns; {found[1]}", "format")


def _after(line: str) -> tuple[re.Match[str], str] | None:
    """Return the stamp in front of a line, and what stands behind it; None where there is none."""
    match = _PREFIX.match(line)
    there = match is not None and match[0].rstrip().endswith(ENDS_OF_PREFIX)
    return (match, line[match.end() :].strip()) if match is not None and there else None


def _cut(last: Labelled, before: Labelled) -> bool:
    """Tell whether a last line has fewer labels, or units, than the one before it."""
    return {k: u for k, (_, u) in last.items()} != {k: u for k, (_, u) in before.items()}


def _of_label(cells: Sequence[tuple[float, str] | None]) -> tuple[Array, str]:
    """Return the values (R,) of a label in the unit that most of them state, and that unit; NaN where there is none, or
    one in a unit of something else.
    """
    stated = Counter(cell[1] for cell in cells if cell is not None)
    unit = stated.most_common(1)[0][0]
    factors = {one: 1.0 if one == unit else (conversion(one, unit) or (np.nan, ""))[0] for one in stated}
    return np.array([np.nan if cell is None else cell[0] * factors[cell[1]] for cell in cells]), unit


def _pairs(line: str) -> Labelled | None:
    """Return names, numbers and units of a line of nothing else."""
    found, at = Labelled(), 0
    if bare := _FIRST.match(line):
        found["c1"], at = (float(bare[1]), ""), bare.end()
    parts = [_PART.fullmatch(part) for part in re.split(";" if ";" in line else "[,\t]", line.strip().rstrip(",;"))]
    if len(parts) > 1 and all(parts):
        return {m["name"]: (_value(m["value"].replace(",", ".")), m["unit"] or "") for m in parts if m}
    if prefix := _PREFIX.match(line):
        found["stamp"], at = (_stamp(prefix), "s"), prefix.end()
    while at < len(line.rstrip()):
        match = _LABELLED.match(line, at)
        if match is None:
            return None
        found[match["name"]] = _value(match["value"]), match["unit"] or ""
        between = _PAIRS.match(line, match.end())
        at = between.end() if between else match.end()
    return found if found.keys() - {"c1", "stamp"} else None


def _stamp(prefix: re.Match[str]) -> int:
    """Return the time in ns that a program puts in front of a line: since 1970, or of the day."""
    if prefix["seconds"]:
        return _nanoseconds(prefix["seconds"])
    try:
        day = dt.date.fromisoformat(prefix["day"]).toordinal() if prefix["day"] else 0
    except ValueError:  # no day of a calendar
        day = 0
    whole = 86400 * day + 3600 * int(prefix["hour"]) + 60 * int(prefix["minute"])
    return 10**9 * whole + _nanoseconds(prefix["second"].replace(",", "."))


def _nanoseconds(seconds: str) -> int:
    whole, _, part = seconds.partition(".")
    return 10**9 * int(whole) + int(part[:9].ljust(9, "0"))


def _from_first(rows: Sequence[Labelled]) -> list[Labelled]:
    """Return rows with stamps in front of their lines (whole ns) in s from the first one."""
    first = next((row["stamp"][0] for row in rows if isinstance(row.get("stamp", (0.0, ""))[0], int)), None)
    if first is None:
        return list(rows)
    return [{**row, "stamp": ((row["stamp"][0] - first) * 1e-9, "s")} if "stamp" in row else row for row in rows]


def _value(cell: str) -> float:
    """Return a number; NaN for what a microcontroller prints where it has none."""
    return np.nan if cell[-1] in "nf" else float(cell)


def _json(line: str) -> Labelled | None:
    prefix = _PREFIX.match(line)
    rest = line[prefix.end() :] if prefix else line
    topic = _TOPIC.match(rest)
    row = _object(rest[topic.end() :] if topic else rest)
    stamp: Labelled = {"stamp": (_stamp(prefix), "s")} if prefix else {}
    before = f"{topic[1]}." if topic else ""
    found: Labelled = {before + name: (value, "") for name, value in leaves(row)} if isinstance(row, dict) else {}
    return {**stamp, **found} if found else None


def _object(text: str) -> Any:
    """Return what JSON, or what Python shows, ``{'t': 0.1, <Register.MODE: 0>: 10}``, holds; None of other text."""
    with suppress(ValueError):
        return json.loads(text)
    text = _MEMBER.sub(r'"\1"', _WRAPPED.sub(r"\1", text.replace("'", '"')))
    words = {"True": "true", "False": "false", "None": "null", "nan": "NaN", "inf": "Infinity"}
    with suppress(ValueError):
        return json.loads(_PYTHON.sub(lambda match: words[match[0]], text))
    return None


def table_text(header: str, columns: Iterable[Array]) -> str:
    """Return columns (R,) as lines below a header, empty cells where there is no value."""
    cells = [["" if x != x else repr(x) for x in column.tolist()] for column in columns]
    return "\n".join([header, *map(",".join, zip(*cells, strict=True))]) + "\n"


def header_cell(name: str) -> str:
    """Return a name as a cell of a header."""
    return '"' + name.replace('"', "'") + '"' if "," in name else name


def with_unit(name: str, unit: str) -> str:
    """Return a name with its unit, where it has one that it does not state itself."""
    return f"{name} [{unit}]" if unit.strip() and "[" not in name else name


__all__ = ["blocks", "header_cell", "labelled", "stamped", "table_text", "with_unit"]
