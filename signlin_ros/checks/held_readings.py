"""Readings that failed, in whose place the last one stands again."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from signlin_ros.checks.base import Check, without_samples
from signlin_ros.checks.finding import Finding
from signlin_ros.checks.look import Look
from signlin_ros.held import dropped


class HeldReadings(Check):
    """A driver repeats the last value where a reading fails: the channel stands still now and then, and leaps after it.

    Test: runs of equal values that the noise of the channel makes none of by chance (10^-4 a record), after which it
    leaps by twice its usual change or more (median); a machine that stands still leaves its place slowly. Values of 0
    are none: a sensor that is asleep says so. Cure: repetitions are left out.
    """

    name = "held_readings"

    def find(self, look: Look) -> Iterator[Finding]:
        """Yield the channels that are held."""
        for name in look.channels:
            lost = dropped(look.of(name))
            if not lost.any():
                continue
            times = int(np.count_nonzero(np.diff(lost.astype(np.int8), prepend=0) == 1))
            often = "once" if times == 1 else f"{times} times"
            yield Finding(
                self.name,
                name,
                "note",
                f"the {name} stays at one value {often}, for {int(lost.sum())} samples in all, and leaps after that, "
                "though its noise leaves no two alike: readings that failed, or that came less often",
                cure=f"drop_held_{name}",
                remedy="repetitions are left out",
                harmless=True,
                action=without_samples(look, (name,), lost),
            )


__all__ = ["HeldReadings"]
