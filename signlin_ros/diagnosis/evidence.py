"""What the record itself shows of a named effect: the force that the motion lacks, over the coordinate that matters.

The model without the effect, its other parameters as fitted, predicts every sample from the one before. What the
measurement does beyond that, divided by what a unit of force would have done, is the missing force. The same is taken
from the motion of the model *with* the effect: sticking, delays and own states are in it. Both pass one short filter,
so that one may be laid over the other. What acts in the winding is shown as a voltage, what acts in an output or a
sensor in the unit of that channel. Everything is computed on the data that the fit did not see.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from signlin_ros.diagnosis.coordinates import Place, Track, places
from signlin_ros.diagnosis.curves import Band, band, memory
from signlin_ros.diagnosis.onestep import Motion, Target, lacking, smoothed, target
from signlin_ros.diagnosis.rank import Ranked
from signlin_ros.diagnosis.search import Findings

Array = NDArray[np.float64]

QUIET = 0.5
"""The filter is as short as leaves no more noise than this share of what the effect does (RMS),"""
LONGEST = 65
"""and no longer than so many samples,"""
SLOWEST = 0.1
"""nor than so many seconds."""


@dataclass(frozen=True, eq=False)
class Explanation:
    """What the motion lacks without an effect, ``measured`` (N,), and what the effect makes of it, ``computed`` (N,).

    The effect's other parameters, and those of the base, are those of its own fit.
    """

    effect: str
    effects: tuple[str, ...]
    measured: Array
    computed: Array
    found: tuple[Band, ...]
    curve: tuple[Band, ...]

    @property
    def share(self) -> float:
        """How much of the binned means (of their square, weighed by their errors) the effect's curve explains."""
        mean, curve, error = (
            np.concatenate([getattr(b, name) for b in bands])
            for bands, name in ((self.found, "mean"), (self.curve, "mean"), (self.found, "two_errors"))
        )
        weight = 1.0 / (error**2 + (0.02 * np.max(np.abs(mean), initial=1e-300)) ** 2)
        return float(1.0 - np.sum(weight * (mean - curve) ** 2) / max(np.sum(weight * mean**2), 1e-300))


@dataclass(frozen=True, eq=False)
class Evidence:
    """The evidence for one effect, over the coordinate ``place`` that tells most of it, beside its nearest rival.

    ``quantity`` and ``unit`` of what is lacking; ``x`` (N,) the coordinate, ``side`` (N,) the direction of motion where
    the two directions are told apart (else 0); ``window`` of the filter in s; ``source`` of the data.
    """

    quantity: str
    unit: str
    place: Place
    x: Array
    side: Array
    window: float
    source: str
    named: Explanation
    rival: Explanation | None

    @cached_property
    def sides(self) -> tuple[float, ...]:
        """The directions of motion that are told apart."""
        return tuple(float(s) for s in np.unique(self.side))


def evidence(f: Findings, effect: str, within: Ranked | None = None) -> Evidence | None:
    """Return the evidence for an effect of the proposal (or of ``within``); None where nothing can be shown."""
    ranked = f.final.ranked if within is None else within
    motion = Motion.of(f, ranked, effect)
    goal = target(motion) if motion else None
    if motion is None or goal is None:
        return None
    measured, computed = lacking(motion, goal)
    width = _width(measured, computed, motion.step)
    track = Track.of(motion, goal, width)
    smooth = smoothed(computed, width)
    place = places(track, motion, smooth)
    x, side, keep = place.x, place.side, place.inside
    named = _explanation(ranked, effect, smoothed(measured, width), smooth, place)
    other = nearest_rival(f, ranked, effect)
    rival = _rival(f, other, ranked, goal, width, place) if other else None
    source = ", ".join(s.source for s in f.unseen.segments)
    return Evidence(goal.quantity, goal.unit, place, x[keep], side[keep], width * motion.step, source, named, rival)
