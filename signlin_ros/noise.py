"""How large the noise of a measured channel is: white, coloured or from a coarse encoder.

White noise is what remains of a signal after its smooth part is taken out: five neighbours are weighted so that every
cubic vanishes (on an even grid the fourth difference, over sqrt(70)). Coloured noise hides in such differences, 2.8
times too small for an AR(1) with 0.8; how the residual of a model grows apart over 1, 2, ... samples tells its
correlation, n_k = rho n_(k-1) + w:

    E (n_(t+k) - n_t)^2 / 2 = sigma^2 (1 - rho^k),   E (4th difference)^2 / 70 = sigma^2 g(rho),
    g(rho) = (70 - 112 rho + 56 rho^2 - 16 rho^3 + 2 rho^4) / 70.

[Variance of differences: von Neumann et al., Ann. Math. Statist. 12 (1941) 153; variogram: Cressie, Statistics for
Spatial Data, 1993, sec. 2.4.]
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import comb

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

MAX_NOISE_DEVIATIONS = 4.0
"""Differences beyond this many standard deviations belong to the signal (a step), not to the noise."""
NOISE_COLOUR_LAGS = 8
"""How many lags of a residual are looked at for the colour of the noise."""
LEAST_CORRELATION = 0.3
"""A smaller correlation is not told from the imprint of a model that is slightly wrong: the noise counts as white."""
GOOD_FIT = 0.1
"""Largest sum of squared relative errors of the lags at which the picture of an AR(1) is believed."""
COARSE_DIFFERENCES = 10
MAX_PRINTED_DIGITS = 8
"""Significant digits beyond which a printed number is as good as the sensor; many programs print six."""
MAX_DIGIT_ERROR = 1e-4
"""Distance from a whole number of last digits that double precision explains."""
ROUNDING = 1e-15
_RHO = np.arange(0.0, 0.985, 0.01)
MAX_NOISE_SAMPLES_LOOKED = 100_000
"""Samples of a stretch that its noise is taken from, at most."""
STANDSTILL_SHARE = 1e-9
"""Part of its largest value within which a channel stands still."""
FLOOR_ORDERS, NORMAL_QUARTILE, MIN_FLOOR_SAMPLES = (4, 8), 0.6745, 200
"""Orders of the differences that tell white noise; median of the absolute value of a standard normal number; samples
from which on both tell it to a few per cent."""
MAX_FLOOR_DIFFERENCE, MAX_FLOOR_SHARE = 0.15, 0.3
"""By how much they may differ; largest share of a signal that is noise."""
MIN_NOISE_SHARE = 1e-6
"""Least noise of a channel, as a part of what it does."""


@dataclass(frozen=True)
class Noise:
    """Noise of a channel: standard deviation ``sigma`` in its unit, and correlation ``rho`` of neighbouring samples.

    ``quantum`` is the step of the values, 0 where there is none that matters. ``even`` is whether the samples were
    evenly spaced; if not, ``rho`` belongs to the median step, and is approximate.
    """

    sigma: float
    rho: float = 0.0
    quantum: float = 0.0
    even: bool = True

    @property
    def effective(self) -> float:
        """Standard deviation of white noise with the same power at low frequencies."""
        return float(self.sigma * np.sqrt((1 + self.rho) / (1 - self.rho)))


def noise_level(t: Array, y: Array, residual: Array | Sequence[Array] | None = None) -> Noise:
    """Estimate the noise on y (T,) measured at t (T,) s; NaN is a missing sample.

    ``residual`` (T,): what a model leaves of y, or several such, of which the one that claims the least correlation
    counts; without it the noise is taken as white. On white noise the estimate is good to a few per cent.
    """
    good = np.isfinite(y)
    t, y = t[good], y[good]
    if y.size < 6:
        return Noise(0.0)
    steps = np.diff(t)
    even = bool(np.ptp(steps) <= 0.01 * np.median(steps))
    quantum = quantum_of(y)
    residuals = [] if residual is None else [residual] if isinstance(residual, np.ndarray) else list(residual)
    residuals = [r[good] for r in residuals if np.isfinite(r[good]).all()]
    fourth = np.array([_smooth_variance(t, r, 5) for r in (y, *residuals)])
    floor = quantum**2 / 12
    variance = max(float(fourth.min()), floor)
    if variance < (ROUNDING * float(np.abs(y).max())) ** 2:
        return Noise(0.0, even=even)
    found = [rho for rho in (_correlation(r, variance) for r in residuals) if rho is not None]
    if found:  # and so a variance
        second = min(_smooth_variance(t, r, 3) for r in (y, *residuals))
        found.append(_largest(second / variance, y.size))
    rho = min(found, default=0.0)
    rho = round(rho, 2) if rho >= LEAST_CORRELATION else 0.0
    coarse = quantum if floor > 0.01 * variance else 0.0
    return Noise(float(np.sqrt(variance / fourth_difference_share(np.array(rho)))), rho, coarse, even)


def sensor_noise(parts: Sequence[tuple[Array, Array]]) -> Array:
    """Return the standard deviation (ny,) of white noise on channels: t (T,) in s and y (T, ny) of every stretch
    without a gap. Of the sensors alone, no model in it. Jumps of what is measured are left out.
    """
    weights, white = [t.size for t, _ in parts], white_noise([y for _, y in parts])
    levels = [
        [noise_level(t[:MAX_NOISE_SAMPLES_LOOKED], column[:MAX_NOISE_SAMPLES_LOOKED]).sigma for column in y.T]
        for t, y in parts
    ]
    found = np.sqrt(np.average(np.square(levels), axis=0, weights=weights))
    return np.asarray(np.where(found > 0.0, np.minimum(white, found), white))


def white_noise(parts: Sequence[Array]) -> Array:
    """Return the standard deviation (ny,) of white noise on channels y (T, ny), at least a millionth of their own.

    A channel that never moves has one of a millionth of its value, or of its unit.
    """
    everything = np.concatenate(parts)
    noise = np.array([fourth_difference_noise(*pieces) for pieces in zip(*(y.T for y in parts), strict=True)])
    own, value = np.nanstd(everything, axis=0), np.nanmax(np.abs(everything), axis=0)
    least = np.where(moving(everything), own, np.where(value > 0, value, 1.0))
    return np.asarray(np.maximum(noise, MIN_NOISE_SHARE * least))


def fourth_difference_noise(*pieces: Array) -> float:
    """Return the standard deviation of white noise on pieces (T,) of a smooth signal: sqrt(mean of (4th difference)^2
    / 70). Where one piece ends and another begins, nothing is smooth.
    """
    differences = np.concatenate([np.diff(values[np.isfinite(values)], 4) for values in pieces])
    return float(np.sqrt(np.mean(differences**2) / 70)) if differences.size else 0.0


def white_floor(values: Array) -> float:
    """Return the standard deviation of white noise on a measured signal (T,) that is smooth beside it; 0 where what
    changes from sample to sample is no such noise: a command in steps, a motion as fast as the samples, a signal that
    is little else.

    Differences of different orders tell the same of white noise; their medians pass over seldom steps.
    """
    found = values[np.isfinite(values)]
    if found.size < MIN_FLOOR_SAMPLES:
        return 0.0
    sizes = [float(np.median(np.abs(np.diff(found, k)))) / np.sqrt(comb(2 * k, k)) for k in FLOOR_ORDERS]
    low, high = sizes[0] / NORMAL_QUARTILE, sizes[1] / NORMAL_QUARTILE
    alike = abs(low - high) <= MAX_FLOOR_DIFFERENCE * high
    return high if alike and high <= MAX_FLOOR_SHARE * float(np.std(found)) else 0.0


def derivative_noise(level: float, order: int, cutoff: float, step: float) -> float:
    """Return the standard deviation of the ``order``-th derivative of white noise below ``cutoff`` Hz."""
    power = 2 * order + 1
    return float(level * np.sqrt(2 * step * cutoff**power / power) * (2 * np.pi) ** order)


def moving(values: Array) -> NDArray[np.bool_]:
    """Return which columns of values (T, ny) ever move."""
    return np.asarray(np.nanstd(values, axis=0) > STANDSTILL_SHARE * np.nanmax(np.abs(values), axis=0))


def quantum_of(y: Array) -> float:
    """Return the step of values (T,) that come in whole multiples of one; 0 where they do not.

    Digits of a printed number are no encoder: most neighbouring values must lie within `COARSE_DIFFERENCES` steps.
    """
    steps = np.diff(np.unique(y))
    steps = steps[steps > 1e-9 * np.ptp(y)]
    if steps.size < 2:
        return float(steps[0]) if steps.size else 0.0
    quantum = float(np.median(steps[steps < 1.5 * steps.min()]))
    multiples = steps / quantum
    close = multiples < COARSE_DIFFERENCES
    whole = np.abs(multiples - np.round(multiples)) < 0.1
    return quantum if close.mean() > 0.9 and whole[close].mean() > 0.98 else 0.0


def steps_shown(y: Array) -> Array:
    """Return the step (T,) in which each of the values y (T,) is shown: that of `quantum_of`, or that of its last digit
    where all are printed with so many significant digits or fewer, as many programs do by default.
    """
    exponent = np.floor(np.log10(np.maximum(np.abs(y), np.finfo(float).tiny))) + 1.0
    for digits in range(1, MAX_PRINTED_DIGITS + 1):
        last = 10.0 ** (exponent - digits)
        multiples = y / last
        if np.all(np.abs(multiples - np.round(multiples)) < MAX_DIGIT_ERROR):
            return np.asarray(np.maximum(quantum_of(y), np.where(y == 0.0, 0.0, last)))
    return np.full(y.shape, quantum_of(y))


def fourth_difference_share(rho: Array) -> Array:
    """Return g(rho): the share of an AR(1)'s variance that fourth differences see."""
    return np.asarray((70 - 112 * rho + 56 * rho**2 - 16 * rho**3 + 2 * rho**4) / 70)


