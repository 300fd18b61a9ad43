"""Is a recorded velocity a measurement of its own, or was it computed from the recorded position?

Drives log both, but most have an encoder only: the velocity is its difference, averaged or filtered. Its noise is then
the position's, and whoever takes both for independent finds errors that go together, which no model leaves by chance. A
velocity of a sensor of its own cannot be foretold from the position to better than its own noise.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from signlin_ros.model import Model
from signlin_ros.noise import noise_level
from signlin_ros.records import ModelData

Array = NDArray[np.float64]

REACH = 8
"""Differences of the position before and after a sample that its velocity may be a combination of."""
OWN = 2
"""Velocities before a sample that a recursive filter may use."""
FORETOLD = 0.1
"""Part of the velocity's noise, and of what its neighbours foretell, beneath which it is foretold by the position."""


def without_derived(model: Model, records: Sequence[ModelData], channels: tuple[str, ...]) -> tuple[str, ...]:
    """Return the channels without the velocity, if it was computed from the position in every record."""
    position, velocity = model.plant.position, model.plant.velocity
    both = position in channels and velocity in channels
    if not both or not all(_is_derived(r.t, r.measured[position], r.measured[velocity]) for r in records):
        return channels
    return tuple(name for name in channels if name != velocity)


def _is_derived(t: Array, q: Array, v: Array) -> bool:
    """Tell whether a velocity v (T,) is a linear combination of differences of the position q (T,) nearby, and of what
    it was just before; NaN is a missing sample.
    """
    rows = np.arange(REACH, t.size - REACH)
    if rows.size < 10 * (2 * REACH + OWN):
        return False
    slopes = np.diff(q) / np.diff(t)
    near = np.column_stack([slopes[rows + k] for k in range(-REACH, REACH)])
    own = np.column_stack([v[rows - k] for k in range(1, OWN + 1)])
    there = np.isfinite(near).all(axis=1) & np.isfinite(own).all(axis=1) & np.isfinite(v[rows])
    near, own, target = near[there], own[there], v[rows][there]
    if target.size < 10 * (2 * REACH + OWN):
        return False
    left, without = (_left(basis, target) for basis in (np.hstack([near, own]), own))
    return left < FORETOLD * min(without, noise_level(t, v).sigma)


def _left(basis: Array, target: Array) -> float:
    """Return the RMS of what a linear combination of columns leaves of a target (T,)."""
    columns = np.hstack([basis, np.ones((target.size, 1))])
    rest = target - columns @ np.linalg.lstsq(columns, target, rcond=None)[0]
    return float(np.sqrt(np.mean(rest**2)))


__all__ = ["without_derived"]
