"""Motion and effort of a run through one low-pass, and rows of all joints for a regression.

Motion is filtered at twice the cut-off, then what is computed from it and the effort alike at the cut-off; rows where a
joint stands still are left out, as are the ends, where filters have not settled.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import welch

from signlin_ros.arms.data import ArmRun
from signlin_ros.filters import low_pass, sensor_noise, slope
from signlin_ros.mathops import NumpyMath
from signlin_ros.robots import Robot, regressor

Array = NDArray[np.float64]
STANDSTILL_OVER_NOISE = 3.0
"""Times its noise below which a velocity is standstill; the sign of less is not known."""
CRAWL = 0.004
"""The same as a part of the largest velocity."""
STUCK = 0.15
"""Share of the filter's window at standstill from which on a row is left out."""
EDGE_PERIODS = 1.2
"""Periods of the cut-off that are left out at both ends."""
ROWS_PER_PERIOD = 2.5
"""Rows per period of the cut-off: more would repeat each other."""
BODY_SAMPLES_PER_PERIOD = 12.0
"""Samples per period of the cut-off at which the rigid body is worked out; motion is slower by far."""
UNSETTLED = 0.05
"""Part of its friction that a motor lacks after a reversal, over two, below which it has set in."""
BLOCK = 0.5
"""Seconds of a block of rows whose errors may be correlated, at least; two periods of the cut-off, too."""
BAND_POWER_SHARE, BAND_RATIO, LOWEST, OF_RATE = 0.999, 4.0, 3.0, 12.0
"""The band: so much of every velocity's power, so many times wider, at least this many Hz, and a part of the rate."""


def chosen_band(runs: Sequence[ArmRun]) -> float:
    """Return a cut-off in Hz that leaves the motion and the jumps of its friction, and most noise out."""
    found = []
    for run in runs:
        rate = 1.0 / run.step
        shown = run.v if run.shown is None else run.shown  # of a velocity before its filter noise is larger
        v = np.gradient(run.q, run.step, axis=0) if shown is None else shown
        f, power = welch(v, rate, nperseg=min(len(run), int(8 * rate)), axis=0)
        power = np.where(f[:, None] < _noisy_from(f, power, rate), power, 0.0)
        share = np.cumsum(power, axis=0) / np.maximum(power.sum(axis=0), 1e-300)
        highest = max(float(f[np.argmax(column >= BAND_POWER_SHARE)]) for column in share.T)
        found.append(float(np.clip(BAND_RATIO * highest, min(LOWEST, rate / OF_RATE), rate / OF_RATE)))
    return float(f"{min(found):.2g}")


def _noisy_from(f: Array, power: Array, rate: float) -> Array:
    """Return the frequencies (n,) from which on spectra (F, n) of velocities are noise.

    Noise of a velocity does not fall with frequency, and that of a position that is differentiated grows: going down
    octave by octave from where there is most beyond any band, it is what falls, and motion begins where that ends.
    """
    octave = np.floor(np.log2(np.maximum(0.5 * rate / np.maximum(f, 1e-12), 1.0))).astype(int)
    octave = np.minimum(octave, int(np.log2(0.5 * rate / f[1])))
    sums = np.stack([np.bincount(octave, column) for column in power.T], axis=1)
    beyond = int(np.log2(0.5 * OF_RATE))  # octaves of which no band is wider
    found = []
    for column in sums.T:
        at = int(np.argmax(column[:beyond]))
        while at + 1 < column.size and column[at + 1] < column[at]:
            at += 1
        found.append(0.5 * rate / 2.0**at)
    return np.array(found)


def widest_band(runs: Sequence[ArmRun]) -> float:
    """Return the widest cut-off in Hz that is chosen, whatever the motion."""
    return float(f"{1.0 / OF_RATE / max(run.step for run in runs):.2g}")


class SoftSigns(NumpyMath):
    """Evaluates laws with a sign of the velocity that is as uncertain as the velocity's noise makes it."""

    def __init__(self, velocity: Array, noise: float) -> None:
        super().__init__()
        self.velocity, self._width = velocity, 2.0 * noise

    def sign(self, g: Any) -> Any:  # type: ignore[override]
        """Return the sign of g, of the velocity as its noise leaves it."""
        return np.clip(g / self._width, -1.0, 1.0) if g is self.velocity else np.sign(g)


