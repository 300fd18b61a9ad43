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

from signlin_ros.engine.native import call, call_among, compiled, copied, inlined, inner
from signlin_ros.follow.steps import LANES

Array = NDArray[np.float64]

MOST = 20
"""Most substeps between two samples."""
REACH = 0.8
"""Largest product of a substep and the fastest rate of the model, for so many substeps"""
FEW = 4
"""and"""
STIFF = 2.0
"""of further substeps: what is so fast has come to rest within a sample (unless a Kalman filter watches it closely)."""
LEAST = 2
"""Least number of substeps in which what decays is integrated exactly, if these are fewer than others would be."""
LOST = 30.0
"""Product of a decay and the time between two samples from which on no other step would do for a plant's own state."""


@inner
def _slope(address, sizes, z, out, mode, s):
    """Evaluate F at z under the mode (0 stuck, else slipping with s); returns the sign in force (1: no surface)."""
    n, switched = sizes[0], sizes[5]
    if not switched:
        call(address, z, out)
        return 1.0
    last = z.size - 1
    if mode != 0:
        z[last] = s
        call(address, z, out)
        return s
    z[last] = 0.0
    call(address, z, out)
    stuck = -out[n + 1] / out[2 * n + 2]
    for i in range(n):
        out[i] += out[n + 2 + i] * stuck
    out[n + 1] = 0.0
    return stuck


@inner
def _rk4(code, sizes, z, x, k, h, mode, s, step):
    """Step from x (slope in k[0]) by h; the new state is left in z."""
    step[0, 0] = h
    if sizes[5] and mode != 0:
        z[z.size - 1] = s
    stuck = mode == 0 and sizes[5] != 0
    call_among(code[4] if stuck else code[3], z, x, 0, k, step)
    if mode == 0 and sizes[6] >= 0:
        z[sizes[6]] = 0.0


@inner
def _weigh(h, W):
    """Fill the weights W[:5] (5, n) of a step by h in which W[5] (n), rates of single states, is integrated exactly.

    h phi_1 and h phi_2 of half the step, h phi_1, h phi_2 and h phi_3 of all of it, where phi_0(y) = exp(y) and
    phi_k(y) = (phi_(k-1)(y) - 1/(k-1)!) / y; without decay h/2, h/2, h, h/2 and h/6.
    """
    for i in range(W.shape[1]):
        y = W[5, i] * h
        if y == 0.0:
            W[0, i], W[1, i], W[2, i], W[3, i], W[4, i] = 0.5 * h, 0.5 * h, h, 0.5 * h, h / 6.0
            continue
        half = np.exp(0.5 * y)
        first = 2.0 * (half - 1.0) / y
        W[0, i], W[1, i] = 0.5 * h * first, 2.0 * h * (first - 1.0) / y
        first = (half * half - 1.0) / y
        second = (first - 1.0) / y
        W[2, i], W[3, i], W[4, i] = h * first, h * second, h * (second - 0.5) / y


@inner
def _exponential(head, sizes, z, out, x, k, h, mode, s, W):
    """Step like `_rk4`, with the decay W[5] (n) of single states integrated exactly.

    The method of order 4 of [Krogstad 2005, doi:10.1016/j.jcp.2004.08.006]; without decay it is that of `_rk4`.
    """
    n = x.size
    _weigh(h, W)
    for stage in range(1, 4):
        for i in range(n):
            if stage == 1:
                z[i] = x[i] + W[0, i] * k[0, i]
            elif stage == 2:
                z[i] += W[1, i] * k[1, i]
            else:
                z[i] = x[i] + W[2, i] * k[0, i] + 2.0 * W[3, i] * k[2, i]
        _slope(head, sizes, z, out, mode, s)
        for i in range(n):
            k[stage, i] = out[i] - k[0, i] - W[5, i] * (z[i] - x[i])
    for i in range(n):
        among = (2.0 * W[3, i] - 4.0 * W[4, i]) * (k[1, i] + k[2, i])
        z[i] = x[i] + W[2, i] * k[0, i] + among + (4.0 * W[4, i] - W[3, i]) * k[3, i]
    if mode == 0 and sizes[6] >= 0:
        z[sizes[6]] = 0.0


