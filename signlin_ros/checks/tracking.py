"""An input that is the number which a channel follows: the set point of a loop that was closed around the machine."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from signlin_ros import units
from signlin_ros.checks.look import MIN_SAMPLES, Look
from signlin_ros.records.grammar import split_unit
from signlin_ros.records.header import heading

Array = NDArray[np.float64]
Pairs = Sequence[tuple[Look, Array, Array]]
"""For each record: what is known of it, the input (T,) and the channel (T,)."""

FORCE = re.compile(
    r"forc|torq|effort|tau|moment|kraft|curr|strom|load|volt|spann|pwm|duty|amp|press|druck"
    r"|\bu\b|\bi_?(?:[qdabm]|cmd|meas|ref)?\b|\bp_?(?:[ab12]|k?pa|bar)\b|^[fvm]$",
    re.IGNORECASE,
)
"""What columns of forces, currents, pressures and voltages are called, also in a formula: these are believed longer."""
MAX_COMMAND_RESIDUAL, MAX_GAIN_ERROR, LATE = 0.05, 0.1, 0.5
"""What the input's own number, late by a lag and a delay of at most so many s, leaves of the position's square; by how
much the gain may differ from 1."""
GRID_DELAYS, FINE_GRID = 12, 4
"""Delays of a grid; of a finer one, delays and lags to either side of the best."""
MIN_COMMAND_CORRELATION = 0.7
"""Least correlation of both as they stand: a force on a mass leads to one near nothing, or to an opposite one."""
STRICT_PART = 0.2
"""Part of both limits for a column that is called a force."""
MAX_HELD_CHANGE, REST_SPEED_PART = 0.05, 0.5
"""Part of its spread that an input changes by at most while it is held; part of its usual speed that rests."""
MIN_HELD_SAMPLES = (6, 8, 10, 12, 16, 24)
"""Samples that it is held at least."""
MIN_HOLDS_OF_COMMAND, AGREE, COMMAND_GAINS = 8, 0.9, (0.5, 1.25)
"""So many holds, the correlation of the positions at their ends with the input, and the gains that count: friction
keeps small steps short."""
STRICTLY_AGREE = 0.98
"""That correlation where any gain counts."""


def stated(look: Look, name: str) -> bool:
    """Tell whether the column or the mapping states a unit of what the model's input is."""
    label = look.record.labels.get(name, "")
    unit = split_unit(label)[1] or heading(label).unit
    return bool(unit) and units.conversion(unit, look.model.units[name]) is not None


def called_a_force(look: Look, name: str) -> bool:
    """Tell whether an input's column is called one of what drives."""
    label = look.record.labels.get(name, name)
    return bool(FORCE.search(heading(label).name))


def strictness(look: Look, name: str) -> float:
    """Return the part of the limits for an input that may be what it is called."""
    return STRICT_PART if called_a_force(look, name) else 1.0


def tracks(pairs: Pairs, strict: float) -> bool:
    """Tell whether a channel follows the number of an input, or settles at it."""
    return _tracked(pairs, strict) or (strict == 1.0 and _settled(pairs))


def proportion(pairs: Pairs) -> float | None:
    """Return by what a channel is larger than the number of an input that it follows, or settles at, wherever each of
    both is zero; None where it does not. What follows is late: an input that is opposite to the channel of its own row
    was computed from it, as a proportional controller does.
    """
    ends = _settling([_ends(u, x) for _, u, x in pairs])
    if ends is not None and abs(_correlation(*ends)) > STRICTLY_AGREE:
        return float(np.polyfit(*ends, 1)[0])
    whole, left, slopes = 0.0, 0.0, []
    for look, u, x in pairs:
        there = np.isfinite(x)
        if there.sum() < MIN_SAMPLES or abs(_correlation(u[there], x[there])) < MIN_COMMAND_CORRELATION:
            return None
        given, shown = u[there] - u[there].mean(), x[there] - x[there].mean()
        gain = float(np.copysign(shown.std() / given.std(), given @ shown))
        followed, size = _best(gain * given, shown, look.step).values, float(shown @ shown)
        if not min(size, float(followed @ followed)) > 0.0:  # too small for a square
            return None
        if gain < 0.0 and np.array_equal(followed, gain * given):
            return None
        whole, left = whole + size, left + size * (1.0 - _correlation(followed, shown) ** 2)
        slopes.append(gain * float(followed @ shown) / float(followed @ followed))
    return float(np.mean(slopes)) if left < STRICT_PART * MAX_COMMAND_RESIDUAL * whole else None


def _correlation(u: Array, x: Array) -> float:
    return float(np.corrcoef(u, x)[0, 1]) if np.ptp(u) > 0.0 and np.ptp(x) > 0.0 else 0.0


