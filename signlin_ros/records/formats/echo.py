"""Joint states as ``ros2 topic echo --csv`` writes them, made a table with names.

A line has the seconds and nanoseconds of the stamp, the frame, the joints' names, then all positions, velocities and
efforts. Joints are told by their names in every line, never by their order.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from signlin_ros.records.notes import Note

QUANTITIES = ("position", "velocity", "effort")
_WHOLE = re.compile(r"-?\d+\Z")
_NAME = re.compile(r"[A-Za-z][\w./-]*\Z")
_BY_NUMBER = re.compile(r"\bc\d+\b")
BEFORE_NAMES = 3
"""Cells before the joints' names: seconds, nanoseconds, frame."""
MIN_JOINTS = 2
"""Of one joint the columns are told by their numbers, as those of any other topic."""


def joint_states(text: str, asked: Sequence[str] = ()) -> tuple[str, Note] | None:
    """Return such lines as a table with a header, times in s from the first one; None where the text is none.

    asked : what the columns are called by whoever reads them; by their numbers they stay as they are.
    """
    lines = [line for line in text.splitlines() if line.strip()]
    if not lines or any(_BY_NUMBER.search(name) for name in asked):
        return None
    names = _names(lines[0].split(","))
    if names is None:
        return None
    n, start = len(names), int(lines[0].split(",", 1)[0])
    rows = []
    for line in lines:
        cells = line.split(",")
        own = _names(cells)
        if own is None or set(own) != set(names):
            return None
        at = {name: k for k, name in enumerate(own)}
        values = cells[BEFORE_NAMES + n :]
        stamp = int(cells[0]) - start + 1e-9 * int(cells[1])
        ordered = [values[q * n + at[name]] for name in names for q in range(len(QUANTITIES))]
        rows.append(",".join([f"{stamp:.9f}", *ordered]))
    head = ["t [s]", *(f"{name}.{quantity}" for name in names for quantity in QUANTITIES)]
    said = f"joint states as ros2 topic echo writes them: {', '.join(names)}"
    return "\n".join([",".join(head), *rows]) + "\n", Note(said, "format")


def _names(cells: Sequence[str]) -> list[str] | None:
    """Return the joints of a line; None where it is none of joint states with all three quantities."""
    if len(cells) < BEFORE_NAMES + 4 * MIN_JOINTS or not (_WHOLE.match(cells[0]) and _WHOLE.match(cells[1])):
        return None
    n, rest = divmod(len(cells) - BEFORE_NAMES, 1 + len(QUANTITIES))
    names = list(cells[BEFORE_NAMES : BEFORE_NAMES + n])
    told = rest == 0 and n >= MIN_JOINTS and len(set(names)) == n and all(_NAME.match(name) for name in names)
    return names if told else None


__all__ = ["joint_states"]
