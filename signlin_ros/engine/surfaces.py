"""Switching surfaces and the set-valued law on them: what sticks, what slips, and the motion that follows.

Sources: Acary and Brogliato, Numerical Methods for Nonsmooth Dynamical Systems, 2008; projected Gauss-Seidel: Cottle,
Pang and Stone, The Linear Complementarity Problem, 1992.
"""

# Numba infers the types in here; mypy cannot see through its decorators.
# mypy: allow-untyped-defs, allow-untyped-calls, disable-error-code="misc"

from __future__ import annotations

from signlin_ros.engine.compiling import call_within, inner
from signlin_ros.engine.parts import (
    copy,
    factor,
    substitute,
)

STUCK_SURFACE, SIGNED_SURFACE, FREE_SURFACE = 0.0, 1.0, 2.0
"""Modes of a surface: its sign is what keeps it there, is 1 or -1, or is 0 as long as nothing pushes."""
COORDINATE, SWITCH = 0, 1
"""Rows of ``links`` (2, q): which state a surface is, and which switch; -1 for none."""
BREAKAWAY = 1e-9
"""How far |s| may pass 1 before a stuck surface slips: keeps the acceleration of the first slip definite."""


@inner
def _stuck_state(at, links, w):
    """Evaluate with stuck signs at zero, then solve for them: dg/dt = 0 on every stuck surface; see `state_of`."""
    n, q, k = at.n, at.q, at.k
    call_within(at.whole, w, at.z, at.f)
    for j in range(q):
        row = links[SWITCH, j]
        if row < 0:
            continue
        held = w[at.mode + j] == STUCK_SURFACE
        w[at.right + row] = -w[at.rate + j] if held else 0.0
        for i in range(q):
            column = links[SWITCH, i]
            if column >= 0:
                both = held and w[at.mode + i] == STUCK_SURFACE
                alone = 1.0 if i == j else 0.0
                w[at.matrix + row * k + column] = w[at.coupling + row * k + column] if both else alone
    factor(w, at.matrix, at.pivots, k)
    substitute(w, at.matrix, at.pivots, at.right, k)
    for j in range(q):
        if w[at.mode + j] == STUCK_SURFACE:
            s = w[at.s + j] = w[at.right + links[SWITCH, j]]
            for i in range(n):
                w[at.f + i] += w[at.slope + i * k + links[SWITCH, j]] * s
            for i in range(q):
                if links[SWITCH, i] >= 0:
                    w[at.rate + i] += w[at.coupling + links[SWITCH, i] * k + links[SWITCH, j]] * s


@inner
def state_of(at, links, w):
    """Evaluate at z: F, g and dg/dt with the present signs and modes.

    Where something is stuck, all that the code returns is there, and F and the rates of switches hold the stuck signs,
    which go to ``s``. A
    coordinate that is stuck, or that nothing pushes, rests: its F is exactly 0.
    """
    stuck = False
    for j in range(at.q):
        w[at.signs + j] = w[at.s + j]
        if w[at.mode + j] == STUCK_SURFACE:
            w[at.signs + j] = 0.0
            stuck = True
    if stuck:
        _stuck_state(at, links, w)
    else:
        call_within(at.head, w, at.z, at.f)
    for j in range(at.q):
        if w[at.mode + j] != SIGNED_SURFACE and links[COORDINATE, j] >= 0:
            w[at.f + links[COORDINATE, j]] = 0.0


@inner
def _sides(at, links, w):
    """Mark in ``on`` what is on its surface (``reached``, stuck, or g = 0); the rest gets the sign of g."""
    for _ in range(2):
        copy(w, at.s, at.signs, at.q)
        call_within(at.whole, w, at.z, at.f)
        for j in range(at.q):
            g, rate = w[at.g + j], w[at.rate + j]
            on = w[at.reached + j] != 0.0 or w[at.mode + j] == STUCK_SURFACE or g == 0.0
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
def resolve(at, links, w):
    """Choose every sign and branch at the present point: what is off its surface follows g, what is on it sticks if
    the set-valued law allows it, else slips the way that it is pushed.
    """
    _sides(at, links, w)
    copy(w, at.s, at.signs, at.q)
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
            w[at.mode + j] = SIGNED_SURFACE
        elif row >= 0:
            holds = w[at.coupling + row * at.k + row] < 0.0 and abs(s) < 1.0
            w[at.mode + j] = STUCK_SURFACE if holds else (SIGNED_SURFACE if s != 0.0 else FREE_SURFACE)


@inner
def violated(at, w):
    """Tell whether the present point lies beyond what the signs and branches assume."""
    for j in range(at.q):
        if w[at.mode + j] == STUCK_SURFACE:
            if abs(w[at.s + j]) > 1.0 + BREAKAWAY:
                return True
        elif w[at.mode + j] == FREE_SURFACE:
            if w[at.rate + j] != 0.0:
                return True
        elif w[at.g + j] * w[at.s + j] < -w[at.g_tol + j]:
            return True
    return False


__all__ = [
    "BREAKAWAY",
    "COORDINATE",
    "FREE_SURFACE",
    "SIGNED_SURFACE",
    "STUCK_SURFACE",
    "SWITCH",
    "resolve",
    "state_of",
    "violated",
]
