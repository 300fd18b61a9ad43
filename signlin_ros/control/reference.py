"""References: what a drive shall do, as a speed that is linear between knots."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
SINE_KNOTS = 400
"""Knots of one period of a sine."""


@dataclass(frozen=True)
class Profile:
    """A speed (K,) that is linear between knots t (K,), and the position that it leads to from ``start``.

    Before the first knot the drive stands there, after the last one it goes on as it was (a drive that stands stands).
    """

    t: Array
    v: Array
    start: float = 0.0

    @property
    def duration(self) -> float:
        """Time of the last knot in s."""
        return float(self.t[-1])

    def at(self, times: ArrayLike) -> tuple[Array, Array, Array]:
        """Return position, speed and acceleration (T,) at times (T,); at a knot, the acceleration after it."""
        when = np.atleast_1d(np.asarray(times, dtype=float))
        spans = np.diff(self.t)
        rates = np.append(np.diff(self.v) / spans, 0.0)
        travelled = self.start + np.concatenate([[0.0], np.cumsum(spans * (self.v[1:] + self.v[:-1]) / 2)])
        k = np.clip(np.searchsorted(self.t, when, side="right") - 1, 0, self.t.size - 1)
        age = np.maximum(when - self.t[k], 0.0)
        begun = when >= self.t[0]
        position = travelled[k] + self.v[k] * age + rates[k] * age**2 / 2
        return position, np.where(begun, self.v[k] + rates[k] * age, 0.0), np.where(begun, rates[k], 0.0)


def sine(amplitude: float, period: float, cycles: int = 3) -> Profile:
    """Return a speed of ``amplitude`` sin(2 pi t / period)."""
    t = np.linspace(0.0, cycles * period, cycles * SINE_KNOTS + 1)
    return Profile(t, amplitude * np.sin(2 * np.pi * t / period))


def swing(amplitude: float, period: float, cycles: int = 3) -> Profile:
    """Return a position of ``amplitude`` (1 - cos(2 pi t / period)): a sine that starts at rest."""
    return sine(2 * np.pi * amplitude / period, period, cycles)


def triangle(amplitude: float, period: float, cycles: int = 3) -> Profile:
    """Return a speed that goes up and down between ``amplitude`` and its negative at a constant rate."""
    corners = np.concatenate([[0.0], np.tile([amplitude, -amplitude], cycles), [0.0]])
    times = np.concatenate([[0.0], (np.arange(2 * cycles) + 0.5) * period / 2, [cycles * period]])
    return Profile(times, corners)


def ramps(speed: float, travel: float, stop: float, rise: float = 0.05, cycles: int = 2, last: float = 4.0) -> Profile:
    """Return a position that goes out by ``travel`` and back at ``speed``, with a stop of ``stop`` s after each way.

    The speed rises and falls within ``rise`` s; the last stop lasts ``last`` s.
    """
    way = travel / speed - rise
    t, v, now = [0.0], [0.0], 0.0
    for leg in range(2 * cycles):
        toward = speed if leg % 2 == 0 else -speed
        for span, value in ((stop, 0.0), (rise, toward), (way, toward), (rise, 0.0)):
            now += span
            t.append(now)
            v.append(value)
    return Profile(np.array([*t, now + last]), np.array([*v, 0.0]))
