"""Families of commands: each is one kind of motion at several sizes in one record, since the size decides as much as
the kind. What the effects' own texts ask for is among them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from signlin_ros.effects import EFFECTS
from signlin_ros.experiment.parts import Part

PEAK_PARTS = (0.45, 0.7, 1.0)
"""Parts of the peak at which a family's motion is repeated in one record."""
LADDER = tuple(float(x) for x in np.geomspace(0.03, 1.0, 11))
"""Peaks that are tried, as parts of the largest input, the quietest first."""


@dataclass(frozen=True)
class Family:
    """A kind of command: its name, its parts with a peak of 1, and the families that it is mixed or made of."""

    name: str
    parts: tuple[Part, ...]
    of: tuple[Family, ...] = ()

    @property
    def texts(self) -> tuple[str, ...]:
        """The effects whose texts ask for it."""
        if self.of:
            return tuple(dict.fromkeys(name for one in self.of for name in one.texts))
        return tuple(name for name, effect in EFFECTS.items() if effect.command == self.name)

    def at(self, peak: float) -> tuple[Part, ...]:
        """Return its parts at a peak."""
        return tuple(replace(p, peak=p.peak * peak) for p in self.parts)


def _repeated(kind: str, frequency: float, sizes: Sequence[float] = PEAK_PARTS, **more: float) -> tuple[Part, ...]:
    return tuple(Part(kind, size, frequency, **more) for size in sizes)


COMMAND_FAMILIES = (
    Family("slow triangles", _repeated("triangle", 0.8)),
    Family("slow ramps through standstill", _repeated("triangle", 0.4, (0.5, 1.0))),
    Family("staircase", (Part("staircase", 0.5, 0.3), Part("staircase", 1.0, 0.3, 1.5))),
    Family("steps with rests", _repeated("steps", 0.8)),
    Family("fast steps", _repeated("steps", 3.0)),
    Family("creep to and fro", _repeated("creep", 0.5)),
    Family("sines that grow", _repeated("sine", 1.0)),
    Family("fast sines that grow", _repeated("sine", 4.0)),
    Family("chirps", _repeated("chirp", 8.0)),
    Family("slow chirps", _repeated("chirp", 2.5)),
    Family("multisines", _repeated("multisine", 6.0)),
    Family("releases", (Part("release", 0.6), Part("release", -0.6), Part("release", 1.0), Part("release", -1.0))),
    Family("long holds", (Part("hold", 1.0), Part("hold", -1.0), Part("hold", 0.5), Part("hold", -0.5))),
)
"""Every kind of command; an effect says in its `Effect.command` which of them shows it."""


def mixed(first: Family, second: Family) -> Family:
    """Return a family with the larger motions of two, one after the other."""
    parts = (*first.parts[-2:], *second.parts[-2:])
    return Family(f"{first.name}, then {second.name}", parts, (first, second))


__all__ = ["COMMAND_FAMILIES", "LADDER", "Family", "mixed"]
