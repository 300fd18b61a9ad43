"""An input whose clock is behind that of the measurements."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from signlin_ros.checks.base import Check, changed
from signlin_ros.checks.finding import Finding
from signlin_ros.checks.look import Look
from signlin_ros.checks.observer import prediction

AHEAD = (2, 3, 5, 8, 13, 21, 34, 55, 89)
"""By how many samples the input is tried earlier."""
BETTER = 0.5
"""What the model leaves with an earlier input, as a share of what it leaves as recorded."""


class MixedClocks(Check):
    """The drive answers to an input before that is stamped: two clocks, or stamps of arrival.

    Test: the linear base leaves half as much if the input acts two samples or more earlier; no cause is later than its
    effect, whatever a model lacks, and none of the clean records of benchmarks/checks.py reads better so.
    Cure: the input is moved (``advance_NAME``).
    """

    name = "mixed_clocks"
    needs_time = True
    needs_input = True

    def find(self, look: Look) -> Iterator[Finding]:
        """Yield the input that is late."""
        if look.base is None or look.predicted is None or not look.record.inputs or look.told:
            return
        if look.model.plant.motion_is_imposed():
            return
        name = look.record.inputs[0]
        u = look.of(name)
        tried = {f"-{k}": np.concatenate([u[k:], np.full(k, u[-1])]) for k in AHEAD if k < u.size // 20}
        p = prediction(look.base, look.record, look.channels, tried) if tried else None
        if p is None:
            return
        none = dict.fromkeys(tried, 0.0)
        left = {key: p.left({**none, name: 0.0, key: 1.0}) for key in tried}
        best = min(left, key=lambda key: left[key])
        if left[best] > BETTER * p.left(none):
            return
        k = -int(best)
        yield Finding(
            self.name,
            name,
            "refuse",
            f"the drive answers about {k * look.step:.3g} s before the {name} is stamped: two clocks",
            cure=f"advance_{name}",
            remedy="the input acts that much earlier",
            action=changed(name, lambda values: np.concatenate([values[k:], np.full(k, values[-1])])),
        )
