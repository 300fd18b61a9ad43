"""Whether a loop does what simulation foretells: what is a fault, that stops the drive, and what is worth a warning.

Three faults: the drive is faster than reference and simulation say; the input goes to and fro between its limits, where
simulation's does not; the drive does not follow, though the model would.
"""

from __future__ import annotations

import itertools
import math
from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from signlin_ros.control.designs import Task

Array = NDArray[np.float64]
WINDOW_PERIODS = 25
"""Periods that are looked at together at least."""
SUPERVISED_TIME_CONSTANTS = 10.0
"""Time constants of the loop that are looked at together at least."""
SAMPLES_BEYOND = 2
"""States one after the other that must be too fast: a single one may be a wild sample."""
STANDING, SLOW = 0.2, 0.1
"""Shares of the largest speed that a drive may have though its reference stands, or is slow: a load that is let go
moves it."""
FORETOLD_TIMES = 2.0
"""Multiple of what simulation goes beyond the reference that the drive may go."""
NOISE_TIMES = 4.0
"""Multiple of the noise of the speed that is no motion."""
AT_LIMIT = 0.98
"""Share of the limit from which on an input is at it."""
SWINGS = 3
"""Changes from one limit to the other within the window that are a fault."""
MOSTLY = 0.5
"""Share of the time for which an input at its limit is told, and an error far beyond what is foretold a fault."""
LONG_WINDOWS = 4
"""Windows over which the latter is counted: the integral action has had its time."""
WORSE = 3.0
"""Multiple of the error that simulation foretells that is told."""
VISIBLE = 0.1
"""Share of the largest reference below which an error is not told, whatever is foretold."""
MAD = 0.6745 * math.sqrt(6.0)
"""Median of the absolute second difference of white noise, in its standard deviations."""


@dataclass(frozen=True)
class Foretold:
    """What simulation says of this period: speed, error of what is tracked, and input."""

    speed: float
    error: float
    u: float


@dataclass(frozen=True)
class _Moment:
    reference: float
    error: float
    side: int
    foretold: Foretold | None


class SpeedNoise:
    """Standard deviation of the noise of a speed: the least that a stretch of samples has shown.

    From second differences, so that motion counts for little; the least, so that a loop that swings does not.
    """

    def __init__(self) -> None:
        self._last: list[float] = []
        self.sigma = 0.0
        self._known = False

    def take(self, v: float) -> None:
        """Take a speed."""
        self._last.append(v)
        if len(self._last) == WINDOW_PERIODS:
            bend = np.abs(np.diff(np.array(self._last), 2))
            found = float(np.median(bend)) / MAD
            self.sigma = min(self.sigma, found) if self._known else found
            self._known, self._last = True, []


