"""An input whose clock is behind that of the measurements."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from signlin_ros.checks.base import Check, changed
from signlin_ros.checks.finding import Finding
from signlin_ros.checks.look import Look
from signlin_ros.checks.observer import prediction

Array = NDArray[np.float64]

AHEAD = (2, 3, 5, 8, 13, 21, 34, 55, 89)
"""By how many samples the input is tried earlier."""
MAX_LINEAR_RATIO = 1.1
"""What an input that is linear between its samples leaves, beside an earlier one, where that is the cause."""
BETWEEN = "between"
MIN_INPUT_CHANGES = 10
"""Changes of an input that tell how often it is logged."""
MAX_RESIDUAL_RATIO = 0.5
"""What the model leaves with an earlier input, as a share of what it leaves as recorded."""


class MixedClocks(Check):
    """The drive answers to an input before that is stamped: two clocks, or stamps of arrival.

    Test: the linear base leaves half as much if the input acts two samples or more earlier; no cause is later than its
    effect, whatever a model lacks, and none of the clean records of benchmarks/checks.py reads better so. An input that
    is logged more seldom than that, and held until its next sample, is late for that alone.
    Cure: the input is moved (``advance_NAME``), or taken as linear between its samples (``interpolate_NAME``).
    """

    name = "mixed_clocks"
    needs_time = True
    needs_input = True

    def find(self, look: Look) -> Iterator[Finding]:
        """Yield the input that is late."""
        if look.base is None or look.predicted is None or not look.record.inputs or look.reported:
            return
        if look.model.plant.motion_is_imposed():
            return
        name = look.record.inputs[0]
        u = look.of(name)
        at = np.flatnonzero(np.diff(u, prepend=np.nan) != 0.0)
        between = np.interp(look.t, look.t[at], u[at])
        tried = {f"-{k}": np.concatenate([u[k:], np.full(k, u[-1])]) for k in AHEAD if k < u.size // 20}
        if not tried:
            return
        p = prediction(look.base, look.record, look.channels, {**tried, BETWEEN: between})
        if p is None:
            return
        none = dict.fromkeys((*tried, BETWEEN), 0.0)
        left = {key: p.left({**none, name: 0.0, key: 1.0}) for key in none}
        best = min(tried, key=lambda key: left[key])
        seldom = _seldom(at)
        if min(left[best], left[BETWEEN]) > MAX_RESIDUAL_RATIO * p.left(none):
            return
        if seldom > 2 and left[BETWEEN] < MAX_LINEAR_RATIO * left[best]:  # held for so long, it lags by half of that
            yield self._sparse(look, name, seldom, between)
            return
        if left[best] > MAX_RESIDUAL_RATIO * p.left(none):
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

    def _sparse(self, look: Look, name: str, seldom: int, between: Array) -> Finding:
        every = f"every {seldom * look.step:.3g} s only, one in {seldom} samples of what it drives"
        return Finding(
            self.name,
            name,
            "note",
            f"the {name} is logged {every}, and the drive follows what goes on in between",
            cure=f"interpolate_{name}",
            remedy="it is taken as linear from one of its samples to the next",
            harmless=True,
            action=changed(name, lambda values: between),
        )


def _seldom(at: NDArray[np.intp]) -> int:
    """Return from how many samples to how many an input changes, the median; 1 where it does at each."""
    return int(np.median(np.diff(at))) if at.size > MIN_INPUT_CHANGES else 1
