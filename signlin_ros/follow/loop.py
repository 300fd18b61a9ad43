"""The compiled loop of the diagnosis: follow a record with a model that an observer corrects, with sensitivities.

Between samples the model is integrated with Runge and Kutta's method of order 4 in as many substeps as its
eigenvalues ask for; the crossing of the switching surface is located inside the substep, then the set-valued law
decides between sticking and slipping. At a sample the innovation e = y - h(x) corrects x by K e. The sensitivities
of e to the parameters follow the same path: trapezoidal rule between events, jump (saltation) at events
[Leine and Nijmeijer, Dynamics and Bifurcations of Non-Smooth Mechanical Systems, 2004, ch. 7].

What a model's machine code (`signlin_ros.follow.equations`) returns at (x, u, p, s), in this order:
F (n), g, dg/dt, dF/ds (n), d(dg/dt)/ds, then h (ny), dh/dx (ny, n), d(dg/dt)/dx (n), dF/dx (n, n), then, for
sensitivities, dF/dp (n, w), d(dg/dt)/dp (w), dg/dx (n), dh/dp (ny, w), where w >= np are the columns of a matrix with
one for each of np parameters and others of 0.
``code`` are the addresses of F and the surface alone, of everything, and of `signlin_ros.follow.steps`'s functions.
"""

# Numba infers the types in here; mypy cannot see through its decorators. What is literal (1, 0, True) is a type of its
# own, for which a function is compiled once more: hence np.int64(1).
# mypy: allow-untyped-defs, allow-untyped-calls, disable-error-code="misc,call-arg,unreachable"

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from signlin_ros.engine.compiling import call_among, compiled, copied, inner
from signlin_ros.follow.interval import MAX_DECAY_STEP, advance, fastest_rate, rate_ahead, split_rates
from signlin_ros.follow.kalman import averaged, fill_gains, spread
from signlin_ros.follow.slopes import differentiated, evaluated, keep, linearized, settle
from signlin_ros.follow.steps import LANES

Array = NDArray[np.float64]
MAX_SUBSTEPS = 20
"""Most substeps between two samples."""
MAX_STABLE_STEP = 0.8
"""Largest product of a substep and the fastest rate of the model, for so many substeps"""
FEW_SUBSTEPS = 4
"""and"""
STIFF_STEP = 2.0
"""of further substeps: what is so fast has come to rest within a sample (unless a Kalman filter watches it closely)."""
STABLE = 3.0
"""Times as fast as it is here, beyond which the rate that the motion leads to counts: the method is unstable there."""
MIN_EXACT_SUBSTEPS = 2
"""Least number of substeps in which what decays is integrated exactly, if these are fewer than others would be."""


@inner
def _next_look(t, now, end, lags, looked):
    """Return when before ``end`` a late channel next shows what the states are, for the sample that shows it."""
    for c in range(lags.shape[0]):
        k = looked[c]
        if k < t.size and lags[c, 0] + lags[c, 2] > -1.0 and t[k] - lags[c, 0] < end - 1e-12:
            end = max(now, t[k] - lags[c, 0])
    return end


@inner
def _look(t, now, x, out, S, lags, seen, seen_s, looked):
    """Note what late channels show of the states x ``now``, of slopes ``out``: the state and its rate ``seen``
    (T, ny, 2) and its sensitivities ``seen_s`` (T, ny, np), in the rows of the samples that will show them.
    """
    for c in range(lags.shape[0]):
        i = int(lags[c, 1])
        while looked[c] < t.size and lags[c, 0] + lags[c, 2] > -1.0 and t[looked[c]] - lags[c, 0] <= now + 1e-12:
            seen[looked[c], c, 0] = x[i]
            seen[looked[c], c, 1] = out[i]
            if seen_s.shape[0]:
                copied(S[i, : seen_s.shape[2]], 0, seen_s[looked[c], c])
            looked[c] += 1


