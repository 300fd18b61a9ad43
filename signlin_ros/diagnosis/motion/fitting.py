"""From starts to minima: many starts for a few steps at a high gain, the best of them onward to the lower ones."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from signlin_ros.diagnosis.motion.score import level, windowed
from signlin_ros.diagnosis.motion.trials import Parts, Trial, extended
from signlin_ros.effects import EFFECTS
from signlin_ros.fitting.candidate import Candidate
from signlin_ros.fitting.fit import Fit, fit, further
from signlin_ros.fitting.narrow import narrowed
from signlin_ros.fitting.problem import Problem

Array = NDArray[np.float64]
Each = Callable[[Callable[[Any], Any], Sequence[Any]], Iterable[Any]]

FEW, KEPT = 6, 2
"""Starts that are tried where an effect has many, and how many of all go on to the next gain."""
FIRST, NEXT, LAST = 2, 4, 10
"""Steps of a fit from a start, at the middle gain, and to the end."""


@dataclass(frozen=True)
class Found:
    """A minimum: the fit at the gain whose windows are predicted best, these errors (blocks, channels), and the fit at
    the lowest gain, where most shows of what is missing.
    """

    fit: Fit
    known: Array
    low: Fit


def settled(problem: Problem, c: Candidate, starts: Sequence[Array | None], check: Callable[[], None]) -> Found | None:
    """Return a candidate fitted from the best of some starts at all gains but the highest, one after the other;
    ``check`` is called in between, and may raise.
    """
    middle, tried = problem.levels[1], list[Fit]()
    for theta in starts:
        check()
        tried += [f for f in [fit(problem, c, middle, theta, NEXT)] if f]
    best = min(tried, key=_cost, default=None)
    if best is None:
        return None
    fits = [further(problem, best, LAST)]
    for gains in problem.levels[2:]:
        check()
        lower = fit(problem, c, gains, fits[-1].theta, LAST)
        if lower is None:
            break
        fits.append(lower)
    scored = [Found(f, windowed(problem, c, f.theta, f.gains), fits[-1]) for f in fits]
    found = min(scored, key=lambda one: level(one.known, problem.noise))
    if found.fit is found.low:
        return found
    slow = fit(problem, c, found.low.gains, found.fit.theta, 0)  # on the way down a fit may lose what it had
    return replace(found, low=slow) if slow and slow.cost < found.low.cost else found


def without(problem: Problem, f: Fit, covariances: Sequence[Array], index: tuple[int, ...]) -> float:
    """Return by how many standard errors coordinates of added effects differ from nothing, by how much the likelihood
    of the best model falls where they are held there [Wilks 1938, doi:10.1214/aoms/1177732360].

    It does not depend on the units that a parameter is fitted in, as its own standard error does: a friction that is
    known only as a multiple of what scales it is surely there. What correlation the residual has is allowed for by the
    scores' own variance, as in the robust covariance.
    """
    c = f.candidate
    at = {i: _where(c, i) for i in index}
    held = tuple(replace(k, low=at[i], high=at[i]) if i in at else k for i, k in enumerate(c.coordinates))
    theta = f.theta.copy()
    theta[list(at)] = list(at.values())
    best = fit(problem, replace(c, coordinates=held), f.gains, theta, NEXT)
    if best is None:
        return np.inf
    scores = f.hessian @ covariances[-1] @ f.hessian
    correlated = max(1.0, *(float(scores[i, i] / max(f.hessian[i, i], 1e-300)) for i in index))
    return float(np.sqrt(max(best.cost - f.cost, 0.0) / correlated))


def _where(c: Candidate, i: int) -> float:
    """Return the value of a coordinate of an added effect at which that does nothing."""
    name = c.coordinates[i].name
    kind = name.partition(".")[0]
    effect = EFFECTS[c.model.effects[kind].type if kind in c.model.effects else kind]
    return c.coordinates[i].nothing(effect)


def climbed(problem: Problem, before: Fit, trial: Trial, few: int = FEW) -> Fit | None:
    """Return the best fit of one more effect at the middle gain on a part of the records, from some of its starts with
    base parameters as given and as they were fitted before.
    """
    remembers, (high, middle) = bool(EFFECTS[trial.effect].states), problem.levels[:2]
    short = problem.led if remembers else problem.short
    starts, known, parts = _spread(trial.starts, few), before.parameters(), Parts.of(before)
    candidates = [extended(problem, parts, trial, start) for start in starts]
    added = {n: v for n, v in known.items() if any(n.startswith(f"{k}.") or n == k for k in before.candidate.label)}
    ways = [added] if not before.candidate.label else [added, known]
    first = [fit(short, c, high, c.start(way), FIRST) for c in candidates for way in ways]
    best = sorted((f for f in first if f), key=_cost)[:KEPT]
    second = [fit(short, f.candidate, middle, f.theta, NEXT) for f in best]
    if remembers:  # a high gain says little of what is remembered
        second += [fit(short, c, middle, c.start(added), NEXT) for c in candidates]
    return min((f for f in second if f), key=_cost, default=None)


def _spread(starts: Sequence[Mapping[str, float]], few: int) -> list[dict[str, float]]:
    at = np.unique(np.linspace(0, len(starts) - 1, min(few, len(starts))).astype(int)).tolist()
    return [dict(starts[i]) for i in at]


def bred(problem: Problem, before: Fit, trial: Trial, each: Each) -> Fit | None:
    """Return the best fit of an effect with many local minima, from the best of many starts and what they breed."""
    parts, middle = Parts.of(before), problem.levels[1]
    first = extended(problem, parts, trial, trial.starts[0])
    key = first.label[-1]
    starts = narrowed(problem.short, first, trial.starts, key, middle, each)
    fits = (fit(problem, extended(problem, parts, trial, s), middle, None, LAST) for s in starts)
    return min((f for f in fits if f), key=_cost, default=None)


def _cost(f: Fit) -> float:
    return f.cost


__all__ = ["Each", "Found", "bred", "climbed", "settled", "without"]