def _clipped(values: Array) -> float:
    """Return the mean square of values without those beyond `MAX_NOISE_DEVIATIONS` robust standard deviations."""
    size = np.abs(values)
    limit = MAX_NOISE_DEVIATIONS * float(np.median(size)) / NORMAL_QUARTILE
    kept = values[size <= limit] if limit > 0 else values
    return float(np.mean(kept**2))


def _largest(ratio: float, samples: int) -> float:
    """Return the largest correlation that the ratio of the variances from second and fourth differences allows.

    What is smooth raises the ratio and never lowers it; on pure noise its logarithm is good to 0.75 / sqrt(samples).
    """
    expected = np.log((6 - 8 * _RHO + 2 * _RHO**2) / 6 / fourth_difference_share(_RHO))
    return float(_RHO[expected <= np.log(max(ratio, 1e-12)) + 2.5 * 0.75 / np.sqrt(samples)].max(initial=0.0))


def _smooth_variance(t: Array, y: Array, points: int) -> float:
    """Return the variance of white noise on y (T,): so many neighbours weighted that smooth curves vanish.

    Three points take out straight lines, five take out cubics, whatever the spacing of t.
    """
    windows = np.lib.stride_tricks.sliding_window_view
    times, values = windows(t, points).T, windows(y, points).T
    gaps = times[:, None] - times + np.eye(points)[:, :, None]
    weights = 1.0 / np.prod(gaps / np.median(np.diff(t)), axis=1)
    weights /= np.linalg.norm(weights, axis=0)
    return _clipped(np.sum(weights * values, axis=0))


