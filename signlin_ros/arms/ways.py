"""Where velocities come late, efforts may have come the same way: by how much of that lag they are late, too.

Velocities that lag behind their positions went through a filter, or were fetched later. Efforts of the same drive are
in time with the positions, with the velocities, or in between: the likeliest of these, of all joints together, is what
the rigid body and the friction that everybody puts in each joint leave least with.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from signlin_ros.arms.data import ArmRun, shifted
from signlin_ros.arms.fit import FitDesign, fit
from signlin_ros.arms.piece import RegressionRows

Array = NDArray[np.float64]
WAY_STEPS = 20
"""Steps in which the way from the positions' time to the velocities' is looked at."""


def asked(runs: Sequence[ArmRun]) -> float:
    """Return the usual lag in s of velocities behind positions, or the other way round; 0 where it was asked before, or
    is less than a sample.
    """
    lags = [np.abs(run.lags) for run in runs if run.lags is not None and run.late is None]
    usual = float(np.median(np.concatenate(lags))) if lags else 0.0
    return usual if usual > max(run.step for run in runs) else 0.0


def lateness(design: FitDesign, rows: RegressionRows, most: float) -> float:
    """Return by how many s, up to the ``most``, the efforts of some rows are later than their positions."""
    delays = np.linspace(0.0, most, WAY_STEPS + 1)
    left = np.array([_left(design, rows, delay) for delay in delays])
    k = int(np.argmin(left))
    if not 0 < k < WAY_STEPS:
        return float(delays[k])
    down, up = left[k - 1] - left[k], left[k + 1] - left[k]
    return float(delays[k] + 0.5 * (down - up) / (down + up) * delays[1])


def _left(design: FitDesign, rows: RegressionRows, delay: float) -> float:
    """Return minus the logarithm of the likelihood of efforts that are late by a delay."""
    moved = rows.with_efforts(delay)
    rms = fit(replace(design, worked={}, before=None), moved, moved).known_rms
    seen = rows.counts > 0
    return float(np.sum(rows.counts[seen] * np.log(np.maximum(rms[seen], 1e-300))))


def in_effort_time(runs: Sequence[ArmRun], delay: float) -> list[ArmRun]:
    """Return runs whose efforts are put in time with their positions, those with lags by a delay in s."""
    n = runs[0].q.shape[1]
    return [run if run.lags is None else replace(shifted(run, np.full(n, delay)), late=delay) for run in runs]


__all__ = ["asked", "in_effort_time", "lateness"]
