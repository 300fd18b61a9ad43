"""Laws of other joints that are as good as one that was found, and that are not there beside it: one or the other.

What two joints pass on to each other shows in both: that one of two efforts is larger than it should be, beside the
other, does not say which of them is off.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from signlin_ros.arms.fit import CoefficientEstimate, fit
from signlin_ros.arms.keys import SEEN_ELSEWHERE, Key, SearchResult, names_of
from signlin_ros.arms.search import MIN_COEFFICIENT_ERRORS, TIE, State


def rivals_left(state: State, estimate: CoefficientEstimate) -> list[SearchResult]:
    """Return the laws of a state, each with those rivals that are still as good in its place."""
    return [replace(law, rivals=_left(state, estimate, law)) for law in state.found]


def _left(state: State, estimate: CoefficientEstimate, law: SearchResult) -> tuple[Key, ...]:
    """Return the rivals of a law: those of its joint, and those of other joints that take its place."""
    own = tuple(key for key in law.rivals if key.at == law.key.at)
    if law.key.law not in SEEN_ELSEWHERE:
        return own
    others = [Key(law.key.law, i) for i in range(state.robot.n) if i not in state.barred]
    others = [key for key in others if not any(key.same(taken) for taken, _ in state.terms)]
    without = state.without(estimate, *law.names, weights=estimate.weights)
    least = TIE * _worth(without, estimate)
    return (*own, *(key for key in others if _takes_place(state, estimate, without, key, least)))


def _takes_place(
    state: State, estimate: CoefficientEstimate, without: CoefficientEstimate, key: Key, least: float
) -> bool:
    """Tell whether a law is as good as another in its place, and not there beside it."""
    columns, names = state.columns(key, None, state.loads(estimate)), names_of(key)
    alone, beside = (
        fit(e.design.plus(names, *columns), state.rows, state.new, estimate.weights) for e in (without, estimate)
    )
    ratios = [abs(float(e.theta[-1])) / max(float(e.errors()[-1]), 1e-300) for e in (alone, beside)]
    return ratios[0] >= MIN_COEFFICIENT_ERRORS > ratios[1] and _worth(without, alone) > least


def _worth(before: CoefficientEstimate, after: CoefficientEstimate) -> float:
    """Return by how much unseen rows fall in all joints, in logarithms of their RMS."""
    with np.errstate(invalid="ignore", divide="ignore"):
        return float(np.nansum(np.log(before.matched_rms) - np.log(after.matched_rms)))


__all__ = ["rivals_left"]
