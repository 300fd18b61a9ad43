"""Learns the curve of a `learned_force` from samples of the force that a model lacks.

The knots are chosen one by one where they help most (as in MARS [Friedman 1991, doi:10.1214/aos/1176347963]); how many
there are, and whether the curve jumps at standstill, is decided on blocks of samples that the curve has not seen: the
fewest whose unseen error is within a standard error of the best. Samples are binned over the coordinates first, so that
a hundred thousand cost no more than the bins.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import lsq_linear

from signlin_ros.effects.learned_force import OVER, learned_curve
from signlin_ros.errors import InputError, choices
from signlin_ros.mathops import NumpyMath

Array = NDArray[np.float64]
Knots = tuple[Array, ...]

SHAPES = ("free", "rising", "dissipative")
"""Any curve; one that only rises with the (first) coordinate; one that only takes energy, over the speed."""
MOST = (10, 5)
"""Most knots of a curve, and of a surface in each direction."""
BINS = (300, 24)
"""Bins of a curve, and of a surface in each direction."""
PLACES = (24, 8)
"""Places in each direction that a new knot is tried at."""
FOLDS = 5
"""Groups of blocks, each of which is left out once."""
BLOCKS = 10
"""Blocks that samples are divided into, in their order, where none are given."""
LEAST_SHARE = 0.005
"""Least share of the samples' weight between two knots."""
STIFF = 1e-6
"""Weight of the squared bends of a curve, in shares of the samples' weight: it decides where there are no samples."""
REFINED = 3
"""Steps from the values that suit straight lines between the knots to those that suit the curve."""
SURE = 2.0
"""Standard errors by which a jump must lower the unseen error."""
FEWEST = 20
"""Samples beneath which no curve is learned."""


@dataclass(frozen=True)
class Learned:
    """A learned curve f(over) + jump sign(v), the force on the moving mass being its negative.

    Errors are weighted RMS values in the force's unit: ``before`` is the missing force, ``unseen`` what the curve
    leaves of it in blocks that it has not seen, ``seen`` in all that it was made from. ``counts``: unseen error by
    number of values.
    """

    over: str
    knots: Knots
    values: Array
    jump: float
    before: float
    unseen: float
    seen: float
    counts: dict[int, float] = field(default_factory=dict)

    @property
    def explained(self) -> float:
        """Share of the missing force's square that it takes away on what it has not seen; negative: it adds to it."""
        return 1.0 - (self.unseen / self.before) ** 2 if self.before > 0 else 0.0

    def parameters(self) -> dict[str, Any]:
        """Return the parameters of the effect `learned_force`, as ``Model.with_effect`` takes them."""
        second = {"knots_2": self.knots[1].tolist()} if len(self.knots) > 1 else {}
        over = self.over.split(", ")
        return {
            "over": over if len(over) > 1 else over[0],
            "knots": self.knots[0].tolist(),
            **second,
            "values": self.values.tolist(),
            "jump": self.jump,
        }

    def force(self, *at: ArrayLike) -> Array:
        """Return the force on the moving mass (T,) at coordinates (T,) each, in the order of ``over``."""
        columns = [np.asarray(x, dtype=float) for x in at]
        found = -_curve(columns, self.knots, self.values)
        names = self.over.split(", ")
        return found - self.jump * np.sign(columns[names.index("speed")]) if "speed" in names else found


