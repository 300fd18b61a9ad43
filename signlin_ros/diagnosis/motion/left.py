"""What a model leaves: is it more than the sensors' noise?"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from signlin_ros.diagnosis.criteria import Criteria
from signlin_ros.diagnosis.dependence import dependence
from signlin_ros.diagnosis.fit import Fit
from signlin_ros.diagnosis.judge import residues
from signlin_ros.diagnosis.problem import Problem

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Left:
    """The residual of a channel: root mean square in multiples of the sensor's noise, the share of its square that is
    slow, the share that follows from the model's motion, and the correlation of the noise.
    """

    channel: str
    over_noise: float
    slow: float
    dependent: float
    rho: float
    structured: bool


def left(problem: Problem, f: Fit, criteria: Criteria) -> tuple[Left, ...]:
    """Return what a fit leaves in every channel of a problem."""
    shares = dependence(problem, f)
    found = residues(f.innovations, problem.noise)
    result = []
    for channel, r, share, noise in zip(problem.channels, found, shares.tolist(), problem.noise.tolist(), strict=True):
        structured = r.structured or share > criteria.dependent
        result.append(Left(channel, float(np.sqrt(r.variance)) / noise, r.structure, share, r.rho, bool(structured)))
    return tuple(result)


__all__ = ["Left", "left"]
