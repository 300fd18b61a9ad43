"""Whether a control loop keeps its times: when its inputs come, and how old the states are that they are made of."""

from __future__ import annotations

from signlin_ros.nodes.told import NANO

LATE_PERIODS = 2
"""Periods between two inputs from which on the later one counts as late."""
RECENT = 1.0
"""Seconds that the shares of late inputs and old states are of."""
OFTEN = 0.1
"""Share of them that is told."""


class LoopTimes:
    """Counts; ``period`` of the inputs in s, ``delay``: the longest, from a sample to its input, that was designed for.

    ``late``: inputs that were; ``oldest``: age in ns of the oldest state that an input was made of.
    """

    def __init__(self, period: float, delay: float) -> None:
        self.period, self.delay = period, delay
        self.late = self.oldest = 0
        self._late = self._old = 0.0

    @property
    def _weight(self) -> float:
        """Weight of a period in a mean over about a second."""
        return min(1.0, self.period / RECENT)

    def take_pause(self, pause: int) -> bool:
        """Take the time in ns since the last input, 0 where this is the first; return whether this one is late."""
        is_late = pause > LATE_PERIODS * self.period * NANO
        self.late += is_late
        self._late += self._weight * (is_late - self._late)
        return is_late

    def take_age(self, age: int) -> None:
        """Take the age in ns of the state that an input is made of."""
        self.oldest = max(self.oldest, age)
        self._old += self._weight * ((age > self.delay * NANO) - self._old)

    @property
    def warning(self) -> str:
        """What is not as the loop was designed; empty where all is."""
        if self._late > OFTEN:
            return f"{100 * self._late:.0f} % of the inputs are late: this machine is busy"
        if self._old > OFTEN:
            return (
                f"{100 * self._old:.0f} % of the states are older than the {self.delay:g} s that the loop is made for"
            )
        return ""


__all__ = ["LoopTimes"]
