"""Compiled inner loops of simulation: a virtual machine for tapes, and three integrators over held inputs.

Everything here is generic: the model comes in as a `signlin_ros.tape.Tape`, so nothing is compiled per model. Numba
compiles each kernel once per machine and keeps it on disk.

Sources: Dormand and Prince 1980 with Shampine's interpolant (coefficients: SciPy); RODAS, Hairer and Wanner, Solving
ODEs II, 1996, sec. IV.7; set-valued friction: Acary and Brogliato, Numerical Methods for Nonsmooth Dynamical Systems,
2008; projected Gauss-Seidel: Cottle, Pang and Stone, The Linear Complementarity Problem, 1992.
"""

# Numba infers the types in here; mypy cannot see through its decorators.
# mypy: allow-untyped-defs, allow-untyped-calls, disable-error-code="misc"

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from scipy.integrate import RK45

from signlin_ros.tape import OPERATIONS, Tape

OK, DIVERGED, TOO_STIFF, CHATTER = 0, 1, 2, 3
"""How a run ended."""
MAX_STEPS = 20_000_000
SMALLEST = 1e-5
"""States smaller than this are resolved absolutely, to rtol times this."""
BREAKAWAY = 1e-9
"""How far |s| may pass 1 before a stuck surface slips: keeps the acceleration of the first slip definite."""

_A = np.array(RK45.A)
_B = np.array(RK45.B)
_E = np.array(RK45.E)
_P = np.array(RK45.P)


def _operation_source() -> str:
    """Return the source of ``operate(op, a, b)``: one branch for each line of the table of operations."""
    lines = ["def operate(op, a, b):"]
    lines += [f"    if op == {op}:\n        return {text}" for op, text in OPERATIONS.items()]
    return "\n".join([*lines, "    return np.nan"]).replace("np.where(a != 0.0, b, 0.0)", "b if a != 0.0 else 0.0")


_inlined: Any = njit(cache=True, error_model="numpy", forceinline=True)
"""For the small parts of an inner loop: passing a tuple of arrays costs more than what they do."""

_scope: dict[str, Any] = {"np": np}
exec(_operation_source(), _scope)
operate: Any = njit(error_model="numpy", forceinline=True)(_scope["operate"])


@_inlined
def _evaluate(tape, inputs, work, result, k_end, n_out):
    op, a, b, constants, picks, ends = tape
    n_in = ends[0]
    base = n_in + constants.size
    for i in range(n_in):
        work[i] = inputs[i]
    for i in range(constants.size):
        work[n_in + i] = constants[i]
    for k in range(k_end):
        work[base + k] = operate(op[k], work[a[k]], work[b[k]])
    for i in range(n_out):
        result[i] = work[picks[i]]


@njit(cache=True, error_model="numpy")
def evaluate(tape, inputs, work, result):
    """Run a tape: ``inputs`` (n_in) to ``result`` (n_out)."""
    _evaluate(tape, inputs, work, result, tape[0].size, tape[4].size)


@_inlined
def evaluate_head(tape, inputs, work, result):
    """Run only the head of a tape: the first ``n_head`` outputs."""
    _evaluate(tape, inputs, work, result, tape[5][2], tape[5][1])


@njit(cache=True, error_model="numpy")
def solve_in_place(matrix, right):
    """Solve matrix x = right by Gaussian elimination with pivoting; both are overwritten, x is in ``right``."""
    n = right.size
    for k in range(n):
        pivot = k + np.argmax(np.abs(matrix[k:, k]))
        if pivot != k:
            for j in range(n):
                matrix[k, j], matrix[pivot, j] = matrix[pivot, j], matrix[k, j]
            right[k], right[pivot] = right[pivot], right[k]
        for i in range(k + 1, n):
            factor = matrix[i, k] / matrix[k, k]
            matrix[i, k] = factor
            for j in range(k + 1, n):
                matrix[i, j] -= factor * matrix[k, j]
            right[i] -= factor * right[k]
    for i in range(n - 1, -1, -1):
        for j in range(i + 1, n):
            right[i] -= matrix[i, j] * right[j]
        right[i] /= matrix[i, i]


