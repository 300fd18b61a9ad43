"""Least absolute errors of free runs: what is most likely where errors are few and large, as Laplace's distribution has
them, because a loop sticks elsewhere than its model; by iteratively reweighted least squares, damped as Levenberg and
Marquardt do [Bloomfield and Steiger, Least Absolute Deviations, 1983; Ljung, System Identification, 1999, ch. 15].
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from signlin_ros.fitting.candidate import Candidate
from signlin_ros.fitting.following import follow_records
from signlin_ros.fitting.inverses import bounded_step
from signlin_ros.fitting.problem import Problem

Array = NDArray[np.float64]
ABSOLUTE_STARTS, APART = 8, 0.15
"""Starts of a fit, since a run that sticks has many local minima, and how far apart they are, in coordinates, or of
their standard error of the prior where that is less."""
MAX_ABSOLUTE_STEPS, MIN_OBJECTIVE_FALL, MAX_DAMPING = 25, 1e-3, 1e6
"""Most steps of a fit; the fall of -2 log likelihood at which it ends; damping from which on a step is none."""


def heavy_tailed(errors: Sequence[Array]) -> bool:
    """Tell whether errors (T, channels) of records are rather Laplace's than normal: by the likelihood of both."""
    e = np.concatenate(errors)
    laplace = np.log(2.0 * np.nanmean(np.abs(e), axis=0)) + 1.0
    normal = 0.5 * (np.log(2.0 * np.pi * np.nanmean(e**2, axis=0)) + 1.0)
    return bool(np.nansum(laplace - normal) < 0.0)


def least_absolute(problem: Problem, c: Candidate, theta: Array, seed: int = 1) -> Array:
    """Return the coordinates (n,) at which free runs err least in the mean of absolute values, from some coordinates
    and from others around them.
    """
    g, spread = np.random.default_rng(seed), np.array([k.spread for k in c.coordinates])
    around = g.standard_normal((ABSOLUTE_STARTS - 1, theta.size)) * np.minimum(APART, spread)
    found = [_descended(problem, c, np.clip(theta + step, *c.bounds)) for step in (np.zeros(theta.size), *around)]
    return min((f for f in found if f), key=lambda f: f[0], default=(0.0, theta))[1]


def _descended(problem: Problem, c: Candidate, theta: Array) -> tuple[float, Array] | None:
    """Return -2 log likelihood of Laplace's distribution, with priors, where a descent ends, and the place."""
    now, damping = _normal(problem, c, theta), 1e-3
    for _ in range(MAX_ABSOLUTE_STEPS if now else 0):
        if now is None or damping > MAX_DAMPING:
            break
        new = bounded_step(theta, now[1], now[2], damping, *c.bounds)
        trial = _normal(problem, c, new)
        if trial is None or not trial[0] < now[0]:
            damping *= 10.0
            continue
        gained, theta, now, damping = now[0] - trial[0], new, trial, max(damping / 8.0, 1e-9)
        if gained < MIN_OBJECTIVE_FALL:
            break
    return (now[0], theta) if now else None


def _normal(problem: Problem, c: Candidate, theta: Array) -> tuple[float, Array, Array] | None:
    """Return -2 log likelihood, half its gradient (n,) and half of a reweighted Hessian (n, n); None: it diverges."""
    found = follow_records(problem, c, theta, problem.observer_gains[-1], True)
    if found is None:
        return None
    e, D = np.concatenate(found[0]), np.concatenate([d[:, :, : theta.size] for d in found[1]]) * c.slopes(theta)
    there = np.isfinite(e)
    size = np.maximum(np.abs(np.where(there, e, 0.0)), problem.noise)
    mean = np.array([size[there[:, k], k].mean() for k in range(e.shape[1])])
    weights = np.where(there, 1.0 / (size * mean), 0.0)
    prior, slope = c.prior(theta)
    cost = float(2.0 * there.sum(axis=0) @ np.log(mean) + prior @ prior)
    columns = np.where(there[:, :, None], D, 0.0).reshape(-1, theta.size)
    weighted = columns.T * weights.ravel()
    gradient = weighted @ np.where(there, e, 0.0).ravel() + prior @ slope
    hessian = weighted @ columns + slope.T @ slope
    finite = np.isfinite(cost) and np.isfinite(gradient).all() and np.isfinite(hessian).all()
    return (cost, gradient, hessian) if finite else None


__all__ = ["heavy_tailed", "least_absolute"]
