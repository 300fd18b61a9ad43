"""Where a drive is by now that was seen some time ago, by its constants and the inputs since then.

Gains hold up to the delay that they are made for; a state that is older is brought up to it (a predictor as in Åström
and Wittenmark, Computer-Controlled Systems, 1997, sec. 12.3, over the part of the delay that the gains do not know of).
"""

from __future__ import annotations

from collections import deque

import numpy as np
from numpy.typing import NDArray

from signlin_ros.control.constants import Constants

Array = NDArray[np.float64]
NANO = 1_000_000_000
KEPT_INPUTS = 200
"""Inputs that are kept."""
STEPS_OF_INPUT = 4
"""Steps of an input's time."""


class DrivePrediction:
    """The inputs of late, each from a time in ns on, and what a drive u = kS sign(v) + kV v + kA a + kP q + kG does."""

    def __init__(self, constants: Constants) -> None:
        self._constants = constants
        self._inputs: deque[tuple[int, float]] = deque(maxlen=KEPT_INPUTS)

    def take(self, now: int, u: float) -> None:
        """Take an input that acts from now on."""
        self._inputs.append((now, u))

    def at(self, measured: Array, since: int, until: int) -> Array:
        """Return position and speed (2,) at ``until`` of a drive that was measured (2,) at ``since``, in ns."""
        q, v = float(measured[0]), float(measured[1])
        times = [max(when, since) for when, _ in self._inputs] + [until]
        for k, (_, u) in enumerate(self._inputs):
            h = (min(times[k + 1], until) - times[k]) / NANO / STEPS_OF_INPUT
            if h <= 0.0:
                continue
            for _ in range(STEPS_OF_INPUT):
                before, v = v, self._moved(q, v, u, h)
                q += h * (before + v) / 2.0
        return np.array([q, v])

    def _moved(self, q: float, v: float, u: float, h: float) -> float:
        """Return the speed after h seconds; dry friction stops a drive, and holds it."""
        c = self._constants
        free = v + h * (u - c.kV * v - c.kP * q - c.kG) / c.kA
        most = h * abs(c.kS) / c.kA
        return 0.0 if abs(free) <= most else free - np.copysign(most, free)


__all__ = ["DrivePrediction"]
