"""How noisy a running sensor is, measured along the way."""

from __future__ import annotations

from collections import deque

import numpy as np
from numpy.typing import NDArray

from signlin_ros.noise import quantum_of, smooth_noise

Array = NDArray[np.float64]

MAX_METER_SAMPLES = 512
"""Samples that an estimate is made of at most."""
ESTIMATE_INTERVAL = 128
"""Samples from one estimate to the next at most."""
MIN_METER_SAMPLES = 8
"""Samples before the first estimate."""
RELATIVE = 1e-6
"""Noise of a value of which nothing is known yet, relative to it."""
STANDING_STEPS = 4.0
"""A channel that stays within so many of its steps says nothing new of its noise."""
ONCE = 0.9
"""A channel of which more values than this share come once only shows no step: steady motion has even steps, too."""
MAX_METER_ESTIMATES = 1000
"""Estimates that the usual one is taken of at most."""


class NoiseMeter:
    """Standard deviation ``sigma`` of a channel's noise from its samples, again whenever they have doubled, or so.

    An encoder counts with its step over sqrt(12). A ``known`` value is kept.
    """

    def __init__(self, known: float | None = None) -> None:
        self.sigma = 1e-9 if known is None else known
        self._known = known is not None
        self._samples: deque[tuple[float, float]] = deque(maxlen=MAX_METER_SAMPLES)
        self._count, self._next, self._quantum = 0, MIN_METER_SAMPLES, np.inf
        self._found: deque[float] = deque(maxlen=MAX_METER_ESTIMATES)

    @property
    def known(self) -> bool:
        """Whether the noise is given, or was measured."""
        return self._known or bool(self._found)

    @property
    def usual(self) -> float:
        """The median of the estimates up to now."""
        return float(np.median(self._found)) if self._found else self.sigma

    def take(self, t: float, value: float) -> None:
        """Take a sample at t (s)."""
        if self._known:
            return
        self._samples.append((t, value))
        self._count += 1
        if self._count < MIN_METER_SAMPLES:
            self.sigma = max(self.sigma, RELATIVE * abs(value))
        elif self._count >= self._next:
            self._next = self._count + min(self._count, ESTIMATE_INTERVAL)
            self._estimate()

    def take_all(self, t: Array, values: Array) -> None:
        """Take samples (T,) one after the other; nothing is asked of them where the noise is given."""
        if not self._known:
            for when, value in zip(t.tolist(), values.tolist(), strict=True):
                self.take(when, value)

    def _estimate(self) -> None:
        t, y = np.array(self._samples).T
        quantum = _step(y)
        if quantum > 0:
            self._quantum = min(self._quantum, quantum)
        floor = self._quantum if np.isfinite(self._quantum) else 0.0
        if np.ptp(y) <= STANDING_STEPS * floor:
            self.sigma = max(self.sigma, float(floor / np.sqrt(12.0)))
            return
        self.sigma = max(smooth_noise(t, y), floor / np.sqrt(12.0), 1e-12)
        self._found.append(self.sigma)

    @staticmethod
    def of(t: Array, y: Array) -> float:
        """Return the standard deviation of the noise on a whole channel (T,)."""
        there = np.isfinite(y)
        if there.sum() < MIN_METER_SAMPLES:
            return 1e-12
        return float(max(smooth_noise(t[there], y[there]), _step(y[there]) / np.sqrt(12.0), 1e-12))


def _step(y: Array) -> float:
    """Return the step of values (T,) that come again and again; 0 where they do not."""
    return quantum_of(y) if np.unique(y).size < ONCE * y.size else 0.0


__all__ = ["NoiseMeter"]
