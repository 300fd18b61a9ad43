"""How the machine moved, and where its model errs: what situations are looked for in."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from signlin_ros.comparison.missing import Missing
from signlin_ros.follow.observer import Observer

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Kind = TypeVar("Kind", bound=np.generic)

FORGOTTEN_SHARE = 0.1
"""Correlation of a quantity with itself below which it has forgotten itself."""
RAREST, MOST_TIME = 0.004, 0.97
"""Part of the time that a situation may take."""
MIN_SUMMED_BLOCKS = 20
"""Blocks of time that sums over them need for a standard error."""


@dataclass(frozen=True)
class Split:
    """A candidate: a name, its samples (N,), and by how much its share of the error exceeds that of the time."""

    name: str
    kind: str
    mask: Mask
    gain: float
    period: float = 0.0


class Scene:
    """All stretches end to end: how the machine moved, and the density of the error at each sample (N,)."""

    def __init__(self, observer: Observer, lacking: Sequence[Missing], units: Mapping[str, str]) -> None:
        self.observer, self.model, self.units = observer, observer.model, units
        self.parts = [s.t.size for s in observer.stretches]
        self.t = np.concatenate([s.t - s.t[0] for s in observer.stretches])
        self.u = np.concatenate([s.u for s in observer.stretches])
        self.x = np.concatenate(observer.best_states)
        self.missing = max(lacking, key=lambda m: m.rms / m.typical)
        self.value = np.concatenate(self.missing.values)
        self.error = np.sum([(np.concatenate(m.values) / m.typical) ** 2 for m in lacking], axis=0)
        self.resolution = max(self.missing.resolution, observer.step)

    def column(self, name: str) -> Array | None:
        """Return a state or an input (N,) by name, None if the model has no such thing."""
        for names, values in ((self.model.states, self.x), (self.model.inputs, self.u)):
            if name in names:
                return np.asarray(values[:, names.index(name)])
        return None

    def by_stretch(self, values: NDArray[Kind]) -> list[NDArray[Kind]]:
        """Return values (N,) of each stretch."""
        return list(np.split(values, np.cumsum(self.parts)[:-1]))

    def unit(self, name: str) -> str:
        """Return the unit of a quantity, as the record has it, else the model."""
        return self.units.get(name, self.model.units.get(name, ""))

    @property
    def velocity(self) -> Array:
        """The velocity (N,)."""
        found = self.column(self.model.plant.velocity)
        return np.zeros(self.t.size) if found is None else found

    @cached_property
    def slow(self) -> float:
        """A speed that is not told from standing."""
        name = self.model.plant.velocity
        if name in self.observer.channels:
            return 3.0 * self.observer.noise[self.observer.channels.index(name)].sigma
        return 1e-3 * float(np.sqrt(np.mean(self.velocity**2)))

    @cached_property
    def turns(self) -> NDArray[np.int64]:
        """Samples at which the velocity changes its sign by more than noise: it gets beyond `slow` on both sides."""
        sides = np.where(np.abs(self.velocity) > self.slow, np.sign(self.velocity), 0.0)
        moving = np.flatnonzero(sides)
        changed = sides[moving[1:]] != sides[moving[:-1]]
        return np.asarray((moving[1:][changed] + moving[:-1][changed]) // 2)

    @cached_property
    def block(self) -> int:
        """Samples in a block beyond which errors do not remember each other; at least `MIN_SUMMED_BLOCKS` blocks."""
        memory = max(remembered(self.error), int(self.resolution / self.observer.step))
        return int(max(1, min(2 * memory, self.error.size // MIN_SUMMED_BLOCKS)))

    def excess(self, mask: Mask, error: Array) -> float:
        """Return by how many standard errors a mask (N,) holds more of the error (N,) than its share of the time."""
        sums = np.add.reduceat((mask - mask.mean()) * (error - error.mean()), np.arange(0, error.size, self.block))
        spread = float(np.sqrt(np.sum(sums**2)))
        return float(np.sum(sums)) / spread if spread > 0 else 0.0

    def as_large_elsewhere(self, mask: Mask) -> float:
        """Return at which share of all cyclic shifts in time a mask (N,) holds as much of the error as in place."""
        spectrum = np.conj(np.fft.rfft(mask.astype(float))) * np.fft.rfft(self.error)
        held = np.fft.irfft(spectrum, mask.size)
        return float(np.mean(held >= held[0] * (1 - 1e-12)))

    def split(self, name: str, kind: str, mask: Mask) -> Split | None:
        """Return a candidate, None where it holds (nearly) nothing or all, or has no more than its share."""
        time = float(mask.mean())
        share = float(self.error[mask].sum() / self.error.sum())
        if not RAREST < time < MOST_TIME or share <= time:
            return None
        return Split(name, kind, mask, share - time)


def remembered(values: Array) -> int:
    """Return after how many samples a quantity (N,) has forgotten itself; N if it never does."""
    z = values - values.mean()
    own = np.fft.irfft(np.abs(np.fft.rfft(z, 2 * z.size)) ** 2)[: z.size]
    below = np.flatnonzero(own < FORGOTTEN_SHARE * own[0]) if own[0] > 0 else np.array([1])
    return int(below[0]) if below.size else z.size


def time_to(scene: Scene, events: NDArray[np.int64]) -> Array:
    """Return the time (N,) in s to the nearest event, given by sample; across stretches no distance is small."""
    number = np.repeat(np.arange(len(scene.parts)), scene.parts)
    clock = scene.t + number * (1e6 + scene.t.max())
    known = np.concatenate([[-np.inf], clock[events], [np.inf]])
    after = np.searchsorted(known, clock)
    return np.asarray(np.minimum(clock - known[after - 1], known[after] - clock))


__all__ = ["Scene", "Split", "remembered", "time_to"]
