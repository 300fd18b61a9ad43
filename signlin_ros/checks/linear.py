"""How the linear part of a model follows a record: by a constant observer whose innovations are linear in the record.

What each input and each channel adds to the innovations is worked out once. What the record would leave with a channel
in another unit, reversed, or replaced, is then a sum of these, and costs nothing. [Kalman filter in steady state:
Anderson and Moore, Optimal Filtering, 1979, ch. 4; recursions by the Schur form, one first-order filter a mode.]
"""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from signlin_ros.model import Model
from signlin_ros.records import ModelData
from signlin_ros.symbolic import symbolic
from signlin_ros.trace import Structure, trace

Array = NDArray[np.float64]

TRUST, NOISY = 0.03, 0.03
"""Errors of the model's equations, and of the sensors, in shares of what they hold: what the observer is made for."""
PERSISTENCE = 0.1
"""How long, in s, an error of an equation lasts."""
MOST, LEAST = 20_000, 60
"""So many samples are followed at most, and at least."""
HOLE = 5.0
"""A step longer than this many median steps is a gap."""
START = 0.05
"""Share of the samples in which the observer forgets where it began."""
PULSE = 100
"""So many samples tell what a pulse of the input leaves."""
ONE = "1"
"""The name of what the equations hold whatever the record says."""


@dataclass(frozen=True)
class Base:
    """x' = A x + B u + c, (n, n), (n, m), (n,): a model at rest, its switches in the middle; channels y = C x + D u + e
    of every state and output by name. ``delay`` of the input in s.
    """

    A: Array
    B: Array
    c: Array
    rows: dict[str, tuple[Array, Array, float]]
    inputs: tuple[str, ...]
    delay: float

    def seen_by(self, channels: Sequence[str]) -> Base:
        """Return the part that some channels show: the states that they depend on, and those that these depend on."""
        kept = np.any([(self.rows[name][0] != 0.0) for name in channels], axis=0)
        for _ in range(kept.size):
            kept = kept | np.any(self.A[kept] != 0.0, axis=0)
        rows = {name: (C[kept], D, e) for name, (C, D, e) in self.rows.items()}
        return replace(self, A=self.A[np.ix_(kept, kept)], B=self.B[kept], c=self.c[kept], rows=rows)

    @property
    def rates(self) -> Array:
        """The sizes of the poles (n,) in 1/s, 0 for what is integrated."""
        return np.asarray(np.abs(np.linalg.eigvals(self.A)), dtype=float)

    @property
    def damping(self) -> Array:
        """How fast each motion dies out (n,), in 1/s."""
        return np.asarray(-np.linalg.eigvals(self.A).real, dtype=float)


@symbolic
@functools.lru_cache(maxsize=64)
def _linear_function(structure: Structure) -> ca.Function:
    """Return the function (x, u, p, s) -> A, B, f, C, D, y, as expressions of one structure."""
    t = trace(structure)
    signs = ca.vertcat(*(s.symbol for s in t.surfaces)) if t.surfaces else ca.SX(0, 1)
    g = ca.vertcat(*(s.g for s in t.surfaces)) if t.surfaces else ca.SX(0, 1)
    y = ca.densify(t.y)
    parts = [ca.jacobian(t.f, t.x), ca.jacobian(t.f, t.u), t.f, ca.jacobian(y, t.x), ca.jacobian(y, t.u), y, g]
    return ca.Function("base", [t.x, t.u, t.p, signs], [ca.densify(part) for part in parts])