@inner
def _crossing(g0, r0, g1, r1, h):
    """Return the fraction of a step at which the cubic through (g0, slope r0) and (g1, slope r1) is zero."""
    low, high, theta = 0.0, 1.0, g0 / (g0 - g1)
    for _ in range(12):
        a, b = theta, 1.0 - theta
        value = (1 + 2 * a) * b * b * g0 + a * b * b * h * r0 + a * a * (3 - 2 * a) * g1 - a * a * b * h * r1
        if value * g1 > 0.0:
            high = theta
        else:
            low = theta
        slope = 6 * a * b * (g1 - g0) + b * (1 - 3 * a) * h * r0 + a * (3 * a - 2) * h * r1
        new = theta - value / slope if slope != 0.0 else 0.5 * (low + high)
        if not low < new < high:
            new = 0.5 * (low + high)
        if abs(new - theta) < 1e-12:
            return new
        theta = new
    return theta


@inner
def _choose(head, sizes, z, out):
    """Decide at a surface by the set-valued law: returns (mode, s)."""
    n = sizes[0]
    z[z.size - 1] = 0.0
    call(head, z, out)
    rate, coupling = out[n + 1], out[2 * n + 2]
    if coupling < 0.0 and abs(rate) <= -coupling:
        return 0, 0.0
    return 1, (1.0 if rate > 0.0 else -1.0)


@inner
def _linearized(code, sizes, z, out, mode, s):
    """Leave in out the derivatives of F in force at z, and F itself."""
    stuck = _slope(code[1], sizes, z, out, mode, s)
    if mode == 0 and sizes[5]:
        z[z.size - 1] = stuck
        call(code[1], z, out)
        n, ny, at, width = sizes[0], sizes[2], sizes[10], sizes[11]
        at_x, at_p = 2 * n + 3 + ny + ny * n, at + n * n + n * width
        coupling = out[2 * n + 2]
        for i in range(n):
            gain = out[n + 2 + i] / coupling
            if gain != 0.0:
                for j in range(n):
                    out[at + i * n + j] -= gain * out[at_x + j]
                for j in range(width):
                    out[at + n * n + i * width + j] -= gain * out[at_p + j]
        out[n + 1] = 0.0
    return stuck


@inner
def _led(code, sizes, z, out, mode, s):
    """Leave in out dF/dx in force at z, and F itself, but not always the derivatives to parameters."""
    if mode == 0 and sizes[5]:
        _linearized(code, sizes, z, out, mode, s)
    else:
        _slope(code[8], sizes, z, out, mode, s)


@inner
def _kept(sizes, out, kept):
    """Copy the derivatives of F (n, n) and (n, w) from out."""
    copied(out, sizes[10], kept)


@inner
def _carry(address, sizes, kept, out, h, S, step, W):
    """Carry the sensitivities S (n, w) over h by the trapezoidal rule; in place.

    Those of states with rates W[5] of their own by Euler's implicit rule: within h they have come to rest.
    """
    for i in range(sizes[0]):
        step[0, i] = 0.0 if W[5, i] != 0.0 else 0.5 * h
        step[1, i] = h - step[0, i]
    call_among(address, kept, out, sizes[10], S, step)


@inner
def _jump(sizes, out, before, S):
    """Saltation: out holds F after the event, ``before`` F before it; dt* = -(dg/dx S) / (dg/dt before)."""
    n, count, width = sizes[0], sizes[3], sizes[11]
    at_g = sizes[10] + n * n + n * width + width
    rate = 0.0
    for i in range(n):
        rate += out[at_g + i] * before[i]
    if rate == 0.0:
        return
    for c in range(count):
        shift = 0.0
        for i in range(n):
            shift -= out[at_g + i] * S[i, c]
        shift /= rate
        for i in range(n):
            S[i, c] += (before[i] - out[i]) * shift


