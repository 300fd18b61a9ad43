"""What a column's head says: a name, a unit, a note. ``force [N] (=gtau*u)`` is ``force``, ``N``,
``(=gtau*u)``.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from signlin_ros import units
from signlin_ros.names import TIME

_BRACKETS = re.compile(r"(?P<gap> ?)(?:\[(?P<square>[^\[\]]*)\]|\((?P<round>[^()]*)\))")
_TIME = re.compile(r"(?P<name>t|time|timestamp|stamp)(?:_(?P<unit>s|sec|ms|us|ns))?\Z", re.IGNORECASE)

TIME_KEYS = frozenset(TIME)
"""Keys that `signals` may map to a file's time column; they are no signals of a model."""


@dataclass(frozen=True)
class Heading:
    """A column's head taken apart: `label` is the whole text, `name` what is left without unit and note."""

    label: str
    name: str
    unit: str = ""

    @property
    def time(self) -> tuple[int, str] | None:
        """For a time column its rank among the known names and its unit (may be empty), else None."""
        match = _TIME.match(self.name)
        if match is None:
            return None
        return TIME.index(match["name"].lower()), self.unit or match["unit"] or ""

    def whole(self, spec: str) -> bool:
        """Whether `spec` is the whole text; white space does not count."""
        return _squeezed(spec) == _squeezed(self.label)

    def bare(self, spec: str) -> bool:
        """Whether `spec` is the text without its note, or without note and unit."""
        return _squeezed(spec) in (_squeezed(self.name), _squeezed(f"{self.name}[{self.unit}]"))

    def matches(self, spec: str) -> bool:
        """Whether the user may call this column `spec`."""
        return self.whole(spec) or self.bare(spec)


def tidy(text: str) -> str:
    """The text stripped, with every run of white space as one blank."""
    return " ".join(text.split())


def clock(headings: Sequence[Heading]) -> Heading | None:
    """The time column among the headings: the first of ``t``, ``time``, ``timestamp``, ``stamp``."""
    times = [head for head in headings if head.time is not None]
    return min(times, key=lambda head: head.time or (9, ""), default=None)


def _squeezed(text: str) -> str:
    return "".join(text.split())


def heading(text: str) -> Heading:
    """Take a header cell apart.

    Square brackets hold a unit where white space precedes them or the unit is known: ``q [0/1]`` and
    ``q[rad]`` have one,
    ``data[0]`` and ``velocity[wheel]`` have none. Round brackets hold a unit only where it is known:
    ``voltage (V)``.
    """
    label = tidy(text)
    for match in _BRACKETS.finditer(label):
        square, unit = match["square"] is not None, (match["square"] or match["round"] or "").strip()
        known = units.parse(unit) is not None and unit != "1"
        spaced = square and bool(match["gap"]) and not unit.isdigit()
        if match.start() and (known or spaced or (square and not unit)):
            return Heading(label, label[: match.start()], unit)
    name = re.sub(r"\s+\(.*\Z", "", label) or label
    return Heading(label, name)
