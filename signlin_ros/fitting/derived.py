"""Is a recorded velocity a measurement of its own, or was it computed from the recorded position?

Most drives have an encoder only: the velocity is its difference, and its noise the position's. That of a sensor of its
own cannot be foretold to better than its noise. What was filtered faster than it was logged, less well, but it errs on.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from signlin_ros.model import Model
from signlin_ros.noise import noise_level
from signlin_ros.records import ModelData
from signlin_ros.relative_lag import lag_of_samples

Array = NDArray[np.float64]

DIFFERENCES_COMBINED, PAST_VELOCITIES, SAMPLES_PER_COEFFICIENT = 8, 2, 10
"""Differences and past velocities that a velocity may be a combination of; samples for each coefficient."""
FORETOLD = 0.1
"""Part of the velocity's noise, and of what its neighbours foretell, beneath which it is foretold by the position."""
FILTER_REACH, MAX_DERIVED_SAMPLES = 60, 20_000
"""Differences of the position before and after a sample that a filter may have gone through, and samples looked at."""
NEARLY, FINE, MAX_OWN_SHARE, MIN_RATE_DISTANCE = 0.02, 0.05, 0.5, 2.5
"""A velocity was filtered if wide combinations of differences leave less than this share of it, if noise of the
position makes less than that share of a single difference, if of what is left no more is white noise than that, and if
it leads elsewhere than the position by more than so many times what noise in both would."""
MAX_UNTOLD_LAG = 2.0
"""Samples beyond which it is told by how much a derived velocity lags."""


def without_derived(model: Model, records: Sequence[ModelData], channels: tuple[str, ...]) -> tuple[str, ...]:
    """Return the channels without the velocity, if it was computed from the position in every record."""
    position, velocity = model.plant.position, model.plant.velocity
    both = position in channels and velocity in channels
    signals = [(r.t, r.measured[position], r.measured[velocity]) for r in records] if both else []
    if not signals or not (all(_is_derived(*s) for s in signals) or all(_is_filtered(*s) for s in signals)):
        return channels
    return tuple(name for name in channels if name != velocity)


def lag(model: Model, records: Sequence[ModelData]) -> float:
    """Return by how many s a velocity computed from the position lags behind its rate (median)."""
    q, v = model.plant.position, model.plant.velocity
    found = [lag_of_samples(*_shown(r.t, r.measured[q], r.measured[v])) for r in records]
    return float(np.median(found))


def _shown(t: Array, q: Array, v: Array) -> tuple[Array, Array, Array]:
    """Return times, positions and velocities (T,) where both were measured, no more than are looked at."""
    there = np.flatnonzero(np.isfinite(q) & np.isfinite(v))[:MAX_DERIVED_SAMPLES]
    return t[there], q[there], v[there]


def _is_derived(t: Array, q: Array, v: Array) -> bool:
    """Tell whether a velocity v (T,) is a combination of differences of q (T,) nearby, and of its own past."""
    rows, slopes = np.arange(DIFFERENCES_COMBINED, t.size - DIFFERENCES_COMBINED), np.diff(q) / np.diff(t)
    own = np.column_stack([v[rows - k] for k in range(1, PAST_VELOCITIES + 1)])
    both = np.column_stack([*(slopes[rows + k] for k in range(-DIFFERENCES_COMBINED, DIFFERENCES_COMBINED)), own])
    there = np.isfinite(both).all(axis=1) & np.isfinite(v[rows])
    if np.count_nonzero(there) < SAMPLES_PER_COEFFICIENT * (2 * DIFFERENCES_COMBINED + PAST_VELOCITIES):
        return False
    left, without = (np.sqrt(np.mean(_rest(basis[there], v[rows][there]) ** 2)) for basis in (both, own))
    return bool(left < FORETOLD * min(without, noise_level(t, v).sigma))


def _is_filtered(t: Array, q: Array, v: Array) -> bool:
    """Tell whether v (T,) is a wide filter of a fine position q (T,), but for a rest that leads elsewhere."""
    t, q, v = _shown(t, q, v)
    reach = min(FILTER_REACH, t.size // 40)
    if reach < DIFFERENCES_COMBINED:
        return False
    noise, step = noise_level(t, q).sigma, np.median(np.diff(t))
    walk = noise_level(t, v).sigma * np.sqrt(step * (t[-1] - t[0]) / 6)
    apart = np.cumsum((v[1:] + v[:-1]) / 2 * np.diff(t)) - q[1:]
    if np.sqrt(2) * noise > FINE * np.std(v) * step or np.std(apart) < MIN_RATE_DISTANCE * np.hypot(noise, walk):
        return False
    slopes, rows = np.diff(q) / np.diff(t), np.arange(reach, t.size - 1 - reach)
    near = np.lib.stride_tricks.sliding_window_view(slopes, 2 * reach)[: rows.size]
    rest = _rest(near, v[rows])
    size = float(np.std(rest))
    return bool(size < NEARLY * np.std(v)) and noise_level(t[rows], rest).sigma < MAX_OWN_SHARE * size


def _rest(basis: Array, target: Array) -> Array:
    """Return the residual of a target (T,) after linear regression on columns (T, k) and a constant."""
    columns = np.hstack([basis, np.ones((target.size, 1))])
    return np.asarray(target - columns @ np.linalg.lstsq(columns, target, rcond=None)[0])


__all__ = ["MAX_UNTOLD_LAG", "lag", "without_derived"]
