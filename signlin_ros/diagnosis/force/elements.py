"""Compiled loops of the force witness."""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@numba.njit(cache=True)
def jenkin(q: Array, widths: Array) -> Array:  # pragma: no cover - compiled
    """Return springs (T, w) in series with sliders: each follows q (T,) and slips at its half width."""
    s = np.zeros((q.size, widths.size))
    for k in range(1, q.size):
        d = q[k] - q[k - 1]
        for j in range(widths.size):
            s[k, j] = min(max(s[k - 1, j] + d, -widths[j]), widths[j])
    return s


@numba.njit(cache=True)
def waves(q: Array, y: Array, limit: Array, first: float, step: float, count: int) -> Array:  # pragma: no cover
    """Return of orders N, ``count`` from ``first`` on, ``step`` apart (3, count): real and imaginary part of
    sum_k y_k exp(-i N q_k) over the samples (T,) with N < ``limit``, and how many these are.

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


@numba.njit(cache=True)
def passed(sections: Array, state: Array, values: Array, back: bool) -> None:  # pragma: no cover - compiled
    """Pass columns (T, c) through the sections (s, 6) of a filter, numerator first, forward or ``back``, in place; from
    its state (s, 2, c) on, which is carried along.
    """
    for at in range(len(values)):
        k = len(values) - 1 - at if back else at
        for i in range(len(sections)):
            b, a = sections[i, :3], sections[i, 3:]
            for j in range(values.shape[1]):
                x = values[k, j]
                values[k, j] = y = b[0] * x + state[i, 0, j]
                state[i, 0, j] = b[1] * x - a[1] * y + state[i, 1, j]
                state[i, 1, j] = b[2] * x - a[2] * y


__all__ = ["jenkin", "passed", "waves"]
