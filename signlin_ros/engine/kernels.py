"""Compiled inner loops of simulation: three integrators over held inputs, and a model at many points.

Everything here is generic: the model comes in as machine code of its own (`signlin_ros.engine.native`), so that Numba
compiles each kernel once per machine and keeps it on disk. A run works in one array ``w`` of float64; a plan says
where things lie in it.

Sources: Dormand and Prince 1980 with Shampine's interpolant (`signlin_ros.engine.tableau`); RODAS, Hairer and Wanner,
Solving ODEs II, 1996, sec. IV.7; set-valued friction: Acary and Brogliato, Numerical Methods for Nonsmooth Dynamical
Systems, 2008; projected Gauss-Seidel: Cottle, Pang and Stone, The Linear Complementarity Problem, 1992.
"""

# Numba infers the types in here; mypy cannot see through its decorators.
# mypy: allow-untyped-defs, allow-untyped-calls, disable-error-code="misc"

from __future__ import annotations

from typing import Any

import numpy as np
from numba import types
from numba.extending import intrinsic

from signlin_ros.engine.native import call_within, compiled, inner
from signlin_ros.engine.tableau import A as _A
from signlin_ros.engine.tableau import E as _E
from signlin_ros.engine.tableau import P as _P

OK, DIVERGED, TOO_STIFF, CHATTER = 0, 1, 2, 3
"""How a run ended."""
STUCK, SIGNED, OPEN = 0.0, 1.0, 2.0
"""Modes of a surface: its sign is what keeps it there, is 1 or -1, or is 0 as long as nothing pushes."""
COORDINATE, SWITCH = 0, 1
"""Rows of ``links`` (2, q): which state a surface is, and which switch; -1 for none."""
MAX_STEPS = 20_000_000
SMALLEST = 1e-5
"""States smaller than this are resolved absolutely, to rtol times this."""
BREAKAWAY = 1e-9
"""How far |s| may pass 1 before a stuck surface slips: keeps the acceleration of the first slip definite."""


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


def _plan(code: tuple[int, int], numbers: dict[str, int], lengths: dict[str, int]) -> np.void:
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


_small: Any = intrinsic(_keep_small)
"""Makes LLVM keep the function that calls it as it is, instead of unrolling its loops in all that it is a part of:
loops over a handful of states gain nothing, and the first compilation would take a quarter longer."""


# --------------------------------------------------------------------------- parts


@inner
def _factor(w, a, pivots, n):
    """Factor the matrix (n, n) at ``a`` by Gaussian elimination with pivoting, in place; pivots (n) are numbers."""
    _small()
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
def _substitute(w, a, pivots, b, n):
    """Solve with the factors at ``a``: the right side (n) at ``b`` becomes the solution."""
    _small()
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
def _copy(w, source, target, count):
    _small()
    for i in range(count):
        w[target + i] = w[source + i]


@inner
def _error_norm(w, error, x, x_new, peak, n, rtol):
    """Largest component of an error relative to rtol times the largest |x| seen so far; inf if not finite.

    States count as at least `SMALLEST` in SI units, so that a start from rest is not resolved below rounding.
    """
    worst = 0.0
    for i in range(n):
        size = max(abs(w[x + i]), abs(w[x_new + i]), w[peak + i], SMALLEST)
        ratio = abs(w[error + i]) / (rtol * size)
        if not ratio <= 1e300:
            return np.inf
        worst = max(worst, ratio)
    return worst


@inner
def _new_step(h, norm, order):
    if norm == np.inf:
        return 0.1 * h
    return h * min(5.0, max(0.2, 0.9 * (norm + 1e-20) ** (-1.0 / order)))


@inner
def _accept(w, x, x_new, peak, n):
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
def _show(at, w, x, y):
    """Write the present state to x and, if wanted, the outputs there to y."""
    for i in range(at.n):
        x[i] = w[at.x + i]
    if y.size:
        _copy(w, at.x, at.z, at.n)
        call_within(at.whole, w, at.z, at.f)
        for i in range(y.size):
            y[i] = w[at.y + i]


@compiled
def slope_at_end(t, values, degree):
    """Return the slope at the last sample of the least-squares polynomial (degree 1 or 2) through all samples."""
    size, n = t[-1] - t[0], degree + 1
    w = np.zeros(n * n + 2 * n)
    pivots, right = n * n, n * n + n
    for k in range(t.size):
        age, value = (t[k] - t[-1]) / size, values[k] - values[-1]
        for i in range(n):
            w[right + i] += age**i * value
            for j in range(n):
                w[i * n + j] += age ** (i + j)
    _factor(w, 0, pivots, n)
    _substitute(w, 0, pivots, right, n)
    return w[right + 1] / size


