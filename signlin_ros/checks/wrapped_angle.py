"""A position that begins anew after every turn, or when its counter is full."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from signlin_ros.checks.base import Check, values_of, with_channel, without_samples
from signlin_ros.checks.finding import Finding
from signlin_ros.checks.look import MIN_SAMPLES, Look
from signlin_ros.checks.wrapping import unwrapped, wraps
from signlin_ros.records import ModelData
from signlin_ros.records.outliers import wild

WHOLE_TURNS = (2.0 * math.pi, 360.0)
"""A whole turn, in rad and, where a column says nothing of its unit, in degrees."""


class WrappedAngle(Check):
    """The position jumps back by a whole turn, or by the range of its counter, while the motion goes on.

    Test: every step beyond 0.4 of the range misses one common period by no more than ordinary steps differ, and the
    values span no more than one period. A period that is not 2 pi needs two jumps against the motion: of a drive that
    does jump so, one way in two each, 19 jumps in 20 would have to agree in size by chance.
    Cure: unwrapped, which changes no value by anything but whole periods.
    """

    name = "wrapped_angle"

    def find(self, look: Look) -> Iterator[Finding]:
        """Yield the position that wraps."""
        name = look.position
        if name not in look.channels or look.finite(name)[1].size < MIN_SAMPLES:
            return
        periods = WHOLE_TURNS if look.unit(name) in ("rad", "m") else ()
        found, off = wraps(look.finite(name)[1], periods), np.zeros(look.t.size, dtype=np.bool_)
        if found is None:  # lost readings among them are no jumps
            off = wild(look.record, name)
            rest = look.of(name)[~off]
            found = wraps(rest[np.isfinite(rest)], periods) if off.any() else None
        if found is None:
            return
        turn = found.period in WHOLE_TURNS
        what = "a whole turn" if turn else f"{found.period:.6g} {look.unit(name)}, the range of a counter,"
        times = "once" if found.count == 1 else f"{found.count} times"
        beside = f", {int(off.sum())} samples far from their neighbours aside" if off.any() else ""
        yield Finding(
            self.name,
            name,
            "note",
            f"the {name} jumps by {what} {times} while the motion goes on{beside}",
            cure="unwrap",
            remedy="it is unwrapped" + (", and these are left out" if off.any() else ""),
            harmless=True,
            action=lambda record: _unwrapped(without_samples(look, (name,), off)(record), name, found.period),
        )


def _unwrapped(record: ModelData, name: str, period: float) -> ModelData:
    return with_channel(record, name, unwrapped(values_of(record, name), period))