@inner
def _fastest(address, J, ratio, fastest):
    """Estimate the fastest rate of J (n, n) in scaled coordinates: sqrt of the norm of its square.

    ``ratio`` (n, n): scales of the columns over those of the rows. ``fastest`` (2) gets the squares of this one and of
    that of the states that ring.
    """
    call_among(address, J, ratio, 0, fastest, fastest)
    return np.sqrt(fastest[0])


@inner
def _left(address, source, at, W, ratio, M, fastest):
    """Estimate the fastest rate of J (n, n), which stands in ``source`` from ``at`` on, without the decay W[5] (n) of
    single states.
    """
    n = W.shape[1]
    for i in range(n):
        for j in range(n):
            M[i, j] = source[at + i * n + j]
        M[i, i] -= W[5, i]
    return _fastest(address, M, ratio, fastest)


@inner
def _split(code, sizes, z, out, x, span, mode, s, work, ratio, fastest, least, W):
    """Fill W[5] (n) with the rates of the states that come to rest within ``span`` seconds by themselves: the effects'
    own ones, and those of the plant that decay by e^-least at least.

    Returns the fastest of all other rates that J has, at x and where the motion leads: what decays there otherwise than
    here counts among them. ``work`` and ``out`` hold what belongs to x, before and (but for derivatives in ``out``)
    after.
    """
    kept, k, M, n, decays = work[0], work[1], work[4], x.size, False
    for i in range(n):
        rate = kept[i * n + i]
        W[5, i] = rate if rate * span < (-1.0 if i >= sizes[9] else -least) else 0.0
        decays = decays or W[5, i] != 0.0
    if not decays:
        return np.inf
    rest = _left(code[2], kept, np.int64(0), W, ratio, M, fastest)
    _weigh(span, W)
    k[1, 0], k[2, 0] = out[n], out[n + 1]
    for i in range(n):
        k[0, i] = out[i]
        z[i] = x[i] + W[2, i] * out[i]
    _linearized(code, sizes, z, out, mode, s)
    rest = max(rest, _left(code[2], out, sizes[10], W, ratio, M, fastest))
    out[n], out[n + 1] = k[1, 0], k[2, 0]
    for i in range(n):
        z[i], out[i] = x[i], k[0, i]
    return rest