@compiled
def causal_slopes(t, values, window, degree, least, slopes):
    """Fill ``slopes`` (T,) with `slope_at_end` of the last ``window`` seconds, at least ``least`` samples."""
    first = 0
    for k in range(t.size):
        while k - first >= least and t[first] < t[k] - window:
            first += 1
        if k > first:
            slopes[k] = slope_at_end(t[first : k + 1], values[first : k + 1], min(degree, k - first))


# --------------------------------------------------------------------------- exact: set-valued signs


def exact_plan(code: tuple[int, int], n: int, m: int, n_p: int, q: int, k: int, n_y: int) -> np.void:
    """Return the plan for n states, m inputs, n_p parameters, q surfaces, k switches and n_y outputs.

    The code takes z, i.e. x (n), u (m), p, then the signs (q), and returns F (n), g (q), dg/dt (q), dF/ds (n, k),
    the coupling d(dg/dt)/ds (k, k) of the switches, and y; its head ends before dF/ds.
    """
    inputs = {"z": n, "u": m, "constants": n_p, "signs": q}
    results = {"f": n, "g": q, "rate": q, "slope": n * k, "coupling": k * k, "y": n_y}
    step = {"x": n, "peak": n, "K": 7 * n, "error": n, "x_new": n}
    surfaces = dict.fromkeys(("s", "mode", "reached", "on", "g_tol", "rate_before", "s_before"), q)
    solver = {"matrix": k * k, "pivots": k, "right": k}
    return _plan(code, {"n": n, "m": m, "q": q, "k": k}, {**inputs, **results, **step, **surfaces, **solver})


@inner
def _stuck_state(at, links, w):
    """Evaluate with stuck signs at zero, then solve for them: dg/dt = 0 on every stuck surface; see `_state_of`."""
    n, q, k = at.n, at.q, at.k
    call_within(at.whole, w, at.z, at.f)
    for j in range(q):
        row = links[SWITCH, j]
        if row < 0:
            continue
        held = w[at.mode + j] == STUCK
        w[at.right + row] = -w[at.rate + j] if held else 0.0
        for i in range(q):
            column = links[SWITCH, i]
            if column >= 0:
                both = held and w[at.mode + i] == STUCK
                alone = 1.0 if i == j else 0.0
                w[at.matrix + row * k + column] = w[at.coupling + row * k + column] if both else alone
    _factor(w, at.matrix, at.pivots, k)
    _substitute(w, at.matrix, at.pivots, at.right, k)
    for j in range(q):
        if w[at.mode + j] == STUCK:
            s = w[at.s + j] = w[at.right + links[SWITCH, j]]
            for i in range(n):
                w[at.f + i] += w[at.slope + i * k + links[SWITCH, j]] * s


@inner
def _state_of(at, links, w):
    """Evaluate at z: F, g and dg/dt with the present signs and modes.

    Where something is stuck, all that the code returns is there, and F holds the stuck signs, which go to ``s``. A
    coordinate that is stuck, or that nothing pushes, rests: its F is exactly 0.
    """
    stuck = False
    for j in range(at.q):
        w[at.signs + j] = w[at.s + j]
        if w[at.mode + j] == STUCK:
            w[at.signs + j] = 0.0
            stuck = True
    if stuck:
        _stuck_state(at, links, w)
    else:
        call_within(at.head, w, at.z, at.f)
    for j in range(at.q):
        if w[at.mode + j] != SIGNED and links[COORDINATE, j] >= 0:
            w[at.f + links[COORDINATE, j]] = 0.0


@inner
def _sides(at, links, w):
    """Mark in ``on`` what is on its surface (``reached``, stuck, or g = 0); the rest gets the sign of g."""
    for _ in range(2):
        _copy(w, at.s, at.signs, at.q)
        call_within(at.whole, w, at.z, at.f)
        for j in range(at.q):
            g, rate = w[at.g + j], w[at.rate + j]
            on = w[at.reached + j] != 0.0 or w[at.mode + j] == STUCK or g == 0.0
            w[at.on + j] = 1.0 if on else 0.0
            if not on:
                w[at.s + j] = 1.0 if g > 0.0 else -1.0
            elif links[SWITCH, j] < 0 and rate != 0.0:
                w[at.s + j] = 1.0 if rate > 0.0 else -1.0


