"""What a sensor or its transmission got wrong for a moment: samples far off, between neighbours that agree.

A lost reading or a filter that runs over the end of a record is no motion, but squares let a single sample outweigh
thousands. What is left out must be beyond doubt: up to three samples in a row, far beyond the noise and beyond whatever
else the record does in so short a time, with the signal back where it was or at the end of the record, no step of the
input nearby, and seldom. A record may begin with a transient: its start is not judged. A position or a velocity has
inertia: of these, samples that are set apart from all others may be more (`wild`).
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d

from signlin_ros.noise import NORMAL_QUARTILE, steps_shown
from signlin_ros.records.clean import gaps
from signlin_ros.records.mapping import ModelData

Array = NDArray[np.float64]
Index = NDArray[np.intp]

MAX_OUTLIER_RUN = 3
"""Most samples in a row that are off."""
MIN_OUTLIER_DEVIATIONS, MIN_OVER_USUAL, MIN_OVER_NEIGHBOURS = 20.0, 3.0, 5.0
"""How far off they are: in robust standard deviations of such departures, in multiples of their `USUAL` quantile, and
of how far apart the neighbours are."""
MIN_OUTLIER_STEPS = 5.0
"""How many steps of a channel that is shown in steps."""
USUAL = 0.995
MAX_SPAN_RATIO = 1e6
"""A value that is off by this many times what the middle 90 % span says nothing of the step in which they are shown."""
MAX_INPUT_CHANGE = 2.0
"""An input that changes nearby by more than this many times the 95 % quantile of its changes may be the cause."""
MAX_OUTLIER_SHARE, MAX_FEW_OUTLIERS = 1e-3, 3
"""Largest share of the samples, and number that is few anyway: what happens more often is what the machine does."""
MIN_USUAL_SAMPLES = 100
"""Samples that it takes to know what is usual."""
MAX_WILD_SHARE = 0.1
"""Largest share of wild samples of what has inertia: beyond, two sources write into one channel."""
MIN_BESIDE_CUBIC = 0.75
"""Least part of its distance from the line between its neighbours that a wild sample lies from a cubic through two on
each side: where a motion turns back within a few samples, as at a hard stop, the cubic turns with it."""
LOOKING_ROUNDS = 4
"""Times that a record is looked through: what lies beside a wild sample shows when that is out."""
PAIR, MIN_MOTION_PEAKS = 2, 10
"""Most of them in a row, and peaks of the motion that it takes at least to know what is usual."""


def without_outliers(record: ModelData, channels: tuple[str, ...]) -> tuple[ModelData, list[str]]:
    """Return a record with such samples of the channels missing (NaN), and a note for each channel that has any."""
    cleaned, notes = {}, []
    for name in channels:
        y = record.measured[name]
        off = _departing(record, y)
        if 0 < off.size <= max(MAX_FEW_OUTLIERS, MAX_OUTLIER_SHARE * y.size):
            cleaned[name] = y.copy()
            cleaned[name][off] = np.nan
            when = ", ".join(f"{t:.6g}" for t in record.t[off][:MAX_FEW_OUTLIERS]) + (
                ", ..." if off.size > MAX_FEW_OUTLIERS else ""
            )
            notes.append(f"{record.source}: {name}: {off.size} outlier(s) at t = {when} s left out")
    return (replace(record, measured={**record.measured, **cleaned}) if cleaned else record), notes


def wild(record: ModelData, name: str, inert: bool = True) -> NDArray[np.bool_]:
    """Return which samples (T,) of a measured signal are off: the seldom ones (`without_outliers`), and more of them
    where each lies between neighbours that agree, `MIN_OVER_USUAL` times further off than any other sample is.

    ``inert``: no step of an input moves it for a sample or two, as a position or a velocity; a current leaps with it.
    """
    y = record.measured[name]
    off = _departing(record, y)
    found = np.zeros(y.size, dtype=np.bool_)
    found[off if off.size <= max(MAX_FEW_OUTLIERS, MAX_OUTLIER_SHARE * y.size) else off[:0]] = True
    for _ in range(LOOKING_ROUNDS):
        before = int(found.sum())
        for there in _stretches(record.t, y, found):
            stepping = _stepping(record.u[there])
            parts = [
                _set_apart(there, y[there], calm, 0 if before else MAX_FEW_OUTLIERS)
                for calm in ((~stepping, stepping | ~stepping) if inert else (~stepping,))
            ]
            found[there[np.concatenate(parts)]] = True
        if before == found.sum():
            break
    return found if found.sum() <= max(MAX_FEW_OUTLIERS, MAX_WILD_SHARE * y.size) else np.zeros_like(found)


def wild_inputs(t: Array, u: Array) -> NDArray[np.bool_]:
    """Return which samples (T,) of an input u (T,) at t (T,) s depart so from neighbours that agree: what a command
    may do, and be it once. Whether it did is for the motion to tell.
    """
    found = np.zeros(u.size, dtype=np.bool_)
    for there in _stretches(t, u, found):
        found[there[_set_apart(there, u[there], np.ones(there.size, dtype=np.bool_), 0, others=0)]] = True
    return found


def _stretches(t: Array, y: Array, out: NDArray[np.bool_]) -> list[Index]:
    """Return the places of the samples of y (T,) at t (T,) s that are there and not ``out`` (T,), by stretches without
    a gap that are long enough.
    """
    found = [first + np.flatnonzero(np.isfinite(y[first:last]) & ~out[first:last]) for first, last in pairwise(gaps(t))]
    return [there for there in found if there.size >= MIN_USUAL_SAMPLES]


def _set_apart(
    at: Index, y: Array, calm: NDArray[np.bool_], few: int, others: int = MIN_MOTION_PEAKS
) -> NDArray[np.intp]:
    """Return the samples of y (T,), where it is ``calm``, that depart from both neighbours and come back, further than
    all others: between the least of them, more than ``few``, and the next peak of the motion is a factor
    `MIN_OVER_USUAL`. ``at`` (T,): places of the samples, between which others may be left out; ``others``: peaks that
    there are at least besides, and as many as are found; 0: none.
    """
    least, found = MIN_OUTLIER_STEPS * _steps(y), np.zeros(y.size, dtype=np.bool_)
    for length in range(1, PAIR + 1):
        away, apart = _away(y, length)
        judged = calm[1 : 1 + away.size] & (away > apart)  # at a corner it does not come back
        peaks = np.flatnonzero(judged & (away >= maximum_filter1d(np.where(judged, away, 0.0), 2 * length + 1)))
        peaks = peaks[np.argsort(-away[peaks], kind="stable")]
        sizes, after = away[peaks], np.append(away[peaks[1:]], 0.0)
        floor = np.maximum(MIN_OUTLIER_DEVIATIONS * float(np.median(away)) / NORMAL_QUARTILE, least[1 + peaks])
        last = np.arange(1, sizes.size + 1)
        beyond = (sizes > floor) & (sizes > MIN_OVER_USUAL * after) & (last > few) & (last <= MAX_WILD_SHARE * y.size)
        if others:
            enough = np.maximum(last, others)
            for k in np.flatnonzero(beyond & (sizes.size - last < enough)).tolist():
                beyond[k] = sizes[k] > MIN_OVER_USUAL * _longest_way(apart, peaks[: k + 1], length, int(enough[k]))
        if not beyond.any():
            continue
        limit = sizes[beyond].min()
        beyond_line = np.sort(peaks[away[peaks] >= limit])
        for k in beyond_line[~_turning(at, y, away, beyond_line, length)].tolist():
            found[1 + k : 1 + k + length] = True
    return np.flatnonzero(found)


def _longest_way(apart: Array, peaks: Index, length: int, enough: int) -> float:
    """Return how far the motion goes at most between two neighbours, ``apart`` (K,), those beside some ``peaks``
    aside: a smooth motion in coarse steps has no peaks to know it by. Infinite where it does not go on in ``enough``
    places.
    """
    rest = apart.copy()
    for aside in range(-length - 1, length + 2):
        rest[np.clip(peaks + aside, 0, rest.size - 1)] = 0.0
    return float(rest.max(initial=0.0)) if np.count_nonzero(rest) >= enough else np.inf


def _away(y: Array, length: int) -> tuple[Array, Array]:
    """Return how far (K,) so many samples in a row lie from the line between those before and after them, all on one
    side of it, and how far apart these two are.
    """
    before, after = y[: -length - 1], y[length + 1 :]
    share = np.arange(1, length + 1)[:, None] / (length + 1)
    inside = np.stack([y[1 + k : 1 + k + before.size] for k in range(length)])
    away = inside - (before + share * (after - before))
    size = np.where((np.sign(away) == np.sign(away[0])).all(axis=0), np.abs(away).min(axis=0), 0.0)
    return np.asarray(size), np.abs(after - before)


def _turning(at: Index, y: Array, away: Array, before: Index, length: int) -> NDArray[np.bool_]:
    """Return whether the motion turns (K,) with some samples in a row: they lie near the cubic through two on each side
    of them, for how far ``away`` (`_away`) they lie from the line through one; ``before`` (K,): the sample before them.
    """
    found = np.zeros(before.size, dtype=np.bool_)
    inner = (before >= 1) & (before + length + 2 < y.size)
    k = before[inner]
    known = [k + i for i in (-1, 0, length + 1, length + 2)]
    distances = [np.abs(y[k + i] - _interpolated(at, y, known, k + i)) for i in range(1, length + 1)]
    found[inner] = np.min(distances, axis=0) < MIN_BESIDE_CUBIC * away[k]
    return found


def _interpolated(at: Index, y: Array, known: list[Index], place: Index) -> Array:
    """Return what the polynomials through some samples, each (K,), give at others (K,) [Lagrange's form]."""
    said = np.zeros(place.size)
    for one in known:
        others = [other for other in known if other is not one]
        said += y[one] * np.prod([(at[place] - at[o]) / (at[one] - at[o]) for o in others], axis=0)
    return said


def _departing(record: ModelData, y: Array) -> NDArray[np.intp]:
    """Return the samples of y (T,) that are off; those of its parts between gaps do not know of each other."""
    found = []
    for there in _stretches(record.t, y, np.zeros(y.size, dtype=np.bool_)):
        found += [there[i] for i in _off(y[there], _stepping(record.u[there]))]
    return np.array(sorted(set(found)), dtype=np.intp)


def _stepping(u: Array) -> NDArray[np.bool_]:
    """Return where (T,) an input of u (T, m) has just changed, or is about to, by more than it usually does.

    What it did before the start is not known.
    """
    changes = np.abs(np.diff(u, axis=0, prepend=u[:1]))
    steps = np.asarray((changes > MAX_INPUT_CHANGE * np.quantile(changes, 0.95, axis=0)).any(axis=1))
    steps[: 2 * MAX_OUTLIER_RUN] = True
    return np.asarray(np.convolve(steps, np.ones(2 * MAX_OUTLIER_RUN + 1), "same") > 0)


def _off(y: Array, stepping: NDArray[np.bool_]) -> set[int]:
    """Return the samples of y (T,), without missing ones, that are off."""
    found: set[int] = set()
    least = MIN_OUTLIER_STEPS * _steps(y)
    for length in range(1, MAX_OUTLIER_RUN + 1):
        away, apart = _away(y, length)
        limit = np.maximum(np.maximum(_unusual(away, length), least[1 : 1 + away.size]), MIN_OVER_NEIGHBOURS * apart)
        beyond_line = np.flatnonzero((away > limit) & ~stepping[1 : 1 + away.size])
        for k in beyond_line[~_turning(np.arange(y.size), y, away, beyond_line, length)]:
            found |= set(range(k + 1, k + 1 + length))
    ends = 0 if stepping[-MAX_OUTLIER_RUN:].any() else _off_at_the_end(y, float(least[-MAX_OUTLIER_RUN - 1]))
    found |= {y.size - 1 - k for k in range(ends)}
    return found


def _steps(y: Array) -> Array:
    """Return the step (T,) in which each value of y (T,) is shown; of what is so far off that the step of the others
    could not be told, that of the others.
    """
    low, middle, high = np.quantile(y, [0.05, 0.5, 0.95])
    core = np.abs(y - middle) <= MAX_SPAN_RATIO * (high - low) if high > low else np.ones(y.shape, dtype=np.bool_)
    shown = steps_shown(y[core])
    steps = np.full(y.shape, shown.min(initial=np.inf) if shown.size else 0.0)
    steps[core] = shown
    return steps


def _unusual(away: Array, length: int) -> float:
    """Return from where on a departure (T,) of so many samples is beyond noise and beyond what else happens, the few
    largest aside: in a short record they and the samples beside them, which depart from them, would be usual.
    """
    rest = away.copy()
    for _ in range(MAX_FEW_OUTLIERS):
        peak = int(np.nanargmax(rest))
        rest[max(peak - length, 0) : peak + length + 1] = np.nan
    usual = np.nanquantile(rest, USUAL)
    return float(max(MIN_OUTLIER_DEVIATIONS * np.median(away) / NORMAL_QUARTILE, MIN_OVER_USUAL * usual))


def _off_at_the_end(y: Array, least: float) -> int:
    """Return how many samples at the end of y (T,) are off: none of them is where the ones before lead."""
    count = 0
    for length in range(1, MAX_OUTLIER_RUN + 1):
        away = np.abs(y[1 + length :] - (y[1:-length] + length * (y[1:-length] - y[: -length - 1])))
        count = length if away[-1] > max(_unusual(away[:-1], length), least) else count
    return count


__all__ = ["wild", "wild_inputs", "without_outliers"]
