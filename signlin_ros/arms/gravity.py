"""A base that stands otherwise than the file says: where gravity comes from, with the size that it has.

The law is the first term of a series, so gravity is turned by what is found and the rest is worked out anew.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from signlin_ros.arms.keys import SearchResult, names_of
from signlin_ros.arms.laws import across_gravity
from signlin_ros.arms.search import State, settled
from signlin_ros.arms.study import Study, study
from signlin_ros.model.arm import ArmModel
from signlin_ros.robots import Robot

Array = NDArray[np.float64]
MAX_TILT_ROUNDS, TILT_SETTLED = 6, 0.1
"""Times that a tilt is worked out anew, at most; standard errors by which it moves once it is settled."""


def turned(robot: Robot, tilt: Array) -> Array:
    """Return gravity (3,) of a robot whose base is tilted: its components across gravity, over that along it (2,)."""
    across, down = across_gravity(robot)
    tilted = robot.gravity + down * (tilt @ across)
    return np.asarray(tilted * np.linalg.norm(robot.gravity) / np.linalg.norm(tilted))


def settled_tilt(found: Study, state: State, law: SearchResult) -> tuple[ArmModel, SearchResult]:
    """Return the model whose file says where gravity comes from, and the law with the tilt as it is then.

    found, state : the study in which the law was found, and where its search ended.
    """
    across, _ = across_gravity(found.robot)
    own, values, errors = found.robot.gravity, law.values, law.errors
    gravity, model = turned(found.robot, values), found.model
    motors = state.rows.pieces[0].motors[: found.robot.n]
    for _ in range(MAX_TILT_ROUNDS):
        content = {**found.model.to_dict(), "gravity": gravity.tolist()}
        model = ArmModel.from_dict(content, found.model.source, found.model.folder)
        again = study(model, *found.runs, found.band).with_motors(motors)
        here = replace(state, robot=again.robot, rows=again.rows, new=again.new, lumped=0.0)
        estimate = settled(here)
        at = [estimate.design.at(name) for name in names_of(law.key)]
        step, errors = estimate.theta[at], estimate.errors()[at]
        if (np.abs(step) < TILT_SETTLED * errors).all():
            break
        gravity = turned(again.robot, step)
    values = across @ gravity / (gravity @ own) * np.linalg.norm(own)
    return model, replace(law, values=values, errors=errors)


__all__ = ["settled_tilt", "turned"]
