"""An observer of a linear base that follows a record: its innovations are linear in what is recorded.

What each input and each channel adds to the innovations is worked out once. What the record would leave with a channel
in another unit, reversed, or replaced, is then a sum of these, and costs nothing. [Kalman filter in steady state:
Anderson and Moore, Optimal Filtering, 1979, ch. 4; recursions by the Schur form, one first-order filter a mode.]
"""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from signlin_ros.checks.linear import Base
from signlin_ros.records import ModelData
from signlin_ros.records.clean import MIN_HOLE_STEPS

Array = NDArray[np.float64]

TRUST, SENSOR_ERROR_SHARE = 0.03, 0.03
"""Errors of the model's equations, and of the sensors, in shares of what they hold: what the observer is made for."""
MODEL_ERROR_TIME = 0.1
"""How long, in s, an error of an equation lasts."""
MAX_FOLLOWED_SAMPLES, MIN_FOLLOWED_SAMPLES = 20_000, 60
"""So many samples are followed at most, and at least."""
FORGETTING_SHARE = 0.05
"""Share of the samples in which the observer forgets where it began."""
CONSTANT_SOURCE = "1"
"""The name of what the equations hold whatever the record says."""
REWEIGHTING_ROUNDS = 2
"""The sum of logarithms is made least by least squares with the weights of the last round: none makes it larger."""
GONE = 1e-6
"""Part of what a start does at its most, beneath which the observer has forgotten it."""
ROUNDING_SHARE = 1e-18
"""Part of the largest answer to a source below which what answers to another is rounding."""
BEGUN = "start: "
"""What the name of a state begins with where it stands for where that state was at the first sample."""


@dataclass(frozen=True, eq=False)
class Discrete:
    """x+ = A x + B u + b, y = C x + D u + e, over one step."""

    A: Array
    B: Array
    b: Array
    C: Array
    D: Array
    e: Array

    @classmethod
    def of(cls, base: Base, channels: Sequence[str], step: float) -> Discrete:
        """Return the difference equations of a base that shows channels, for inputs held over ``step`` s."""
        from scipy.linalg import expm

        n, m = base.B.shape
        C, D = (np.stack([base.rows[name][i] for name in channels]) for i in (0, 1))
        whole = np.zeros((n + m + 1, n + m + 1))
        whole[:n] = np.column_stack([base.A, base.B, base.c])
        moved = expm(whole * step)
        e = np.array([base.rows[name][2] for name in channels])
        return cls(moved[:n, :n], moved[:n, n : n + m], moved[:n, n + m], C, D, e)


@dataclass(frozen=True, eq=False)
class Followed:
    """A record on an even grid, t (T,), u (T, m), y (T, ny), and the observer that follows it: gain K (n, ny).

    ``base``: the part of it that the channels show; ``more`` (T,): further inputs, each acting as the first one does.
    """

    base: Base
    channels: tuple[str, ...]
    t: Array
    u: Array
    y: Array
    more: Mapping[str, Array]
    design: Discrete
    K: Array

    @property
    def step(self) -> float:
        """The time between samples in s."""
        return float(self.t[1] - self.t[0])

    def discrete(self, base: Base) -> Discrete:
        """Return the difference equations of another base for the same channels and steps."""
        return Discrete.of(base.seen_by(self.channels), self.channels, self.step)

    def rates(self) -> Array:
        """Return the RMS (n,) of the rates of the base, driven by the inputs of the record."""
        return _sizes(self.base, self.design.A, self.design.B, self.u)[1]

    def innovations(self, d: Discrete | None = None) -> Array:
        """Return the innovations (T, ny); of other equations with the same gain if they are given."""
        d = self.design if d is None else d
        known = self.y.T - _times(d.D, self.u.T) - d.e[:, None]
        force = _times(d.B, self.u.T) + d.b[:, None] + _times(self.K, known)
        return np.asarray((known - _times(d.C, run(d.A - self.K @ d.C, [force])[0])).T)

    def answer(self, way: Array, values: Array) -> Array:
        """Return the innovations (T, ny) that values (T,) cause, which act on the states' rates in a way (n,)."""
        pushed = Discrete.of(replace(self.base, c=way), self.channels, self.step).b
        force = pushed[:, None] * values
        return np.asarray(-_times(self.design.C, run(self.design.A - self.K @ self.design.C, [force])[0]).T)

    def parts(self) -> Array:
        """Return the innovations (k, T, ny) that every source causes: inputs, channels, `CONSTANT_SOURCE`, and
        ``more``.
        """
        d, K = self.design, self.K
        ways = [(d.B[:, j], d.D[:, j], column) for j, column in enumerate(self.u.T)]
        shown = np.eye(len(self.channels))
        ways += [(np.zeros(len(d.A)), -shown[j], column) for j, column in enumerate(self.y.T)]
        ways.append((d.b, d.e, np.ones(self.t.size)))
        ways += [(d.B[:, 0], d.D[:, 0], column) for column in self.more.values()]
        states = run(d.A - K @ d.C, [(b - K @ direct)[:, None] * column for b, direct, column in ways])
        pairs = zip(ways, states, strict=True)
        return np.stack([-(direct[:, None] * c + _times(d.C, x)).T for (_, direct, c), x in pairs])

    def begun(self) -> list[Array]:
        """Return the innovations (T, ny) that a unit of each state at the first sample causes."""
        d, first = self.design, np.zeros(self.t.size)
        first[0] = 1.0  # x(1) = (A - K C) x(0), and x(0) is seen at the first sample besides
        closed = d.A - self.K @ d.C
        ways = [(closed[:, i], d.C[:, i]) for i in range(len(d.A))]
        states = run(closed, [way[:, None] * first for way, _ in ways])
        return [-(_times(d.C, x) + c[:, None] * first).T for (_, c), x in zip(ways, states, strict=True)]


