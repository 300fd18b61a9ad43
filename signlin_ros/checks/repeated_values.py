"""Values that are repeated because their sensor is slower than the log."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from signlin_ros.checks.base import Check, without_samples
from signlin_ros.checks.finding import Finding
from signlin_ros.checks.look import LEAST, Look

Array = NDArray[np.float64]

REGULAR = 0.9
"""Share of the runs of equal values that are of two neighbouring lengths."""
LONGER = 1.4
"""Least mean length of those."""
SAME = 0.01
"""Changes that are alike to this part of them, in nine of ten runs, are the steps of a sensor at a steady speed."""
STEPS = 4.0
"""Values of a slow sensor change by more than so many of their own steps (median)."""


class RepeatedValues(Check):
    """A channel is logged faster than its sensor measures, each value repeated until the next.

    Test: nine in ten runs of equal values have one of two neighbouring lengths, whatever the speed, and the channel
    changes from run to run by many of its steps, and not always by the same. An encoder that rests on a count changes
    by one step, in runs as long as the motion is slow; of 20 such runs nine in ten are alike by chance in less than one
    record of 10^4.
    Cure: repetitions are left out, so that the channel is taken at its own rate.
    """

    name = "repeated_values"

    def find(self, look: Look) -> Iterator[Finding]:
        """Yield the slower channels."""
        for name in look.channels:
            values = look.of(name)
            begins = _begins(values)
            regular = _regular(np.diff(begins))
            if regular.size < LEAST or regular.mean() < LONGER:
                continue
            changes = np.abs(np.diff(values[begins]))
            usual = float(np.median(changes))
            steady = np.mean(np.abs(changes - usual) < SAME * usual) > REGULAR
            if steady or usual < STEPS * look.quantum(name):
                continue
            drop = np.ones(values.size, dtype=bool)
            drop[begins] = False
            rate = look.step * float(regular.mean())
            yield Finding(
                self.name,
                name,
                "note",
                f"the {name} repeats each value for {regular.mean():.3g} samples: its sensor measures every {rate:.3g}"
                f" s, the log every {look.step:.3g} s",
                cure="own_rate",
                remedy="repetitions are left out",
                harmless=True,
                action=without_samples((name,), drop),
            )


def _begins(values: Array) -> NDArray[np.intp]:
    """Return the samples at which runs of equal values (T,) begin; a missing sample repeats nothing."""
    return np.concatenate([[0], np.flatnonzero(values[1:] != values[:-1]) + 1])


def _regular(lengths: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return the lengths of runs that are one of two neighbouring numbers; none where nine in ten are not. What rests
    is a long run among others, and no sensor's rate.
    """
    counts = np.bincount(lengths, minlength=2)
    short = int(np.argmax(counts[1:] + counts[:-1]))
    alike = lengths[(lengths == short) | (lengths == short + 1)]
    return np.asarray(alike if alike.size >= REGULAR * lengths.size else alike[:0])
