"""Linear-quadratic gains with integral action for a sampled drive with a delay.

Sources: Åström and Wittenmark, Computer-Controlled Systems, 1997, sec. 2.3 (a delay that is no whole number of
periods) and ch. 11 (LQR); Bryson's rule for the weights.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

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
    integral: float = 1.0

    def __post_init__(self) -> None:
        for name in ("bandwidth", "damping", "integral"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value >= 0.0) or (name == "bandwidth" and value == 0.0):
                raise InputError(f"{name}: found {value!r}; allowed: a positive number")

    def matrices(self, kA: ArrayLike, position: bool) -> tuple[Array, Array]:
        """Return Q for the states [integral, (position,) speed] and R (...) for kA (...), by Bryson's rule."""
        w, inertia = self.bandwidth, np.asarray(kA, dtype=float)
        if position:
            return np.diag([(self.integral * w) ** 2, 1.0, (self.damping / w) ** 2]), 1.0 / (inertia * w * w) ** 2
        return np.diag([(self.integral * w) ** 2, 1.0]), 1.0 / (inertia * w) ** 2


@dataclass(frozen=True)
class FeedbackGains:
    """u = k_q e_q + k_v e_v + k_i (sum of errors) - sum_j past_j w_j, w_j the feedback of past periods."""

    k_q: float
    k_v: float
    k_i: float
    past: tuple[float, ...] = ()

    @property
    def row(self) -> Array:
        """The gains (3 + N,) as a row of a law."""
        return np.array([self.k_q, self.k_v, self.k_i, *self.past])


def rigid(kV: ArrayLike, kA: ArrayLike, kP: ArrayLike, position: bool) -> tuple[Array, Array]:
    """Return A (..., n, n), B (..., n, 1) of the errors [integral, (position,) speed] of drives u = kV v + kA a + kP q.

    The integral of a speed's error is the error of the position, so that kP belongs to it.
    """
    speed, inertia, spring = np.broadcast_arrays(*(np.asarray(k, dtype=float) for k in (kV, kA, kP)))
    if not (inertia > 0.0).all():
        raise InputError(f"kA is {np.min(inertia):g}: the drive has no inertia that an input could move")
    n = 3 if position else 2
    A, B = np.zeros((*inertia.shape, n, n)), np.zeros((*inertia.shape, n, 1))
    A[..., range(n - 1), range(1, n)] = 1.0
    A[..., n - 1, n - 2], A[..., n - 1, n - 1], B[..., n - 1, 0] = -spring / inertia, -speed / inertia, 1.0 / inertia
    return A, B


def held(A: Array, B: Array, h: float) -> tuple[Array, Array]:
    """Return the transition (..., n, n) and the input's effect (..., n, 1) over h seconds with the input held."""
    from scipy.linalg import expm

    n = A.shape[-1]
    block = np.zeros((*A.shape[:-2], n + 1, n + 1))
    block[..., :n, :n], block[..., :n, n:] = A, B
    power = expm(h * block)
    return power[..., :n, :n], power[..., :n, n:]


def sampled(A: Array, B: Array, period: float, delay: float) -> tuple[Array, Array]:
    """Return the sampled system whose states are x and the inputs of the last periods that are still to act.

    N = ceil(delay / period) inputs, oldest first, stand after x.
    """
    n, waiting = A.shape[-1], int(np.ceil(delay / period - 1e-9))
    if waiting == 0:
        return held(A, B, period)
    part = delay - (waiting - 1) * period  # in (0, period]: how long the oldest input goes on
    transition, _ = held(A, B, period)
    rest, late = held(A, B, period - part)
    _, early = held(A, B, part)
    size = n + waiting
    F, G = np.zeros((*A.shape[:-2], size, size)), np.zeros((*A.shape[:-2], size, 1))
    F[..., :n, :n], F[..., :n, n] = transition, (rest @ early)[..., 0]
    if waiting == 1:
        G[..., :n, :] = late
    else:
        F[..., :n, n + 1] = late[..., 0]
        F[..., n:-1, n + 1 :] = np.eye(waiting - 1)
    G[..., -1, 0] = 1.0
    return F, G


