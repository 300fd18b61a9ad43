"""How large a law of the robot has to be before a record shows it: what is smaller cannot be told from these data.

A gain that is off scales friction along with the rigid body, and friction is fitted: a joint whose effort is nearly all
friction does not show it, however much it is off.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from signlin_ros.arms.fit import CoefficientEstimate, blocks, fit
from signlin_ros.arms.heldout import MIN_VALIDATION_ERRORS, on_all
from signlin_ros.arms.keys import BODIES_IMITATE, GAIN, ZERO
from signlin_ros.arms.search import MIN_VALIDATION_SHARE, Key, State, needed_errors

Array = NDArray[np.float64]
LAWS = (GAIN, "compliant_load", ZERO)
"""Laws that are told from friction and inertia only where the record shows them."""


def detectable(state: State, estimate: CoefficientEstimate) -> dict[Key, float]:
    """Return the smallest coefficients that would be named: of gains (relative), compliances (rad/N·m), zeros (rad, m).

    A coefficient is named from so many standard errors of all rows on, and from a visible share of a joint's squares; a
    zero, which bodies imitate, from so many on the rows of the fit and on unseen ones by themselves. Errors are those
    beside all that is fitted, inertial parameters with their priors included. An estimate that is too small by chance
    is allowed for.
    """
    own = fit(estimate.design, state.rows, state.new, estimate.weights)
    other = fit(own.design.swapped(), state.new, state.rows, estimate.weights)
    whole, taken = on_all(own), [key for key, _ in state.terms]
    keys = [Key(law, i) for i in range(state.robot.n) if i not in state.barred for law in LAWS]
    keys = [key for key in keys if not any(key.same(other) for other in taken)]
    needed, loads = needed_errors(len(list(state.candidates(estimate)))) + MIN_VALIDATION_ERRORS, state.loads(estimate)
    found = dict[Key, float]()
    for key in keys:
        columns = state.columns(key, None, loads)
        if key.law in BODIES_IMITATE:
            sides = (own, columns[0], needed), (other, columns[1], 2.0 * MIN_VALIDATION_ERRORS)
            found[key] = max(_smallest(*side, visibly=False) for side in sides)
        else:
            found[key] = _smallest(whole, np.concatenate(columns), needed)
    return found


def _smallest(estimate: CoefficientEstimate, column: Array, needed: float, visibly: bool = True) -> float:
    """Return the smallest coefficient of a column (N, 1) that would be named; inf where it is nothing new.

    ``visibly``: it has to be visible in the joint that shows it most.
    """
    w = estimate.weights[estimate.rows.joint]
    X, r, c = estimate.design.known * w[:, None], estimate.residual * w, column[:, 0] * w
    new = c - X @ (estimate.inverse() @ (X.T @ c))
    size = float(new @ c)
    if size <= 0.0:
        return np.inf
    spread = float(np.linalg.norm(blocks((new * estimate.unabsorbed)[:, None], estimate.rows.block)))
    error = max(spread / size, 1.0 / np.sqrt(size))
    if not visibly:
        return float(needed * error)
    left, shown = (np.bincount(estimate.rows.joint, values**2, estimate.rows.n) for values in (r, new))
    visible = float(
        np.sqrt(MIN_VALIDATION_SHARE * np.min(left / np.maximum(shown, 1e-300), where=left > 0.0, initial=np.inf))
    )
    return float(max(needed * error, visible))


__all__ = ["detectable"]
