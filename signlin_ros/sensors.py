"""What a sensor makes of the quantity that it measures."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

Values = TypeVar("Values", float, "NDArray[np.float64]")


@dataclass(frozen=True)
class Sensor:
    """The sensor of one channel: it shows y(t) = gain x(t - delay) + offset of the true x.

    ``gain`` has no unit, ``offset`` is in the unit of the channel, ``delay`` in s. `show` and `true` are about values
    alone: when a value is seen is left to who has the times.
    """

    gain: float = 1.0
    offset: float = 0.0
    delay: float = 0.0

    def show(self, x: Values) -> Values:
        """Return the reading for the true value x, a number or an array, ``delay`` later."""
        return self.gain * x + self.offset

    def true(self, y: Values) -> Values:
        """Return the true value behind what is shown, a number or an array, as it was ``delay`` ago."""
        return (y - self.offset) / self.gain