def learn(
    coordinates: Mapping[str, ArrayLike],
    force: ArrayLike,
    weights: ArrayLike | None = None,
    blocks: ArrayLike | None = None,
    *,
    shape: str = "free",
    jump: bool | None = None,
) -> Learned:
    """Learn the curve of a missing force.

    Parameters
    ----------
    coordinates : one or two of ``speed``, ``position``, ``load``, each (T,), in SI units.
    force : (T,), the force on the moving mass that the model lacks; what is not finite is left out.
    weights : (T,), of the samples; all alike without it.
    blocks : (T,), whole numbers: samples of a block are left out together. Without it samples in their order are parted
        into ten. Blocks should be longer than what correlates the samples, records for instance.
    shape : one of `SHAPES`.
    jump : whether dry friction, a jump at standstill, is learned with it; None: where it lowers the unseen error.

    Raises
    ------
    InputError
        A coordinate or shape that is not known, arrays of different lengths, or too few samples.
    """
    over, samples = _samples(coordinates, force, weights, blocks)
    if shape not in SHAPES or (shape == "dissipative" and over != "speed"):
        allowed = f"{choices(SHAPES)}; dissipative over the speed alone"
        raise InputError(f"shape: found {shape!r} over {over}; allowed: {allowed}")
    straddles = "speed" in over and np.ptp(np.sign(samples.x[over.split(", ").index("speed")])) == 2
    tried = [False, True] if jump is None and straddles else [bool(jump) and bool(straddles)]
    plans = [_Plan(over, shape, jumps) for jumps in tried]
    bins = _binned(samples, plans[0])
    found = [_learned(plan, bins) for plan in plans]
    return _better(*found) if len(found) > 1 else found[0][1]


# -------------------------------------------------------------------- samples


@dataclass(frozen=True)
class _Samples:
    """Coordinates (d, T), the force's negative (T,), weights (T,) and folds (T,)."""

    x: Array
    f: Array
    w: Array
    fold: NDArray[np.int64]


def _samples(
    coordinates: Mapping[str, ArrayLike], force: ArrayLike, weights: ArrayLike | None, blocks: ArrayLike | None
) -> tuple[str, _Samples]:
    over = ", ".join(coordinates)
    if over not in OVER:
        raise InputError(f"coordinates: found {over or 'none'}; allowed: {'; '.join(OVER)}")
    f = -np.asarray(force, dtype=float)
    count = f.size
    x = [np.asarray(c, dtype=float) for c in coordinates.values()]
    w = np.ones(count) if weights is None else np.asarray(weights, dtype=float)
    b = np.arange(count) * BLOCKS // max(count, 1) if blocks is None else np.asarray(blocks)
    for name, column in (*zip(coordinates, x, strict=True), ("weights", w), ("blocks", b)):
        if column.shape != (count,):
            raise InputError(f"{name}: found shape {column.shape}; allowed: ({count},), that of the force")
    good = np.isfinite(f) & np.isfinite(w) & (w > 0) & np.all(np.isfinite(x), axis=0)
    if good.sum() < FEWEST:
        raise InputError(f"force: found {good.sum()} samples that are numbers; allowed: {FEWEST} or more")
    _, block = np.unique(b[good], return_inverse=True)
    if block.max() == 0:
        raise InputError("blocks: found one; allowed: two or more, to have some that the curve has not seen")
    return over, _Samples(np.array(x)[:, good], f[good], w[good] / w[good].mean(), block % FOLDS)


@dataclass(frozen=True)
class _Plan:
    """What is to be learned."""

    over: str
    shape: str
    jump: bool

    @property
    def names(self) -> list[str]:
        """The coordinates."""
        return self.over.split(", ")


@dataclass(frozen=True)
class _Bins:
    """Bins that hold samples: mean coordinates (d, n), and weight, weighted sum and sum of squares of f by fold
    (k, n); places at which knots may stand, and the outermost ones, of each coordinate.
    """

    x: Array
    w: Array
    s: Array
    square: Array
    places: tuple[Array, ...]
    ends: tuple[tuple[float, float], ...]

    def without(self, fold: int) -> _Bins:
        """Return the bins without the samples of one fold."""
        keep = np.arange(len(self.w)) != fold
        return _Bins(self.x, self.w[keep], self.s[keep], self.square[keep], self.places, self.ends)

    def only(self, fold: int) -> _Bins:
        """Return the bins with the samples of one fold alone."""
        one = slice(fold, fold + 1)
        return _Bins(self.x, self.w[one], self.s[one], self.square[one], self.places, self.ends)

    def left(self, f: Array) -> float:
        """Return the weighted sum of the squares that a curve, f (n,) in the bins, leaves."""
        w, s = self.w.sum(axis=0), self.s.sum(axis=0)
        return max(float(self.square.sum() - 2 * f @ s + (f * f) @ w), 0.0)


