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


__all__ = ["jenkin"]
