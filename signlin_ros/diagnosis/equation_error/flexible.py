"""Whether anything is left that goes with the motion, whatever its law, or that changes along the record.

A flexible regression, judged on validation data; and forces whose size changes slowly, judged on blocks left out. Which
one, and the weight of its ridge, is chosen by blocks of training data:

- a curve over the speed;
- loads, dry and viscous friction whose size is a curve over the position;
- loads, dry and viscous friction that repeat along the way;
- position, velocity, their past and what bristles of several lengths would do, through random cosine features [Rahimi
  and Recht, Advances in Neural Information Processing Systems 20, 2007].
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline
from scipy.signal import lfilter

from signlin_ros.comparison.force_segment import ForceSegment
from signlin_ros.diagnosis.blocks import MIN_DIVISOR, mean_t_ratio
from signlin_ros.diagnosis.equation_error.regression import (
    Regression,
    RegressionData,
    RegressionFit,
)
from signlin_ros.diagnosis.equation_error.waves import Waves
from signlin_ros.diagnosis.wording import phrases

Array = NDArray[np.float64]
Columns = Callable[[ForceSegment], Array]
"""What gives the columns (K, n) of a piece."""
FORCES: dict[str, Columns] = {
    "load": lambda p: np.ones_like(p.t),
    "dry friction": lambda p: p.sign,
    "viscous friction": lambda p: p.v,
}
"""Forces (T,) whose size may change along a record or along the way."""

FEATURES, WIDTHS = 160, (0.35, 0.8)
"""Random cosines, and how fine they are: inverse widths in standard deviations of a coordinate."""
MEMORY_TIMES = (0.15, 1.0)
"""Time constants in s of the past that counts."""
SLIP_WIDTHS = (0.002, 0.005, 0.01, 0.02, 0.04, 0.08, 0.15, 0.3)
"""Half widths of elements that slip, as parts of the travel."""
SPEED_KNOTS, SLOWEST_QUANTILE = 6, 0.3
"""Knots of a curve over the speed, at quantiles of it, from this one on: slower, the direction may be lost in noise,
and a curve would take what is lost of dry friction's corner for a law."""
POSITION_KNOTS = 12
"""Knots of a curve over the position, at quantiles of it."""
MIN_KNOTS = 2
"""Fewest knots that make a curve."""
WEIGHTS = (1e-3, 1e-2, 1e-1, 1.0, 10.0)
"""Weights of the ridge that are tried,"""
CURVE_FOLDS = 5
"""each on so many parts of the record, left out in turn."""
CHANGES = (6, 24)
"""Fewest and most splines of time that a size follows in a record, one for `BLOCKS_PER_SPLINE` blocks and two
reversals at most."""
BLOCKS_PER_SPLINE, MIN_CHANGING_PART = 3, 0.5
"""Blocks that a spline function spans; part of what is left beyond the noise that such a change takes away."""


class Curve(NamedTuple):
    """What a flexible regression makes of the force that is left of validation data.

    ``visible``: whether it surely takes a visible part away; ``percent`` of the effort (RMS) would be left then, inf
    where less than such a part is there; ``along``: the forces that change along the way, if that is it, in words.
    """

    visible: bool
    percent: float
    along: str = ""


class Curves(NamedTuple):
    """Columns of a flexible regression; ``labels``: what the curves are, by equal parts of the columns, in words."""

    columns: Columns
    labels: Sequence[str] = ()

    def largest(self, theta: Array) -> str:
        """Return what has the largest coefficients (n,), in words; empty where it has none."""
        if not self.labels:
            return ""
        parts = np.abs(theta).reshape(len(self.labels), -1)
        return self.labels[int(np.argmax(parts.max(axis=1)))]


@numba.njit(cache=True)
def slipping(q: Array, widths: Array) -> Array:
    """Return elastic elements (T, w) that follow q (T,) and slip at their half widths (w,): a Jenkin element each."""
    s = np.zeros((q.size, widths.size))
    for k in range(1, q.size):
        d = q[k] - q[k - 1]
        for j in range(widths.size):
            s[k, j] = min(max(s[k - 1, j] + d, -widths[j]), widths[j])
    return s


def _lagged(x: Array, step: float, tau: float) -> Array:
    a = 1.0 - np.exp(-step / tau)
    return np.asarray(lfilter([a], [1.0, a - 1.0], x))


def _coordinates(piece: ForceSegment) -> Array:
    """Return the coordinates (T, d) of a force; not effort and acceleration of now: their noise is in the residual."""
    v, step = piece.v, piece.step
    past = [
        _lagged(v, step, MEMORY_TIMES[0]),
        _lagged(np.abs(v), step, MEMORY_TIMES[1]),
        _lagged(piece.effort_nearby, step, MEMORY_TIMES[0]),
    ]
    return np.column_stack([v, *([piece.q] if piece.position_measured else []), *past])