@_inlined
def _error_norm(error, x, x_new, peak, rtol):
    """Largest component of an error relative to rtol times the largest |x| seen so far; inf if not finite.

    States count as at least `SMALLEST` in SI units, so that a start from rest is not resolved below rounding.
    """
    worst = 0.0
    for i in range(x.size):
        size = max(abs(x[i]), abs(x_new[i]), peak[i], SMALLEST)
        ratio = abs(error[i]) / (rtol * size)
        if not ratio <= 1e300:
            return np.inf
        worst = max(worst, ratio)
    return worst


@_inlined
def _new_step(h, norm, order):
    if norm == np.inf:
        return 0.1 * h
    return h * min(5.0, max(0.2, 0.9 * (norm + 1e-20) ** (-1.0 / order)))


@njit(cache=True, error_model="numpy")
def slope_at_end(t, values, degree):
    """Return the slope at the last sample of the least-squares polynomial (degree 1 or 2) through all samples."""
    size = t[-1] - t[0]
    normal, right = np.zeros((degree + 1, degree + 1)), np.zeros(degree + 1)
    for k in range(t.size):
        age, value = (t[k] - t[-1]) / size, values[k] - values[-1]
        for i in range(degree + 1):
            right[i] += age**i * value
            for j in range(degree + 1):
                normal[i, j] += age ** (i + j)
    solve_in_place(normal, right)
    return right[1] / size


@njit(cache=True, error_model="numpy")
def causal_slopes(t, values, window, degree, least, slopes):
    """Fill ``slopes`` (T,) with `slope_at_end` of the last ``window`` seconds, at least ``least`` samples."""
    first = 0
    for k in range(t.size):
        while k - first >= least and t[first] < t[k] - window:
            first += 1
        if k > first:
            slopes[k] = slope_at_end(t[first : k + 1], values[first : k + 1], min(degree, k - first))


# --------------------------------------------------------------------------- exact: set-valued signs


@njit(cache=True, error_model="numpy")
def _stuck_state(tape, sizes, z, work, res, s, mode, stuck):
    """Evaluate with stuck signs at zero, then solve for them: dg/dt = 0 on every stuck surface; see `_state_of`."""
    n, m, n_p, q, k, coordinate, switch_of = sizes
    i_rate, i_slope, i_m = n + q, n + 2 * q, n + 2 * q + n * k
    evaluate(tape, z, work, res)
    matrix, right, members = np.empty((stuck, stuck)), np.empty(stuck), np.empty(stuck, np.int64)
    row = 0
    for j in range(q):
        if mode[j] == 0:
            members[row] = j
            row += 1
    for r in range(stuck):
        right[r] = -res[i_rate + members[r]]
        for c in range(stuck):
            matrix[r, c] = res[i_m + switch_of[members[r]] * k + switch_of[members[c]]]
    solve_in_place(matrix, right)
    for r in range(stuck):
        j = members[r]
        s[j] = right[r]
        for i in range(n):
            res[i] += res[i_slope + i * k + switch_of[j]] * right[r]
    for r in range(stuck):
        if coordinate[members[r]] >= 0:
            res[coordinate[members[r]]] = 0.0


@njit(cache=True, error_model="numpy")
def _state_of(tape, sizes, z, work, res, s, mode):
    """Evaluate the tape at z (x, u, p, s): ``res`` gets F (n), g (q) and dg/dt (q).

    Where something is stuck, ``res`` also gets dF/ds (n, k), the coupling (k, k) and y, and F holds the stuck signs,
    which are written to ``s``.
    """
    base = z.size - s.size
    stuck = 0
    for j in range(s.size):
        z[base + j] = 0.0 if mode[j] == 0 else s[j]
        stuck += mode[j] == 0
    if stuck == 0:
        evaluate_head(tape, z, work, res)
    else:
        _stuck_state(tape, sizes, z, work, res, s, mode, stuck)


