"""Records of machines that are driven by tones of drawn frequencies and phases."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from signlin_ros.model import Model
from signlin_ros.records import ModelData
from signlin_ros.simulation import simulate

Array = NDArray[np.float64]


def drawn_tones(
    random: np.random.Generator, t: Array, *, count: int, band: tuple[float, float], fall: float, deviation: float
) -> Array:
    """Return ``count`` tones (T,) within ``band`` in Hz, whose amplitudes fall as f^-fall, of a standard deviation."""
    frequencies, phases = np.exp(random.uniform(*np.log(band), count)), random.uniform(0, 2 * np.pi, count)
    u = np.sum(np.sin(2 * np.pi * np.outer(t, frequencies) + phases) / frequencies**fall, axis=1)
    return np.asarray(u * (deviation / u.std()))


def noisy_states(
    random: np.random.Generator, machine: Model, t: Array, u: Array, deviations: tuple[float, ...]
) -> Array:
    """Return the states (T, n) of a machine driven by ``u`` (T,), each with white noise of its deviation."""
    x = simulate(machine, t, u).x
    return np.asarray(x + random.normal(size=x.shape) * deviations)


def as_data(model: Model, t: Array, u: Array, shown: Array) -> ModelData:
    """Return a record of one input (T,) and of all states (T, n)."""
    measured = dict(zip(model.states, shown.T, strict=True))
    return ModelData(t, u[:, None], measured, None, model.inputs, model.states, dict(model.units))
