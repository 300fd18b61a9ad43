"""A channel that never changes while others do."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from signlin_ros.checks.base import Check, without_channel
from signlin_ros.checks.finding import Finding
from signlin_ros.checks.look import MIN_SAMPLES, Look

MIN_TRAVEL_OVER_NOISE = 3.0
"""Others move if they travel more than so many times their noise."""


class FrozenChannel(Check):
    """A measured channel holds one value from the first sample to the last, though another channel moves.

    Test: no two values differ. A sensor with any noise, or a quantity that follows the other, never does that: of
    `MIN_SAMPLES` samples in steps as coarse as their noise fewer than one in 10^6 records are all alike.
    Cure: the channel is left out; refused where it is all that the model computes of an imposed motion.
    """

    name = "frozen_channel"

    def find(self, look: Look) -> Iterator[Finding]:
        """Yield the channels that are left out."""
        spread = {name: float(np.ptp(look.finite(name)[1])) if _told(look, name) else -1.0 for name in look.channels}
        frozen = [name for name, size in spread.items() if size == 0.0]
        moving = [
            name
            for name, size in spread.items()
            if size > MIN_TRAVEL_OVER_NOISE * look.noise(name).sigma > -1.0 and size > 0
        ]
        if not moving:
            return
        for name in frozen:
            value = float(look.finite(name)[1][0])
            sentence = f"the {name} is {value:g} {look.unit(name)} in every sample while the {moving[0]} changes"
            if look.model.plant.motion_is_imposed() and not {*look.model.outputs} & {*look.channels} - {*frozen}:
                way = f"nothing else of what the model does is recorded; map what measures it, --signal {name}=COLUMN"
                yield Finding(self.name, name, "refuse", f"{sentence}: nothing measures it, and {way}", final=True)
                continue
            yield Finding(
                self.name,
                name,
                "note",
                f"{sentence}: nothing measures it",
                cure=f"leave_out_{name}",
                remedy="it is left out",
                harmless=True,
                action=without_channel(name),
            )


def _told(look: Look, name: str) -> bool:
    return look.finite(name)[1].size >= MIN_SAMPLES
