"""Curves for pictures: states, inputs and internal forces along the records of a comparison."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from signlin_ros.comparison.equations import mass
from signlin_ros.diagnosis.compared import Comparison, Traces
from signlin_ros.follow.tracking import Tracker
from signlin_ros.model import Model

Array = NDArray[np.float64]


def column(comparison: Comparison, name: str) -> Array | None:
    """Return a state or an input (N,) over all stretches; None if the model has no such thing."""
    model = comparison.model
    if name in model.states:
        return np.concatenate([t.states[:, model.states.index(name)] for t in comparison.traces])
    if name in model.inputs:
        return np.concatenate([t.u[:, model.inputs.index(name)] for t in comparison.traces])
    return None


def internal_force(comparison: Comparison, k: int) -> tuple[Array, Array]:
    """Return the force (T,) with which springs and friction resist on stretch k: as the measurements have it, and as
    the model has it at the same states. Inertia and drive are taken out.
    """
    model, trace = comparison.model, comparison.traces[k]
    if model.plant.velocity not in model.states:
        j = list(comparison.channels).index(model.plant.effort)
        computed = _tracker(comparison, trace).outputs(trace.states)[:, j]
        return trace.measured[:, j], computed
    row = model.states.index(model.plant.velocity)
    rate = _tracker(comparison, trace).linearized(trace.states)[0][:, row]
    resisting = np.asarray(_drive(model, trace) - rate * mass(model))
    lacking = next(m for m in comparison.missing if m.name in ("force", "torque"))
    return resisting - lacking.values[k], resisting


def _tracker(comparison: Comparison, trace: Traces) -> Tracker:
    names = tuple(comparison.channels)
    return Tracker(comparison.model, trace.t, trace.u, trace.measured, names, np.ones(len(comparison.model.states)))


def _drive(model: Model, trace: Traces) -> Array:
    if "current" in model.states:
        return np.asarray(model.parameters["K_t"] * trace.states[:, model.states.index("current")])
    return np.asarray(trace.u[:, 0]) if model.plant.effort in model.inputs else np.zeros(trace.t.size)


__all__ = ["column", "internal_force"]
