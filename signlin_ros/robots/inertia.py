"""Inertial parameters of a rigid body: the ten numbers in which torques are linear, and their consistency.

The ten are m, m cx, m cy, m cz, Ixx, Ixy, Ixz, Iyy, Iyz, Izz, the inertia about the frame's origin. A body with these
numbers exists if its pseudo-inertia matrix is positive semidefinite.   [Wensing, Kim and Slotine, IEEE Robotics and
Automation Letters 3(1), 2018, doi:10.1109/LRA.2017.2729659]
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
INERTIAL_NAMES = ("m", "mx", "my", "mz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz")
"""The ten parameters of a body, in order."""
INERTIAL_UNITS = ("kg", *["kg·m"] * 3, *["kg·m²"] * 6)
"""Their units."""
TEN = len(INERTIAL_NAMES)
_SYMMETRIC = np.array([[0, 1, 2], [1, 3, 4], [2, 4, 5]])


def skew(v: ArrayLike) -> Array:
    """Return the matrix (3, 3) of the cross product with v (3,)."""
    x, y, z = np.asarray(v, dtype=float)
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def inertia_matrix(pi: Array) -> Array:
    """Return the inertia about the origin (3, 3) out of the ten parameters (10,)."""
    return np.asarray(pi[4:][_SYMMETRIC])


def ten(m: float, h: ArrayLike, inertia: Array) -> Array:
    """Return the ten parameters (10,) from mass, first moment (3,) and inertia about the origin (3, 3)."""
    return np.array([m, *np.asarray(h, dtype=float), *inertia[np.triu_indices(3)]])


def moved(pi: Array, R: Array, t: Array) -> Array:
    """Return the ten parameters (10,) of a body seen from a frame in which its own stands turned by R, moved by t."""
    m, h = float(pi[0]), R @ pi[1:4]
    a, b = skew(h), skew(t)
    return ten(m, h + m * t, R @ inertia_matrix(pi) @ R.T - a @ b - b @ a - m * b @ b)


def about_centre(m: float, centre: ArrayLike, inertia: Array) -> Array:
    """Return the ten parameters (10,) from mass, centre of mass (3,) and inertia about the centre (3, 3)."""
    return moved(ten(m, np.zeros(3), inertia), np.eye(3), np.asarray(centre, dtype=float))


def pseudo_inertia(pi: Array) -> Array:
    """Return the pseudo-inertia (4, 4) of the ten parameters; positive semidefinite if such a body exists."""
    inertia = inertia_matrix(pi)
    sigma = 0.5 * np.trace(inertia) * np.eye(3) - inertia
    return np.block([[sigma, pi[1:4, None]], [pi[None, 1:4], np.array([[pi[0]]])]])


def from_pseudo_inertia(J: Array) -> Array:
    """Return the ten parameters (10,) of a pseudo-inertia (4, 4)."""
    sigma = J[:3, :3]
    return ten(float(J[3, 3]), J[:3, 3], np.trace(sigma) * np.eye(3) - sigma)


def least_eigenvalue(pi: Array) -> float:
    """Return the smallest eigenvalue of the pseudo-inertia: negative where no such body exists."""
    return float(np.linalg.eigvalsh(pseudo_inertia(pi))[0])


def least_eigenvalue_along(pi: Array) -> tuple[float, Array]:
    """Return the smallest eigenvalue of the pseudo-inertia, and by how much it grows with each parameter (10,)."""
    values, vectors = np.linalg.eigh(pseudo_inertia(pi))
    return float(values[0]), np.einsum("i,aij,j->a", vectors[:, 0], UNIT_PSEUDO_INERTIAS, vectors[:, 0])


UNIT_PSEUDO_INERTIAS = np.stack([pseudo_inertia(unit) for unit in np.eye(TEN)])
"""Pseudo-inertias (10, 4, 4) of a unit of each parameter."""


__all__ = [
    "INERTIAL_NAMES",
    "INERTIAL_UNITS",
    "TEN",
    "UNIT_PSEUDO_INERTIAS",
    "about_centre",
    "from_pseudo_inertia",
    "inertia_matrix",
    "least_eigenvalue",
    "least_eigenvalue_along",
    "moved",
    "pseudo_inertia",
    "skew",
    "ten",
]
