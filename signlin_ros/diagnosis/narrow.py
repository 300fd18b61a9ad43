"""Where the search for a rugged effect starts: many points are tried, and the best of them bred.

The cross-entropy method [Rubinstein and Kroese, The Cross-Entropy Method, 2004, ch. 2] on -2 log likelihood without
its derivatives: what makes and breaks contact has many local minima, in which a descent ends.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from signlin_ros.diagnosis.fit import Candidate, Fit, fit, likelihood
from signlin_ros.diagnosis.problem import Gains, Problem

Array = NDArray[np.float64]

ROUNDS, CHILDREN, PARENTS = 4, 48, 14
"""Rounds of breeding, new points in each, and the points that they are drawn around."""
LEAST = 0.03
"""Smallest spread of the logarithm of what is drawn."""
NEAR = 0.2
"""Spread of the logarithms around what was fitted, where the search goes on from there."""
AGAIN = 3
"""How often at most it goes on."""
MANY = 12_000
"""Samples above which points are compared on stretches of the records even where motion is sensitive, to which the
uncertain starts of stretches do much."""
STRIDES, ONWARD = (0.25, 0.5, 2.0, 4.0, 8.0), 8
"""Factors by which a parameter is moved where deeper minima are looked for far away, and steps of a fit from there."""
BESIDE = np.array([-5.0, -2.5, 2.5, 5.0])
"""Where neighbouring minima of an order are looked for, in radians of phase from end to end of the travel."""

Each = Callable[[Callable[[Any], Any], Sequence[Any]], Iterable[Any]]
"""Does a thing to each: `map`, or that of an executor where nothing of the executor's own waits for it."""


def narrowed(
    problem: Problem, c: Candidate, starts: Sequence[dict[str, float]], key: str, gains: Gains, each: Each
) -> list[dict[str, float]]:
    """Return the best points found from many positive ``starts`` of the effect ``key`` of a candidate, best first."""
    own = _own(c, key)
    free = [n for n in starts[0] if n in own]
    index = [own[n] for n in free]
    coordinates = [c.coordinates[i] for i in index]

    def cost(z: Array) -> float:
        theta = c.start()
        values = zip(coordinates, np.exp(z).tolist(), strict=True)
        theta[index] = [np.clip(k.theta(value), k.low, k.high) for k, value in values]
        return likelihood(problem, c, theta, gains)

    best = _bred(np.log([[one[n] for n in free] for one in starts]), cost, LEAST, each)
    return [{**starts[0], **dict(zip(free, np.exp(z).tolist(), strict=True))} for z in best[:3]]


def deepened(problem: Problem, found: Fit, key: str, each: Each) -> Fit:
    """Return a fit of the effect ``key``, gone on from until nothing better is found nearby."""
    c, index = found.candidate, list(_own(found.candidate, key).values())
    low, high = (np.array([getattr(c.coordinates[i], side) for i in index]) for side in ("low", "high"))
    short = problem if problem.samples <= MANY and c.filtered else problem.short
    for _ in range(AGAIN):
        centre, gains = found.theta.copy(), found.gains
        scale = NEAR * np.array([1.0 if c.coordinates[i].log else abs(centre[i]) for i in index])

        def moved(z: Array, centre: Array = centre, scale: Array = scale) -> Array:
            theta: Array = centre.copy()
            theta[index] = np.clip(centre[index] + scale * z, low, high)
            return theta

        def cost(z: Array, gains: Gains = gains, moved: Callable[[Array], Array] = moved) -> float:
            return likelihood(short, c, moved(z), gains)

        points = np.random.default_rng(1).standard_normal((CHILDREN, len(index)))
        best = _bred(points, cost, LEAST / NEAR, each, ROUNDS // 2)[0]
        again = fit(problem, c, gains, moved(best), 12, found.filter, 0.0)
        if again is None or again.cost > found.cost - 1.0:
            return found
        found = again
    return found


def widened(problem: Problem, found: Fit, name: str, each: Each) -> Fit:
    """Return a fit gone on from with a parameter several times smaller or larger, as long as one is deeper."""
    c = found.candidate
    i = [k.name for k in c.coordinates].index(name)
    k = c.coordinates[i]
    for _ in range(AGAIN):
        first = found

        def moved(stride: float, first: Fit = first) -> Fit | None:
            theta = first.theta.copy()
            theta[i] = np.clip(k.theta(stride * k.value(float(theta[i]))), k.low, k.high)
            return fit(problem, c, first.gains, theta, ONWARD, first.filter)

        found = min((f for f in each(moved, STRIDES) if f), key=lambda f: f.cost, default=first)
        if found.cost > first.cost - 1.0:
            return first
    return found


def tuned(problem: Problem, found: Fit, order: str, phase: str) -> Fit:
    """Return a fit of a periodic force with its order moved to a neighbouring minimum, as long as one is deeper."""
    c = found.candidate
    names = [k.name for k in c.coordinates]
    i, j = names.index(order), names.index(phase)
    low, high = problem.stretch
    for _ in range(AGAIN):
        tried = []
        for shift in BESIDE / max(high - low, 1e-300):
            theta = found.theta.copy()
            theta[i] = c.coordinates[i].theta(c.coordinates[i].value(float(theta[i])) + shift)
            theta[j] -= shift * (low + high) / 2 / c.coordinates[j].unit
            tried.append(fit(problem, c, found.gains, theta, 8, found.filter))
        best = min((f for f in tried if f), key=lambda f: f.cost, default=None)
        if best is None or best.cost > found.cost - 1.0:
            return found
        found = best
    return found


def _own(c: Candidate, key: str) -> dict[str, int]:
    """Return the free parameters of an effect, and where they stand among the coordinates."""
    return {k.name.partition(".")[2]: i for i, k in enumerate(c.coordinates) if k.name.partition(".")[0] == key}


def _bred(points: Array, cost: Callable[[Array], float], least: float, each: Each, rounds: int = ROUNDS) -> Array:
    """Return points (N, n) and what was bred of them, best first; ``least``: smallest spread of what is drawn."""
    costs = np.array(list(each(cost, list(points))))
    draw = np.random.default_rng(0).standard_normal
    low, high = points.min(axis=0) - 1.0, points.max(axis=0) + 1.0
    size = points.shape[1]
    for _ in range(rounds):
        parents = points[np.argsort(costs)[:PARENTS]]
        spread = np.linalg.cholesky(np.cov(parents.T).reshape(size, size) + least**2 * np.eye(size))
        children = np.clip(parents.mean(axis=0) + draw((CHILDREN, size)) @ spread.T, low, high)
        points = np.concatenate([points, children])
        costs = np.concatenate([costs, list(each(cost, list(children)))])
    order: Array = points[np.argsort(costs)]
    return order


__all__ = ["Each", "deepened", "narrowed", "tuned", "widened"]
