"""A position that leaps once while the machine does not: a counter that was set anew."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from signlin_ros.checks.base import Check, values_of, with_channel
from signlin_ros.checks.finding import Finding
from signlin_ros.checks.look import MIN_SAMPLES, Look
from signlin_ros.noise import NORMAL_QUARTILE
from signlin_ros.records.clean import MIN_HOLE_STEPS
from signlin_ros.records.outliers import MAX_FEW_OUTLIERS, MIN_OUTLIER_DEVIATIONS, MIN_OUTLIER_STEPS, MIN_OVER_USUAL

Array = NDArray[np.float64]
Index = NDArray[np.intp]


SAMPLES_BEFORE_LEAP, MIN_SHORTFALL = 10, 0.5
"""Samples before a leap, and the part of their way by which they fall short if the position stood still instead."""


class Leap(Check):
    """A position leaps from one sample to the next, and goes on from there, while the velocity goes on as before: a
    drive was referenced, or a counter set anew or lost.

    Test: up to `MAX_FEW_OUTLIERS` changes of the position miss what the velocity makes of them by more than
    `MIN_OUTLIER_DEVIATIONS` robust standard deviations of all such misses, by `MIN_OVER_USUAL` times the next largest,
    and by `MIN_OUTLIER_STEPS` steps of the sensor; where samples are missing for long nothing is said. What has inertia
    does not leap. Cure: the position is continued, as if it had not been set.
    """

    name = "leap"
    needs_time = True

    def find(self, look: Look) -> Iterator[Finding]:
        """Yield the position."""
        q, v = look.position, look.velocity
        if q not in look.channels or v not in look.channels or look.t.size < 5 * MIN_SAMPLES:
            return
        at, sizes = _leaps(look)
        if not at.size:
            return
        when = ", ".join(f"{look.t[k]:.6g}" for k in at)
        by = ", ".join(f"{size:.4g}" for size in sizes)
        yield Finding(
            self.name,
            q,
            "note",
            f"the {q} leaps by {by} {look.unit(q)} at t = {when} s while the {v} goes on: it was set anew",
            cure="continue_position",
            remedy="it is continued",
            harmless=True,
            action=lambda record: with_channel(record, q, values_of(record, q) - _added(record.t, look.t[at], sizes)),
        )


def _leaps(look: Look) -> tuple[Index, Array]:
    """Return the samples (k,) to which the position leaps, and by how much (k,)."""
    there = np.flatnonzero(np.isfinite(look.of(look.position)) & np.isfinite(look.of(look.velocity)))
    t, q, v = look.t[there], look.of(look.position)[there], look.of(look.velocity)[there]
    nothing = np.zeros(0, dtype=np.intp), np.zeros(0)
    if t.size < 5 * MIN_SAMPLES:
        return nothing
    steps = np.diff(t)
    way = 0.5 * (v[1:] + v[:-1]) * steps
    missed = np.where(steps > MIN_HOLE_STEPS * np.median(steps), 0.0, np.diff(q) - way)
    sizes = np.abs(missed - np.median(missed))
    least = max(
        MIN_OUTLIER_DEVIATIONS * float(np.median(sizes)) / NORMAL_QUARTILE,
        MIN_OUTLIER_STEPS * look.quantum(look.position),
    )
    largest = np.argsort(-sizes, kind="stable")[: MAX_FEW_OUTLIERS + 1]
    alone = (sizes[largest[:-1]] > MIN_OVER_USUAL * sizes[largest[1:]]) & (sizes[largest[:-1]] > least)
    if not alone.any():
        return nothing
    found = np.sort(largest[: int(np.flatnonzero(alone)[-1]) + 1])
    if any(
        _stood(missed[max(k - SAMPLES_BEFORE_LEAP, 0) : k], way[max(k - SAMPLES_BEFORE_LEAP, 0) : k])
        for k in found.tolist()
    ):
        return nothing
    return there[found + 1], missed[found]


def _stood(missed: Array, way: Array) -> bool:
    """Tell whether a position stood still before it leapt, while the velocity led it a ``way`` (k,): a reading failed,
    and the leap makes up for that.
    """
    return bool(abs(missed.sum()) > MIN_SHORTFALL * abs(way.sum()) and missed.sum() * way.sum() < 0.0)


def _added(t: Array, at: Array, sizes: Array) -> Array:
    """Return what leaps of some sizes (k,) at the times (k,) have added by the stamps t (T,), in s."""
    return np.asarray(np.concatenate([[0.0], np.cumsum(sizes)])[np.searchsorted(at, t, side="right")])


__all__ = ["Leap"]
