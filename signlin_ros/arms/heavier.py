"""How many times as heavy as in the URDF what each joint carries is, by all rows: its mass, moment and inertia alike.

Bodies near the URDF take up a part of what a link that is heavier needs, each of its parameters a little. A factor of
the whole body is one parameter, which nothing holds near one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from signlin_ros.arms.fit import CoefficientEstimate, fit
from signlin_ros.arms.heldout import MIN_VALIDATION_ERRORS, on_all
from signlin_ros.arms.keys import Key, names_of
from signlin_ros.arms.search import DOUBT, TIE, State, drop, needed_errors
from signlin_ros.robots.inertia import TEN

Array = NDArray[np.float64]
PAYLOAD = names_of(Key("payload", -1))


@dataclass(frozen=True)
class Heaviness:
    """Of each joint's body, times as heavy as in the URDF (n,), and standard errors; NaN where it has no mass.

    ``told``: the joints of bodies that are heavier (or lighter) beyond doubt, that which tells most first; those after
    it are as good, or are not told beside it.
    """

    factors: Array
    errors: Array
    told: tuple[int, ...]

    @property
    def smallest(self) -> Array:
        """By how much (n,) a body has to be heavier to be told, where its estimate is too small by chance, too."""
        return np.asarray((needed_errors(len(self.errors)) + MIN_VALIDATION_ERRORS) * self.errors)


def heaviness(state: State, estimate: CoefficientEstimate) -> Heaviness:
    """Return how many times as heavy as in the URDF each body is, all else free near where it was.

    Instead of a payload that was found, and told where it is as good as that.
    """
    whole, least = on_all(fit(estimate.design, state.rows, state.new, estimate.weights)), 0.0
    if PAYLOAD[0] in estimate.design.names:
        loaded, whole = whole, on_all(state.without(estimate, *PAYLOAD, weights=estimate.weights))
        least = TIE * drop(whole, loaded)
    n, given = state.robot.n, np.asarray(state.robot.pi).reshape(-1, TEN)
    factors, errors, falls = np.full(n, np.nan), np.full(n, np.nan), np.zeros(n)
    Y = np.concatenate([state.rows.Y, state.new.Y])
    for i in (i for i in range(n) if given[i, 0] > 0.0):
        column = (Y[:, TEN * i : TEN * (i + 1)] @ given[i])[:, None]
        trial = fit(whole.design.plus(("heavier",), column, column), whole.rows, whole.new, whole.weights)
        factors[i], errors[i] = 1.0 + trial.theta[-1], trial.errors()[-1]
        falls[i] = drop(whole, trial)
    with np.errstate(invalid="ignore"):
        sure = np.abs(factors - 1.0) > needed_errors(n) * errors
    least = max(least, float(chi2.isf(DOUBT / n, 1)))
    order = [i for i in np.argsort(-falls).tolist() if sure[i] and falls[i] > least]
    return Heaviness(factors, errors, tuple(order))


__all__ = ["Heaviness", "heaviness"]
