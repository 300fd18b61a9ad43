"""Jumps by one whole period: what wraps, and what overflows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

MIN_WRAP_STEP = 0.4
"""A wrap is a step of more than this share of the range."""
PERIOD_TOLERANCE = 0.02
"""By how much of the period steps may miss it, beside what neighbouring steps differ by."""
MIN_JUMPS_ALIKE = 0.95
"""Share of the jumps that must be of one period."""
MAX_ORDINARY_STEP = 0.4
"""Ordinary steps are below this share of the period, or nothing tells where it was passed."""


@dataclass(frozen=True)
class Wraps:
    """``count`` jumps of one ``period``; ``onward``: the motion goes on through them."""

    count: int
    period: float
    onward: bool


def wraps(values: Array, periods: tuple[float, ...] = ()) -> Wraps | None:
    """Return how values (T,) without gaps wrap; None where they do not.

    ``periods``: such as are known; another one must be told by two jumps at least, in a motion that goes on.
    """
    steps = np.diff(values)
    span = float(np.ptp(values))
    at = np.flatnonzero(np.abs(steps) > MIN_WRAP_STEP * span)
    if not at.size or at.size > 0.25 * steps.size:
        return None
    rest = np.delete(steps, at)
    usual = np.interp(at, np.delete(np.arange(steps.size), at), rest)
    beyond = np.abs(steps[at] - usual)
    usually = float(np.median(beyond))
    period = next((p for p in periods if abs(usually - p) < PERIOD_TOLERANCE * p), usually)
    allowed = PERIOD_TOLERANCE * period + 3.0 * float(np.percentile(np.abs(rest), 99))
    onward = float(np.mean(np.sign(steps[at]) * usual < 0.0)) > 0.8
    fits = float(np.mean(np.abs(beyond - period) < allowed)) >= MIN_JUMPS_ALIKE and span < 1.02 * period + allowed
    known = period in periods
    if not fits or float(np.percentile(np.abs(rest), 99)) > MAX_ORDINARY_STEP * period:
        return None
    if not known and (not onward or at.size < 2):
        return None
    return Wraps(int(at.size), period if known else float(np.mean(beyond[np.abs(beyond - period) < allowed])), onward)


def unwrapped(values: Array, period: float) -> Array:
    """Return values (T,) that go on where they wrapped; NaN is a missing sample, and stays one."""
    good, found = np.isfinite(values), values.copy()
    found[good] = np.unwrap(values[good], period=period)
    return np.asarray(found)


__all__ = ["Wraps", "unwrapped", "wraps"]
