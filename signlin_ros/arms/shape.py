"""The parameter of a law that does not enter linearly, between the values of which each is tried."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import minimize_scalar

from signlin_ros.arms.fit import CoefficientEstimate, fit
from signlin_ros.arms.keys import Key, names_of
from signlin_ros.arms.laws import JointLaw, shapes

if TYPE_CHECKING:
    from signlin_ros.arms.search import State

RESOLVED = 0.02
"""Relative change of the parameter at which its search ends."""


def shaped(state: State, estimate: CoefficientEstimate, key: Key, law: JointLaw) -> Key:
    """Return a law with the shape that fits best beside an estimate, between its neighbours of those that are tried.

    What a coarse value leaves would be taken for another law of the joint.
    """
    if not law.shape:
        return key
    tried, loads = shapes(law, state.rows, key.at), state.loads(estimate)
    at = int(np.argmin(np.abs(np.log(tried) - np.log(key.shape))))
    ends = np.log([tried[max(at - 1, 0)], tried[min(at + 1, len(tried) - 1)]])

    def left(logarithm: float) -> float:
        columns = state.columns(replace(key, shape=float(np.exp(logarithm))), law, loads)
        design = estimate.design.plus(names_of(key), *columns)
        return fit(design, state.rows, state.new, estimate.weights).objective

    best = minimize_scalar(left, bounds=tuple(ends), method="bounded", options={"xatol": RESOLVED})
    return replace(key, shape=float(np.exp(best.x)))


__all__ = ["shaped"]
