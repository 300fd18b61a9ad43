"""Output error fit, corrected by an observer: -2 log likelihood of the innovations with an unknown variance for each
channel, sum_c n_c ln(RSS_c / n_c), and priors; by Levenberg and Marquardt's method with analytic sensitivities [Ljung,
System Identification, 1999, ch. 7 and 10; Nocedal and Wright, Numerical Optimization, 2006, ch. 10].
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from signlin_ros.effects import EFFECTS
from signlin_ros.fitting.candidate import Candidate
from signlin_ros.fitting.following import follow_records
from signlin_ros.fitting.gains import ObserverGains
from signlin_ros.fitting.inverses import bounded_step
from signlin_ros.fitting.problem import Problem
from signlin_ros.model import Model

Array = NDArray[np.float64]
MIN_COST_FALL, MIN_RELATIVE_FALL = 0.02, 1e-3
"""A fit ends where -2 log likelihood falls by less than this, or this share of its distance from pure noise's."""
MIN_DAMPING, MAX_DAMPING, ENDLESS = 1e-9, 1e9, 1e100
"""Damping that is none, and from which on a step is none; curvature of a model that diverges: its sensitivities have
run away."""


@dataclass(frozen=True)
class Fit:
    """A fitted candidate: coordinates ``theta`` (n,), ``objective`` (-2 log likelihood with priors), ``count``
    (channels,) of samples, ``innovations`` (T, channels) by segment, and half the objective's ``hessian`` (n, n) and
    ``gradient`` (n,) there.
    """

    candidate: Candidate
    theta: Array
    objective: float
    count: Array
    innovations: tuple[Array, ...]
    hessian: Array
    gains: ObserverGains
    gradient: Array

    def parameters(self) -> dict[str, float]:
        """Return the free parameters by name."""
        return self.candidate.named(self.theta)

    def fitted(self) -> Model:
        """Return the candidate's model with the fitted values; what its sensors add is not part of it."""
        return self.candidate.model_at(self.theta)


def with_positive_amplitudes(f: Fit) -> Fit:
    """Return a fit whose added periodic forces have positive amplitudes and phases within half a turn."""
    theta, signs = f.theta.copy(), np.ones(f.theta.size)
    at = {k.name: i for i, k in enumerate(f.candidate.coordinates)}
    model = f.candidate.model
    for key in f.candidate.label:
        use = model.effects.get(key)
        names = [f"{key}.{name}" for name in (EFFECTS[use.type].turning if use else ())]
        if not names or not set(names) <= set(at):
            continue
        amplitude, phase = (at[name] for name in names)
        unit = f.candidate.coordinates[phase].unit
        if theta[amplitude] < 0:
            theta[amplitude], signs[amplitude] = -theta[amplitude], -1.0
            theta[phase] += np.pi / unit
        theta[phase] -= 2 * np.pi / unit * np.round(theta[phase] * unit / (2 * np.pi))
    return replace(f, theta=theta, hessian=f.hessian * np.outer(signs, signs), gradient=f.gradient * signs)


def _normal(
    problem: Problem, c: Candidate, theta: Array, errors: Sequence[Array], derivatives: Sequence[Array]
) -> tuple[float, Array, Array, Array]:
    """Return cost, number of samples (ny), gradient and Gauss-Newton Hessian."""
    ny, count = c.equations.sizes[2], theta.size
    rss, number = np.zeros(ny), np.zeros(ny)
    squares, products = np.zeros((ny, count, count)), np.zeros((ny, count))
    for E, D in zip(errors, derivatives, strict=True):
        e, d, there = E, D[:, :, :count], np.isfinite(E)
        if not there.all():
            e, d = np.where(there, e, 0.0), np.where(there[: len(d), :, None], d, 0.0)
        number += there.sum(axis=0)
        for k in range(ny):
            rss[k] += e[:, k] @ e[:, k]
            if len(d):
                squares[k] += d[:, k].T @ d[:, k]
                products[k] += e[:, k] @ d[:, k]
    rss = np.maximum(rss, (1e-9 * problem.noise) ** 2 * np.maximum(number, 1))
    prior, slope = c.prior(theta)
    cost = float(np.sum(number * np.log(rss / np.maximum(number, 1))) + np.sum(prior**2))
    weights, slopes = number / rss, c.slopes(theta)
    gradient = slopes * (weights @ products) + prior @ slope
    hessian = np.outer(slopes, slopes) * np.tensordot(weights, squares, 1) + slope.T @ slope
    return cost, number, gradient, hessian