def follow(
    base: Base, record: ModelData, channels: Sequence[str], more: Mapping[str, Array] | None = None
) -> Followed | None:
    """Return how an observer of a base follows a record; None where none can be made, or the record is too short."""
    channels = tuple(name for name in channels if name in base.rows and np.ptp(_finite(record.measured[name])) > 0)
    part = _longest(record.t)
    if not channels or part.stop - part.start < MIN_FOLLOWED_SAMPLES:
        return None
    base = base.seen_by(channels)
    t, u, y, extra = _even(record, part, channels, more or {}, base.delay)
    d = Discrete.of(base, channels, float(t[1] - t[0]))
    K = _gain(base, d, u, float(t[1] - t[0])) if t.size >= MIN_FOLLOWED_SAMPLES else None
    return None if K is None else Followed(base, channels, t, u, y, extra, d, K)


@dataclass(frozen=True, eq=False)
class LinearPrediction:
    """What a record leaves of an observer of a linear base.

    ``sources``: the inputs, the channels, `CONSTANT_SOURCE`, further inputs, and where the states were at the first
    sample, as far as the observer has not forgotten it (a short record is all start); ``grams`` (ny, k, k): mean
    products of what each adds to the innovations of each channel; ``spread`` (ny,): standard deviations of the
    channels; ``samples`` that tell it; ``free``: starts, and further inputs, that count with the size that suits best,
    which is not negative where a channel is named with it: turned with the sign of that.
    """

    channels: tuple[str, ...]
    sources: tuple[str, ...]
    grams: Array
    spread: Array
    samples: int
    free: Mapping[str, str] = field(default_factory=dict)

    def lefts(self, scales: Sequence[Mapping[str, float]]) -> Array:
        """Return `left` for several choices of scales (k,)."""
        return np.asarray(np.exp(np.mean(np.log(np.maximum(self._shares(scales), 1e-12)), axis=1)))

    def shares(self, scales: Mapping[str, float] | None = None) -> Array:
        """Return the residual of every channel (ny,), as a share of its spread, with some sources multiplied."""
        return np.asarray(self._shares([scales or {}])[0])

    def left(self, scales: Mapping[str, float] | None = None) -> float:
        """Return the geometric mean of `shares`."""
        return float(self.lefts([scales or {}])[0])

    def _shares(self, scales: Sequence[Mapping[str, float]]) -> Array:
        """Return `shares` (k, ny) for several choices of scales."""
        s = np.array([[one.get(n, 0.0 if n in self.free else 1.0) for n in self.sources] for one in scales])
        own = np.abs(s[:, [self.sources.index(name) for name in self.channels]]) * self.spread
        found = self._squares(s)
        for _ in range(REWEIGHTING_ROUNDS if self.free else 0):  # the channels count by their logarithms, as in `left`
            more = self._squares(self._with_free(s, 1.0 / np.maximum(found, 1e-300)))
            better = np.log(more + 1e-300).sum(axis=1) < np.log(found + 1e-300).sum(axis=1)
            found = np.where(better[:, None], more, found)
        return np.asarray(np.sqrt(found) / np.maximum(own, 1e-300))

    def _squares(self, s: Array) -> Array:
        """Return mean squared innovations (k, ny) for scales of all sources (k, sources)."""
        return np.asarray(np.maximum(np.einsum("jkb,kb->kj", s @ self.grams, s), 0.0))

    @functools.cached_property
    def _of_free(self) -> tuple[list[int], Array, NDArray[np.bool_], Array, Array, Array]:
        """Return where the free sources stand, their least scales, which are silent, the sizes that divide them, and
        `grams` of them with each other (ny, free, free) and with all (ny, k, free).
        """
        at = [self.sources.index(name) for name in self.free]
        least = np.array([0.0 if c else -np.inf for c in self.free.values()])
        answers = np.einsum("jaa->a", self.grams)
        silent = (
            answers[at] <= ROUNDING_SHARE * answers.max()
        )  # an observer that forgets constants is left nothing of one
        size = np.where(silent, np.inf, np.sqrt(answers[at] + 1e-300))
        of_all = np.ascontiguousarray(np.swapaxes(self.grams[:, at] / size[:, None], 1, 2))
        return at, least, silent, size, self.grams[:, at][:, :, at] / size / size[:, None], of_all

    def _with_free(self, s: Array, weights: Array) -> Array:
        """Return scales (k, sources) with those of the free inputs by least squares; ``weights`` (k, ny)."""
        at, least, silent, size, of_each, of_all = self._of_free
        A = np.einsum("kj,jab->kab", weights, of_each)
        g = -np.einsum("kj,jka->ka", weights, s @ of_all)
        turned = [
            np.sign(s[:, self.sources.index(c)]) if c in self.sources else np.ones(len(s)) for c in self.free.values()
        ]
        sign = np.stack(turned, axis=1)
        A, g = A * sign[:, :, None] * sign[:, None, :], g * sign
        ridge = 1e-9 * np.einsum("kaa->k", A)[:, None, None] * np.eye(len(at)) + np.diag(silent.astype(float))
        found = np.linalg.solve(A + ridge, g[:, :, None])[:, :, 0]
        below = found < least
        held = np.where(below[:, :, None] | below[:, None, :], np.eye(len(at)), A + ridge)
        found = np.linalg.solve(held, np.where(below, 0.0, g)[:, :, None])[:, :, 0] if below.any() else found
        whole = np.array(s)
        whole[:, at] = found * sign / size
        return whole


