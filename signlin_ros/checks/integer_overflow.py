"""A channel whose integers overflow."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from signlin_ros.checks.base import Check, changed
from signlin_ros.checks.finding import Finding
from signlin_ros.checks.look import MIN_SAMPLES, Look
from signlin_ros.checks.wrapping import unwrapped, wraps

Array = NDArray[np.float64]

BITS = (*range(8, 17), 20, 24, 31, 32)


class IntegerOverflow(Check):
    """A speed, current or force in counts leaps by 2^n of its steps: a sign read as a large number, or too few bits.

    Test: all steps beyond 0.4 of the range are one power of two of the channel's own step (to 2 %, and what
    ordinary steps differ by), two of them at least, and all values are such as so many bits can hold, with a sign or
    without. One power lies within 2 % of a random number in about one case of seventeen, so that two jumps agree by
    chance in one of 300 records that jump at all, and a drive that is switched on and off jumps alike; its noise about
    0 is of neither kind of integer.
    Cure: whole multiples of that power are added, which changes nothing else.
    """

    name = "integer_overflow"

    def find(self, look: Look) -> Iterator[Finding]:
        """Yield the channels and inputs that overflow."""
        for name in (*look.channels, *look.record.inputs):
            values = look.finite(name)[1]
            if name == look.position or values.size < MIN_SAMPLES or not _jumps(values):
                continue
            step = _step(values)
            found = wraps(values, tuple(2.0**n * step for n in BITS)) if step else None
            if found is None or found.count < 2 or found.period not in {2.0**n * step for n in BITS}:
                continue
            if not _held(values, found.period, step):
                continue
            bits = round(np.log2(found.period / step))
            unit, period = look.unit(name), found.period
            yield Finding(
                self.name,
                name,
                "note",
                f"the {name} leaps {found.count} times by {found.period:.6g} {unit}, 2^{bits} of its steps of"
                f" {step:.4g} {unit}: its integers overflow",
                cure="unwrap",
                remedy="they are continued",
                harmless=True,
                action=changed(name, lambda values, period=period: unwrapped(values, period)),  # type: ignore[misc]
            )


def _jumps(values: Array) -> bool:
    steps = np.abs(np.diff(values))
    return bool(steps.max() > 0.4 * np.ptp(values) > 0)


def _held(values: Array, period: float, step: float) -> bool:
    """Tell whether integers of one period hold all values (T,): from 0 on, or about 0."""
    low, high = float(values.min()) + 0.5 * step, float(values.max()) - 0.5 * step
    return (low > 0.0 and high < period) or (low > -0.5 * period - step and high < 0.5 * period)


def _step(values: Array) -> float:
    """Return the largest step of which all values (T,) are multiples; 0 where there is none."""
    levels = np.unique(values)
    gaps = np.diff(levels)
    gaps = gaps[gaps > 1e-9 * np.ptp(values)]
    if gaps.size < 2:
        return 0.0
    step = float(np.median(gaps[gaps < 1.5 * gaps.min()]))
    multiples = gaps / step
    whole = np.abs(multiples - np.round(multiples)) < 0.05 + 1e-6 * multiples
    return step if whole.mean() > 0.98 else 0.0