class ArmSegment:
    """One run, filtered: q, v, a (T, n) of the joints at times ``step`` s apart, ``speed`` (T, K) where effects act.

    ``motors`` (K, n): first the n motors from the joints, then the joints that a coupling has parted from their motors.
    ``settling`` (n,) lengths in rad (m) over which the motors' friction sets in after a reversal, 0 where at once.
    """

    def __init__(self, robot: Robot, motors: Array, run: ArmRun, band: float, settling: Array | None = None) -> None:
        self.robot, self.run = robot, run
        self.settling = np.zeros(robot.n) if settling is None else settling
        rate = 1.0 / run.step
        self.band = band
        wide = min(2.0 * band, 0.4 * rate)
        self.q = low_pass(run.q, wide, run.step)
        passed = np.sqrt(2.0 * wide * run.step)
        if run.v is None:
            self.v = _slopes(self.q, run.step)
            noise = 2.0 * np.pi * wide * _noise(run.q) * passed
        else:
            self.v = low_pass(run.v, wide, run.step)
            noise = _noise(run.v) * passed
        self.a = _slopes(self.v, run.step)
        edge = min(int(EDGE_PERIODS / band * rate) + 1, len(run) // 4)
        every = max(1, int(rate / (BODY_SAMPLES_PER_PERIOD * band)))
        self.step = every * run.step
        self.q, self.v, self.a = self.q[::every], self.v[::every], self.a[::every]
        self._joint_noise = noise
        self._place(motors)
        first, last, apart = -(-edge // every), (len(run) - edge) // every, rate / every / (ROWS_PER_PERIOD * band)
        self.index = np.arange(first, max(last, first + 1), max(1, int(apart)))
        self.moving = self._moving(band)
        self._every, self._efforts = every, low_pass(run.tau, band, run.step)
        self.tau = self._efforts[self.index * every]
        self.block = (self.index * self.step / max(BLOCK, 2.0 / band)).astype(int)

    def efforts(self, delays: Array | float) -> Array:
        """Return the efforts (rows, n) that are recorded later by one delay in s, or by one of each joint (n,)."""
        at, k = self.index * self._every, np.arange(len(self.run))
        later = np.broadcast_to(np.asarray(delays) / self.run.step, self.robot.n)
        columns = zip(later, self._efforts.T, strict=True)
        return np.stack([np.interp(at + by, k, column) for by, column in columns], axis=1)

    def coupled(self, motors: Array) -> ArmSegment:
        """Return the piece with other motors; which rows count stays as it is."""
        other = copy(self)
        other._place(motors)
        return other

    def _place(self, motors: Array) -> None:
        """Work out angles and speeds (T, K) in the coordinates in which effects act."""
        self.motors, self.speed, self.angle = motors, self.v @ motors.T, self.q @ motors.T
        self.noise = np.maximum(np.sqrt((motors**2) @ self._joint_noise**2), 1e-9)
        self.signs = [SoftSigns(self.speed[:, i], self.noise[i]) for i in range(len(motors))]

    def _moving(self, band: float) -> NDArray[np.bool_]:
        """Return which rows of which joint count (rows, n): no motor that acts on it stands still, or has turned back
        so little ago that its friction has not set in.
        """
        slow = self._slow()
        unknown = np.abs(self.speed) < slow
        for i in np.flatnonzero(self.settling).tolist():
            unknown[:, i] |= np.exp(-self.travelled(i) / self.settling[i]) > UNSETTLED
        stuck = low_pass(unknown.astype(float), band, self.step)[self.index] > STUCK
        return np.asarray(~((stuck.astype(float) @ (self.motors != 0.0)) > 0.0))

    def _slow(self) -> Array:
        """Return the speeds (K,) below which a motor stands still."""
        found: Array = np.maximum(STANDSTILL_OVER_NOISE * self.noise, CRAWL * np.abs(self.speed).max(axis=0))
        return found

    def travelled(self, i: int) -> Array:
        """Return how far the motor i has gone since it turned back last (T,), in rad (m); first since the start."""
        angle, v = self.angle[:, i], self.speed[:, i]
        moves = np.flatnonzero(np.abs(v) >= self._slow()[i])
        if not moves.size:
            return np.zeros(angle.size)
        way = np.sign(v[moves])
        turned = np.flatnonzero(np.diff(way)) + 1
        starts, ways = np.concatenate([[0], moves[turned]]), np.concatenate([way[:1], way[turned]])
        stretch = np.repeat(np.arange(starts.size), np.diff([*starts, angle.size]))
        farthest = ways * np.maximum.reduceat(ways[stretch] * angle, starts)
        since = np.concatenate([angle[:1], farthest[:-1]])
        return np.asarray(np.abs(angle - since[stretch]))

    def filtered(self, values: Array) -> Array:
        """Return values (T, ...) through the low-pass, at the rows."""
        return low_pass(values, self.band, self.step)[self.index]


def _slopes(values: Array, step: float) -> Array:
    return np.stack([slope(column, step) for column in values.T], axis=1)


def _noise(values: Array) -> Array:
    return np.array([sensor_noise(column) for column in values.T])


class RegressionRows:
    """Rows of all joints of several pieces, joint after joint in each: ``joint``, ``block``, the effort ``y`` (N,).

    ``Y`` (N, 10 n) is the regressor of the rigid body; ``known`` keeps columns that do not depend on the model.
    """

    def __init__(self, pieces: Sequence[ArmSegment]) -> None:
        self.pieces = list(pieces)
        self.known: dict[tuple[object, ...], Array] = {}
        self.robot, self.n = pieces[0].robot, pieces[0].robot.n
        joints, blocks, count = [], [], 0
        for piece in pieces:
            for i in range(self.n):
                kept = piece.moving[:, i]
                joints.append(np.full(int(kept.sum()), i))
                blocks.append(count + piece.block[kept])
            count += int(piece.block.max(initial=0)) + 1
        self.joint, self.block = np.concatenate(joints), np.concatenate(blocks)
        self.y = np.concatenate([p.tau[p.moving[:, i], i] for p in pieces for i in range(self.n)])
        self.Y = self.whole(lambda p: regressor(self.robot, p.q, p.v, p.a))

    def __len__(self) -> int:
        return int(self.y.size)

    def coupled(self, motors: Array) -> RegressionRows:
        """Return the same rows with other motors."""
        other = copy(self)
        other.pieces, other.known = [piece.coupled(motors) for piece in self.pieces], {}
        return other

    def with_efforts(self, delays: Array | float) -> RegressionRows:
        """Return the same rows with the efforts that are recorded some s later, one number or (n,)."""
        other = copy(self)
        late = [(piece, piece.efforts(delays)) for piece in self.pieces]
        other.y = np.concatenate([tau[p.moving[:, i], i] for p, tau in late for i in range(self.n)])
        return other

    def of_motors(self, change: Array) -> RegressionRows:
        """Return the same rows with efforts that are sums of those recorded, joint by joint (n, n)."""
        other = copy(self)
        sums = [(piece, piece.tau @ change) for piece in self.pieces]
        other.y = np.concatenate([tau[p.moving[:, i], i] for p, tau in sums for i in range(self.n)])
        return other

    def whole(self, of: Callable[[ArmSegment], Array]) -> Array:
        """Return rows (N, k) of what a function says of all joints (T, n, k)."""
        found = []
        for piece in self.pieces:
            values = piece.filtered(of(piece))
            found += [values[piece.moving[:, i], i] for i in range(self.n)]
        return np.concatenate(found)

    def motor(self, i: int, of: Callable[[ArmSegment], Array]) -> Array:
        """Return rows (N,) of what a function says of the motor i (T,): it acts on the joints that it moves."""
        found = []
        for piece in self.pieces:
            values = piece.filtered(of(piece))
            found += [piece.motors[i, j] * values[piece.moving[:, j]] for j in range(self.n)]
        return np.concatenate(found)

    def faster(self, i: int, share: float) -> NDArray[np.bool_]:
        """Return which rows (N,) see the motor i only above a share of its fastest speed."""
        fastest = max(float(np.abs(piece.speed[:, i]).max()) for piece in self.pieces)

        def crawls(piece: ArmSegment) -> Array:
            slow = np.abs(piece.speed[:, i]) < share * fastest
            return np.tile(slow[:, None, None].astype(float), (1, self.n, 1))

        slow = self.whole(crawls)
        return np.asarray(slow[:, 0] <= STUCK)

    def by_joint(self, r: Array) -> Array:
        """Return the RMS of residuals (N,) joint by joint (n,), NaN where none counts."""
        squares = np.bincount(self.joint, r**2, self.n)
        count = np.bincount(self.joint, minlength=self.n)
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.asarray(np.sqrt(squares / count))

    def by_time(self, values: Array) -> Array:
        """Return values of rows (N,) instant by instant (R, n), NaN where a joint's row does not count."""
        moving = np.concatenate([piece.moving for piece in self.pieces])
        found = np.full(moving.shape, np.nan)
        found[self._at] = values
        return found

    def of_times(self, values: Array) -> Array:
        """Return the rows (N,) of values instant by instant (R, n)."""
        return np.asarray(values[self._at])

    @property
    def _at(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """The instant and the joint of each row (N,)."""
        starts = np.cumsum([0, *(len(piece.moving) for piece in self.pieces)])
        own = [
            (start, piece.moving[:, i])
            for start, piece in zip(starts, self.pieces, strict=False)
            for i in range(self.n)
        ]
        return np.concatenate([start + np.flatnonzero(moving) for start, moving in own]), self.joint

    @property
    def counts(self) -> NDArray[np.int64]:
        """Rows of each joint (n,)."""
        return np.bincount(self.joint, minlength=self.n)


__all__ = ["ArmSegment", "RegressionRows", "SoftSigns", "chosen_band", "widest_band"]
