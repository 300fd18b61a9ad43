"""Lines with a name before every value, ``t:0.005,u:1.2`` or ``{"t": 0.005, "m": {"u": 1.2}}``, made a table.

What ROS, a serial monitor or a program's log puts in front of a line is its stamp, ``stamp [s]``, from the first one
on. Lines of another kind are left out.
"""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Callable, Iterable, Sequence

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
    r"(?P<value>[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?|[-+]?(?:nan|inf|ovf)\b)"
    r"\s*(?P<unit>(?:[A-Za-zµ°%/]+(?=[,;\s]|\Z))(?!\s*[:=]))?\s*"
)
_FIRST = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)[,;\s]+(?=[A-Za-z_])")
_PREFIX = re.compile(
    r"\s*(?:\[[A-Z]+\]\s*\[(?P<seconds>\d+\.\d+)\](?:\s*\[[^\]]*\])?:?"
    r"|\[?(?:(?P<day>\d{4}-\d\d-\d\d)[ T])?(?P<hour>\d\d):(?P<minute>\d\d):(?P<second>\d\d[.,]\d+)\]?"
    r"(?:\s*[-|:]*\s*\[?[A-Z]{4,8}\]?)?(?:\s*[-|]*\s*\[?[\w.]+\]?(?=\s*[:|-]))?)\s*(?:->|[|:-])?\s*"
)
"""What ROS, a serial monitor or a program's log puts in front of a line: ``[INFO] [1719000000.5] [node]: ``,
``10:05:03.125 -> ``, ``2024-07-01 10:05:03,125 - INFO - ``.
"""
_PAIRS = re.compile(r"[,;\s]*")
LABEL_LINES = 50
"""Lines that tell whether values have labels."""


def labelled(text: str) -> tuple[str, Note] | None:
    """Return rows of labels with values, as ``t:0.005,u:1.2``, or of JSON; other lines are left out, and a last one
    that a crash cut off.
    """
    lines = [line for line in text.split("\n") if line.strip()]
    read: Callable[[str], Labelled | None] = _json if lines and lines[0].lstrip().startswith("{") else _pairs
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
        heads.append(quoted(with_unit(name, unit)))
    lost = len(lines) - len(found)
    said = f"values with labels: {', '.join(heads)}" + (f"; {lost} other lines are left out" if lost else "")
    return table_text(",".join(heads), columns), Note(said, "format")


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
    day = int(np.datetime64(prefix["day"]).astype("datetime64[s]").astype(np.int64)) if prefix["day"] else 0
    whole = day + 3600 * int(prefix["hour"]) + 60 * int(prefix["minute"])
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
    try:
        row = json.loads(line)
    except ValueError:
        return None
    return {name: (value, "") for name, value in leaves(row)} or None if isinstance(row, dict) else None


def table_text(header: str, columns: Iterable[Array]) -> str:
    """Return columns (R,) as lines below a header, empty cells where there is no value."""
    cells = [["" if x != x else repr(x) for x in column.tolist()] for column in columns]
    return "\n".join([header, *map(",".join, zip(*cells, strict=True))]) + "\n"


def quoted(name: str) -> str:
    """Return a name as a cell of a header."""
    return '"' + name.replace('"', "'") + '"' if "," in name else name


def with_unit(name: str, unit: str) -> str:
    """Return a name with its unit, where it has one that it does not state itself."""
    return f"{name} [{unit}]" if unit.strip() and "[" not in name else name


__all__ = ["labelled", "quoted", "table_text", "with_unit"]