@inner
def _project(at, links, w, j):
    """Give the switch j on its surface the sign in [-1, 1] that keeps it there best; returns how far that moved it."""
    k, row = at.k, links[SWITCH, j]
    diagonal, rate, old = w[at.coupling + row * k + row], w[at.rate + j], w[at.s + j]
    if diagonal < 0.0:
        new = min(1.0, max(-1.0, old - rate / diagonal))
    else:
        alone = rate - diagonal * old
        new = 1.0 if alone > 0.0 else (-1.0 if alone < 0.0 else 0.0)
    w[at.s + j] = new
    for i in range(at.q):
        if links[SWITCH, i] >= 0:
            w[at.rate + i] += w[at.coupling + links[SWITCH, i] * k + row] * (new - old)
    return abs(new - old)


@inner
def _resolve(at, links, w):
    """Choose every sign and branch at the present point: what is off its surface follows g, what is on it sticks if
    the set-valued law allows it, else slips the way that it is pushed.
    """
    _sides(at, links, w)
    _copy(w, at.s, at.signs, at.q)
    call_within(at.whole, w, at.z, at.f)
    for _ in range(1000):
        moved = 0.0
        for j in range(at.q):
            if w[at.on + j] != 0.0 and links[SWITCH, j] >= 0:
                moved = max(moved, _project(at, links, w, j))
        if moved <= 1e-14:
            break
    for j in range(at.q):
        row, s = links[SWITCH, j], w[at.s + j]
        if w[at.on + j] == 0.0:
            w[at.mode + j] = SIGNED
        elif row >= 0:
            holds = w[at.coupling + row * at.k + row] < 0.0 and abs(s) < 1.0
            w[at.mode + j] = STUCK if holds else (SIGNED if s != 0.0 else OPEN)


@inner
def _violated(at, w):
    """Tell whether the present point lies beyond what the signs and branches assume."""
    for j in range(at.q):
        if w[at.mode + j] == STUCK:
            if abs(w[at.s + j]) > 1.0 + BREAKAWAY:
                return True
        elif w[at.mode + j] == OPEN:
            if w[at.rate + j] != 0.0:
                return True
        elif w[at.g + j] * w[at.s + j] < -w[at.g_tol + j]:
            return True
    return False


@inner
def _stages(at, links, w, h):
    """Take one Dormand-Prince step from x (K[0] is known); the new state is left in z, its slope in K[6]."""
    n = at.n
    for stage in range(1, 7):
        for i in range(n):
            total = 0.0
            for j in range(stage):
                total += _A[stage, j] * w[at.K + j * n + i]
            w[at.z + i] = w[at.x + i] + h * total
        _state_of(at, links, w)
        _copy(w, at.f, at.K + stage * n, n)


@inner
def _interpolate(at, w, h, theta):
    """Put the state after the share ``theta`` of the step h into z."""
    for i in range(at.n):
        total = 0.0
        for j in range(7):
            weight = theta * (_P[j, 0] + theta * (_P[j, 1] + theta * (_P[j, 2] + theta * _P[j, 3])))
            total += w[at.K + j * at.n + i] * weight
        w[at.z + i] = w[at.x + i] + h * total


@inner
def _beyond(at, links, w, h, theta):
    """Tell whether the point after the share ``theta`` of the step h is `_violated`."""
    _interpolate(at, w, h, theta)
    _state_of(at, links, w)
    return _violated(at, w)


@inner
def _may_dip(at, w):
    """Tell whether a surface may be passed and passed back inside the step, judged from both ends."""
    for j in range(at.q):
        s = w[at.s + j]
        if w[at.mode + j] == STUCK:
            if max(abs(s), abs(w[at.s_before + j])) > 0.9:
                return True
        elif w[at.mode + j] == OPEN or (w[at.rate_before + j] * s < 0.0 and w[at.rate + j] * s > 0.0):
            return True
    return False


@inner
def _first_violation(at, links, w, h):
    """Return the smallest share in (0, 1] of the step h at which a surface is passed, by bisection; 2 if none is.

    The point at hand is the end of the step; inner points are looked at only if they may differ.
    """
    low, high = 0.0, 1.0
    if _may_dip(at, w):
        while not _beyond(at, links, w, h, low + 0.25):
            low += 0.25
            if low == 1.0:
                return 2.0
        high = low + 0.25
    elif not _violated(at, w):
        return 2.0
    while high - low > 1e-15:
        theta = 0.5 * (low + high)
        if theta <= low or theta >= high:
            break
        if _beyond(at, links, w, h, theta):
            high = theta
        else:
            low = theta
    return high


