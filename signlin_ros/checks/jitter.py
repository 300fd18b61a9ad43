"""Stamps that jitter."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from signlin_ros.checks.base import Check
from signlin_ros.checks.finding import Finding
from signlin_ros.checks.look import LEAST, Look
from signlin_ros.checks.timing import regular_steps

UNEVEN, OFTEN = 0.1, 0.05
"""A step counts that differs from the median by this share, and so many of them are worth a word."""


class Jitter(Check):
    """Samples are stamped unevenly: when they arrived, rather than when they were taken, or by a busy computer.

    Test: more than `OFTEN` of the steps, gaps aside, differ from the median by more than `UNEVEN`. Stamps are exact:
    none is wrong by chance. Cure: none is needed; everything takes the stamps as they are.
    """

    name = "jitter"

    def find(self, look: Look) -> Iterator[Finding]:
        """Yield one note for the record."""
        steps = regular_steps(look.t)
        if steps.size < LEAST:
            return
        median = float(np.median(steps))
        share = float(np.mean(np.abs(steps / median - 1.0) > UNEVEN))
        if share > OFTEN:
            low, high = np.percentile(steps, (1, 99))
            yield self.note(
                "t",
                f"the stamps jitter: steps of {low:.3g} to {high:.3g} s around {median:.3g} s,"
                f" {100 * share:.0f} % of them off by a tenth or more",
            )
