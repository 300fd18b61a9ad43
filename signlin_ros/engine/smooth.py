"""The compiled integrator with smooth signs: RODAS.

Source: Hairer and Wanner, Solving ODEs II, 1996, sec. IV.7.
"""

# Numba infers the types in here; mypy cannot see through its decorators.
# mypy: allow-untyped-defs, allow-untyped-calls, disable-error-code="misc"

from __future__ import annotations

import numpy as np

from signlin_ros.engine.compiling import call_within, compiled, inner
from signlin_ros.engine.parts import (
    DIVERGED,
    MAX_STEPS,
    OK,
    TOO_STIFF,
    accept,
    copy,
    error_norm,
    factor,
    hold,
    new_step,
    planned,
    prepared,
    put,
    show,
    substitute,
)

_GAMMA = 0.25
_RA = np.array(
    [
        [0.0, 0.0, 0.0, 0.0, 0.0],
        [1.544, 0.0, 0.0, 0.0, 0.0],
        [0.9466785280815826, 0.2557011698983284, 0.0, 0.0, 0.0],
        [3.314825187068521, 2.896124015972201, 0.9986419139977817, 0.0, 0.0],
        [1.221224509226641, 6.019134481288629, 12.53708332932087, -0.6878860361058950, 0.0],
        [1.221224509226641, 6.019134481288629, 12.53708332932087, -0.6878860361058950, 1.0],
    ]
)
_RC = np.array(
    [
        [0.0, 0.0, 0.0, 0.0, 0.0],
        [-5.6688, 0.0, 0.0, 0.0, 0.0],
        [-2.430093356833875, -0.2063599157091915, 0.0, 0.0, 0.0],
        [-0.1073529058151375, -9.594562251023355, -20.47028614809616, 0.0, 0.0],
        [7.496443313967647, -10.24680431464352, -33.99990352819905, 11.70890893206160, 0.0],
        [8.083246795921522, -7.981132988064893, -31.52159432874371, 16.31930543123136, -6.058818238834054],
    ]
)


def smooth_plan(code: tuple[int, int], n: int, m: int, n_c: int, n_y: int, linear: int = 0, rest: int = 0) -> np.void:
    """Return the plan for n states, m inputs, n_c constants and n_y outputs.

    The code takes z, i.e. x (n), u (m) and constants, and returns f_j (n), its Jacobian (n, n) and y; its head is
    f_j. ``linear`` is the address of the linearization, if there is one: it takes the same and returns A (n, n),
    B (n, m), c (n) and ``rest`` numbers more.
    """
    inputs = {"z": n, "u": m, "constants": n_c}
    results = {"f": n, "jacobian": n * n, "y": n_y}
    step = {"x": n, "peak": n, "U": 6 * n, "error": n, "matrix": n * n, "pivots": n}
    pieces = {"kept": n, "A": n * n, "B": n * m, "c": n, "rest": rest}
    exponential = dict.fromkeys(("exponent", "power", "spare"), (n + 1) ** 2 if linear else 0)
    sizes = {"n": n, "m": m, "linear": linear}
    return planned(code, sizes, {**inputs, **results, **step, **pieces, **exponential})


@inner
def _rodas_matrix(at, w, h):
    """Factor 1/(gamma h) - J at x."""
    n = at.n
    copy(w, at.x, at.z, n)
    call_within(at.whole, w, at.z, at.f)
    for i in range(n * n):
        w[at.matrix + i] = -w[at.jacobian + i]
    for i in range(n):
        w[at.matrix + i * n + i] += 1.0 / (_GAMMA * h)
    factor(w, at.matrix, at.pivots, n)


@inner
def _rodas_step(at, w, h):
    """Take one step of RODAS from x; the new state is left in z, the error estimate in ``error``."""
    n = at.n
    _rodas_matrix(at, w, h)
    for stage in range(6):
        if stage > 0:
            for i in range(n):
                total = w[at.x + i]
                for j in range(stage):
                    total += _RA[stage, j] * w[at.U + j * n + i]
                w[at.z + i] = total
            call_within(at.head, w, at.z, at.f)
        right = at.U + stage * n
        for i in range(n):
            total = w[at.f + i]
            for j in range(stage):
                total += _RC[stage, j] / h * w[at.U + j * n + i]
            w[right + i] = total
        substitute(w, at.matrix, at.pivots, right, n)
    for i in range(n):
        w[at.error + i] = w[at.U + 5 * n + i]
        w[at.z + i] += w[at.error + i]


@inner
def flow(at, w, t, target, h, rtol):
    """Carry x from t to target under f_j with the input in z held; returns (status, time, next step)."""
    for _ in range(MAX_STEPS):
        if t >= target:
            return OK, t, h
        if target - t <= 1e-14 * abs(target):
            return OK, target, h
        last = h >= target - t
        step = target - t if last else h
        if step <= 1e-15 * max(abs(t), abs(target)) and not last:
            return DIVERGED, t, h
        _rodas_step(at, w, step)
        norm = error_norm(w, at.error, at.x, at.z, at.peak, at.n, rtol)
        wanted = new_step(step, norm, 4.0)
        if norm > 1.0 and (norm == np.inf or step > 1e-12 * max(abs(t), 1e-3)):
            h = wanted
            continue
        t = target if last else t + step
        h = max(h, wanted) if last else wanted
        if not accept(w, at.x, at.z, at.peak, at.n):
            return DIVERGED, t, h
    return TOO_STIFF, t, h


@compiled
def run_smooth(at, times, breaks, inputs, x0, constants, rtol, X, Y):
    """Integrate f_j; inputs (K, m) hold from breaks (K,) on. ``constants``: p and scales. Returns (status, time)."""
    w = prepared(at, constants)
    put(at, w, x0)
    t, h, next_break, status = times[0], np.inf, 0, OK
    for sample in range(times.size):
        while True:
            while next_break < breaks.size and breaks[next_break] <= t:
                hold(at, w, inputs[next_break])
                next_break += 1
            target = times[sample]
            if next_break < breaks.size and breaks[next_break] < target:
                target = breaks[next_break]
            if t >= target:
                break
            status, t, h = flow(at, w, t, target, h, rtol)
            if status != OK:
                return status, t
        show(at, w, X[sample], Y[sample])
    return OK, t


@compiled
def flow_many(at, points, inputs, constants, span, rtol):
    """Carry every point (T, n) under f_j over ``span`` seconds with its input (T, m) held; in place."""
    w = prepared(at, constants)
    for k in range(points.shape[0]):
        hold(at, w, inputs[k])
        put(at, w, points[k])
        status, _, _ = flow(at, w, 0.0, span, span, rtol)
        for i in range(at.n):
            points[k, i] = w[at.x + i] if status == OK else np.nan


__all__ = ["flow", "flow_many", "run_smooth", "smooth_plan"]