@dataclass(frozen=True, eq=False)
class Together:
    """What several records with the same columns leave, as one `LinearPrediction`: their geometric mean by samples."""

    parts: tuple[LinearPrediction, ...]

    @classmethod
    def of(cls, parts: Sequence[LinearPrediction]) -> Together:
        """Return several predictions as one."""
        return cls(tuple(parts))

    @property
    def channels(self) -> tuple[str, ...]:
        """The channels of all records."""
        return tuple(n for n in self.parts[0].channels if all(n in p.channels for p in self.parts))

    @property
    def sources(self) -> tuple[str, ...]:
        """The sources of all records."""
        return tuple(n for n in self.parts[0].sources if all(n in p.sources for p in self.parts))

    @property
    def free(self) -> Mapping[str, str]:
        """The sources that count with the size that suits best."""
        return self.parts[0].free

    def lefts(self, scales: Sequence[Mapping[str, float]]) -> Array:
        """Return `left` for several choices of scales (k,)."""
        sizes = [p.samples for p in self.parts]
        return np.asarray(np.exp(np.average([np.log(p.lefts(scales)) for p in self.parts], axis=0, weights=sizes)))

    def left(self, scales: Mapping[str, float] | None = None) -> float:
        """Return the residual as a share of the channels' spread."""
        return float(self.lefts([scales or {}])[0])

    def shares(self, scales: Mapping[str, float] | None = None) -> Array:
        """Return the residual of every channel of every record, as a share of its spread."""
        return np.concatenate([p.shares(scales) for p in self.parts])


def prediction(
    base: Base,
    record: ModelData,
    channels: Sequence[str],
    more: Mapping[str, Array] | None = None,
    free: Mapping[str, str] | None = None,
) -> LinearPrediction | None:
    """Return the residual of a record under an observer of a base; None where `follow` does.

    ``more`` (T,): further inputs by name, each acting as the first input does; ``free``: see `LinearPrediction`.
    """
    f = follow(base, record, channels, more)
    return None if f is None else summed(f, free)


def summed(f: Followed, free: Mapping[str, str] | None = None) -> LinearPrediction:
    """Return the residual of a followed record, and its parts by source."""
    first, answers = int(FORGETTING_SHARE * f.t.size), f.begun()
    lasting = [np.abs(one[first:]).max() > GONE * np.abs(one).max() for one in answers]
    begun = tuple(f"{BEGUN}{name}" for name, lasts in zip(f.base.states, lasting, strict=True) if lasts)
    left = np.stack([*f.parts(), *(one for one, lasts in zip(answers, lasting, strict=True) if lasts)])[:, first:]
    left = left - left.mean(axis=1, keepdims=True)
    grams = np.einsum("atj,btj->jab", left, left) / left.shape[1]
    sources = (*f.base.inputs, *f.channels, CONSTANT_SOURCE, *f.more, *begun)
    free = {**(free or {}), **dict.fromkeys(begun, "")}
    return LinearPrediction(f.channels, sources, grams, f.y.std(axis=0), left.shape[1], free)


