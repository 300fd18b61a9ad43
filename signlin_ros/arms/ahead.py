"""A second witness: the forward model over short windows of unseen motion, with a law and without it.

Every window starts from the measured state, is driven by the measured efforts, and its velocities are held against the
measured ones: nothing is fitted. The equation error of the efforts and this error weigh a law differently, so one is
told beside the other. All windows are simulated at once, with dry friction as a set-valued force: a joint sticks where
its friction can hold it.   [Moreau, in: Nonsmooth Mechanics and Applications, CISM 302, Springer, 1988]
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from signlin_ros.arms.consistent import consistent
from signlin_ros.arms.fit import CoefficientEstimate
from signlin_ros.arms.heldout import MIN_VALIDATION_ERRORS
from signlin_ros.arms.laws import across_gravity, force, unit_of
from signlin_ros.arms.loaded import payload_in_record
from signlin_ros.arms.piece import BLOCK, EDGE_PERIODS, ArmSegment
from signlin_ros.arms.search import State
from signlin_ros.arms.warmth import in_record, sources_of
from signlin_ros.filters import low_pass
from signlin_ros.mathops import NumpyMath
from signlin_ros.robots import Robot, inverse_dynamics

Array = NDArray[np.float64]
WINDOW = 0.15
"""Seconds that are simulated from each measured state."""
RUNAWAY = 3.0
"""Times a joint's fastest measured velocity at which it is held: a law that drives its joint there is wrong by that."""
SWEEPS = 12
"""Times that the impulses of dry friction are corrected in a step."""
NOT_SIMULATED = ("compliant_load",)
"""Laws with states of their own."""


@dataclass(frozen=True, eq=False)
class Ahead:
    """RMS errors of the joints' velocities (n,) in rad/s (m/s) over the windows, and mean squares window by window.

    ``squares`` (W, n); ``block`` (W,) tells which windows are near each other.
    """

    rms: Array
    squares: Array
    block: NDArray[np.int64]


@dataclass(frozen=True)
class Witness:
    """What the windows say of a law: RMS errors of velocity without and with it, and the fall in standard errors.

    The errors are those of its joint; of a law of the robot, of all joints, each in units of its own.
    """

    without: float
    with_: float
    errors: float
    windows: int

    @property
    def says(self) -> str:
        """What it comes to: confirmed, in question, or undecided."""
        if self.errors >= MIN_VALIDATION_ERRORS:
            return "confirmed"
        return "in question" if self.errors <= -MIN_VALIDATION_ERRORS else "undecided"


class OneSided(NumpyMath):
    """Evaluates laws on one side of a velocity of zero."""

    def __init__(self, velocity: Array, side: float) -> None:
        super().__init__()
        self.velocity, self._side = velocity, side

    def sign(self, g: Any) -> Any:  # type: ignore[override]
        """Return the side for the velocity, the sign of anything else."""
        return self._side if g is self.velocity else np.sign(g)


@dataclass
class _Sample:
    """What laws see of all motors at one moment of W windows."""

    angle: Array
    signs: list[OneSided]


class ForwardModel:
    """An estimate as a forward model: bodies that exist, motors, friction."""

    def __init__(self, state: State, estimate: CoefficientEstimate) -> None:
        carried = state.point(estimate) + state.carried
        estimate = replace(estimate, theta=consistent(estimate, state.robot.pi, carried))
        values = dict(zip(estimate.design.names, estimate.theta.tolist(), strict=True))
        n, self.P = state.robot.n, state.rows.pieces[0].motors
        across, down = across_gravity(state.robot)
        tilt = [values.get(f"tilt.{axis}", 0.0) for axis in ("x", "y")]
        self.robot: Robot = replace(state.robot, gravity=state.robot.gravity + down * (np.array(tilt) @ across))
        self.pi = state.body(estimate)
        inertias = np.array([max(values.get(f"{i}.motor_inertia", 0.0), 0.0) for i in range(n)])
        self.shown = np.array([1.0 + values.get(f"{i}.sensor_gain", 0.0) for i in range(n)])
        self.motors = self.P[:n].T @ (inertias[:, None] * self.P[:n]) / self.shown[:, None]
        self.laws, self.kept = state.friction(estimate), state.kept

    def mass(self, q: Array) -> Array:
        """Return mass matrices (W, n, n), the motors' inertias in them."""
        W, n = q.shape
        still, rest = replace(self.robot, gravity=np.zeros(3)), np.zeros((W * n, n))
        units = np.repeat(np.eye(n), W, axis=0)
        columns = inverse_dynamics(still, np.tile(q, (n, 1)), rest, units, self.pi).reshape(n, W, n)
        return np.asarray(np.moveaxis(columns, 0, 2) + self.motors)

    def friction(self, q: Array, v: Array, load: Array) -> tuple[Array, Array]:
        """Return the effort (W, K) that laws need whatever the side of the velocity, and their dry level."""
        angle, speed, n = q @ self.P.T, v @ self.P.T, self.robot.n
        parted = [int(np.flatnonzero(row)[0]) for row in self.P[n:]]
        loads = np.concatenate([load @ np.linalg.inv(self.P[:n]), load[:, parted]], axis=1)
        sides = []
        for side in (1.0, -1.0):
            sample: Any = _Sample(angle, [OneSided(column, side) for column in speed.T])
            needed = np.zeros(speed.shape)
            for i, law, shape, value in self.laws:
                needed[:, i] -= value * force(law.effect, unit_of(law, shape), sample, i, loads)
            for kept in self.kept:
                needed[:, kept.at] += kept.needed(sample, loads)
            sides.append(needed)
        dry = 0.5 * (sides[0] - sides[1])
        return 0.5 * (sides[0] + sides[1]) + np.minimum(dry, 0.0) * np.sign(speed), np.maximum(dry, 0.0)

    def velocities(self, q: Array, v: Array, a: Array, tau: Array, h: float, fastest: Array | float = np.inf) -> Array:
        """Return velocities (S, W, n) after each of S steps of h s under efforts tau (S, W, n), from a state (W, n);
        they are held within ``fastest`` (n,).
        """
        found, scaled = [], self.P / self.shown
        for effort in tau:
            middle = q + 0.5 * h * v
            M = self.mass(middle)
            inverse = np.linalg.inv(M)
            G = np.einsum("ki,wij,lj->wkl", self.P, inverse, scaled, optimize=True)
            bias = inverse_dynamics(self.robot, middle, v, np.zeros(v.shape), self.pi)
            load = np.einsum("wij,wj->wi", M - self.motors, a) + bias
            always, dry = self.friction(middle, v, load)
            free = v + h * np.einsum("wij,wj->wi", inverse, effort / self.shown - bias - always @ scaled)
            impulse = _impulses(free @ self.P.T, G, h * dry)
            new = np.clip(free - np.einsum("wij,wj->wi", inverse, impulse @ scaled), -fastest, fastest)
            a, q, v = (new - v) / h, middle + 0.5 * h * new, new
            found.append(v)
        return np.array(found)


