"""A servo whose position goes on faster than its motor turns without a load: the position is in another unit."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from signlin_ros.checks.base import Check
from signlin_ros.checks.finding import Finding
from signlin_ros.checks.look import MIN_SAMPLES, Look
from signlin_ros.records.converted import quoted

MAX_FREE_SPEEDS = 2.0
"""Times the speed without a load that a servo turns at most: a weight that falls helps it."""
STEPS_APART, FASTEST_SHARE = 5, 0.99
"""The speed is taken over so many samples, and is what this part of all does not exceed: no single sample tells it."""
COUNTS_A_TURN = 4096
"""What the encoders of most bus servos count in."""


class TooFast(Check):
    """A servo's goal and position without a unit, in degrees or in counts: taken in rad, it is faster than its motor.

    Test: the position goes on, over `STEPS_APART` samples and but for one in a hundred, by more than `MAX_FREE_SPEEDS`
    times the supply over the motor's constant: there its back-EMF is twice the supply. Degrees are told from 0.035 of
    the motor's speed without a load on, counts from 0.003; twelve public logs of an XL-330 reach 0.02 to 0.66 of it in
    rad. Cure: none; say the unit, of both.
    """

    name = "too_fast"
    needs_time = True

    def find(self, look: Look) -> Iterator[Finding]:
        """Yield the position that no motor follows."""
        free = look.model.plant.free_speed(look.model.parameters)
        q = look.position
        if free is None or q not in look.channels:
            return
        t, x = look.finite(q)
        if t.size < MIN_SAMPLES:
            return
        speeds = np.abs(x[STEPS_APART:] - x[:-STEPS_APART]) / (t[STEPS_APART:] - t[:-STEPS_APART])
        fastest = float(np.quantile(speeds, FASTEST_SHARE))
        if fastest > MAX_FREE_SPEEDS * free:
            yield Finding(self.name, q, "refuse", _sentence(look, fastest, free), columns=True)


def _sentence(look: Look, fastest: float, free: float) -> str:
    """Return what is said of the unit, and how to state it."""
    names = [look.record.inputs[0], look.position]
    labels = {name: quoted(look.record.labels.get(name, name)) for name in names}
    degrees = " ".join(f"--signal '{name} = {label} [deg]'" for name, label in labels.items())
    half = COUNTS_A_TURN // 2
    counts = " ".join(
        f"--signal '{name} = {2.0 * np.pi / COUNTS_A_TURN:.9f} * ({label} - {half})'" for name, label in labels.items()
    )
    unit = look.unit(look.position)
    return (
        f"the {look.position} goes at up to {fastest:.3g} {unit}/s, and the motor at {free:.3g} without a load: it is "
        f"in another unit. Say which, of both: in degrees {degrees}; in counts of {COUNTS_A_TURN} a turn {counts}"
    )
