"""What the compiled integrators are made of: a run's plan and work array, linear equations, errors and steps.

The model comes in as machine code of its own (`signlin_ros.engine.native`), so that Numba compiles each integrator once
per machine and keeps it on disk. A run works in one array ``w`` of float64; a plan says where things lie in it.
"""

# Numba infers the types in here; mypy cannot see through its decorators.
# mypy: allow-untyped-defs, allow-untyped-calls, disable-error-code="misc"

from __future__ import annotations

from typing import Any

import numpy as np
from numba import types
from numba.extending import intrinsic

from signlin_ros.engine.compiling import call_within, compiled, inner

OK, DIVERGED, TOO_STIFF, CHATTER = 0, 1, 2, 3
"""How a run ended."""
MAX_STEPS = 20_000_000
MIN_RESOLVED_STATE = 1e-5
"""States smaller than this are resolved absolutely, to rtol times this."""
_PLAN = np.dtype(
    [
        (name, np.int64)
        for name in (
            *("whole", "head", "linear", "size", "n", "m", "q", "k"),
            *("z", "u", "constants", "signs", "f", "g", "rate", "slope", "coupling", "jacobian", "y"),
            *("x", "peak", "K", "U", "error", "x_new", "matrix", "pivots", "right"),
            *("s", "mode", "reached", "on", "g_tol", "rate_before", "s_before"),
            *("kept", "A", "B", "c", "rest", "exponent", "power", "spare"),
        )
    ]
)
"""All that a plan of either kind says. There is one type for both, and may not be two: Numba names a compiled function
by a number that a record's type gets anew in every process, so that of two types cached by different processes one
kernel may be linked with what was compiled for the other."""


def planned(code: tuple[int, int], numbers: dict[str, int], lengths: dict[str, int]) -> np.void:
    """Return native code, numbers, where each part begins in the work array, and its ``size``; as attributes."""
    ends = np.cumsum(list(lengths.values())).tolist()
    starts = dict(zip(lengths, [0, *ends[:-1]], strict=True))
    plan: np.void = np.zeros(1, _PLAN)[0]
    for name, value in {"whole": code[0], "head": code[1], **numbers, **starts, "size": ends[-1]}.items():
        plan[name] = value
    return plan


def _keep_small(typing_context: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        builder.function.attributes.add("optsize")
        builder.function.attributes.add("noinline")
        return context.get_dummy_value()

    return types.void(), generate


small: Any = intrinsic(_keep_small)
"""Makes LLVM keep the function that calls it as it is, instead of unrolling its loops in all that it is a part of:
loops over a handful of states gain nothing, and the first compilation would take a quarter longer."""


@inner
def factor(w, a, pivots, n):
    """Factor the matrix (n, n) at ``a`` by Gaussian elimination with pivoting, in place; pivots (n) are numbers."""
    small()
    for k in range(n):
        pivot = k
        for i in range(k + 1, n):
            if abs(w[a + i * n + k]) > abs(w[a + pivot * n + k]):
                pivot = i
        w[pivots + k] = pivot
        if pivot != k:
            for j in range(n):
                w[a + k * n + j], w[a + pivot * n + j] = w[a + pivot * n + j], w[a + k * n + j]
        for i in range(k + 1, n):
            factor = w[a + i * n + k] / w[a + k * n + k]
            w[a + i * n + k] = factor
            for j in range(k + 1, n):
                w[a + i * n + j] -= factor * w[a + k * n + j]


@inner
def substitute(w, a, pivots, b, n):
    """Solve with the factors at ``a``: the right side (n) at ``b`` becomes the solution."""
    small()
    for k in range(n):
        pivot = int(w[pivots + k])
        w[b + k], w[b + pivot] = w[b + pivot], w[b + k]
    for i in range(n):
        for j in range(i):
            w[b + i] -= w[a + i * n + j] * w[b + j]
    for i in range(n - 1, -1, -1):
        for j in range(i + 1, n):
            w[b + i] -= w[a + i * n + j] * w[b + j]
        w[b + i] /= w[a + i * n + i]


@inner
def copy(w, source, target, count):
    """Copy so many numbers."""
    small()
    for i in range(count):
        w[target + i] = w[source + i]


@inner
def error_norm(w, error, x, x_new, peak, n, rtol):
    """Largest component of an error relative to rtol times the largest |x| seen so far; inf if not finite.

    States count as at least `MIN_RESOLVED_STATE` in SI units, so that a start from rest is not resolved below rounding.
    """
    worst = 0.0
    for i in range(n):
        size = max(abs(w[x + i]), abs(w[x_new + i]), w[peak + i], MIN_RESOLVED_STATE)
        ratio = abs(w[error + i]) / (rtol * size)
        if not ratio <= 1e300:
            return np.inf
        worst = max(worst, ratio)
    return worst


@inner
def new_step(h, norm, order):
    """Return the step to try after one of h whose error has this norm."""
    if norm == np.inf:
        return 0.1 * h
    return h * min(5.0, max(0.2, 0.9 * (norm + 1e-20) ** (-1.0 / order)))


@inner
def accept(w, x, x_new, peak, n):
    """Take over the new state; returns whether it is bounded."""
    bounded = True
    for i in range(n):
        w[x + i] = w[x_new + i]
        w[peak + i] = max(w[peak + i], abs(w[x + i]))
        if not abs(w[x + i]) < 1e150:
            bounded = False
    return bounded


@compiled
def prepared(at, constants):
    """Return a work array with the constants in it."""
    w = np.zeros(at.size)
    for i in range(constants.size):
        w[at.constants + i] = constants[i]
    return w


@inner
def put(at, w, x):
    """Make x (n,) the present state, with nothing before it."""
    for i in range(at.n):
        w[at.x + i], w[at.peak + i] = x[i], abs(x[i])


@inner
def hold(at, w, u):
    """Hold the input u (m,) from now on."""
    for i in range(at.m):
        w[at.z + at.n + i] = u[i]


@inner
def show(at, w, x, y):
    """Write the present state to x and, if wanted, the outputs there to y."""
    for i in range(at.n):
        x[i] = w[at.x + i]
    if y.size:
        copy(w, at.x, at.z, at.n)
        call_within(at.whole, w, at.z, at.f)
        for i in range(y.size):
            y[i] = w[at.y + i]


__all__ = [
    "CHATTER",
    "DIVERGED",
    "MAX_STEPS",
    "MIN_RESOLVED_STATE",
    "OK",
    "TOO_STIFF",
    "accept",
    "copy",
    "error_norm",
    "factor",
    "hold",
    "new_step",
    "planned",
    "prepared",
    "put",
    "show",
    "small",
    "substitute",
]
