"""How far what one rival would show is from what another can imitate: -2 log likelihood of the other, refitted, with
what the first records know of it, after an observer and in units of what a model leaves of the first records.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import permutations

import numpy as np
from numpy.typing import NDArray

from signlin_ros.experiment.contenders import Contender
from signlin_ros.experiment.limits import Limits
from signlin_ros.fitting.following import follow_records
from signlin_ros.fitting.gains import ObserverGains
from signlin_ros.fitting.inverses import bounded_step
from signlin_ros.fitting.problem import Problem
from signlin_ros.follow.segments import PreparedSegment
from signlin_ros.simulation import Trajectory

Array = NDArray[np.float64]
Pair = tuple[int, int]
"""The rival that is true, and the one that is refitted to what it would show."""

MODEL_ERROR_FLOOR = 0.01
"""Part of a channel's spread that a model is never believed to: a floor for its error."""
MAX_REFIT_STEPS, ENDS = 8, 0.01
"""Most steps of a refit, and the part of its cost by which one must lower it: beyond that of noise, or of the best
refit so far."""
MIN_MOTION_OVER_NOISE = 4.0
"""Times its noise that a channel of the motion must move by (RMS) with every rival."""
OWN_STARTS = 2
"""Sigma points from which a rival is refitted to a noisy record of itself, where it cannot be followed as it is."""
KEPT_SAMPLES = 2_000_000
"""Samples of motions that are kept: searches for other pairs look at the same commands again."""
LOST = 1e12
"""Cost of a model that diverges."""


