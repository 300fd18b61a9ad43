"""Inverse dynamics of a robot at many samples, and its regressor: torques are linear in the inertial parameters.

Recursive Newton-Euler with the accelerations of the frames' origins.   [Luh, Walker and Paul, ASME J. Dynamic Systems
102(2), 1980; Atkeson, An and Hollerbach, Int. J. Robotics Research 5(3), 1986]
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from signlin_ros.robots.inertia import TEN, inertia_matrix, skew
from signlin_ros.robots.urdf import Joint, Robot

Array = NDArray[np.float64]


def transforms(joint: Joint, q: Array) -> tuple[Array, Array]:
    """Return rotations (T, 3, 3) and translations (T, 3) of a joint's frame in its parent's at positions q (T,)."""
    if joint.prismatic:
        along = joint.R @ joint.axis
        return np.broadcast_to(joint.R, (q.size, 3, 3)), joint.p + q[:, None] * along
    K = skew(joint.axis)
    sin, one_minus_cos = np.sin(q)[:, None, None], 2.0 * np.sin(q / 2.0)[:, None, None] ** 2
    return joint.R @ (np.eye(3) + sin * K + one_minus_cos * (K @ K)), np.broadcast_to(joint.p, (q.size, 3))


class JointMotion:
    """How bodies move at T samples: angular velocity and acceleration, acceleration of the origin, (T, 3) each."""

    def __init__(self, robot: Robot, q: Array, v: Array, a: Array) -> None:
        self.robot = robot
        self.placed = [transforms(joint, q[:, i]) for i, joint in enumerate(robot.joints)]
        self.bodies: dict[int, tuple[Array, Array, Array]] = {}
        rest = np.zeros((len(q), 3))
        base = (rest, rest, np.broadcast_to(-robot.gravity, rest.shape))
        for i in robot.sequence:
            joint = robot.joints[i]
            before = self.bodies.get(joint.parent, base)
            self.bodies[i] = self._body(joint, before, *self.placed[i], v[:, i, None], a[:, i, None])

    @staticmethod
    def _body(
        joint: Joint, before: tuple[Array, Array, Array], R: Array, p: Array, v: Array, a: Array
    ) -> tuple[Array, Array, Array]:
        w0, al0, a0 = before
        turned = [np.einsum("tji,tj->ti", R, x) for x in (w0, al0, a0 + cross(al0, p) + cross(w0, cross(w0, p)))]
        w, al, acceleration = turned
        if joint.prismatic:
            return w, al, acceleration + a * joint.axis + 2.0 * cross(w, v * joint.axis)
        return w + v * joint.axis, al + a * joint.axis + cross(w, v * joint.axis), acceleration


def cross(a: Array, b: Array) -> Array:
    """Return the cross products of rows (T, 3)."""
    x = a[..., 1] * b[..., 2] - a[..., 2] * b[..., 1]
    y = a[..., 2] * b[..., 0] - a[..., 0] * b[..., 2]
    return np.stack([x, y, a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]], axis=-1)


def inverse_dynamics(robot: Robot, q: Array, v: Array, a: Array, pi: Array | None = None) -> Array:
    """Return the forces and torques (T, n) that a motion needs: M(q) a + bias(q, v).

    q, v, a : (T, n) in rad, rad/s, rad/s² (m for prismatic joints). pi : (10 n,), the robot's own by default.
    """
    motion = JointMotion(robot, q, v, a)
    bodies = (robot.pi if pi is None else np.asarray(pi, dtype=float)).reshape(-1, TEN)
    forces, moments = [], []
    for i, body in enumerate(bodies):
        w, al, acc = motion.bodies[i]
        m, h, inertia = body[0], body[1:4], inertia_matrix(body)
        forces.append(m * acc + cross(al, h[None]) + cross(w, cross(w, h[None])))
        moments.append(al @ inertia + cross(w, w @ inertia) + cross(np.broadcast_to(h, acc.shape), acc))
    found = np.zeros(q.shape)
    for i in reversed(robot.sequence):
        joint, (R, p) = robot.joints[i], motion.placed[i]
        found[:, i] = (forces[i] if joint.prismatic else moments[i]) @ joint.axis
        if joint.parent >= 0:
            force = np.einsum("tij,tj->ti", R, forces[i])
            forces[joint.parent] = forces[joint.parent] + force
            moments[joint.parent] = moments[joint.parent] + np.einsum("tij,tj->ti", R, moments[i]) + cross(p, force)
    return found


def mass_matrix(robot: Robot, q: Array, pi: Array | None = None) -> Array:
    """Return the mass matrices (T, n, n) at positions q (T, n)."""
    n = robot.n
    rest = np.zeros(q.shape)
    still = inverse_dynamics(robot, q, rest, rest, pi)
    columns = [inverse_dynamics(robot, q, rest, np.broadcast_to(np.eye(n)[i], q.shape), pi) - still for i in range(n)]
    return np.stack(columns, axis=-1)


def regressor(robot: Robot, q: Array, v: Array, a: Array) -> Array:
    """Return Y (T, n, 10 n) with M(q) a + bias(q, v) = Y pi."""
    motion, n = JointMotion(robot, q, v, a), robot.n
    Y = np.zeros((len(q), n, TEN * n))
    for k in range(n):
        W = _wrench(*motion.bodies[k])
        i = k
        while i >= 0:
            joint, (R, p) = robot.joints[i], motion.placed[i]
            part = W[:, :3] if joint.prismatic else W[:, 3:]
            Y[:, i, TEN * k : TEN * (k + 1)] = np.einsum("j,tjk->tk", joint.axis, part)
            force = R @ W[:, :3]
            W = np.concatenate([force, R @ W[:, 3:] + _skews(p) @ force], axis=1)
            i = joint.parent
    return Y


def _wrench(w: Array, al: Array, acc: Array) -> Array:
    """Return force and moment (T, 6, 10) of a body per parameter."""
    W = np.zeros((len(w), 6, TEN))
    W[:, :3, 0] = acc
    S = _skews(w)
    W[:, :3, 1:4] = _skews(al) + S @ S
    W[:, 3:, 1:4] = -_skews(acc)
    W[:, 3:, 4:] = _dots(al) + S @ _dots(w)
    return W


def _skews(v: Array) -> Array:
    """Return the cross product matrices (T, 3, 3) of vectors (T, 3)."""
    found = np.zeros((len(v), 3, 3))
    found[:, 0, 1], found[:, 0, 2], found[:, 1, 2] = -v[:, 2], v[:, 1], -v[:, 0]
    return found - np.swapaxes(found, 1, 2)


def _dots(v: Array) -> Array:
    """Return the matrices (T, 3, 6) that times (Ixx, Ixy, Ixz, Iyy, Iyz, Izz) are the inertia times v (T, 3)."""
    found = np.zeros((len(v), 3, 6))
    for row, column, axis in (
        (0, 0, 0),
        (0, 1, 1),
        (0, 2, 2),
        (1, 1, 0),
        (1, 3, 1),
        (1, 4, 2),
        (2, 2, 0),
        (2, 4, 1),
        (2, 5, 2),
    ):
        found[:, row, column] = v[:, axis]
    return found


__all__ = ["JointMotion", "inverse_dynamics", "mass_matrix", "regressor", "transforms"]
