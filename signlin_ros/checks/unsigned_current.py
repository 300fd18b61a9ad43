"""A measured current without a sign."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from signlin_ros.checks.base import Check, without_channel
from signlin_ros.checks.finding import Finding
from signlin_ros.checks.look import SIGNED_OVER_NOISE, Look

Array = NDArray[np.float64]

BOTH = 0.1
"""Least share of the time that what drives the current is positive, or negative."""
MIN_CORRELATION = 0.5
"""Least squared correlation of the current with the size of what drives it."""
MAX_SIGNED_PART = 0.5
"""The squared correlation with what drives it, as a part of that with its size, where a current has no sign."""


class UnsignedCurrent(Check):
    """A current is measured without its sign: a shunt in the supply of a bridge, a sensor that tells the size alone.

    Test: it never changes sign, what drives it (the voltage less the back-EMF, for as long as its winding takes) is of
    either sign for one tenth of the time, and it goes with the size of that, not with that. Cure: it is left out; a
    sign that the voltage asks for is no measurement.
    """

    name = "unsigned_current"
    needs_time = True
    needs_input = True

    def find(self, look: Look) -> Iterator[Finding]:
        """Yield the states and outputs that an input drives at once and that have no sign."""
        for name in look.channels:
            drive = _drive(look, name) if name not in (look.position, look.velocity) else None
            if drive is None:
                continue
            good = np.isfinite(look.of(name)) & np.isfinite(drive)
            x, e = look.of(name)[good], drive[good]
            least = SIGNED_OVER_NOISE * look.noise(name).sigma
            if x.size == 0 or np.ptp(x) <= 2.0 * least or not (x.min() >= -least or x.max() <= least):
                continue
            if min(np.mean(e > 0.0), np.mean(e < 0.0)) < BOTH:
                continue
            of_size, own = (float(np.corrcoef(x, one)[0, 1]) ** 2 for one in (np.abs(e), e))
            if not (of_size > MIN_CORRELATION and own < MAX_SIGNED_PART * of_size):
                continue
            yield Finding(
                self.name,
                name,
                "refuse",
                f"the {name} never changes sign while what drives it does, and goes with its size: it has no "
                f'direction; map its sign from another column, as --signal "{name} = sign(dir) * {name}"',
                cure=f"leave_out_{name}",
                remedy=f"the {name} is left out",
                columns=True,
                action=without_channel(name),
            )


def _drive(look: Look, name: str) -> Array | None:
    """Return where a channel would settle (T,), by an input that drives it at once and the other channels; None where
    none does, or something else that it depends on is not known.
    """
    base, v = look.base, look.motion
    if base is None or v is None or name not in base.rows or look.model.plant.motion_is_imposed():
        return None
    if name in base.states:
        k = base.states.index(name)
        if base.A[k, k] >= 0.0 or not base.B[k].any():
            return None
        row, direct = -base.A[k] / base.A[k, k], -base.B[k] / base.A[k, k]
        row[k] = 0.0
    else:
        row, direct, _ = base.rows[name]
    if not direct.any():
        return None
    known = {**{n: look.of(n) for n in look.channels if n in base.states}, look.velocity: v}
    if any(a != 0.0 and n not in known for n, a in zip(base.states, row, strict=True)):
        return None
    moved = sum((a * known[n] for n, a in zip(base.states, row, strict=True) if a != 0.0), np.zeros(v.size))
    return np.asarray(look.record.u @ direct + moved)


__all__ = ["UnsignedCurrent"]
