"""The velocity behind a recorded displacement."""

from __future__ import annotations

import functools

import numpy as np
import numpy.typing as npt

from signlin_ros.held import held
from signlin_ros.noise import noise_level

Array = npt.NDArray[np.float64]

MIN_SPLINE_SAMPLES = 6
"""Fewer samples make no spline."""
MIN_RATE_SAMPLES, MAX_HELD_SHARE, MIN_HELD_RATE_GAIN = 100, 0.7, 50.0
"""Samples that tell whether a rate was held; the largest share that held rates may leave of what smooth ones do; and by
how much -2 log likelihood must be less with them if it is more."""
PIECE = 3000
"""So many samples tell how far to smooth; which costs more than to smooth them all."""
_WEAKEST, _STRONGEST = -6.0, 8.0
"""Powers of ten of the smoothing, times in steps: from every sample met to a straight line through a hundred."""


def rate_of(t: Array, values: Array, effort: Array | None = None) -> tuple[Array, float, bool]:
    """Return the rate (T,) of a quantity (T,) at t (T,) s, the noise taken out of it, in its unit, and whether it is
    one that was held from sample to sample, as an ``effort`` (T,) that goes with it tells.
    """
    smooth, noise = slope(t, values)
    steps = None if effort is None else held_slope(t, values, smooth, effort)
    return (smooth, noise, False) if steps is None else (steps, noise, True)


def slope(t: Array, values: Array) -> tuple[Array, float]:
    """Return the rate (T,) of a quantity (T,) at t (T,) s, and the noise taken out of it, in its unit.

    Cubic smoothing spline, smoothed until it misses the samples by as much as their noise (discrepancy principle;
    [Reinsch, Numer. Math. 10 (1967) 177]): a difference quotient has the noise of two samples over two steps in it,
    10 um at 1 kHz become 7 mm/s. NaN is a missing sample, and stays one. What is held counts where it is new.
    """
    from scipy.interpolate import make_smoothing_spline

    good = np.isfinite(values)
    if good.sum() < MIN_SPLINE_SAMPLES:
        return np.asarray(np.gradient(values, t)) if t.size > 1 else np.full(t.size, np.nan), 0.0
    slower = held(values)
    new = good & ~slower.repeated(t.size) if slower else good
    step, sigma = float(np.median(np.diff(t[new]))), noise_level(t[new], values[new]).sigma
    unit = sigma or float(np.ptp(values[good])) or 1.0
    times, counts = (t[new] - t[0]) / step, values[new] / unit
    smoothing = _smoothing(times, counts) if sigma else 0.0
    rate = make_smoothing_spline(times, counts, lam=smoothing).derivative()((t - t[0]) / step) * unit / step
    return np.where(good, rate, np.nan), sigma


def held_slope(t: Array, values: Array, smooth: Array, effort: Array) -> Array | None:
    """Return the rate (T,) of a quantity (T,) whose rate is held from sample to sample, where the effort (T,) that goes
    with it asks for that; None where the ``smooth`` rate (T,) explains the effort as well.

    A spline through what was led by held rates is half a step late: a damper c would also look like an inertia of
    c step/2. Effort, and its change from sample to sample, are regressed on the quantity, its rate and the rate's sign:
    one must ask for held rates clearly, the other not against them, as it does where a hysteresis lags; or both surely.
    """
    steps = np.diff(t)
    rate = np.append(np.diff(values) / steps, np.nan) if t.size > 1 else np.full(t.size, np.nan)
    there = np.isfinite(rate) & np.isfinite(smooth) & np.isfinite(values) & np.isfinite(effort)
    if np.count_nonzero(there) < MIN_RATE_SAMPLES:
        return None
    features = [np.column_stack([values, v, np.sign(v)])[there] for v in (smooth, rate)]
    levels = [_left(f - f.mean(axis=0), effort[there] - effort[there].mean()) for f in features]
    changes = [_left(np.diff(f, axis=0), np.diff(effort[there])) for f in features]
    shares = [after / max(before, 1e-300) for before, after in (levels, changes)]
    clearly = min(shares) < MAX_HELD_SHARE or max(shares) < np.exp(-MIN_HELD_RATE_GAIN / np.count_nonzero(there))
    if not clearly or max(shares) > 1.0:
        return None
    rate[-1] = rate[-2]
    return np.where(np.isfinite(values), rate, np.nan)


def _left(features: Array, effort: Array) -> float:
    """Return the mean square of an effort (T,) that features (T, k) leave."""
    features = features / np.maximum(np.abs(features).max(axis=0), 1e-300)
    return float(np.mean((effort - features @ np.linalg.lstsq(features, effort, rcond=None)[0]) ** 2))


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


__all__ = ["held_slope", "rate_of", "slope"]
