"""The compiled integrator with set-valued signs: Dormand and Prince's method, cut at every surface that it passes.

Source: Dormand and Prince 1980 with Shampine's interpolant (`signlin_ros.engine.tableau`).
"""

# Numba infers the types in here; mypy cannot see through its decorators.
# mypy: allow-untyped-defs, allow-untyped-calls, disable-error-code="misc"

from __future__ import annotations

import numpy as np

from signlin_ros.engine.compiling import compiled, inner
from signlin_ros.engine.parts import (
    CHATTER,
    DIVERGED,
    MAX_STEPS,
    OK,
    TOO_STIFF,
    accept,
    copy,
    error_norm,
    hold,
    new_step,
    planned,
    prepared,
    put,
    show,
)
from signlin_ros.engine.surfaces import (
    COORDINATE,
    FREE_SURFACE,
    SIGNED_SURFACE,
    STUCK_SURFACE,
    SWITCH,
    resolve,
    state_of,
    violated,
)
from signlin_ros.engine.tableau import DENSE_WEIGHTS as _P
from signlin_ros.engine.tableau import A as _A
from signlin_ros.engine.tableau import E as _E


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
    return planned(code, {"n": n, "m": m, "q": q, "k": k}, {**inputs, **results, **step, **surfaces, **solver})


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
        state_of(at, links, w)
        copy(w, at.f, at.K + stage * n, n)


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
    """Tell whether the point after the share ``theta`` of the step h is `violated`."""
    _interpolate(at, w, h, theta)
    state_of(at, links, w)
    return violated(at, w)


@inner
def _may_dip(at, w):
    """Tell whether a surface may be passed and passed back inside the step, judged from both ends."""
    for j in range(at.q):
        s = w[at.s + j]
        if w[at.mode + j] == STUCK_SURFACE:
            if max(abs(s), abs(w[at.s_before + j])) > 0.9:
                return True
        elif w[at.mode + j] == FREE_SURFACE or (w[at.rate_before + j] * s < 0.0 and w[at.rate + j] * s > 0.0):
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
    elif not violated(at, w):
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
    if mode == STUCK_SURFACE:
        return abs(s) >= 1.0
    if mode == FREE_SURFACE:
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
        if w[at.reached + j] != 0.0 and w[at.mode + j] == SIGNED_SURFACE:
            correction = -w[at.g + j] / w[at.rate + j]
            if abs(correction) < 0.5 * h:
                h += correction
                _stages(at, links, w, h)
            break
    for j in range(at.q):
        if w[at.reached + j] != 0.0 and w[at.mode + j] != STUCK_SURFACE and links[COORDINATE, j] >= 0:
            w[at.z + links[COORDINATE, j]] = 0.0
    return h


@inner
def begin(at, links, w, anew):
    """Set signs, branches and the slope for a new input; choose them afresh if something may have changed."""
    copy(w, at.x, at.z, at.n)
    for j in range(at.q):
        anew = anew or w[at.mode + j] != SIGNED_SURFACE
    if not anew:
        state_of(at, links, w)
        anew = violated(at, w)
    if anew:
        for j in range(at.q):
            w[at.reached + j] = 0.0
        resolve(at, links, w)
        state_of(at, links, w)
    copy(w, at.f, at.K, at.n)


@inner
def _try_step(at, links, w, h, rtol):
    """Take a step of h; returns its error norm, with the new state in z and the slopes in K."""
    n = at.n
    copy(w, at.rate, at.rate_before, at.q)
    copy(w, at.s, at.s_before, at.q)
    _stages(at, links, w, h)
    for i in range(n):
        total = 0.0
        for j in range(7):
            total += _E[j] * w[at.K + j * n + i]
        w[at.error + i] = h * total
    norm = error_norm(w, at.error, at.x, at.z, at.peak, n, rtol)
    if norm > 1.0:
        copy(w, at.rate_before, at.rate, at.q)
    return norm


@inner
def _shorten(at, links, w, h, rtol):
    """Cut an accepted step of h at the first surface that it passes; returns (step taken, whether one was)."""
    for j in range(at.q):
        w[at.g_tol + j] = max(w[at.g_tol + j], 1e-3 * rtol * abs(w[at.g + j]))
    copy(w, at.z, at.x_new, at.n)
    theta = _first_violation(at, links, w, h)
    if theta > 1.0:
        copy(w, at.x_new, at.z, at.n)
        return h, False
    return _land(at, links, w, theta * h), True


@inner
def _note(at, links, w, t, events, count):
    """Append the surfaces just reached to the events; returns how many there are."""
    for j in range(at.q):
        if w[at.reached + j] != 0.0 and count < events.shape[0]:
            events[count, 0], events[count, 1] = t, j
            events[count, 2] = 0 if links[SWITCH, j] < 0 else (1 if w[at.mode + j] == STUCK_SURFACE else 2)
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
        wanted = new_step(step, norm, 5.0)
        if norm > 1.0 and (norm == np.inf or step > 1e-12 * max(abs(t), 1e-3)):
            h = wanted
            continue
        h = max(h, wanted) if step < h else wanted
        taken, passed = _shorten(at, links, w, step, rtol)
        idle = idle + 1 if taken <= 1e-13 * max(abs(t), 1e-3) else 0
        t = target if taken == target - t else t + taken
        if not accept(w, at.x, at.z, at.peak, at.n):
            return DIVERGED, t, h, count
        if idle > 200:
            return CHATTER, t, h, count
        if passed:
            resolve(at, links, w)
            count = _note(at, links, w, t, events, count)
            state_of(at, links, w)
        copy(w, at.f if passed else at.K + 6 * at.n, at.K, at.n)
    return TOO_STIFF, t, h, count


@compiled
def run_exact(at, links, times, breaks, inputs, x0, p, rtol, X, Y, events):
    """Integrate with set-valued signs; inputs (K, m) hold from breaks (K,) on; states to X (T, n), outputs to Y.

    ``events`` (E, 3) takes time, surface and kind (0 crossed, 1 stuck, 2 slips). Returns (status, time, events).
    """
    w = prepared(at, p)
    put(at, w, x0)
    for j in range(at.q):
        w[at.s + j], w[at.mode + j] = 1.0, SIGNED_SURFACE
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
        copy(w, at.s, at.signs, at.q)
        show(at, w, X[sample], Y[sample])
    return OK, t, count


__all__ = ["begin", "exact_plan", "march", "run_exact"]
