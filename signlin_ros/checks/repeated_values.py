"""Values that are repeated because their sensor is slower than the log."""

from __future__ import annotations

from collections.abc import Iterator

from signlin_ros.checks.base import Check, without_samples
from signlin_ros.checks.finding import Finding
from signlin_ros.checks.look import Look
from signlin_ros.held import held


class RepeatedValues(Check):
    """A channel is logged faster than its sensor measures, each value repeated until the next.

    Test: nine in ten runs of equal values, rests aside, have one of two neighbouring lengths, whatever the speed, more
    than by chance (10^-4); or, where there is noise on what is held, nine tenths of the squared differences lie at
    regular distances. The channel changes from run to run by many of its steps, and not always by the same: an encoder
    that rests on a count changes by one step. Where an input changes in the same rhythm, what it drives may jump.
    Cure: repetitions are left out, so that the channel is taken at its own rate.
    """

    name = "repeated_values"

    def find(self, look: Look) -> Iterator[Finding]:
        """Yield the slower channels."""
        for name in look.channels:
            values = look.of(name)
            found = held(values)
            if found is None or (found.noise and any(found.follows(look.of(n)) for n in look.record.inputs)):
                continue
            noisy = ", with noise on it" if found.noise else ""
            yield Finding(
                self.name,
                name,
                "note",
                f"the {name} repeats each value for {found.length:.3g} samples{noisy}: its sensor measures every"
                f" {look.step * found.length:.3g} s, the log every {look.step:.3g} s",
                cure="own_rate",
                remedy="repetitions are left out",
                harmless=True,
                action=without_samples(look, (name,), found.repeated(values.size)),
            )