@njit(cache=True, error_model="numpy")
def _resolve(tape, sizes, z, work, res, s, mode, at):
    """Choose every sign and branch at the present point: what is off its surface follows g, what is on it (``at``,
    stuck, or g = 0) sticks if the set-valued law allows it, else slips the way that it is pushed.
    """
    n, m, n_p, q, k, coordinate, switch_of = sizes
    base, i_g, i_rate, i_m = n + m + n_p, n, n + q, n + 2 * q + n * k
    on = np.zeros(q, np.bool_)
    for _ in range(2):
        for j in range(q):
            z[base + j] = s[j]
        evaluate(tape, z, work, res)
        for j in range(q):
            on[j] = at[j] or mode[j] == 0 or mode[j] == 2 or res[i_g + j] == 0.0
            if not on[j]:
                s[j] = 1.0 if res[i_g + j] > 0.0 else -1.0
                mode[j] = 1
            elif switch_of[j] < 0 and res[i_rate + j] != 0.0:
                s[j] = 1.0 if res[i_rate + j] > 0.0 else -1.0
    for j in range(q):
        z[base + j] = s[j]
    evaluate(tape, z, work, res)
    for _ in range(1000):
        moved = 0.0
        for j in range(q):
            if not on[j] or switch_of[j] < 0:
                continue
            diagonal = res[i_m + switch_of[j] * k + switch_of[j]]
            rate = res[i_rate + j]
            if diagonal < 0.0:
                new = min(1.0, max(-1.0, s[j] - rate / diagonal))
            else:
                alone = rate - diagonal * s[j]
                new = 1.0 if alone > 0.0 else (-1.0 if alone < 0.0 else 0.0)
            step = new - s[j]
            s[j] = new
            moved = max(moved, abs(step))
            for i in range(q):
                if switch_of[i] >= 0:
                    res[i_rate + i] += res[i_m + switch_of[i] * k + switch_of[j]] * step
        if moved <= 1e-14:
            break
    for j in range(q):
        if on[j] and switch_of[j] >= 0:
            diagonal = res[i_m + switch_of[j] * k + switch_of[j]]
            mode[j] = 0 if (diagonal < 0.0 and abs(s[j]) < 1.0) else (1 if s[j] != 0.0 else 2)


@_inlined
def _violated(sizes, res, s, mode, g_tol):
    """Tell whether the present point lies beyond what the signs and branches assume."""
    n, m, n_p, q, k, coordinate, switch_of = sizes
    i_g = n
    for j in range(q):
        if mode[j] == 0:
            if abs(s[j]) > 1.0 + BREAKAWAY:
                return True
        elif res[i_g + j] * s[j] < -g_tol[j]:
            return True
    return False


@njit(cache=True, error_model="numpy")
def _stages(tape, sizes, z, work, res, s, mode, x, h, K):
    """Take one Dormand-Prince step from x (K[0] is known); the new state is left in ``z``, its slope in K[6]."""
    n = x.size
    for stage in range(1, 7):
        for i in range(n):
            total = 0.0
            for j in range(stage):
                total += (_A[stage, j] if stage < 6 else _B[j]) * K[j, i]
            z[i] = x[i] + h * total
        _state_of(tape, sizes, z, work, res, s, mode)
        K[stage, :] = res[:n]


@njit(cache=True, error_model="numpy")
def _interpolate(x, h, K, theta, z):
    for i in range(x.size):
        total = 0.0
        for j in range(7):
            total += K[j, i] * theta * (_P[j, 0] + theta * (_P[j, 1] + theta * (_P[j, 2] + theta * _P[j, 3])))
        z[i] = x[i] + h * total


@_inlined
def _may_dip(sizes, res, s, mode, rates, s_before):
    """Tell whether a surface may be passed and passed back inside the step, judged from both ends."""
    n, m, n_p, q, k, coordinate, switch_of = sizes
    i_rate = n + q
    for j in range(q):
        if mode[j] == 0:
            if max(abs(s[j]), abs(s_before[j])) > 0.9:
                return True
        elif rates[j] * s[j] < 0.0 and res[i_rate + j] * s[j] > 0.0:
            return True
    return False


@njit(cache=True, error_model="numpy")
def _first_violation(tape, sizes, z, work, res, s, mode, x, h, K, g_tol, dip):
    """Return the smallest theta in (0, 1] at which a surface is passed, by bisection; 2 if none is.

    On entry ``res`` belongs to the end of the step; inner points are looked at only if ``dip``.
    """
    low, high = 0.0, 2.0
    if dip:
        for part in range(1, 4):
            theta = part / 4
            _interpolate(x, h, K, theta, z)
            _state_of(tape, sizes, z, work, res, s, mode)
            if _violated(sizes, res, s, mode, g_tol):
                low, high = theta - 0.25, theta
                break
    if high > 1.0:
        _interpolate(x, h, K, 1.0, z)
        if dip:
            _state_of(tape, sizes, z, work, res, s, mode)
        if not _violated(sizes, res, s, mode, g_tol):
            return 2.0
        high = 1.0
    while high - low > 1e-15:
        theta = 0.5 * (low + high)
        if theta <= low or theta >= high:
            break
        _interpolate(x, h, K, theta, z)
        _state_of(tape, sizes, z, work, res, s, mode)
        if _violated(sizes, res, s, mode, g_tol):
            high = theta
        else:
            low = theta
    return high


