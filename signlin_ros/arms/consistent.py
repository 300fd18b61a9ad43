"""Inertial parameters of bodies that exist: the best ones whose pseudo-inertias are positive definite.

The pseudo-inertia of a body is linear in its parameters, so the problem is convex: squares under linear matrix
inequalities, solved by Newton's method with a logarithmic barrier.   [Boyd and Vandenberghe, Convex Optimization,
Cambridge 2004, sec. 11.3; Wensing, Kim and Slotine, IEEE Robotics and Automation Letters 3(1), 2018]
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from signlin_ros.arms.fit import CoefficientEstimate
from signlin_ros.robots.inertia import TEN, from_pseudo_inertia, least_eigenvalue, pseudo_inertia

Array = NDArray[np.float64]
MIN_EIGENVALUE = 1e-7
"""Part of the largest eigenvalue that the smallest one of a pseudo-inertia is given."""
MIN_BODY_MASS = 1e-6
"""kg by which a body without a mass is given one."""
LEAST_BARRIER, WEAKER = 1e-4, 0.2
"""The last weight of the barrier, nothing beside squares in units of their scatter; how much less each weight is."""
NEWTON_STEPS, HALVINGS, DESCENT, SETTLED = 60, 60, 1e-4, 1e-7
"""Steps for each weight; halvings of one; part of the foretold descent that it needs; descent that ends them."""


def consistent(estimate: CoefficientEstimate, start: Array, carried: Array) -> Array:
    """Return all parameters (k,) of an estimate with bodies that exist, as near its optimum as they come.

    start : (10 n,) parameters near which the search begins, those of the URDF. carried : (10 n,) of the payload, beside
    which the bodies exist.
    """
    k = TEN * estimate.rows.n
    target = estimate.pi - carried
    if min(least_eigenvalue(body) for body in target.reshape(-1, TEN)) > 0.0:
        return estimate.theta
    G, theta = estimate.G, estimate.theta
    inner = np.linalg.solve(G[k:, k:], G[k:, :k]) if len(theta) > k else np.zeros((0, k))
    reduced = G[:k, :k] - G[:k, k:] @ inner
    x = np.concatenate([_near(body) for body in start.reshape(-1, TEN)])
    pi = _nearest(0.5 * (reduced + reduced.T), target, x) + carried
    return np.concatenate([pi, theta[k:] - inner @ (pi - estimate.pi)])


def existing(pi: Array) -> Array:
    """Return bodies (10 n,) that exist, near some of which a rounding may have taken that."""
    bodies = pi.reshape(-1, TEN)
    return np.concatenate([body if least_eigenvalue(body) > 0.0 else _near(body) for body in bodies])


def _near(pi: Array) -> Array:
    """Return a body (10,) that exists, near one that may not."""
    values, vectors = np.linalg.eigh(pseudo_inertia(pi))
    floor = max(MIN_EIGENVALUE * float(values[-1]), MIN_EIGENVALUE * MIN_BODY_MASS)
    found: Array = from_pseudo_inertia((vectors * np.maximum(values, floor)) @ vectors.T)
    return found


def _nearest(H: Array, target: Array, x: Array) -> Array:
    """Return the bodies (10 n,) that exist and are nearest a target in the metric H, from bodies x that exist."""
    away = x - target
    first = max(1.0, float(away @ H @ away) / x.size)
    for weight in np.geomspace(first, LEAST_BARRIER, 1 + int(np.log(LEAST_BARRIER / first) / np.log(WEAKER))):
        for _ in range(NEWTON_STEPS):
            slope, curvature = H @ (x - target), H.copy()
            for at in (slice(i, i + TEN) for i in range(0, x.size, TEN)):
                own = np.linalg.solve(pseudo_inertia(x[at]), _UNITS)
                slope[at] -= weight * np.trace(own, axis1=1, axis2=2)
                curvature[at, at] += weight * np.einsum("aij,bji->ab", own, own)
            step = -np.linalg.solve(curvature, slope)
            descent = -float(slope @ step)
            if descent < SETTLED * max(1.0, weight):
                break
            before, length = _height(H, target, x, weight), 1.0
            for _ in range(HALVINGS):
                if _height(H, target, x + length * step, weight) <= before - DESCENT * length * descent:
                    x = x + length * step
                    break
                length *= 0.5
            else:
                break
    return x


def _height(H: Array, target: Array, x: Array, weight: float) -> float:
    """Return the squares with the barrier on them; infinite where a body does not exist."""
    values = np.linalg.eigvalsh(np.stack([pseudo_inertia(body) for body in x.reshape(-1, TEN)]))
    if values.min() <= 0.0:
        return np.inf
    away = x - target
    return float(0.5 * away @ H @ away - weight * np.sum(np.log(values)))


_UNITS = np.stack([pseudo_inertia(unit) for unit in np.eye(TEN)])
"""Pseudo-inertias (10, 4, 4) of a unit of each parameter."""


__all__ = ["consistent", "existing"]