def dlqr(F: Array, G: Array, Q: Array, R: ArrayLike) -> Array:
    """Return the gains K (..., 1, n) of u = -K x that minimize the sum of x'Qx + R u^2, for many systems at once.

    By the doubling algorithm (Chu, Fan, Lin and Wang 2004, doi:10.1080/00207170410001714988): each pass looks twice as
    far ahead. Raise `InputError` where no such gain is found.
    """
    price = np.asarray(R, dtype=float)[..., None, None]
    A, H, one = F, np.broadcast_to(Q, F.shape), np.eye(F.shape[-1])
    W = G @ G.swapaxes(-1, -2) / price
    for _ in range(MAX_DOUBLINGS):
        inside = np.linalg.solve(one + W @ H, np.concatenate([A, W], axis=-1))
        onward, spread = np.split(inside, 2, axis=-1)
        more = A.swapaxes(-1, -2) @ H @ onward
        W, H, A = W + A @ spread @ A.swapaxes(-1, -2), H + more, A @ onward
        if not np.isfinite(H).all():
            break
        if np.max(np.abs(more)) <= 1e-13 * np.max(np.abs(H)):
            back = G.swapaxes(-1, -2) @ H
            return np.asarray((back @ F) / (price + back @ G))
    raise InputError("no linear-quadratic gain for these weights: the drive cannot be stabilized")


MAX_DOUBLINGS = 60
"""Doublings after which no gain is expected any more."""


def lqr_rows(
    kV: ArrayLike, kA: ArrayLike, kP: ArrayLike, weights: Weights, period: float, delay: float, position: bool
) -> Array:
    """Return gains (..., 3 + N), k_q, k_v, k_i and those of past inputs, of drives u = kV v + kA a + kP q."""
    A, B = rigid(kV, kA, kP, position)
    F, G = sampled(A, B, period, delay)
    inertia = np.broadcast_to(np.asarray(kA, dtype=float), A.shape[:-2])
    Q, R = weights.matrices(inertia, position)
    n = A.shape[-1]
    padded = np.zeros(F.shape[-2:])
    padded[:n, :n] = Q
    K = dlqr(F, G, padded, R)[..., 0, :]
    k_q = K[..., 1] if position else np.zeros(K.shape[:-1])
    return np.concatenate([np.stack([k_q, K[..., n - 1], K[..., 0]], axis=-1), K[..., n:]], axis=-1)


def lqr_gains(
    kV: float, kA: float, kP: float, weights: Weights, period: float, delay: float, position: bool
) -> FeedbackGains:
    """Return the gains of one drive u = kV v + kA a + kP q, sampled, with an input delay."""
    k_q, k_v, k_i, *past = lqr_rows(kV, kA, kP, weights, period, delay, position).tolist()
    return FeedbackGains(k_q, k_v, k_i, tuple(past))


def pid_gains(constants: Constants, weights: Weights, position: bool) -> FeedbackGains:
    """Return a PI (speed) or PID (position) from the same weights: the continuous regulator, without memory.

    Position: K_p = k_q, K_i = k_i, K_d = k_v; speed: K_p = k_v, K_i = k_i.
    """
    from scipy.linalg import solve_continuous_are

    A, B = rigid(constants.kV, constants.kA, constants.kP, position)
    Q, R = weights.matrices(constants.kA, position)
    price = np.array([[float(R)]])
    try:
        K = np.linalg.solve(price, B.T @ solve_continuous_are(A, B, Q, price))[0]
    except (np.linalg.LinAlgError, ValueError):
        raise InputError("no PI(D) for these weights: the drive cannot be stabilized") from None
    return FeedbackGains(float(K[1]) if position else 0.0, float(K[-1]), float(K[0]))
