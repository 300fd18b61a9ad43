"""What laws are called, and what is known of one that was found."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
DELAY, GAIN, ZERO, TILT = "sensor_delay", "sensor_gain", "joint_zero", "tilt"
"""Names of the laws that an effort is recorded later than the motion, that it shows another size than what acts, that a
position is counted from elsewhere than in the URDF, and that the base stands otherwise than the file says.
"""
SEEN_ELSEWHERE = ("compliant_load", GAIN)
"""Laws of a joint that others may show: bodies that fit a wrong gain of one joint are wrong for its neighbours.

No model that is written has them: a gain is taken out of the efforts first, an elastic gear has states of its own.
"""
BODIES_IMITATE = ("payload", ZERO)
"""Laws that bodies far from those of the URDF imitate: they stand where they relieve these, not where unseen rows gain.
"""


@dataclass(frozen=True)
class Key:
    """What a law is called: its effect and joint; of the robot: ``payload``, ``tilt`` or ``coupling``, at -1."""

    law: str
    at: int
    shape: float = 0.0

    def same(self, other: Key) -> bool:
        """Tell whether two laws are one, whatever their shapes."""
        return (self.law, self.at) == (other.law, other.at)


@dataclass(frozen=True, eq=False)
class SearchResult:
    """A law that stands: its columns, coefficients with standard errors, unseen RMS (n,) before and after, rivals."""

    key: Key
    names: tuple[str, ...]
    values: Array
    errors: Array
    before: Array
    after: Array
    worth: float
    rivals: tuple[Key, ...] = ()


def names_of(key: Key) -> tuple[str, ...]:
    """Return the names of a law's columns."""
    if key.law == "payload":
        return ("payload.m", "payload.mx", "payload.my", "payload.mz")
    return ("tilt.x", "tilt.y") if key.law == TILT else (f"{key.at}.{key.law}",)


__all__ = ["BODIES_IMITATE", "DELAY", "GAIN", "SEEN_ELSEWHERE", "TILT", "ZERO", "Key", "SearchResult", "names_of"]
