"""A residual taken apart by its autocorrelation: what is slow, coloured noise, white noise."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from signlin_ros.comparison.whiteness import FURTHEST, LAGS, SURER, correlations, related, white

Array = NDArray[np.float64]

LONGEST, UNSURE, SURE = 0.9, 0.02, 3.0
"""Largest correlation from sample to sample of what counts as noise that has a white part; how well a share of the
variance, or a correlation, is known at best; standard errors beyond which a residual is slow."""
PURE, TIMES, ROUGH = 0.998, 20.0, 0.05
"""Noise of one pole alone may last longer, up to this correlation: whitened by it, nothing but white noise is left
beside no more than a share of that; and the record must be so many times as long as it lasts."""


@dataclass(frozen=True)
class Colour:
    """Shares of a residual's ``variance``: ``slow``, ``coloured`` (of correlation ``rho``), the rest white. ``alone``:
    first correlation of the coloured part if nothing is slow; ``pure``: it is noise of one pole. ``together``: how many
    samples go together, 1 + 2 sum of correlations.
    """

    variance: float
    slow: float
    coloured: float
    rho: float
    samples: int
    alone: float
    pure: bool = False
    together: float = 1.0

    @property
    def structured(self) -> bool:
        """Whether more is slow, or lasts longer, than noise shows by chance in a record this long."""
        alone = min(self.alone, 0.95) if self.coloured > 0 else 0.0
        error = np.sqrt((1 + alone**2) / (1 - alone**2) / max(self.samples, 1))
        return bool(self.slow > UNSURE + SURE * error)

    def limited(self, white: float, whole: bool) -> Colour:
        """Return the same with all but ``white`` (a share) as structure, if that lasts too long or is ``whole``."""
        lasting = self.rho > LONGEST - UNSURE and self.coloured > 0.0 and not self.pure
        if not (lasting or whole) or white >= 1.0:
            return self
        most = 1.0 if whole else self.slow + self.coloured
        return replace(self, slow=max(self.slow, min(most, 1.0 - white)), coloured=0.0, pure=False)


def colours(innovations: Sequence[Array], noise: Array) -> list[Colour]:
    """Take every channel of innovations (T, ny) apart; ``noise`` (ny): standard deviations of white noise."""
    channels = [[e[:, c] for e in innovations] for c in range(noise.size)]
    found = [_colour(parts) for parts in channels]
    whites = [min(w**2 / max(one.variance, 1e-300), 1.0) for one, w in zip(found, noise.tolist(), strict=True)]
    pairs = itertools.combinations(range(noise.size), 2)
    moving = {c for a, b in pairs if related(channels[a], channels[b]) for c in (a, b)}
    return [one.limited(w, c in moving) for c, (one, w) in enumerate(zip(found, whites, strict=True))]


def _colour(parts: Sequence[Array]) -> Colour:
    """Return r_k = slow + coloured rho^k, neither below 0, fitted to the autocorrelations at k = 1..`LAGS`."""
    r, variance, count = correlations(parts, max(LAGS, min(FURTHEST, min(p.size for p in parts) // 4)))
    vanished = np.append(r < 2.0 / np.sqrt(max(count, 1)), True)
    together, r = 1.0 + 2.0 * float(np.sum(r[: int(np.argmax(vanished))])), r[:LAGS]
    pole = _pole(parts, r, count)
    if pole is not None:
        return Colour(variance, 0.0, pole[1], pole[0], count, float(r[0]), True, together)
    best, alone, k = (np.inf, 0.0, 0.0, 0.0), (np.inf, 0.0), np.arange(1, LAGS + 1)
    for rho in np.linspace(0.1, LONGEST, 33).tolist():
        shape = rho**k
        slow, fast = np.linalg.lstsq(np.column_stack([np.ones(LAGS), shape]), r, rcond=None)[0]
        one = float(shape @ r / (shape @ shape))
        only = min(max(one, 0.0), 1.0)
        alone = min(alone, (float(np.sum((r - only * shape) ** 2)), only * rho))
        slow, fast = (0.0, one) if slow < 0 else (max(float(r.mean()), 0.0), 0.0) if fast < 0 else (slow, fast)
        best = min(best, (float(np.sum((r - slow - fast * shape) ** 2)), float(slow), float(fast), rho))
    _, slow, fast, rho = best
    slow, fast = min(slow, 1.0), fast if fast >= SURER / np.sqrt(max(count, 1)) else 0.0
    return Colour(variance, slow, min(fast, 1.0 - slow), rho, count, alone[1], together=together)


def _pole(parts: Sequence[Array], r: Array, count: int) -> tuple[float, float] | None:
    """Return the correlation of noise of one pole that lasts long and its share, if a residual is nothing else."""
    rho = float(r[1:] @ r[:-1] / max(float(r[:-1] @ r[:-1]), 1e-300))
    share = min(float(r[0]) / max(rho, 1e-12), 1.0)
    if not (LONGEST - UNSURE < rho <= PURE and count * (1.0 - rho) >= TIMES and share >= 1.0 - ROUGH):
        return None
    first = rho * (1 - share) / (share * (1 - rho**2) + (1 - share) * (1 + rho**2))
    theta = 2.0 * first / (1.0 + np.sqrt(max(1.0 - 4.0 * first**2, 0.0)))
    left = [lfilter([1.0, -rho], [1.0, -theta], np.nan_to_num(part))[1:] for part in parts]
    return (rho, share) if white(left) else None


__all__ = ["Colour", "colours"]
