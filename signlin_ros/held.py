"""Channels whose values are held: logged faster than their sensor measures.

Either the values between two measurements are equal, or there is a little noise on what is held, and a change takes a
sample or two. The first shows in runs of equal values of one of two neighbouring lengths, the second in the rhythm of
the squared differences: nearly all of them at regular distances, and so little between that the value stays where it
is until the next change.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from signlin_ros.masks import ends_of_runs, of_runs
from signlin_ros.noise import noise_level, quantum_of, steps_shown

Array = NDArray[np.float64]
Index = NDArray[np.intp]

REGULAR = 0.9
"""Share of the runs of equal values, rests aside, that are of two neighbouring lengths."""
LONGER_HOLD_RATIO = 1.4
"""Least mean length of those."""
MIN_REST_RUN = 1.5
"""Runs beyond so many times that length are rests: what does not change is measured again with the same result."""
CHANCE = 1e-4
"""The largest chance of runs so alike where every sample is as likely to change as any other."""
MAX_CHANGE_DIFFERENCE = 0.01
"""Changes that are alike to this part of them, in nine of ten runs, are the steps of a sensor at a steady speed."""
MIN_CHANGE_OVER_NOISE = 3.0
"""Changes that differ by less than so many times the noise on what is held are alike."""
MIN_SLOW_SENSOR_STEPS = 4.0
"""Values of a slow sensor change by more than so many of their own steps (median)."""
MIN_HOLDS = 20
"""Fewer changes make no rhythm."""
MIN_HOLD_SAMPLES = 5
"""Shortest hold, in samples, whose rhythm is not that of an oscillation: of one of ten samples the two largest of
every five squared differences are three quarters."""
MIN_RHYTHM_SHARE = 0.9
"""Share of the squared differences that two samples in each hold have."""
STAYS = 1.0 / 3.0
"""A held value moves by less than this part of what it changes by from hold to hold (RMS)."""
MIN_REPEATS, LEAP, MAX_DROPPED_SHARE = 2, 2.0, 0.5
"""Least repetitions in a row of a reading that failed; how many of its usual changes a channel leaps after them
(median); and the largest share of such samples: more are a slower sensor."""
FINER_STEPS = 8
"""The rhythm is sought in so many times finer steps than a record resolves."""
RHYTHM_SAMPLES = 20_000
"""So many samples tell a rhythm."""


@dataclass(frozen=True, eq=False)
class Held:
    """Where the values of a channel are new: ``begins`` (k,), samples; ``length``: how many samples each is held;
    ``noise``: differences of neighbouring samples in between (RMS).
    """

    begins: Index
    length: float
    noise: float = 0.0

    def repeated(self, size: int) -> NDArray[np.bool_]:
        """Return which of so many samples hold nothing new."""
        repeats = np.ones(size, dtype=bool)
        repeats[self.begins] = False
        return repeats

    def follows(self, values: Array) -> bool:
        """Return whether values (T,) change where these do: an input that is held makes what it drives jump."""
        energy = np.diff(values) ** 2
        at = np.unique(np.clip(self.begins[1:, None] - np.arange(1, 4), 0, energy.size - 1))
        return bool(energy.any() and energy[at].sum() >= MIN_RHYTHM_SHARE * energy.sum())


def dropped(values: Array) -> NDArray[np.bool_]:
    """Return which of values (T,) repeat the one before because no reading came: runs of equal values that the noise of
    the channel makes none of, not even once in so many samples (`CHANCE`), and after which it leaps. A machine that
    stands still leaves its place slowly; at its largest or smallest value a channel is at the end of its range.
    """
    there = np.flatnonzero(np.isfinite(values))
    y, found = values[there], np.zeros(values.size, dtype=np.bool_)
    changes = np.abs(np.diff(y))
    if y.size < MIN_HOLDS or not changes.any():
        return found
    new = np.concatenate([[True], changes > 0.0])
    sigma = noise_level(np.flatnonzero(new).astype(np.float64), y[new]).sigma
    if sigma == 0.0:
        return found
    alike = min(float(np.median(steps_shown(y))) / (2.0 * np.sqrt(np.pi) * sigma), 1.0)
    longest = int(np.ceil(np.log(CHANCE / y.size) / np.log(alike))) if 0.0 < alike < 1.0 else MIN_REPEATS
    begins, ends = ends_of_runs(~new)  # repetitions
    inside = (y[begins] != 0.0) & (y[begins] > y.min()) & (y[begins] < y.max()) & (ends < y.size)
    long = (ends - begins >= max(longest, MIN_REPEATS)) & inside & (alike < 1.0)
    begins, ends = begins[long], ends[long]
    if not begins.size or np.median(np.abs(y[ends] - y[begins])) < LEAP * np.median(changes[changes > 0.0]):
        return found
    found[there[of_runs(y.size, begins, ends)]] = True
    return found if found.sum() <= MAX_DROPPED_SHARE * y.size else np.zeros_like(found)


def held(values: Array) -> Held | None:
    """Return where values (T,) are new that are held in between; None where they are not held.

    Their changes are not always the same, as those of an encoder at a steady speed are, and many of their own steps.
    """
    found = _equal(values) or _rhythmic(values)
    if found is None:
        return None
    changes = np.abs(np.diff(values[found.begins]))
    changes = changes[changes > 0.0]
    if not changes.size:
        return None
    usual = float(np.median(changes))
    steady = (
        np.mean(np.abs(changes - usual) < max(MAX_CHANGE_DIFFERENCE * usual, MIN_CHANGE_OVER_NOISE * found.noise))
        > REGULAR
    )
    return (
        None
        if steady or usual < MIN_SLOW_SENSOR_STEPS * quantum_of(values[np.isfinite(values)][:RHYTHM_SAMPLES])
        else found
    )


def _equal(values: Array) -> Held | None:
    """Return where runs of equal values (T,) begin that are alike; a missing sample repeats nothing.

    The first run and the last are cut off somewhere, and tell no length.
    """
    begins = np.flatnonzero(values[1:] != values[:-1]) + 1
    lengths = np.diff(begins)
    if not lengths.size:
        return None
    counts = np.bincount(lengths, minlength=2)
    short = int(np.argmax(counts[1:] + counts[:-1]))
    alike = lengths[(lengths == short) | (lengths == short + 1)]
    length = float(alike.mean()) if alike.size else 0.0
    moving = lengths[lengths <= MIN_REST_RUN * length]
    if length < LONGER_HOLD_RATIO or alike.size < REGULAR * moving.size or _chance(lengths, alike.size, short) > CHANCE:
        return None
    return Held(_with_rests(np.concatenate([[0], begins]), length), length)


def _chance(lengths: Index, alike: int, short: int) -> float:
    """Return the chance that so many of these runs are of two neighbouring lengths if each sample is as likely to
    change as any other (Chernoff's bound), for as many such pairs as may be.
    """
    rate = 1.0 / float(lengths.mean())
    expected = rate * (1.0 - rate) ** (short - 1) * (2.0 - rate)
    share = alike / lengths.size
    if share <= expected:
        return 1.0
    parts = ((share, expected), (1.0 - share, 1.0 - expected))
    surprise = sum(part * np.log(part / usual) for part, usual in parts if part > 0.0)
    return float(np.exp(-lengths.size * surprise) * lengths.mean())


def _with_rests(begins: Index, length: float) -> Index:
    """Return the samples at which runs begin (k,), and those at which what rests was measured again."""
    parts = [
        first + np.round(np.linspace(0.0, last - first, max(round((last - first) / length), 1), endpoint=False))
        for first, last in pairwise(begins)
    ]
    return np.concatenate([*parts, begins[-1:]]).astype(np.intp)


def _rhythmic(values: Array) -> Held | None:
    """Return where held values (T,) that have noise on them are new: after the two samples in which they change."""
    energy = np.diff(values) ** 2
    if energy.size < MIN_HOLD_SAMPLES * MIN_HOLDS or not np.isfinite(energy).all() or not energy.any():
        return None
    if energy.sum() ** 2 < MIN_HOLDS * np.sum(energy**2):  # a jump or two make no rhythm
        return None
    length, first = _rhythm(energy)
    centres = np.arange(first % length, energy.size - 2, length)
    changes = np.floor(centres).astype(np.intp)
    if energy[changes].sum() + energy[changes + 1].sum() < MIN_RHYTHM_SHARE * energy.sum():
        return None
    begins, ends = changes[:-1] + 2, changes[1:]
    levels = np.array([values[b : e + 1].mean() for b, e in zip(begins, ends, strict=True)])
    stays = np.mean((values[ends] - values[begins]) ** 2) < STAYS**2 * np.mean(np.diff(levels) ** 2)
    between = np.delete(energy, np.concatenate([changes, changes + 1]))
    noise = float(np.sqrt(np.mean(between)))
    return Held(np.append(begins, changes[-1] + 2), length, noise) if stays and noise else None


def _rhythm(energy: Array) -> tuple[float, float]:
    """Return the period, in samples, at which squared differences (T,) gather most, and where the first of them is."""
    samples = np.arange(energy.size)
    size = 2 ** int(np.ceil(np.log2(FINER_STEPS * energy.size)))  # of any other, the transform takes much memory
    spectrum = np.abs(np.fft.rfft(energy, size))
    lowest, highest = int(np.ceil(size / energy.size * MIN_HOLDS)), int(np.ceil(size / MIN_HOLD_SAMPLES))
    best = lowest + int(np.argmax(spectrum[lowest : highest + 1]))
    length = size / best
    turn = np.angle(np.sum(energy * np.exp(2j * np.pi * samples / length)))
    return length, float(turn / (2.0 * np.pi) * length)


__all__ = ["Held", "dropped", "held"]
