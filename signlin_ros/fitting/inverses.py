"""Inverses of information and covariance matrices, in whatever units their coordinates are."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
MIN_LM_DAMPING = 1e-12
"""Damping, relative to the diagonal, of an undamped step: about where rounding swallows what is known of a
direction."""
MIN_INFORMATION = 1e-150
"""Information below which nothing is known of a coordinate: the product of two such units is beyond all numbers."""


def units_of(information: Array) -> Array:
    """Return the coordinates' units (n,) in which a symmetric, non-negative matrix (n, n) has ones on its diagonal, one
    where nothing is known: what rounding swallows then depends on no unit [Marquardt, SIAM J. 11 (1963) 431;
    van der Sluis, Numer. Math. 14 (1969) 14].
    """
    diagonal = np.diag(information)
    return np.asarray(1.0 / np.sqrt(np.where(diagonal > MIN_INFORMATION, diagonal, 1.0)))


def covariance_of(information: Array) -> Array:
    """Return the covariance (n, n) of an information (n, n): huge, not zero, in a direction of which nothing is
    known.
    """
    unit = units_of(information)
    values, axes = np.linalg.eigh(information * np.outer(unit, unit))
    least = max(float(values[-1:].sum()) * values.size * np.finfo(float).eps, 1e-300)
    return np.asarray((axes / np.maximum(values, least)) @ axes.T * np.outer(unit, unit), dtype=np.float64)


def squared_distance(apart: Array, covariance: Array) -> float:
    """Return the squared distance from nothing of coordinates (n,) in standard errors [Wald 1943,
    doi:10.1090/S0002-9947-1943-0012401-3]; a direction of no variance counts as unknown.
    """
    unit = units_of(covariance)
    z = apart * unit
    inverse = np.linalg.pinv(covariance * np.outer(unit, unit), hermitian=True)
    return max(float(z @ inverse @ z), 0.0)


def bounded_step(x: Array, gradient: Array, hessian: Array, damping: float, low: Array, high: Array) -> Array:
    """Return where a Gauss-Newton step leads from x (n,), damped relative to the diagonal and projected on the bounds:
    what leaves them is held there, and the rest solved anew.
    """
    active, new = np.zeros(x.size, dtype=bool), x.copy()
    while not active.all():
        free = np.flatnonzero(~active)
        matrix = hessian[np.ix_(free, free)]
        unit = units_of(matrix)
        matrix = matrix * np.outer(unit, unit) + (damping + MIN_LM_DAMPING) * np.eye(free.size)
        right = gradient[free] + hessian[np.ix_(free, active)] @ (new - x)[active]
        new[free] = x[free] - unit * np.linalg.lstsq(matrix, unit * right, rcond=MIN_LM_DAMPING / 10.0)[0]
        outside = (new < low) | (new > high)
        new = np.clip(new, low, high)
        if not outside.any():
            break
        active |= outside
    return np.asarray(new)


__all__ = ["bounded_step", "covariance_of", "squared_distance", "units_of"]
