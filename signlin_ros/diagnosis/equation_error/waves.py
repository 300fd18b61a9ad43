"""Forces that repeat over the position: at which orders what is left of a record does so.

On a rotary axis orders are whole numbers a turn, of the joint or of the motor before its gear; elsewhere any. A wave
must have some periods inside the record, and pass slowly enough for the low-pass.
"""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import NDArray

from signlin_ros.diagnosis.blocks import MIN_DIVISOR
from signlin_ros.diagnosis.equation_error.regression import RegressionData

Array = NDArray[np.float64]

FINEST = 4000
"""Most orders that are looked at for each half period over the travel."""
QUANTILE, MIN_WAVE_SHARE = 0.15, 0.02
"""A wave must pass the filter at this quantile of the speed, and this share of the largest."""
MAX_ORDERS_SHOWN = 3
"""Orders that are told of what is left."""


class Waves:
    """Orders in rad^-1 or m^-1, ``least`` periods of which are held: whole ones of a joint or its motor; or any."""

    def __init__(self, side: RegressionData, whole: bool, gear: float, least: float) -> None:
        self.whole = whole
        self._side, cutoff = side, 2 * np.pi * side.pieces[0].cutoff
        self._q = np.concatenate([p.q[p.kept] for p in side.pieces])
        speed = np.concatenate([np.abs(p.v[p.kept]) for p in side.pieces])
        self._limit = cutoff / np.maximum(speed, MIN_DIVISOR)
        slow = float(np.quantile(speed, QUANTILE)) + MIN_WAVE_SHARE * float(speed.max())
        low, high = least * 2 * np.pi / max(side.travel, MIN_DIVISOR), cutoff / max(slow, MIN_DIVISOR)
        turns = np.arange(1.0, FINEST + 1)
        rows = [turns, turns * gear] if gear != 1.0 else [turns]
        rows = [row[(row >= low) & (row <= high)] for row in rows]
        if not whole:
            rows = [np.arange(low, min(high, FINEST * np.pi / side.travel), 0.8 * np.pi / side.travel)]
        self._rows = [row for row in rows if row.size]
        self.slowest = min((float(row[0]) for row in self._rows), default=np.inf)
        self.finest = max((float(row[-1]) for row in self._rows), default=0.0)

    def strongest(self, left: Array) -> list[float]:
        """Return the orders at which what is left (K,) repeats most, far enough apart to be others."""
        if not self._rows:
            return []
        y = np.concatenate([e - e.mean() for e in self._side.split(left)])
        tried, power = np.concatenate(self._rows), np.concatenate([self._power(y, row) for row in self._rows])
        apart = 3 * np.pi / max(float(np.ptp(self._q)), MIN_DIVISOR)
        found: list[float] = []
        for order in tried[np.argsort(-power)].tolist():
            if all(abs(order - other) > apart for other in found):
                found.append(order)
            if len(found) == MAX_ORDERS_SHOWN:
                break
        return found

    def _power(self, y: Array, row: Array) -> Array:
        """Return how much y (K,) repeats at an even row of orders (N,), where these pass the filter."""
        step = row[1] - row[0] if row.size > 1 else 1.0
        real, imaginary, count = _transformed(self._q, y, self._limit, row[0], step, row.size)
        return np.asarray(np.hypot(real, imaginary) / np.sqrt(count + 0.02 * y.size))


@numba.njit(cache=True)
def _transformed(q: Array, y: Array, limit: Array, first: float, step: float, count: int) -> Array:
    """Return of orders N, ``count`` from ``first`` on, ``step`` apart (3, count): real and imaginary part of
    sum_k y_k exp(-i N q_k) over the samples (K,) with N < ``limit``, and how many these are.

    From one order to the next each sample turns by the same angle.
    """
    found = np.zeros((3, count))
    for k in range(q.size):
        a, b = y[k] * np.cos(first * q[k]), -y[k] * np.sin(first * q[k])
        c, s = np.cos(step * q[k]), -np.sin(step * q[k])
        for j in range(count):
            if first + j * step >= limit[k]:
                break
            found[0, j] += a
            found[1, j] += b
            found[2, j] += 1.0
            a, b = a * c - b * s, a * s + b * c
    return found


__all__ = ["Waves"]
