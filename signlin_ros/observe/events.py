"""The filter's loop over events, compiled once per machine for every model.

An event is an input that begins to act, or one measured value. Several filters run side by side, which trust the model
to different degrees; each keeps how likely it has found what was measured lately [multiple-model estimation: Magill,
IEEE Trans. Automatic Control 10 (1965) 434].
"""

# Numba infers the types in here; mypy cannot see through its decorators.
# mypy: allow-untyped-defs, allow-untyped-calls, disable-error-code="misc"

from __future__ import annotations

import numpy as np

from signlin_ros.engine.compiling import call, compiled, inner

INPUT, QUERY = -1, -2
"""Kinds of events that measure nothing: an input begins to act; only time goes on. Others are numbers of channels."""
GATE = 20.0**2
"""Squared innovation, in its variance of the filter that trusts the model least, of a value that is not believed."""
STUBBORN = 3
"""So many values in a row that are not believed are believed after all."""
FORGETTING = 1.0
"""How long, in s, a filter's likelihood is remembered."""
VARIANCE_GROWTH = 100.0
"""By how much the variances grow where a measured state is set anew."""


@inner
def _carry(address, z, out, f, X, U, D, usual, trusts, doubt, u, acted, span, h_max):
    """Carry one filter over ``span`` seconds; z is prepared but for the state, the inputs, the step and the trust."""
    n, m = X.shape[1], u.size
    at_u = n * n + 3 * n
    at_h = at_u + 2 * m
    for i in range(m):
        z[at_u + i], z[at_u + m + i] = u[i], acted[i]
    count = max(1, int(np.ceil(span / h_max - 1e-9)))
    z[at_h], z[at_h + 1], z[at_h + 2] = span / count, trusts[f], doubt
    at_D = n + n * n
    for i in range(n):
        z[i], z[at_D + i], z[at_D + n + i] = X[f, i], D[f, i], usual[f, i]
        for j in range(n):
            z[n + i * n + j] = U[f, i, j]
    for _ in range(count):
        call(address, z, out)
        for i in range(n * n + 3 * n):
            z[i] = out[i]
        for i in range(m):
            z[at_u + m + i] = u[i]
    for i in range(n):
        X[f, i], D[f, i], usual[f, i] = z[i], z[at_D + i], z[at_D + n + i]
        for j in range(n):
            U[f, i, j] = z[n + i * n + j]


@inner
def _variance(U, D, f, i):
    """Return the variance of a state."""
    total = 0.0
    for k in range(D.shape[1]):
        total += U[f, i, k] * U[f, i, k] * D[f, k]
    return total


@inner
def _correct(f, X, U, D, i, e, R, b):
    """Correct one filter by the innovation e of its state i, measured with variance R; b (n,) is for work.

    [Bierman, Factorization Methods for Discrete Sequential Estimation, 1977, sec. V.3]
    """
    n = X.shape[1]
    for j in range(n):
        b[j] = D[f, j] * U[f, i, j]
    alpha = R
    for j in range(n):
        a = b[j] / D[f, j] if D[f, j] > 0.0 else 0.0
        before = alpha
        alpha += a * b[j]
        factor = -a / before
        D[f, j] *= before / alpha
        for k in range(j):
            old = U[f, k, j]
            U[f, k, j] = old + b[k] * factor
            b[k] += b[j] * old
    for j in range(n):
        X[f, j] += b[j] / alpha * e


@inner
def _set_anew(f, X, U, D, i, y, R, b):
    """Put a measured state where the sensor sees it, and doubt the others."""
    n = X.shape[1]
    for a in range(n):  # by rows: those below need no columns of what is above
        total = VARIANCE_GROWTH * _variance(U, D, f, a)
        for c in range(n):
            U[f, a, c] = 1.0 if a == c else 0.0
        b[a] = R if a == i else total
    for a in range(n):
        D[f, a] = b[a]
    X[f, i] = y


@inner
def _sound(X, D, f):
    """Tell whether a filter is finite, with variances that are not negative."""
    for i in range(X.shape[1]):
        bounded = abs(X[f, i]) < 1e150 and 0.0 <= D[f, i] < 1e250  # also False for NaN
        if not bounded:
            return False
    return True