@inlined
def _advance(code, sizes, z, out, x, span, count, mode, s, S, work, with_s, W, decays):
    """Integrate x over ``span`` seconds in ``count`` substeps with the input held; returns (mode, s).

    ``out`` must hold what belongs to x (and ``work`` the derivatives there, if ``with_s``). W[5] (n): rates of single
    states that are integrated exactly, if anything ``decays``.
    """
    n, switched, coordinate, head = sizes[0], sizes[5], sizes[6], code[0]
    kept, k, before, step, _ = work
    left, part, events = span, span / count, 0
    while left > 1e-13 * span:
        h = left if left < 1.5 * part else part
        g0, r0, s0 = out[n], out[n + 1], s
        for i in range(n):
            k[0, i] = out[i]
        if switched and mode == 0:
            s0 = _slope(head, sizes, z, out, mode, s)
        if decays:
            _exponential(head, sizes, z, out, x, k, h, mode, s, W)
        else:
            _rk4(code, sizes, z, x, k, h, mode, s, step)
        whole = with_s and (mode != 0 or not switched)
        s1 = _slope(code[1] if whole else head, sizes, z, out, mode, s)
        event = False
        if switched and events < 50:
            theta = 2.0
            if mode != 0:
                if out[n] * s < 0.0:
                    theta = _crossing(g0, r0, out[n], out[n + 1], h) if g0 * s > 0.0 else 1.0
            elif abs(s1) > 1.0:
                theta = 0.0 if abs(s0) >= 1.0 else min(1.0, max(0.0, (1.0 - abs(s0)) / max(abs(s1) - abs(s0), 1e-300)))
            if theta <= 1.0:
                event = True
                events += 1
                h *= theta
                if decays:
                    _exponential(head, sizes, z, out, x, k, h, mode, s, W)
                else:
                    _rk4(code, sizes, z, x, k, h, mode, s, step)
                if mode != 0:
                    _slope(head, sizes, z, out, mode, s)
                    if out[n + 1] != 0.0:
                        shift = -out[n] / out[n + 1]
                        if abs(shift) < 0.1 * part:
                            for i in range(n):
                                z[i] += shift * out[i]
                            h += shift
                    if coordinate >= 0:
                        z[coordinate] = 0.0
        if with_s:
            if event or not whole:
                _linearized(code, sizes, z, out, mode, s)
            _carry(code[5], sizes, kept, out, h, S, step, W)
        elif event:
            _slope(head, sizes, z, out, mode, s)
        left -= h
        for i in range(n):
            x[i] = z[i]
        if event:
            if mode == 0:
                mode, s = np.int64(1), (1.0 if s1 > 0.0 else -1.0)
                if with_s:
                    _linearized(code, sizes, z, out, mode, s)
                else:
                    _slope(head, sizes, z, out, mode, s)
            else:
                for i in range(n):
                    before[i] = out[i]
                mode, s = _choose(head, sizes, z, out)
                if with_s:
                    _linearized(code, sizes, z, out, mode, s)
                    _jump(sizes, out, before, S)
                else:
                    _slope(head, sizes, z, out, mode, s)
                if mode != 0:
                    out[n] = 0.0
        if with_s:
            _kept(sizes, out, kept)
        if not np.abs(x[0]) < 1e100:
            break
    return mode, s


@inlined
def _settle(code, sizes, z, out, mode, s, moved):
    """Choose mode and sign anew after the input or, if ``moved``, the state has jumped; returns (mode, s).

    Leaves in ``out`` all of z under that sign, or if stuck under the one that holds the motion.
    """
    head = code[0]
    if not sizes[5]:
        mode, s = 1, 1.0
    elif mode == 0 and not moved:
        mode, s = _choose(head, sizes, z, out)
    else:
        z[z.size - 1] = s
        call(code[1], z, out)
        g = out[sizes[0]]
        if g * s > 0.0:
            return 1, s
        if g == 0.0:
            mode, s = _choose(head, sizes, z, out)
        else:
            mode, s = 1, (1.0 if g > 0.0 else -1.0)
    z[z.size - 1] = s
    if mode == 0:
        z[z.size - 1] = _slope(head, sizes, z, out, mode, s)
    call(code[1], z, out)
    return mode, s


@inner
def _lagged(k, t, lag, i, past, past_s, row, with_s):
    """Return state ``i`` as it was ``lag`` before sample k and its rate; its sensitivities go to ``row``.

    ``past`` (T, 4, n): state and slope after the correction of every sample, and before that of the next one, between
    which a cubic is laid; ``past_s`` (T, 2, n, np) alike.
    """
    j = k - 1
    while j > 0 and t[j] > t[k] - lag:
        j -= 1
    h = t[j + 1] - t[j]
    a = min(1.0, max(0.0, (t[k] - lag - t[j]) / h))
    b = 1.0 - a
    x0, f0, x1, f1 = past[j, 0, i], past[j, 1, i], past[j, 2, i], past[j, 3, i]
    value = (1 + 2 * a) * b * b * x0 + a * b * b * h * f0 + a * a * (3 - 2 * a) * x1 - a * a * b * h * f1
    rate = 6 * a * b * (x1 - x0) / h + b * (1 - 3 * a) * f0 + a * (3 * a - 2) * f1
    if with_s:
        for c in range(row.size):
            row[c] = b * past_s[j, 0, i, c] + a * past_s[j, 1, i, c]
    return value, rate


