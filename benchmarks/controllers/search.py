"""One search for every design: a point that suits most, points of a Sobol sequence, then points around the best."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import qmc

from signlin_ros.control.designs import Design, Task, Tuning
from signlin_ros.control.lqr import Weights

WIDE, CLOSE = 16, 16
"""Evaluations of the search, far and near."""
FIRST = {"bandwidth": 1.2, "damping": 1.0, "integral": 1.0, "floor": 0.02, "friction": 1.0, "turning": 1.0}
"""Where every search begins; the bandwidth as a multiple of 1 / (period + delay)."""
ALWAYS = ("bandwidth", "damping", "integral")


@dataclass(frozen=True)
class Found:
    """The best tuning and its cost."""

    tuning: Tuning
    cost: float


def reaches(task: Task) -> dict[str, tuple[float, float]]:
    """Return the smallest and the largest value of what is searched."""
    fastest = 1.5 / (task.period + task.delay)
    return {
        "bandwidth": (fastest / 40, fastest),
        "damping": (0.2, 4.0),
        "integral": (0.03, 3.0),
        "floor": (0.003, 0.3),
        "friction": (0.5, 1.2),
        "turning": (0.05, 5.0),
    }


def tuning_at(design: Design, task: Task, point: np.ndarray) -> Tuning:
    """Return the tuning at a point of the unit cube: logarithmic scales."""
    reach = reaches(task)
    names = (*ALWAYS, *design.free)
    pairs = zip(names, point, strict=True)
    values = {name: float(reach[name][0] * (reach[name][1] / reach[name][0]) ** p) for name, p in pairs}
    weights = Weights(*(values.pop(name) for name in ALWAYS))
    return replace(Tuning(weights), **values)


def first(design: Design, task: Task) -> np.ndarray:
    """Return the point of the unit cube at which every search begins."""
    reach = reaches(task)
    start = {**FIRST, "bandwidth": FIRST["bandwidth"] / (task.period + task.delay)}
    names = (*ALWAYS, *design.free)
    return np.array([np.log(start[n] / reach[n][0]) / np.log(reach[n][1] / reach[n][0]) for n in names])


def search(design: Design, task: Task, cost: Callable[[Tuning], float], seed: int) -> Found:
    """Return the best of `WIDE` + `CLOSE` tunings, the same number for every design."""
    size = len(ALWAYS) + len(design.free)
    rng = np.random.default_rng(seed)
    points = np.vstack([first(design, task), qmc.Sobol(size, seed=rng).random(WIDE)[1:]])
    values = [cost(tuning_at(design, task, p)) for p in points]
    for k in range(CLOSE):
        best = points[int(np.argmin(values))]
        width = 0.25 * 0.15 ** (k / CLOSE)
        near = np.clip(best + width * rng.standard_normal(size), 0.0, 1.0)
        points = np.vstack([points, near])
        values.append(cost(tuning_at(design, task, near)))
    k = int(np.argmin(values))
    return Found(tuning_at(design, task, points[k]), float(values[k]))
