"""Inertial parameters of bodies that exist: the best ones whose pseudo-inertias are positive definite.

The pseudo-inertia of a body is linear in its parameters, so the problem is convex: squares under linear matrix
inequalities, solved by Newton's method with a logarithmic barrier.   [Boyd and Vandenberghe, Convex Optimization,
Cambridge 2004, sec. 11.3; Wensing, Kim and Slotine, IEEE Robotics and Automation Letters 3(1), 2018]
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from signlin_ros.arms.fit import CoefficientEstimate
from signlin_ros.robots.inertia import TEN, UNIT_PSEUDO_INERTIAS, from_pseudo_inertia, least_eigenvalue, pseudo_inertia

Array = NDArray[np.float64]
MIN_EIGENVALUE = 1e-7
"""Part of the largest eigenvalue that the smallest one of a pseudo-inertia is given."""
MIN_BODY_MASS = 1e-6
"""kg by which a body without a mass is given one."""
LEAST_BARRIER, WEAKER = 1e-4, 0.2
"""The last weight of the barrier, nothing beside squares in units of their scatter; how much less each weight is."""
NEWTON_STEPS, STEP_HALVINGS, DESCENT, MIN_DESCENT = 60, 60, 1e-4, 1e-7
"""Steps for each weight; halvings of one; part of the foretold descent that it needs; descent that ends them."""
POSITIVE = (".motor_inertia", ".viscous_friction.b", ".coulomb_friction.mu", "payload.m")
"""Ends of the names of coefficients that a model file takes from zero on."""
NOTHING = 1e-3
"""Standard errors below which such a coefficient is none."""


def consistent(estimate: CoefficientEstimate, start: Array, carried: Array, exist: bool = True) -> Array:
    """Return all parameters (k,) of an estimate with bodies that exist, as near its optimum as they come.

    Motors' inertias, friction and payloads are not below nothing either; without ``exist`` that is all that is asked.
    start : (10 n,) parameters near which the search begins, those of the URDF. carried : (10 n,) of the payload, beside
    which the bodies exist.
    """
    k, theta = TEN * estimate.rows.n, estimate.theta
    signed = np.array([i for i, name in enumerate(estimate.design.names) if name.endswith(POSITIVE)], dtype=int)
    target = estimate.pi - carried
    sound = not exist or min(least_eigenvalue(body) for body in target.reshape(-1, TEN)) > 0.0
    if sound and (theta[signed] >= 0.0).all():
        return theta
    G = estimate.G
    kept = np.concatenate([np.arange(k), signed])
    rest = np.setdiff1d(np.arange(len(theta)), kept)
    inner = np.linalg.solve(G[np.ix_(rest, rest)], G[np.ix_(rest, kept)])
    H = G[np.ix_(kept, kept)] - G[np.ix_(kept, rest)] @ inner
    size = 1.0 / np.sqrt(np.diag(H)[k:])
    first = np.concatenate([*(_near(body) for body in start.reshape(-1, TEN)), np.maximum(theta[signed], size)])
    offset = np.concatenate([carried, np.zeros(len(signed))])
    bodies = estimate.rows.n if exist else 0
    x = _nearest(0.5 * (H + H.T), theta[kept] - offset, first, Barrier(bodies, k))
    x[k:] = np.where(x[k:] < NOTHING * size, 0.0, x[k:])
    found: Array = theta.copy()
    found[kept] = x + offset
    found[rest] -= inner @ (found - theta)[kept]
    return found


@dataclass(frozen=True)
class Barrier:
    """What keeps the first bodies (10 each) existing, and what stands from a place on above nothing."""

    bodies: int
    signed: int

    def height(self, x: Array) -> float:
        """Return minus the logarithms; infinite where a body does not exist or a sign is wrong."""
        stack = [pseudo_inertia(x[at]) for at in self.parts]
        values = np.concatenate([np.linalg.eigvalsh(np.stack(stack)).ravel() if stack else [], x[self.signed :]])
        return -float(np.sum(np.log(values))) if values.min() > 0.0 else np.inf

    def bend(self, x: Array, weight: float, slope: Array, curvature: Array) -> None:
        """Add the barrier's slope (k,) and curvature (k, k) to those of the squares."""
        for at in self.parts:
            own = np.linalg.solve(pseudo_inertia(x[at]), UNIT_PSEUDO_INERTIAS)
            slope[at] -= weight * np.trace(own, axis1=1, axis2=2)
            curvature[at, at] += weight * np.einsum("aij,bji->ab", own, own)
        alone = np.arange(self.signed, x.size)
        slope[alone] -= weight / x[alone]
        curvature[alone, alone] += weight / x[alone] ** 2

    @property
    def parts(self) -> list[slice]:
        """Where each body's parameters are."""
        return [slice(i, i + TEN) for i in range(0, TEN * self.bodies, TEN)]


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


def _nearest(H: Array, target: Array, x: Array, barrier: Barrier) -> Array:
    """Return the parameters (k,) within a barrier that are nearest a target in the metric H, from some within it."""
    away = x - target
    first = max(1.0, float(away @ H @ away) / x.size)

    def height(x: Array, weight: float) -> float:
        return float(0.5 * (x - target) @ H @ (x - target) + weight * barrier.height(x))

    for weight in np.geomspace(first, LEAST_BARRIER, 1 + int(np.log(LEAST_BARRIER / first) / np.log(WEAKER))):
        for _ in range(NEWTON_STEPS):
            slope, curvature = H @ (x - target), H.copy()
            barrier.bend(x, weight, slope, curvature)
            step = -np.linalg.solve(curvature, slope)
            descent = -float(slope @ step)
            if descent < MIN_DESCENT * max(1.0, weight):
                break
            before, length = height(x, weight), 1.0
            for _ in range(STEP_HALVINGS):
                if height(x + length * step, weight) <= before - DESCENT * length * descent:
                    x = x + length * step
                    break
                length *= 0.5
            else:
                break
    return x


__all__ = ["POSITIVE", "consistent", "existing"]
