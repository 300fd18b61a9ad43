"""Linear-quadratic gains with integral action for a sampled drive with a delay.

Sources: Åström and Wittenmark, Computer-Controlled Systems, 1997, sec. 2.3 (a delay that is no whole number of
periods) and ch. 11 (LQR); Bryson's rule for the weights.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from signlin_ros.control.constants import Constants
from signlin_ros.errors import InputError

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Weights:
    """What the weights of a design say, in terms of the loop that comes of them.

    ``bandwidth`` in rad/s: the feedback reaches it where the drive is an inertia; ``damping``: the weight of the
    speed in a position loop, as a share of the error's at that frequency; ``integral``: that of the summed error.
    """

    bandwidth: float
    damping: float = 1.0
    integral: float = 0.3

    def __post_init__(self) -> None:
        for name in ("bandwidth", "damping", "integral"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value >= 0.0) or (name == "bandwidth" and value == 0.0):
                raise InputError(f"{name}: found {value!r}; allowed: a positive number")

    def matrices(self, kA: float, position: bool) -> tuple[Array, float]:
        """Return Q for the states [integral, (position,) speed] and R by Bryson's rule."""
        w = self.bandwidth
        if position:
            return np.diag([(self.integral * w) ** 2, 1.0, (self.damping / w) ** 2]), 1.0 / (kA * w * w) ** 2
        return np.diag([(self.integral * w) ** 2, 1.0]), 1.0 / (kA * w) ** 2


@dataclass(frozen=True)
class Gains:
    """u = k_q e_q + k_v e_v + k_i (sum of errors) - sum_j past_j w_j, w_j the feedback of past periods, oldest first."""

    k_q: float
    k_v: float
    k_i: float
    past: tuple[float, ...] = ()

    @property
    def row(self) -> Array:
        """The gains (3 + N,) as a row of a law."""
        return np.array([self.k_q, self.k_v, self.k_i, *self.past])


def rigid(kV: float, kA: float, kP: float, position: bool) -> tuple[Array, Array]:
    """Return A and B of the errors [integral, (position,) speed] of a drive u = kV v + kA a + kP q.

    The integral of a speed's error is the error of the position, so that kP belongs to it.
    """
    if not kA > 0.0:
        raise InputError(f"kA is {kA:g}: the drive has no inertia that an input could move")
    if position:
        A = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, -kP / kA, -kV / kA]])
        return A, np.array([[0.0], [0.0], [1.0 / kA]])
    return np.array([[0.0, 1.0], [-kP / kA, -kV / kA]]), np.array([[0.0], [1.0 / kA]])


def held(A: Array, B: Array, h: float) -> tuple[Array, Array]:
    """Return the transition (n, n) and the input's effect (n, m) over h seconds with the input held."""
    from scipy.linalg import expm

    n, m = B.shape
    block = expm(h * np.block([[A, B], [np.zeros((m, n + m))]]))
    return block[:n, :n], block[:n, n:]


def sampled(A: Array, B: Array, period: float, delay: float) -> tuple[Array, Array]:
    """Return the sampled system whose states are x and the inputs of the last periods that are still to act.

    N = ceil(delay / period) inputs, oldest first, stand after x.
    """
    n = len(A)
    waiting = int(np.ceil(delay / period - 1e-9))
    if waiting == 0:
        return held(A, B, period)
    part = delay - (waiting - 1) * period  # in (0, period]: how long the oldest input goes on
    transition, _ = held(A, B, period)
    rest, late = held(A, B, period - part)
    _, early = held(A, B, part)
    F = np.zeros((n + waiting, n + waiting))
    G = np.zeros((n + waiting, 1))
    F[:n, :n], F[:n, n] = transition, (rest @ early)[:, 0]
    if waiting == 1:
        G[:n] = late
    else:
        F[:n, n + 1] = late[:, 0]
        F[n:-1, n + 1 :] = np.eye(waiting - 1)
    G[-1] = 1.0
    return F, G


def dlqr(F: Array, G: Array, Q: Array, R: float) -> Array:
    """Return the gain K (1, n) of u = -K x that minimizes the sum of x'Qx + u'Ru; raise `InputError` if there is none."""
    from scipy.linalg import solve_discrete_are

    try:
        P = solve_discrete_are(F, G, Q, np.array([[R]]))
    except (np.linalg.LinAlgError, ValueError) as error:
        raise InputError(f"no linear-quadratic gain for these weights: {error}") from error
    return np.asarray(np.linalg.solve(R + G.T @ P @ G, G.T @ P @ F))


def lqr_gains(kV: float, kA: float, kP: float, weights: Weights, period: float, delay: float, position: bool) -> Gains:
    """Return the gains of a drive u = kV v + kA a + kP q, sampled, with an input delay."""
    A, B = rigid(kV, kA, kP, position)
    F, G = sampled(A, B, period, delay)
    Q, R = weights.matrices(kA, position)
    padded = np.zeros(F.shape)
    padded[: len(Q), : len(Q)] = Q
    K = dlqr(F, G, padded, R)[0]
    n = len(A)
    k_q = float(K[1]) if position else 0.0
    return Gains(k_q, float(K[n - 1]), float(K[0]), tuple(map(float, K[n:])))


def pid_gains(constants: Constants, weights: Weights, position: bool) -> Gains:
    """Return a PI (speed) or PID (position) from the same weights: the continuous regulator, without memory.

    Position: K_p = k_q, K_i = k_i, K_d = k_v; speed: K_p = k_v, K_i = k_i.
    """
    from scipy.linalg import solve_continuous_are

    A, B = rigid(constants.kV, constants.kA, constants.kP, position)
    Q, R = weights.matrices(constants.kA, position)
    K = (B.T @ solve_continuous_are(A, B, Q, np.array([[R]])) / R)[0]
    return Gains(float(K[1]) if position else 0.0, float(K[-1]), float(K[0]))
