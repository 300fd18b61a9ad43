"""Mean squares over blocks of time, which two models share: by how much one leaves less than another, and how surely.

Standard errors are those of the means of blocks; neighbouring blocks hardly go together, samples do.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

MIN_DIVISOR = 1e-300
"""What keeps a division from failing."""
MIN_BLOCKS = 3
"""Blocks from which a standard error is told."""
MAX_LOG_FALL = float(np.log(4.0))
"""Logarithm of the fall of a square to that of half the error, from which on a block says all that it can [Huber,
Robust Statistics, 1981, ch. 3]."""
MAX_T = 60.0
"""Largest t ratio that is told: from there on it says nothing more."""


@dataclass(frozen=True, eq=False)
class BlockChange:
    """Mean squares (blocks,) that two models leave of the same data, ``before`` and ``after``; NaN where nothing was
    measured.
    """

    before: Array
    after: Array

    @property
    def fall(self) -> float:
        """By how much the mean square falls."""
        return float(np.mean(self.before) - np.mean(self.after))

    @property
    def t_ratio(self) -> float:
        """By how many standard errors the squares fall, see `mean_t_ratio`."""
        return mean_t_ratio(self.before, self.after)

    def falls_to(self, share: float, min_t: float) -> bool:
        """Tell whether the mean square falls to a ``share`` of itself at most, by so many standard errors at least."""
        return self.t_ratio >= min_t and float(np.mean(self.after)) <= share * float(np.mean(self.before))

    def rise_shows(self, visible: float) -> bool:
        """Tell whether the RMS rises by more than a part ``visible``."""
        return bool(np.nanmean(self.after) > (1.0 + visible) ** 2 * np.nanmean(self.before))

    @property
    def mean_rise_t(self) -> float:
        """By how many standard errors the mean rises, whatever logarithms say."""
        rise = self.after - self.before
        error = float(np.nanstd(rise) / np.sqrt(max(int(np.count_nonzero(np.isfinite(rise))), 1)))
        return float(np.nanmean(rise)) / (error + MIN_DIVISOR)


def mean_t_ratio(before: Array, after: Array, noise: Array | None = None) -> float:
    """Return by how many standard errors squares (blocks,) fall, at most 60: their mean, or that of their logarithms,
    whichever is surer.

    ``noise`` (blocks,): what noise makes of them. Beyond it all falls to a half and less count alike, with one more
    block, which tells nothing, as a doubt: in a motion that dies down the first blocks would else decide alone.
    """
    plain = _t_ratio(before - after)
    if plain <= 0:
        return max(plain, -MAX_T)
    floor = 0.1 * before.mean() + MIN_DIVISOR
    found = max(plain, _t_ratio(np.log((before + floor) / (after + floor))))
    if noise is not None:
        falls = np.log((before + noise) / (after + noise))
        found = max(found, _t_ratio(np.append(np.clip(falls, -MAX_LOG_FALL, MAX_LOG_FALL), 0.0)))
    return min(found, MAX_T)


def _t_ratio(values: Array) -> float:
    size = float(np.abs(values).max(initial=0.0))
    if values.size < MIN_BLOCKS or not 0.0 < size < np.inf:
        return 0.0
    values = values / size  # squares of a law that runs away are beyond what can be squared
    return float(values.mean() / (values.std(ddof=1) / np.sqrt(values.size) + MIN_DIVISOR))


__all__ = ["MAX_LOG_FALL", "MIN_DIVISOR", "BlockChange", "mean_t_ratio"]