@njit(cache=True, error_model="numpy")
def _land(tape, sizes, z, work, res, s, mode, x, h, K, at, g_tol):
    """Step onto the surface just found, with one Newton correction of the step; mark in ``at`` what was reached.

    Returns the step taken. A surface that is a coordinate is hit exactly.
    """
    n, m, n_p, q, k, coordinate, switch_of = sizes
    i_g, i_rate = n, n + q
    _stages(tape, sizes, z, work, res, s, mode, x, h, K)
    for j in range(q):
        at[j] = mode[j] != 0 and res[i_g + j] * s[j] < g_tol[j] and res[i_rate + j] * s[j] < 0.0
        if mode[j] == 0:
            at[j] = abs(s[j]) >= 1.0
    for j in range(q):
        if at[j] and mode[j] != 0:
            correction = -res[i_g + j] / res[i_rate + j]
            if abs(correction) < 0.5 * h:
                h += correction
                _stages(tape, sizes, z, work, res, s, mode, x, h, K)
            break
    for j in range(q):
        if at[j] and mode[j] != 0 and coordinate[j] >= 0:
            z[coordinate[j]] = 0.0
    return h


@njit(cache=True, error_model="numpy")
def _memory(sizes, n_work, n_res, x0, p):
    """Return the arrays that a run works in: z (x, u, p, s), tape work, results, signs, modes and the step's own."""
    n, m, n_p, q, k, coordinate, switch_of = sizes
    z = np.zeros(n + m + n_p + q)
    z[:n], z[n + m : n + m + n_p] = x0, p
    signs = (np.ones(q), np.ones(q, np.int64), np.zeros(q, np.bool_), np.zeros(q))
    step = (x0.copy(), np.abs(x0), np.zeros((7, n)), np.zeros(n), np.zeros(n), np.zeros(q), np.zeros(q))
    return z, np.zeros(n_work), np.zeros(n_res), signs, step


@njit(cache=True, error_model="numpy")
def _begin(tape, sizes, memory, anew):
    """Set signs, branches and the slope for a new input; choose them afresh if something may have changed."""
    z, work, res, (s, mode, at, g_tol), step = memory
    n = step[0].size
    z[:n] = step[0]
    _state_of(tape, sizes, z, work, res, s, mode)
    if anew or np.any(mode != 1) or _violated(sizes, res, s, mode, g_tol):
        at[:] = False
        _resolve(tape, sizes, z, work, res, s, mode, at)
        _state_of(tape, sizes, z, work, res, s, mode)
    step[2][0, :] = res[:n]


@njit(cache=True, error_model="numpy")
def _try_step(tape, sizes, memory, h, rtol):
    """Take a step of h; returns its error norm, with the new state in z and the slopes in K."""
    z, work, res, (s, mode, at, g_tol), (x, peak, K, error, x_new, rates, s_before) = memory
    n, m, n_p, q, k, coordinate, switch_of = sizes
    i_rate = n + q
    rates[:] = res[i_rate : i_rate + q]
    s_before[:] = s
    _stages(tape, sizes, z, work, res, s, mode, x, h, K)
    for i in range(n):
        total = 0.0
        for j in range(7):
            total += _E[j] * K[j, i]
        error[i] = h * total
    norm = _error_norm(error, x, z[:n], peak, rtol)
    if norm > 1.0:
        res[i_rate : i_rate + q] = rates
    return norm


@njit(cache=True, error_model="numpy")
def _shorten(tape, sizes, memory, h, rtol):
    """Cut an accepted step of h at the first surface that it passes; returns (step taken, whether one was)."""
    z, work, res, (s, mode, at, g_tol), (x, peak, K, error, x_new, rates, s_before) = memory
    n, m, n_p, q, k, coordinate, switch_of = sizes
    i_g = n
    for j in range(q):
        g_tol[j] = max(g_tol[j], 1e-3 * rtol * abs(res[i_g + j]))
    if q == 0:
        return h, False
    x_new[:] = z[:n]
    dip = _may_dip(sizes, res, s, mode, rates, s_before)
    theta = _first_violation(tape, sizes, z, work, res, s, mode, x, h, K, g_tol, dip)
    if theta > 1.0:
        z[:n] = x_new
        return h, False
    return _land(tape, sizes, z, work, res, s, mode, x, theta * h, K, at, g_tol), True


