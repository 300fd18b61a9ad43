"""Whether anything is left that goes with the motion, whatever its law, or that changes along the record.

A flexible regression, judged on unseen data; and forces whose size changes slowly, judged on blocks left out.

Position, velocity, their past and what bristles of several lengths would do, through random cosine features [Rahimi and
Recht, Advances in Neural Information Processing Systems 20, 2007]; ridge regression, its weight chosen by blocks.
"""

from __future__ import annotations

from collections.abc import Callable

import numba
import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline
from scipy.signal import lfilter

from signlin_ros.diagnosis.force.record import Piece
from signlin_ros.diagnosis.force.regression import TINY, Fit, Regression, mean_certainty

Array = NDArray[np.float64]

FEATURES, WIDTHS = 160, (0.35, 0.8)
"""Random cosines, and how fine they are: inverse widths in standard deviations of a coordinate."""
LAGS = (0.15, 1.0)
"""Time constants in s of the past that counts."""
BRISTLES = (0.002, 0.005, 0.01, 0.02, 0.04, 0.08, 0.15, 0.3)
"""Half widths of elements that slip, as parts of the travel."""
WEIGHTS = (1e-3, 1e-2, 1e-1, 1.0, 10.0)
"""Weights of the ridge that are tried,"""
FOLDS = 5
"""each on so many parts of the record, left out in turn."""
CHANGES = (6, 24)
"""Fewest and most spline functions of time that a size follows along a record, one for each `APART` blocks and two
reversals at most."""
APART, HALF = 3, 0.5
"""Blocks that a spline function spans; part of what is left beyond the noise that such a change takes away."""


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


def _coordinates(piece: Piece) -> Array:
    """Return what a force may go with (T, d); not the effort and acceleration of now: what is left has their noise."""
    v, step = piece.v, piece.step
    past = [_lagged(v, step, LAGS[0]), _lagged(np.abs(v), step, LAGS[1]), _lagged(piece.effort_nearby, step, LAGS[0])]
    return np.column_stack([v, *([piece.q] if piece.position_measured else []), *past])


