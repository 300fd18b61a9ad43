"""Inertial parameters of bodies that exist: the best ones whose pseudo-inertias are positive definite.

Each pseudo-inertia is L L^T with L triangular, so that nothing has to be constrained.   [Rucker and Wensing, IEEE
Robotics and Automation Letters 7(2), 2022, doi:10.1109/LRA.2022.3144517]
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from signlin_ros.arms.fit import CoefficientEstimate
from signlin_ros.robots.inertia import TEN, from_pseudo_inertia, least_eigenvalue, pseudo_inertia

Array = NDArray[np.float64]
_LOWER = np.tril_indices(4)
MIN_EIGENVALUE = 1e-7
"""Part of the largest eigenvalue that the smallest one of a pseudo-inertia is given."""
MIN_BODY_MASS = 1e-6
"""kg by which a body without a mass is given one."""


def consistent(estimate: CoefficientEstimate, start: Array, carried: Array) -> Array:
    """Return all parameters (k,) of an estimate with bodies that exist, as near its optimum as they come.

    start : (10 n,) parameters near which the search begins, those of the URDF. carried : (10 n,) of the payload, beside
    which the bodies exist.
    """
    k = TEN * estimate.rows.n
    if min(least_eigenvalue(body) for body in (estimate.pi - carried).reshape(-1, TEN)) > 0.0:
        return estimate.theta
    G, theta = estimate.G, estimate.theta
    inner = np.linalg.solve(G[k:, k:], G[k:, :k]) if len(theta) > k else np.zeros((0, k))
    reduced = G[:k, :k] - G[:k, k:] @ inner
    root = np.linalg.cholesky(0.5 * (reduced + reduced.T) + 1e-12 * np.diag(np.diag(reduced))).T

    def residual(x: Array) -> Array:
        return np.asarray(root @ (_bodies(x) + carried - estimate.pi))

    def slopes(x: Array) -> Array:
        return np.asarray(root @ _slopes(x))

    x = np.concatenate([_triangle(body) for body in start.reshape(-1, TEN)])
    found = least_squares(residual, x, jac=slopes, x_scale="jac", method="trf", max_nfev=200)
    pi = _bodies(found.x) + carried
    return np.concatenate([pi, theta[k:] - inner @ (pi - estimate.pi)])


def _triangle(pi: Array) -> Array:
    """Return the lower triangle (10,) whose product is a body's pseudo-inertia, or one near it that exists."""
    J = pseudo_inertia(pi)
    values, vectors = np.linalg.eigh(J)
    floor = max(MIN_EIGENVALUE * float(values[-1]), MIN_EIGENVALUE * MIN_BODY_MASS)
    L = np.linalg.cholesky((vectors * np.maximum(values, floor)) @ vectors.T)
    return np.asarray(L[_LOWER])


def _bodies(x: Array) -> Array:
    found = []
    for part in x.reshape(-1, TEN):
        L = np.zeros((4, 4))
        L[_LOWER] = part
        found.append(from_pseudo_inertia(L @ L.T + MIN_EIGENVALUE * MIN_BODY_MASS * np.eye(4)))
    return np.concatenate(found)


def _slopes(x: Array) -> Array:
    """Return the derivatives (10 n, 10 n) of the bodies by their triangles."""
    count = x.size // TEN
    found = np.zeros((x.size, x.size))
    for b in range(count):
        L = np.zeros((4, 4))
        L[_LOWER] = x[TEN * b : TEN * (b + 1)]
        for k, (i, j) in enumerate(zip(*_LOWER, strict=True)):
            E = np.zeros((4, 4))
            E[i, j] = 1.0
            found[TEN * b : TEN * (b + 1), TEN * b + k] = from_pseudo_inertia(E @ L.T + L @ E.T)
    return found


__all__ = ["consistent"]
