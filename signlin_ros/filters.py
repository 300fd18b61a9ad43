"""The low-pass of the equation-error estimate, slopes, and the noise of a sensor that goes through them."""

from __future__ import annotations

import functools

import numba
import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, sosfilt_zi

from signlin_ros.noise import quantum_of

Array = NDArray[np.float64]

BUTTERWORTH_ORDER = 4
"""Order of the Butterworth low-pass."""
THREE = 3
"""Samples that are taken together to see coloured noise."""
NYQUIST = 0.45
"""Part of the sampling rate from which on nothing is left to filter."""
DIFFERENCES = 16
"""Fourth differences from which a noise is told."""
ROUNDED = 1e-12
"""Part of a value that arithmetic makes of what stands still, and no sensor does."""
OUTLYING, SMOOTH_RATIO = 5.0, 0.25
"""Times the median of a jump; part of coarse differences below which fine ones tell of a smooth signal."""


def low_pass(values: Array, cutoff: float, step: float) -> Array:
    """Return values (T, ...) without what is faster than ``cutoff`` Hz, and without a phase shift."""
    if cutoff >= NYQUIST / step:
        return values
    pad = min(len(values) - 1, int(3 / (step * cutoff)))
    before, after = 2 * values[:1] - values[pad:0:-1], 2 * values[-1:] - values[-2 : -pad - 2 : -1]
    found = np.ascontiguousarray(np.concatenate([before, values, after]))
    (sections, settled), columns = _sections(cutoff, step), found.reshape(len(found), -1)
    for back in (False, True):
        _pass(sections, settled[:, :, None] * columns[-back], columns, back)
    return found[pad : pad + len(values)]


@numba.njit(cache=True)
def _pass(sections: Array, state: Array, values: Array, back: bool) -> None:
    """Pass columns (T, c) through sections (s, 6), numerator first, in place; from their ``state`` (s, 2, c) on."""
    for at in range(len(values)):
        k = len(values) - 1 - at if back else at
        for i in range(len(sections)):
            b, a = sections[i, :3], sections[i, 3:]
            for j in range(values.shape[1]):
                x = values[k, j]
                values[k, j] = y = b[0] * x + state[i, 0, j]
                state[i, 0, j] = b[1] * x - a[1] * y + state[i, 1, j]
                state[i, 1, j] = b[2] * x - a[2] * y


@functools.lru_cache(maxsize=64)
def _sections(cutoff: float, step: float) -> tuple[Array, Array]:
    """Return the low-pass, and the state (sections, 2) in which it rests at 1."""
    sections = np.asarray(butter(BUTTERWORTH_ORDER, cutoff, fs=1 / step, output="sos"))
    return sections, np.asarray(sosfilt_zi(sections))


def slope(values: Array, step: float) -> Array:
    """Return the derivative (T,), exact to the sixth power of the step."""
    y = np.gradient(values, step)
    a, b, c = (values[3 + k : len(values) - 3 + k or None] - values[3 - k : -3 - k] for k in (1, 2, 3))
    y[3:-3] = (45 * a - 9 * b + c) / (60 * step)
    return np.asarray(y)


def sensor_noise(values: Array) -> float:
    """Return the standard deviation of white noise that leaves as much at low frequencies as a sensor's noise: of
    fourth differences, and those of means of three, in which coloured noise shows; at least that of a sensor's steps.
    """
    means = values[: values.size // THREE * THREE].reshape(-1, THREE).mean(axis=1)
    fine, coarse = _fourth(values), np.sqrt(THREE) * _fourth(means)
    level = max(fine, coarse) if fine > SMOOTH_RATIO * coarse else fine
    return float(max(level, quantum_of(values) / np.sqrt(12)))


def _fourth(values: Array) -> float:
    d = np.diff(values, 4)
    if d.size < DIFFERENCES:
        return 0.0
    size = np.abs(d)
    usual, rounded = float(np.median(size)), ROUNDED * float(np.abs(values).max())
    if usual > rounded:
        return float(np.sqrt(np.mean(d[size <= OUTLYING * usual] ** 2) / 70))
    return float(np.sqrt(np.mean(d**2) / 70))  # what is held for long has none: all that changes tells of it then


__all__ = ["low_pass", "sensor_noise", "slope"]
