"""A stretch of a record followed by a model: run freely, corrected by an observer, or restarted at given states.

All three are one compiled loop (`signlin_ros.follow.loop`): what is measured corrects the state by a gain, which
is zero in a free run, that of a Kalman filter in an observer, and one where the run starts anew.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from signlin_ros.follow.data import Early, Segment, acting
from signlin_ros.follow.equations import equations, neutral_sensors
from signlin_ros.follow.loop import NONE_LATE, follow
from signlin_ros.model import Model

Array = NDArray[np.float64]

RICCATI_DOUBLINGS = 14
"""The Riccati equation is followed over 2^14 samples: what is not observable never settles."""
FINER_SAMPLES = 16
"""Times as many samples on which a model carries what leaves all bounds on those that there are."""
MAX_EXPONENT_NORM = 8.0
"""Norm of a matrix beyond which nothing is left of its smallest parts in its exponential."""


@dataclass(frozen=True)
class TrackedRun:
    """A stretch followed: innovation (T, channels) and state before its correction (T, n).

    ``stopped`` is the sample at which the run left all bounds, None if it did not; what follows it is NaN.
    """

    innovation: Array
    state: Array
    stopped: int | None


class Tracker:
    """Follows a stretch with a model; ``channels`` (states or outputs) are the columns of ``y`` (T, channels).

    ``scale`` (n,) is the size of every state: a run counts as diverged a million times beyond it. ``early``: by how
    many s the input precedes its sample. ``p``: values of the model's parameters in the trace's order, by default its
    own.
    """

    def __init__(
        self,
        model: Model,
        t: Array,
        u: Array,
        y: Array,
        channels: tuple[str, ...],
        scale: Array,
        early: Early = 0.0,
        p: Array | None = None,
    ) -> None:
        self.model, self.channels, self.scale, self.early = model, channels, scale, early
        self.t, self.u, self.y = (np.ascontiguousarray(a, dtype=float) for a in (t, u, y))
        self._equations = equations(model.structure, channels, ())
        self._p = np.concatenate([model.p if p is None else p, neutral_sensors(len(channels))])

    @property
    def acts(self) -> Array | None:
        """From when each row of the input acts (T,), but for what the model says; None: from its sample on."""
        if not isinstance(self.early, np.ndarray):
            return None
        return np.asarray(self.t - self.early + self.model.early * float(np.median(np.diff(self.t))))

    def run(self, x0: Array, gains: Array | None = None) -> TrackedRun:
        """Follow from x0 (n,); ``gains`` (G, n, channels) of the first G samples, the last for all others."""
        e, n, ny, total = self._equations, self.scale.size, len(self.channels), self.t.size
        gains = np.zeros((1, n, ny)) if gains is None else np.ascontiguousarray(gains)
        innovation, state = np.full((total, ny), np.nan), np.full((total, n), np.nan)
        u, acts = acting(self.model, self.t, self.u, self.model.delay - self.early)
        ringing, start = e.ringing(self._p, self.scale), np.array(x0, dtype=float)
        record = (self.t, u, self.y, gains, start, self._p, self.scale, acts, ringing)
        rest = (NONE_LATE, np.zeros((3, 0)), np.ones(ny), innovation, np.zeros((0, ny, 0)), state)
        done = follow(e.calls(False), e.flags(False), *record, *rest)
        innovation[done:], state[done:] = np.nan, np.nan
        return TrackedRun(innovation, state, int(done) if done < total else None)

    def restarted(self, states: Array, at: Sequence[int]) -> TrackedRun:
        """Follow the model itself, started anew from ``states`` (T, n) at the samples ``at``, and at the first one."""
        n = self.scale.size
        gains = np.zeros((self.t.size, n, n))
        gains[np.asarray(at, dtype=int)] = np.eye(n)
        whole = Tracker(self.model, self.t, self.u, states, self.model.states, self.scale, self.early)
        return whole.run(states[0], gains)

    def between(self, states: Array, at: NDArray[np.intp], then: Array) -> Array:
        """Return the states (T, n) at the times ``then`` (T,) of the model started anew from ``states`` (T, n) at the
        samples ``at`` (the first one among them).
        """
        t = np.union1d(self.t, then)
        rows, own = np.searchsorted(self.t, t, side="right") - 1, np.searchsorted(t, self.t[at])
        held = np.full((t.size, states.shape[1]), np.nan)
        held[own] = states[at]
        early = t - np.asarray(self.t - self.early)[rows]
        finer = Tracker(self.model, t, self.u[rows], held, self.model.states, self.scale, early)
        return np.asarray(finer.restarted(held, own.tolist()).state[np.searchsorted(t, then)])

    def linearized(self, x: Array) -> tuple[Array, Array, Array]:
        """Return F (T, n), dF/dx (T, n, n) and dh/dx (T, channels, n) at the states x (T, n) under the inputs."""
        n, _, ny, *_ = self._equations.sizes
        out, at = self._evaluated(x), self._equations.places
        blocks = out[at.J : at.J + n * n].reshape(n, n, -1), out[at.h_x : at.h_x + ny * n].reshape(ny, n, -1)
        J, C = (np.moveaxis(block, -1, 0) for block in blocks)
        return out[:n].T, J, C

    def outputs(self, x: Array) -> Array:
        """Return the readings (T, channels) at the states x (T, n) under the inputs."""
        h = self._equations.places.h
        return np.asarray(self._evaluated(x)[h : h + len(self.channels)].T)

    def _evaluated(self, x: Array) -> Array:
        """Return everything that the equations say at x (T, n), (outputs, T)."""
        tape, n = self._equations.keep, self._equations.sizes[0]
        columns = [*x.T, *self.u.T, *self._p]
        s = np.sign(tape.batch([*columns, 0.0])[n])
        return np.asarray(tape.batch([*columns, s]))


def filled(t: Array, values: Array) -> Array:
    """Return values (T,) with missing samples interpolated."""
    good = np.isfinite(values)
    return values if good.all() else np.interp(t, t[good], values[good])


def mean(values: Array) -> Array:
    """Return the means (ny,) of values (T, ny) without their NaN; 0 for a column that has nothing else."""
    good = np.isfinite(values)
    return np.asarray(np.sum(np.where(good, values, 0.0), axis=0) / np.maximum(good.sum(axis=0), 1))


def mean_square(values: Array) -> Array:
    """Return the mean squares (ny,) of values (T, ny) without their NaN; infinite for a column of nothing else."""
    good = np.isfinite(values)
    return np.where(good.any(axis=0), mean(values**2), np.inf)


def measured_states(model: Model, stretch: Segment, channels: tuple[str, ...]) -> dict[str, Array]:
    """Return the states that a stretch measures or imposes, without holes, a velocity from its position if need be."""
    columns = {c: stretch.y[:, i] for i, c in enumerate(channels) if c in model.states}
    found = {c: filled(stretch.t, v) for c, v in columns.items() if np.isfinite(v).any()} | dict(stretch.known)
    position, velocity = model.plant.position, model.plant.velocity
    if velocity in model.states and velocity not in found and position in found:
        found[velocity] = np.gradient(found[position], stretch.t)
    return found


def driven(
    model: Model, t: Array, u: Array, values: Mapping[str, Array], early: Early = 0.0, p: Array | None = None
) -> Array:
    """Return the states (T, n) where ``values`` (T,) impose some of them: the model carries the others.

    Where it leaves all bounds on these samples, as a stiff bristle does on few of them, it carries them on finer ones,
    between which what is imposed is linear. A state that it cannot carry stays at its initial value. ``p``: see
    `Tracker`.
    """
    names = tuple(name for name in model.states if name in values)
    x0 = np.array([values[name][0] if name in values else x for name, x in zip(model.states, model.x0, strict=True)])
    columns = [model.states.index(name) for name in names]
    if len(names) < len(model.states):
        sizes = np.maximum(np.abs(x0), 1.0)
        sizes[columns] = [max(float(np.abs(values[name]).max()), 1e-12) for name in names]
        y = np.column_stack([values[name] for name in names]) if names else np.full((t.size, len(x0)), np.nan)
        gain = np.zeros((1, len(x0), y.shape[1]))
        gain[0, columns, np.arange(len(names))] = 1.0
        run = Tracker(model, t, u, y, names or model.states, sizes, early, p).run(x0, gain)
        if run.stopped is not None and names:
            run = _finer(model, t, u, y, names, sizes, early, p).run(x0, gain)
        result = run.state[:: len(run.state) // t.size] if run.stopped is None else np.tile(x0, (t.size, 1))
    else:
        result = np.empty((t.size, len(x0)))
    for name, column in zip(names, columns, strict=True):
        result[:, column] = values[name]
    return result


def _finer(
    model: Model, t: Array, u: Array, y: Array, names: tuple[str, ...], sizes: Array, early: Early, p: Array | None
) -> Tracker:
    """Return a tracker of states y (T, names) on `FINER_SAMPLES` samples for each, between which they are linear."""
    at = np.arange(FINER_SAMPLES * t.size) / FINER_SAMPLES
    rows, fine = at.astype(int), np.interp(at, np.arange(t.size + 1), np.append(t, 2 * t[-1] - t[-2]))
    shown = np.column_stack([np.interp(fine, t, column) for column in y.T])
    return Tracker(model, fine, u[rows], shown, names, sizes, fine - np.asarray(t - early)[rows], p)


def discrete(A: Array, intensity: Array, dt: float) -> tuple[Array, Array, Array]:
    """Return, over dt, the transition (n, n), the covariance (n, n) of white noise of these intensities (n,), and the
    mean transition (n, n): what a constant rate adds to the state, divided by dt.

    [Van Loan, IEEE Trans. Automatic Control 23 (1978) 395]; what is over within dt makes that matrix huge, so it is
    taken over a part of dt, which is doubled until it is dt.
    """
    n = A.shape[0]
    doublings = int(np.ceil(np.log2(max(np.linalg.norm(A, 1) * dt / MAX_EXPONENT_NORM, 1.0))))
    part = dt / 2**doublings
    block = np.zeros((2 * n, 2 * n))
    block[:n, :n], block[:n, n:], block[n:, n:] = -A, np.diag(intensity), A.T
    exponential = expm(block * part)
    held = np.zeros((2 * n, 2 * n))
    held[:n, :n], held[:n, n:] = A, np.eye(n)
    transition, total = exponential[n:, n:].T, expm(held * part)[:n, n:]
    noise = transition @ exponential[:n, n:]
    for _ in range(doublings):
        noise, total = noise + transition @ noise @ transition.T, total + transition @ total
        transition = transition @ transition
    return transition, noise, np.asarray(total / dt)


def predicted_covariance(A: Array, C: Array, Q: Array, R: Array) -> Array:
    """Return the covariance (n, n) of the predicted state after 2^`RICCATI_DOUBLINGS` steps of the Kalman filter.

    Structure-preserving doubling [Chu, Fan and Lin, Linear Algebra Appl. 396 (2005) 55], which needs no state to be
    observable: what is not observable grows, and gets no gain.
    """
    n = A.shape[0]
    F, G, H = A.T, C.T @ np.linalg.solve(R, C), Q
    for _ in range(RICCATI_DOUBLINGS):
        inner = np.linalg.inv(np.eye(n) + G @ H)
        F, G, H = F @ inner @ F, G + F @ inner @ G @ F.T, H + F.T @ H @ inner @ F
        G, H = 0.5 * (G + G.T), 0.5 * (H + H.T)
    return np.asarray(H)


__all__ = [
    "TrackedRun",
    "Tracker",
    "discrete",
    "driven",
    "filled",
    "mean",
    "mean_square",
    "measured_states",
    "predicted_covariance",
]
