"""The Kalman filter of a followed model: gains, and the covariance of the state's error, compiled."""

# Numba infers the types in here; mypy cannot see through its decorators. What is literal (1, 0, True) is a type of its
# own, for which a function is compiled once more: hence np.int64(1).
# mypy: allow-untyped-defs, allow-untyped-calls, disable-error-code="misc,call-arg,unreachable"

from __future__ import annotations

import numpy as np

from signlin_ros.engine.compiling import compiled, inlined, inner
from signlin_ros.follow.interval import carry_step
from signlin_ros.follow.slopes import differentiated


@inlined
def fill_gains(out, at, e, noise, P, K, row):
    """Fill the Kalman gains K (n, ny); P (n, n), the covariance of the state's error, becomes that after them.

    Channel by channel, since their noises are independent; H (ny, n) stands in ``out`` from ``at`` on. Channels without
    a sample say nothing.
    """
    n, ny = K.shape
    for c in range(ny):
        H = out[at + c * n : at + (c + 1) * n]
        total = noise[c]
        for i in range(n):
            row[i] = 0.0
            for j in range(n):
                row[i] += P[i, j] * H[j]
            total += H[i] * row[i]
        there = 1.0 / total if e[c] == e[c] else 0.0
        for d in range(c):
            seen = 0.0
            for i in range(n):
                seen += H[i] * K[i, d]
            for i in range(n):
                K[i, d] -= row[i] * there * seen
        for i in range(n):
            K[i, c] = row[i] * there
            for j in range(n):
                P[i, j] -= row[i] * there * row[j]


@inlined
def spread(address, sizes, first, last, h, process, P, step, W):
    """Carry the covariance P (n, w) over h by the trapezoidal rule, and add the variances ``process`` (n).

    ``first`` (n, n) and ``last`` hold dF/dx at both ends, the one alone and the other where ``out`` has it.
    """
    n = P.shape[0]
    for _ in range(2):
        carry_step(address, sizes, first, last, h, P, step, W)
        for i in range(n):
            for j in range(i):
                P[i, j], P[j, i] = P[j, i], P[i, j]
    for i in range(n):
        for j in range(i):
            P[i, j] = P[j, i] = 0.5 * (P[i, j] + P[j, i])
        P[i, i] += process[i]


@inlined
def averaged(code, sizes, z, out, x, mode, s, belief, P, mean):
    """Average ``mean`` (n n), which holds dF/dx at x, over how uncertain the own positions are, by Gauss and Hermite's
    rule of order 3. Returns whether there are any; ``out`` does not belong to x then.
    """
    n, moved, at = x.size, False, sizes[10]
    for own in range(n):
        if belief[2, own] > 1.0:
            moved = True
            reach = np.sqrt(3.0 * max(P[own, own], 0.0))
            for i in range(n * n):
                mean[i] *= 2.0 / 3.0
            for sign in (-1.0, 1.0):
                z[own] = x[own] + sign * reach
                differentiated(code, sizes, z, out, mode, s)
                for i in range(n * n):
                    mean[i] += out[at + i] / 6.0
            z[own] = x[own]
    return moved


@compiled
def kalman_gains(A, H, Q, noise, P0, gains, variances):
    """Fill ``gains`` (G, n, ny) with the gains of the Kalman filter from P0 on, and ``variances`` (G, ny) with those
    of the innovations; returns how many are needed.

    A, Q and P0 (n, n); H (ny n): what the channels show, row by row; ``noise`` (ny): their variances.
    """
    n, ny = A.shape[0], noise.size
    P, AP, K, row, e = P0.copy(), np.zeros((n, n)), np.zeros((n, ny)), np.zeros(n), np.zeros(ny)
    for k in range(gains.shape[0]):
        moved = _one_more(A, H, Q, noise, P, AP, K, row, e, gains, variances, k)
        if k > 5 and moved <= 0.0:
            return k + 1
    return gains.shape[0]


@inner
def _one_more(A, H, Q, noise, P, AP, K, row, e, gains, variances, k):
    """Do step k of `kalman_gains`; returns by how much gains have moved, beyond a ten thousandth of them."""
    n, ny = K.shape
    for c in range(ny):
        variances[k, c] = noise[c]
        for i in range(n):
            for j in range(n):
                variances[k, c] += H[c * n + i] * P[i, j] * H[c * n + j]
    fill_gains(H, np.int64(0), e, noise, P, K, row)
    moved = 0.0
    for i in range(n):
        for c in range(ny):
            gains[k, i, c] = K[i, c]
            if k > 0:
                moved = max(moved, abs(K[i, c] - gains[k - 1, i, c]) - 1e-4 * abs(K[i, c]))
    for i in range(n):
        for j in range(n):
            AP[i, j] = 0.0
            for m in range(n):
                AP[i, j] += A[i, m] * P[m, j]
    for i in range(n):
        for j in range(i + 1):
            P[i, j] = 0.5 * (Q[i, j] + Q[j, i])
            for m in range(n):
                P[i, j] += 0.5 * (AP[i, m] * A[j, m] + AP[j, m] * A[i, m])
            P[j, i] = P[i, j]
    return moved


__all__ = ["averaged", "fill_gains", "kalman_gains", "spread"]
