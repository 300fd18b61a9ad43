"""What ``ros2 topic echo`` writes, made a table with names: messages in YAML, joint states with ``--csv``.

A line of the latter has the seconds and nanoseconds of the stamp, the frame, the joints' names, then all positions,
velocities and efforts. Joints are told by their names in every message, never by their order: ``elbow.position``.
Other fields are called by their way, ``twist.linear.x``, ``data[0]``; a stamp in the header is the time.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from signlin_ros.records.notes import Note

QUANTITIES = ("position", "velocity", "effort")
_WHOLE = re.compile(r"-?\d+\Z")
_NAME = re.compile(r"[A-Za-z][\w./-]*\Z")
_BY_NUMBER = re.compile(r"\bc\d+\b")
BEFORE_NAMES = 3
"""Cells before the joints' names: seconds, nanoseconds, frame."""
MIN_JOINTS = 2
"""Of one joint the columns are told by their numbers, as those of any other topic."""


_MESSAGE = re.compile(r"\A\s*(?:---\n)?[A-Za-z_]\w*:(?: [^\n]*)?\n(?s:.*?)^---[ \t]*$", re.MULTILINE)
"""The first message of several: a key and what it holds, down to the line between messages."""
STAMPS = (("sec", "nanosec"), ("secs", "nsecs"))
"""Fields of a stamp, in ROS 2 and in ROS 1."""


def messages(text: str) -> tuple[str, Note] | None:
    """Return messages in YAML as a table with a header, times in s from the first one; None where the text is none."""
    if not _MESSAGE.match(text[:100_000]):
        return None
    import yaml

    loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
    rows = []
    for part in re.split(r"^---[ \t]*$", text, flags=re.MULTILINE):
        try:
            message = yaml.load(part, loader)  # a safe one, in C where that is built
        except yaml.YAMLError:
            message = None  # the last one, cut off
        if isinstance(message, dict):
            rows.append(dict(_fields(message)))
    names = list(dict.fromkeys(name for row in rows for name in row if name != "t [s]"))
    if len(rows) < 2 or not names:
        return None
    start = next((int(row["t [s]"]) for row in rows if "t [s]" in row), None)
    rows = [row for row in rows if start is None or "t [s]" in row]  # of others nobody knows when they were sent
    head = [*(["t [s]"] if start is not None else []), *names]
    lines = [",".join([*_stamp(row, start), *(str(row.get(name, "")) for name in names)]) for row in rows]
    said = f"messages as ros2 topic echo writes them: {', '.join(names)}"
    return "\n".join([",".join(head), *lines]) + "\n", Note(said, "format")


def _stamp(row: Mapping[str, Any], start: int | None) -> list[str]:
    """Return the time in whole ns of a message as s from the first one; nothing where messages have none."""
    return [] if start is None else [f"{(row['t [s]'] - start) * 1e-9:.9f}"]


def _fields(message: Mapping[str, Any], way: str = "") -> Iterator[tuple[str, float | int]]:
    """Yield the numbers of a message by their names, and its stamp in ns as ``t [s]``."""
    names = message.get("name")
    joints = names if isinstance(names, list) and all(isinstance(name, str) for name in names) else []
    for key, value in message.items():
        if key == "header" and isinstance(value, dict):
            stamp = value.get("stamp", {})
            pairs = [pair for pair in STAMPS if isinstance(stamp, dict) and stamp.keys() >= set(pair)]
            parts = [stamp[key] for key in pairs[0]] if pairs and not way else []
            if parts and all(isinstance(part, int) for part in parts):
                yield "t [s]", parts[0] * 10**9 + parts[1]
        elif isinstance(value, dict):
            yield from _fields(value, f"{way}{key}.")
        elif isinstance(value, list):
            named = len(joints) == len(value)
            parts = [(f"{way}{joints[k]}.{key}" if named else f"{way}{key}[{k}]", one) for k, one in enumerate(value)]
            for name, one in parts:
                if isinstance(one, dict):
                    yield from _fields(one, f"{name}.")
                elif isinstance(one, (int, float)):
                    yield name, one
        elif isinstance(value, (int, float)):
            yield f"{way}{key}", value + 0


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


__all__ = ["joint_states", "messages"]
