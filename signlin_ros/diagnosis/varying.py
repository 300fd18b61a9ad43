"""Does friction, or inertia, vary along the way? A search for waves over the position in what a model leaves.

A rail that is tighter in places, a bearing with a high spot, a crank: what varies with the position averages out where
the motion is fast, and a constant friction or inertia then leaves what looks like noise. No listed effect is one, so it
gets no name, but it can be told. What an observer leaves is filtered with its own response to a force (a matched
filter) and multiplied by the velocity, its sign, or the acceleration; peaks of the spectrum of that over the position
show the waves. Each is then regressed on, beside the same wave of a plain force and all that the fit's parameters could
still change, and tested by sums over blocks, whatever correlation what is left has within them [Hotelling, Ann. Math.
Stat. 2 (1931) 360; Liang and Zeger, Biometrika 73 (1986) 13].
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import ceil

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar
from scipy.stats import f as fisher
from scipy.stats import norm

from signlin_ros.diagnosis.dependence import BLOCK, BLOCKS, LEAST, MOST, left_of
from signlin_ros.diagnosis.fit import Fit, follow_records
from signlin_ros.diagnosis.problem import Problem, Segment
from signlin_ros.diagnosis.scan import FASTEST, backwards, finest, halfway, peaks, response
from signlin_ros.diagnosis.tracking import Tracker
from signlin_ros.errors import InputError
from signlin_ros.model import Model
from signlin_ros.trace import resolve_unit

Array = NDArray[np.float64]

PEAKS = 3
"""Waves that are tried for each of what may vary."""
PARTS = 16
"""Parts of a wave in which what varies is told."""
PERIODS = 1.0
"""Periods that a travel must have, at least."""
FINER = 0.02
"""What an order is known to, as a share of the distance of two that a travel tells apart."""
DIFFERENT, RELATIVE = 1e-3, 1e-8
"""Size, as a share, that must be left of a wave beside the same wave of a plain force (none is of dry friction where
the motion has one direction); and what counts as singular."""


VISCOUS, DRY, INERTIA = "viscous friction", "coulomb friction", "inertia"
"""What may vary, and goes with the velocity, its sign, or the acceleration."""


@dataclass(frozen=True)
class Varying:
    """What varies with the position: the force is -a ``what`` sin(N q + phi), of a velocity, its sign, an acceleration.

    ``order``: N, per unit of the position. ``phase``: phi. ``amplitude``: a, in the units of force and of what it goes
    with. ``force``: root mean square of that force. ``certainty``: in standard errors of a normal one.
    """

    what: str
    order: float
    phase: float
    amplitude: float
    force: float
    certainty: float


def unit_of(problem: Problem, what: str) -> str:
    """Return the unit of the amplitude of what varies."""
    declared = {VISCOUS: "F·s/Q", DRY: "F", INERTIA: "F·s²/Q"}[what]
    return resolve_unit(declared, problem.base.plant, problem.rotary)


@dataclass(frozen=True)
class _Left:
    """What a model leaves between two samples each, records one after the other: T in all, in ny channels.

    ``rest`` (T, ny): innovations; ``known`` (T, ny): whether there are any; ``slopes`` (T ny, k): how the parameters
    would change them; ``lengths``: samples of each record; ``q``, ``goes`` (T,): position, and what each of what may
    vary goes with; ``block`` (T,): in which block a sample is; ``seen`` (M, ny): the response to a force.
    """

    rest: Array
    known: NDArray[np.bool_]
    slopes: Array
    lengths: tuple[int, ...]
    q: Array
    goes: Mapping[str, Array]
    block: NDArray[np.int_]
    seen: Array

    def of(self, values: Array) -> list[Array]:
        """Return values (T, ...) by record."""
        return np.split(values, np.cumsum(self.lengths)[:-1])

    def matched(self) -> Array:
        """Return what is left (T,), filtered with the response to a force backwards."""
        return np.concatenate([backwards(e, self.seen) for e in self.of(self.rest)])

    def trace(self, forces: Array) -> Array:
        """Return what an observer leaves (T ny, k) of forces (T, k)."""
        ny = self.rest.shape[1]
        one = [left_of(w, self.seen, len(w) + 1, ny)[1:] for w in self.of(forces)]
        return np.asarray(np.where(self.known[:, :, None], np.concatenate(one), 0.0).reshape(self.rest.size, -1))

    def apart(self, columns: Array, beside: Array) -> tuple[Array, Array]:
        """Return columns (T ny, k) and what is left (T ny,) without what others ``beside`` them make of either."""
        beside = beside / np.linalg.norm(beside, axis=0)
        both = np.column_stack([columns, self.rest.ravel()])
        both -= beside @ np.linalg.lstsq(beside, both, rcond=RELATIVE)[0]
        return both[:, :-1], both[:, -1]

    def tried(self, what: str, order: float) -> tuple[float, Varying]:
        """Return by how much a wave lowers the squares of what is left, and the wave, for an inertia of 1."""
        goes, waves = self.goes[what], np.column_stack([np.sin(order * self.q), np.cos(order * self.q)])
        columns = self.trace(waves * goes[:, None])
        alone, e = self.apart(columns, np.column_stack([self.slopes, self.trace(waves)]))
        if np.linalg.norm(alone) < DIFFERENT * np.linalg.norm(columns):
            return 0.0, Varying(what, order, 0.0, 0.0, 0.0, 0.0)
        fitted = np.linalg.lstsq(alone, e, rcond=None)[0]
        products = (alone * (e - alone @ fitted)[:, None]).reshape(*self.rest.shape, 2).sum(axis=1)
        force = float(np.sqrt(np.mean((waves @ fitted * goes) ** 2)))
        certainty = self._certainty(alone.T @ e, products)
        phase, size = float(np.arctan2(-fitted[1], -fitted[0])), float(np.hypot(*fitted))
        return float(e @ alone @ fitted), Varying(what, order, phase, size, force, certainty)

    def profile(self, what: str, order: float, parts: int) -> tuple[Array, Array]:
        """Return by how much what varies is larger than its mean (parts,) in each part of a wave, with its standard
        error as of white noise, for an inertia of 1.
        """
        part = (order * self.q / (2 * np.pi) % 1.0 * parts).astype(int)
        columns, e = self.apart(self.trace(np.eye(parts)[part] * self.goes[what][:, None]), self.slopes)
        spread = np.linalg.pinv(columns.T @ columns, rcond=DIFFERENT**2, hermitian=True)
        found = spread @ columns.T @ e
        error = np.sqrt(np.diag(spread) * np.mean((e - columns @ found) ** 2))
        return found.mean() - found, error

    def _certainty(self, score: Array, products: Array) -> float:
        """Return how certain a score (2,) is, whose noise are sums of products (T, 2) over all blocks."""
        count = int(self.block[-1]) + 1
        spread = count * np.cov([np.bincount(self.block, one, count) for one in products.T])
        if not np.linalg.cond(spread) < 1.0 / RELATIVE:
            return 0.0
        squared = float(score @ np.linalg.solve(spread, score))
        return float(norm.isf(fisher.sf(squared * (count - 2) / (2 * (count - 1)), 2, count - 2)))


def varying(problem: Problem, f: Fit) -> Varying | None:
    """Return the wave along the way that takes most of what a fitted model leaves; None where there is none to look
    for: no inertia, or a model that an extended Kalman filter follows, or too few samples.
    """
    left = _left(problem, f)
    if left is None or left.block[-1] + 1 < BLOCKS or not np.ptp(left.q) > 0.0:
        return None
    span, matched = float(np.ptp(left.q)), left.matched()
    highest = min(FASTEST / (problem.scale.velocity * problem.scale.step), finest(problem))
    orders = {
        w: peaks(left.q, matched * goes, highest, PEAKS, PERIODS * 2 * np.pi / span) for w, goes in left.goes.items()
    }
    found = [left.tried(what, order) for what, several in orders.items() for order in several]
    if not found:
        return None
    _, best = max(found, key=lambda one: one[0])
    bounds, tolerance = (best.order - np.pi / span, best.order + np.pi / span), FINER * np.pi / span
    finer = minimize_scalar(
        lambda N: -left.tried(best.what, N)[0], bounds=bounds, method="bounded", options={"xatol": tolerance}
    )
    _, best = max([*found, left.tried(best.what, float(finer.x))], key=lambda one: one[0])
    size = problem.scale.inertia
    return replace(best, amplitude=size * best.amplitude, force=size * best.force)


def along_a_wave(problem: Problem, f: Fit, found: Varying) -> tuple[Array, Array, Array]:
    """Return parts of a wave (P,), in waves from where the position is 0, and by how much what varies is larger there
    than its mean (P,), with its standard error, in the unit of the amplitude.
    """
    left = _left(problem, f)
    if left is None:
        raise InputError("this model leaves nothing in which something could vary along the way")
    size, error = left.profile(found.what, found.order, PARTS)
    return (np.arange(PARTS) + 0.5) / PARTS, problem.scale.inertia * size, problem.scale.inertia * error


def _left(problem: Problem, f: Fit) -> _Left | None:
    """Return what a fitted model leaves at the highest gain; None where no inertia is moved, a filter follows it, or
    the motion is lost.
    """
    gains, block, speed = problem.levels[0], max(int(BLOCK / problem.scale.step), LEAST), problem.base.plant.velocity
    if problem.scale.imposed or f.candidate.filtered or speed not in f.candidate.model.states:
        return None
    runs = [follow_records(problem, f.candidate, f.theta, gains, with_s) for with_s in (False, True)]
    if runs[0] is None or runs[1] is None:
        return None
    model, i, used = f.fitted(), f.candidate.model.states.index(speed), min(1.0, MOST / max(problem.samples, 1))
    parts: dict[str, list[Array]] = defaultdict(list)
    for s, e, X, D in zip(problem.segments, runs[0][0], runs[0][2], runs[1][1], strict=True):
        count = ceil(used * len(e))
        v, a = X[:count, i], _rates(problem, model, s, X)[:count, i]
        parts["q"].append(halfway(model, s.t[:count], X[:count]))
        parts[VISCOUS].append((v[1:] + v[:-1]) / 2)
        parts[INERTIA].append(a[:-1])
        parts["rest"].append(f.filter.apply(e[:count] / problem.noise)[1:])
        parts["slopes"].append(np.nan_to_num(f.filter.apply(D[:count] / problem.noise[:, None])[1:]))
        parts["block"].append(np.arange(count - 1) // block + (parts["block"][-1][-1] + 1 if parts["block"] else 0))
    whole = {name: np.concatenate(several) for name, several in parts.items()}
    slopes = whole["slopes"].reshape(whole["rest"].size, -1)
    return _Left(
        rest=np.nan_to_num(whole["rest"]),
        known=np.isfinite(whole["rest"]),
        slopes=slopes[:, np.any(slopes != 0.0, axis=0)],
        lengths=tuple(map(len, parts["q"])),
        q=whole["q"],
        goes={VISCOUS: whole[VISCOUS], DRY: np.sign(whole[VISCOUS]), INERTIA: whole[INERTIA]},
        block=whole["block"].astype(int),
        seen=f.filter.apply(response(problem, model, gains)),
    )


def _rates(problem: Problem, model: Model, s: Segment, X: Array) -> Array:
    """Return the rates (T, n) of states (T, n) in a model."""
    tracker = Tracker(model, s.t, s.u, s.y, problem.channels, np.ones(len(model.states)), s.early)
    return tracker.linearized(X)[0]


__all__ = ["DRY", "INERTIA", "VISCOUS", "Varying", "along_a_wave", "unit_of", "varying"]
