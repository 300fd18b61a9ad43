"""A joint whose encoder counts from elsewhere than the URDF: by how much, and the URDF that counts as the encoder does.

The law is the first term of a series, so the URDF is moved by what is found and the rest is worked out anew.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from signlin_ros.arms.keys import SearchResult, names_of
from signlin_ros.arms.search import State, settled
from signlin_ros.arms.study import Study, study
from signlin_ros.model.arm import ArmModel
from signlin_ros.robots.write import with_zeros

Array = NDArray[np.float64]
MAX_ZERO_ROUNDS, ZERO_SETTLED = 6, 0.1
"""Times that a zero is worked out anew, at most; standard errors by which it moves once it is settled."""


def counted_from(model: ArmModel, offsets: Mapping[str, float]) -> ArmModel:
    """Return a model whose URDF has joints stand by some rad (m) farther at every position."""
    content = {**model.to_dict(), "robot": with_zeros(model.urdf, offsets)}
    return ArmModel.from_dict(content, model.source, model.folder)


def settled_zeros(found: Study, state: State, laws: Sequence[SearchResult]) -> tuple[ArmModel, list[SearchResult]]:
    """Return the model whose URDF counts as the encoders do, and the laws with offsets as they are then.

    found, state : the study in which the laws were found, and where its search ended.
    """
    totals, model = np.array([law.values[0] for law in laws]), found.model
    errors = np.array([law.errors[0] for law in laws])
    motors = state.rows.pieces[0].motors[: found.robot.n]
    for _ in range(MAX_ZERO_ROUNDS):
        offsets = dict(zip((found.names[law.key.at] for law in laws), totals.tolist(), strict=True))
        model = counted_from(found.model, offsets)
        again = study(model, *found.runs, found.band).with_motors(motors)
        here = replace(state, robot=again.robot, rows=again.rows, new=again.new, lumped=0.0)
        estimate = settled(here)
        at = [estimate.design.at(names_of(law.key)[0]) for law in laws]
        step, errors = estimate.theta[at], estimate.errors()[at]
        if (np.abs(step) < ZERO_SETTLED * errors).all():
            break
        totals = totals + step
    values = zip(laws, totals, errors, strict=True)
    return model, [replace(law, values=np.array([v]), errors=np.array([e])) for law, v, e in values]


__all__ = ["counted_from", "settled_zeros"]
