"""Samples too far apart for the model's fastest motion."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from signlin_ros.checks.base import Check
from signlin_ros.checks.finding import Finding
from signlin_ros.checks.linear import Base
from signlin_ros.checks.look import Look

FAR = 3.0
"""Steps of so many time constants leave nothing of a motion (5 %)."""


class SlowSampling(Check):
    """The samples are too far apart for the model's fastest motion.

    Test: a step is more than `FAR` of its time constants, by the model's own numbers; nothing is left to chance.
    Cure: none; what only that motion tells is not known from this record. If even the slowest motion is over between
    two samples, the time is probably in another unit: the record is refused.
    """

    name = "slow_sampling"
    needs_time = True

    def find(self, look: Look) -> Iterator[Finding]:
        """Yield one finding for the record."""
        if look.base is None or look.step <= 0.0:
            return
        sizes = look.base.rates
        moving = sizes > 1e-6 * sizes.max(initial=0.0)
        if not moving.any():
            return
        fast, slow = 1.0 / sizes[moving].max(), 1.0 / sizes[moving].min()
        if look.step > FAR * slow:
            yield Finding(
                self.name,
                "t",
                "refuse",
                f"a sample every {look.step:.3g} s, while the model's slowest motion takes {slow:.3g} s: is the time in"
                " another unit? Name it, as t [ms]",
            )
        elif look.step > FAR * fast:
            state = _fastest_state(look.base, look.model.states)
            yield self.note(
                "t",
                f"a sample every {look.step:.3g} s is too slow for the model's fastest motion ({fast:.2g} s, of the"
                f" {state}): what happens in between is not known from this record",
            )


def _fastest_state(base: Base, states: tuple[str, ...]) -> str:
    """Return the state that takes most part in the fastest motion."""
    rates, vectors = np.linalg.eig(base.A)
    k = int(np.argmax(np.abs(rates)))
    return states[int(np.argmax(np.abs(vectors[:, k] * np.linalg.pinv(vectors)[k])))]
