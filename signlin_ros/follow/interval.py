"""Between two samples or inputs: a model and its sensitivities carried on, compiled for `signlin_ros.follow.loop`.

The model is integrated with Runge and Kutta's method of order 4; the crossing of the switching surface is located
inside the substep, then the set-valued law decides between sticking and slipping. Sensitivities follow the same path:
trapezoidal rule between events, jump (saltation) at events [Leine and Nijmeijer, Dynamics and Bifurcations of
Non-Smooth Mechanical Systems, 2004, ch. 7].
"""

# Numba infers the types in here; mypy cannot see through its decorators. What is literal (1, 0, True) is a type of its
# own, for which a function is compiled once more: hence np.int64(1).
# mypy: allow-untyped-defs, allow-untyped-calls, disable-error-code="misc,call-arg,unreachable"

from __future__ import annotations

import numpy as np

from signlin_ros.engine.compiling import call_among, inlined, inner
from signlin_ros.follow.slopes import choose, evaluated, keep, linearized

MAX_DECAY_STEP = 30.0
"""Product of a decay and the time between two samples from which on no other step would do for a plant's own state."""


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
        evaluated(head, sizes, z, out, mode, s)
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
def carry_step(address, sizes, kept, out, h, S, step, W):
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
def fastest_rate(address, J, ratio, fastest):
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
    return fastest_rate(address, M, ratio, fastest)


@inner
def split_rates(code, sizes, z, out, x, span, mode, s, work, ratio, fastest, least, W):
    """Fill W[5] (n) with the rates of the states that come to rest within ``span`` seconds by themselves: the effects'
    own ones, and those of the plant that decay by e^-least at least.

    Returns the fastest of all other rates that J has, at x and where the motion leads: what decays there otherwise than
    here counts among them. ``work`` and ``out`` hold what belongs to x, before and (but for derivatives in ``out``)
    after.
    """
    kept, k, M, n, decays = work[0], work[1], work[4], x.size, False
    for i in range(n):
        rate = kept[i * n + i] if i < sizes[9] else min(kept[i * n + i], k[3, i])
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
    linearized(code, sizes, z, out, mode, s)
    rest = max(rest, _left(code[2], out, sizes[10], W, ratio, M, fastest))
    out[n], out[n + 1] = k[1, 0], k[2, 0]
    for i in range(n):
        z[i], out[i] = x[i], k[0, i]
    return rest


@inner
def rate_ahead(code, sizes, z, out, x, span, mode, s, work, ratio, fastest):
    """Return the fastest rate where the effects' own states are going, 0 where none of these moves by half of itself:
    a loop yields quicker than the state tells before it does so. ``work`` and ``out`` as of `split_rates`, which finds
    their own rates there in ``work``.
    """
    k, far = work[1], False
    for i in range(sizes[9], x.size):
        far = far or abs(out[i]) * span > 0.5 * abs(x[i])
        k[3, i] = 0.0
    if not far:
        return 0.0
    k[1, 0], k[2, 0], rings = out[x.size], out[x.size + 1], fastest[1]
    for i in range(x.size):
        k[0, i] = out[i]
        z[i] = x[i] + span * out[i]
    linearized(code, sizes, z, out, mode, s)
    rate = fastest_rate(code[2], out[sizes[10] : sizes[10] + x.size * x.size], ratio, fastest)
    for i in range(sizes[9], x.size):
        k[3, i] = out[sizes[10] + i * x.size + i]
    out[x.size], out[x.size + 1], fastest[1] = k[1, 0], k[2, 0], rings
    for i in range(x.size):
        z[i], out[i] = x[i], k[0, i]
    return rate


@inlined
def advance(code, sizes, z, out, x, span, count, mode, s, S, work, with_s, W, decays):
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
            s0 = evaluated(head, sizes, z, out, mode, s)
        if decays:
            _exponential(head, sizes, z, out, x, k, h, mode, s, W)
        else:
            _rk4(code, sizes, z, x, k, h, mode, s, step)
        whole = with_s and (mode != 0 or not switched)
        s1 = evaluated(code[1] if whole else head, sizes, z, out, mode, s)
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
                    evaluated(head, sizes, z, out, mode, s)
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
                linearized(code, sizes, z, out, mode, s)
            carry_step(code[5], sizes, kept, out, h, S, step, W)
        elif event:
            evaluated(head, sizes, z, out, mode, s)
        left -= h
        for i in range(n):
            x[i] = z[i]
        if event:
            if mode == 0:
                mode, s = np.int64(1), (1.0 if s1 > 0.0 else -1.0)
                if with_s:
                    linearized(code, sizes, z, out, mode, s)
                else:
                    evaluated(head, sizes, z, out, mode, s)
            else:
                for i in range(n):
                    before[i] = out[i]
                mode, s = choose(head, sizes, z, out)
                if with_s:
                    linearized(code, sizes, z, out, mode, s)
                    _jump(sizes, out, before, S)
                else:
                    evaluated(head, sizes, z, out, mode, s)
                if mode != 0:
                    out[n] = 0.0
        if with_s:
            keep(sizes, out, kept)
        if not np.abs(x[0]) < 1e100:
            break
    return mode, s


__all__ = ["MAX_DECAY_STEP", "advance", "carry_step", "fastest_rate", "rate_ahead", "split_rates"]
