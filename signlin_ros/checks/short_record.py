"""Too short to hold anything out."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from signlin_ros.checks.base import Check
from signlin_ros.checks.finding import Finding
from signlin_ros.checks.look import Look

THIRD = 3
MIN_HELD_OUT_SAMPLES = 60
"""A part that is held out needs so many samples."""
MIN_SLOWEST_PERIODS = 1.0
"""And so many times as long as the model's slowest motion: a time constant, or the period of an oscillation that goes
on for longer."""
MAX_SLOWEST_MOTION = 10.0
"""A motion slower than this, in s, is none that a part must hold."""


class ShortRecord(Check):
    """The record is too short for a part to be held out on which a fit can be tried.

    Test: its last third has fewer than `MIN_HELD_OUT_SAMPLES` samples, or is shorter than the model's slowest motion;
    by the model's own numbers, nothing is left to chance. Cure: a second record (``--validation``).
    """

    name = "short_record"
    needs_time = True
    holding_out = True

    def find(self, look: Look) -> Iterator[Finding]:
        """Yield one note for the record."""
        samples, length = look.t.size // THIRD, look.duration / THIRD
        times = look.base.times if look.base is not None else np.zeros(0)
        slow = times[times < MAX_SLOWEST_MOTION].max(initial=0.0)
        if samples < MIN_HELD_OUT_SAMPLES:
            yield self.note("", f"{look.t.size} samples are too few to hold a third of them out; give --validation")
        elif length < MIN_SLOWEST_PERIODS * slow:
            yield self.note(
                "",
                f"a third of the record ({length:.3g} s) is shorter than the model's slowest motion ({slow:.3g} s):"
                " what is held out says little; give --validation",
            )
