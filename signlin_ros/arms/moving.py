"""Gravity whose direction changes along a record: a base that moves, or what acts like one.

The equations have one gravity. Of each record the tilt of the base is a sum of cosines of the time, beside which all
that is fitted stays free; a tilt that does not change is a law of its own.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from signlin_ros.arms.drift import times
from signlin_ros.arms.fit import CoefficientEstimate, fit
from signlin_ros.arms.laws import Loads, tilt
from signlin_ros.arms.piece import RegressionRows
from signlin_ros.arms.search import DOUBT, MIN_VALIDATION_SHARE, drop, needed_errors
from signlin_ros.arms.warmth import sources_of, within

Array = NDArray[np.float64]
PERIOD = 5.0
"""Seconds of the quickest cosine."""


@dataclass(frozen=True)
class MovingBase:
    """By how much gravity's direction leaves its mean along a record, in rad; its largest part in standard errors."""

    source: str
    size: float
    errors: float


def moving_bases(estimate: CoefficientEstimate, loads: Loads) -> Iterator[MovingBase]:
    """Yield the records of a fit's rows along which gravity's direction changes beyond doubt, and in two joints.

    That in which it is seen most comes first, and others are looked at beside it, as one record bends all bodies.
    """
    rows = estimate.rows
    columns, sources = tilt(rows, loads), list(sources_of(rows))
    while found := [one for source in sources if (one := _moving(estimate, columns, source)) is not None]:
        _, moving, estimate = max(found, key=lambda one: one[0])
        yield moving
        sources.remove(moving.source)


def _moving(
    estimate: CoefficientEstimate, columns: Array, source: str
) -> tuple[float, MovingBase, CoefficientEstimate] | None:
    """Return by how much the objective falls where a base moves in a record, how, and the fit; None if it does not."""
    rows = estimate.rows
    own = within(rows, source)
    waves = np.cos(np.pi * _clock(rows, own)[:, None] * np.arange(1, _orders(rows, source) + 1)) * own[:, None]
    parts = (columns[:, :, None] * waves[:, None, :]).reshape(len(rows), -1)
    names = tuple(f"{source}.tilt.{k}" for k in range(parts.shape[1]))
    trial = fit(estimate.design.plus(names, parts, parts), rows, rows, estimate.weights)
    fall = drop(estimate, trial)
    if fall <= float(chi2.isf(DOUBT, len(names))):
        return None
    values, errors = trial.theta[-len(names) :], trial.errors()[-len(names) :]
    with np.errstate(invalid="ignore", divide="ignore"):
        share = 1.0 - (_left(trial, own) / _left(estimate, own)) ** 2
    most = float(np.max(np.abs(values / np.maximum(errors, 1e-300))))
    seen = int(np.count_nonzero(share > MIN_VALIDATION_SHARE))
    if most < needed_errors(len(names)) or seen < min(2, rows.n):
        return None  # gravity is that of all joints: what one of them alone shows is a law of its own
    return fall, MovingBase(source, _size(values, errors, waves[own]), most), trial


def _clock(rows: RegressionRows, own: NDArray[np.bool_]) -> Array:
    """Return the times (N,) of rows as a part of their record, from 0 to 1."""
    t = times(rows)
    first, last = float(t[own].min()), float(t[own].max())
    return np.asarray((t - first) / max(last - first, 1e-300))


def _orders(rows: RegressionRows, source: str) -> int:
    lengths = [piece.run.t[-1] - piece.run.t[0] for piece in rows.pieces if piece.run.source == source]
    return max(2, int(2.0 * sum(lengths) / PERIOD))


def _left(estimate: CoefficientEstimate, own: NDArray[np.bool_]) -> Array:
    """Return the RMS of what is left of the efforts of some rows, joint by joint (n,)."""
    return estimate.rows.by_joint(np.where(own, estimate.residual, 0.0))


def _size(values: Array, errors: Array, waves: Array) -> float:
    """Return the largest angle between gravity and its mean, by the cosines (N, K) that are beyond two errors."""
    sure = np.where(np.abs(values) > 2.0 * errors, values, 0.0).reshape(2, -1)
    angles = waves @ sure.T
    return float(np.max(np.linalg.norm(angles - angles.mean(axis=0), axis=1)))


__all__ = ["MovingBase", "moving_bases"]