def unseen_after(r: Regression, fit: Fit) -> Array:
    """Return what is left (K,) of unseen data after a flexible regression on what a fit leaves."""
    everything = np.concatenate([_coordinates(p) for p in r.known.pieces])
    mean, spread = everything.mean(axis=0), everything.std(axis=0) + 1e-12
    rng = np.random.default_rng(0)
    W = rng.standard_normal((everything.shape[1], FEATURES)) * np.repeat(WIDTHS, FEATURES // len(WIDTHS))
    phase = rng.uniform(0.0, 2 * np.pi, FEATURES)
    widths = np.array(BRISTLES) * (r.known.travel + TINY)

    def features(piece: Piece) -> Array:
        Z = np.clip((_coordinates(piece) - mean) / spread, -3.0, 3.0)
        direction = np.sign(piece.v)[:, None]
        seen = [piece.seen(slipping(piece.q, widths) / widths)]
        seen += [piece.seen(np.cos(Z @ W[:, part] + phase[part])) for part in piece.at_once(FEATURES)]
        return np.hstack([*seen, *(piece.seen(one) for one in (Z, Z[:, :1] * Z[:, 1:], direction, direction * Z))])

    A, V = (np.vstack([features(p) for p in side.pieces]) for side in (r.known, r.unseen))
    centre, scale = A.mean(axis=0), A.std(axis=0) + 1e-12
    A, V = (A - centre) / scale, (V - centre) / scale
    coefficients = _ridge(A, fit.left, _chosen(A, fit.left, r.known.blocks))
    return np.asarray(fit.unseen - V @ coefficients)


def _ridge(A: Array, y: Array, weight: float) -> Array:
    return np.asarray(np.linalg.solve(A.T @ A + weight * len(y) * np.eye(A.shape[1]), A.T @ y))


def _chosen(A: Array, y: Array, blocks: NDArray[np.intp]) -> float:
    """Return the weight of the ridge that predicts blocks of time best that it was not fitted to."""
    fold = blocks * FOLDS // (int(blocks.max()) + 1)
    errors = np.zeros(len(WEIGHTS))
    for out in (fold == k for k in range(FOLDS)):
        if not out.any() or out.all():
            continue
        values, vectors = np.linalg.eigh(A[~out].T @ A[~out])
        projected, seen = vectors.T @ (A[~out].T @ y[~out]), A[out] @ vectors
        left = [y[out] - seen @ (projected / (values + w * np.count_nonzero(~out))) for w in WEIGHTS]
        errors += [float(e @ e) for e in left]
    return WEIGHTS[int(np.argmin(errors))]


def structured(r: Regression, fit: Fit, base: Fit) -> tuple[bool, float]:
    """Tell whether a flexible regression takes a visible part away from what a fit leaves of unseen data, and return
    the force in per cent of the effort (RMS) that would be left then; inf where less than such a part is left.
    """
    c = r.criteria
    visible = max(c.flexible_share * base.error, (c.flexible_visible * r.unseen.effort) ** 2)
    if fit.error <= visible:
        return False, np.inf
    flexible = Fit((("flexible", ()),), fit.theta, fit.left, lambda: unseen_after(r, fit))
    large = fit.error - flexible.error > visible
    return large and r.surely(flexible, fit) > c.flexible, r.percent(flexible)


def changing(r: Regression, left: Array) -> str:
    """Return which force changes slowly along the unseen records, and by its change is most of what is left (K,) beyond
    the sensors' noise; empty if none does. Each block of time is predicted from those around it.
    """
    unseen, found = r.unseen, dict[float, str]()
    kinds: dict[str, Callable[[Piece], Array]] = {
        "load": lambda p: np.ones_like(p.t),
        "dry friction": lambda p: p.sign,
        "viscous friction": lambda p: p.v,
    }
    beyond = float(np.mean(left**2)) - unseen.noise
    for name, kind in kinds.items():
        whole = np.concatenate([p.seen(kind(p)) for p in unseen.pieces])
        steady = left - whole * float(whole @ left) / max(float(whole @ whole), TINY)
        pairs = zip(unseen.pieces, unseen.split(steady), strict=True)
        after = np.concatenate([_along(p, part, kind(p)) for p, part in pairs])
        gone = float(np.mean(steady**2) - np.mean(after**2))
        sure = mean_certainty(unseen.by_block(steady), unseen.by_block(after)) > r.criteria.flexible
        if gone > HALF * beyond and sure:
            found[gone] = name
    return found[max(found)] if found else ""


def _along(piece: Piece, left: Array, force: Array) -> Array:
    """Return what is left (K,) after a force whose size is a spline of time, each block predicted from the others; all
    of it where the motion comes back too rarely: what changes with time is then not told from what goes with it.
    """
    number = min((int(piece.blocks.max()) + 1) // APART, _reversals(piece) // 2, CHANGES[1])
    if number < CHANGES[0]:
        return np.array(left)
    knots = np.concatenate([np.zeros(3), np.linspace(0.0, 1.0, number - 2), np.ones(3)])
    of_time = BSpline.design_matrix(piece.t / max(float(piece.t[-1]), TINY), knots, 3).toarray()
    A = piece.seen(of_time * force[:, None])
    A = A / (A.std() + TINY)
    weight, fold, after = _chosen(A, left, piece.blocks), piece.blocks % (FOLDS - 1), left.copy()
    for out in (fold == k for k in range(FOLDS - 1)):
        if out.any() and not out.all():
            after[out] = left[out] - A[out] @ _ridge(A[~out], left[~out], weight)
    return np.asarray(after)


def _reversals(piece: Piece) -> int:
    """Return how often a motion turns back."""
    side = np.sign(piece.sign[np.abs(piece.sign) > HALF])
    return int(np.count_nonzero(np.diff(side)))


__all__ = ["changing", "structured", "unseen_after"]