def linear_base(model: Model) -> Base | None:
    """Return the linear part of a model; None where it is not finite."""
    function, n, m = _linear_function(model.structure), len(model.states), len(model.inputs)
    rest = np.zeros(n), np.zeros(m), model.p
    count = function.size1_in(3)
    surfaces = np.asarray(function(*rest, np.zeros(count))[6]).ravel()
    A, B, f, C, D, y, _ = (np.asarray(part, dtype=float) for part in function(*rest, np.sign(surfaces)))
    if not all(np.isfinite(part).all() for part in (A, B, f, C, D, y)):
        return None
    rows = {name: (np.eye(n)[i], np.zeros(m), 0.0) for i, name in enumerate(model.states)}
    others = [name for name in model.outputs if name not in model.states]
    rows |= {name: (C[i], D[i], float(y.ravel()[i])) for i, name in enumerate(others) if i < len(C)}
    return Base(A, B.reshape(n, m), f.ravel(), rows, model.inputs, model.delay)


@dataclass(frozen=True, eq=False)
class Prediction:
    """What a record leaves of an observer of a linear base.

    ``sources``: the inputs, the channels and `ONE`; ``grams`` (ny, k, k): mean products of what each adds to the
    innovations of each channel; ``spread`` (ny,): standard deviations of the channels; ``samples`` that tell it.
    """

    channels: tuple[str, ...]
    sources: tuple[str, ...]
    grams: Array
    spread: Array
    samples: int

    def lefts(self, scales: Sequence[Mapping[str, float]]) -> Array:
        """Return `left` for several choices of scales (k,)."""
        s = np.array([[one.get(name, 1.0) for name in self.sources] for one in scales])
        own = np.abs(s[:, [self.sources.index(name) for name in self.channels]])
        left = np.sqrt(np.maximum(np.einsum("jab,ka,kb->kj", self.grams, s, s, optimize=True), 0.0))
        return np.asarray(np.exp(np.mean(np.log(np.maximum(left / (own * self.spread), 1e-12)), axis=1)))

    def shares(self, scales: Mapping[str, float] | None = None) -> Array:
        """Return what is left of every channel (ny,), as a share of its spread, with some sources multiplied."""
        s = np.array([(scales or {}).get(name, 1.0) for name in self.sources])
        own = np.array([s[self.sources.index(name)] for name in self.channels])
        left = np.einsum("jab,a,b->j", self.grams, s, s)
        return np.asarray(np.sqrt(np.maximum(left, 0.0)) / np.maximum(np.abs(own) * self.spread, 1e-300))

    def left(self, scales: Mapping[str, float] | None = None) -> float:
        """Return the geometric mean of `shares`."""
        return float(np.exp(np.mean(np.log(np.maximum(self.shares(scales), 1e-12)))))


def prediction(
    base: Base, record: ModelData, channels: Sequence[str], extra: Mapping[str, Array] | None = None
) -> Prediction | None:
    """Return how an observer of a base follows a record; None where it cannot be made, or the record is too short.

    ``extra`` (T,): further inputs by name, each acting as the first input does; they count nothing until scaled.
    """
    channels = tuple(name for name in channels if name in base.rows and np.ptp(_finite(record.measured[name])) > 0)
    part = _longest(record.t)
    if not channels or part.stop - part.start < LEAST:
        return None
    base = base.seen_by(channels)
    t, u, y, more = _even(record, part, channels, extra or {}, base.delay)
    design = _design(base, channels, u, t[1] - t[0])
    if design is None or t.size < LEAST:
        return None
    sources = (*base.inputs, *channels, ONE, *more)
    driven = np.column_stack([u, y, np.ones(t.size), *more.values()])
    left = _innovations(base, channels, design, driven, len(more))[:, int(START * t.size) :]
    left = left - left.mean(axis=1, keepdims=True)
    grams = np.einsum("atj,btj->jab", left, left) / left.shape[1]
    return Prediction(channels, sources, grams, y.std(axis=0), left.shape[1])