@inner
def _later_start(lags, out, S):
    """Let states that are first shown as they were before the record start later by the lag; ``out``: their slope."""
    for c in range(lags.shape[0]):
        if lags[c, 2] >= 0.0 and lags[c, 3] > 0.0:
            i = int(lags[c, 1])
            S[i, int(lags[c, 2])] += out[i]


@inner
def _any(values, count):
    """Tell whether any of the first so many differs from 0."""
    found = False
    for i in range(count):
        found = found or values[i] != 0.0
    return found


NONE_LATE = np.zeros((0, 4))
"""``lags`` of channels that are all seen in time."""


def follow(
    code: tuple[int, ...],
    sizes: tuple[int, ...],
    t: Array,
    u: Array,
    y: Array,
    gains: Array,
    x0: Array,
    p: Array,
    scale: Array,
    acts: Array,
    ringing: float,
    lags: Array,
    belief: Array,
    noise: Array,
    E: Array,
    D: Array,
    X: Array,
) -> int:
    """Follow a record: fill the innovations E (T, ny) and, if D (T, ny, w) is not empty, their derivatives.

    ``code``: addresses of F and the surface alone, of everything, and of what `signlin_ros.follow.steps` writes: the
    fastest rate, a step free of the surface, one stuck to it, one of sensitivities, what is seen of these and how they
    are corrected, everything but derivatives to parameters, a step of a covariance. ``sizes``: n,
    m, ny, np (sensitivities), index of the delay among them (-1), switched, index of the state that is the switching
    surface (-1), whether derivatives are wanted, least number of substeps between samples, index of the first state
    that is an effect's own, where dF/dx begins, columns w for sensitivities.
    ``u`` (K, m) held from ``acts`` (K,) s, which do not decrease, until the next row acts; ``ringing``: the largest
    product of
    a substep and the fastest rate of the states that ring, ``y`` (T, ny) with NaN for missing, ``gains`` (G, n, ny):
    those of the first G samples, the last one for all others. X (T, n) gets the state before the correction, if it is
    not empty. ``lags`` (ny, 4): by how much every channel is seen late in s, the state that it shows, the index of its
    lag among the sensitivities (-1), and whether it says nothing (nan) as long as it shows what was before the record;
    empty if none is late. ``belief`` (3, n): variances that a step adds to the
    states and that they start with, from which an extended Kalman filter corrects them all, with the variances
    ``noise`` (ny), but nowhere where ``gains`` are 0; 2 in its last row: an own position that makes contact, over whose
    uncertainty derivatives are averaged. (3, 0): all are corrected by ``gains``.
    Returns how many samples were followed before the run left all bounds.
    """
    # Numba compiles one loop for arrays that may be written to and another for those that may not: these may not.
    views = [array.view() for array in (t, u, y)]
    for view in views:
        view.flags.writeable = False
    rest = (gains, x0, p, scale, acts, ringing, lags, belief, noise, E, D, X)
    return int(_allocated(code, sizes, *views, *rest))


