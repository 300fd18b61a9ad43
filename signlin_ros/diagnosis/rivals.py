"""The rivals of a diagnosis: the models that its records do not tell apart from the proposal."""

from __future__ import annotations

from dataclasses import dataclass
from operator import attrgetter
from typing import Any

import numpy as np

from signlin_ros.diagnosis.blocks import MIN_DIVISOR
from signlin_ros.diagnosis.evidence import Evidence
from signlin_ros.diagnosis.output_error import FittedModel
from signlin_ros.diagnosis.verdict import Verdict

MAX_RIVALS = 8
"""Most rivals that are told."""
MAX_VARIANCE = 1e30
"""Largest variance that is told: of what nothing is known."""


@dataclass(frozen=True)
class Rival:
    """A model that the records do not exclude: the ``effects`` that it adds to the model as given, the ``model`` as a
    file with its fitted values, its free ``parameters`` by name, and the ``covariance`` (n, n) of their values.
    """

    effects: tuple[str, ...]
    model: str
    parameters: tuple[str, ...]
    covariance: tuple[tuple[float, ...], ...]

    def to_json(self) -> dict[str, Any]:
        """Return one entry of ``rivals``."""
        covariance = [list(row) for row in self.covariance]
        return {
            "effects": list(self.effects),
            "model": self.model,
            "parameters": list(self.parameters),
            "covariance": covariance,
        }


def rivals(evidence: Evidence, verdict: Verdict) -> tuple[Rival, ...]:
    """Return the proposal first, then every model that was fitted and that it does not surely beat on validation data,
    least error first: what ties with it, and what was rejected for want of evidence.
    """
    least = evidence.criteria.min_t
    best: dict[tuple[str, ...], FittedModel] = {}
    for f in sorted((*evidence.cache.weighed, verdict.base), key=attrgetter("log_mse"), reverse=True):
        best[f.kind] = f
    best.pop(verdict.final.kind, None)
    others = [f for f in best.values() if not f.implausible and evidence.output_error.t_ratio(f, verdict.final) < least]
    others = [f for f in others if len(f.effects) <= max(len(verdict.final.effects), 1)]
    chosen = [verdict.final, *sorted(others, key=attrgetter("log_mse"))[: MAX_RIVALS - 1]]
    return tuple(rival(f) for f in chosen)


def rival(f: FittedModel) -> Rival:
    """Return a fit as a rival: the covariance has the larger of its standard errors, and the correlations of noise."""
    slopes = np.array([one.k.slope(one.x) for one in f.coordinates])
    stds = np.minimum(np.array([one.std for one in f.coordinates]) * np.abs(slopes), np.sqrt(MAX_VARIANCE))
    bread = f.covariances[0]
    size = np.sqrt(np.maximum(np.diag(bread), MIN_DIVISOR))
    correlation = bread / np.outer(size, size) * np.outer(np.sign(slopes), np.sign(slopes))
    covariance = correlation * np.outer(stds, stds)
    names, rows = tuple(one.k.name for one in f.coordinates), tuple(map(tuple, covariance.tolist()))
    return Rival(f.effects, f.model.to_yaml(), names, rows)


__all__ = ["Rival", "rival", "rivals"]
