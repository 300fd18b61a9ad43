"""What unseen data show of a named effect: what the motion lacks without it, over the coordinate that matters.

See `signlin_ros.diagnosis.onestep` for how it is computed, `signlin_ros.diagnosis.coordinates` for the coordinate.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from signlin_ros.diagnosis.coordinates import Place, place_of
from signlin_ros.diagnosis.curves import Band, band, memory
from signlin_ros.diagnosis.findings import Findings
from signlin_ros.diagnosis.onestep import Motion, Target, lacking, motion_of, smoothed, target, target_at
from signlin_ros.diagnosis.parameters import added_parameters
from signlin_ros.diagnosis.rank import Ranked
from signlin_ros.diagnosis.refusals import plausible
from signlin_ros.diagnosis.results import Estimate

Array = NDArray[np.float64]

QUIET, QUIET_OVER_TIME = 1.5, 0.3
"""The filter is just so long that no more noise is left than this multiple of what the effect does (RMS), where means
are shown, and where every sample counts;"""
WIDTHS = (1, 3, 5, 9, 17, 33, 65)
SLOWEST = 0.1
"""where means are shown it is no longer than so many seconds."""
ENOUGH = 60
"""Samples below which nothing is shown of a direction of motion."""
PARTS = 30
"""Into so many parts of time something is divided that is shown for each unit of something else."""


@dataclass(frozen=True, eq=False)
class Explanation:
    """What the motion lacks without an effect, ``measured`` (N,), and what the effect makes of it, ``computed`` (N,).

    All other parameters are those of the fit with ``effects``; an empty ``effect`` is none at all. ``found`` and
    ``curve`` are the means of both over the coordinate, one for each direction of motion that is told apart.
    ``parameters`` of the effect in that fit.
    """

    effect: str
    effects: tuple[str, ...]
    measured: Array
    computed: Array
    found: tuple[Band, ...]
    curve: tuple[Band, ...]
    parameters: Mapping[str, Estimate]


@dataclass(frozen=True, eq=False)
class Evidence:
    """The evidence for one effect, beside its nearest rival on the same data.

    ``quantity`` and ``unit`` of what is lacking; ``place``: the coordinate, with x (N,); ``window`` of the filter in s;
    ``sources`` of the data.
    """

    quantity: str
    unit: str
    place: Place
    window: float
    sources: tuple[str, ...]
    named: Explanation
    rival: Explanation | None


def evidence(f: Findings, effect: str, within: Ranked | None = None) -> Evidence | None:
    """Return the evidence for an effect of the proposal (or of ``within``); None where nothing can be shown of it."""
    ranked = within or f.final.ranked
    motion = motion_of(f.unseen, ranked, effect)
    goal = target(motion) if motion else None
    if motion is None or goal is None:
        return None
    measured, computed = lacking(motion, goal)
    width = _width(measured, computed, motion.step)
    place = place_of(motion, goal, width, smoothed(computed, 1))
    if place.single:
        width = _width(measured, computed, motion.step, QUIET_OVER_TIME)
    quantity, unit = ("missing resistance", "Ohm") if place.per is not None else (goal.quantity, goal.unit)
    named = _explanation(f, ranked, effect, place, measured, computed, width)
    if named is None:
        return None
    rival = _rival(f, ranked, effect, goal, place, width)
    place = replace(place, x=place.x[place.inside], side=place.side[place.inside])
    sources = tuple(dict.fromkeys(s.source for s in f.unseen.segments))
    return Evidence(quantity, unit, place, width * motion.step, sources, named, rival)


def _width(measured: Sequence[Array], computed: Sequence[Array], step: float, quiet: float = QUIET) -> int:
    """Return the length of the filter in samples."""
    noise = [m - c for m, c in zip(measured, computed, strict=True)]
    best = WIDTHS[0]
    for best in WIDTHS:
        left, does = (float(np.nanstd(smoothed(parts, best))) for parts in (noise, computed))
        if left <= quiet * does or (quiet == QUIET and 2 * best * step > SLOWEST):
            break
    return best


def nearest_rival(f: Findings, ranked: Ranked, effect: str) -> tuple[Ranked, str] | None:
    """Return the best other effect in place of one, with all others kept, as fitted; None if none was tried.

    What was refused, or fits only with parameters that it cannot have, is no rival; what raises the error on unseen
    data is one only where nothing else is.
    """
    others = set(ranked.effects) - {effect}
    options = [s.ranked for s in f.singles] if not others else list(f.pairs)
    raising = {s.ranked.effects for s in f.singles if s.gain <= 0}
    fitting = [
        (r, (set(r.effects) - others).pop())
        for r in options
        if set(r.effects) > others and len(r.effects) == len(ranked.effects) and effect not in r.effects
    ]
    rivals = [(r, other) for r, other in fitting if other not in f.declined and plausible(f.problem, r)]
    return min(rivals, key=lambda rival: (rival[0].effects in raising, rival[0].evidence), default=None)


def _rival(f: Findings, ranked: Ranked, effect: str, goal: Target, place: Place, width: int) -> Explanation | None:
    """Return the nearest rival's explanation; where there is no rival, what is left if nothing takes the place."""
    found = nearest_rival(f, ranked, effect)
    if found is None:
        others = set(ranked.effects) - {effect}
        rest = next((s.ranked for s in (*f.steps, *f.singles) if set(s.ranked.effects) == others), None)
        found = (rest, "") if rest else None
    motion = motion_of(f.unseen, *found) if found else None
    if found is None or motion is None:
        return None
    return _explanation(f, *found, place, *lacking(motion, _same(motion, goal)), width)


def _same(motion: Motion, goal: Target) -> Target:
    """Return the target for another model: the inertia may have been fitted anew."""
    return goal if goal.kind == "sensor" else target_at(motion, goal.name)


def _explanation(
    f: Findings,
    ranked: Ranked,
    effect: str,
    place: Place,
    measured: Sequence[Array],
    computed: Sequence[Array],
    width: int,
) -> Explanation | None:
    """Return what the motion lacks and what an effect makes of it; None where the record has too little of it."""
    a, b = (_for_each_unit(smoothed(parts, width), place)[place.inside] for parts in (measured, computed))
    x, side = place.x[place.inside], place.side[place.inside]
    good = np.isfinite(a) & np.isfinite(b)
    parts = [own for s in np.unique(side) if np.count_nonzero(own := good & (side == s)) >= ENOUGH]
    if not parts:
        return None
    block = max(memory(a[good] - b[good]), 2 * width)
    found, curve = (
        tuple(band(x[own], values[own], block, dense_at_zero=place.dense) for own in parts) for values in (a, b)
    )
    parameters = added_parameters(f, ranked, effect) if effect else {}
    return Explanation(effect, ranked.effects, a, b, found, curve, parameters)


def _for_each_unit(values: Array, place: Place) -> Array:
    """Return what is lacking (N,) for each unit of what ``place`` says, e.g. a resistance: minus voltage per ampere."""
    if place.per is None:
        return values
    mean = uniform_filter1d(np.nan_to_num(place.per) ** 2, max(1, values.size // PARTS), mode="nearest")
    return np.asarray(-values * place.per / np.maximum(mean, 1e-12 * mean.max()))


__all__ = ["Evidence", "Explanation", "evidence", "nearest_rival"]
