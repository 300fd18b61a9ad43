"""Parts of a command that an engineer recognises, and a command of several parts between rests."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

REST_PART, LEAST_REST = 0.05, 0.1
"""Part of the time at rest at either end, and s of it at least."""
STAIRCASE_LEVELS = np.array([0.25, 0.5, 0.75, 1.0, 0.75, 0.5, 0.25, 0.0])
"""Steps of a staircase, up and down, to either side."""
LINES = 12
"""Sines in a multisine."""


@dataclass(frozen=True)
class Part:
    """A part of a command: its ``kind``, its ``peak`` (signed), a ``frequency`` in Hz, its ``share`` of the time.

    The frequency is that of cycles, or the highest one of a chirp and of a multisine.
    """

    kind: str
    peak: float
    frequency: float = 1.0
    share: float = 1.0

    def values(self, t: Array, duration: float) -> Array:
        """Return the part (T,) at times t in s from its beginning."""
        cycles = max(1, round(self.frequency * duration))
        return self.peak * PART_KINDS[self.kind](t / duration, cycles)

    def told(self, duration: float, unit: str) -> str:
        """Return the part in words."""
        cycles = max(1, round(self.frequency * duration))
        size, hertz = f"{abs(self.peak):.3g} {unit}", f"{cycles / duration:.2g} Hz"
        if self.kind in ("chirp", "multisine"):
            return f"{self.kind} {size} up to {hertz} ({duration:.2g} s)"
        if self.kind in ("rest",):
            return f"rest ({duration:.2g} s)"
        if self.kind in ("hold", "release"):
            return f"{self.kind} {self.peak:.3g} {unit} ({duration:.2g} s)"
        return f"{self.kind} ±{size} {hertz} ({duration:.2g} s)"


def _turns(p: Array, cycles: int) -> Array:
    return np.asarray(2 * np.pi * cycles * p)


def _triangle(p: Array, cycles: int) -> Array:
    return np.asarray(2 / np.pi * np.arcsin(np.sin(_turns(p, cycles))))


def _steps(p: Array, cycles: int) -> Array:
    """Forth, rest, back, rest."""
    quarter = np.floor(4 * cycles * p + 1e-9) % 4
    return np.asarray(np.where(quarter == 0, 1.0, np.where(quarter == 2, -1.0, 0.0)))


def _staircase(p: Array, cycles: int) -> Array:
    levels = np.concatenate([STAIRCASE_LEVELS, -STAIRCASE_LEVELS])
    place = np.floor(levels.size * cycles * p + 1e-9).astype(int) % levels.size
    return np.asarray(levels[place])


def _creep(p: Array, cycles: int) -> Array:
    """As long forth as back, with short ramps."""
    return np.asarray(np.clip(6.0 * np.sin(_turns(p, cycles)), -1.0, 1.0))


def _one_way(p: Array, cycles: int) -> Array:
    """A wave about a level that never turns back."""
    return np.asarray((0.7 + 0.3 * np.sin(_turns(p, cycles))) * np.clip(10 * p, 0.0, 1.0))


def _release(p: Array, cycles: int) -> Array:
    """Ramp up, hold, let go: at rest for the second half."""
    phase = (p * cycles) % 1.0
    return np.asarray(np.where(phase < 0.5, np.clip(6.0 * phase, 0.0, 1.0), 0.0))


def _chirp(p: Array, cycles: int) -> Array:
    """A sweep that ends at ``cycles`` in the whole time, from a twelfth of that."""
    first = cycles / 12.0
    return np.asarray(np.sin(2 * np.pi * (first * p + (cycles - first) * p * p / 2)))


def _multisine(p: Array, cycles: int) -> Array:
    """Sines of Schroeder's phases [IEEE Trans. Information Theory 16 (1970) 85]."""
    lines = np.unique(np.geomspace(1, max(cycles, 2), LINES).round())
    k = np.arange(1, lines.size + 1)
    waves = np.sin(2 * np.pi * np.outer(p, lines) - np.pi * k * (k - 1) / lines.size).sum(axis=1)
    ends = np.clip(np.minimum(p, 1.0 - p) * 20.0, 0.0, 1.0)
    return np.asarray(ends * waves / max(float(np.abs(waves).max(initial=0.0)), 1e-12))


PART_KINDS: dict[str, Callable[[Array, int], Array]] = {
    "rest": lambda p, cycles: np.zeros_like(p),
    "hold": lambda p, cycles: np.clip(10.0 * np.minimum(p, 1.0 - p), 0.0, 1.0),
    "triangle": _triangle,
    "steps": _steps,
    "staircase": _staircase,
    "creep": _creep,
    "one way": _one_way,
    "sine": lambda p, cycles: np.asarray(np.sin(_turns(p, cycles))),
    "release": _release,
    "chirp": _chirp,
    "multisine": _multisine,
}
"""Values at a part p (T,) of the time, in [0, 1), for a number of cycles; the largest is 1."""


def rendered(parts: Sequence[Part], t: Array, slew: float = np.inf) -> Array:
    """Return a command (T,) at times t (T,): rest, the parts in turn, rest; no faster than ``slew`` per s."""
    duration, u = float(t[-1] - t[0]) + float(t[1] - t[0]), np.zeros(t.size)
    rest = max(REST_PART * duration, LEAST_REST)
    start, span, total = float(t[0]) + rest, duration - 2 * rest, sum(p.share for p in parts)
    for part in parts:
        long = span * part.share / total
        there = (t >= start - 1e-9) & (t < start + long - 1e-9)
        u[there] = part.values(t[there] - start, long)
        start += long
    return u if np.isinf(slew) else slowed(u, t, slew)


def slowed(u: Array, t: Array, slew: float) -> Array:
    """Return a command (T,) that changes by no more than ``slew`` per s, and is 0 at both ends: the mean of the
    smallest such one above it and the largest below.
    """
    way = slew * (t - t[0])
    below = np.minimum.accumulate(u - way) + way
    below = np.minimum(below, np.minimum.accumulate((u + way)[::-1])[::-1] - way)
    above = np.maximum.accumulate(u + way) - way
    above = np.maximum(above, np.maximum.accumulate((u - way)[::-1])[::-1] + way)
    bound = np.minimum(way, way[::-1])
    return np.asarray(np.clip((above + below) / 2, -bound, bound))


def in_words(parts: Sequence[Part], duration: float, unit: str) -> str:
    """Return a command in words, part by part."""
    span = duration - 2 * max(REST_PART * duration, LEAST_REST)
    total = sum(p.share for p in parts)
    return ", ".join(p.told(span * p.share / total, unit) for p in parts)


__all__ = ["PART_KINDS", "Part", "in_words", "rendered", "slowed"]
