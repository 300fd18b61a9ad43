"""Forces that repeat over the position: at which orders what is left of a record does so.

On a rotary axis orders are whole numbers a turn, of the joint or of the motor before its gear; elsewhere any. A wave
must have some periods inside the record, and pass slowly enough for the low-pass.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from signlin_ros.diagnosis.force.record import Piece

Array = NDArray[np.float64]

FINEST = 4000
"""Most orders that are looked at for each half period over the travel."""
QUANTILE, SHARE = 0.15, 0.02
"""A wave must pass the filter at this quantile of the speed, and this share of the largest."""


def orders(
    pieces: Sequence[Piece], position: str, velocity: str, whole: bool, gear: float, least: float
) -> list[Array]:
    """Return the orders in rad^-1 or m^-1 that records can show, at least ``least`` periods of each, as even rows (N,):
    of a joint, and of its motor.
    """
    travel = max(float(np.ptp(p.values[position])) for p in pieces)
    speed = np.concatenate([np.abs(p.values[velocity][p.kept]) for p in pieces])
    slow = float(np.quantile(speed, QUANTILE)) + SHARE * float(speed.max())
    low, high = least * 2 * np.pi / max(travel, 1e-300), 2 * np.pi * pieces[0].cutoff / max(slow, 1e-300)
    if not whole:
        step = 0.8 * np.pi / travel
        return [np.arange(low, min(high, FINEST * np.pi / travel), step)]
    turns = np.arange(1, FINEST + 1)
    rows = [turns, turns * gear] if gear != 1.0 else [turns]
    return [row[(row >= low) & (row <= high)].astype(float) for row in rows]


def strongest(
    pieces: Sequence[Piece], left: Sequence[Array], rows: Sequence[Array], position: str, velocity: str, most: int
) -> list[float]:
    """Return the orders at which what is left (K,) of the pieces repeats most, far enough apart to be others."""
    tried = np.concatenate(rows)
    if tried.size == 0:
        return []
    q = np.concatenate([p.values[position][p.kept] for p in pieces])
    v = np.concatenate([np.abs(p.values[velocity][p.kept]) for p in pieces])
    y = np.concatenate([e - e.mean() for e in left])
    limit = 2 * np.pi * pieces[0].cutoff / np.maximum(v, 1e-300)
    power = np.concatenate([_power(q, y, limit, row) for row in rows if row.size])
    apart = 3 * np.pi / max(float(np.ptp(q)), 1e-300)
    found: list[float] = []
    for j in np.argsort(-power):
        if all(abs(tried[j] - other) > apart for other in found):
            found.append(float(tried[j]))
        if len(found) == most:
            break
    return found


def _power(q: Array, y: Array, limit: Array, row: Array) -> Array:
    """Return how much y (K,) repeats over q (K,) at an even row of orders (N,), over samples with a higher limit."""
    from signlin_ros.diagnosis.force.elements import waves

    step = row[1] - row[0] if row.size > 1 else 1.0
    real, imaginary, count = waves(q, y, limit, row[0], step, row.size)
    return np.asarray(np.hypot(real, imaginary) / np.sqrt(count + 0.02 * y.size))


__all__ = ["orders", "strongest"]
