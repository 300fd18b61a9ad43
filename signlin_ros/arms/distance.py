"""How far the bodies that records ask for are from those of the URDF, in what the URDF leaves open.

Bodies swallow what they can: a joint that is counted from elsewhere, a load that no file has, a spring. What is left of
the efforts does not show it, the distance does. Of every combination of inertial parameters that the records tell
better than the URDF, the square of its distance over its variance, that of the URDF and that of the records, is of
one degree of freedom.   [Wald, Trans. American Mathematical Society 54(3), 1943]
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from signlin_ros.arms.fit import CoefficientEstimate, fit
from signlin_ros.robots.inertia import TEN

Array = NDArray[np.float64]
DOUBT = 1e-4
"""Probability of bodies so far from the URDF, if its tolerance is right."""
MIN_INFORMATION_SHARE = 1e-6
"""Information on a combination, in that of the URDF, below which the records do not tell it."""


@dataclass(frozen=True)
class BodyDistance:
    """Wald's statistic of some combinations of inertial parameters, and which one is farthest, in its tolerance."""

    statistic: float
    combinations: int
    farthest: str
    tolerances: float

    @property
    def most(self) -> float:
        """The largest statistic that is left to chance."""
        return float(chi2.isf(DOUBT, max(self.combinations, 1)))

    @property
    def beyond(self) -> bool:
        """Whether the bodies are farther from the URDF than its tolerance says."""
        return self.statistic > self.most


def body_distance(estimate: CoefficientEstimate) -> BodyDistance:
    """Return how far the bodies of an estimate are from their priors, all that is fitted beside them left open.

    The records' own errors are those of a fit without the priors: what these leave is no noise.
    """
    k, design = TEN * estimate.rows.n, estimate.design
    sd = design.sd[:k]
    away = (estimate.pi - design.mean[:k]) / sd
    open_ = replace(design, sd=np.concatenate([np.full(k, np.inf), design.sd[k:]]))
    scores, G = fit(open_, estimate.rows, estimate.new, estimate.weights).scores, estimate.G
    inner = np.linalg.solve(G[k:, k:], G[k:, :k])
    told = (G[:k, :k] - G[:k, k:] @ inner) * sd[:, None] * sd - np.eye(k)
    values, vectors = np.linalg.eigh(told)
    kept = values > MIN_INFORMATION_SHARE
    values, vectors = values[kept], vectors[:, kept]
    scatter = np.sum((((scores[:, :k] - scores[:, k:] @ inner) * sd) @ vectors) ** 2, axis=0)
    variance = np.maximum(scatter / values**2, 1.0 / values)
    better = variance < 1.0
    free = (vectors.T @ away) * (1.0 + values) / values
    statistic = float(np.sum(free[better] ** 2 / (1.0 + variance[better])))
    at = int(np.argmax(np.abs(away)))
    return BodyDistance(statistic, int(better.sum()), design.names[at], float(abs(away[at])))


__all__ = ["BodyDistance", "body_distance"]