@njit(cache=True, error_model="numpy")
def _note(sizes, mode, at, t, events, count):
    """Append the surfaces just reached to the events; returns how many there are."""
    switch_of = sizes[6]
    for j in range(at.size):
        if at[j] and count < events.shape[0]:
            events[count, 0], events[count, 1] = t, j
            events[count, 2] = 0 if switch_of[j] < 0 else (1 if mode[j] == 0 else 2)
            count += 1
    return count


@njit(cache=True, error_model="numpy")
def _march(tape, sizes, memory, t, target, h, rtol, events, count):  # one integrator loop: its parts are above
    """Integrate to ``target`` with the input held; returns (status, time, next step, number of events)."""
    z, work, res, (s, mode, at, g_tol), (x, peak, K, error, x_new, rates, s_before) = memory
    n, idle = x.size, 0
    for _ in range(MAX_STEPS):
        if target - t <= 1e-14 * abs(target):
            return OK, target, h, count
        step = min(h, target - t)
        if step <= 1e-15 * max(abs(t), abs(target)):
            return DIVERGED, t, h, count
        norm = _try_step(tape, sizes, memory, step, rtol)
        wanted = _new_step(step, norm, 5.0)
        if norm > 1.0 and (norm == np.inf or step > 1e-12 * max(abs(t), 1e-3)):
            h = wanted
            continue
        h = max(h, wanted) if step < h else wanted
        taken, reached = _shorten(tape, sizes, memory, step, rtol)
        idle = idle + 1 if taken <= 1e-13 * max(abs(t), 1e-3) else 0
        t = target if taken == target - t else t + taken
        for i in range(n):
            x[i] = z[i]
            peak[i] = max(peak[i], abs(x[i]))
        if not np.max(np.abs(x)) < 1e150:
            return DIVERGED, t, h, count
        if idle > 200:
            return CHATTER, t, h, count
        if reached:
            _resolve(tape, sizes, z, work, res, s, mode, at)
            count = _note(sizes, mode, at, t, events, count)
            _state_of(tape, sizes, z, work, res, s, mode)
            K[0, :] = res[:n]
        else:
            K[0, :] = K[6, :]
    return TOO_STIFF, t, h, count


@njit(cache=True, error_model="numpy")
def _output(tape, sizes, memory, y):
    """Write the outputs at the present state and signs to y."""
    z, work, res, (s, mode, at, g_tol), step = memory
    n, q = step[0].size, s.size
    z[:n], z[z.size - q :] = step[0], s
    evaluate(tape, z, work, res)
    y[:] = res[res.size - y.size :]


@njit(cache=True, error_model="numpy")
def run_exact(tape, sizes, n_work, n_res, times, breaks, inputs, x0, p, rtol, X, Y, events):
    """Integrate with set-valued signs; inputs (K, m) hold from breaks (K,) on; states to X (T, n), outputs to Y.

    ``events`` (E, 3) takes time, surface and kind (0 crossed, 1 stuck, 2 slips). Returns (status, time, events).
    """
    n, m, count, next_break, status = x0.size, inputs.shape[1], 0, 0, OK
    memory = _memory(sizes, n_work, n_res, x0, p)
    t, h = times[0], np.inf
    for sample in range(times.size):
        while True:
            fresh = sample == 0
            while next_break < breaks.size and breaks[next_break] <= t:
                memory[0][n : n + m] = inputs[next_break]
                next_break += 1
                fresh = True
            if fresh:
                _begin(tape, sizes, memory, sample == 0)
            target = times[sample]
            if next_break < breaks.size:
                target = min(target, breaks[next_break])
            if t >= target:
                break
            status, t, h, count = _march(tape, sizes, memory, t, target, h, rtol, events, count)
            if status != OK:
                return status, t, count
        X[sample] = memory[4][0]
        if Y.shape[1]:
            _output(tape, sizes, memory, Y[sample])
    return OK, t, count


