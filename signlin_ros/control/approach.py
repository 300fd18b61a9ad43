"""From where a drive is to where its reference is, without a jump: an offset that goes to zero, limited in its slopes.

Polynomials between given ends (Siciliano et al., Robotics: Modelling, Planning and Control, 2009, sec. 4.2).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from signlin_ros.control.constants import Constants
from signlin_ros.control.designs import Task

Array = NDArray[np.float64]
SHARE = 0.5
"""Share of what a drive can do that an approach asks of it; the rest is left to reference and feedback."""
LEAST_SHARE = 0.05
"""Share of the limit that is taken to be there for an acceleration, even where nothing seems to be left of it."""
TIME_CONSTANTS, MIN_APPROACH_TIME = 4.0, 0.5
"""Time constants of the loop, and s, that an approach lasts at least."""


@dataclass(frozen=True)
class Reach:
    """What an approach may ask for: speed, acceleration, and s that it lasts at least."""

    speed: float
    acceleration: float
    shortest: float

    @classmethod
    def of(cls, c: Constants, task: Task, bandwidth: float) -> Reach:
        """Return what is left of the limit beside friction, load and the largest speed, halved."""
        left = task.limit - abs(c.kS) - abs(c.kG) - abs(c.kV) * task.speed
        strength = max(SHARE * left, LEAST_SHARE * task.limit)
        return cls(SHARE * task.speed, strength / c.kA, max(TIME_CONSTANTS / bandwidth, MIN_APPROACH_TIME))


@dataclass(frozen=True)
class Approach:
    """An offset of a reference, from ``start`` (2,), position and speed, to zero after ``duration`` s."""

    start: tuple[float, float]
    duration: float
    position: bool

    @classmethod
    def begin(cls, start: Array, reach: Reach, position: bool) -> Approach:
        """Return the quickest offset within what may be asked for; without ``position`` that of a speed."""
        q, v = abs(float(start[0])), abs(float(start[1]))
        if not position:
            return cls((0.0, float(start[1])), max(1.5 * v / reach.acceleration, reach.shortest), False)
        from_speed = 3.94 * v  # the quintic's largest second derivatives: 3.94 of a speed, 5.78 of a way
        a = reach.acceleration
        least = (from_speed + math.sqrt(from_speed**2 + 4.0 * a * 5.78 * q)) / (2.0 * a)
        return cls((float(start[0]), float(start[1])), max(least, 1.875 * q / reach.speed, reach.shortest), True)

    def at(self, age: float) -> Array:
        """Return the offset (3,) of position, speed and acceleration at ``age`` s."""
        T = self.duration
        s = min(max(age / T, 0.0), 1.0)
        q, v = self.start
        if age >= T or not (q or v):
            return np.zeros(3)
        if not self.position:
            return np.array([0.0, v * (1.0 - 3.0 * s**2 + 2.0 * s**3), v * (6.0 * s**2 - 6.0 * s) / T])
        way = q * np.array(
            [
                1.0 - 10.0 * s**3 + 15.0 * s**4 - 6.0 * s**5,
                (-30.0 * s**2 + 60.0 * s**3 - 30.0 * s**4) / T,
                (-60.0 * s + 180.0 * s**2 - 120.0 * s**3) / T**2,
            ]
        )
        speed = v * np.array(
            [
                T * (s - 6.0 * s**3 + 8.0 * s**4 - 3.0 * s**5),
                1.0 - 18.0 * s**2 + 32.0 * s**3 - 15.0 * s**4,
                (-36.0 * s + 96.0 * s**2 - 60.0 * s**3) / T,
            ]
        )
        return np.asarray(way + speed)


__all__ = ["Approach", "Reach"]