def smooth_noise(t: Array, y: Array) -> float:
    """Return the standard deviation of white noise on y (T,) at t (T,) s, of what five neighbours differ by alone."""
    return float(np.sqrt(_smooth_variance(t, y, 5)))


def _correlation(residual: Array, variance: float) -> float | None:
    """Return the correlation rho that explains how a residual (T,) grows apart; None where none does.

    What a wrong model adds is smooth: it grows with the square of the lag.
    """
    k = np.arange(1, NOISE_COLOUR_LAGS + 1)
    if residual.size < 10 * NOISE_COLOUR_LAGS or variance <= 0:
        return None
    apart = np.array([_clipped(residual[i:] - residual[:-i]) / 2 for i in k])
    if not apart.all():
        return None
    noise = variance / fourth_difference_share(_RHO)[:, None] * (1 - _RHO[:, None] ** k)
    weight = k**2 / apart
    smooth = np.maximum(0.0, np.sum(weight * (1 - noise / apart), axis=1) / np.sum(weight**2))
    misfit = np.sum(((noise + smooth[:, None] * k**2) / apart - 1) ** 2, axis=1)
    best = int(np.argmin(misfit))
    return float(_RHO[best]) if misfit[best] < GOOD_FIT else None


__all__ = [
    "NORMAL_QUARTILE",
    "Noise",
    "derivative_noise",
    "fourth_difference_noise",
    "fourth_difference_share",
    "moving",
    "noise_level",
    "quantum_of",
    "sensor_noise",
    "smooth_noise",
    "steps_shown",
    "white_noise",
]
