"""A commanded position that is taken for a force or a voltage."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from signlin_ros import units
from signlin_ros.checks.base import OfColumns
from signlin_ros.checks.finding import Finding
from signlin_ros.checks.look import MIN_SAMPLES, Look
from signlin_ros.records.grammar import split_unit
from signlin_ros.records.header import heading

Array = NDArray[np.float64]

FORCE = re.compile(
    r"forc|torq|effort|tau|moment|kraft|curr|strom|load|volt|spann|pwm|duty|\bu\b|^[fiuvm]$", re.IGNORECASE
)
"""What columns of forces, currents and voltages are called: these are believed longer."""
MAX_COMMAND_RESIDUAL, MAX_GAIN_ERROR, LATE = 0.05, 0.1, 0.5
"""What the input's own number, late by a lag and a delay of at most so many s, leaves of the position's square; by how
much the gain may differ from 1."""
MIN_COMMAND_CORRELATION = 0.7
"""Least correlation of both as they stand: a force on a mass leads to one near nothing, or to an opposite one."""
STRICT_PART = 0.2
"""Part of both limits for a column that is called a force."""
HELD, REST_SPEED_PART = 0.05, 0.5
"""Part of its spread that an input changes by at most while it is held; part of its usual speed that rests."""
MIN_HELD_SAMPLES = (6, 8, 10, 12, 16, 24)
"""Samples that it is held at least."""
MIN_HOLDS_OF_COMMAND, AGREE, COMMAND_GAINS = 8, 0.9, (0.5, 1.25)
"""So many holds, the correlation of the positions at their ends with the input, and the gains that count: friction
keeps small steps short."""
COMMAND_UNITS = {"": 1.0, "degrees": 57.29577951308232, "turns": 0.15915494309189535}
"""What a commanded angle is in, and how many of it a rad is."""


class PositionCommand(OfColumns):
    """The input is a position that was commanded, since nothing else was recorded of a servo: the position settles at
    the input's own number.

    Test: with a lag and a delay the input's number itself is the position to `MAX_COMMAND_RESIDUAL` of its square; or
    at the ends of steps that are held the position rests, goes with the input, and is most of it. A force that acts on
    a mass leads to neither; a spring of the stiffness 1 would, so that a model which has a spring is believed, and a
    column whose unit is that of a force or that is called one is believed unless its number is exactly the position's.
    Cure: none; the plant `servo` takes a position for its input.
    """

    name = "position_command"
    needs_time = True

    def find(self, look: Look) -> Iterator[Finding]:
        """Yield the input of one record."""
        yield from self._found([look])

    def find_each(self, looks: Sequence[Look]) -> list[list[Finding]]:
        """Return the findings of all records with the same columns together."""
        found = list(self._found(looks))
        return [list(found) for _ in looks]

    def _found(self, looks: Sequence[Look]) -> Iterator[Finding]:
        if not looks:
            return
        look = looks[0]
        model, q = look.model, look.position
        usable = [one for one in looks if q in one.channels and one.t.size >= MIN_SAMPLES]
        if not usable or model.plant.motion_is_imposed() or not look.record.inputs:
            return
        name = look.record.inputs[0]
        if units.conversion(model.units[name], model.units[q]) is not None or _restored(look) or _stated(look, name):
            return
        pairs = [(one, np.nan_to_num(one.of(name)), one.of(q)) for one in usable]
        strict = STRICT_PART if _called_a_force(look, name) else 1.0
        for unit, times in COMMAND_UNITS.items():
            scaled = [(one, u / times, x) for one, u, x in pairs]
            if _tracked(scaled, strict) or (strict == 1.0 and _settled(scaled)):
                yield self._finding(look, name, unit)
                return

    def _finding(self, look: Look, name: str, unit: str) -> Finding:
        q, inside = look.position, f" in {unit}" if unit else ""
        label = look.record.labels.get(name, name)
        sentence = (
            f"the {q} settles at the number of the {name} (column {label!r}){inside}: this is a commanded position, "
            f"not the {name}; what a {name} does cannot be told from it. Record what drives (the current, the torque), "
            "or model the servo as one: plant servo, input goal_position, where `signlin plants` lists it"
        )
        return Finding(self.name, name, "refuse", sentence, columns=True)


def _restored(look: Look) -> bool:
    """Tell whether the model itself pulls the position back, so that it follows a force."""
    base = look.base
    if base is None or look.position not in base.states or look.velocity not in base.states:
        return False
    return bool(base.A[base.states.index(look.velocity), base.states.index(look.position)] != 0.0)


def _stated(look: Look, name: str) -> bool:
    """Tell whether the column or the mapping states a unit of what the model's input is."""
    label = look.record.labels.get(name, "")
    unit = split_unit(label)[1] or heading(label).unit
    return bool(unit) and units.conversion(unit, look.model.units[name]) is not None