class Supervisor:
    """Looks at every period of a loop; ``share``: part of the largest reference by which the speed may exceed it.

    floor : share of the task's largest speed that counts as standing still.
    """

    def __init__(
        self, task: Task, bandwidth: float, floor: float, share: float, noise: SpeedNoise | None = None
    ) -> None:
        self.task, self.share, self.bandwidth = task, share, bandwidth
        self.still = floor * task.speed
        self.window = max(WINDOW_PERIODS, math.ceil(SUPERVISED_TIME_CONSTANTS / bandwidth / task.period))
        self.noise = noise or SpeedNoise()
        self._stride = max(1, self.window // WINDOW_PERIODS)
        self.reset()

    def reset(self) -> None:
        """Forget the loop, not the noise: it begins anew."""
        self._moments: deque[_Moment] = deque(maxlen=self.window)
        self._beyond = self._since = 0
        self._astray = 0.0
        self.peak = self._more = 0.0

    # ---------------------------------------------------------------- faults

    def take(
        self, reference: Array, sent: float, measured: Array, u: float, foretold: Foretold | None, fresh: bool
    ) -> str:
        """Take a period; return the fault that it shows, empty where there is none.

        reference : (3,) position, speed, acceleration, with what is left of the way to the one that was ``sent``, of
        which this is the speed. measured : (2,) position and speed; ``fresh``: not seen before.
        """
        position = self.task.position
        error = float(reference[0] - measured[0]) if position else float(reference[1] - measured[1])
        side = 0 if abs(u) < AT_LIMIT * self.task.limit else (1 if u > 0.0 else -1)
        self._moments.append(_Moment(max(abs(float(reference[1])), abs(sent)), error, side, foretold))
        self._look(self._moments[-1])
        way = self.bandwidth * abs(error) if position else 0.0
        allowed = self.allowed + way
        if fresh:
            self._beyond = self._beyond + 1 if abs(measured[1]) > allowed else 0
        if self._beyond >= SAMPLES_BEYOND:
            return f"the drive runs away: speed {measured[1]:.3g}, at most {allowed:.3g} is in order here"
        return "" if self._since else self._swinging() or self._unanswered()

    def may_begin(self, reference: Array, measured: Array) -> bool:
        """Return whether a drive is slow enough to be driven, for the reference (3,) that is sent."""
        least = STANDING if abs(reference[1]) <= self.still else SLOW
        allowed = max((1.0 + self.share) * abs(float(reference[1])), least * self.task.speed)
        return abs(float(measured[1])) <= allowed + NOISE_TIMES * self.noise.sigma

    def _look(self, last: _Moment) -> None:
        """Keep the largest speeds of the window, of reference and simulation; anew once in a while, for they fall."""
        self._since = (self._since + 1) % self._stride
        some = [last] if self._since else list(self._moments)
        before = (self.peak, self._more) if self._since else (0.0, 0.0)
        self.peak = max(before[0], *(abs(m.reference) for m in some))
        self._more = max(before[1], *(abs(m.foretold.speed) for m in some if m.foretold is not None), 0.0)

    @property
    def allowed(self) -> float:
        """The largest speed that is in order; ``peak`` is that of the reference within the window."""
        foretold = FORETOLD_TIMES * (self._more - self.peak)
        moving = self.peak + max(self.share * self.peak, foretold)
        least = STANDING if self.peak <= self.still else SLOW
        return max(moving, least * self.task.speed) + NOISE_TIMES * self.noise.sigma

    def _swinging(self) -> str:
        swings = _changes([m.side for m in self._moments])
        own = _changes([self._side(m) for m in self._moments])
        if swings - own < SWINGS:
            return ""
        span = self.window * self.task.period
        return f"the input swings between its limits, {swings} times within {span:.3g} s; simulation's {own} times"

    def _unanswered(self) -> str:
        """Tell whether the error has lately been far beyond what is foretold for most of the time, or for a window with
        the input at its limit on one side.
        """
        if len(self._moments) < self.window:
            return ""
        wrong, own = self.errors
        beyond = wrong - WORSE * _known(own) - NOISE_TIMES * self._noise
        weight = self._stride / (LONG_WINDOWS * self.window)
        self._astray += weight * ((beyond > self.share * self._lag(SUPERVISED_TIME_CONSTANTS)) - self._astray)
        sides, foretold = {m.side for m in self._moments}, [self._side(m) for m in self._moments]
        stuck = len(sides) == 1 and 0 not in sides and self._share(foretold) <= MOSTLY and self._far
        if self._astray < MOSTLY and not stuck:
            return ""
        where = ", the input at its limit" if stuck else ""
        return f"the drive does not follow: RMS error {wrong:.3g}, simulation foretells {own:.3g}{where}"

    def _lag(self, time_constants: float) -> float:
        """Return the error that the largest speed makes: itself, or the way of some time constants."""
        speed = max(self.peak, STANDING * self.task.speed)
        return speed * (time_constants / self.bandwidth if self.task.position else 1.0)

    def _side(self, moment: _Moment) -> int:
        u = 0.0 if moment.foretold is None else moment.foretold.u
        return 0 if abs(u) < AT_LIMIT * self.task.limit else (1 if u > 0.0 else -1)

    @staticmethod
    def _share(sides: list[int]) -> float:
        return sum(side != 0 for side in sides) / max(len(sides), 1)

    # ---------------------------------------------------------------- warnings

    @property
    def errors(self) -> tuple[float, float]:
        """RMS within the window of the error, and of what simulation foretells; NaN where nothing is known."""
        wrong = [m.error for m in self._moments]
        own = [m.foretold.error for m in self._moments if m.foretold is not None]
        return _rms(wrong), _rms(own)

    @property
    def _far(self) -> bool:
        wrong, own = self.errors
        still = self.still / self.bandwidth if self.task.position else self.still
        scale = max(VISIBLE * self.peak / (self.bandwidth if self.task.position else 1.0), still)
        return wrong > WORSE * _known(own) + scale + NOISE_TIMES * self._noise

    @property
    def _noise(self) -> float:
        return self.noise.sigma / (self.bandwidth if self.task.position else 1.0)

    @property
    def saturation(self) -> float:
        """Share of the window for which the input is at its limit."""
        return self._share([m.side for m in self._moments])

    @property
    def warning(self) -> str:
        """What is worth a warning; empty where nothing is."""
        if len(self._moments) < self.window:
            return ""
        wrong, own = self.errors
        if self._far:
            return f"tracks worse than simulation foretells: RMS error {wrong:.3g}, foretold {own:.3g}"
        if self.saturation > MOSTLY:
            return f"the input is at its limit for {100 * self.saturation:.0f} % of the time"
        return ""


def _changes(sides: list[int]) -> int:
    """Return how often a limit follows the other one."""
    met = [side for side in sides if side]
    return sum(a != b for a, b in itertools.pairwise(met))


def _known(value: float) -> float:
    return 0.0 if math.isnan(value) else value


def _rms(values: list[float]) -> float:
    return math.sqrt(sum(v * v for v in values) / len(values)) if values else math.nan


__all__ = ["Foretold", "SpeedNoise", "Supervisor"]
