"""Compile ahead: everything that a node will need on a model, once, onto the disk."""

from __future__ import annotations

import time

import numpy as np
from numpy.typing import NDArray

from signlin_ros.estimate import StateEstimator
from signlin_ros.model import Model
from signlin_ros.observe.observer import KalmanObserver
from signlin_ros.simulation import KINDS, SmoothFlow, simulate


def warm_up(model: Model) -> float:
    """Run each compiled kernel on a model for a moment; returns the seconds that it took."""
    begun = time.perf_counter()
    t: NDArray[np.float64] = np.array([0.0, 1e-3, 2e-3, 3e-3])
    u = np.zeros((4, len(model.inputs)))
    for kind in KINDS:
        simulate(model, t, u, kind=kind)
    SmoothFlow(model, 1e-3)(model.x0, u[0])  # a node's midpoint
    for channel in [name for name in (model.plant.position, model.plant.velocity) if name in model.states][:1]:
        observer = KalmanObserver(model, [channel])
        observer.record(t, {channel: np.zeros(t.size)}, u)
        StateEstimator(model, [channel]).warm_up()
    return time.perf_counter() - begun


__all__ = ["warm_up"]
