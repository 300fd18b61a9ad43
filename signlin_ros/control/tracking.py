"""A control law on the exact plant, compiled: what a design is worth, in milliseconds a run.

The plant is that of `signlin_ros.simulation`, kind exact, marched by the same kernel from sample to sample.
"""

# Numba infers the types in here; mypy cannot see through its decorators. What is literal (True) is a type of its own,
# for which a function is compiled once more: hence conditions.
# mypy: allow-untyped-defs, allow-untyped-calls, disable-error-code="misc"

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from signlin_ros.control.drive import Drive, resting
from signlin_ros.control.law import ControlLaw, step
from signlin_ros.control.reference import Profile
from signlin_ros.engine.compiling import compiled, inner
from signlin_ros.engine.exact import begin, march
from signlin_ros.engine.parts import OK, hold, prepared, put
from signlin_ros.engine.surfaces import SIGNED_SURFACE

Array = NDArray[np.float64]


@inner
def _act(at, links, w, t, h, start, part, period, held, value, rtol, events):
    """March over one period from ``start``: the input changes to ``value`` after its part; returns (status, t, h)."""
    status = OK
    if part > 0.0:
        status, t, h, _ = march(at, links, w, t, start + part, h, rtol, events, 0)
    if status == OK:
        held[0] = value
        hold(at, w, held)
        begin(at, links, w, part < 0.0)
        status, t, h, _ = march(at, links, w, t, start + period, h, rtol, events, 0)
    return status, t, h


@compiled
def follow(at, links, slots, p, x0, delay, references, feed, noise, law, memory, rtol, X, U):
    """Track references (T, 2) with a law; measured position and speed to X (T, 2), without noise, inputs to U (T,).

    An input acts ``delay`` seconds after its sample. Returns (status, samples done).
    """
    grid, gains, tables, settings = law
    w = prepared(at, p)
    put(at, w, x0)
    for j in range(at.q):
        w[at.s + j], w[at.mode + j] = 1.0, SIGNED_SURFACE
    period = settings[1]
    behind = int(np.floor(delay / period + 1e-9))
    part = delay - behind * period if delay - behind * period > 1e-9 * period else 0.0
    waiting, held, measured = np.zeros(behind + 1), np.zeros(at.m), np.zeros(2)
    events = np.zeros((0, 3))
    t, h, status = 0.0, np.inf, OK
    hold(at, w, held)
    begin(at, links, w, t == 0.0)
    for k in range(references.shape[0]):
        for i in range(2):
            X[k, i] = w[at.x + slots[i]] if slots[i] >= 0 else 0.0
            measured[i] = X[k, i] + noise[k, i]
        for i in range(behind):
            waiting[i] = waiting[i + 1]
        U[k] = waiting[behind] = step(grid, gains, tables, settings, memory, references[k], measured, feed[k])
        status, t, h = _act(at, links, w, t, h, k * period, part, period, held, waiting[0], rtol, events)
        if status != OK:
            return status, k
    return OK, references.shape[0]


@dataclass(frozen=True)
class TrackingRun:
    """A simulated closed loop: times t (T,), reference and motion (T, 2) as position and speed, inputs u (T,).

    ``finished`` is False where the plant ran away; the rest is NaN then.
    """

    t: Array
    reference: Array
    motion: Array
    u: Array
    position: bool
    finished: bool

    @property
    def error(self) -> Array:
        """What is not tracked (T,): position or speed."""
        column = 0 if self.position else 1
        return np.asarray(self.reference[:, column] - self.motion[:, column])

    @property
    def rms(self) -> float:
        """Root mean square of the error; inf where the run did not finish."""
        return float(np.sqrt(np.mean(self.error**2))) if self.finished else float("inf")

    @property
    def effort(self) -> float:
        """Root mean square of the input; inf where the run did not finish."""
        return float(np.sqrt(np.mean(self.u**2))) if self.finished else float("inf")

    @property
    def chatter(self) -> float:
        """Root mean square of what each input differs from the mean of its neighbours; inf where not finished."""
        bend = self.u[1:-1] - (self.u[2:] + self.u[:-2]) / 2
        return float(np.sqrt(np.mean(bend**2))) if self.finished else float("inf")

    def oscillation(self, last: float) -> float:
        """Return half of the span of the position in the last seconds: what a limit cycle at rest, or creep, leaves."""
        return float(np.ptp(self._late(last)) / 2) if self.finished else float("inf")

    def swing(self, last: float) -> float:
        """Return half of what the position goes to and fro in the last seconds: creep to one side is none."""
        if not self.finished:
            return float("inf")
        q = self._late(last)
        up = np.max(q - np.minimum.accumulate(q))
        down = np.max(np.maximum.accumulate(q) - q)
        return float(min(up, down) / 2)

    def _late(self, last: float) -> Array:
        return np.asarray(self.motion[self.t >= self.t[-1] - last, 0])


@dataclass(frozen=True)
class TrackingBench:
    """A plant, a reference and what disturbs: ready for one law after the other.

    Parameters
    ----------
    plant : the drive that is controlled.
    profile, period : reference and s between updates.
    delay : s from a sample to the input made of it, beside the input delay of the plant's model.
    noise : (T, 2) what sensors add to position and speed, or None.
    """

    plant: Drive
    profile: Profile
    period: float
    delay: float = 0.0
    noise: Array | None = None

    @property
    def count(self) -> int:
        """Number of updates."""
        return int(np.floor(self.profile.duration / self.period + 1e-9))

    @property
    def lead(self) -> float:
        """Time in s from a sample to the input made of it."""
        return self.delay + self.plant.model.delay

    @functools.cached_property
    def reference(self) -> Array:
        """Position and speed (T, 2) of the profile at the updates."""
        q, v, _ = self.profile.at(self.period * np.arange(self.count))
        return np.column_stack([q, v])

    def run(self, law: ControlLaw, feed: Array, rtol: float = 1e-5) -> TrackingRun:
        """Close the loop with a law and a feed-forward (T,), from rest at the start of the profile."""
        t: Array = self.period * np.arange(self.count, dtype=float)
        X, U = np.full((t.size, 2), np.nan), np.full(t.size, np.nan)
        noise = np.zeros((t.size, 2)) if self.noise is None else self.noise
        model = self.plant.model
        start = resting(self.plant, self.profile.start)
        plant = (*self.plant.plan, self.plant.slots, model.p, start, self.lead)
        status, _ = follow(*plant, self.reference, feed, noise, law.parts, law.memory, rtol, X, U)
        return TrackingRun(t, self.reference, X, U, law.position, status == OK)