def _everything(r: Regression) -> Columns:
    """Return random cosines of all that a force may go with, and what bristles of several lengths do."""
    every = np.concatenate([_coordinates(p) for p in r.training.pieces])
    mean, spread = every.mean(axis=0), every.std(axis=0) + 1e-12
    rng = np.random.default_rng(0)
    W = rng.standard_normal((every.shape[1], FEATURES)) * np.repeat(WIDTHS, FEATURES // len(WIDTHS))
    phase = rng.uniform(0.0, 2 * np.pi, FEATURES)
    widths = np.array(SLIP_WIDTHS) * (r.training.travel + MIN_DIVISOR)

    def columns(piece: ForceSegment) -> Array:
        Z = np.clip((_coordinates(piece) - mean) / spread, -3.0, 3.0)
        direction = np.sign(piece.v)[:, None]
        seen = [piece.seen(slipping(np.ascontiguousarray(piece.q), widths) / widths)]
        seen += [piece.seen(np.cos(Z @ W[:, part] + phase[part])) for part in piece.at_once(FEATURES)]
        return np.hstack([*seen, *(piece.seen(one) for one in (Z, Z[:, :1] * Z[:, 1:], direction, direction * Z))])

    return columns


def _splines(x: Array, inner: Array) -> Array:
    """Return cubic splines (T, k) of x (T,) over its ``inner`` knots, from the first of them to the last."""
    knots = np.concatenate([inner[:1].repeat(3), inner, inner[-1:].repeat(3)])
    return np.asarray(BSpline.design_matrix(np.clip(x, inner[0], inner[-1]), knots, 3).toarray())


def _over_speed(r: Regression) -> Columns:
    """Return splines of the size of the velocity, against the motion and with it; as they begin where it is slower."""
    speeds = np.abs(np.concatenate([p.v[p.kept] for p in r.training.pieces]))
    inner = np.unique(np.quantile(speeds, np.linspace(SLOWEST_QUANTILE, 1.0, SPEED_KNOTS)))

    def columns(piece: ForceSegment) -> Array:
        curves = _splines(np.abs(piece.v), inner)
        return piece.seen(np.hstack([curves * piece.sign[:, None], curves]))

    return columns if inner.size >= MIN_KNOTS else lambda piece: piece.seen(piece.sign[:, None])


def _over_position(r: Regression) -> Curves | None:
    """Return splines of the position, as the size of a load, of dry and of viscous friction; None where the position
    was not measured.
    """
    if not all(p.position_measured for p in r.training.pieces):
        return None
    places = np.concatenate([p.q[p.kept] for p in r.training.pieces])
    inner = np.unique(np.quantile(places, np.linspace(0.0, 1.0, POSITION_KNOTS)))
    if inner.size < MIN_KNOTS:
        return None

    def columns(piece: ForceSegment) -> Array:
        curves = _splines(piece.q, inner)
        return piece.seen(np.hstack([curves * force(piece)[:, None] for force in FORCES.values()]))

    return Curves(columns, [phrases.changes_along(name) for name in FORCES])


def _along_the_way(r: Regression, waves: Waves, left: Array) -> Curves | None:
    """Return the waves of forces that repeat along the way, at the orders at which what is left (K,) of training data
    does most; None where the position was not measured, or travels too little.
    """
    known, plant = r.training, r.model.plant
    measured = all(p.position_measured for p in known.pieces)
    orders = [
        (name, N)
        for name, force in (FORCES if measured else {}).items()
        for N in waves.strongest(left * np.concatenate([force(p)[p.kept] for p in known.pieces]))
    ]

    def columns(piece: ForceSegment) -> Array:
        waving = [FORCES[n](piece) * f(N * piece.q) for n, N in orders for f in (np.sin, np.cos)]
        return piece.seen(np.column_stack(waving))

    unit = plant.position_unit
    often = [f"{N:g} times a turn" if waves.whole else f"every {2 * np.pi / N:.3g} {unit}" for _, N in orders]
    labels = [phrases.repeats(name, how) for (name, _), how in zip(orders, often, strict=True)]
    return Curves(columns, labels) if orders else None


def _unseen_after(r: Regression, waves: Waves, fit: RegressionFit) -> tuple[Array, str]:
    """Return the residual (K,) of a flexible regression on validation data, and what changes along the way, if it
    does.
    """
    place = _along_the_way(r, waves, fit.training_residual), _over_position(r)
    curves = [c for c in (*place, Curves(_over_speed(r)), Curves(_everything(r))) if c]
    known = [_scaled(r.training, c.columns) for c in curves]
    tried = [_chosen(A, fit.training_residual, r.training.blocks) for A, _, _ in known]
    k = int(np.argmin([error for error, _ in tried]))
    A, centre, scale = known[k]
    theta = _ridge(A, fit.training_residual, tried[k][1])
    V = np.vstack([curves[k].columns(p) for p in r.validation.pieces])
    return np.asarray(fit.validation_residual - (V - centre) / scale @ theta), curves[k].largest(theta)


def _scaled(side: RegressionData, columns: Columns) -> tuple[Array, Array, Array]:
    """Return the columns (K, n) of a side, less their mean and over their spread, and both (n,)."""
    A = np.vstack([columns(p) for p in side.pieces])
    centre, scale = A.mean(axis=0), A.std(axis=0) + 1e-12
    return (A - centre) / scale, centre, scale


def _ridge(A: Array, y: Array, weight: float) -> Array:
    return np.asarray(np.linalg.solve(A.T @ A + weight * len(y) * np.eye(A.shape[1]), A.T @ y))


def _chosen(A: Array, y: Array, blocks: NDArray[np.intp]) -> tuple[float, float]:
    """Return the squared error of blocks of time that a ridge was not fitted to, and its weight: the best of them."""
    fold = blocks * CURVE_FOLDS // (int(blocks.max()) + 1)
    errors = np.zeros(len(WEIGHTS))
    for out in (fold == k for k in range(CURVE_FOLDS)):
        if not out.any() or out.all():
            continue
        values, vectors = np.linalg.eigh(A[~out].T @ A[~out])
        projected, seen = vectors.T @ (A[~out].T @ y[~out]), A[out] @ vectors
        left = [y[out] - seen @ (projected / (values + w * np.count_nonzero(~out))) for w in WEIGHTS]
        errors += [float(e @ e) for e in left]
    return min(zip(errors.tolist(), WEIGHTS, strict=True))


def structured(r: Regression, waves: Waves, base: RegressionFit, fit: RegressionFit) -> Curve:
    """Return the force residual of a fit, of validation data, after a flexible regression; visible beside what the
    ``base`` model leaves, or as a part of the effort.
    """
    c = r.criteria
    visible = min(c.min_flexible_share * base.validation_mse, (c.min_missing_share * r.validation.effort) ** 2)
    if fit.validation_mse <= visible:
        return Curve(False, np.inf)
    left, along = _unseen_after(r, waves, fit)
    flexible = RegressionFit((("flexible", ()),), fit.theta, fit.training_residual, lambda: left)
    large = fit.validation_mse - flexible.validation_mse > visible
    return Curve(large and r.surely(flexible, fit) > c.min_flexible_t, r.percent(flexible), along)


def changing(r: Regression, left: Array, own: Mapping[str, Columns] | None = None) -> str:
    """Return which force changes slowly along the validation data, and by its change is most of what is left (K,)
    beyond the sensors' noise; empty if none does. Each block of time is predicted from those around it. ``own``:
    forces (T,) of what is proposed, by their names.
    """
    unseen, found = r.validation, dict[float, str]()
    beyond = float(np.mean(left**2)) - unseen.noise_mse
    for name, kind in {**FORCES, **(own or {})}.items():
        whole = np.concatenate([p.seen(kind(p)) for p in unseen.pieces])
        steady = left - whole * float(whole @ left) / max(float(whole @ whole), MIN_DIVISOR)
        pairs = zip(unseen.pieces, unseen.split(steady), strict=True)
        after = np.concatenate([_changed(p, part, kind(p)) for p, part in pairs])
        gone = float(np.mean(steady**2) - np.mean(after**2))
        sure = mean_t_ratio(unseen.mse_by_block(steady), unseen.mse_by_block(after)) > r.criteria.min_flexible_t
        if gone > MIN_CHANGING_PART * beyond and sure:
            found[gone] = name
    return found[max(found)] if found else ""


def _changed(piece: ForceSegment, left: Array, force: Array) -> Array:
    """Return the residual (K,) after a force whose size is a spline of time, each block predicted from the others; all
    of it where the motion comes back too rarely: what changes with time is then not told from what goes with it.
    """
    reversals = int(np.count_nonzero(np.diff(np.sign(piece.sign[np.abs(piece.sign) > MIN_CHANGING_PART]))))
    number = min((int(piece.blocks.max()) + 1) // BLOCKS_PER_SPLINE, reversals // 2, CHANGES[1])
    if number < CHANGES[0]:
        return np.array(left)
    of_time = _splines(piece.t / max(float(piece.t[-1]), MIN_DIVISOR), np.linspace(0.0, 1.0, number - 2))
    A = piece.seen(of_time * force[:, None])
    A = A / (A.std() + MIN_DIVISOR)
    weight, fold, after = _chosen(A, left, piece.blocks)[1], piece.blocks % (CURVE_FOLDS - 1), left.copy()
    for out in (fold == k for k in range(CURVE_FOLDS - 1)):
        if out.any() and not out.all():
            after[out] = left[out] - A[out] @ _ridge(A[~out], left[~out], weight)
    return np.asarray(after)


__all__ = ["Curve", "changing", "structured"]
