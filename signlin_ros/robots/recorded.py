"""The same equations written once as CasADi expressions: mass matrix, bias, inverse dynamics, and M^-1 unrolled.

Composite bodies for the mass matrix, Newton-Euler for the bias.   [Walker and Orin, ASME J. Dynamic Systems 104, 1982]
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from signlin_ros.robots.inertia import inertia_matrix, skew
from signlin_ros.robots.urdf import Joint, Robot

Array = NDArray[np.float64]


def _sparse(a: Array) -> ca.SX:
    """Return numbers as an expression without entries for zeros."""
    return ca.sparsify(ca.SX(np.asarray(a, dtype=float)))


def _transform(joint: Joint, q: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Return rotation and translation of a joint's frame in its parent's."""
    if joint.prismatic:
        return _sparse(joint.R), _sparse(joint.p) + q * _sparse(joint.R @ joint.axis)
    K = skew(joint.axis)
    turned = _sparse(np.eye(3) + K @ K) + ca.sin(q) * _sparse(K) - ca.cos(q) * _sparse(K @ K)
    return ca.sparsify(ca.simplify(_sparse(joint.R) @ turned)), _sparse(joint.p)


class Recorded:
    """The equations of a robot at symbols q, v (n each).

    ``M`` (n, n) is the mass matrix, ``bias`` (n) what gravity, centrifugal and Coriolis forces need.
    """

    def __init__(self, robot: Robot, q: Sequence[ca.SX], v: Sequence[ca.SX]) -> None:
        self.robot, self._v = robot, v
        self._placed = [_transform(joint, q[i]) for i, joint in enumerate(robot.joints)]
        self._bodies = [
            (ca.SX(float(j.pi[0])), _sparse(j.pi[1:4]), _sparse(inertia_matrix(j.pi))) for j in robot.joints
        ]
        self.bias = self.inverse(None)
        self.M = self._mass_matrix()

    def inverse(self, a: Sequence[ca.SX] | None) -> ca.SX:
        """Return M a + bias (n) by the recursion, which is a fraction of the product; None: all accelerations 0."""
        joints, n = self.robot.joints, self.robot.n
        motions = self._motions(a)
        wrenches = [self._wrench(i, motions[i]) for i in range(n)]
        found: list[ca.SX] = [ca.SX(0)] * n
        for i in reversed(self.robot.sequence):
            joint, (R, p) = joints[i], self._placed[i]
            force, moment = wrenches[i]
            found[i] = ca.dot(_sparse(joint.axis), force if joint.prismatic else moment)
            if joint.parent >= 0:
                at_parent = R @ force
                before = wrenches[joint.parent]
                wrenches[joint.parent] = (before[0] + at_parent, before[1] + R @ moment + ca.cross(p, at_parent))
        return ca.vertcat(*found)

    def _motions(self, a: Sequence[ca.SX] | None) -> dict[int, tuple[ca.SX, ca.SX, ca.SX]]:
        found: dict[int, tuple[ca.SX, ca.SX, ca.SX]] = {}
        base = (ca.SX(3, 1), ca.SX(3, 1), _sparse(-self.robot.gravity))
        for i in self.robot.sequence:
            joint, (R, p) = self.robot.joints[i], self._placed[i]
            axis = _sparse(joint.axis)
            w0, al0, a0 = found.get(joint.parent, base)
            w, al = R.T @ w0, R.T @ al0
            acceleration = R.T @ (a0 + ca.cross(al0, p) + ca.cross(w0, ca.cross(w0, p)))
            own, faster = axis * self._v[i], ca.SX(3, 1) if a is None else axis * a[i]
            if joint.prismatic:
                acceleration = acceleration + faster + 2 * ca.cross(w, own)
            else:
                w, al = w + own, al + faster + ca.cross(w, own)
            found[i] = (w, al, acceleration)
        return found

    def _wrench(self, i: int, motion: tuple[ca.SX, ca.SX, ca.SX]) -> tuple[ca.SX, ca.SX]:
        m, h, inertia = self._bodies[i]
        w, al, acceleration = motion
        force = m * acceleration + ca.cross(al, h) + ca.cross(w, ca.cross(w, h))
        return force, inertia @ al + ca.cross(w, inertia @ w) + ca.cross(h, acceleration)

    def _mass_matrix(self) -> ca.SX:
        joints, n = self.robot.joints, self.robot.n
        M, bodies = ca.SX(n, n), list(self._bodies)
        for i in reversed(self.robot.sequence):
            joint, axis = joints[i], _sparse(joints[i].axis)
            m, h, inertia = bodies[i]
            force, moment = (m * axis, ca.cross(h, axis)) if joint.prismatic else (ca.cross(axis, h), inertia @ axis)
            M[i, i] = ca.dot(axis, force if joint.prismatic else moment)
            k = i
            while joints[k].parent >= 0:
                R, p = self._placed[k]
                force, moment = R @ force, R @ moment
                moment = moment + ca.cross(p, force)
                k = joints[k].parent
                M[i, k] = M[k, i] = ca.dot(_sparse(joints[k].axis), force if joints[k].prismatic else moment)
            if joint.parent >= 0:
                bodies[joint.parent] = _composite(bodies[joint.parent], bodies[i], *self._placed[i])
        return M


def _composite(
    body: tuple[ca.SX, ca.SX, ca.SX], other: tuple[ca.SX, ca.SX, ca.SX], R: ca.SX, p: ca.SX
) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Return a body with another one on it, whose frame stands at R, p."""
    m, h, inertia = other
    turned = R @ h
    a, b = ca.skew(turned), ca.skew(p)
    moved = R @ inertia @ R.T - a @ b - b @ a - m * (b @ b)
    return body[0] + m, body[1] + turned + m * p, body[2] + moved


class Factors:
    """The unrolled factors L D L^T of a positive definite matrix (n, n) of expressions."""

    def __init__(self, M: ca.SX) -> None:
        self.n = n = M.shape[0]
        L, D = [[ca.SX(0)] * n for _ in range(n)], [ca.SX(0)] * n
        for j in range(n):
            d = M[j, j]
            for k in range(j):
                d = d - L[j][k] * L[j][k] * D[k]
            D[j] = d
            for i in range(j + 1, n):
                s = M[i, j]
                for k in range(j):
                    s = s - L[i][k] * L[j][k] * D[k]
                L[i][j] = s / d
        self._L, self._D = L, D

    def solve(self, right: ca.SX) -> ca.SX:
        """Return M^-1 times a vector (n)."""
        n, L = self.n, self._L
        y: list[ca.SX] = []
        for i in range(n):
            y.append(right[i] - sum((L[i][k] * y[k] for k in range(i)), ca.SX(0)))
        x: list[ca.SX] = [ca.SX(0)] * n
        for i in reversed(range(n)):
            x[i] = y[i] / self._D[i] - sum((L[k][i] * x[k] for k in range(i + 1, n)), ca.SX(0))
        return ca.vertcat(*x)


__all__ = ["Factors", "Recorded"]