@inner
def _copy_filter(source, f, X, U, D, usual, score):
    n = X.shape[1]
    for i in range(n):
        X[f, i], D[f, i], usual[f, i] = X[source, i], D[source, i], usual[source, i]
        for j in range(n):
            U[f, i, j] = U[source, i, j]
    score[f] = score[source]


@inner
def _best(score):
    best = 0
    for f in range(score.size):
        if score[f] > score[best]:
            best = f
    return best


@inner
def _measure(kind, y, X, U, D, score, states, R, missed, b):
    """Let all filters see a measured value; one that is far off is believed when it comes again."""
    i, r, last = states[kind], R[kind], X.shape[0] - 1
    wide = y - X[last, i]
    believed = wide * wide <= GATE * (_variance(U, D, last, i) + r)
    missed[kind] = 0 if believed else missed[kind] + 1
    for f in range(X.shape[0]):
        if believed:
            e, S = y - X[f, i], _variance(U, D, f, i) + r
            score[f] -= 0.5 * (np.log(S) + e * e / S)
            _correct(f, X, U, D, i, e, r, b)
        elif missed[kind] >= STUBBORN:
            _set_anew(f, X, U, D, i, y, r, b)
    if missed[kind] >= STUBBORN:
        missed[kind] = 0


@inner
def _advance(address, z, out, X, U, D, usual, score, trusts, doubt, u, acted, span, h_max):
    """Carry all filters over ``span`` seconds; returns whether the last of them is sound. Others start anew from it.

    ``acted`` (m,): the inputs before, then u.
    """
    count = X.shape[0]
    keep, last = np.exp(-span / FORGETTING), count - 1
    for f in range(count):
        _carry(address, z, out, f, X, U, D, usual, trusts, doubt, u, acted, span, h_max)
        score[f] *= keep
    for i in range(u.size):
        acted[i] = u[i]
    if not _sound(X, D, last):
        return False
    for f in range(last):
        if not _sound(X, D, f):
            _copy_filter(last, f, X, U, D, usual, score)
    return True


@compiled
def run_filters(
    address,
    times,
    kinds,
    values,
    clock,
    X,
    U,
    D,
    usual,
    score,
    trusts,
    doubt,
    u,
    acted,
    disturbed,
    p,
    states,
    R,
    missed,
    h_max,
    found,
):
    """Take events in the order of their times; returns how many were taken before all filters broke down.

    ``kinds`` (E,), ``values`` (E, max(m, 1)); X (F, n), U (F, n, n), D, usual (F, n), score (F,), u and acted (m,),
    clock (1,) and missed (C,) are what the filters know and are changed. ``states`` (C,) says which state a channel
    shows, R (C,) with which variance. ``found`` (E, 2 + 2 n) takes innovation, its variance, the state after the event
    and its variances, of the likeliest filter.
    """
    n, m = X.shape[1], u.size
    at_u = n * n + 3 * n
    z, out, b = np.zeros(at_u + 2 * m + 3 + n + p.size), np.zeros(at_u), np.zeros(n)
    for i in range(n):
        z[at_u + 2 * m + 3 + i] = disturbed[i]
    for i in range(p.size):
        z[at_u + 2 * m + 3 + n + i] = p[i]
    for event in range(times.size):
        span = times[event] - clock[0]
        if span > 0.0:
            if not _advance(address, z, out, X, U, D, usual, score, trusts, doubt, u, acted, span, h_max):
                return event
            clock[0] = times[event]
        kind = kinds[event]
        if kind == INPUT:
            for i in range(m):
                u[i] = values[event, i]
        elif kind >= 0:
            best = _best(score)
            found[event, 0] = values[event, 0] - X[best, states[kind]]
            found[event, 1] = _variance(U, D, best, states[kind]) + R[kind]
            _measure(kind, values[event, 0], X, U, D, score, states, R, missed, b)
        best = _best(score)
        for i in range(n):
            found[event, 2 + i], found[event, 2 + n + i] = X[best, i], _variance(U, D, best, i)
    return times.size


__all__ = ["INPUT", "QUERY", "run_filters"]