@inner
def _reached(at, w, j):
    """Tell whether the surface j is what ends the step: it breaks away, is pushed for the first time, or is met."""
    s, mode = w[at.s + j], w[at.mode + j]
    if mode == STUCK:
        return abs(s) >= 1.0
    if mode == OPEN:
        return w[at.rate + j] != 0.0
    return w[at.g + j] * s < w[at.g_tol + j] and w[at.rate + j] * s < 0.0


@inner
def _land(at, links, w, h):
    """Step onto the surface just found, with one Newton correction of the step; mark what was ``reached``.

    Returns the step taken. A surface that is a coordinate is hit exactly.
    """
    _stages(at, links, w, h)
    for j in range(at.q):
        w[at.reached + j] = _reached(at, w, j)
    for j in range(at.q):
        if w[at.reached + j] != 0.0 and w[at.mode + j] == SIGNED:
            correction = -w[at.g + j] / w[at.rate + j]
            if abs(correction) < 0.5 * h:
                h += correction
                _stages(at, links, w, h)
            break
    for j in range(at.q):
        if w[at.reached + j] != 0.0 and w[at.mode + j] != STUCK and links[COORDINATE, j] >= 0:
            w[at.z + links[COORDINATE, j]] = 0.0
    return h


@inner
def begin(at, links, w, anew):
    """Set signs, branches and the slope for a new input; choose them afresh if something may have changed."""
    _copy(w, at.x, at.z, at.n)
    for j in range(at.q):
        anew = anew or w[at.mode + j] != SIGNED
    if not anew:
        _state_of(at, links, w)
        anew = _violated(at, w)
    if anew:
        for j in range(at.q):
            w[at.reached + j] = 0.0
        _resolve(at, links, w)
        _state_of(at, links, w)
    _copy(w, at.f, at.K, at.n)


@inner
def _try_step(at, links, w, h, rtol):
    """Take a step of h; returns its error norm, with the new state in z and the slopes in K."""
    n = at.n
    _copy(w, at.rate, at.rate_before, at.q)
    _copy(w, at.s, at.s_before, at.q)
    _stages(at, links, w, h)
    for i in range(n):
        total = 0.0
        for j in range(7):
            total += _E[j] * w[at.K + j * n + i]
        w[at.error + i] = h * total
    norm = _error_norm(w, at.error, at.x, at.z, at.peak, n, rtol)
    if norm > 1.0:
        _copy(w, at.rate_before, at.rate, at.q)
    return norm


@inner
def _shorten(at, links, w, h, rtol):
    """Cut an accepted step of h at the first surface that it passes; returns (step taken, whether one was)."""
    for j in range(at.q):
        w[at.g_tol + j] = max(w[at.g_tol + j], 1e-3 * rtol * abs(w[at.g + j]))
    _copy(w, at.z, at.x_new, at.n)
    theta = _first_violation(at, links, w, h)
    if theta > 1.0:
        _copy(w, at.x_new, at.z, at.n)
        return h, False
    return _land(at, links, w, theta * h), True


@inner
def _note(at, links, w, t, events, count):
    """Append the surfaces just reached to the events; returns how many there are."""
    for j in range(at.q):
        if w[at.reached + j] != 0.0 and count < events.shape[0]:
            events[count, 0], events[count, 1] = t, j
            events[count, 2] = 0 if links[SWITCH, j] < 0 else (1 if w[at.mode + j] == STUCK else 2)
            count += 1
    return count


@inner
def march(at, links, w, t, target, h, rtol, events, count):
    """Integrate to ``target`` with the input held; returns (status, time, next step, number of events)."""
    idle = 0
    for _ in range(MAX_STEPS):
        if target - t <= 1e-14 * abs(target):
            return OK, target, h, count
        step = min(h, target - t)
        if step <= 1e-15 * max(abs(t), abs(target)):
            return DIVERGED, t, h, count
        norm = _try_step(at, links, w, step, rtol)
        wanted = _new_step(step, norm, 5.0)
        if norm > 1.0 and (norm == np.inf or step > 1e-12 * max(abs(t), 1e-3)):
            h = wanted
            continue
        h = max(h, wanted) if step < h else wanted
        taken, passed = _shorten(at, links, w, step, rtol)
        idle = idle + 1 if taken <= 1e-13 * max(abs(t), 1e-3) else 0
        t = target if taken == target - t else t + taken
        if not _accept(w, at.x, at.z, at.peak, at.n):
            return DIVERGED, t, h, count
        if idle > 200:
            return CHATTER, t, h, count
        if passed:
            _resolve(at, links, w)
            count = _note(at, links, w, t, events, count)
            _state_of(at, links, w)
        _copy(w, at.f if passed else at.K + 6 * at.n, at.K, at.n)
    return TOO_STIFF, t, h, count


