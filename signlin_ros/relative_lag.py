"""By how much a measured velocity lags behind the position beside it: drives filter what they report.

Below a cut-off at which the position tells its own rate, q'(t) = v(t + tau) to the first order of tau is q' - v =
tau v', a regression of one coefficient. Its standard error is that of blocks, since what is left is no white noise.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from signlin_ros.filters import low_pass, sensor_noise, slope
from signlin_ros.noise import derivative_noise

Array = NDArray[np.float64]

CUTOFFS = 0.12 * np.geomspace(1.0, 1e-2, 21)
"""Cut-offs that are tried, as parts of the sampling rate, the widest first,"""
MAX_RATE_NOISE_SHARE = 0.1
"""until noise of the rate is no more than this share of it."""
LAG_ROUNDS, BLOCKS, EDGE_PERIODS = 6, 20, 1.2
"""Times that the lag is taken up before it is asked again; blocks; periods of the cut-off left out at either end."""
MAX_LAG_SAMPLES = 30
"""Lags that are looked at first, in samples."""
AS_ALIKE = 0.99
"""Part of the largest correlation from which on another lag may be the right one."""
MIN_LAG_T = 6.0
"""Standard errors from which on there is a lag: of blocks that are few and not quite independent."""


def relative_lag(q: Array, v: Array, step: float) -> float:
    """Return by how many s a velocity v (T,) lags behind the rate of a position q (T,), samples ``step`` s apart;
    negative where the position is the late one, 0 where that is not sure.
    """
    moves, noise = float(np.std(v)), sensor_noise(q)
    quiet = (f for f in CUTOFFS / step if derivative_noise(noise, 1, f, step) < MAX_RATE_NOISE_SHARE * moves)
    cutoff = next(quiet, None)
    ends = int(EDGE_PERIODS / (CUTOFFS[-1] if cutoff is None else cutoff * step)) + 3
    if cutoff is None or q.size < 4 * ends:
        return 0.0
    rate, shown, k = slope(low_pass(q, cutoff, step), step), low_pass(v, cutoff, step), np.arange(q.size)
    lag, error = step * _most_alike(rate, shown), np.inf
    for _ in range(LAG_ROUNDS):
        moved = np.interp(k + lag / step, k, shown)
        apart, change = (x[ends:-ends] for x in (rate - moved, slope(moved, step)))
        power = float(change @ change)
        if not power:
            return 0.0
        more = float(apart @ change) / power
        starts = np.linspace(0, apart.size, BLOCKS + 1).astype(int)[:-1]
        left = np.add.reduceat((apart - more * change) * change, starts)
        lag, error = lag + more, float(np.sqrt(left @ left)) / power
    return lag if abs(lag) > MIN_LAG_T * error else 0.0


def lag_of_samples(t: Array, q: Array, v: Array) -> float:
    """Return the same of samples at times t (T,) that need not be even: both are read on an even grid of their median
    step.
    """
    step = float(np.median(np.diff(t)))
    even = t[0] + step * np.arange(int((t[-1] - t[0]) / step + 1e-6) + 1)
    return relative_lag(np.interp(even, t, q), np.interp(even, t, v), step)


def _most_alike(rate: Array, shown: Array) -> int:
    """Return by how many samples ``shown`` (T,) lags behind ``rate`` (T,), to the nearest one: where they are most
    alike; what repeats is so at many lags, of which the smallest is taken.
    """
    far = min(MAX_LAG_SAMPLES, rate.size // 10)
    alike = np.correlate(shown - np.mean(shown), (rate - np.mean(rate))[far:-far], "valid")
    return int(min(np.flatnonzero(alike >= AS_ALIKE * alike.max()) - far, key=abs, default=0))


__all__ = ["lag_of_samples", "relative_lag"]
