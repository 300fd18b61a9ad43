"""The velocity behind a recorded displacement."""

from __future__ import annotations

import functools

import numpy as np
import numpy.typing as npt

from signlin_ros.noise import noise_level

Array = npt.NDArray[np.float64]

LEAST = 6
"""Fewer samples make no spline."""
PIECE = 3000
"""So many samples tell how far to smooth; which costs more than to smooth them all."""
_WEAKEST, _STRONGEST = -6.0, 8.0
"""Powers of ten of the smoothing, times in steps: from every sample met to a straight line through a hundred."""


def slope(t: Array, values: Array) -> tuple[Array, float]:
    """Return the rate (T,) of a quantity (T,) at t (T,) s, and the noise taken out of it, in its unit.

    Cubic smoothing spline, smoothed until it misses the samples by as much as their noise (discrepancy principle;
    [Reinsch, Numer. Math. 10 (1967) 177]): a difference quotient has the noise of two samples over two steps in it,
    10 um at 1 kHz become 7 mm/s. NaN is a missing sample, and stays one.
    """
    from scipy.interpolate import make_smoothing_spline

    good = np.isfinite(values)
    if good.sum() < LEAST:
        return np.asarray(np.gradient(values, t)) if t.size > 1 else np.full(t.size, np.nan), 0.0
    step, sigma = float(np.median(np.diff(t))), noise_level(t, values).sigma
    unit = sigma or float(np.ptp(values[good])) or 1.0
    times, counts = (t[good] - t[0]) / step, values[good] / unit
    smoothing = _smoothing(times, counts) if sigma else 0.0
    rate = make_smoothing_spline(times, counts, lam=smoothing).derivative()((t - t[0]) / step) * unit / step
    return np.where(good, rate, np.nan), sigma


def _smoothing(times: Array, counts: Array) -> float:
    """Return the smoothing that leaves residuals of mean square 1, from the piece that moves most."""
    from scipy.interpolate import make_smoothing_spline
    from scipy.optimize import brentq

    begins = range(0, max(times.size - PIECE, 0) + 1, PIECE // 2)
    first = max(begins, key=lambda k: float(np.std(counts[k : k + PIECE])))
    x, y = times[first : first + PIECE], counts[first : first + PIECE]

    @functools.cache
    def excess(power: float) -> float:
        left = y - make_smoothing_spline(x, y, lam=10.0**power)(x)
        return float(np.log(max(float(np.mean(left**2)), 1e-30)))

    if excess(_STRONGEST) <= 0:
        return float(10.0**_STRONGEST)
    return float(10.0 ** brentq(excess, _WEAKEST, _STRONGEST, xtol=0.05)) if excess(_WEAKEST) < 0 else 0.0


__all__ = ["slope"]