@compiled
def _allocated(code, sizes, t, u, y, gains, x0, p, scale, acts, ringing, lags, belief, noise, E, D, X):
    """Make the arrays that `_follow` works in, and do it."""
    n, m, ny, count, at, width = sizes[0], sizes[1], sizes[2], sizes[3], sizes[10], sizes[11]
    n_out = at + n * n + n * width + width + n + ny * width
    late, kept = t.size if lags.shape[0] > 0 else 0, t.size if lags.shape[0] > 0 and sizes[7] != 0 else 0
    ratio = np.zeros((n, n))
    for i in range(n):
        for j in range(n):
            ratio[i, j] = scale[j] / scale[i]
    z, x = np.zeros(n + m + p.size + 1), x0.copy()
    copied(u, 0, z[n : n + m])
    copied(p, 0, z[n + m : n + m + p.size])
    work = (np.zeros(n * n + n * width), np.zeros((4, n)), np.zeros(n), np.zeros((2, n)), np.zeros((n, n)))
    past = (np.zeros((late, ny, 2)), np.zeros((kept, ny, count)), np.zeros(ny, np.int64))
    P = np.zeros((n, -(-n // LANES) * LANES))
    for i in range(n if belief.shape[1] else 0):
        P[i, i] = belief[1, i]
    kalman = (P, np.zeros((n, ny)), np.zeros(n * n), np.zeros(n * n))
    memory = (z, np.zeros(n_out), x, np.zeros((n, width)), work, past, kalman, ratio, np.zeros((6, n)), np.zeros(2))
    return _follow(code, sizes, t, u, y, gains, scale, acts, ringing, lags, belief, noise, E, D, X, memory)


@inner
def _follow(code, sizes, t, u, y, gains, scale, acts, ringing, lags, belief, noise, E, D, X, memory):
    """Do what `follow` does, in the arrays of ``memory``."""
    n, m, ny, count, i_delay = sizes[0], sizes[1], sizes[2], sizes[3], sizes[4]
    with_s, total, rows = sizes[7] != 0, t.size, acts.size
    at = sizes[10]
    at_h = 2 * n + 3
    at_hx = at_h + ny
    z, out, x, S, work, (seen, seen_s, looked), (P, K, first, mean), ratio, W, fastest = memory
    head, kept, before, step = code[0], work[0], work[2], work[3]
    late, aware = lags.shape[0] > 0, belief.shape[1] > 0
    mode, s, active = np.int64(1), 1.0, 0
    for k in range(total):
        for i in range(n):
            z[i] = x[i]
        while active + 1 < rows and acts[active + 1] <= t[k]:
            if with_s and i_delay >= 0:
                evaluated(head, sizes, z, out, mode, s)
                for i in range(n):
                    before[i] = out[i]
            active += 1
            for i in range(m):
                z[n + i] = u[active, i]
            if with_s and i_delay >= 0:
                evaluated(head, sizes, z, out, mode, s)
                for i in range(n):
                    S[i, i_delay] += before[i] - out[i]
        mode, s = settle(code, sizes, z, out, mode, s, k == 0)
        if k == 0 and late and with_s:
            _later_start(lags, out, S)
        if X.shape[0]:
            copied(x, 0, X[k])
        gain = gains[min(k, gains.shape[0] - 1)]
        corrected, awake, complete = k < 0, False, True
        for i in range(n if aware else 0):
            for c in range(ny):
                awake = awake or gain[i, c] != 0.0
        if with_s:
            call_among(code[6], out, D[k], 0, S, step)
        for c in range(ny):
            E[k, c] = y[k, c] - out[at_h + c]
            delayed = late and lags[c, 0] + lags[c, 2] > -1.0
            if delayed and lags[c, 3] > 0.0 and t[k] - lags[c, 0] < t[0]:
                E[k, c] = np.nan
                for j in range(count if with_s else 0):
                    D[k, c, j] = 0.0
            complete = complete and E[k, c] == E[k, c]
            if delayed and k > 0 and E[k, c] == E[k, c]:
                i_state, i_lag = int(lags[c, 1]), int(lags[c, 2])
                slope = out[at_hx + c * n + i_state]
                E[k, c] += slope * (x[i_state] - seen[k, c, 0])
                if with_s:
                    for j in range(count):
                        D[k, c, j] += slope * (S[i_state, j] - seen_s[k, c, j])
                    if i_lag >= 0:
                        D[k, c, i_lag] += slope * seen[k, c, 1]
        if awake:
            fill_gains(out, at_hx, E[k], noise, P, K, before)
            gain = K
        for c in range(ny):
            if E[k, c] == E[k, c]:
                for i in range(n):
                    if gain[i, c] != 0.0:
                        corrected = True
                        x[i] += gain[i, c] * E[k, c]
                        if with_s and not complete:
                            for j in range(count):
                                S[i, j] += gain[i, c] * D[k, c, j]
        if with_s and complete and corrected:
            call_among(code[7], gain, D[k], 0, S, step)
        if k + 1 == total:
            break
        for i in range(n):
            z[i] = x[i]
        if corrected:
            mode, s = settle(code, sizes, z, out, mode, s, corrected)
        if late:
            evaluated(head, sizes, z, out, mode, s)
            _look(t, t[k], x, out, S, lags, seen, seen_s, looked)
        begin = t[k]
        while True:
            end, changes = t[k + 1], False
            if active + 1 < rows and acts[active + 1] < end - 1e-12:
                end, changes = acts[active + 1], True
            if late:
                looks = _next_look(t, begin, end, lags, looked)
                end, changes = looks, changes and looks == end
            if mode == 0 or late:
                linearized(code, sizes, z, out, mode, s)
            keep(sizes, out, kept)
            if awake and begin == t[k]:
                keep(sizes, out, first)
                if averaged(code, sizes, z, out, x, mode, s, belief, P, first):
                    evaluated(head, sizes, z, out, mode, s)
            span, decays = end - begin, False
            reach = span * fastest_rate(code[2], kept, ratio, fastest) / MAX_STABLE_STEP
            least = max(sizes[8], int(min(MAX_SUBSTEPS, np.ceil(span * np.sqrt(fastest[1]) / ringing))))
            if sizes[9] < n:
                ahead = span * rate_ahead(code, sizes, z, out, x, span, mode, s, work, ratio, fastest) / MAX_STABLE_STEP
                if ahead > STABLE * max(reach, 1.0):
                    reach = ahead
                else:
                    for i in range(sizes[9], n):
                        work[1][3, i] = 0.0
            wanted = np.ceil(
                reach
                if aware or reach < FEW_SUBSTEPS
                else FEW_SUBSTEPS + (reach - FEW_SUBSTEPS) * MAX_STABLE_STEP / STIFF_STEP
            )
            substeps = int(min(MAX_SUBSTEPS, max(least, wanted)))
            if wanted > (MAX_SUBSTEPS if aware else FEW_SUBSTEPS):
                rest = (
                    span
                    * split_rates(code, sizes, z, out, x, span, mode, s, work, ratio, fastest, MAX_DECAY_STEP, W)
                    / MAX_STABLE_STEP
                )
                decays = rest < max(least, wanted) - 1
                if decays and not _any(W[5], sizes[9]):
                    substeps = int(min(MAX_SUBSTEPS, max(MIN_EXACT_SUBSTEPS, least, np.ceil(rest))))
            if not decays:
                for i in range(n):
                    W[5, i] = 0.0
            mode, s = advance(code, sizes, z, out, x, span, substeps, mode, s, S, work, with_s, W, decays)
            for i in range(n):
                if not abs(x[i]) < 1e6 * scale[i]:
                    return k + 1
            if late:
                _look(t, end, x, out, S, lags, seen, seen_s, looked)
            if end == t[k + 1]:
                if awake:
                    for i in range(n):
                        z[i] = x[i]
                    if not with_s:
                        differentiated(code, sizes, z, out, mode, s)
                    keep(sizes, out, mean)
                    averaged(code, sizes, z, out, x, mode, s, belief, P, mean)
                    for i in range(n * n):
                        out[at + i] = mean[i]
                    spread(code[9], sizes, first, out, end - t[k], belief[0], P, step, W)
                break
            begin = end
            for i in range(n):
                z[i] = x[i]
                before[i] = out[i]
            if not changes:
                continue
            active += 1
            for i in range(m):
                z[n + i] = u[active, i]
            mode, s = settle(code, sizes, z, out, mode, s, begin == t[k])
            if with_s and i_delay >= 0:
                if mode == 0:
                    linearized(code, sizes, z, out, mode, s)
                for i in range(n):
                    S[i, i_delay] += before[i] - out[i]
    return total


__all__ = [
    "FEW_SUBSTEPS",
    "MAX_STABLE_STEP",
    "MAX_SUBSTEPS",
    "MIN_EXACT_SUBSTEPS",
    "NONE_LATE",
    "STIFF_STEP",
    "Array",
    "follow",
]