def _called_a_force(look: Look, name: str) -> bool:
    label = look.record.labels.get(name, name)
    return bool(FORCE.search(heading(label).name))


def _tracked(pairs: Sequence[tuple[Look, Array, Array]], strict: float) -> bool:
    """Tell whether the input's number (T,), late, is the position (T,)."""
    whole, left, both, own, given = 0.0, 0.0, 0.0, 0.0, 0.0
    for look, u, x in pairs:
        there = np.isfinite(x)
        if there.sum() < MIN_SAMPLES or np.ptp(u) == 0.0:
            continue
        followed = _best(u[there], x[there], look.step)
        size = float(np.sum((x[there] - x[there].mean()) ** 2))
        whole, left = whole + size, left + float(np.sum((x[there] - followed) ** 2))
        a, b = followed - followed.mean(), x[there] - x[there].mean()
        own, given = own + float(a @ a), given + float(a @ b)
        both += float(np.corrcoef(u[there], x[there])[0, 1]) * size if np.ptp(x[there]) > 0.0 else 0.0
    if whole == 0.0 or own == 0.0:
        return False
    return (
        both > MIN_COMMAND_CORRELATION * whole
        and left < strict * MAX_COMMAND_RESIDUAL * whole
        and abs(given / own - 1.0) < max(strict, 0.3) * MAX_GAIN_ERROR
    )


def _best(u: Array, x: Array, step: float) -> Array:
    """Return the input (T,) with the lag and delay after which it is nearest to the position (T,)."""
    best, least = u, np.inf
    most = max(min(LATE, step * u.size / 10.0), step)
    lags = [0.0, *np.geomspace(step / 2.0, most, 8).tolist()]
    for late in np.unique(np.round(np.linspace(0.0, most / step, 12)).astype(int)).tolist():
        moved = np.concatenate([np.full(late, u[0]), u[: u.size - late]])
        for lag in lags:
            a = 1.0 - np.exp(-step / lag) if lag else 1.0
            y = lfilter([a], [1.0, a - 1.0], moved, zi=[(1.0 - a) * x[0]])[0]
            left = float(np.sum((x - y) ** 2))
            best, least = (y, left) if left < least else (best, least)
    return np.asarray(best)


def _settled(pairs: Sequence[tuple[Look, Array, Array]]) -> bool:
    """Tell whether at the ends of held inputs the position rests, and is most of the input's number."""
    ends = [_ends(u, x) for _, u, x in pairs]
    every = np.concatenate(ends) if ends else np.zeros((0, 3))
    for long in MIN_HELD_SAMPLES[::-1]:
        of = every[every[:, 0] >= long]
        if len(of) < MIN_HOLDS_OF_COMMAND:
            continue
        u, x = of[:, 1], of[:, 2]
        if np.ptp(u) == 0.0 or np.ptp(x) == 0.0:
            return False
        gain = float(u @ x) / float(u @ u)
        return bool(np.corrcoef(u, x)[0, 1] > AGREE and COMMAND_GAINS[0] < gain < COMMAND_GAINS[1])
    return False


def _ends(u: Array, x: Array) -> Array:
    """Return for every held input of u (T,) at whose end x (T,) rests: how long it was held, and both (n, 3), in units
    of the input's spread.
    """
    spread = float(u.std())
    if spread == 0.0 or not np.isfinite(x).all():
        return np.zeros((0, 3))
    edges = np.concatenate([[0], np.flatnonzero(np.abs(np.diff(u)) > HELD * spread) + 1, [u.size]])
    speed = np.abs(np.gradient(x))
    usual = float(np.sqrt(np.mean(speed**2)))
    last, long = edges[1:] - 1, np.diff(edges)
    there = (edges[:-1] > 0) & (long >= MIN_HELD_SAMPLES[0]) & (speed[last] < REST_SPEED_PART * usual)
    return np.column_stack([long[there], u[last[there]] / spread, x[last[there]] / spread])


__all__ = ["PositionCommand"]