def fit(
    problem: Problem, c: Candidate, gains: ObserverGains, theta: Array | None = None, steps: int = 10
) -> Fit | None:
    """Fit a candidate at one gain, from theta (its own start by default); None if the start diverges."""
    first = evaluated(problem, c, np.clip(c.start() if theta is None else theta, *c.bounds), gains)
    return None if first is None else further(problem, first, steps)


@np.errstate(over="ignore", invalid="ignore", divide="ignore")
def evaluated(problem: Problem, c: Candidate, x: Array, gains: ObserverGains, with_s: bool = True) -> Fit | None:
    """Return a candidate at one point, as if fitted (``with_s``: with its slope); None if it diverges there."""
    found = follow_records(problem, c, x, gains, with_s)
    if found is None:
        return None
    cost, number, gradient, hessian = _normal(problem, c, x, *found[:2])
    if not (np.isfinite(cost) and np.abs(hessian).max(initial=0.0) < ENDLESS):
        return None
    return Fit(c, x, cost, number, tuple(found[0]), hessian, gains, gradient)


@np.errstate(over="ignore", invalid="ignore", divide="ignore")
def further(problem: Problem, f: Fit, steps: int) -> Fit:
    """Go on with a fit for some steps of Levenberg and Marquardt's method. It ends where a step without damping would
    gain nothing either: of what records do not tell, as the scale of all forces on a machine that nothing drives, what
    is known beforehand holds, which damping outweighs. Where that step was refused already, so were all between.
    """
    damping, enough, undamped = 1e-3, MIN_COST_FALL, False
    for _ in range(steps):
        new, gained = _step(f, damping)
        if gained < enough and damping > MIN_DAMPING and not undamped:
            damping = MIN_DAMPING
            new, gained = _step(f, damping)
        if gained < enough:
            break
        undamped |= damping <= MIN_DAMPING
        trial = evaluated(problem, f.candidate, new, f.gains)
        if damping <= MIN_DAMPING and not (trial and trial.objective < f.objective):
            other = _in_proportion(f, new)
            trial = trial if np.array_equal(other, new) else evaluated(problem, f.candidate, other, f.gains)
        if trial is None or not trial.objective < f.objective:
            damping *= 16
            if damping > MAX_DAMPING:
                break
            continue
        gain, f, undamped = f.objective - trial.objective, trial, False
        damping = max(damping / 8, MIN_DAMPING)
        beyond_noise = max(f.objective - float(np.sum(f.count * np.log(problem.noise**2))), 0.0)
        least = MIN_COST_FALL + MIN_RELATIVE_FALL * beyond_noise
        if gain < least:
            if damping <= MIN_DAMPING:
                break
            damping, enough = MIN_DAMPING, least
    return f


def _in_proportion(f: Fit, new: Array) -> Array:
    """Return a step to ``new`` (n,) along which coefficients change in proportion, as inertias do, whose coordinates
    are logarithms: all forces scale together on a straight line.
    """
    change = (new - f.theta) / np.where(f.theta == 0.0, np.inf, f.theta)
    straight = [k.log or abs(share) > 1.0 for k, share in zip(f.candidate.coordinates, change.tolist(), strict=True)]
    return np.asarray(np.clip(np.where(straight, new, f.theta * np.exp(change)), *f.candidate.bounds))


def _step(f: Fit, damping: float) -> tuple[Array, float]:
    """Return the coordinates after a damped step from a fit, and by how much that should lower the objective."""
    new = bounded_step(f.theta, f.gradient, f.hessian, damping, *f.candidate.bounds)
    shift = new - f.theta
    return new, float(-2 * f.gradient @ shift - shift @ f.hessian @ shift)


__all__ = ["Fit", "evaluated", "fit", "further", "with_positive_amplitudes"]