def required_sign(base: Base, record: ModelData, channels: Sequence[str]) -> Array | None:
    """Return the sign (T,) that the first input must have had for the base to follow a record: what is left without it,
    matched with what a pulse of it leaves; 0 where the record is not followed (`MOST`). None where nothing tells.
    """
    from scipy.signal import fftconvolve

    channels = tuple(name for name in channels if name in base.rows and np.ptp(_finite(record.measured[name])) > 0)
    part = _longest(record.t)
    if not channels or part.stop - part.start < LEAST:
        return None
    base = base.seen_by(channels)
    t, u, y, _ = _even(record, part, channels, {}, base.delay)
    design = _design(base, channels, u, t[1] - t[0])
    if design is None:
        return None
    driven = np.column_stack([u, y, np.ones(t.size)])
    left = _innovations(base, channels, design, driven, 0)[1:].sum(axis=0)
    pulse = np.zeros((min(t.size, PULSE), driven.shape[1]))
    pulse[0, 0] = 1.0
    shape = -_innovations(base, channels, design, pulse, 0)[0] / y.std(axis=0)
    wanted = np.stack(
        [fftconvolve(e, g[::-1])[g.size - 1 :] for e, g in zip((left / y.std(axis=0)).T, shape.T, strict=True)]
    )
    grid = np.sign(wanted.sum(axis=0))
    at = np.clip(np.searchsorted(t, record.t, side="right") - 1, 0, t.size - 1)
    inside = (record.t >= t[0]) & (record.t <= t[-1] + 1e-9)
    return np.where(inside, grid[at], 0.0)


def _finite(values: Array) -> Array:
    good = values[np.isfinite(values)]
    return good if good.size else np.zeros(1)


def _longest(t: Array) -> slice:
    """Return the longest stretch of stamps (T,) without a gap, of `MOST` samples at most."""
    steps = np.diff(t)
    if not steps.size:
        return slice(0, 0)
    edges = np.concatenate([[0], np.flatnonzero(steps > HOLE * np.median(steps)) + 1, [t.size]])
    k = int(np.argmax(np.diff(edges)))
    return slice(int(edges[k]), int(min(edges[k + 1], edges[k] + MOST)))


def _even(
    record: ModelData, part: slice, channels: tuple[str, ...], extra: Mapping[str, Array], delay: float
) -> tuple[Array, Array, Array, dict[str, Array]]:
    """Return t (T,), u (T, m), y (T, ny) and the extra inputs (T,) on an even grid, inputs held, samples filled in."""
    t = record.t[part]
    step = float(np.median(np.diff(t)))
    grid = t[0] + step * np.arange(int((t[-1] - t[0]) / step + 1e-6) + 1)
    held = np.maximum(np.searchsorted(t + delay, grid + 1e-6 * step, side="right") - 1, 0)
    y = [_filled(grid, t, record.measured[name][part]) for name in channels]
    more = {name: values[part][held] for name, values in extra.items()}
    return grid, record.u[part][held], np.column_stack(y), more


def _filled(grid: Array, t: Array, values: Array) -> Array:
    good = np.isfinite(values)
    return np.interp(grid, t[good], values[good]) if good.any() else np.zeros(grid.size)


@dataclass(frozen=True, eq=False)
class _Design:
    """A constant observer: x+ = A x + B u + b + K (y - C x - D u - e)."""

    A: Array
    B: Array
    b: Array
    K: Array
    C: Array
    D: Array
    e: Array


def _design(base: Base, channels: tuple[str, ...], u: Array, step: float) -> _Design | None:
    """Return the observer for a record with inputs u (T, m) every ``step`` s."""
    from scipy.linalg import LinAlgError, expm, solve_discrete_are

    n, m = base.B.shape
    C, D = (np.stack([base.rows[name][i] for name in channels]) for i in (0, 1))
    e = np.array([base.rows[name][2] for name in channels])
    whole = np.zeros((n + m + 1, n + m + 1))
    whole[:n] = np.column_stack([base.A, base.B, base.c])
    moved = expm(whole * step)
    A, B, b = moved[:n, :n], moved[:n, n : n + m], moved[:n, n + m]
    x, rates = _sizes(base, A, B, u)
    if not (np.isfinite(A).all() and np.isfinite(x).all()):
        return None
    size = np.maximum(x, 1e-9 * max(float(x.max(initial=0.0)), 1e-30))
    disturbed = np.where(_kinematic(base), 1e-6, TRUST) * np.maximum(rates, 1e-12)
    Q = np.diag(disturbed**2 * PERSISTENCE * step + (1e-6 * size) ** 2)
    shown = np.abs(C) @ size + np.abs(D) @ u.std(axis=0)
    R = np.diag((NOISY * np.maximum(shown, 1e-12)) ** 2)
    try:
        P = solve_discrete_are((A.T * size[:, None] / size).copy(), *_scaled(C, Q, R, size))
    except (LinAlgError, ValueError):
        return None
    P = P * size[:, None] * size
    K = A @ P @ C.T @ np.linalg.inv(C @ P @ C.T + R)
    return _Design(A, B, b, K, C, D, e) if np.isfinite(K).all() else None