@dataclass(frozen=True, eq=False)
class RivalBench:
    """Rivals, and the observer (``gains``) through which a record is seen; ``spread`` (ny,): what a model leaves of the
    first records; ``x0``: where the machine starts, by state; ``bias``: the input that holds it there; ``likely``:
    those that may be true, all where it is empty; ``behind``: by how much the first records leave them behind the best;
    ``check`` is called before every simulation and refit, and raises what ends the work; ``motions`` that are kept.
    """

    problem: Problem
    contenders: tuple[Contender, ...]
    gains: ObserverGains
    spread: Array
    x0: Mapping[str, float]
    bias: float = 0.0
    likely: frozenset[int] = frozenset()
    behind: Array = field(default_factory=lambda: np.zeros(0), repr=False)
    used: dict[str, int] = field(default_factory=lambda: {"runs": 0, "fits": 0}, repr=False)
    check: Callable[[], None] = field(default=lambda: None, repr=False)
    motions: dict[tuple[Contender, bytes, bytes, bytes], Trajectory | None] = field(default_factory=dict, repr=False)

    @property
    def pairs(self) -> list[Pair]:
        """Every rival that may be true, with every other one that may imitate it."""
        every = permutations(range(len(self.contenders)), 2)
        return [pair for pair in every if not self.likely or pair[0] in self.likely]

    def inputs(self, u: Array) -> Array:
        """Return all inputs (T, m) of the machine under a command u (T,) of the first; others as by default."""
        every = np.tile(self.problem.base.u0, (u.size, 1))
        every[:, 0] = u
        return every

    def run(self, i: int, t: Array, u: Array, theta: Array | None = None) -> Trajectory | None:
        """Return the motion of a rival, at its estimate by default; None where it diverges. It is kept for a while."""
        self.check()
        c = self.contenders[i]
        theta = c.theta if theta is None else theta
        key = (c, theta.tobytes(), t.tobytes(), u.tobytes())
        if key not in self.motions:
            if (len(self.motions) + 1) * t.size > KEPT_SAMPLES:
                self.motions.clear()
            self.used["runs"] += 1
            self.motions[key] = c.run(theta, t, self.inputs(u), self.x0)
        return self.motions[key]

    def segment(self, i: int, run: Trajectory, theta: Array | None = None) -> PreparedSegment:
        """Return the sensors' readings of a motion, without noise, as a record."""
        c = self.contenders[i]
        y = np.ascontiguousarray(c.shown(c.theta if theta is None else theta, run, self.problem.channels))
        early = self.problem.base.early * self.problem.scale.step
        start = {n: self.x0.get(n, 0.0) for n in self.problem.base.states}
        return PreparedSegment(run.t, np.ascontiguousarray(run.u), y, start, "command", True, early)

    def moves(self, s: PreparedSegment) -> bool:
        """Tell whether a motion shows beyond the noise: of a record in which nothing moves nothing is concluded."""
        plant = self.problem.plant
        spread = s.y.std(axis=0) / self.problem.noise
        moving = [k for k, c in enumerate(self.problem.channels) if c in (plant.position, plant.velocity)]
        return not moving or bool(np.any(spread[moving] > MIN_MOTION_OVER_NOISE))

    def _followed(self, c: Contender, theta: Array, s: PreparedSegment) -> tuple[Array, Array] | None:
        """Return errors (N,) and their slopes (N, n) in units of what a model leaves; None where it diverges."""
        self.check()
        self.used["fits"] += 1
        found = follow_records(self.problem, replace(c.candidate, starts={}), theta, self.gains, True, (s,))
        if found is None:
            return None
        unit = 1.0 / np.hypot(self.spread, MODEL_ERROR_FLOOR * s.y.std(axis=0))
        e = (found[0][0] * unit).ravel()
        slopes = (found[1][0][:, :, : theta.size] * np.outer(unit, c.candidate.slopes(theta))).reshape(-1, theta.size)
        return (e, slopes) if np.isfinite(e).all() and np.isfinite(slopes).all() else None

    def linear(self, j: int, s: PreparedSegment) -> float:
        """Return the distance of a rival from a record after one linear refit: for screening, and never shown."""
        c = self.contenders[j]
        found = self._followed(c, c.theta, s)
        if found is None:
            return LOST
        e, D = found
        normal = D.T @ D + c.information
        slope = D.T @ e
        step = np.clip(c.theta - np.linalg.lstsq(normal, slope, rcond=1e-13)[0], *c.bounds) - c.theta
        return _compressed(float(e @ e + 2 * slope @ step + step @ normal @ step), s)

    def refitted(self, j: int, s: PreparedSegment, starts: Sequence[Array] | None = None) -> tuple[float, Array]:
        """Return the distance of a rival from a record after a refit by Levenberg and Marquardt's method from its
        estimate and its other minima, or from some starts, the best, and where it arrived.
        """
        c = self.contenders[j]
        cost, theta = self._best(c, s, [c.theta, *c.minima] if starts is None else starts)
        return (cost if cost >= LOST else _compressed(cost, s)), theta

    def imitated(self, j: int, s: PreparedSegment) -> tuple[float, Array]:
        """Return the least distance of a rival from a record, refitted from its estimate and from every sigma point,
        and where that is. Each refit goes on to its own end: what one step foretells of a law with a memory says little
        of where several lead.
        """
        c = self.contenders[j]
        ends = [self._descended(c, s, start) for start in (c.theta, *c.sigma_points)]
        cost, theta = min(ends, key=lambda one: one[0])
        return (cost if cost >= LOST else _compressed(cost, s)), theta

    def squares(self, j: int, s: PreparedSegment, theta: Array) -> float:
        """Return the squares that a rival leaves of a record at some coordinates, in units of what a model leaves."""
        found = self._followed(self.contenders[j], theta, s)
        return LOST if found is None else float(found[0] @ found[0])

    def margin(self, j: int, s: PreparedSegment, own: float, starts: Sequence[Array]) -> float:
        """Return -2 log likelihood of a noisy record by which a rival is behind the true one, which leaves ``own``
        squares: refitted from its estimate and from some ``starts`` with what first records know, the variance unknown.
        """
        other = self.contenders[j]
        cost, _ = self._best(other, s, [*starts, other.theta], own)
        return 0.0 if max(own, cost) >= LOST else float(s.y.size * np.log(cost / max(own, 1e-12)))

    def left(self, i: int, s: PreparedSegment, theta: Array) -> float:
        """Return the squares that a rival leaves of a noisy record of itself, refitted from its true coordinates; where
        it cannot be followed there, as a bristle that is too stiff for the samples, from those that a diagnosis starts
        from.
        """
        c = self.contenders[i]
        cost = self._descended(c, s, theta)[0]
        starts = [c.theta, *c.sigma_points[:OWN_STARTS]]
        return cost if cost < LOST else self._best(c, s, starts, float(s.y.size))[0]

    def _best(
        self, c: Contender, s: PreparedSegment, starts: Sequence[Array], noise: float = 0.0
    ) -> tuple[float, Array]:
        """Return the least cost of refits from some starts, and where; ``noise``: the part of it that is noise's."""
        best = (LOST, c.theta)
        for start in starts:
            best = min(best, self._descended(c, s, start, noise, best[0]), key=lambda one: one[0])
        return best

    def _descended(
        self, c: Contender, s: PreparedSegment, theta: Array, noise: float = 0.0, known: float = LOST
    ) -> tuple[float, Array]:
        """Return the cost of a refit from a start, and where it arrived: it ends where it gains no more, or foretells
        after a step to end no lower than what is ``known`` from another start.
        """
        low, high = c.bounds
        found = self._followed(c, theta, s)
        if found is None:
            return LOST, theta
        e, D = found
        known_at, behind = c.nearest(theta)
        apart = theta - known_at
        cost, damping = float(e @ e + apart @ c.information @ apart) + behind, 1e-3
        for k in range(MAX_REFIT_STEPS):
            normal = D.T @ D + c.information
            slope = D.T @ e + c.information @ apart
            new = bounded_step(theta, slope, normal, damping, low, high)
            step, most = new - theta, min(cost, known if k else LOST)
            foretold = cost + float(2.0 * slope @ step + step @ normal @ step)
            if cost < 1.0 or foretold > most - ENDS * max(most - noise, 1.0):
                break
            trial = self._followed(c, new, s)
            way = new - known_at
            value = LOST if trial is None else float(trial[0] @ trial[0] + way @ c.information @ way) + behind
            if trial is None or not value < cost:
                damping *= 10.0
                continue
            gained, cost, theta, (e, D), damping = cost - value, value, new, trial, damping / 8
            apart = way
            if gained < ENDS * max(cost - noise, 1.0):
                break
        return cost, theta

    def growing(self, j: int, s: PreparedSegment, theta: Array) -> Array:
        """Return the squares that a rival leaves of a record at some coordinates, summed up to each sample (T,)."""
        found = self._followed(self.contenders[j], theta, s)
        if found is None:
            return np.full(s.t.size, np.nan)
        return np.asarray(np.cumsum((found[0].reshape(s.y.shape) ** 2).sum(axis=1)))

    def share(self, t: Array, u: Array, limits: Limits, points: bool = False) -> tuple[float, str, list[Trajectory]]:
        """Return the largest part of a limit that any rival would come to under a command, and of which; with the
        motions of the estimates. ``points``: of their sigma points too, but one that diverges is no machine.
        """
        worst, name, runs = 0.0, "", list[Trajectory]()
        for i, c in enumerate(self.contenders):
            for k, theta in enumerate([c.theta, *(c.sigma_points if points else ())]):
                run = self.run(i, t, u, theta)
                if run is None and k > 0:
                    continue
                part, which = (np.inf, "it diverges") if run is None else limits.share(run)
                if part > worst:
                    worst, name = part, which
                if run is None or (worst > 1.0 and not points):
                    return worst, name, []
                if k == 0:
                    runs.append(run)
        return worst, name, runs


def _compressed(cost: float, s: PreparedSegment) -> float:
    """Return squares in units of the noise as -2 log likelihood with an unknown variance: it grows but slowly."""
    n = float(s.y.size)
    return float(n * np.log1p(max(cost, 0.0) / n))


__all__ = ["Pair", "RivalBench"]
