"""The control law: one step of it, compiled, for simulation and for the node alike.

u = sat(feed + k_q e_q + k_v e_v + I + m s + f - sum_j k_j w_j), with e the errors of position and speed, I the integral
action, m a part of it that changes its sign with the reference's direction s, f what a design adds for the measured
speed, and w_j the feedback of the last periods, which a delay has kept from acting.
"""

# Numba infers the types in here; mypy cannot see through its decorators.
# mypy: allow-untyped-defs, allow-untyped-calls, disable-error-code="misc"

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from signlin_ros.engine.compiling import compiled, inner

Array = NDArray[np.float64]
POSITION, PERIOD_SLOT, LIMIT_SLOT, TOLERANCE_SLOT, TURNING_SLOT, WIDTH_SLOT, ADDED_SLOT, BY_STATE = range(8)
"""What stands where in the settings of a law."""
NO_ADDITION, CLIPPED, RAW, TANGENT_ADDED = range(4)
"""What is added for the measured speed: nothing; slope times reference speed, clipped to the level or not; level and
slope as a tangent at the measured speed."""
INTEGRAL, TURNING_MEMORY, PAST = 0, 1, 2
"""Where the memory of a law has the integral action, its turning part, and the feedback of past periods."""
K_Q, K_V, K_I, K_PAST = range(4)
"""Columns of the gains."""


@inner
def _at(table, column, k, share):
    return table[k, column] + share * (table[k + 1, column] - table[k, column])


@inner
def _place(grid, value):
    """Return the interval of the grid (G >= 2) that a value lies in, and its share of it; constant beyond the ends."""
    k = 0
    while k < grid.size - 2 and value >= grid[k + 1]:
        k += 1
    return k, min(1.0, max(0.0, (value - grid[k]) / (grid[k + 1] - grid[k])))


@inner
def _added(grid, tables, kind, reference, speed):
    """Return the input that a design adds for the measured speed, odd in it."""
    k, share = _place(grid, abs(speed))
    slope, level = _at(tables, 0, k, share), _at(tables, 1, k, share)
    if kind == CLIPPED:
        return min(level, max(-level, slope * reference))
    if kind == RAW:
        return slope * reference
    sign = 1.0 if speed > 0.0 else (-1.0 if speed < 0.0 else 0.0)
    return sign * level + slope * (reference - speed)


@inner
def step(grid, gains, tables, settings, memory, reference, measured, feed):
    """Return the input for one period; reference and measured (2,) are position and speed; the memory moves on."""
    position, limit = settings[POSITION], settings[LIMIT_SLOT]
    e_q, e_v = reference[0] - measured[0], reference[1] - measured[1]
    e = e_q if position != 0.0 else e_v
    k, share = _place(grid, abs(measured[1]) if settings[BY_STATE] != 0.0 else abs(reference[1]))
    toward = min(1.0, max(-1.0, reference[1] / settings[WIDTH_SLOT]))
    wanted = feed + _at(gains, K_V, k, share) * e_v + memory[INTEGRAL] + memory[TURNING_MEMORY] * toward
    if position != 0.0:
        wanted += _at(gains, K_Q, k, share) * e_q
    if settings[ADDED_SLOT] != NO_ADDITION:
        wanted += _added(grid, tables, settings[ADDED_SLOT], reference[1], measured[1])
    past = memory.size - PAST
    for j in range(past):
        wanted -= _at(gains, K_PAST + j, k, share) * memory[PAST + j]
    u = min(limit, max(-limit, wanted))
    resting = reference[1] == 0.0 and abs(e) <= settings[TOLERANCE_SLOT]
    if not resting and (wanted - u) * e <= 0.0:
        more = _at(gains, K_I, k, share) * e * settings[PERIOD_SLOT]
        memory[INTEGRAL] += more
        memory[TURNING_MEMORY] += settings[TURNING_SLOT] * more * toward
    for j in range(past - 1):
        memory[PAST + j] = memory[PAST + j + 1]
    if past > 0:
        memory[PAST + past - 1] = u - feed
    return u


@compiled
def _one_step(grid, gains, tables, settings, memory, reference, measured, feed):
    return step(grid, gains, tables, settings, memory, reference, measured, feed)


@dataclass(frozen=True)
class ControlLaw:
    """A control law in numbers.

    Parameters
    ----------
    grid : (G,) speeds, rising from 0, at which ``gains`` and ``tables`` are given.
    gains : (G, 3 + N) k_q, k_v, k_i and, for each of N past periods, oldest first, its gain.
    period, limit : s between updates; largest |u|.
    position : whether the position is tracked, else the speed.
    tolerance : error below which the integral action rests where the reference stands still.
    turning : share of the integral action that also goes to the part which turns with the reference's direction.
    width : speed below which that direction fades.
    tables : (G, 2) slope and level, ``added`` (`NO_ADDITION`, ...) for the measured speed.
    by_state : whether the gains go by the measured speed, else by that of the reference.
    """

    grid: Array
    gains: Array
    period: float
    limit: float
    position: bool
    tolerance: float = 0.0
    turning: float = 0.0
    width: float = 1e-3
    tables: Array = field(default_factory=lambda: np.zeros((2, 2)))
    added: int = NO_ADDITION
    by_state: bool = False

    @property
    def settings(self) -> Array:
        """The numbers of the law (8,) as the compiled step takes them."""
        found = (self.position, self.period, self.limit, self.tolerance, self.turning, self.width)
        return np.array([*found, self.added, self.by_state], dtype=float)

    @property
    def memory(self) -> Array:
        """An empty memory."""
        return np.zeros(PAST + self.gains.shape[1] - K_PAST)

    @property
    def parts(self) -> tuple[Array, Array, Array, Array]:
        """What the compiled step takes before the memory."""
        tables = self.tables if len(self.tables) == self.grid.size else np.zeros((self.grid.size, 2))
        return self.grid, np.ascontiguousarray(self.gains), tables, self.settings


class RunningLaw:
    """A law at work: its memory between steps."""

    def __init__(self, law: ControlLaw) -> None:
        self.law = law
        self._parts = law.parts
        self.memory = law.memory

    def reset(self) -> None:
        """Forget what has been."""
        self.memory[:] = 0.0

    def __call__(self, reference: Array, measured: Array, feed: float) -> float:
        """Return the input for the next period; reference and measured (2,) are position and speed."""
        return float(_one_step(*self._parts, self.memory, reference, measured, feed))


def constant(k_q: float, k_v: float, k_i: float, past: tuple[float, ...] = ()) -> tuple[Array, Array]:
    """Return a grid and gains that are the same at every speed."""
    row = np.array([k_q, k_v, k_i, *past])
    return np.array([0.0, 1.0]), np.vstack([row, row])
