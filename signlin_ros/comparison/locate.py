"""Where a model fails: situations that hold more of its error than of the time.

The error is what the equations lack (`signlin_ros.comparison.missing`), squared, so that a fault is found where it
acts and not where its consequences drift to. Every family of situations (speed, position, load, branch of a loop, ...)
is split where that divides the error best, thresholds taken from the data; what is kept must stand out of the
correlated scatter of the error, must matter, and must not be the shadow of a situation that explains more.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import welch

from signlin_ros.comparison.missing import Missing
from signlin_ros.follow.observer import Observer

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

FORGOTTEN = 0.1
"""Correlation of the error with itself below which it has forgotten itself."""
RAREST, MOST_TIME = 0.004, 0.97
"""Part of the time that a situation may take."""
JUMP, OF_ALL, LEAST_JUMPS, RARE = 10, 0.05, 3, 0.02
"""A jump of the input: times its usual step and part of its range at least; how many, and which part of the samples."""
LEAST_SEGMENT = 64
"""Samples of a segment whose spectrum is taken."""
SIGNIFICANT = 3.0
"""So many standard errors, from sums over blocks, must the share of the error exceed the share of the time."""
LARGE, FEW, RARE = 0.3, 2.2, 0.005
"""An excess above `LARGE` needs only `FEW` standard errors if no more than `RARE` of all shifts in time match it."""
SHADOW = 2.5
"""The same once what the situations above it explain is taken out."""
MATTERS = 10.0
"""Least excess of the share of the error over the share of the time, in per cent."""
LIFT = 1.2
"""Least ratio of the two shares."""
LEAST_BLOCKS = 20
"""Blocks of time that sums over them need for a standard error."""
BAND_ERROR, BAND_MOTION = 0.6, 0.1
"""A band is named where it holds at least this share of the error and at most this share of the acceleration."""
QUANTILES = (0.02, 0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.85, 0.9, 0.95, 0.98)
NEAR = (0.005, 0.01, 0.02, 0.03, 0.05, 0.1, 0.2)
"""Time in s within which a sample counts as near an event."""
HARMONICS = 1500
"""Harmonics over the way at which a pattern is looked for,"""
PATTERN_SAMPLES = 3000
"""in so many samples."""
SLOW_PASSAGES = 0.1
"""Patterns are looked for down to what this slowest part of the samples resolves."""
PATTERN_CLEAR = 12
"""A pattern must explain so many times what the median harmonic does."""
PATTERN_SHARE = 0.04
"""Least share of what is missing that a pattern over position must explain."""


@dataclass(frozen=True)
class Region:
    """A situation, with its share of the error (of its square) and its share of the time, both in per cent.

    ``mean`` of what is missing in it, with its standard error, in ``unit``; ``kind``: the family; ``period`` of the
    position in which what is missing repeats, 0 for none. Of a frequency band the share of the time is that of the
    acceleration's power.
    """

    name: str
    kind: str
    share_of_error: float
    share_of_time: float
    what: str = ""
    mean: float = 0.0
    mean_std: float = 0.0
    unit: str = ""
    mask: tuple[Mask, ...] = ()
    period: float = 0.0

    def to_json(self) -> dict[str, Any]:
        """Return the entry of the contract, with what is missing on average."""
        return {
            "region": self.name,
            "share_of_error_percent": self.share_of_error,
            "share_of_time_percent": self.share_of_time,
            "kind": self.kind,
            "missing": {"what": self.what, "mean": self.mean, "std": self.mean_std, "unit": self.unit},
        }


@dataclass(frozen=True)
class _Split:
    """A candidate: a name, its samples (N,), and by how much its share of the error exceeds that of the time."""

    name: str
    kind: str
    mask: Mask
    gain: float
    period: float = 0.0


class _Scene:
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
        """Samples in a block beyond which errors do not remember each other, but at least `LEAST_BLOCKS` blocks."""
        z = self.error - self.error.mean()
        spectrum = np.abs(np.fft.rfft(z, 2 * z.size)) ** 2
        own = np.fft.irfft(spectrum)[: z.size]
        below = np.flatnonzero(own < FORGOTTEN * own[0]) if own[0] > 0 else np.array([1])
        memory = max(int(below[0]) if below.size else z.size, int(self.resolution / self.observer.step))
        return int(max(1, min(2 * memory, z.size // LEAST_BLOCKS)))

    def excess(self, mask: Array, error: Array) -> float:
        """Return by how many standard errors a mask (N,) holds more of the error (N,) than its share of the time."""
        sums = np.add.reduceat((mask - mask.mean()) * (error - error.mean()), np.arange(0, error.size, self.block))
        spread = float(np.sqrt(np.sum(sums**2)))
        return float(np.sum(sums)) / spread if spread > 0 else 0.0

    def as_large_elsewhere(self, mask: Mask) -> float:
        """Return at which share of all cyclic shifts in time a mask (N,) holds as much of the error as in place."""
        spectrum = np.conj(np.fft.rfft(mask.astype(float))) * np.fft.rfft(self.error)
        held = np.fft.irfft(spectrum, mask.size)
        return float(np.mean(held >= held[0] * (1 - 1e-12)))

    def split(self, name: str, kind: str, mask: Mask) -> _Split | None:
        """Return a candidate, None where it holds (nearly) nothing or all, or has no more than its share."""
        time = float(mask.mean())
        share = float(self.error[mask].sum() / self.error.sum())
        if not RAREST < time < MOST_TIME or share <= time:
            return None
        return _Split(name, kind, mask, share - time)


def locate(observer: Observer, lacking: Sequence[Missing], units: Mapping[str, str]) -> tuple[Region, ...]:
    """Return the situations in which the error is concentrated, the most telling first; none where the model is as
    good as the noise lets one see, or fails everywhere alike.
    """
    lacking = [m for m in lacking if m.clear]
    if not lacking:
        return ()
    scene = _Scene(observer, lacking, units)
    best = [max(found, key=lambda s: s.gain) for family in FAMILIES if (found := [s for s in family(scene) if s])]
    kept: list[_Split] = []
    error = scene.error
    for split in sorted(best, key=lambda s: -s.gain):
        mask = split.mask.astype(float)
        if _matters(split) and _significant(scene, split) and scene.excess(mask, error) > SHADOW:
            kept.append(split)
            error = _explained(scene.error, kept)
    return (*(_region(scene, s) for s in kept), *_band(scene))


def _significant(scene: _Scene, split: _Split) -> bool:
    """Whether the excess stands out of its scatter; a large one also if it is lost when the situation is shifted in
    time, which a record of few independent blocks can show as well.
    """
    errors = scene.excess(split.mask.astype(float), scene.error)
    by_place = split.gain > LARGE and errors > FEW and scene.as_large_elsewhere(split.mask) < RARE
    return errors > SIGNIFICANT or by_place


def _matters(split: _Split) -> bool:
    time = float(split.mask.mean())
    return split.gain >= MATTERS / 100 and split.gain >= (LIFT - 1) * time


def _explained(error: Array, kept: Sequence[_Split]) -> Array:
    """Return the error (N,) without its means over the situations found so far and their overlaps."""
    code = sum(s.mask.astype(int) << i for i, s in enumerate(kept))
    means = np.bincount(code, error) / np.maximum(np.bincount(code), 1)
    return np.asarray(error - means[code])


def _region(scene: _Scene, split: _Split) -> Region:
    edges = np.cumsum([0, *scene.parts])
    mean, std = block_mean(scene.value, split.mask, scene.block)
    return Region(
        name=split.name,
        kind=split.kind,
        share_of_error=100 * float(scene.error[split.mask].sum() / scene.error.sum()),
        share_of_time=100 * float(split.mask.mean()),
        what=scene.missing.name,
        mean=mean,
        mean_std=std,
        unit=scene.missing.unit,
        mask=tuple(split.mask[a:b] for a, b in pairwise(edges)),
        period=split.period,
    )


def block_mean(values: Array, mask: Mask, block: int) -> tuple[float, float]:
    """Return the mean of values (N,) in a mask (N,) with its standard error, from sums over blocks of samples."""
    mean, count = float(values[mask].mean()), int(mask.sum())
    sums = np.add.reduceat(np.where(mask, values - mean, 0.0), np.arange(0, mask.size, block))
    return mean, float(np.sqrt(np.sum(sums**2))) / count


def by_direction(observer: Observer, lacking: Missing, units: Mapping[str, str]) -> dict[str, dict[str, float]]:
    """Return mean and standard error of what is missing while moving forward and while moving backward.

    Around reversals both are blurred: what is closer to one than the resolution is left out.
    """
    scene = _Scene(observer, [lacking], units)
    v, turns = scene.velocity, scene.turns
    clear = _time_to(scene, turns) > scene.resolution if turns.size else np.ones(v.size, dtype=np.bool_)
    sides = {"forward": clear & (v > scene.slow), "backward": clear & (v < -scene.slow)}
    found = {side: block_mean(scene.value, mask, scene.block) for side, mask in sides.items() if mask.any()}
    return {side: {"mean": mean, "std": std} for side, (mean, std) in found.items()}


# -------------------------------------------------------------------- families


Splits = Iterator["_Split | None"]


def _rounded(value: float) -> float:
    """Return a value rounded to what one says aloud: two digits."""
    return float(f"{value:.2g}")


def _thresholds(values: Array) -> list[float]:
    return list(dict.fromkeys(_rounded(float(q)) for q in np.quantile(values, QUANTILES)))


def _label(scene: _Scene, name: str) -> str:
    return scene.units.get(name, scene.model.units.get(name, ""))


def _below_and_above(scene: _Scene, name: str, kind: str, values: Array, form: str = "|{}|") -> Splits:
    unit, shown = _label(scene, name), form.format(name)
    for limit in _thresholds(values):
        yield scene.split(f"{shown} < {limit:g} {unit}", kind, values < limit)
        yield scene.split(f"{shown} > {limit:g} {unit}", kind, values > limit)


def _direction(scene: _Scene) -> Splits:
    name, unit = scene.model.plant.velocity, _label(scene, scene.model.plant.velocity)
    for sign, mask in ((">", scene.velocity > scene.slow), ("<", scene.velocity < -scene.slow)):
        yield scene.split(f"{name} {sign} 0 {unit}", "direction", mask)


def _speed(scene: _Scene) -> Splits:
    yield from _below_and_above(scene, scene.model.plant.velocity, "speed", np.abs(scene.velocity))


def _reversals(scene: _Scene) -> Splits:
    yield from _near(scene, scene.turns, f"of a reversal of {scene.model.plant.velocity}", "reversal")


def _near(scene: _Scene, events: NDArray[np.int64], what: str, kind: str) -> Splits:
    if not events.size:
        return
    away = _time_to(scene, events)
    for reach in NEAR:
        if reach >= 0.5 * scene.resolution:
            yield scene.split(f"within {1e3 * reach:g} ms {what}", kind, away <= reach)


def _time_to(scene: _Scene, events: NDArray[np.int64]) -> Array:
    """Return the time (N,) in s to the nearest event, given by sample; across stretches no distance is small."""
    number = np.repeat(np.arange(len(scene.parts)), scene.parts)
    clock = scene.t + number * (1e6 + scene.t.max())
    at = np.searchsorted(clock[events], clock)
    left, right = clock[events[np.clip(at - 1, 0, events.size - 1)]], clock[events[np.clip(at, 0, events.size - 1)]]
    return np.asarray(np.minimum(np.abs(clock - left), np.abs(clock - right)))


def _position(scene: _Scene) -> Splits:
    name = scene.model.plant.position
    q = scene.column(name)
    if q is None:
        return
    yield from _below_and_above(scene, name, "position", q, "{}")
    yield from _below_and_above(scene, name, "position", np.abs(q))


def _current(scene: _Scene) -> Splits:
    i = scene.column("current")
    if i is not None:
        yield from _below_and_above(scene, "current", "load", np.abs(i))


def _input_size(scene: _Scene) -> Splits:
    name = scene.model.inputs[0]
    if name != scene.model.plant.velocity:
        yield from _below_and_above(scene, name, "input", np.abs(scene.u[:, 0]))


def _input_sign(scene: _Scene) -> Splits:
    name = scene.model.inputs[0]
    if name != scene.model.plant.velocity:
        for sign, mask in ((">", scene.u[:, 0] > 0), ("<", scene.u[:, 0] < 0)):
            yield scene.split(f"{name} {sign} 0 {_label(scene, name)}", "input sign", mask)


def _input_steps(scene: _Scene) -> Splits:
    """After a jump of the input, where it does jump: rarely, and by much more than it usually moves."""
    steps = np.abs(np.diff(scene.u[:, 0], prepend=scene.u[0, 0]))
    jumps = np.flatnonzero(steps > max(JUMP * float(np.median(steps)), OF_ALL * float(np.ptp(scene.u[:, 0]))))
    if LEAST_JUMPS <= jumps.size < RARE * steps.size:
        yield from _near(scene, jumps, f"of a step of {scene.model.inputs[0]}", "input step")


def _branch(scene: _Scene) -> Splits:
    q, v = scene.column(scene.model.plant.position), scene.velocity
    held = scene.model.parameters.get("k", 0.0) > 0 or scene.model.plant.motion_is_imposed()
    if q is not None and held:
        name, other = scene.model.plant.position, scene.model.plant.velocity
        yield scene.split(f"loading ({name} and {other} of the same sign)", "branch", q * v > 0)
        yield scene.split(f"unloading ({name} and {other} of opposite sign)", "branch", q * v < 0)


def _power(scene: _Scene) -> Splits:
    effort = scene.column("current") if "current" in scene.model.states else scene.u[:, 0]
    if effort is not None and scene.model.plant.velocity in scene.model.states:
        yield scene.split("driving (effort along the motion)", "power", effort * scene.velocity > 0)
        yield scene.split("braking (effort against the motion)", "power", effort * scene.velocity < 0)


def _time(scene: _Scene) -> Splits:
    length = float(scene.t.max())
    for limit in dict.fromkeys(_rounded(part * length) for part in (0.01, 0.02, 0.05, 0.1, 0.2)):
        yield scene.split(f"first {limit:g} s", "start", scene.t < limit)
    for limit in dict.fromkeys(_rounded(part * length) for part in (0.33, 0.5, 0.67)):
        yield scene.split(f"after {limit:g} s", "drift", scene.t > limit)


def _pattern(scene: _Scene) -> Splits:
    """Position within a period, where what is missing swings with the position."""
    name = scene.model.plant.position
    q = scene.column(name)
    found = None if q is None else _period(scene, q)
    if q is None or found is None:
        return
    harmonic, phase = found
    distance = np.pi / harmonic
    centre = (-phase / harmonic) % distance
    near = np.abs((q - centre + distance / 2) % distance - distance / 2) < 0.5 * (distance / 2)
    period, unit = 2 * np.pi / harmonic, _label(scene, name)
    place = f"{distance / 4:.2g} {unit} of {centre:.2g} + {distance:.3g} n"
    text = f"{name} within {place} (a pattern of period {period:.3g} {unit})"
    split = scene.split(text, "position in its period", near)
    yield replace(split, period=float(period)) if split else None


def _period(scene: _Scene, q: Array) -> tuple[float, float] | None:
    """Return N and phi of the pattern cos(N q + phi) that explains most of what is missing; None if none does.

    Fast passages are blurred by the resolution and weigh less.
    """
    every = max(1, q.size // PATTERN_SAMPLES)
    q, v, value = q[::every], scene.velocity[::every], scene.value[::every]
    span, speed = float(np.ptp(q)), float(np.quantile(np.abs(v), SLOW_PASSAGES))
    highest = np.pi / max(scene.resolution * max(speed, 1e-12), 1e-9 * max(span, 1e-12))
    lowest = 4 * np.pi / span if span > 0 else np.inf
    if highest <= lowest:
        return None
    count = int(min(HARMONICS, 2 * span * (highest - lowest) / np.pi + 2))
    harmonics = np.linspace(lowest, min(highest, lowest + HARMONICS * np.pi / (2 * span)), count)
    weight = 1.0 / (1.0 + (harmonics[:, None] * v * scene.resolution) ** 2)
    waves = weight * np.exp(-1j * harmonics[:, None] * q)
    amplitude = waves @ (value - value.mean())
    explained = 2 * np.abs(amplitude) ** 2 / np.sum(weight**2, axis=1) / np.sum((value - value.mean()) ** 2)
    best = int(np.argmax(explained))
    clear = explained[best] > max(PATTERN_SHARE, PATTERN_CLEAR * float(np.median(explained)))
    return (float(harmonics[best]), float(np.angle(amplitude[best]))) if clear else None


FAMILIES: tuple[Callable[[_Scene], Splits], ...] = (
    *(_direction, _speed, _reversals, _position, _pattern, _current, _input_size, _input_sign, _input_steps),
    *(_branch, _power, _time),
)
"""Each gives at most one region: its best split."""


def _band(scene: _Scene) -> tuple[Region, ...]:
    """Return the octaves in which what is missing is concentrated while the motion is not, if there are such."""
    longest = max(scene.parts)
    start = int(np.cumsum([0, *scene.parts])[int(np.argmax(scene.parts))])
    segment = min(longest // 6, int(8.0 / scene.observer.step))
    if segment < LEAST_SEGMENT:
        return ()
    part, rate = slice(start, start + longest), 1.0 / scene.observer.step
    f, error = welch(scene.value[part], rate, nperseg=segment)
    _, motion = welch(np.gradient(scene.velocity[part]), rate, nperseg=segment)
    top = min(0.5 * rate, 0.5 / scene.resolution)
    edges = [top / 2**k for k in range(int(np.log2(max(top / f[2], 1.0))) + 1)][::-1]
    found = []
    for i, low in enumerate(edges[:-1]):
        for high in edges[i + 1 : i + 3]:
            inside = (f >= low) & (f < high)
            share, other = error[inside].sum() / error[1:].sum(), motion[inside].sum() / max(motion[1:].sum(), 1e-300)
            found.append((float(share - other), _rounded(low), _rounded(high), float(share), float(other)))
    if not found:
        return ()
    _, low, high, share, other = max(found)
    if share < BAND_ERROR or other > BAND_MOTION:
        return ()
    m, name = scene.missing, f"{low:g} to {high:g} Hz"
    return (Region(name, "frequency", 100 * share, 100 * other, m.name, 0.0, m.rms * share**0.5, m.unit),)


__all__ = ["Region", "block_mean", "by_direction", "locate"]