def _tracked(pairs: Pairs, strict: float) -> bool:
    """Tell whether the input's number (T,), late, is the position (T,)."""
    whole, left, both, own, given = 0.0, 0.0, 0.0, 0.0, 0.0
    for look, u, x in pairs:
        there = np.isfinite(x)
        if there.sum() < MIN_SAMPLES or np.ptp(u) == 0.0:
            continue
        followed = _finest(u[there], x[there], look.step)
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


def _best(u: Array, x: Array, step: float) -> _Late:
    """Return the input (T,) with the lag and delay of a grid after which it is nearest to the position (T,)."""
    most = _latest(u.size, step)
    delays = np.unique(np.round(np.linspace(0.0, most / step, GRID_DELAYS)).astype(int))
    return _nearest(u, x, step, delays, np.concatenate([[0.0], np.geomspace(step / 2.0, most, 8)]), _Late(u))


def _finest(u: Array, x: Array, step: float) -> Array:
    """Return the nearest (T,) of a finer grid around that: a hundredth of the square is not left to a coarse one."""
    best = _best(u, x, step)
    apart = int(np.ceil(_latest(u.size, step) / step / (GRID_DELAYS - 1)))
    delays = np.arange(max(best.delay - apart, 0), best.delay + apart + 1)[:: -(-apart // FINE_GRID)]
    lags = best.lag * np.geomspace(0.5, 2.0, 2 * FINE_GRID + 1) if best.lag else np.array([0.0, step / 2.0])
    return _nearest(u, x, step, delays, lags, best).values


def _latest(samples: int, step: float) -> float:
    """Return the largest delay or lag in s that is looked at."""
    return max(min(LATE, step * samples / 10.0), step)


@dataclass(frozen=True, eq=False)
class _Late:
    """An input that is late by a number of samples and a lag in s, its values (T,), and what it leaves."""

    values: Array
    delay: int = 0
    lag: float = 0.0
    left: float = np.inf


def _nearest(u: Array, x: Array, step: float, delays: NDArray[np.intp], lags: Array, best: _Late) -> _Late:
    """Return the input (T,), late by some of these or the best as yet, that is nearest to the position (T,)."""
    for delay in delays.tolist():
        moved = np.concatenate([np.full(delay, u[0]), u[: u.size - delay]])
        for lag in lags.tolist():
            a = 1.0 - np.exp(-step / lag) if lag else 1.0
            y = lfilter([a], [1.0, a - 1.0], moved, zi=[(1.0 - a) * x[0]])[0]
            left = float(np.sum((x - y) ** 2))
            best = _Late(y, delay, lag, left) if left < best.left else best
    return best


def _settled(pairs: Pairs) -> bool:
    """Tell whether at the ends of held inputs the channel rests, and is most of the input's number."""
    ends = _settling([_ends(u, x) for _, u, x in pairs])
    if ends is None:
        return False
    u, x = ends
    return _correlation(u, x) > AGREE and COMMAND_GAINS[0] < float(u @ x) / float(u @ u) < COMMAND_GAINS[1]


def _settling(ends: Sequence[Array]) -> tuple[Array, Array] | None:
    """Return inputs and channel (n,) at the ends of the longest holds that there are enough of; None where there are
    not, by what `_ends` returns for each record.
    """
    every = np.concatenate(ends) if ends else np.zeros((0, 3))
    for long in MIN_HELD_SAMPLES[::-1]:
        of = every[every[:, 0] >= long]
        if len(of) >= MIN_HOLDS_OF_COMMAND:
            return of[:, 1], of[:, 2]
    return None


def _ends(u: Array, x: Array) -> Array:
    """Return for every held input of u (T,) at whose end x (T,) rests: how long it was held, and both (n, 3), in units
    of the input's spread.
    """
    spread = float(u.std())
    if spread == 0.0 or not np.isfinite(x).all():
        return np.zeros((0, 3))
    edges = np.concatenate([[0], np.flatnonzero(np.abs(np.diff(u)) > MAX_HELD_CHANGE * spread) + 1, [u.size]])
    speed = np.abs(np.gradient(x))
    usual = float(np.sqrt(np.mean(speed**2)))
    last, long = edges[1:] - 1, np.diff(edges)
    there = (edges[:-1] > 0) & (long >= MIN_HELD_SAMPLES[0]) & (speed[last] < REST_SPEED_PART * usual)
    return np.column_stack([long[there], u[last[there]] / spread, x[last[there]] / spread])


__all__ = ["called_a_force", "proportion", "stated", "strictness", "tracks"]
