"""A free run: the exact simulation of a stretch from an initial state that is estimated, held against all of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from signlin_ros.errors import SimulationError
from signlin_ros.follow.data import cut
from signlin_ros.follow.tracking import Tracker, mean, mean_square
from signlin_ros.model import Model
from signlin_ros.simulation import simulate

Array = NDArray[np.float64]

FIRST_PART = 2.0
"""The initial state is fitted to so many seconds first, then to the whole stretch."""
DIVERGED_RATIO = 1e3
"""A run that goes so many times further than anything measured has diverged for all purposes."""
EVALUATIONS = 12
PRIOR = 3.0
"""The reach of an initial state is so many standard deviations of what is known of it beforehand."""
MIN_START_SAMPLES = 50
"""An initial state is fitted to at least so many samples."""
MAX_START_FIT_SAMPLES = 200_000
"""Samples beyond which a record tells no more of its start."""


@dataclass(frozen=True)
class FreeRun:
    """States (T, n) and channels (T, ny) of a free run from x0 (n,); ``why`` is empty unless it failed."""

    x0: Array
    states: Array
    shown: Array
    why: str = ""


def free_run(tracker: Tracker, rough: Array, reach: Array, noise: Array) -> FreeRun:
    """Run freely from the best initial state found; ``rough`` (n,) is the first measured one, ``reach`` (n,) how far
    from it the true one may be, ``noise`` (ny,) that of the channels. It is never worse than the run from ``rough``.
    """
    first = max(int(np.searchsorted(tracker.t, tracker.t[0] + FIRST_PART)), MIN_START_SAMPLES)
    near = fitted_start(tracker, rough, reach, noise, first)
    candidates = [fitted_start(tracker, near, reach, noise, min(tracker.t.size, MAX_START_FIT_SAMPLES)), near, rough]
    runs = [_simulated(tracker, x0) for x0 in candidates]
    good = [run for run in runs if not run.why]
    return min(good, key=lambda run: _cost(tracker, run.shown)) if good else runs[-1]


def fitted_start(tracker: Tracker, start: Array, reach: Array, noise: Array, samples: int) -> Array:
    """Return the initial state (n,) whose free run is closest to the first samples, in units of the noise (ny,).

    It is looked for from ``start`` (n,), no further than ``reach`` (n,) away; what the samples do not tell stays.
    """
    part = slice(0, samples)
    t, u, y = tracker.t[part], tracker.u[part], tracker.y[part]
    short = Tracker(tracker.model, t, u, y, tracker.channels, tracker.scale, cut(tracker.early, part))
    unit = np.maximum(noise, 1e-6 * np.sqrt(_variances(short)))

    def errors(shift: Array) -> Array:
        e = short.run(start + shift * reach).innovation / unit
        left = np.where(np.isfinite(short.y), np.nan_to_num(e, nan=DIVERGED_RATIO / 1e-6), 0.0)
        return np.concatenate([left.ravel(), PRIOR * shift])

    found = least_squares(errors, np.zeros(start.size), bounds=(-1.0, 1.0), diff_step=1e-4, max_nfev=EVALUATIONS)
    return np.asarray(start + found.x * reach)


def _simulated(tracker: Tracker, x0: Array) -> FreeRun:
    model: Model = tracker.model
    nothing = np.full((tracker.t.size, len(model.states)), np.nan)
    try:
        states = _states(tracker, x0)
    except SimulationError as error:
        return FreeRun(x0, nothing, np.full(tracker.y.shape, np.nan), str(error).removeprefix(f"{model.source}: "))
    shown = tracker.outputs(states)
    size = np.max(np.abs(np.nan_to_num(tracker.y)), axis=0)
    beyond = np.flatnonzero((np.abs(shown) > DIVERGED_RATIO * np.where(size > 0, size, np.inf)).any(axis=1))
    why = f"the free run leaves all that was measured {DIVERGED_RATIO:g} times behind" if beyond.size else ""
    return FreeRun(x0, states, shown, why + (f" at t = {tracker.t[beyond[0]]:.6g} s" if why else ""))


def _states(tracker: Tracker, x0: Array) -> Array:
    """Return the states (T, n) of the exact simulation; an imposed motion needs no search for where it sticks."""
    if tracker.model.plant.velocity not in tracker.model.states:
        run = tracker.run(x0)
        if run.stopped is None:
            return run.state
    return simulate(tracker.model, tracker.t, tracker.u, x0, acts=tracker.acts).x


def _cost(tracker: Tracker, shown: Array) -> float:
    """Return the mean square error in variances of the channels, summed over them."""
    return float(np.sum(mean_square(tracker.y - shown) / _variances(tracker)))


def _variances(tracker: Tracker) -> Array:
    """Return the variances of the channels (ny,), 1 where one does not move or is not measured."""
    square = mean_square(tracker.y - mean(tracker.y))
    return np.where((square > 0) & np.isfinite(square), square, 1.0)


__all__ = ["MIN_START_SAMPLES", "FreeRun", "fitted_start", "free_run"]
