"""Curves for pictures: binned means with confidence, internal forces, shares over two coordinates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from signlin_ros.comparison.equations import mass
from signlin_ros.comparison.scene import remembered
from signlin_ros.diagnosis.comparison import Comparison, Traces
from signlin_ros.follow.tracking import Tracker
from signlin_ros.model import Model

Array = NDArray[np.float64]

MIN_BIN_SAMPLES = 8
"""A bin with fewer samples says nothing."""


@dataclass(frozen=True)
class Band:
    """Means of a quantity over bins of a coordinate: ``at``, ``mean``, ``two_errors`` (bins,): ± 2 standard errors."""

    at: Array
    mean: Array
    two_errors: Array


def band(x: Array, values: Array, block: int, bins: int = 30, dense_at_zero: bool = False) -> Band:
    """Return the means of values (N,) over bins of x (N,), with errors that allow for correlation within ``block``
    samples. ``dense_at_zero``: bins are narrow near 0, where dry friction decides.
    """
    low, high = np.quantile(x, [0.002, 0.998])
    edges = np.linspace(low, high, bins + 1)
    if dense_at_zero and low < 0 < high:
        top = max(-low, high)
        scaled = np.linspace(-np.sqrt(-low / top), np.sqrt(high / top), bins + 1)
        edges = top * np.sign(scaled) * scaled**2
    index = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, bins - 1)
    count = np.bincount(index, minlength=bins)
    full = count >= MIN_BIN_SAMPLES
    mean = np.bincount(index, values, bins) / np.maximum(count, 1)
    at = np.bincount(index, x, bins) / np.maximum(count, 1)
    groups = np.arange(x.size) // max(block, 1) * bins + index
    sums = np.bincount(groups, values - mean[index], (groups.max() // bins + 1) * bins).reshape(-1, bins)
    errors = 2.0 * np.sqrt(np.sum(sums**2, axis=0)) / np.maximum(count, 1)
    return Band(at[full], mean[full], errors[full])


def memory(values: Array) -> int:
    """Return after how many samples a quantity (N,) has forgotten itself: twice the lag of correlation 0.1."""
    return min(2 * remembered(values), max(1, values.size // 20))


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


__all__ = ["Band", "band", "column", "internal_force", "memory"]