def _binned(samples: _Samples, plan: _Plan) -> _Bins:
    """Return the samples in bins, half of the edges evenly spaced, half evenly filled; none across 0."""
    two = len(samples.x) - 1
    index, ends, places = np.zeros(samples.f.size, dtype=np.int64), [], []
    for x, name in zip(samples.x, plan.names, strict=True):
        shares = np.linspace(0.0, 1.0, BINS[two] // 2 + 1)
        edges = np.unique([*np.quantile(x, shares), *np.linspace(x.min(), x.max(), shares.size), 0.0])
        index = index * (edges.size + 1) + np.searchsorted(edges, x, side="left")
        low, high = np.quantile(x, [0.001, 0.999])
        if not high > low:
            raise InputError(f"{name}: found the same value in all samples; allowed: one that varies")
        ends.append((float(low), float(high)))
        inner = np.linspace(0.0, 1.0, PLACES[two] + 2)[1:-1]
        still = [0.0] if name == "speed" else []
        places.append(np.unique([*np.quantile(x, inner), *(low + inner * (high - low)), *still]))
    _, cell = np.unique(index, return_inverse=True)
    total, folds = cell.max() + 1, samples.fold.max() + 1
    slot = samples.fold * total + cell

    def sums(values: Array) -> Array:
        return np.asarray(np.bincount(slot, samples.w * values, folds * total).reshape(folds, total), dtype=float)

    w = sums(np.ones_like(samples.f))
    x = np.array([sums(column).sum(axis=0) / w.sum(axis=0) for column in samples.x])
    return _Bins(x, w, sums(samples.f), sums(samples.f**2), tuple(places), tuple(ends))


# -------------------------------------------------------------------- a curve with given knots


def _curve(at: Sequence[Array], knots: Knots, values: Array) -> Array:
    return np.asarray(learned_curve(NumpyMath(), at, knots, values))  # type: ignore[arg-type]


def _hats(x: Array, knots: Array) -> Array:
    """Return the weights (n, m) of the knots' values for straight lines between and beyond them."""
    i = np.clip(np.searchsorted(knots, x, side="right") - 1, 0, knots.size - 2)
    t = (x - knots[i]) / (knots[i + 1] - knots[i])
    rows, found = np.arange(x.size), np.zeros((x.size, knots.size))
    found[rows, i], found[rows, i + 1] = 1 - t, t
    return found


def _design(x: Array, knots: Knots, plan: _Plan) -> Array:
    """Return the columns (n, values [+ 1]) of the values, and of the jump if there is one."""
    found = _hats(x[0], knots[0])
    for column, more in zip(x[1:], knots[1:], strict=True):
        found = (found[:, :, None] * _hats(column, more)[:, None, :]).reshape(x.shape[1], -1)
    return np.column_stack([found, np.sign(x[plan.names.index("speed")])]) if plan.jump else found


def _bends(knots: Knots, plan: _Plan) -> Array:
    """Return the rows (r, values [+ 1]) of the second differences in each direction."""
    shape, rows = [k.size for k in knots], []
    identity = np.eye(int(np.prod(shape))).reshape(*shape, -1)
    for axis, size in enumerate(shape):
        if size > 2:
            rows.append(np.diff(identity, 2, axis=axis).reshape(-1, identity.shape[-1]))
    found = np.concatenate(rows) if rows else np.zeros((0, identity.shape[-1]))
    return np.column_stack([found, np.zeros(len(found))]) if plan.jump else found


def _solved(columns: Array, target: Array, w: Array, knots: Knots, plan: _Plan) -> Array:
    """Return the values (and the jump) for which columns times them are nearest to a target (n,)."""
    root, bends = np.sqrt(w), _bends(knots, plan)
    stiff = np.sqrt(STIFF * w.sum()) * bends
    A = np.concatenate([root[:, None] * columns, stiff])
    b = np.concatenate([root * target, np.zeros(len(stiff))])
    if plan.shape == "free":
        free = np.asarray(np.linalg.lstsq(A, b, rcond=None)[0])
        if not plan.jump or free[-1] >= 0:
            return free
        return np.append(np.linalg.lstsq(A[:, :-1], b, rcond=None)[0], 0.0)
    T, low, high = _bounds(knots, plan)
    return np.asarray(T @ lsq_linear(A @ T, b, (low, high), method="bvls").x)


def _bounds(knots: Knots, plan: _Plan) -> tuple[Array, Array, Array]:
    """Return values (and jump) = T z with bounds on z that make the curve of the shape that is asked for."""
    count = int(np.prod([k.size for k in knots]))
    T, low = np.eye(count + plan.jump), np.full(count + plan.jump, -np.inf)
    high = np.full(count + plan.jump, np.inf)
    if plan.shape == "rising":  # sums of steps along the first coordinate that are not negative
        step = count // knots[0].size
        T[:count, :count] = np.kron(np.tri(knots[0].size), np.eye(step))
        low[step:count] = 0.0
    if plan.shape == "dissipative":
        low[:count] = np.where(knots[0] > 0, 0.0, np.where(knots[0] < 0, -np.inf, -1e-300))
        high[:count] = np.where(knots[0] < 0, 0.0, np.where(knots[0] > 0, np.inf, 1e-300))
    if plan.jump:
        low[-1] = 0.0
    return T, low, high


def _fitted(bins: _Bins, knots: Knots, plan: _Plan, steps: int) -> Array:
    """Return the values (and the jump) of the curve that fits the bins best, by Gauss-Newton from straight lines."""
    w = bins.w.sum(axis=0)
    there = w > 0
    x, w, target = bins.x[:, there], w[there], bins.s.sum(axis=0)[there] / w[there]
    theta = _solved(_design(x, knots, plan), target, w, knots, plan)
    best, least = theta, np.inf
    for step in range(steps + 1):
        f = _shown(x, knots, theta, plan)
        left = float(w @ (target - f) ** 2)
        if left >= least:
            break
        best, least = theta, left
        if step < steps:
            columns = _slopes(x, knots, theta, plan)
            theta = _solved(columns, target - f + columns @ theta, w, knots, plan)
    return best


def _shown(x: Array, knots: Knots, theta: Array, plan: _Plan) -> Array:
    """Return f (n,)."""
    curve = _curve(list(x), knots, theta[: theta.size - plan.jump])
    return curve + theta[-1] * np.sign(x[plan.names.index("speed")]) if plan.jump else curve


def _slopes(x: Array, knots: Knots, theta: Array, plan: _Plan) -> Array:
    """Return the derivatives (n, values [+ 1]) of f, by differences: it is of degree one in the values."""
    values = theta[: theta.size - plan.jump]
    h = 1e-6 * max(float(np.abs(values).max()), 1e-300)
    ends = [values[:, None, None] + sign * h * np.eye(values.size)[:, :, None] for sign in (1.0, -1.0)]
    up, down = (np.asarray(learned_curve(NumpyMath(), list(x), knots, one)) for one in ends)  # type: ignore[arg-type]
    slopes = (up - down).T / (2 * h)
    return np.column_stack([slopes, np.sign(x[plan.names.index("speed")])]) if plan.jump else slopes


# -------------------------------------------------------------------- how many knots, and where


@dataclass(frozen=True)
class _Basis:
    """Broken lines of one coordinate: columns (n, p) 1, x, and x beyond every place; whether each is chosen yet.

    ``at`` (p,): the places, the outermost knots standing for the first two; ``share`` (p,): the share of the samples'
    weight below each.
    """

    columns: Array
    at: Array
    share: Array

    @classmethod
    def of(cls, x: Array, w: Array, ends: tuple[float, float], places: Array) -> _Basis:
        """Return the basis of a coordinate, in units of half its range."""
        at = np.array([*ends, *(p for p in places if ends[0] < p < ends[1])])
        z = (x - x.mean()) / (ends[1] - ends[0]) * 2
        beyond = np.maximum(x[:, None] - at[2:], 0.0) / (ends[1] - ends[0]) * 2
        share = (w @ (x[:, None] < at)) / w.sum()
        return cls(np.column_stack([np.ones_like(z), z, beyond]), at, share)

    def first(self, name: str) -> list[int]:
        """Return the knots that there always are: the outermost, and standstill."""
        return [0, 1, *np.flatnonzero((self.at == 0.0) & (name == "speed")).tolist()]

    def free(self, chosen: Sequence[int]) -> NDArray[np.int64]:
        """Return the places with enough samples between them and what is chosen."""
        apart = np.abs(self.share[:, None] - self.share[list(chosen)]).min(axis=1)
        apart[:2] = 0.0
        return np.flatnonzero(apart >= LEAST_SHARE)


def _grown(bins: _Bins, plan: _Plan) -> list[Knots]:
    """Return knots, from the fewest on, each set with one more, where straight lines between them gain most.

    Forward selection on the normal equations of all broken lines (orthogonal least squares)
    [Chen, Billings and Luo 1989, doi:10.1080/00207178908953472].
    """
    w, s, two = bins.w.sum(axis=0), bins.s.sum(axis=0), len(bins.x) - 1
    bases = [_Basis.of(x, w, e, p) for x, e, p in zip(bins.x, bins.ends, bins.places, strict=True)]
    columns = bases[0].columns if not two else _products(bases[0].columns, bases[1].columns)
    shape = tuple(b.at.size for b in bases)
    if plan.jump:
        columns = np.column_stack([columns, np.sign(bins.x[plan.names.index("speed")])])
    G, c = columns.T @ (w[:, None] * columns), columns.T @ s
    chosen = [b.first(name) for b, name in zip(bases, plan.names, strict=True)]
    G, c = _projected(G, c, [*_block(chosen, shape), *range(int(np.prod(shape)), len(c))])
    sets = [_knots(bases, chosen)]
    while found := _next(G, c, chosen, bases, MOST[two]):
        axis, place = found
        block = _block([[place] if a == axis else one for a, one in enumerate(chosen)], shape)
        G, c = _projected(G, c, block)
        chosen = [[*one, place] if a == axis else one for a, one in enumerate(chosen)]
        sets.append(_knots(bases, chosen))
    return sets


def _products(a: Array, b: Array) -> Array:
    """Return all products (n, p q) of columns (n, p) and (n, q)."""
    return np.asarray((a[:, :, None] * b[:, None, :]).reshape(len(a), -1))


def _block(chosen: Sequence[Sequence[int]], shape: tuple[int, ...]) -> list[int]:
    """Return the columns that belong to members of each basis."""
    if len(chosen) == 1:
        return list(chosen[0])
    return [i * shape[1] + j for i in chosen[0] for j in chosen[1]]


def _projected(G: Array, c: Array, block: Sequence[int]) -> tuple[Array, Array]:
    """Return normal equations of what a block of columns leaves."""
    own = G[np.ix_(block, block)]
    solved = np.linalg.pinv(own, hermitian=True) @ np.column_stack([G[block], c[block]])
    return G - G[:, block] @ solved[:, :-1], c - G[:, block] @ solved[:, -1]


def _next(
    G: Array, c: Array, chosen: Sequence[Sequence[int]], bases: Sequence[_Basis], most: int
) -> tuple[int, int] | None:
    """Return the coordinate and the place of the knot that gains most; None where there is none to add."""
    shape, best, found = tuple(b.at.size for b in bases), 0.0, None
    for axis, basis in enumerate(bases):
        places = basis.free(chosen[axis])
        if len(chosen[axis]) >= most or not places.size:
            continue
        blocks = np.array([_block([[i] if a == axis else one for a, one in enumerate(chosen)], shape) for i in places])
        own = G[blocks[:, :, None], blocks[:, None, :]]
        own = own + (1e-12 * np.trace(own, axis1=1, axis2=2)[:, None, None] + 1e-300) * np.eye(blocks.shape[1])
        gains = np.einsum("ij,ij->i", c[blocks], np.linalg.solve(own, c[blocks][:, :, None])[:, :, 0])
        if gains.max() > best:
            best, found = float(gains.max()), (axis, int(places[np.argmax(gains)]))
    return found


def _knots(bases: Sequence[_Basis], chosen: Sequence[Sequence[int]]) -> Knots:
    return tuple(np.sort(b.at[one]) for b, one in zip(bases, chosen, strict=True))


@dataclass(frozen=True)
class _Tried:
    """Unseen sums of squares (folds, sets) of growing sets of knots, and how many values each has."""

    left: Array
    sizes: list[int]

    def chosen(self) -> int:
        """Return the fewest knots within a standard error of the best, going by the folds' differences."""
        total = self.left.sum(axis=0)
        best = int(np.argmin(total))
        for i in range(best):
            if total[i] - total[best] <= _spread(self.left[:, i] - self.left[:, best]):
                return i
        return best


def _spread(differences: Array) -> float:
    """Return the standard error of a sum of differences (folds,)."""
    return float(np.sqrt(differences.size) * np.std(differences, ddof=1)) if differences.size > 1 else 0.0


def _learned(plan: _Plan, bins: _Bins) -> tuple[Array, Learned]:
    """Return the unseen sums of squares of each fold and the curve, its number of knots chosen by them."""
    folds = range(len(bins.w))
    rows = [_unseen(bins.without(fold), bins.only(fold), plan) for fold in folds]
    depth = min(len(row) for row in rows)
    left = np.array([row[:depth] for row in rows])
    sets = _grown(bins, plan)
    depth = min(depth, len(sets))
    tried = _Tried(left[:, :depth], [int(np.prod([k.size for k in knots])) for knots in sets[:depth]])
    i, weight = tried.chosen(), bins.w.sum()
    knots = sets[i]
    theta = _fitted(bins, knots, plan, REFINED)

    def rms(square: float) -> float:
        return float(np.sqrt(square / weight))

    counts = {size: rms(float(total)) for size, total in zip(tried.sizes, tried.left.sum(axis=0), strict=True)}
    values, jump = (theta[:-1], float(theta[-1])) if plan.jump else (theta, 0.0)
    seen, unseen = rms(bins.left(_shown(bins.x, knots, theta, plan))), rms(float(tried.left[:, i].sum()))
    found = Learned(plan.over, knots, values, jump, rms(float(bins.square.sum())), unseen, seen, counts)
    return tried.left[:, i], found


def _unseen(seen: _Bins, unseen: _Bins, plan: _Plan) -> list[float]:
    """Return what growing sets of knots, fitted to some bins, leave of others."""
    sets = _grown(seen, plan)
    steps = 1 if len(seen.x) == 1 else 0  # of a surface, refining takes long and changes little
    return [unseen.left(_shown(unseen.x, knots, _fitted(seen, knots, plan, steps), plan)) for knots in sets]


def _better(smooth: tuple[Array, Learned], jumping: tuple[Array, Learned]) -> Learned:
    """Return the curve without a jump, unless one with it is better by more than a standard error."""
    gained, told = smooth[0] - jumping[0], jumping[1].explained > 0
    return jumping[1] if told and gained.sum() > SURE * _spread(gained) else smooth[1]


__all__ = ["SHAPES", "Learned", "learn"]
