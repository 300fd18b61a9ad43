"""Nothing moves."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from signlin_ros.checks.base import Check
from signlin_ros.checks.finding import Finding
from signlin_ros.checks.look import MIN_SAMPLES, Look

MIN_MOVING_VARIANCE = 1.5
"""Variance beyond which, in multiples of the noise's, a channel moves."""
COUNTS = 2.5
"""Steps of a coarse sensor within which it rests."""
MAX_RESIDUAL_SHARE = 0.7
"""What a model leaves of a channel that it follows, as a share: then the channel moves, however much like noise."""


class NoMotion(Check):
    """The drive never moved beyond the noise of its sensors: no effect of a motion can be named.

    Test: the variance of position and velocity is no more than `MIN_MOVING_VARIANCE` times that of their noise, as
    their finest differences show it. Of white noise the ratio is 1 within 3 / sqrt(T): 200 samples exceed 1.5 in one of
    10^5 records. Cure: another record.
    """

    name = "no_motion"

    def find(self, look: Look) -> Iterator[Finding]:
        """Yield one finding for the record."""
        names = [
            n for n in (look.position, look.velocity) if n in look.channels and look.finite(n)[1].size >= MIN_SAMPLES
        ]
        if not names or look.model.plant.motion_is_imposed() or not all(_rests(look, name) for name in names):
            return
        what = " and ".join(f"the {name} stays within {_size(look, name)}" for name in names)
        does = "turned or ran at one speed all the time" if any(_runs(look, name) for name in names) else "never moved"
        yield Finding(
            self.name,
            ", ".join(names),
            "refuse",
            f"the drive {does}, but for the noise of its sensors ({what}): nothing can be named from this record",
        )


def _size(look: Look, name: str) -> str:
    middle = f"{float(np.mean(look.finite(name)[1])):.3g} " if _runs(look, name) else ""
    return f"{middle}±{_spread(look, name):.2g} {look.unit(name)}"


def _spread(look: Look, name: str) -> float:
    return 3.0 * float(np.std(look.finite(name)[1]))


def _runs(look: Look, name: str) -> bool:
    return name == look.velocity and abs(float(np.mean(look.finite(name)[1]))) > _spread(look, name)


def _rests(look: Look, name: str) -> bool:
    values = look.finite(name)[1]
    quantum, noise = look.quantum(name), look.noise(name)
    if np.ptp(values) <= COUNTS * quantum or np.ptp(values) == 0.0:
        return True
    p = look.predicted
    if p is not None and name in p.channels and p.shares()[p.channels.index(name)] < MAX_RESIDUAL_SHARE:
        return False
    return bool(np.var(values) <= MIN_MOVING_VARIANCE * noise.sigma**2)