def _finite(values: Array) -> Array:
    good = values[np.isfinite(values)]
    return good if good.size else np.zeros(1)


def _longest(t: Array) -> slice:
    """Return the longest stretch of stamps (T,) without a gap, of `MAX_FOLLOWED_SAMPLES` samples at most."""
    steps = np.diff(t)
    if not steps.size:
        return slice(0, 0)
    edges = np.concatenate([[0], np.flatnonzero(steps > MIN_HOLE_STEPS * np.median(steps)) + 1, [t.size]])
    k = int(np.argmax(np.diff(edges)))
    return slice(int(edges[k]), int(min(edges[k + 1], edges[k] + MAX_FOLLOWED_SAMPLES)))


def _even(
    record: ModelData, part: slice, channels: tuple[str, ...], extra: Mapping[str, Array], delay: float
) -> tuple[Array, Array, Array, dict[str, Array]]:
    """Return t (T,), u (T, m), y (T, ny) and the extra inputs (T,) on an even grid, inputs held, samples filled in."""
    t = record.t[part]
    step = float(np.median(np.diff(t)))
    grid = t[0] + step * np.arange(int((t[-1] - t[0]) / step + 1e-6) + 1)
    acts = getattr(record, "acts", None)
    acts = t if acts is None else acts[part]
    held = np.maximum(np.searchsorted(acts + delay, grid + 1e-6 * step, side="right") - 1, 0)
    y = [_filled(grid, t, record.measured[name][part]) for name in channels]
    more = {name: values[part][held] for name, values in extra.items()}
    return grid, record.u[part][held], np.column_stack(y), more


def _filled(grid: Array, t: Array, values: Array) -> Array:
    good = np.isfinite(values)
    return np.interp(grid, t[good], values[good]) if good.any() else np.zeros(grid.size)


def _gain(base: Base, d: Discrete, u: Array, step: float) -> Array | None:
    """Return the gain (n, ny) of the observer for inputs u (T, m) every ``step`` s; None where there is none."""
    from scipy.linalg import LinAlgError, solve_discrete_are

    if not d.A.size:  # a force that depends on the imposed motion alone: nothing is left to correct
        return np.zeros((0, len(d.C)))
    x, rates = _sizes(base, d.A, d.B, u)
    if not (np.isfinite(d.A).all() and np.isfinite(x).all()) or not rates.any():
        return None
    size = np.maximum(x, 1e-9 * max(float(x.max(initial=0.0)), 1e-30))
    disturbed = np.where(_kinematic(base), 1e-6, TRUST) * np.maximum(rates, 1e-12)
    Q = np.diag(disturbed**2 * MODEL_ERROR_TIME * step + (1e-6 * size) ** 2)
    shown = np.abs(d.C) @ size + np.abs(d.D) @ u.std(axis=0)
    R = np.diag((SENSOR_ERROR_SHARE * np.maximum(shown, 1e-12)) ** 2)
    try:
        P = solve_discrete_are((d.A.T * size[:, None] / size).copy(), *_scaled(d.C, Q, R, size))
    except (LinAlgError, ValueError):
        return None
    P = P * size[:, None] * size
    K = d.A @ P @ d.C.T @ np.linalg.inv(d.C @ P @ d.C.T + R)
    return K if np.isfinite(K).all() else None


def _scaled(C: Array, Q: Array, R: Array, size: Array) -> tuple[Array, Array, Array]:
    """Return the matrices of the Riccati equation in units of the states' sizes (n,)."""
    return (C * size).T.copy(), Q / size[:, None] / size, R


def _sizes(base: Base, A: Array, B: Array, u: Array) -> tuple[Array, Array]:
    """Return how large the states (n,) and what their equations hold (n,) are under inputs u (T, m)."""
    x = run(A, [_times(B, u.T)])[0]
    x = x - x.mean(axis=1, keepdims=True)
    size = np.sqrt(np.mean(x**2, axis=1))
    rates = np.abs(base.A) @ size + np.abs(base.B) @ np.sqrt(np.mean(u**2, axis=0))
    return size, rates


def _kinematic(base: Base) -> NDArray[np.bool_]:
    """Return which equations (n,) say no more than that one state is the rate of another."""
    whole = np.column_stack([base.A, base.B])
    return np.asarray((np.count_nonzero(whole, axis=1) == 1) & (np.abs(whole).max(axis=1, initial=0.0) == 1.0))


def run(A: Array, forces: Sequence[Array]) -> list[Array]:
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


__all__ = [
    "CONSTANT_SOURCE",
    "FORGETTING_SHARE",
    "Discrete",
    "Followed",
    "LinearPrediction",
    "Together",
    "follow",
    "prediction",
    "run",
    "summed",
]
