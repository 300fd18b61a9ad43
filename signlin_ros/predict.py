"""How well A_k, B_k and c predict the next update period on a measured record."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from signlin_ros.errors import RecordError
from signlin_ros.estimate import StateEstimator
from signlin_ros.model import Model
from signlin_ros.simulation import simulate

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Prediction:
    """Predictions over non-overlapping windows of ``horizon`` s: error (S,) at every sample inside, and its RMS."""

    horizon: float
    error: Array
    rms: float


def causal_states(
    model: Model, t: Array, measured: Mapping[str, Array], u: Array, window: float | None = None
) -> Array:
    """Return the causal estimate (T, n) of the state over a record (see `StateEstimator`)."""
    estimator = StateEstimator(model, measured, rate=1.0 / float(np.median(np.diff(t))), window=window)
    return estimator.all(t, measured, u)


def zero_phase_velocity(t: Array, position: Array, cutoff: float) -> Array:
    """Return the velocity (T,) from a position by a zero-phase Butterworth low-pass of order 4 at ``cutoff`` Hz."""
    from scipy.signal import butter, filtfilt

    rate = 1.0 / float(np.median(np.diff(t)))
    if not 0 < cutoff < rate / 2:
        raise RecordError(f"cut-off {cutoff:g} Hz is not below half the sampling rate {rate:g} Hz")
    b, a = butter(4, cutoff / (rate / 2))
    return np.asarray(np.gradient(filtfilt(b, a, position), t))


def predict(
    model: Model, t: Array, u: Array, states: Array, truth: Array, name: str, horizon: float, kind: str = "piecewise"
) -> Prediction:
    """Predict the state ``name`` over windows of ``horizon`` s with the linear model built at each window's start.

    The measured input u (T, m) is applied, the state starts from ``states`` (T, n), all samples after the start are
    compared with ``truth`` (T,). The model's own method and operating point are used, one linear model per window;
    ``kind`` "exact" or "smooth" simulates the nonlinear model instead.
    """
    column = model.states.index(name)
    held = model.with_options(update_period=horizon)
    errors = []
    for first, last in windows(t, horizon):
        part = slice(first, last + 1)
        run = simulate(held, t[part], u[part], states[first], kind=kind)
        errors.append(run.x[1:, column] - truth[part][1:])
    error = np.concatenate(errors)
    return Prediction(horizon, error, float(np.sqrt(np.mean(error**2))))


def windows(t: Array, horizon: float) -> list[tuple[int, int]]:
    """Return the first and the last sample of every non-overlapping window of ``horizon`` s; neighbours share one."""
    edges = np.unique(np.searchsorted(t, np.arange(t[0], t[-1], horizon) - 1e-9))
    return list(pairwise(edges.tolist()))


def without_dry_friction(model: Model) -> Model:
    """Return the model without every effect that switches with a sign: what a linear description would keep."""

    def switches(key: str) -> bool:
        alone = Model.from_dict({**model.to_dict(), "effects": {key: model.effects[key].written()}})
        return any(s.kind == "switch" for s in alone.trace.surfaces)

    return model.without_effect(*filter(switches, model.effects))


def value_of_the_method(
    model: Model, t: Array, u: Array, position: Array, horizon: float = 0.2, cutoff: float = 100.0
) -> dict[str, float]:
    """Return the RMS error of the predicted velocity for five linear models built on one record of positions.

    ``start`` and ``midpoint`` are this project's; ``jacobian`` is the affine Jacobian at the start; ``no friction``
    the same model with all dry friction removed; ``nonlinear`` the exact simulation, which no linear model can beat.
    """
    position = model.sensors[model.plant.position].true(position)
    states = causal_states(model, t, {model.plant.position: position}, u)
    truth = zero_phase_velocity(t, position, cutoff)
    name = model.plant.velocity
    start, bare = model.with_options(operating_point="start"), without_dry_friction(model)
    models = {
        "start": start,
        "midpoint": model.with_options(operating_point="midpoint"),
        "jacobian": start.with_options(linearization="jacobian"),
        "no friction": bare.with_options(operating_point="start"),
    }
    keep = [bare.states.index(s) for s in bare.states]
    found = {
        label: predict(m, t, u, states[:, keep] if m is bare else states, truth, name, horizon).rms
        for label, m in models.items()
    }
    nonlinear = predict(model, t, u, states, truth, name, horizon, kind="exact").rms
    return found | {"nonlinear": nonlinear}
