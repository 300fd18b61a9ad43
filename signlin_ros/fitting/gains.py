"""Gains of the observers, from high to low: Kalman filters of the linear base model for several time constants."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from signlin_ros.comparison.equations import bare
from signlin_ros.follow.kalman import kalman_gains
from signlin_ros.follow.segments import twin
from signlin_ros.follow.tracking import Tracker
from signlin_ros.model import Model

Array = NDArray[np.float64]
Sizes = Mapping[str, float]
"""Sizes of channels or states, by name."""
INITIAL_VARIANCE = 25.0
"""Variance of the initial state in variances of the measurement noise."""
LOOP = 0.2
"""Time in s after which a servo's loop has about forgotten a disturbance."""
MAX_GAIN_SAMPLES = 20_000
"""Samples after which a gain that has not settled is taken as it is."""


@dataclass(frozen=True)
class ObserverGains:
    """Kalman gains (G, n, ny) for the states ``names`` and a time constant ``tau`` in s; ``weights`` (G, ny) of the
    first innovations; ``spread`` (2, n): variances that a step adds, and those at the start.
    """

    tau: float
    names: tuple[str, ...]
    values: Array
    weights: Array
    spread: Array

    def rows(self, states: tuple[str, ...], uncorrected: Collection[str] = ()) -> Array:
        """Return gains for a model with these states: an effect's own position or velocity moves with the plant's."""
        result = np.zeros((self.values.shape[0], len(states), self.values.shape[2]))
        for i, name in enumerate(states):
            source = name if name in self.names else twin(name, self.names)
            if source and name not in uncorrected:
                result[:, i] = self.values[:, self.names.index(source)]
        return result


def linear_base(model: Model, channels: tuple[str, ...]) -> tuple[tuple[str, ...], Array, Array]:
    """Return (states, A, C) of the bare plant at rest: what the observer is designed for. A channel that shows an
    effect's own position or velocity shows about the plant's.
    """
    plain = bare(model)
    channels = _of_plant(plain, channels)
    n, u, y = len(plain.states), np.zeros((1, len(plain.inputs))), np.zeros((1, len(channels)))
    _, A, C = Tracker(plain, np.zeros(1), u, y, channels, np.ones(n)).linearized(np.zeros((1, n)))
    return plain.states, A[0], C[0]


def _of_plant(plain: Model, channels: tuple[str, ...]) -> tuple[str, ...]:
    """Return the channels, those that show a state of an effect as the plant's state that it moves with."""
    return tuple(c if c in plain.states else twin(c, plain.states) or c for c in channels)


def _process_noise(model: Model, states: tuple[str, ...], noise: Sizes, speed: float, dt: float, tau: float) -> Array:
    """Return the variances (n,) that a step adds to the states for a time constant tau: a measured state wanders by its
    noise in tau, a velocity by its position's noise / tau, or else by a share of its size, ``speed``.
    """
    velocity, position = model.plant.velocity, model.plant.position
    wander = np.zeros(len(states))
    for i, name in enumerate(states):
        own = [noise[name] * dt / tau] if name in noise else []
        if name == velocity:
            own += [noise[position] * dt / tau**2] if position in noise else []
            own = own or [0.01 * speed * dt / tau]
        if name != position or velocity not in states:
            wander[i] = min(own, default=0.0)
    return wander**2


def input_variances(model: Model, channels: tuple[str, ...], sigma: Array, dt: float) -> Array:
    """Return the variances (n,) that white noise of the inputs, held between samples, adds to the states in a step;
    ``sigma`` (m,): its standard deviations.
    """
    plain, (states, A, _) = bare(model), linear_base(model, channels)
    n, m, channels = len(states), len(plain.inputs), _of_plant(plain, channels)
    u, y, rest = np.vstack([np.zeros(m), np.eye(m)]), np.zeros((m + 1, len(channels))), np.zeros((m + 1, n))
    rates, _, _ = Tracker(plain, np.arange(m + 1.0), u, y, channels, np.ones(n)).linearized(rest)
    whole = np.zeros((n + m, n + m))
    whole[:n] = np.column_stack([A, (rates[1:] - rates[0]).T])
    return np.asarray(expm(whole * dt)[:n, n:] ** 2 @ sigma**2)


def design(
    model: Model, noise: Sizes, sizes: Sizes, dt: float, tau: float, known: Sizes, inputs: Array | None = None
) -> ObserverGains:
    """Return the Kalman gains of the base model for a time constant tau (s); ``known``: how well states begin known;
    ``inputs`` (n,): variances that a step adds for inputs that are not better known, where these are larger.
    """
    states, A, C = linear_base(model, tuple(noise))
    added = _process_noise(model, states, noise, sizes.get(model.plant.velocity, 1.0), dt, tau)
    added = added if inputs is None else np.maximum(added, inputs)
    first = {s: INITIAL_VARIANCE * noise[s] ** 2 if s in noise else sizes.get(s, 1.0) ** 2 for s in states}
    begun = np.array([min(first[s], known.get(s, np.inf) ** 2) for s in states])
    values = np.zeros((MAX_GAIN_SAMPLES, *C.T.shape))
    variances = np.zeros((MAX_GAIN_SAMPLES, len(C)))
    seen = np.array([*noise.values()]) ** 2
    used = kalman_gains(expm(A * dt), np.ravel(C), np.diag(added), seen, np.diag(begun), values, variances)
    weights = np.sqrt(variances[used - 1] / variances[:used])
    return ObserverGains(tau, states, values[:used].copy(), weights, np.array([added, begun]))


def uncorrected(states: tuple[str, ...], channels: int) -> ObserverGains:
    """Return the gains of no observer: a free run, for a plant whose own loop keeps it near what was measured."""
    n = len(states)
    return ObserverGains(LOOP, states, np.zeros((1, n, channels)), np.ones((1, channels)), np.zeros((2, n)))


def time_constants(dt: float, duration: float, horizon: float) -> tuple[float, ...]:
    """Return the observer's time constants in s from high to low gain, the first for searching only."""
    high, low = 8 * dt, max(min(2.0, duration / 8), 16 * dt)
    middle = float(np.clip(max(np.sqrt(high * low), horizon), high, low))
    return (high, middle, float(np.sqrt(middle * low)), low)


__all__ = ["ObserverGains", "design", "input_variances", "linear_base", "time_constants", "uncorrected"]
