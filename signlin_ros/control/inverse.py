"""The input that a reference takes: a model solved for its input along a motion that is given.

Friction, loads, the current and the states of hysteresis and bristles are carried along the *reference*, which has no
noise and no delay; what the machine does is left to the feedback. A switching sign is a straight line within ``width``
of its surface, so that a reference at rest asks for no friction.
"""

# Numba infers the types in here; mypy cannot see through its decorators.
# mypy: allow-untyped-defs, allow-untyped-calls, disable-error-code="misc"

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from signlin_ros.control.drive import Drive, resting
from signlin_ros.control.reference import Profile
from signlin_ros.engine.compiling import call_within, compiled, inner
from signlin_ros.engine.parts import prepared
from signlin_ros.engine.surfaces import SWITCH

Array = NDArray[np.float64]
MAX_STATE_STEP = 2e-3
"""Seconds; own states are carried in steps no longer than this."""
BRACKET_DOUBLINGS, BRACKET_HALVINGS = 40, 60
"""How often a bracket is widened, and narrowed, for the input that gives an acceleration."""


@inner
def _evaluate(at, links, w, width):
    """Evaluate F and the surfaces at z; signs from their surfaces, two deep."""
    for j in range(at.q):
        w[at.signs + j] = 0.0
    for _ in range(2 if at.q > 0 else 0):
        call_within(at.head, w, at.z, at.f)
        for j in range(at.q):
            g = w[at.g + j]
            if links[SWITCH, j] >= 0:
                w[at.signs + j] = min(1.0, max(-1.0, g / width))
            else:
                w[at.signs + j] = 1.0 if g > 0.0 else (-1.0 if g < 0.0 else 0.0)
    call_within(at.head, w, at.z, at.f)


@inner
def _left(at, links, w, slot, value, row, wanted, width):
    """Put a value into a slot of z; returns by how much F in ``row`` is above what is wanted."""
    w[at.z + slot] = value
    _evaluate(at, links, w, width)
    return w[at.f + row] - wanted


@inner
def _solve(at, links, w, slot, row, wanted, width):
    """Choose the slot such that F in ``row``, which rises with it, is as wanted: a bracket, then Illinois' rule."""
    a = w[at.z + slot]
    fa = _left(at, links, w, slot, a, row, wanted, width)
    step = -1.0 if fa > 0.0 else 1.0
    b, fb = a, fa
    for _ in range(BRACKET_DOUBLINGS):
        if fa == 0.0 or fa * fb < 0.0:
            break
        a, fa = b, fb
        b = a + step
        fb = _left(at, links, w, slot, b, row, wanted, width)
        step *= 2.0
    for _ in range(BRACKET_HALVINGS):
        if fb == 0.0 or fb == fa:
            break
        c = b - fb * (b - a) / (fb - fa)
        fc = _left(at, links, w, slot, c, row, wanted, width)
        done = abs(c - b) <= 1e-10 * (1.0 + abs(c))
        if fc * fb < 0.0:
            a, fa = b, fb
        else:
            fa *= 0.5
        b, fb = c, fc
        if done:
            break


@inner
def _carry(at, links, w, i, h, width):
    """Carry the own state i over h seconds: Euler's exponential method with the state's own slope."""
    z, rate = w[at.z + i], w[at.f + i]
    nudge = 1e-6 * max(abs(z), 1e-3)
    w[at.z + i] = z + nudge
    _evaluate(at, links, w, width)
    slope = min((w[at.f + i] - rate) / nudge * h, 1.0)
    growth = 1.0 + 0.5 * slope if abs(slope) < 1e-6 else (np.exp(slope) - 1.0) / slope
    w[at.z + i] = z + h * rate * growth
    _evaluate(at, links, w, width)


@compiled
def inverse(at, links, slots, own, x, motion, h, p, width, inputs):
    """Fill inputs (T,) with what gives the motion (T, 3): position, speed, acceleration every h seconds.

    ``x`` (n,) holds the current and the own states at the start, and in the end those there.
    """
    w = prepared(at, p)
    for i in range(at.n):
        w[at.z + i] = x[i]
    current, drive = slots[2], (slots[2] if slots[2] >= 0 else at.n)
    for k in range(motion.shape[0]):
        if slots[0] >= 0:
            w[at.z + slots[0]] = motion[k, 0]
        w[at.z + slots[1]] = motion[k, 1]
        before = w[at.z + drive]
        _solve(at, links, w, drive, slots[1], motion[k, 2], width)
        if current >= 0:
            _solve(at, links, w, at.n, current, (w[at.z + current] - before) / h, width)
        inputs[k] = w[at.z + at.n]
        for i in own:
            _carry(at, links, w, i, h, width)
    for i in range(at.n):
        x[i] = w[at.z + i]


@dataclass
class InverseModel:
    """A drive's model solved for its input along a motion; ``x`` (n,) are the states along it.

    ``width`` is the speed below which dry friction falls to zero along the reference.
    """

    drive: Drive
    width: float

    def __post_init__(self) -> None:
        self.reset()

    def reset(self, position: float = 0.0) -> None:
        """Begin anew at rest at a position; what hangs on the drive is there too."""
        self.x = resting(self.drive, position)

    def along(self, motion: Array, h: float) -> Array:
        """Return the inputs (T,) for a motion (T, 3), position, speed and acceleration every h seconds."""
        inputs, own = np.empty(len(motion)), np.array(self.drive.own, dtype=np.int64)
        points = np.ascontiguousarray(motion, dtype=float)
        inverse(*self.drive.plan, self.drive.slots, own, self.x, points, h, self.drive.model.p, self.width, inputs)
        return inputs

    def mean(self, motion: Array, h: float) -> float:
        """Return the mean input over a motion (T, 3): what to hold meanwhile."""
        return float(np.mean(self.along(motion, h)))


def feed_forward(drive: Drive, profile: Profile, period: float, count: int, width: float, lead: float) -> Array:
    """Return the inputs (count,) to hold for a period each, so that the drive follows the profile.

    ``lead`` in s is how much later an input acts: each is the mean over the time in which it acts.
    """
    parts = max(1, int(np.ceil(period / MAX_STATE_STEP)))
    h = period / parts
    times = lead + h * (np.arange(count * parts) + 0.5)
    inverse_model = InverseModel(drive, width)
    inverse_model.reset(profile.start)
    return np.asarray(inverse_model.along(np.column_stack(profile.at(times)), h).reshape(count, parts).mean(axis=1))