@inner
def _later_start(lags, out, S):
    """Let states that are first shown as they were before the record start later by the lag; ``out``: their slope."""
    for c in range(lags.shape[0]):
        if lags[c, 2] >= 0.0 and lags[c, 3] > 0.0:
            i = int(lags[c, 1])
            S[i, int(lags[c, 2])] += out[i]


@inlined
def _aware(out, at, e, noise, P, K, row):
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
def _spread(address, sizes, first, last, h, process, P, step, W):
    """Carry the covariance P (n, w) over h by the trapezoidal rule, and add the variances ``process`` (n).

    ``first`` (n, n) and ``last`` hold dF/dx at both ends, the one alone and the other where ``out`` has it.
    """
    n = P.shape[0]
    for _ in range(2):
        _carry(address, sizes, first, last, h, P, step, W)
        for i in range(n):
            for j in range(i):
                P[i, j], P[j, i] = P[j, i], P[i, j]
    for i in range(n):
        for j in range(i):
            P[i, j] = P[j, i] = 0.5 * (P[i, j] + P[j, i])
        P[i, i] += process[i]


@inlined
def _averaged(code, sizes, z, out, x, mode, s, belief, P, mean):
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
                _led(code, sizes, z, out, mode, s)
                for i in range(n * n):
                    mean[i] += out[at + i] / 6.0
            z[own] = x[own]
    return moved


@inner
def _any(values, count):
    """Tell whether any of the first so many differs from 0."""
    found = False
    for i in range(count):
        found = found or values[i] != 0.0
    return found


@inner
def _copy_rows(source, to):
    """Copy a matrix."""
    for i in range(to.shape[0]):
        copied(source[i], 0, to[i])


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
    delay: float | Array,
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
    ``u`` (T, m) held from ``delay`` s after its sample on (before it, if negative; one number, or one for every row),
    ``ringing``: the largest product of
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
    late = np.full(t.size, delay) if np.ndim(delay) == 0 else np.array(delay[: t.size])  # type: ignore[index]
    views = [array.view() for array in (t, u, y)]
    for view in views:
        view.flags.writeable = False
    rest = (gains, x0, p, scale, late, ringing, lags, belief, noise, E, D, X)
    return int(_allocated(code, sizes, *views, *rest))


