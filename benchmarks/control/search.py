"""One search for every design: points of a Sobol sequence, then points around the best, ever closer."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import qmc

from signlin_ros.control.designs import Design, Task, Tuning
from signlin_ros.control.lqr import Weights

WIDE, CLOSE = 16, 16
"""Evaluations of the search, far and near."""
ALWAYS = ("bandwidth", "damping", "integral")


@dataclass(frozen=True)
class Found:
    """The best tuning and its cost."""

    tuning: Tuning
    cost: float


def tuning_at(design: Design, task: Task, point: np.ndarray) -> Tuning:
    """Return the tuning at a point of the unit cube: logarithmic scales."""
    fastest = 1.5 / (task.period + task.delay)
    reach = {
        "bandwidth": (fastest / 40, fastest),
        "damping": (0.2, 4.0),
        "integral": (0.03, 2.0),
        "floor": (0.003, 0.3),
        "friction": (0.5, 1.2),
        "turning": (0.05, 5.0),
    }
    names = (*ALWAYS, *design.free)
    values = {n: float(low * (high / low) ** p) for (n, (low, high)), p in zip(_of(reach, names), point, strict=True)}
    weights = Weights(*(values.pop(name) for name in ALWAYS))
    return replace(Tuning(weights), **values)


def _of(reach: dict[str, tuple[float, float]], names: tuple[str, ...]) -> list[tuple[str, tuple[float, float]]]:
    return [(name, reach[name]) for name in names]


def search(design: Design, task: Task, cost: Callable[[Tuning], float], seed: int) -> Found:
    """Return the best of `WIDE` + `CLOSE` tunings, the same number for every design."""
    size = len(ALWAYS) + len(design.free)
    rng = np.random.default_rng(seed)
    points = qmc.Sobol(size, seed=rng).random(WIDE)
    values = [cost(tuning_at(design, task, p)) for p in points]
    for k in range(CLOSE):
        best = points[int(np.argmin(values))]
        width = 0.25 * 0.15 ** (k / CLOSE)
        near = np.clip(best + width * rng.standard_normal(size), 0.0, 1.0)
        points = np.vstack([points, near])
        values.append(cost(tuning_at(design, task, near)))
    k = int(np.argmin(values))
    return Found(tuning_at(design, task, points[k]), float(values[k]))
