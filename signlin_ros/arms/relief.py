"""What a torque sensor behind the gear may show beside the rigid body, where bodies that exist do not fit it.

Friction of motor and gear is not in such an effort; what holds the link from outside the gear is (cables, a balancer),
and the sensor has a gain. Bodies imitate both in one motion: a spring is an inertia below nothing at the frequency of
the motion. They are no laws of the arm, since the efforts of a record do not tell a sensor from what it measures; a
model that is written has them, so that its bodies are not bent.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from signlin_ros.arms.data import resized, with_gains
from signlin_ros.arms.faults import shows
from signlin_ros.arms.fit import CoefficientEstimate
from signlin_ros.arms.keys import GAIN, Key, names_of
from signlin_ros.arms.proposal import Proposal, proposal
from signlin_ros.arms.search import State, search, settled
from signlin_ros.arms.study import Study, study

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Relief:
    """Laws outside the gears with coefficients and standard errors, the model that has them, and what that leaves of
    unseen efforts as they were recorded (n,); ``without``: what the model leaves that was fitted without them.

    ``estimate``: the fit beside them, whether its bodies exist or not.
    """

    laws: tuple[tuple[Key, float, float], ...]
    proposal: Proposal
    rms: Array
    without: Array
    estimate: CoefficientEstimate


def relief(found: Study, state: State, without: Array) -> Relief | None:
    """Return the laws outside the gears that stand beside those of a state, and the model that has them.

    without : (n,) what the model that has none of them leaves of unseen efforts. None where there are no such laws, or
    where bodies that exist leave no less beside them.
    """
    if not found.link_side:
        return None
    tried = replace(state, barred=frozenset(found.barred), terms=list(state.terms), found=[])
    fitted = search(tried)
    own, errors = {name: i for i, name in enumerate(fitted.design.names)}, fitted.errors()
    at = [(law.key, own[names_of(law.key)[0]]) for law in tried.found]
    laws = tuple((key, float(fitted.theta[i]), float(errors[i])) for key, i in at)
    laws = tuple(law for law in laws if law[0].law != GAIN or shows(*law[1:]))
    if not laws:
        return None
    shown = np.ones(found.robot.n)
    for key, value, _ in (law for law in laws if law[0].law == GAIN):
        shown[key.at] += value
    right = _resized(found, shown)
    kept = [(key, law) for key, law in tried.terms if key.law != GAIN]
    beside = replace(right.state(), terms=kept, barred=state.barred, known=state.known)
    estimate = settled(beside)
    new = proposal(right, beside, estimate)
    rms = right.new.by_joint(right.left(new.model, right.new)) * np.abs(shown)
    with np.errstate(divide="ignore", invalid="ignore"):
        better = float(np.nansum(np.log(without / rms))) > 0.0
    return Relief(laws, new, rms, without, estimate) if better else None


def _resized(found: Study, shown: Array) -> Study:
    """Return a study of efforts as large as what acts, of which those recorded show some parts (n,)."""
    if (shown == 1.0).all():
        return found
    known, unseen = ([resized(run, shown) for run in side] for side in found.runs)
    again = study(with_gains(found.model, shown), known, unseen, found.band)
    return replace(found, model=again.model, runs=again.runs, rows=again.rows, new=again.new)


__all__ = ["Relief", "relief"]
