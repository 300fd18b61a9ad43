"""Effects with many local minima, as of what makes and breaks contact: many starts, and what is bred of the best."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from operator import attrgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from signlin_ros.diagnosis.blocks import MIN_DIVISOR
from signlin_ros.diagnosis.output_error.fitting import LAST_STEPS, MIDDLE_STEPS, log_mse_of_windows
from signlin_ros.diagnosis.output_error.trials import CandidateParts, Trial, completed
from signlin_ros.fitting.candidate import Candidate
from signlin_ros.fitting.fit import Fit, evaluated, fit
from signlin_ros.fitting.gains import ObserverGains
from signlin_ros.fitting.problem import Problem

Array = NDArray[np.float64]
Each = Callable[[Callable[[Any], Any], Sequence[Any]], Iterable[Any]]

FOLLOWED_FIRST, FOLLOWED_BESIDE, PARENTS, CHILDREN, EVOLVED_KEPT = 64, 16, 10, 24, 4
"""Of an effect with many minima: starts that get a few steps, and how many of them do first; no more do, and nothing is
bred, beside other effects or where these are all less likely than a rival; points that others are bred of, how many of
these in each generation, and how many points a fit starts from."""
GENERATIONS = (0.15, 0.15, 0.05)
"""How far a load may wander in a second for the observer of each generation, the first one of starts: one that trusts a
wrong load loses it, and what it leaves then says nothing of which way the right one lies."""
FEWEST_PARENTS = 3
"""Points of which another is bred."""
MAX_BEYOND_STARTS = 1.0
"""How far beyond all starts a point may get (log): an observer may make of it a disturbance that it follows."""
DIFFERENCE, JITTER = 0.7, 0.15
"""Part of the difference of two points that is added to a third one, and the spread of what is drawn besides (log)."""


def evolved_fit(
    problem: Problem, before: Fit, trial: Trial, each: Each, rival: float = np.inf, seed: int = 0
) -> Fit | None:
    """Return the best fit of an effect with many local minima, as of what makes and breaks contact: the best of its
    positive starts get a few steps, and so do points that are bred of these [differential evolution: Storn and Price,
    J. Global Optimization 11 (1997) 341, doi:10.1023/A:1008202821328]; the best of all are fitted. As long as all are
    less likely than a ``rival`` of that objective at the same gain, though the observer moves the load for them, no
    more are followed than a few, and nothing is bred of these. ``seed``: of what is drawn; from 1 on the starts are
    shifted, too [Cranley and Patterson, SIAM J. Numer. Anal. 13 (1976) 904].
    """
    parts, (high, middle) = CandidateParts.of(before), problem.observer_gains[:2]
    c = parts.extended(trial.name, trial.starts[0]).candidate(problem)
    own = {k.name: i for i, k in enumerate(c.coordinates) if k.name.partition(".")[0] == c.label[-1]}
    index = {n: own[f"{c.label[-1]}.{n}"] for n in trial.starts[0] if f"{c.label[-1]}.{n}" in own}

    draw, logs = np.random.default_rng(seed), np.log([[start[n] for n in index] for start in trial.starts])
    low, size = logs.min(axis=0), np.ptp(logs, axis=0)

    def real(f: Fit) -> bool:
        values = _values(c, index, f.theta)
        within = np.all(np.abs(np.log(values) - low - size / 2.0) <= size / 2.0 + MAX_BEYOND_STARTS)
        return bool(within) and trial.effect.plausible({**trial.starts[0], **dict(zip(index, values, strict=True))})

    def followed(wander: float, steps: int, thetas: Sequence[Array]) -> list[Fit]:
        one = replace(c, load_wander=wander)
        run = each(lambda theta: _followed(problem, one.apart(), theta, high, steps), thetas)
        return sorted((f for f in run if f and real(f)), key=attrgetter("objective"))

    if seed:
        logs = low + np.mod(logs - low + draw.random(len(index)) * size, np.maximum(size, MIN_DIVISOR))
    first = [_at(c, index, c.start(), values) for values in np.exp(logs).tolist()]
    beside = bool(before.candidate.label)
    began = [f.theta for f in followed(GENERATIONS[0], 0, first)[:FOLLOWED_FIRST]]
    points = followed(GENERATIONS[0], MIDDLE_STEPS, began[:FOLLOWED_BESIDE])

    def in_vain() -> bool:
        return beside or not points or points[0].objective > rival

    if not in_vain():
        rest = followed(GENERATIONS[0], MIDDLE_STEPS, began[FOLLOWED_BESIDE:])
        points = sorted([*points, *rest], key=attrgetter("objective"))
    for wander, last in zip(GENERATIONS[1:], GENERATIONS, strict=False):
        if in_vain() or len(points) < FEWEST_PARENTS:
            break
        children = _bred(c, index, points[:PARENTS], draw)
        if wander != last:
            points = followed(wander, MIDDLE_STEPS, [f.theta for f in points[:PARENTS]])
        points = sorted([*points, *followed(wander, MIDDLE_STEPS, children)], key=attrgetter("objective"))
    starts = []
    for f in points[:EVOLVED_KEPT]:
        values = {**trial.starts[0], **dict(zip(index, _values(c, index, f.theta), strict=True))}
        again = parts.extended(trial.name, completed(problem, trial.effect, values)).candidate(problem)
        starts.append((again, again.start(f.parameters())))
    fits = [f for f in each(lambda one: fit(problem, one[0], middle, one[1], 2 * LAST_STEPS), starts) if f]
    return min(list(filter(real, fits)) or fits, key=partial(log_mse_of_windows, problem), default=None)


def _followed(problem: Problem, c: Candidate, theta: Array, gains: ObserverGains, steps: int) -> Fit | None:
    """Return a candidate at some coordinates, or so many steps of a fit from there; None where it diverges."""
    return fit(problem, c, gains, theta, steps) if steps else evaluated(problem, c, theta, gains, False)


def _values(c: Candidate, index: Mapping[str, int], theta: Array) -> list[float]:
    """Return the values of positive parameters at some coordinates."""
    return [max(c.coordinates[i].value(float(theta[i])), MIN_DIVISOR) for i in index.values()]


def _at(c: Candidate, index: Mapping[str, int], theta: Array, values: Sequence[float]) -> Array:
    """Return coordinates with other values of some parameters."""
    theta = theta.copy()
    theta[list(index.values())] = [c.coordinates[i].theta(v) for i, v in zip(index.values(), values, strict=True)]
    return np.clip(theta, *c.bounds)


def _bred(c: Candidate, index: Mapping[str, int], parents: Sequence[Fit], draw: np.random.Generator) -> list[Array]:
    """Return `CHILDREN` coordinates, each of three points: the logarithms of one with a part of what two differ by."""
    logs, found = np.log([_values(c, index, f.theta) for f in parents]), []
    for _ in range(CHILDREN):
        at, one, other = (int(i) for i in draw.choice(len(parents), 3, replace=False))
        child = logs[at] + DIFFERENCE * (logs[one] - logs[other]) + JITTER * draw.standard_normal(len(index))
        found.append(_at(c, index, parents[at].theta, np.exp(child).tolist()))
    return found


__all__ = ["evolved_fit"]
