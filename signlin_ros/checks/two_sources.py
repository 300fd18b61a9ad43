"""Two sources that write into one channel by turns."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from signlin_ros.checks.base import Check, set_to, without_samples
from signlin_ros.checks.finding import Finding
from signlin_ros.checks.look import MIN_SAMPLES, Look
from signlin_ros.checks.reached import never_reached
from signlin_ros.errors import joined
from signlin_ros.noise import noise_level
from signlin_ros.records.inputs import filled_in

Array = NDArray[np.float64]

MIN_ZERO_DISTANCE = 8.0
"""A zero between two values that are so many times the noise away from it is no measurement of the same thing."""
MAX_NEIGHBOUR_DIFFERENCE = 0.5
"""The values on both sides of it differ by less than this share of their size."""
MIN_ZEROS, MAX_ZERO_SHARE = 5, 0.6
"""Least number, and largest share, of zeros between values."""
BRIEF, BURST = 3, 30
"""Samples from value to value within which zeros stand between them; and where a channel is never 0 otherwise, for its
noise: so long a reading may fail."""
SUDDEN = 2.0
"""How much larger than the usual change (its 90 % quantile) the step into a burst is."""
FEW_ARE_LARGER = 0.995
"""Quantile of its changes beyond which a step to 0 is one of them, once it is known that zeros are."""
SOURCE_COUNTS = (2, 3, 4)
"""Numbers of sources that are looked for."""
SMOOTHER = 0.05
"""Mean squared steps from turn to turn, as a share of those from sample to sample, where sources alternate."""


class TwoSources(Check):
    """Two publishers, or a driver that writes 0 where a reading failed: zeros stand between values far from zero, or
    every second (third, fourth) sample belongs to another curve.

    Test: a zero counts that lies `MIN_ZERO_DISTANCE` standard deviations from both neighbours, which are alike: by
    chance none in 10^9 samples; or the steps over one turn are `SMOOTHER` than those between neighbours, which of
    white noise are as large, and of any motion larger. Cure: zeros of a measured channel are no samples of it, and are
    left out; of an input they may have reached the drive, and somebody must say (``hold_NAME``). Two other sources are
    refused.
    """

    name = "two_sources"

    def find(self, look: Look) -> Iterator[Finding]:
        """Yield channels with zeros between values together, then inputs, then curves by turns."""
        zeros = {name: found for name in look.channels if (found := _constants(look.of(name), BURST)) is not None}
        if zeros:
            yield self._dropped(look, zeros)
        for name in look.record.inputs:
            found = _zeros(look.of(name), BURST)
            found = _between_equals(look, name) if found is None else found
            if found is not None and np.ptp(look.of(name)[look.of(name) != 0.0]) > 0:
                yield self._held(look, name, found)
        for name in (n for n in look.channels if n not in zeros):
            turns = _turns(look.finite(name)[1])
            if turns and not any(_turns(look.of(u)) for u in look.record.inputs):
                sentence = f"every {_ORDINAL[turns]} sample of the {name} belongs to another curve than its neighbours"
                why = "two sources write into one channel; record each by itself"
                yield Finding(self.name, name, "refuse", f"{sentence}: {why}")

    def _dropped(self, look: Look, zeros: dict[str, NDArray[np.bool_]]) -> Finding:
        names = tuple(zeros)
        values = {name: float(look.of(name)[at][0]) for name, at in zeros.items()}
        together = np.all([look.of(name) == value for name, value in values.items()], axis=0)
        drop = np.any(list(zeros.values()), axis=0) | (together if len(names) > 1 else False)
        what, to = joined([f"the {name}" for name in names]), joined([f"{values[name]:.4g}" for name in names])
        to = "0" if not any(values.values()) else to
        share = f"{int(drop.sum())} of {drop.size} samples"
        sentence = f"{what} {'jumps' if len(names) == 1 else 'jump'} to {to} and back in {share}"
        sentence += ": a second source, or readings that failed"
        return Finding(
            self.name,
            ", ".join(names),
            "note",
            sentence,
            cure="drop_zeros",
            remedy="these are left out",
            harmless=True,
            action=without_samples(look, names, drop),
        )

    def _held(self, look: Look, name: str, zeros: NDArray[np.bool_]) -> Finding:
        sentence = f"the {name} jumps to 0 and back in {int(zeros.sum())} of {zeros.size} samples: a second source"
        index = np.arange(zeros.size, dtype=float)
        filled, between = filled_in(index, look.of(name), zeros)
        how = (
            "they lie on the line between the values beside them" if between else "the value before them is held there"
        )
        return Finding(
            self.name,
            name,
            "refuse",
            sentence,
            cure=f"hold_{name}",
            remedy=f"{how}, if that is what reached the drive",
            action=set_to(look, name, filled),
        )


_ORDINAL = {2: "second", 3: "third", 4: "fourth"}


def _constants(values: Array, longest: int = BRIEF) -> NDArray[np.bool_] | None:
    """Return where (T,) values jump to 0, or to the value that is there most often, and back; None if they do not."""
    levels, counts = np.unique(values[np.isfinite(values)], return_counts=True)
    often = float(levels[int(np.argmax(counts))]) if levels.size else 0.0
    found = _zeros(values, longest)
    return _zeros(values - often, longest) if found is None and often != 0.0 else found


def _zeros(values: Array, longest: int = BRIEF) -> NDArray[np.bool_] | None:
    """Return where (T,) values are zeros between values; None where they are too few, or too many. ``longest``: from
    value to value, where the noise of the values makes a zero by itself unlikely.
    """
    zero = values == 0.0
    rest = np.flatnonzero(~zero & np.isfinite(values))
    if not MIN_ZEROS <= zero.sum() <= MAX_ZERO_SHARE * values.size or rest.size < MIN_SAMPLES:
        return None
    at = np.flatnonzero(zero)
    k = np.searchsorted(rest, at)
    inside = (k > 0) & (k < rest.size)
    at, k = at[inside], k[inside]
    before, after = values[rest[k - 1]], values[rest[k]]
    noise = noise_level(np.arange(rest.size, dtype=float)[:20_000], values[rest][:20_000])
    sigma = noise.sigma
    size = np.minimum(np.abs(before), np.abs(after))
    close = np.abs(before - after) < MAX_NEIGHBOUR_DIFFERENCE * size
    usual = float(np.quantile(np.abs(np.diff(values[rest])), 0.9))
    same = (
        (np.sign(before) == np.sign(after))
        & (size > SUDDEN * usual)
        & (size > MIN_ZERO_DISTANCE * sigma)
        & (sigma > 0.0)
    )
    wide = rest[k] - rest[k - 1]
    brief = (wide <= BRIEF) | ((wide <= longest) & same)
    close = close | ((wide > BRIEF) & same)
    jumps = at[brief & close & (size > MIN_ZERO_DISTANCE * sigma) & (size > usual)]  # a turn goes no further
    if jumps.size < MIN_ZEROS or jumps.size < 0.3 * at.size or np.unique(values[rest]).size < MIN_SAMPLES:
        return None
    found = np.zeros(values.size, dtype=bool)
    never = noise.quantum == 0.0 and sigma > 0.0  # its noise makes no exact 0
    ordinary = np.abs(np.diff(values[rest]))[np.diff(rest) == 1]
    sudden = (wide <= longest) & (np.maximum(np.abs(before), np.abs(after)) > np.quantile(ordinary, FEW_ARE_LARGER))
    found[at[(wide <= longest) if never and longest > BRIEF else brief | (sudden & (longest > BRIEF))]] = True
    return found


def _between_equals(look: Look, name: str) -> NDArray[np.bool_] | None:
    """Return where (T,) an input is 0 for a while, often between values that are the same, and the motion does not
    follow: a command that is held has no noise to tell such zeros by. None where they are few.
    """
    values = look.of(name)
    rest, at = np.flatnonzero(values != 0.0), np.flatnonzero(values == 0.0)
    if min(rest.size, at.size) < MIN_ZEROS:
        return None
    k = np.searchsorted(rest, at)
    inside = (k > 0) & (k < rest.size)
    at, before, after = at[inside], rest[k[inside] - 1], rest[k[inside]]
    brief, equal = np.zeros(values.size, dtype=np.bool_), np.zeros(values.size, dtype=np.bool_)
    brief[at] = after - before <= BURST
    equal[at] = brief[at] & (values[before] == values[after])
    if equal.sum() < MIN_ZEROS:
        return None
    missed, small = never_reached(look, name, filled_in(look.t, values, brief)[0])
    return missed | (small & equal) if missed.sum() >= MIN_ZEROS else None


def _turns(values: Array) -> int:
    """Return by how many sources values (T,) are written in turns; 0 where by one."""
    if values.size < 5 * MIN_SAMPLES:
        return 0
    first = float(np.mean(np.diff(values) ** 2))
    if first == 0.0:
        return 0
    return next((m for m in SOURCE_COUNTS if np.mean((values[m:] - values[:-m]) ** 2) < SMOOTHER * first), 0)