def _scaled(C: Array, Q: Array, R: Array, size: Array) -> tuple[Array, Array, Array]:
    """Return what the Riccati equation takes in units of the states' sizes (n,)."""
    return (C * size).T.copy(), Q / size[:, None] / size, R


def _sizes(base: Base, A: Array, B: Array, u: Array) -> tuple[Array, Array]:
    """Return how large the states (n,) and what their equations hold (n,) are under inputs u (T, m)."""
    x = _run(A, [_times(B, u.T)])[0]
    x = x - x.mean(axis=1, keepdims=True)
    size = np.sqrt(np.mean(x**2, axis=1))
    rates = np.abs(base.A) @ size + np.abs(base.B) @ np.sqrt(np.mean(u**2, axis=0))
    return size, rates


def _kinematic(base: Base) -> NDArray[np.bool_]:
    """Return which equations (n,) say no more than that one state is the rate of another."""
    whole = np.column_stack([base.A, base.B])
    return np.asarray((np.count_nonzero(whole, axis=1) == 1) & (np.abs(whole).max(axis=1, initial=0.0) == 1.0))


def _run(A: Array, forces: Sequence[Array]) -> list[Array]:
    """Return the states (n, T) that x+ = A x + g leads to from 0 under each of several g (n, T)."""
    from scipy.linalg import schur
    from scipy.signal import lfilter

    T, U = schur(A.astype(complex), output="complex")
    found = []
    for g in forces:
        h, z = _times(U.conj().T, g), np.zeros(g.shape, dtype=complex)
        for i in range(A.shape[0] - 1, -1, -1):
            z[i] = lfilter([0.0, 1.0], [1.0, -T[i, i]], h[i] + _times(T[i : i + 1, i + 1 :], z[i + 1 :])[0])
        found.append(_times(U, z).real)
    return found


def _times(small: NDArray[Any], wide: NDArray[Any]) -> NDArray[Any]:
    """Return the product of a small matrix and a wide one (n, T), for which threads of a BLAS wait for each other."""
    return np.asarray(np.einsum("ij,jt->it", small, wide))


def _innovations(base: Base, channels: tuple[str, ...], d: _Design, driven: Array, more: int) -> Array:
    """Return what each source (T, k) adds to the innovations: (k, T, ny). The last ``more`` act as the first input."""
    m, ny = len(base.inputs), len(channels)
    forces, direct = [], []
    for k, column in enumerate(driven.T):
        j = k if k < m else (0 if k >= driven.shape[1] - more else -1)
        if j >= 0:
            forces.append((d.B[:, j] - d.K @ d.D[:, j])[:, None] * column)
            direct.append(-np.outer(column, d.D[:, j]))
        elif k < m + ny:
            forces.append(d.K[:, k - m][:, None] * column)
            direct.append(np.outer(column, np.eye(ny)[k - m]))
        else:
            forces.append((d.b - d.K @ d.e)[:, None] * column)
            direct.append(-np.outer(column, d.e))
    states = _run(d.A - d.K @ d.C, forces)
    return np.stack([own - _times(d.C, x).T for own, x in zip(direct, states, strict=True)])


__all__ = ["ONE", "Base", "Prediction", "linear_base", "prediction", "required_sign"]
