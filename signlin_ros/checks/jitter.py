"""Stamps that jitter, or that come at two rates."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from signlin_ros.checks.base import Check
from signlin_ros.checks.finding import Finding
from signlin_ros.checks.look import MIN_SAMPLES, Look
from signlin_ros.checks.timing import regular_steps, two_rates

MIN_STEP_DEVIATION, MIN_UNEVEN_SHARE = 0.1, 0.05
"""A step counts that differs from the median by this share, and so many of them are worth a word."""


class Jitter(Check):
    """Samples are stamped unevenly: when they arrived, rather than when they were taken, or by a busy computer.

    Test: more than `MIN_UNEVEN_SHARE` of the steps, gaps aside, differ from the median by more than
    `MIN_STEP_DEVIATION`. Stamps are exact: none is wrong by chance. Where nearly all steps are one of two that seldom
    change (`two_rates`), it is no jitter and is told as two rates. Cure: none is needed; everything takes the stamps
    as they are.
    """

    name = "jitter"

    def find(self, look: Look) -> Iterator[Finding]:
        """Yield one note for the record."""
        steps = regular_steps(look.t)
        if steps.size < MIN_SAMPLES:
            return
        median = float(np.median(steps))
        share = float(np.mean(np.abs(steps / median - 1.0) > MIN_STEP_DEVIATION))
        if share <= MIN_UNEVEN_SHARE:
            return
        rates = two_rates(steps)
        if rates is not None:
            first, second, changes = rates
            often = "once" if changes == 1 else f"{changes} times"
            said = f"two rates, one after the other: steps of {first:.3g} s and of {second:.3g} s"
            yield self.note("t", f"{said}, which change {often}")
        else:
            low, high = np.percentile(steps, (1, 99))
            yield self.note(
                "t",
                f"the stamps jitter: steps of {low:.3g} to {high:.3g} s around {median:.3g} s,"
                f" {100 * share:.0f} % of them off by a tenth or more",
            )
