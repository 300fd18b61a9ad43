"""Single samples that are far from their neighbours."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from signlin_ros.checks.base import Check, without_samples
from signlin_ros.checks.finding import Finding
from signlin_ros.checks.look import Look
from signlin_ros.records.outliers import wild

MAX_SHOWN_TIMES = 3
"""Times that are told."""


class WildSamples(Check):
    """Single samples of a position, a velocity or another state lie far from their neighbours, which agree: lost
    readings, a sensor that slips where it passes zero, a number cut in two.

    Test: what has inertia, or a winding's current, does not leave its way for one sample or two and come back; a few
    that are beyond noise and beyond whatever else the record does, or more that depart three times further than any
    peak of the motion (`signlin_ros.records.outliers`). None is found in the shared records of real machines. Cure:
    these samples are left out, before anything else is looked at: squares let one outweigh thousands, and the other
    channel would be blamed.
    """

    name = "wild_samples"

    def find(self, look: Look) -> Iterator[Finding]:
        """Yield the channels that have such samples."""
        names = dict.fromkeys((look.position, look.velocity, *look.record.states))
        for name in (n for n in names if n in look.channels):
            off = wild(look.record, name, inert=name in (look.position, look.velocity))
            if not off.any():
                continue
            values, times = look.of(name)[off], look.t[off]
            when = ", ".join(f"{t:.6g}" for t in times[:MAX_SHOWN_TIMES]) + (
                ", ..." if times.size > MAX_SHOWN_TIMES else ""
            )
            most = f"up to {values[int(np.argmax(np.abs(values)))]:.4g} {look.unit(name)}"
            one = times.size == 1
            lies, what = ("lies far from its", "a lost reading") if one else ("lie far from their", "lost readings")
            sentence = f"{times.size} of {off.size} samples {lies} neighbours, which agree ({most}), at t = {when} s"
            yield Finding(
                self.name,
                name,
                "note",
                f"the {name}: {sentence}: {what}",
                cure=f"drop_outliers_{name}",
                remedy="it is left out" if one else "they are left out",
                harmless=True,
                action=without_samples((name,), off),
            )


__all__ = ["WildSamples"]