# --------------------------------------------------------------------------- smooth: RODAS

_GAMMA = 0.25
_RA = np.array(
    [
        [0.0, 0.0, 0.0, 0.0, 0.0],
        [1.544, 0.0, 0.0, 0.0, 0.0],
        [0.9466785280815826, 0.2557011698983284, 0.0, 0.0, 0.0],
        [3.314825187068521, 2.896124015972201, 0.9986419139977817, 0.0, 0.0],
        [1.221224509226641, 6.019134481288629, 12.53708332932087, -0.6878860361058950, 0.0],
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


@njit(cache=True, error_model="numpy")
def _rodas_step(tape, z, work, res, x, h, U, error):
    """Take one step of RODAS from x; the new state is left in ``z``, the error estimate in ``error``."""
    n = x.size
    z[:n] = x
    evaluate(tape, z, work, res)
    jacobian = res[n : n + n * n].copy().reshape(n, n)
    for stage in range(6):
        if stage > 0:
            for i in range(n):
                total = x[i]
                for j in range(stage):
                    total += (_RA[stage, j] if stage < 5 else (_RA[4, j] if j < 4 else 1.0)) * U[j, i]
                z[i] = total
            evaluate_head(tape, z, work, res)
        matrix, right = -jacobian, np.empty(n)
        for i in range(n):
            matrix[i, i] += 1.0 / (_GAMMA * h)
            right[i] = res[i]
            for j in range(stage):
                right[i] += _RC[stage, j] / h * U[j, i]
        solve_in_place(matrix, right)
        U[stage, :] = right
    for i in range(n):
        z[i] += U[5, i]
        error[i] = U[5, i]


@njit(cache=True, error_model="numpy")
def flow_smooth(tape, z, work, res, x, peak, t, target, h, rtol, U, error):
    """Carry x from t to target under f_j with the input in ``z`` held; returns (status, time, next step)."""
    n = x.size
    for _ in range(MAX_STEPS):
        if t >= target:
            return OK, t, h
        if target - t <= 1e-14 * abs(target):
            return OK, target, h
        last = h >= target - t
        step = target - t if last else h
        if step <= 1e-15 * max(abs(t), abs(target)) and not last:
            return DIVERGED, t, h
        _rodas_step(tape, z, work, res, x, step, U, error)
        norm = _error_norm(error, x, z[:n], peak, rtol)
        if norm > 1.0 and (norm == np.inf or step > 1e-12 * max(abs(t), 1e-3)):
            h = _new_step(step, norm, 4.0)
            continue
        t = target if last else t + step
        h = max(h, _new_step(step, norm, 4.0)) if last else _new_step(step, norm, 4.0)
        for i in range(n):
            x[i] = z[i]
            peak[i] = max(peak[i], abs(x[i]))
            if not abs(x[i]) < 1e150:
                return DIVERGED, t, h
    return TOO_STIFF, t, h


@njit(cache=True, error_model="numpy")
def run_smooth(tape, n_work, n_res, times, breaks, inputs, x0, constants, rtol, X, Y):
    """Integrate f_j; inputs (K, m) hold from breaks (K,) on. ``constants``: p and scales. Returns (status, time)."""
    n, m, n_y = x0.size, inputs.shape[1], Y.shape[1]
    z, work, res = np.zeros(n + m + constants.size), np.zeros(n_work), np.zeros(n_res)
    z[n + m :] = constants
    x, peak, U, error = x0.copy(), np.abs(x0), np.zeros((6, n)), np.zeros(n)
    t, h, next_break, status = times[0], np.inf, 0, OK
    for sample in range(times.size):
        while True:
            while next_break < breaks.size and breaks[next_break] <= t:
                z[n : n + m] = inputs[next_break]
                next_break += 1
            target = times[sample]
            if next_break < breaks.size and breaks[next_break] < target:
                target = breaks[next_break]
            if t >= target:
                break
            status, t, h = flow_smooth(tape, z, work, res, x, peak, t, target, h, rtol, U, error)
            if status != OK:
                return status, t
        X[sample] = x
        if n_y:
            z[:n] = x
            evaluate(tape, z, work, res)
            Y[sample] = res[n_res - n_y :]
    return OK, t


@njit(cache=True, error_model="numpy")
def flow_many(tape, n_work, n_res, points, inputs, constants, span, rtol):
    """Carry every point (T, n) under f_j over ``span`` seconds with its input (T, m) held; in place."""
    n, m = points.shape[1], inputs.shape[1]
    z, work, res = np.zeros(n + m + constants.size), np.zeros(n_work), np.zeros(n_res)
    z[n + m :] = constants
    U, error = np.zeros((6, n)), np.zeros(n)
    for k in range(points.shape[0]):
        z[n : n + m] = inputs[k]
        x = points[k].copy()
        status, _, _ = flow_smooth(tape, z, work, res, x, np.abs(x), 0.0, span, span, rtol, U, error)
        if status == OK:
            points[k] = x
        else:
            points[k] = np.nan


# --------------------------------------------------------------------------- piecewise linear


@njit(cache=True, error_model="numpy")
def propagate(A, b, h, x):
    """Carry x over h seconds of x' = A x + b (b constant), by scaling and squaring of the augmented exponential."""
    n = x.size
    M = np.zeros((n + 1, n + 1))
    M[:n, :n], M[:n, n] = A * h, b * h
    size, squarings = 0.0, 0
    for i in range(n):
        size = max(size, np.sum(np.abs(M[i, :n])))
    while size > 0.5 and squarings < 1000:
        size *= 0.5
        squarings += 1
    M *= 0.5**squarings
    total, power = np.eye(n + 1), np.eye(n + 1)
    for order in range(1, 14):
        power = power @ M / order
        total += power
    for _ in range(squarings):
        total = total @ total
    return np.ascontiguousarray(total[:n, :n]) @ x + total[:n, n]


@njit(cache=True, error_model="numpy")
def run_piecewise(linear, smooth, sizes, times, breaks, inputs, x0, linear_p, smooth_p, updates, half, X, Y):
    """Follow x' = A_k x + B_k u + c_k with a new A_k, B_k, c_k at every time in ``updates``.

    ``half`` > 0: linearize where f_j arrives after ``half`` seconds (midpoint). Returns (status, time).
    """
    n_work, n_res, s_work, s_res = sizes
    n, m, n_y = x0.size, inputs.shape[1], Y.shape[1]
    z, work, res = np.zeros(n + m + linear_p.size), np.zeros(n_work), np.zeros(n_res)
    sz, swork, sres = np.zeros(n + m + smooth_p.size), np.zeros(s_work), np.zeros(s_res)
    z[n + m :], sz[n + m :] = linear_p, smooth_p
    U, error, x, u = np.zeros((6, n)), np.zeros(n), x0.copy(), np.zeros(m)
    A, B, c = np.zeros((n, n)), np.zeros((n, m)), np.zeros(n)
    t, next_break, next_update = times[0], 0, 0
    for sample in range(times.size):
        while True:
            while next_break < breaks.size and breaks[next_break] <= t:
                u = inputs[next_break].copy()
                next_break += 1
            if next_update < updates.size and updates[next_update] <= t:
                while next_update < updates.size and updates[next_update] <= t:
                    next_update += 1
                point = x.copy()
                if half > 0.0:
                    sz[n : n + m] = u
                    status, _, _ = flow_smooth(
                        smooth, sz, swork, sres, point, np.abs(x), 0.0, half, half, 1e-9, U, error
                    )
                    if status != OK:
                        return status, t
                z[:n], z[n : n + m] = point, u
                evaluate(linear, z, work, res)
                A[:, :] = res[: n * n].reshape(n, n)
                B[:, :] = res[n * n : n * (n + m)].reshape(n, m)
                c[:] = res[n * (n + m) : n * (n + m + 1)]
            target = times[sample]
            if next_break < breaks.size and breaks[next_break] < target:
                target = breaks[next_break]
            if next_update < updates.size and updates[next_update] < target:
                target = updates[next_update]
            if t >= target:
                break
            x = propagate(A, B @ u + c, target - t, x)
            t = target
            if not np.max(np.abs(x)) < 1e150:
                return DIVERGED, t
        X[sample] = x
        if n_y:
            sz[:n], sz[n : n + m] = x, u
            evaluate(smooth, sz, swork, sres)
            Y[sample] = sres[s_res - n_y :]
    return OK, t


__all__ = ["Tape", "evaluate", "flow_many", "run_exact", "run_piecewise", "run_smooth"]
