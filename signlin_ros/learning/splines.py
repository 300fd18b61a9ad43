"""Curves and surfaces with given knots, fitted to binned samples, and where knots help: what
`signlin_ros.learning.curve` weighs against each other.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from signlin_ros.effects.learned_force import learned_curve
from signlin_ros.errors import InputError
from signlin_ros.mathops import NumpyMath

Array = NDArray[np.float64]
Knots = tuple[Array, ...]

MAX_KNOTS = (10, 5)
"""Most knots of a curve, and of a surface in each direction."""
SPLINE_BINS = (300, 24)
"""Bins of a curve, and of a surface in each direction."""
PLACES = (24, 8)
"""Places in each direction that a new knot is tried at."""
MIN_BIN_SHARE = 0.005
"""Least share of the samples' weight between two knots."""
BEND_WEIGHT = 1e-6
"""Weight of the squared bends of a curve, in shares of the samples' weight: it decides where there are no samples."""
REFINING_STEPS = 3
"""Steps from the values that suit straight lines between the knots to those that suit the curve."""


@dataclass(frozen=True)
class Samples:
    """Coordinates (d, T), the force's negative (T,), weights (T,) and folds (T,)."""

    x: Array
    f: Array
    w: Array
    fold: NDArray[np.int64]


@dataclass(frozen=True)
class KnotPlan:
    """What is to be learned."""

    over: str
    shape: str
    jump: bool

    @property
    def names(self) -> list[str]:
        """The coordinates."""
        return self.over.split(", ")


@dataclass(frozen=True)
class Bins:
    """Bins that hold samples: mean coordinates (d, n), and weight, weighted sum and sum of squares of f by fold
    (k, n); places at which knots may stand, and the outermost ones, of each coordinate.
    """

    x: Array
    w: Array
    s: Array
    square: Array
    places: tuple[Array, ...]
    ends: tuple[tuple[float, float], ...]

    def without(self, fold: int) -> Bins:
        """Return the bins without the samples of one fold."""
        keep = np.arange(len(self.w)) != fold
        return Bins(self.x, self.w[keep], self.s[keep], self.square[keep], self.places, self.ends)

    def only(self, fold: int) -> Bins:
        """Return the bins with the samples of one fold alone."""
        one = slice(fold, fold + 1)
        return Bins(self.x, self.w[one], self.s[one], self.square[one], self.places, self.ends)

    def left(self, f: Array) -> float:
        """Return the weighted sum of the squares that a curve, f (n,) in the bins, leaves."""
        w, s = self.w.sum(axis=0), self.s.sum(axis=0)
        return max(float(self.square.sum() - 2 * f @ s + (f * f) @ w), 0.0)


def binned(samples: Samples, plan: KnotPlan) -> Bins:
    """Return the samples in bins, half of the edges evenly spaced, half evenly filled; none across 0."""
    two = len(samples.x) - 1
    index, ends, places = np.zeros(samples.f.size, dtype=np.int64), [], []
    for x, name in zip(samples.x, plan.names, strict=True):
        shares = np.linspace(0.0, 1.0, SPLINE_BINS[two] // 2 + 1)
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
    return Bins(x, w, sums(samples.f), sums(samples.f**2), tuple(places), tuple(ends))


# -------------------------------------------------------------------- a curve with given knots


def curve(at: Sequence[Array], knots: Knots, values: Array) -> Array:
    """Return f (n,) without its jump, as the effect's own law says."""
    return np.asarray(learned_curve(NumpyMath(), at, knots, values))  # type: ignore[arg-type]


def _hats(x: Array, knots: Array) -> Array:
    """Return the weights (n, m) of the knots' values for straight lines between and beyond them."""
    i = np.clip(np.searchsorted(knots, x, side="right") - 1, 0, knots.size - 2)
    t = (x - knots[i]) / (knots[i + 1] - knots[i])
    rows, found = np.arange(x.size), np.zeros((x.size, knots.size))
    found[rows, i], found[rows, i + 1] = 1 - t, t
    return found


def _design(x: Array, knots: Knots, plan: KnotPlan) -> Array:
    """Return the columns (n, values [+ 1]) of the values, and of the jump if there is one."""
    found = _hats(x[0], knots[0])
    for column, more in zip(x[1:], knots[1:], strict=True):
        found = (found[:, :, None] * _hats(column, more)[:, None, :]).reshape(x.shape[1], -1)
    return np.column_stack([found, np.sign(x[plan.names.index("speed")])]) if plan.jump else found


def _bends(knots: Knots, plan: KnotPlan) -> Array:
    """Return the rows (r, values [+ 1]) of the second differences in each direction."""
    shape, rows = [k.size for k in knots], []
    identity = np.eye(int(np.prod(shape))).reshape(*shape, -1)
    for axis, size in enumerate(shape):
        if size > 2:
            rows.append(np.diff(identity, 2, axis=axis).reshape(-1, identity.shape[-1]))
    found = np.concatenate(rows) if rows else np.zeros((0, identity.shape[-1]))
    return np.column_stack([found, np.zeros(len(found))]) if plan.jump else found


def _solved(columns: Array, target: Array, w: Array, knots: Knots, plan: KnotPlan) -> Array:
    """Return the values (and the jump) for which columns times them are nearest to a target (n,)."""
    root, bends = np.sqrt(w), _bends(knots, plan)
    stiff = np.sqrt(BEND_WEIGHT * w.sum()) * bends
    A = np.concatenate([root[:, None] * columns, stiff])
    b = np.concatenate([root * target, np.zeros(len(stiff))])
    if plan.shape == "free":
        free = np.asarray(np.linalg.lstsq(A, b, rcond=None)[0])
        if not plan.jump or free[-1] >= 0:
            return free
        return np.append(np.linalg.lstsq(A[:, :-1], b, rcond=None)[0], 0.0)
    T, low, high = _bounds(knots, plan)
    return np.asarray(T @ lsq_linear(A @ T, b, (low, high), method="bvls").x)


def _bounds(knots: Knots, plan: KnotPlan) -> tuple[Array, Array, Array]:
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


def fitted(bins: Bins, knots: Knots, plan: KnotPlan, steps: int) -> Array:
    """Return the values (and the jump) of the curve that fits the bins best, by Gauss-Newton from straight lines."""
    w = bins.w.sum(axis=0)
    there = w > 0
    x, w, target = bins.x[:, there], w[there], bins.s.sum(axis=0)[there] / w[there]
    theta = _solved(_design(x, knots, plan), target, w, knots, plan)
    best, least = theta, np.inf
    for step in range(steps + 1):
        f = shown(x, knots, theta, plan)
        left = float(w @ (target - f) ** 2)
        if left >= least:
            break
        best, least = theta, left
        if step < steps:
            columns = _slopes(x, knots, theta, plan)
            theta = _solved(columns, target - f + columns @ theta, w, knots, plan)
    return best


def shown(x: Array, knots: Knots, theta: Array, plan: KnotPlan) -> Array:
    """Return f (n,)."""
    f = curve(list(x), knots, theta[: theta.size - plan.jump])
    return f + theta[-1] * np.sign(x[plan.names.index("speed")]) if plan.jump else f


def _slopes(x: Array, knots: Knots, theta: Array, plan: KnotPlan) -> Array:
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
        return np.flatnonzero(apart >= MIN_BIN_SHARE)


def grown(bins: Bins, plan: KnotPlan) -> list[Knots]:
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
    while found := _next(G, c, chosen, bases, MAX_KNOTS[two]):
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


__all__ = ["REFINING_STEPS", "Bins", "KnotPlan", "Knots", "Samples", "binned", "curve", "fitted", "grown", "shown"]
