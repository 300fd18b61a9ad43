"""Names that mean the same in every model file and record, and in every verb and page."""

from __future__ import annotations

import re

PROGRESS_ASKED = "SIGNLIN_PROGRESS"
"""Variable of the environment that says that a program, no terminal, reads what is told of progress."""
TIME_NAMES = ("t", "time", "timestamp", "stamp")
"""What the time column of a record may be called, in the order in which it is looked for."""

AS_GIVEN, REFITTED_ROW, SENSOR_NOISE_ROW, MISSING_FORCE_ROW = (
    "model as given",
    "refitted",
    "noise of the sensors",
    "missing force",
)
"""The first rows by which models are told apart, the same in every verb, and the last; and what stands in every group
beside the channels."""
AT_NOISE_RATIO = 1.1
"""Times the noise of a channel up to which an error is no larger than it."""

PROPER_NAMES = {
    "bouc_wen": "Bouc-Wen",
    "coulomb": "Coulomb",
    "dahl": "Dahl",
    "lugre": "LuGre",
    "maxwell": "Maxwell",
    "stribeck": "Stribeck",
}
"""Proper names in the names of effects, and how they are printed."""
_PROPER = re.compile(rf"(?<![a-z])(?:{'|'.join(PROPER_NAMES)})(?![a-z])")


def printed_name(name: str) -> str:
    """Return the name of an effect as it is printed, ``Bouc-Wen hysteresis`` for ``bouc_wen_hysteresis``; the name of
    its joint stays as it is, ``wrist_2.Coulomb friction``.
    """
    joint, dot, own = name.rpartition(".")
    return joint + dot + _PROPER.sub(lambda found: PROPER_NAMES[found[0]], own).replace("_", " ")


def capitalised(text: str) -> str:
    """Return a text that begins with a capital; others in it stay."""
    return text[:1].upper() + text[1:]


__all__ = [
    "AS_GIVEN",
    "AT_NOISE_RATIO",
    "MISSING_FORCE_ROW",
    "PROPER_NAMES",
    "REFITTED_ROW",
    "SENSOR_NOISE_ROW",
    "TIME_NAMES",
    "capitalised",
    "printed_name",
]
