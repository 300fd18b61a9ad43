"""Columns that number the joints (``actual_q_0``, ``q1_meas``, ``joint_1_pos``) as signals of an arm's joints.

Numbers are not names: which joint a number is stands in no record. What is proposed takes them from the base to the
tip, as controllers of arms count, and is for a user to paste.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Sequence

from signlin_ros.robots import Robot

QUANTITY_WORDS = {
    "position": ("q", "pos", "position", "angle", "theta"),
    "velocity": ("qd", "dq", "vel", "velocity", "speed", "omega", "qdot"),
    "effort": ("effort", "torque", "tau", "current", "cur", "i", "trq", "moment"),
}
"""Words in the names of columns that say what they are."""
COMMAND_WORDS = ("target", "desired", "des", "d", "cmd", "command", "ref", "reference", "goal", "set", "control")
"""Words of what was asked for, and not measured."""
_NUMBER = re.compile(r"(?P<before>.*?[^\d]|)(?P<number>\d)(?P<after>(?:[^\d].*|))\Z")


def signals_by_number(columns: Sequence[str], robot: Robot) -> dict[str, str]:
    """Return the columns that number the joints of a chain, as ``JOINT.quantity`` -> column.

    Of each quantity one group of columns must be what was measured; efforts and positions must be there.
    """
    if any(robot.joints[i].parent != before for before, i in itertools.pairwise(robot.sequence)):
        return {}
    names, found = [robot.names[i] for i in robot.sequence], dict[str, str]()
    groups = _groups(columns, robot.n)
    for quantity, words in QUANTITY_WORDS.items():
        own = [group for said, group in groups if set(said) & set(words) and not set(said) & set(COMMAND_WORDS)]
        if len(own) != 1:
            if quantity == "velocity" and not own:
                continue
            return {}
        found |= {f"{name}.{quantity}": column for name, column in zip(names, own[0], strict=True)}
    return found


def _groups(columns: Sequence[str], n: int) -> list[tuple[list[str], list[str]]]:
    """Return the groups of n columns that differ by a number only, from 0 or 1 on: their words, and the columns."""
    found = dict[tuple[str, str], dict[int, str]]()
    for match in filter(None, map(_NUMBER.match, columns)):
        found.setdefault((match["before"], match["after"]), {})[int(match["number"])] = match.string
    whole = [(key, group) for key, group in found.items() if sorted(group) in (list(range(n)), list(range(1, n + 1)))]
    return [(_words(*key), [group[k] for k in sorted(group)]) for key, group in whole]


def _words(before: str, after: str) -> list[str]:
    return [word for word in re.split(r"[^a-z]+", f"{before} {after}".lower()) if word]


def said(columns: Sequence[str], robot: Robot) -> str:
    """Return what is said of a record whose columns number the joints; nothing of others."""
    signals = signals_by_number(columns, robot)
    if not signals:
        return ""
    block = ", ".join(f"{name}: {column}" for name, column in signals.items())
    return f"; its columns number the joints; if they do from the base on, the model file may say signals: {{{block}}}"


__all__ = ["said", "signals_by_number"]
