"""Where the search for a rugged effect starts: many points are tried, and the best of them bred.

The cross-entropy method [Rubinstein and Kroese, The Cross-Entropy Method, 2004, ch. 2] on -2 log likelihood without
its derivatives: what makes and breaks contact has many local minima, in which a descent ends.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from signlin_ros.fitting.candidate import Candidate
from signlin_ros.fitting.fit import evaluated
from signlin_ros.fitting.gains import Gains
from signlin_ros.fitting.problem import Problem

Array = NDArray[np.float64]

ROUNDS, CHILDREN, PARENTS = 4, 48, 14
"""Rounds of breeding, new points in each, and the points that they are drawn around."""
LEAST = 0.03
"""Smallest spread of the logarithm of what is drawn."""

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
        f = evaluated(problem, c, theta, gains, False)
        return f.cost if f else np.inf

    best = _bred(np.log([[one[n] for n in free] for one in starts]), cost, each)
    return [{**starts[0], **dict(zip(free, np.exp(z).tolist(), strict=True))} for z in best[:3]]


def _own(c: Candidate, key: str) -> dict[str, int]:
    """Return the free parameters of an effect, and where they stand among the coordinates."""
    return {k.name.partition(".")[2]: i for i, k in enumerate(c.coordinates) if k.name.partition(".")[0] == key}


def _bred(points: Array, cost: Callable[[Array], float], each: Each) -> Array:
    """Return points (N, n) and what was bred of them, best first."""
    costs = np.array(list(each(cost, list(points))))
    draw = np.random.default_rng(0).standard_normal
    low, high = points.min(axis=0) - 1.0, points.max(axis=0) + 1.0
    size = points.shape[1]
    for _ in range(ROUNDS):
        parents = points[np.argsort(costs)[:PARENTS]]
        spread = np.linalg.cholesky(np.cov(parents.T).reshape(size, size) + LEAST**2 * np.eye(size))
        children = np.clip(parents.mean(axis=0) + draw((CHILDREN, size)) @ spread.T, low, high)
        points = np.concatenate([points, children])
        costs = np.concatenate([costs, list(each(cost, list(children)))])
    order: Array = points[np.argsort(costs)]
    return order


__all__ = ["Each", "narrowed"]
