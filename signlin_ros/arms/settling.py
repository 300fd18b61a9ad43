"""Dry friction that sets in over a distance after a reversal: told, and rows before it has are left out.

A gear winds up, and contacts bend, before they slide. Until a motor has gone far enough its friction is neither the
old one nor the new one, as that of a joint which stands still; a few slow reversals are most of what is left then, and
laws that are none explain them. Friction that sets in exponentially with distance [Dahl, Aerospace Corp. TOR-158, 1968]
lacks twice its size times exp(-distance / length) after a reversal, which is one column more for each length.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from signlin_ros.arms.fit import CoefficientEstimate, fit
from signlin_ros.arms.keys import Key
from signlin_ros.arms.laws import JointLaw
from signlin_ros.arms.piece import ArmSegment, RegressionRows
from signlin_ros.arms.search import Promise, State, stands

Array = NDArray[np.float64]
LAW = JointLaw("dahl_presliding", "sigma", "length")
"""What friction lacks until it has set in."""
SHORTEST_LENGTH, LONGEST_LENGTH, LENGTHS_TRIED = 1e-4, 1e-2, 7
"""Lengths that are tried, as parts of a motor's range: the shortest, the longest, and how many."""


def settling(state: State, estimate: CoefficientEstimate) -> Array:
    """Return the lengths (n,) in rad (m) over which the friction of joints sets in after a reversal, beside those that
    the rows leave out already; 0 where they are not beyond doubt.
    """
    fixed = fit(estimate.design, state.rows, state.new, estimate.weights)
    told, found = [i for i in range(state.robot.n) if i not in state.barred], np.zeros(state.robot.n)
    for i in told:
        best = max((_promise(state, fixed, i, length) for length in _lengths(state.rows, i)), key=lambda p: p.fall)
        law = stands(state, fixed, best, LENGTHS_TRIED * len(told))
        if law is not None:
            found[i] = best.key.shape
    return found


def _lengths(rows: RegressionRows, i: int) -> list[float]:
    """Return the lengths that are tried for the motor i."""
    most = max(float(np.ptp(piece.angle[:, i])) for piece in rows.pieces)
    lengths: list[float] = (most * np.geomspace(SHORTEST_LENGTH, LONGEST_LENGTH, LENGTHS_TRIED)).tolist()
    return lengths


def _promise(state: State, estimate: CoefficientEstimate, i: int, length: float) -> Promise:
    """Return what one length promises: the fall of the weighted squares beside all that is fitted."""

    def of(piece: ArmSegment) -> Array:
        signs = piece.signs[i]
        return np.asarray(-signs.sign(signs.velocity) * np.exp(-piece.travelled(i) / length))

    known, unseen = (rows.motor(i, of)[:, None] for rows in state.both)
    w = estimate.weights[state.rows.joint]
    C, X = known[:, 0] * w, estimate.design.known * w[:, None]
    P = X.T @ C
    new, slope = float(C @ C - P @ estimate.inverse() @ P), float(C @ (estimate.residual * w))
    fall = slope**2 / new if slope > 0.0 < new else 0.0
    return Promise(fall, Key(LAW.effect, i, length), LAW, known, unseen)


__all__ = ["settling"]
