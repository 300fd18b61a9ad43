"""Laws whose level repeats over the position: at which orders what is left of a motion says so.

A load, a friction and a viscosity may each have a pattern over the position that is finer than any power of it tells.
Of thousands of orders some fit any noise. So the orders for samples that are left out are chosen on the others, as the
coefficients are.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.fft import next_fast_len, rfft
from scipy.signal import fftconvolve

from signlin_ros.diagnosis.blocks import MIN_DIVISOR
from signlin_ros.effects import find_effect
from signlin_ros.fitting.problem import Problem
from signlin_ros.fitting.scan import finest, whole_orders
from signlin_ros.model import Model

Array = NDArray[np.float64]

BINS_PER_PERIOD, MIN_BINS, MAX_BINS = 4, 256, 2**16
"""Parts of the travel that the quickest wave has in a period; fewest and most in all."""
MIN_PERIODS = 2.0
"""Least number of periods over the travel: fewer are as good as a power of the position."""


class Pattern(NamedTuple):
    """A wave of some order (rad^-1 or m^-1) of one of the `levels`."""

    level: int
    order: float


def levels(v: Array) -> Array:
    """Return what may vary over the position (T, 3): a load, a friction and a viscosity, of a velocity (T,)."""
    return np.column_stack([np.ones_like(v), np.sign(v), v])


def functions(patterns: Sequence[Pattern], q: Array, v: Array) -> Array:
    """Return the two waves (T, 2 k) of each of k patterns along a motion, of position and velocity (T,)."""
    of_level, found = levels(v), np.empty((len(q), 2 * len(patterns)))
    for i, one in enumerate(patterns):
        found[:, 2 * i] = of_level[:, one.level] * np.sin(one.order * q)
        found[:, 2 * i + 1] = of_level[:, one.level] * np.cos(one.order * q)
    return found


def has_waves(model: Model) -> bool:
    """Tell whether a model has waves over the position: what these leave has waves, too, and tells of no other law."""
    return any(find_effect(use.type, "effects").waves(use.parameters) for use in model.effects.values())


def force_left(left: Array, response: Array) -> Array:
    """Return the force (T - 1,), in any unit, that innovations (T, ny) tell of: filtered backwards with the observer's
    own response (M, ny), a matched filter.
    """
    whole = fftconvolve(left[1:], response[::-1], axes=0).sum(axis=1)
    return np.asarray(whole[len(response) - 1 :][: len(left) - 1])


def strongest(problem: Problem, q: Array, v: Array, force: Array, fold: NDArray[np.int_]) -> list[list[Pattern]]:
    """Return for every fold the strongest pattern of each level in what is left (T,) of the other folds; none where
    the motion has no place for one.
    """
    folds, span = int(fold.max()) + 1, float(np.ptp(q))
    highest = min(problem.max_wave_order, finest(problem))
    least = MIN_PERIODS * 2 * np.pi / max(span, MIN_DIVISOR)
    if not least < highest:
        return [[] for _ in range(folds)]
    bins = int(np.clip(BINS_PER_PERIOD * span * highest / (2 * np.pi), MIN_BINS, MAX_BINS))
    size = next_fast_len(2 * bins, real=True)
    place = np.minimum(((q - q.min()) / span * bins).astype(int), bins - 1) + bins * fold
    orders = 2 * np.pi * np.arange(size // 2 + 1) * bins / (span * size)
    lines = whole_orders(problem, highest)
    tried = lines if lines.size else orders[orders <= highest]
    tried = tried[(tried >= least) & (tried <= orders[-1])]
    found: list[list[Pattern]] = [[] for _ in range(folds)]
    for level, size_of in enumerate(levels(v).T if tried.size else ()):
        parts = np.bincount(place, weights=force * size_of, minlength=folds * bins).reshape(folds, bins)
        spectra = rfft(parts, size, axis=1)
        for own, spectrum in zip(found, spectra.sum(axis=0) - spectra, strict=True):
            power = np.interp(tried, orders, np.abs(spectrum))
            own.append(Pattern(level, float(tried[int(np.argmax(power))])))
    return found


__all__ = ["Pattern", "force_left", "functions", "has_waves", "levels", "strongest"]
