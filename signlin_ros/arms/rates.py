"""Velocities that are recorded later than the positions beside them: drives filter what they report.

A rigid body is fitted to both at one time. Where a velocity is surely late it is put in time with its position: by a
shift, or by the inverse of a filter, whichever leaves less of the position's rate; where the position is the late one,
it is shifted. No sensor is early.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from signlin_ros.filters import low_pass, slope
from signlin_ros.relative_lag import relative_lag

Array = NDArray[np.float64]
LAG_BAND, WIDE = 0.02, 0.12
"""Parts of the sampling rate: below the first two lags are told apart, noise being above; below the second one all of
the motion is.
"""
UNSURE = 0.5
"""Part of what a velocity leaves as it is below which the usual lag is that of a joint whose own lag is not sure."""
RATE_EDGE_PERIODS = 3.0
"""Periods of a cut-off that are left out at both ends."""
MIN_RATE_AGREEMENT = 0.9
"""Correlation from which on a velocity is the rate of its position, and a factor from which on it is in its unit."""


@dataclass(frozen=True)
class Lags:
    """By how many s velocities are later than positions (n,), and what inverts their filters where these are (n, 2):
    v + a v' + b v''.
    """

    seconds: Array
    inverse: Array

    def in_one_time(self, q: Array, v: Array, step: float) -> tuple[Array, Array]:
        """Return positions and velocities (T, n) at one time: of each joint the late one is moved.

        Less than a sample is a difference of neighbours, which is of the velocity's making.
        """
        q, v = q.copy(), v.copy()
        for i in np.flatnonzero(self.seconds):
            if self.seconds[i] < -step:
                q[:, i] = _earlier(q[:, i], -self.seconds[i], step)
            elif self.inverse[i].any():
                v[:, i] = _sharpened(v[:, i], self.inverse[i], step)
            else:
                v[:, i] = _earlier(v[:, i], self.seconds[i], step)
        return q, v


def lags_of(q: Array, v: Array, step: float) -> Lags:
    """Return by how much velocities (T, n) are later than the rates of positions (T, n), samples ``step`` s apart.

    It is 0 where that is not sure, and where the two have little to do with each other or are in other units, which
    the check of the record says. A jump in one joint's record spoils its own lag and not that of most joints, which
    is taken where it leaves less (in absolute values, in which jumps count little).
    """
    found = np.array([_lag(*pair, step) for pair in zip(q.T, v.T, strict=True)])
    usual = float(np.median(found[found != 0.0])) if found.any() else 0.0
    inverse = np.zeros((len(found), 2))
    for i in range(len(found) if usual else 0):
        rate, shown = slope(q[:, i], step), v[:, i]
        own, other = (_left(rate, _earlier(shown, lag, step), LAG_BAND, step) for lag in (found[i], usual))
        found[i] = usual if other < (own if found[i] else UNSURE * own) else found[i]
        if found[i] > step:
            factors = _inverse(rate, shown, step)
            shifted, sharp = _earlier(shown, found[i], step), _sharpened(shown, factors, step)
            if _left(rate, sharp, WIDE, step) < _left(rate, shifted, WIDE, step):
                inverse[i] = factors
    return Lags(found, inverse)


def _lag(q: Array, v: Array, step: float) -> float:
    lag = relative_lag(q, v, step)
    if not lag:
        return 0.0
    rate, shown = slope(q, step), _earlier(v, lag, step)
    product, power = float(rate @ shown), float(shown @ shown)
    alike = product > MIN_RATE_AGREEMENT * np.sqrt(power * float(rate @ rate))
    return lag if alike and MIN_RATE_AGREEMENT < product / power < 1.0 / MIN_RATE_AGREEMENT else 0.0


def _inverse(rate: Array, v: Array, step: float) -> Array:
    """Return the factors (2,) of a velocity's first and second derivative that bring it nearest a rate (T,)."""
    first, second = _derivatives(v, step)
    below = [_within(low_pass(x, LAG_BAND / step, step), LAG_BAND) for x in (first, second, rate - v)]
    factors, *_ = np.linalg.lstsq(np.stack(below[:2], axis=1), below[2], rcond=None)
    return np.asarray(factors, dtype=float)


def _sharpened(v: Array, factors: Array, step: float) -> Array:
    """Return a velocity (T,) before its filter."""
    first, second = _derivatives(v, step)
    return np.asarray(v + factors[0] * first + factors[1] * second)


def _derivatives(v: Array, step: float) -> tuple[Array, Array]:
    first = slope(low_pass(v, WIDE / step, step), step)
    return first, slope(first, step)


def _left(rate: Array, v: Array, share: float, step: float) -> float:
    """Return the mean absolute distance of a velocity from a rate (T,) below a share of the sampling rate."""
    return float(np.mean(np.abs(_within(low_pass(rate - v, share / step, step), share))))


def _within(values: Array, share: float) -> Array:
    """Return values (T,) without their ends, where filters have not settled."""
    edge = min(int(RATE_EDGE_PERIODS / share), len(values) // 4)
    return values[edge : len(values) - edge]


def _earlier(values: Array, by: float, step: float) -> Array:
    """Return values (T,) as they are some seconds later."""
    k = np.arange(values.size)
    return np.asarray(CubicSpline(k, values)(np.clip(k + by / step, 0, k[-1]))) if by else values


__all__ = ["Lags", "lags_of"]
