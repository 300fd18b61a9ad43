"""Gains of the observers, from high to low: Kalman filters of the linear base model for several time constants."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from signlin_ros.follow.equations import equations, neutral_sensors
from signlin_ros.follow.kalman import kalman_gains
from signlin_ros.follow.segments import Segment, twin
from signlin_ros.model import Model

Array = NDArray[np.float64]
SETTLED = 25.0
"""Variance of the initial state in variances of the measurement noise."""


@dataclass(frozen=True)
class Gains:
    """Kalman gains (G, n, ny) for the states ``names``; ``tau`` is the observer's time constant in s.

    ``weights`` (G, ny): what the first innovations count, made uncertain as they are by the unknown initial state.
    ``spread`` (2, n): variances that a step adds to the states, and those that they start with; (2, 0): not known.
    """

    tau: float
    names: tuple[str, ...]
    values: Array
    weights: Array
    spread: Array = field(default_factory=lambda: np.zeros((2, 0)))

    def rows(self, states: tuple[str, ...]) -> Array:
        """Return the gains for a model with these states: an effect's own position or velocity moves with the
        plant's; its other states are not corrected.
        """
        result = np.zeros((self.values.shape[0], len(states), self.values.shape[2]))
        for i, name in enumerate(states):
            source = name if name in self.names else twin(name, self.names)
            if source:
                result[:, i] = self.values[:, self.names.index(source)]
        return result


def bare(model: Model) -> Model:
    """Return the plant without any effect."""
    for key in list(model.effects):
        model = model.without_effect(key)
    return model


def linear_base(model: Model, channels: tuple[str, ...]) -> tuple[tuple[str, ...], Array, Array, Array]:
    """Return (states, A, B, C) of the bare plant at rest: what the observer is designed for."""
    plain = bare(model)
    eq = equations(plain.structure, channels, ())
    n, m, ny = eq.sizes[:3]
    point = np.concatenate([np.zeros(n + m), plain.p, neutral_sensors(ny), [0.0]])
    columns = eq.keep.batch([*point])[:, 0]
    A = columns[eq.places.J :][: n * n].reshape(n, n)
    C = columns[eq.places.h_x :][: ny * n].reshape(ny, n)
    moved = [eq.keep.batch([*(point + np.eye(point.size)[n + j])])[:n, 0] for j in range(m)]
    B = np.column_stack([f - columns[:n] for f in moved])
    return plain.states, A, B, C


def stepped(A: Array, B: Array, dt: float) -> tuple[Array, Array]:
    """Return the transition (n, n) of x' = A x + B u over dt, and what a unit of u (m), held for dt, adds (n, m)."""
    n, m = B.shape
    whole = expm(np.block([[A, B], [np.zeros((m, n + m))]]) * dt)
    return whole[:n, :n], whole[:n, n:]


def _process_noise(model: Model, states: tuple[str, ...], sizes: dict[str, float], dt: float, tau: float) -> Array:
    """Return the variance added to every state in a step, for an observer with time constant tau.

    A measured state wanders by its noise in tau; a velocity whose position is measured by noise / tau in tau.
    """
    velocity, position = model.plant.velocity, model.plant.position
    wander = np.zeros(len(states))
    for i, name in enumerate(states):
        if name == position and velocity in states:
            continue
        own = [sizes[name] * dt / tau] if name in sizes else []
        if name == velocity and position in sizes and position in states:
            own.append(sizes[position] * dt / tau**2)
        if name == velocity and not own:
            own = [0.01 * sizes.get("fallback", 1.0) * dt / tau]
        wander[i] = min(own) if own else 0.0
    return np.diag(wander**2)


def doubts(segments: Sequence[Segment]) -> dict[str, float]:
    """Return the states that are imposed and recorded, and by how much they may be off at the start of any record.

    An observer that were uncertain of more would hide a load in their zero.
    """
    return {name: max(s.doubt.get(name, np.inf) for s in segments) for name in segments[0].doubt}


def design(
    model: Model,
    channels: tuple[str, ...],
    noise: Array,
    sizes: dict[str, float],
    dt: float,
    tau: float,
    known: Mapping[str, float] | None = None,
) -> Gains:
    """Return the gains of an observer with time constant tau (s); it starts uncertain of all states, of those ``known``
    by no more than so much.
    """
    states, A, _, C = linear_base(model, channels)
    measured = {c: float(s) for c, s in zip(channels, noise, strict=True)}
    measured["fallback"] = sizes.get(model.plant.velocity, 1.0)
    Q = _process_noise(model, states, measured, dt, tau)
    first = {s: SETTLED * measured[s] ** 2 if s in measured else sizes.get(s, 1.0) ** 2 for s in states}
    P0 = np.diag([min(first[s], (known or {}).get(s, np.inf) ** 2) for s in states])
    return _kalman(states, expm(A * dt), C, Q, noise, P0, tau)


def _kalman(states: tuple[str, ...], Ad: Array, C: Array, Q: Array, noise: Array, P0: Array, tau: float) -> Gains:
    """Return the gains of the Kalman filter of a discrete model, from what is known at the start on."""
    values = np.zeros((20_000, len(states), noise.size))
    variances = np.zeros((20_000, noise.size))
    used = kalman_gains(Ad, np.ravel(C), Q, noise**2, P0, values, variances)
    spread = np.array([np.diag(Q), np.diag(P0)])
    last = variances[used - 1]
    return Gains(tau, states, values[:used].copy(), np.sqrt(last / variances[:used]), spread)


def time_constants(dt: float, duration: float, horizon: float) -> tuple[float, ...]:
    """Return the observer's time constants from high to low gain in s; ``horizon``: over which the model is used.

    The first is for searching only; models are compared at the others, which are not shorter than the horizon.
    """
    high, low = 8 * dt, max(min(2.0, duration / 8), 16 * dt)
    middle = float(np.clip(max(np.sqrt(high * low), horizon), high, low))
    return (high, middle, float(np.sqrt(middle * low)), low)


__all__ = ["Gains", "bare", "design", "doubts", "linear_base", "stepped", "time_constants"]
