"""Where a model fails: situations that hold more of its error than of the time.

The error is what the equations lack, squared: a fault is found where it acts. Each family of situations is split where
that divides the error best; what is kept stands out of its scatter, matters, and is no shadow of a better one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import welch

from signlin_ros.comparison.missing import Missing
from signlin_ros.comparison.scene import Scene, Split, time_to
from signlin_ros.comparison.situations import SPLIT_FAMILIES, rounded
from signlin_ros.follow.observer import Observer

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

LEAST_SEGMENT = 64
"""Samples of a segment whose spectrum is taken."""
SIGNIFICANT = 3.0
"""So many standard errors, from sums over blocks, must the share of the error exceed the share of the time."""
LARGE_EXCESS, MIN_EXCESS_ERRORS, MAX_SHIFT_SHARE = 0.3, 2.2, 0.005
"""An excess above `LARGE_EXCESS` needs only `MIN_EXCESS_ERRORS` standard errors if no more than `MAX_SHIFT_SHARE` of
all shifts in time match it."""
SHADOW = 2.5
"""The same once what the situations above it explain is taken out."""
MATTERS, LIFT = 10.0, 1.2
"""Least excess of the share of the error over the share of the time, in per cent, and least ratio of the two."""
BAND_ERROR, BAND_MOTION = 0.6, 0.1
"""A band is named where it holds at least this share of the error and at most this share of the acceleration."""


@dataclass(frozen=True)
class Region:
    """A situation with its shares of the squared error and of the time (of a band: of the acceleration), in per cent;
    ``mean`` of what is missing in it, with its error, in ``unit``; ``kind``: the family; ``period`` of the position.
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


def locate(observer: Observer, lacking: Sequence[Missing], units: Mapping[str, str]) -> tuple[Region, ...]:
    """Return the situations in which the error is concentrated, the most telling first; none if nothing is clear."""
    lacking = [m for m in lacking if m.clear]
    if not lacking:
        return ()
    scene = Scene(observer, lacking, units)
    best = [max(found, key=lambda s: s.gain) for family in SPLIT_FAMILIES if (found := [s for s in family(scene) if s])]
    kept: list[Split] = []
    error = scene.error
    for split in sorted(best, key=lambda s: -s.gain):
        if _significant(scene, split) and scene.excess(split.mask, error) > SHADOW:
            kept.append(split)
            error = _explained(scene.error, kept)
    return (*(_region(scene, s) for s in kept), *_band(scene))


def _significant(scene: Scene, split: Split) -> bool:
    """Whether the excess matters and is beyond its scatter, or a large one is lost when it is shifted in time."""
    if split.gain < max(MATTERS / 100, (LIFT - 1) * float(split.mask.mean())):
        return False
    errors = scene.excess(split.mask, scene.error)
    by_place = (
        split.gain > LARGE_EXCESS
        and errors > MIN_EXCESS_ERRORS
        and scene.as_large_elsewhere(split.mask) < MAX_SHIFT_SHARE
    )
    return errors > SIGNIFICANT or by_place


def _explained(error: Array, kept: Sequence[Split]) -> Array:
    """Return the error (N,) without its means over the situations found so far and their overlaps."""
    code = sum(s.mask.astype(int) << i for i, s in enumerate(kept))
    means = np.bincount(code, error) / np.maximum(np.bincount(code), 1)
    return np.asarray(error - means[code])


def _region(scene: Scene, split: Split) -> Region:
    m, time = scene.missing, float(split.mask.mean())
    shares, mask = (100 * (time + split.gain), 100 * time), tuple(scene.by_stretch(split.mask))
    mean = block_mean(scene.value, split.mask, scene.block)
    return Region(split.name, split.kind, *shares, m.name, *mean, m.unit, mask, split.period)


def block_mean(values: Array, mask: Mask, block: int) -> tuple[float, float]:
    """Return the mean of values (N,) in a mask (N,) with its standard error, from sums over blocks of samples."""
    mean, count = float(values[mask].mean()), int(mask.sum())
    sums = np.add.reduceat(np.where(mask, values - mean, 0.0), np.arange(0, mask.size, block))
    return mean, float(np.sqrt(np.sum(sums**2))) / count


def by_direction(observer: Observer, lacking: Missing, units: Mapping[str, str]) -> dict[str, dict[str, float]]:
    """Return means and standard errors of what is missing, forward and backward; not what is blurred by a reversal."""
    scene = Scene(observer, [lacking], units)
    v, turns = scene.velocity, scene.turns
    clear = time_to(scene, turns) > scene.resolution
    sides = {"forward": clear & (v > scene.slow), "backward": clear & (v < -scene.slow)}
    found = {side: block_mean(scene.value, mask, scene.block) for side, mask in sides.items() if mask.any()}
    return {side: {"mean": mean, "std": std} for side, (mean, std) in found.items()}


def _band(scene: Scene) -> tuple[Region, ...]:
    """Return the octaves in which what is missing is concentrated while the motion is not, if there are such."""
    value, velocity = (max(scene.by_stretch(values), key=len) for values in (scene.value, scene.velocity))
    segment, rate = min(value.size // 6, int(8.0 / scene.observer.step)), 1.0 / scene.observer.step
    if segment < LEAST_SEGMENT:
        return ()
    f, error = welch(value, rate, nperseg=segment)
    _, motion = welch(np.gradient(velocity), rate, nperseg=segment)
    top = min(0.5 * rate, 0.5 / scene.resolution)
    edges = [top / 2**k for k in range(int(np.log2(max(top / f[2], 1.0))) + 1)][::-1]
    found = []
    for i, low in enumerate(edges[:-1]):
        for high in edges[i + 1 : i + 3]:
            inside = (f >= low) & (f < high)
            share, other = error[inside].sum() / error[1:].sum(), motion[inside].sum() / max(motion[1:].sum(), 1e-300)
            found.append((float(share - other), rounded(low), rounded(high), float(share), float(other)))
    _, low, high, share, other = max(found, default=(0.0,) * 5)
    if share < BAND_ERROR or other > BAND_MOTION:
        return ()
    m, name = scene.missing, f"{low:g} to {high:g} Hz"
    return (Region(name, "frequency", 100 * share, 100 * other, m.name, 0.0, m.rms * share**0.5, m.unit),)


__all__ = ["Region", "block_mean", "by_direction", "locate"]