def _impulses(speed: Array, G: Array, largest: Array) -> Array:
    """Return the impulses (W, K) of dry friction that stop what they can stop, by projected Gauss-Seidel sweeps."""
    w, found = speed.copy(), np.zeros(speed.shape)
    for _ in range(SWEEPS):
        for i in range(speed.shape[1]):
            new = np.clip(found[:, i] + w[:, i] / G[:, i, i], -largest[:, i], largest[:, i])
            w -= G[:, :, i] * (new - found[:, i])[:, None]
            found[:, i] = new
    return found


def ahead(state: State, estimate: CoefficientEstimate) -> Ahead:
    """Return how well an estimate foretells the velocities of unseen motion over windows of `WINDOW` s."""
    model, squares, blocks, count = ForwardModel(state, estimate), [], [], 0
    laws, pi, sources = model.laws, model.pi, sources_of(*state.both)
    for piece in state.new.pieces:
        starts, steps = _windows(piece)
        if not starts.size:
            continue
        every = round(piece.step / piece.run.step)
        tau = low_pass(piece.run.tau, min(2.0 * piece.band, 0.4 / piece.run.step), piece.run.step)[::every]
        at = starts[None, :] + np.arange(steps)[:, None]
        between = 0.5 * (tau[at] + tau[at + 1])
        record = sources.index(piece.run.source)
        model.laws = in_record(estimate, laws, record)
        if state.lightest is not None and state.payload_at is not None:
            model.pi = pi + payload_in_record(estimate, record, state.payload_at)
        start = piece.q[starts], piece.v[starts], piece.a[starts]
        shown = model.velocities(*start, between, piece.step, RUNAWAY * np.abs(piece.v).max(axis=0))
        squares.append(np.mean((shown - piece.v[at + 1]) ** 2, axis=0))
        near = (starts * piece.step / max(BLOCK, 2.0 / piece.band)).astype(int)
        blocks.append(count + near)
        count += int(near.max()) + 1
    if not squares:
        nothing = np.full(state.robot.n, np.nan)
        return Ahead(nothing, nothing[None, :], np.zeros(1, dtype=int))
    all_ = np.concatenate(squares)
    return Ahead(np.sqrt(all_.mean(axis=0)), all_, np.concatenate(blocks))


def _windows(piece: ArmSegment) -> tuple[NDArray[np.int64], int]:
    """Return the first samples of windows, the ends of the piece left out, and how many steps each has."""
    steps, edge = max(2, round(WINDOW / piece.step)), int(EDGE_PERIODS / piece.band / piece.step) + 1
    return np.arange(edge, len(piece.q) - edge - steps - 1, steps), steps


def witnesses(
    state: State, estimate: CoefficientEstimate, whole: Ahead, laws: Sequence[tuple[int, tuple[str, ...]]]
) -> Iterator[Witness | None]:
    """Yield what the windows say of each law, given by its joint (-1: the robot) and its columns."""
    for at, names in laws:
        if not all(name in estimate.design.names for name in names) or names[0].endswith(NOT_SIMULATED):
            yield None
            continue
        less = state.without(estimate, *names, weights=estimate.weights)
        without = ahead(state, less)
        yield compared(without, whole, at)


def compared(without: Ahead, whole: Ahead, at: int) -> Witness | None:
    """Return by how much the squares of a joint's windows fall, beside what they scatter block by block."""
    weights = np.zeros(len(whole.rms))
    weights[slice(None) if at < 0 else at] = 1.0
    if at < 0:
        weights /= np.maximum(without.rms, 1e-300) ** 2 * len(weights)
    before, after = without.squares @ weights, whole.squares @ weights
    if not np.isfinite(before + after).all():
        return None
    sums = np.bincount(whole.block, before - after)[np.unique(whole.block)]
    spread = float(np.linalg.norm(sums - sums.mean()))
    rms = float(np.sqrt(before.mean())), float(np.sqrt(after.mean()))
    return Witness(*rms, float(sums.sum()) / max(spread, 1e-300), len(before))


__all__ = ["WINDOW", "Ahead", "ForwardModel", "Witness", "ahead", "compared", "witnesses"]