@compiled
def run_exact(at, links, times, breaks, inputs, x0, p, rtol, X, Y, events):
    """Integrate with set-valued signs; inputs (K, m) hold from breaks (K,) on; states to X (T, n), outputs to Y.

    ``events`` (E, 3) takes time, surface and kind (0 crossed, 1 stuck, 2 slips). Returns (status, time, events).
    """
    w = prepared(at, p)
    put(at, w, x0)
    for j in range(at.q):
        w[at.s + j], w[at.mode + j] = 1.0, SIGNED
    t, h, count, next_break, status = times[0], np.inf, 0, 0, OK
    for sample in range(times.size):
        while True:
            fresh = sample == 0
            while next_break < breaks.size and breaks[next_break] <= t:
                hold(at, w, inputs[next_break])
                next_break += 1
                fresh = True
            if fresh:
                begin(at, links, w, sample == 0)
            target = times[sample]
            if next_break < breaks.size:
                target = min(target, breaks[next_break])
            if t >= target:
                break
            status, t, h, count = march(at, links, w, t, target, h, rtol, events, count)
            if status != OK:
                return status, t, count
        _copy(w, at.s, at.signs, at.q)
        _show(at, w, X[sample], Y[sample])
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
    return _plan(code, sizes, {**inputs, **results, **step, **pieces, **exponential})


@inner
def _rodas_matrix(at, w, h):
    """Factor 1/(gamma h) - J at x."""
    n = at.n
    _copy(w, at.x, at.z, n)
    call_within(at.whole, w, at.z, at.f)
    for i in range(n * n):
        w[at.matrix + i] = -w[at.jacobian + i]
    for i in range(n):
        w[at.matrix + i * n + i] += 1.0 / (_GAMMA * h)
    _factor(w, at.matrix, at.pivots, n)


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
        _substitute(w, at.matrix, at.pivots, right, n)
    for i in range(n):
        w[at.error + i] = w[at.U + 5 * n + i]
        w[at.z + i] += w[at.error + i]


@inner
def _flow(at, w, t, target, h, rtol):
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
        norm = _error_norm(w, at.error, at.x, at.z, at.peak, at.n, rtol)
        wanted = _new_step(step, norm, 4.0)
        if norm > 1.0 and (norm == np.inf or step > 1e-12 * max(abs(t), 1e-3)):
            h = wanted
            continue
        t = target if last else t + step
        h = max(h, wanted) if last else wanted
        if not _accept(w, at.x, at.z, at.peak, at.n):
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
            status, t, h = _flow(at, w, t, target, h, rtol)
            if status != OK:
                return status, t
        _show(at, w, X[sample], Y[sample])
    return OK, t


@compiled
def flow_many(at, points, inputs, constants, span, rtol):
    """Carry every point (T, n) under f_j over ``span`` seconds with its input (T, m) held; in place."""
    w = prepared(at, constants)
    for k in range(points.shape[0]):
        hold(at, w, inputs[k])
        put(at, w, points[k])
        status, _, _ = _flow(at, w, 0.0, span, span, rtol)
        for i in range(at.n):
            points[k, i] = w[at.x + i] if status == OK else np.nan


# --------------------------------------------------------------------------- piecewise linear


@inner
def _multiply(w, a, b, product, n):
    """Write the product of the matrices (n, n) at ``a`` and ``b``."""
    _small()
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
    return _accept(w, at.x, spare, at.peak, n)


@inner
def _linearize(at, w, half):
    """Write A, B and c at the present state, or where f_j arrives from there after ``half`` seconds."""
    _copy(w, at.x, at.kept, at.n)
    status = OK
    if half > 0.0:
        for i in range(at.n):
            w[at.peak + i] = abs(w[at.x + i])
        status, _, _ = _flow(at, w, 0.0, half, half, 1e-9)
    _copy(w, at.x, at.z, at.n)
    _copy(w, at.kept, at.x, at.n)
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
        _show(at, w, X[sample], Y[sample])
    return OK, t


__all__ = [
    "begin",
    "causal_slopes",
    "exact_plan",
    "flow_many",
    "hold",
    "march",
    "prepared",
    "put",
    "run_exact",
    "run_piecewise",
    "run_smooth",
    "slope_at_end",
    "smooth_plan",
]