@compiled
def _allocated(code, sizes, t, u, y, gains, x0, p, scale, delay, ringing, lags, belief, noise, E, D, X):
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
    past = (np.zeros((late, 4, n)), np.zeros((kept, 2, n, count)), np.zeros(count))
    P = np.zeros((n, -(-n // LANES) * LANES))
    for i in range(n if belief.shape[1] else 0):
        P[i, i] = belief[1, i]
    kalman = (P, np.zeros((n, ny)), np.zeros(n * n), np.zeros(n * n))
    memory = (z, np.zeros(n_out), x, np.zeros((n, width)), work, past, kalman, ratio, np.zeros((6, n)), np.zeros(2))
    return _follow(code, sizes, t, u, y, gains, scale, delay, ringing, lags, belief, noise, E, D, X, memory)


@inner
def _follow(code, sizes, t, u, y, gains, scale, delay, ringing, lags, belief, noise, E, D, X, memory):
    """Do what `follow` does, in the arrays of ``memory``."""
    n, m, ny, count, i_delay = sizes[0], sizes[1], sizes[2], sizes[3], sizes[4]
    with_s, total = sizes[7] != 0, t.size
    at = sizes[10]
    at_h = 2 * n + 3
    at_hx = at_h + ny
    z, out, x, S, work, (past, past_s, row), (P, K, first, mean), ratio, W, fastest = memory
    head, kept, before, step = code[0], work[0], work[2], work[3]
    late, aware = lags.shape[0] > 0, belief.shape[1] > 0
    mode, s, active = np.int64(1), 1.0, 0
    for k in range(total):
        for i in range(n):
            z[i] = x[i]
        while active + 1 < total and t[active + 1] + delay[active + 1] <= t[k]:
            if with_s and i_delay >= 0:
                _slope(head, sizes, z, out, mode, s)
                for i in range(n):
                    before[i] = out[i]
            active += 1
            for i in range(m):
                z[n + i] = u[active, i]
            if with_s and i_delay >= 0:
                _slope(head, sizes, z, out, mode, s)
                for i in range(n):
                    S[i, i_delay] += before[i] - out[i]
        mode, s = _settle(code, sizes, z, out, mode, s, k == 0)
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
                was, rate = _lagged(k, t, lags[c, 0], i_state, past, past_s, row, with_s)
                slope = out[at_hx + c * n + i_state]
                E[k, c] += slope * (x[i_state] - was)
                if with_s:
                    for j in range(count):
                        D[k, c, j] += slope * (S[i_state, j] - row[j])
                    if i_lag >= 0:
                        D[k, c, i_lag] += slope * rate
        if awake:
            _aware(out, at_hx, E[k], noise, P, K, before)
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
            mode, s = _settle(code, sizes, z, out, mode, s, corrected)
        if late:
            _slope(head, sizes, z, out, mode, s)
            copied(x, 0, past[k, 0])
            copied(out, 0, past[k, 1])
            if with_s:
                _copy_rows(S, past_s[k, 0])
        begin = t[k]
        while True:
            end = t[k + 1]
            if active + 1 < total and t[active + 1] + delay[active + 1] < end - 1e-12:
                end = t[active + 1] + delay[active + 1]
            if mode == 0 or late:
                _linearized(code, sizes, z, out, mode, s)
            _kept(sizes, out, kept)
            if awake and begin == t[k]:
                _kept(sizes, out, first)
                if _averaged(code, sizes, z, out, x, mode, s, belief, P, first):
                    _slope(head, sizes, z, out, mode, s)
            span, decays = end - begin, False
            reach = span * _fastest(code[2], kept, ratio, fastest) / REACH
            wanted = np.ceil(reach if aware or reach < FEW else FEW + (reach - FEW) * REACH / STIFF)
            least = max(sizes[8], int(min(MOST, np.ceil(span * np.sqrt(fastest[1]) / ringing))))
            substeps = int(min(MOST, max(least, wanted)))
            if wanted > FEW and not aware:
                rest = span * _split(code, sizes, z, out, x, span, mode, s, work, ratio, fastest, LOST, W) / REACH
                decays = rest < substeps - 1
                if decays and not _any(W[5], sizes[9]):
                    substeps = int(max(LEAST, least, np.ceil(rest)))
            if not decays:
                for i in range(n):
                    W[5, i] = 0.0
            mode, s = _advance(code, sizes, z, out, x, span, substeps, mode, s, S, work, with_s, W, decays)
            for i in range(n):
                if not abs(x[i]) < 1e6 * scale[i]:
                    return k + 1
            if end == t[k + 1]:
                if late:
                    copied(x, 0, past[k, 2])
                    copied(out, 0, past[k, 3])
                    if with_s:
                        _copy_rows(S, past_s[k, 1])
                if awake:
                    for i in range(n):
                        z[i] = x[i]
                    if not with_s:
                        _led(code, sizes, z, out, mode, s)
                    _kept(sizes, out, mean)
                    _averaged(code, sizes, z, out, x, mode, s, belief, P, mean)
                    for i in range(n * n):
                        out[at + i] = mean[i]
                    _spread(code[9], sizes, first, out, end - t[k], belief[0], P, step, W)
                break
            begin = end
            for i in range(n):
                z[i] = x[i]
                before[i] = out[i]
            active += 1
            for i in range(m):
                z[n + i] = u[active, i]
            mode, s = _settle(code, sizes, z, out, mode, s, begin == t[k])
            if with_s and i_delay >= 0:
                if mode == 0:
                    _linearized(code, sizes, z, out, mode, s)
                for i in range(n):
                    S[i, i_delay] += before[i] - out[i]
    return total


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
    _aware(H, np.int64(0), e, noise, P, K, row)
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


__all__ = ["NONE_LATE", "follow", "kalman_gains"]
