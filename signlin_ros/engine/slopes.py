"""Slopes of samples by polynomials of least squares, compiled."""

# Numba infers the types in here; mypy cannot see through its decorators.
# mypy: allow-untyped-defs, allow-untyped-calls, disable-error-code="misc"

from __future__ import annotations

import numpy as np

from signlin_ros.engine.compiling import compiled
from signlin_ros.engine.parts import factor, substitute


@compiled
def slope_at_end(t, values, degree):
    """Return the slope at the last sample of the least-squares polynomial (degree 1 or 2) through all samples."""
    size, n = t[-1] - t[0], degree + 1
    w = np.zeros(n * n + 2 * n)
    pivots, right = n * n, n * n + n
    for k in range(t.size):
        age, value = (t[k] - t[-1]) / size, values[k] - values[-1]
        for i in range(n):
            w[right + i] += age**i * value
            for j in range(n):
                w[i * n + j] += age ** (i + j)
    factor(w, 0, pivots, n)
    substitute(w, 0, pivots, right, n)
    return w[right + 1] / size


@compiled
def causal_slopes(t, values, window, degree, least, slopes):
    """Fill ``slopes`` (T,) with `slope_at_end` of the last ``window`` seconds, at least ``least`` samples."""
    first = 0
    for k in range(t.size):
        while k - first >= least and t[first] < t[k] - window:
            first += 1
        if k > first:
            slopes[k] = slope_at_end(t[first : k + 1], values[first : k + 1], min(degree, k - first))


__all__ = ["causal_slopes", "slope_at_end"]
