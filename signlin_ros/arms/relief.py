"""What a torque sensor behind the gear may show beside the rigid body, where bodies that exist do not fit it.

Friction of motor and gear is not in such an effort; what holds the link from outside the gear is (cables, a balancer),
and the sensor has a gain. Bodies imitate both in one motion: a spring is an inertia below nothing at the frequency of
the motion. They are told and not written, since the efforts of a record do not tell a sensor from what it measures.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from signlin_ros.arms.consistent import consistent
from signlin_ros.arms.fit import CoefficientEstimate
from signlin_ros.arms.keys import Key, names_of
from signlin_ros.arms.search import State, search
from signlin_ros.arms.study import Study

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Relief:
    """Laws outside the gears with coefficients and standard errors, and what bodies that exist leave of unseen efforts
    beside them (n,).
    """

    laws: tuple[tuple[Key, float, float], ...]
    rms: Array


def relief(study: Study, state: State) -> Relief | None:
    """Return the laws outside the gears that stand beside those of a state; None where there are none."""
    if not study.link_side:
        return None
    tried = replace(state, barred=frozenset(study.barred), terms=list(state.terms), found=[])
    estimate = search(tried)
    own = {name: i for i, name in enumerate(estimate.design.names)}
    errors = estimate.errors()
    at = [(found.key, own[names_of(found.key)[0]]) for found in tried.found]
    laws = tuple((key, float(estimate.theta[i]), float(errors[i])) for key, i in at)
    return Relief(laws, _existing_rms(study, estimate)) if laws else None


def _existing_rms(study: Study, estimate: CoefficientEstimate) -> Array:
    """Return what a fit leaves of unseen efforts (n,) with bodies that exist."""
    theta = consistent(estimate, study.robot.pi, np.asarray(study.carried))
    return study.new.by_joint(study.new.y - estimate.design.unseen @ theta)


__all__ = ["Relief", "relief"]
