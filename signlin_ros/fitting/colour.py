"""A residual taken apart by its autocorrelation: what is slow, coloured noise, white noise."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter
from scipy.special import chdtri

Array = NDArray[np.float64]

LAGS, FURTHEST, LONGEST = 12, 200, 0.9
"""Lags that are looked at, and how many at most where samples may go together for long; largest correlation from sample
to sample of what counts as noise that has a white part."""
PURE, TIMES, ROUGH = 0.998, 20.0, 0.05
"""Noise of one pole alone may last longer, up to this correlation: whitened by it, nothing but white noise is left
beside no more than a share of that; and the record must be so many times as long as it lasts."""
SPAN, NEAR, ALIKE = 12, 5, 0.1
"""Lags either way at which channels are compared, how many are averaged, and the least common correlation."""
UNSURE, TOLERATED = 0.02, 0.05
"""How well a share of the variance, or a correlation, is known at best; correlations that never matter."""
SURE, SURER, SUREST = 3.0, 4.0, 5.0
"""Standard errors beyond which a residual is slow; coloured, or not white; and two channels have a common cause."""
LIKELY, EXCESS = 0.9999, 1.5
"""Quantile of chi squared below so many times of which a residual is white."""


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


def correlations(parts: Sequence[Array], lags: int) -> tuple[Array, float, int]:
    """Return autocorrelations at lags 1..``lags``, the variance and the number of samples, over several records."""
    sums, total, count = np.zeros(lags), 0.0, 0
    for part in parts:
        e = np.where(np.isfinite(part), part, 0.0)
        total += float(e @ e)
        count += int(np.count_nonzero(e))
        size = 1 << (2 * e.size - 1).bit_length()
        sums += np.fft.irfft(np.abs(np.fft.rfft(e, size)) ** 2, size)[1 : lags + 1]
    return sums / max(total, 1e-300), total / max(count, 1), count


def colours(innovations: Sequence[Array], noise: Array) -> list[Colour]:
    """Take every channel of innovations (T, ny) apart; ``noise`` (ny): standard deviations of white noise."""
    found = [_colour([e[:, c] for e in innovations]) for c in range(noise.size)]
    whites = [min(w**2 / max(one.variance, 1e-300), 1.0) for one, w in zip(found, noise.tolist(), strict=True)]
    moving = _together(innovations)
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


def white(parts: Sequence[Array]) -> bool:
    """Test whether residuals are white; correlations below `TOLERATED` do not matter however long the record is.

    [Ljung and Box 1978, doi:10.1093/biomet/65.2.297]
    """
    lags = int(min(FURTHEST, max(20, sum(p.size for p in parts) // 20)))
    r, _, count = correlations(parts, lags)
    statistic = count * (count + 2) * float(np.sum(r**2 / np.maximum(count - np.arange(1, lags + 1), 1)))
    bound = TOLERATED + SURER / np.sqrt(max(count, 1))
    small = statistic < EXCESS * float(chdtri(lags, 1.0 - LIKELY)) or float(np.max(np.abs(r))) < bound
    return bool(small and abs(float(r[:LAGS].mean())) < bound / 2)


def _together(innovations: Sequence[Array]) -> set[int]:
    """Return the channels whose slow part is correlated with that of another one, beyond five standard errors.

    [Bartlett 1946, doi:10.2307/2983611]
    """
    whole = [np.nan_to_num(e) for e in innovations]
    count, found = sum(len(e) for e in whole), set[int]()
    own = [correlations([e[:, c] for e in whole], 50) for c in range(whole[0].shape[1])]
    for a, b in itertools.combinations(range(len(own)), 2):
        error = np.sqrt(max(1.0 + 2.0 * float(np.sum(own[a][0] * own[b][0])), 1.0) / count)
        sums = np.sum([[_product(e, a, b, k) for k in range(-SPAN, SPAN + 1)] for e in whole], axis=0)
        r = np.convolve(sums / max(np.sqrt(own[a][1] * own[b][1]) * count, 1e-300), np.ones(NEAR) / NEAR, "valid")
        if np.max(np.abs(r)) > max(ALIKE, SUREST * error):
            found |= {a, b}
    return found


def _product(e: Array, a: int, b: int, k: int) -> float:
    return float(e[max(k, 0) : len(e) + min(k, 0), a] @ e[max(-k, 0) : len(e) - max(k, 0), b])


__all__ = ["Colour", "colours", "correlations", "white"]
