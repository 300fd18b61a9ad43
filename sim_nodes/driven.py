"""A plant along a clock, with the inputs that were sent to it: what `plant_simulator` does, without ROS.

Time is a whole number of nanoseconds of one clock, and is passed in.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from signlin_ros.model import Model
from signlin_ros.nodes.told import NANO
from signlin_ros.simulation import Stepper
from sim_nodes.measuring import Measuring
from sim_nodes.signals import Signal

Array = NDArray[np.float64]
MAX_CLOCK_JUMP = 10 * NANO
"""A clock that moves on by more ns at once was set, or the machine slept: the plant stood still."""
FRESH_PERIODS = 2
"""Periods after which a state is old. A message without a stamp counts from when it is sent, so that an old state must
not be sent: a loop that takes it for a new one is unstable."""

MOST_AT_ONCE = 20
"""Steps that are shown together where whoever steps was late; of more, the last ones."""
LONGEST_TURN = NANO // 10
"""Time in ns after which others have their turn, though steps are still due."""


class DrivenPlant:
    """The exact plant, step by step; an input acts from when it was sent, and is held.

    Parameters
    ----------
    model : the plant, its sensors and its initial state.
    period, begin : ns of a step, and the time at which the run begins.
    watchdog : ns without an input after which the drive lets its inputs go back to what they were at first; 0: never.
        It is armed by the first input.
    signal : the first input as a function of time in s, in the place of inputs that are sent.
    """

    def __init__(self, model: Model, period: int, begin: int, watchdog: int = 0, signal: Signal | None = None) -> None:
        self.model, self.period, self._begin, self._watchdog = model, period, begin, watchdog
        self.plant = Stepper(model, model.x0)
        self._sensors = Measuring(model, period / NANO, self.plant.x)
        self._signal = signal
        self.u, self.steps, self.trips = model.u0.copy(), 0, 0
        """The inputs (m,), steps done, and how often the watchdog has ended an input."""
        self._coming: deque[tuple[int, Array]] = deque()
        self._heard: int | None = None

    @property
    def time(self) -> int:
        """The time in ns up to which the plant has come."""
        return self._begin + self.steps * self.period

    def take(self, sent: int, value: Array) -> None:
        """Take inputs (m,), sent at a time in ns; one that comes late acts from the next step on."""
        self._coming.append((sent, value))

    def is_due(self, now: int) -> bool:
        """Tell whether a step is due; after a jump of the clock the plant has stood still until now."""
        behind = (now - self.time) // self.period
        if behind * self.period > MAX_CLOCK_JUMP:
            self._begin += (behind - 1) * self.period
        return behind > 0

    def catch_up(self, clock: Callable[[], int]) -> Iterator[None]:
        """Do the steps that are due on a clock in ns, which is looked at before each; yield after each to be shown.

        Of many steps that are due only the last ones are. Ends when no step is due any more, or after a while.
        """
        end = clock() + LONGEST_TURN
        while self.is_due(now := clock()) and now < end:
            shown = now - self.time < (MOST_AT_ONCE + 1) * self.period
            self.step()
            if shown:
                yield

    def is_fresh(self, now: int) -> bool:
        """Tell whether the present state is new enough to be sent without a stamp."""
        return now - self.time < FRESH_PERIODS * self.period

    def step(self) -> None:
        """Go on by one step."""
        begin, end = self.time, self.time + self.period
        if self._signal is not None:
            self.u[0] = self._signal(self.steps * self.period / NANO)
        while self._coming and self._coming[0][0] < end:
            sent, value = self._coming.popleft()
            begin = self._go_on(begin, sent)
            self.u, self._heard = value, max(sent, begin)
        self._go_on(begin, end)
        self._sensors.take(self.plant.x)
        self.steps += 1

    def _go_on(self, begin: int, end: int) -> int:
        """Go on from one time to another, from where the watchdog bites without input; return the later one."""
        if self._watchdog and self._heard is not None and end > self._heard + self._watchdog:
            begin = self._advance(begin, self._heard + self._watchdog)
            self.u, self._heard, self.trips = self.model.u0.copy(), None, self.trips + 1
        return self._advance(begin, end)

    def _advance(self, begin: int, end: int) -> int:
        if end > begin:
            self.plant.advance((end - begin) / NANO, self.u)
        return max(begin, end)

    def shown(self) -> Array:
        """Return what the sensors show of the present state (n,)."""
        return self._sensors.shown()


__all__ = ["DrivenPlant"]
