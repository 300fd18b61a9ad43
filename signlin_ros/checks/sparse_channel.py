"""Channels whose rates do not go together."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from signlin_ros.checks.base import Check
from signlin_ros.checks.finding import Finding
from signlin_ros.checks.look import Look

MAX_SPARSE_SHARE = 0.1
"""A channel is seldom measured that has no more than this share of the samples of the one that has most."""


class SparseChannel(Check):
    """A channel is measured far more rarely than the others, so that it says little of what they show.

    Test: fewer than a tenth of the samples of the channel that has most; counted, nothing is left to chance.
    Cure: none is needed, missing samples are missing; but nothing fast is known of such a channel.
    """

    name = "sparse_channel"

    def find(self, look: Look) -> Iterator[Finding]:
        """Yield the channels that are seldom measured."""
        counts = {name: int(np.isfinite(look.of(name)).sum()) for name in look.channels}
        most = max(counts.values(), default=0)
        for name, count in counts.items():
            if 0 < count < MAX_SPARSE_SHARE * most:
                apart = look.duration / max(count - 1, 1)
                yield self.note(
                    name,
                    f"the {name} is measured every {apart:.3g} s, other channels every {look.step:.3g} s: nothing fast"
                    " is known of it",
                )
