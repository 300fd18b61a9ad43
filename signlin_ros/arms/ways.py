"""Where velocities come late, efforts may have come the same way: by how much of that lag they are late, too.

Velocities that lag behind their positions went through a filter, or were fetched later. Efforts of the same drive are
in time with the positions, with the velocities, or in between: by what the rigid body needs, of all joints together.
Friction does not speak, as for any delay of an effort: it sets in late after a reversal.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from signlin_ros.arms.data import ArmRun, shifted
from signlin_ros.arms.fit import fit
from signlin_ros.arms.keys import DELAY, Key, names_of
from signlin_ros.arms.search import State

Array = NDArray[np.float64]
ROUNDS, SETTLED = 10, 1e-3
"""Times that the delay is worked out anew, at most; part of its largest value by which it moves once it is settled."""
ALL = Key(DELAY, -1)
"""The law that all efforts are late."""


def asked(runs: Sequence[ArmRun]) -> float:
    """Return the usual lag in s of velocities behind positions, or the other way round; 0 where it was asked before, or
    is less than a sample.
    """
    lags = [np.abs(run.lags) for run in runs if run.lags is not None and run.late is None]
    usual = float(np.median(np.concatenate(lags))) if lags else 0.0
    return usual if usual > max(run.step for run in runs) else 0.0


def lateness(state: State, most: float, before: float = 0.0) -> float:
    """Return by how many s, up to the ``most``, the efforts of a state's rows were recorded later than their positions.

    before : by how many s they were put in time already.
    """
    loads, delay = state.loads(None), before
    design = state.design(loads).plus(names_of(ALL), *state.columns(ALL, None, loads))
    for _ in range(ROUNDS):
        rows, new = (r.with_efforts(delay - before) for r in state.both)
        later = fit(replace(design, worked={}, before=None), rows, new)[names_of(ALL)[0]]
        step = float(np.clip(delay + later, 0.0, most)) - delay
        delay += step
        if abs(step) < SETTLED * most:
            break
    return delay


def put_in_time(runs: Sequence[ArmRun]) -> float:
    """Return by how many s the efforts of some runs were put in time with their positions."""
    return max((run.late for run in runs if run.late is not None), default=0.0)


def in_effort_time(runs: Sequence[ArmRun], delay: float) -> list[ArmRun]:
    """Return runs whose efforts are put in time with their positions, those with lags by a delay in s."""
    n = runs[0].q.shape[1]
    return [run if run.lags is None else replace(shifted(run, np.full(n, delay)), late=delay) for run in runs]


__all__ = ["asked", "in_effort_time", "lateness", "put_in_time"]
