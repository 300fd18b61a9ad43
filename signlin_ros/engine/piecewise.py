"""The compiled integrator of a linear model that is held for a period: by the exponential of its matrix."""

# Numba infers the types in here; mypy cannot see through its decorators.
# mypy: allow-untyped-defs, allow-untyped-calls, disable-error-code="misc"

from __future__ import annotations

from signlin_ros.engine.compiling import call_within, compiled, inner
from signlin_ros.engine.parts import DIVERGED, OK, accept, copy, hold, prepared, put, show, small
from signlin_ros.engine.smooth import flow


@inner
def _multiply(w, a, b, product, n):
    """Write the product of the matrices (n, n) at ``a`` and ``b``."""
    small()
    for i in range(n):
        for j in range(n):
            total = 0.0
            for k in range(n):
                total += w[a + i * n + k] * w[b + k * n + j]
            w[product + i * n + j] = total


@inner
def _augment(at, w, h):
    """Write h [A, B u + c; 0, 0] as the exponent, divided by a power of 2 until it is small; returns that power."""
    n, worst, squarings = at.n, 0.0, 0
    size = n + 1
    for i in range(n):
        total, drift = 0.0, w[at.c + i]
        for j in range(at.m):
            drift += w[at.B + i * at.m + j] * w[at.z + n + j]
        for j in range(n):
            w[at.exponent + i * size + j] = h * w[at.A + i * n + j]
            total += abs(h * w[at.A + i * n + j])
        w[at.exponent + i * size + n] = h * drift
        worst = max(worst, total)
    while worst > 0.5 and squarings < 1000:
        worst *= 0.5
        squarings += 1
    for i in range(n * size):
        w[at.exponent + i] *= 0.5**squarings
    return squarings


@inner
def _propagate(at, w, h):
    """Carry x over h seconds of x' = A x + B u + c, by scaling and squaring of the augmented exponential.

    Taylor's series to order 13, summed by Horner's rule.
    """
    n, size = at.n, at.n + 1
    squarings, power, spare = _augment(at, w, h), at.power, at.spare
    for i in range(size * size):
        w[power + i] = 1.0 if i % (size + 1) == 0 else 0.0
    for order in range(13, 0, -1):
        _multiply(w, at.exponent, power, spare, size)
        for i in range(size * size):
            w[power + i] = w[spare + i] / order + (1.0 if i % (size + 1) == 0 else 0.0)
    for _ in range(squarings):
        _multiply(w, power, power, spare, size)
        power, spare = spare, power
    for i in range(n):
        total = w[power + i * size + n]
        for j in range(n):
            total += w[power + i * size + j] * w[at.x + j]
        w[spare + i] = total
    return accept(w, at.x, spare, at.peak, n)


@inner
def _linearize(at, w, half):
    """Write A, B and c at the present state, or where f_j arrives from there after ``half`` seconds."""
    copy(w, at.x, at.kept, at.n)
    status = OK
    if half > 0.0:
        for i in range(at.n):
            w[at.peak + i] = abs(w[at.x + i])
        status, _, _ = flow(at, w, 0.0, half, half, 1e-9)
    copy(w, at.x, at.z, at.n)
    copy(w, at.kept, at.x, at.n)
    call_within(at.linear, w, at.z, at.A)
    return status


@compiled
def run_piecewise(at, times, breaks, inputs, x0, constants, updates, half, X, Y):
    """Follow x' = A_k x + B_k u + c_k with a new A_k, B_k, c_k at every time in ``updates``.

    ``half`` > 0: linearize where f_j arrives after ``half`` seconds (midpoint). Returns (status, time).
    """
    w = prepared(at, constants)
    put(at, w, x0)
    t, next_break, next_update = times[0], 0, 0
    for sample in range(times.size):
        while True:
            while next_break < breaks.size and breaks[next_break] <= t:
                hold(at, w, inputs[next_break])
                next_break += 1
            due = False
            while next_update < updates.size and updates[next_update] <= t:
                next_update += 1
                due = True
            if due:
                status = _linearize(at, w, half)
                if status != OK:
                    return status, t
            target = times[sample]
            if next_break < breaks.size:
                target = min(target, breaks[next_break])
            if next_update < updates.size:
                target = min(target, updates[next_update])
            if t >= target:
                break
            bounded, t = _propagate(at, w, target - t), target
            if not bounded:
                return DIVERGED, t
        show(at, w, X[sample], Y[sample])
    return OK, t


__all__ = ["run_piecewise"]
