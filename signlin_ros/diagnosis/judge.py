"""What the residual of a fitted model says: its noise, the structure that is left in it, gains on unseen data."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter
from scipy.stats import chi2

from signlin_ros.noise import fourth_difference_share

Array = NDArray[np.float64]

LAGS = 12
"""Lags over which the colour of the noise is told from slow structure."""
MOST_COLOUR = 0.9
"""Largest rho of what counts as noise; what lasts longer counts as structure."""
PURE, TIMES, ROUGH = 0.998, 20.0, 0.05
"""Noise of one pole may last longer, up to this rho, where it is nothing else: whitened by that pole, nothing is left
but white noise and what a share of its variance, white itself, makes of it; and a record must be so many times as long
as it lasts to tell."""
SPAN, NEAR = 12, 5
"""Lags either way at which channels are compared, and how many are averaged."""
ALIKE = 0.2
"""Smallest correlation between the residuals of two channels that tells of a common cause."""
ODD, LOUD = 0.2, 2.5
"""Share of the squared autocorrelations that slow structure and coloured noise leave where something rings; and the
most noise that is left then, in multiples of the sensor's."""
WORTH = 0.15
"""Smallest rho that is worth a filter."""


@dataclass(frozen=True)
class Residue:
    """A channel's residual taken apart: variance = slow structure + AR(1) noise + white noise.

    ``structure``, ``coloured``, ``white`` are shares of the variance; ``rho`` belongs to the AR(1) part. ``odd``: the
    share of the squared autocorrelations that the three do not explain. ``dependent``: the share of the variance that
    follows from the model's own motion. ``alone``: the first autocorrelation if all are those of AR(1) and white noise:
    where there is no structure, what passes for some by chance was taken from the colour. ``pure``: it is AR(1) noise
    and nothing else but a little white noise, however long that lasts.
    """

    variance: float
    structure: float
    coloured: float
    white: float
    rho: float
    samples: int
    odd: float = 0.0
    dependent: float = 0.0
    alone: float = 0.0
    pure: bool = False

    @property
    def structured(self) -> bool:
        """Whether the slow structure is beyond what noise without any shows by chance in a record this long."""
        colour = min(self.alone, 0.95) if self.coloured > 0 else 0.0
        error = np.sqrt((1 + colour**2) / (1 - colour**2) / max(self.samples, 1))
        return bool(self.structure > 0.02 + 3.0 * error)

    def depending(self, share: float) -> Residue:
        """Return the residual with a share of its variance that follows from the model's motion: structure."""
        if share <= self.structure:
            return replace(self, dependent=share)
        kept = (1.0 - share) / max(1.0 - self.structure, 1e-12)
        return replace(self, structure=share, coloured=kept * self.coloured, white=kept * self.white, dependent=share)

    @property
    def lasting(self) -> bool:
        """Whether what seems to be coloured noise lasts too long to be any."""
        return self.rho > MOST_COLOUR - 0.02 and self.coloured > 0.0 and not self.pure

    @property
    def noise(self) -> float:
        """Standard deviation of the noise."""
        return float(np.sqrt(max(1.0 - self.structure, 1e-12) * self.variance))

    @property
    def average(self) -> float:
        """Coefficient theta of the prewhitening (1 - `filter` L) / (1 - theta L); 0 where noise does not last long."""
        return _moving_average(self.rho, self.coloured, self.white) if self.pure else 0.0

    @property
    def filter(self) -> float:
        """Coefficient of the first-order prewhitening that suits the noise.

        0 where it is nearly white, and where it lasts so long that it is no noise. What would be more than all of the
        variance is coloured as it is with no more than all.
        """
        if self.lasting:
            return 0.0
        if self.pure:
            return self.rho
        noise = self.coloured + self.white
        first = self.coloured * self.rho / noise if noise > 0 else 0.0
        if self.coloured > 0.0 and self.white < 1e-9 and not self.structured:
            first = max(first, self.alone)
        return first if first > WORTH else 0.0


def correlations(parts: Sequence[Array], lags: int) -> tuple[Array, float, int]:
    """Return autocorrelations at lags 1..``lags``, the variance and the number of samples, over several records."""
    sums, total, count = np.zeros(lags), 0.0, 0
    for part in parts:
        e = np.where(np.isfinite(part), part, 0.0)
        total += float(e @ e)
        count += int(np.count_nonzero(e))
        size = 1 << (2 * e.size - 1).bit_length()
        spectrum = np.fft.rfft(e, size)
        sums += np.fft.irfft(np.abs(spectrum) ** 2, size)[1 : lags + 1]
    return sums / max(total, 1e-300), total / max(count, 1), count


def residue(parts: Sequence[Array]) -> Residue:
    """Take a residual apart by its autocorrelation: r_k = structure + coloured rho^k at k = 1..`LAGS`."""
    r, variance, count = correlations(parts, LAGS)
    pole = _pure(parts, r, count)
    if pole is not None:
        rho, share = pole
        return Residue(variance, 0.0, share, 1.0 - share, rho, count, alone=float(r[0]), pure=True)
    k = np.arange(1, LAGS + 1)
    best, alone = (np.inf, 0.0, 0.0, 0.0), (np.inf, 0.0)
    for rho in np.linspace(0.1, MOST_COLOUR, 33):
        basis = np.column_stack([np.ones(LAGS), rho**k])
        (slow, fast), *_ = np.linalg.lstsq(basis, r, rcond=None)
        one = float(basis[:, 1] @ r / (basis[:, 1] @ basis[:, 1]))
        only = min(max(one, 0.0), 1.0)
        alone = min(alone, (float(np.sum((r - only * basis[:, 1]) ** 2)), only * float(rho)))
        if slow < 0:
            slow, fast = 0.0, one
        if fast < 0:
            slow, fast = max(float(r.mean()), 0.0), 0.0
        miss = float(np.sum((r - basis @ np.array([slow, fast])) ** 2))
        if miss < best[0]:
            best = (miss, float(slow), float(fast), float(rho))
    miss, slow, fast, rho = best
    if fast < 4.0 / np.sqrt(max(count, 1)):
        fast = 0.0
    slow, fast = min(slow, 1.0), min(fast, 1.0 - min(slow, 1.0))
    return Residue(variance, slow, fast, 1.0 - slow - fast, rho, count, miss / max(float(r @ r), 1e-300), 0.0, alone[1])


def _pure(parts: Sequence[Array], r: Array, count: int) -> tuple[float, float] | None:
    """Return rho of noise of one pole that lasts long and its share of the variance, the rest being white (a sensor's
    steps); None if a residual with autocorrelations ``r`` is anything else.
    """
    rho = float(r[1:] @ r[:-1] / max(float(r[:-1] @ r[:-1]), 1e-300))
    share = min(float(r[0]) / max(rho, 1e-12), 1.0)
    if not (MOST_COLOUR - 0.02 < rho <= PURE and count * (1.0 - rho) >= TIMES and share >= 1.0 - ROUGH):
        return None
    theta = _moving_average(rho, share, 1.0 - share)
    left = [lfilter([1.0, -rho], [1.0, -theta], np.nan_to_num(part))[1:] for part in parts]
    return (rho, share) if whiteness(left).white else None


def _moving_average(rho: float, coloured: float, white: float) -> float:
    """Return theta of the moving average that AR(1) noise and white noise of these variances leave of (1 - rho L) e:
    what (1 - rho L) / (1 - theta L) makes of them is white.
    """
    first = rho * white / (coloured * (1.0 - rho**2) + white * (1.0 + rho**2))
    return float(2.0 * first / (1.0 + np.sqrt(max(1.0 - 4.0 * first**2, 0.0))))


def residues(innovations: Sequence[Array], white: Array | None = None) -> list[Residue]:
    """Return `residue` for every channel of innovations (T, ny).

    ``white`` (ny): standard deviation of white noise, from fourth differences. Where residuals move together, as
    sensors do not know of each other, or where their colour lasts too long, all beyond white noise is structure.
    """
    found = [residue([e[:, c] for e in innovations]) for c in range(innovations[0].shape[1])]
    if white is None:
        return found
    found = [_limited(r, float(w)) for r, w in zip(found, white, strict=True)]
    moving = together(innovations)
    shares = [min(float(w) ** 2 / max(r.variance, 1e-300), 1.0) for r, w in zip(found, white, strict=True)]
    return [
        _without_colour(r, 1.0 if c in moving else r.structure + r.coloured, share) if c in moving or r.lasting else r
        for c, (r, share) in enumerate(zip(found, shares, strict=True))
    ]


def any_structure(innovations: Sequence[Array], white: Array) -> bool:
    """Tell whether any channel of innovations (T, ny) shows structure; see `residues`."""
    return any(one.structured for one in residues(innovations, white))


def _limited(r: Residue, white: float) -> Residue:
    """Return a residue of which no more is noise than fourth differences of what was measured can hide, where it is
    `ODD`.

    What rings is neither slow nor coloured by one pole, but noise it is not: ``white`` noise from those differences is
    the most that there is (`LOUD`: beyond what an observer adds), and of an AR(1) they show a known share.
    """
    if r.odd < ODD:
        return r
    shown = (r.coloured * float(fourth_difference_share(np.array(r.rho))) + r.white) * r.variance
    part = min((LOUD * white) ** 2 / max(shown, 1e-300), 1.0)
    if part >= 1.0:
        return r
    coloured, left = part * r.coloured, part * r.white
    return replace(r, structure=1.0 - coloured - left, coloured=coloured, white=left)


def _without_colour(r: Residue, most: float, white: float) -> Residue:
    """Return a residue with structure in place of colour, at most so much of it, where it is beyond ``white`` noise."""
    if white >= 1.0:
        return r
    structure = max(r.structure, min(most, 1.0 - white))
    return replace(r, structure=structure, coloured=0.0, white=1.0 - structure)


def together(innovations: Sequence[Array]) -> set[int]:
    """Return the channels of innovations (T, ny) whose slow part is correlated with that of another one.

    Cross-correlations, averaged over `NEAR` lags (so that noise of a speed that was derived from the position cancels),
    must exceed `ALIKE` and five standard errors [Bartlett 1946, doi:10.2307/2983611].
    """
    whole = [np.nan_to_num(e) for e in innovations]
    count, found = sum(len(e) for e in whole), set()
    own = [correlations([e[:, c] for e in whole], 50) for c in range(whole[0].shape[1])]
    for a, b in itertools.combinations(range(len(own)), 2):
        scale = np.sqrt(own[a][1] * own[b][1]) * count
        error = np.sqrt(max(1.0 + 2.0 * float(np.sum(own[a][0] * own[b][0])), 1.0) / count)
        sums = np.zeros(2 * SPAN + 1)
        for e in whole:
            x, y = e[:, a], e[:, b]
            sums += [
                float(x[max(k, 0) : len(x) + min(k, 0)] @ y[max(-k, 0) : len(y) - max(k, 0)])
                for k in range(-SPAN, SPAN + 1)
            ]
        r = np.convolve(sums / max(scale, 1e-300), np.ones(NEAR) / NEAR, "valid")
        if np.max(np.abs(r)) > max(ALIKE, 5.0 * error):
            found |= {a, b}
    return found


@dataclass(frozen=True)
class Whiteness:
    """Whether a prewhitened residual is white: lag-1 correlation, portmanteau statistic over its limit."""

    lag1: float
    portmanteau: float
    white: bool


def whiteness(parts: Sequence[Array], tolerance: float = 0.05, steps: bool = False) -> Whiteness:
    """Test a prewhitened residual; correlations below ``tolerance`` do not matter however long the record is.

    ``steps``: it is mostly the rounding of what is shown in steps, whose correlations have either sign; only the mean
    of the first ones counts then.

    Ljung and Box 1978, doi:10.1093/biomet/65.2.297, over lags up to a twentieth of the record (at most 200).
    """
    lags = int(min(200, max(20, sum(p.size for p in parts) // 20)))
    r, _, count = correlations(parts, lags)
    k = np.arange(1, lags + 1)
    statistic = count * (count + 2) * float(np.sum(r**2 / np.maximum(count - k, 1)))
    limit = float(chi2.ppf(0.9999, lags))
    bound = tolerance + 4.0 / np.sqrt(max(count, 1))
    slow = float(np.abs(r[:LAGS].mean()))
    white = (steps or statistic < 1.5 * limit or float(np.max(np.abs(r))) < bound) and slow < bound / 2
    return Whiteness(float(r[0]), statistic / limit, bool(white))


def gain_in_blocks(
    before: Sequence[Array], after: Sequence[Array], block: int, floor: Array
) -> tuple[float, float, float]:
    """Return the same as `gain_on` of the logarithms of the squared innovations (T, ny) of every block.

    ``floor`` (ny): variance of the noise, added to all. Where a motion is lost for once, `gain_on` sees nothing else.
    """
    falls = []
    for a, b in zip(before, after, strict=True):
        whole = len(a) // block * block
        first, second = (np.nanmean(e[:whole].reshape(-1, block, e.shape[1]) ** 2, axis=1) + floor for e in (a, b))
        falls.append(np.nansum(np.log(first / second), axis=1))
    fall = np.concatenate(falls)
    error = float(np.std(fall, ddof=1) / np.sqrt(fall.size)) if fall.size > 1 else 0.0
    mean = float(fall.mean())
    return block * float(fall.sum()), mean / error if error > 0 else 0.0, 1.0 - float(np.exp(-mean / floor.size))


def gain_on(before: Sequence[Array], after: Sequence[Array], block: int) -> tuple[float, float, float]:
    """Compare prewhitened innovations (T, ny) of two models on the same unseen data.

    Returns by how much -2 log likelihood falls; the fall of squared innovations, in units of what is left, over its
    standard error, which is that of the means of blocks of ``block`` samples; and the mean share of the squares gone.
    """
    squares = [(np.nansum(a**2, axis=0), np.nansum(b**2, axis=0)) for a, b in zip(before, after, strict=True)]
    first, second = (np.maximum(sum(s[i] for s in squares), 1e-300) for i in (0, 1))
    count = sum(np.isfinite(b).sum(axis=0) for b in after)
    sums = []
    for a, b in zip(before, after, strict=True):
        difference = np.nansum((a**2 - b**2) * count / second, axis=1)
        whole = difference.size // block * block
        sums.append(difference[:whole].reshape(-1, block).sum(axis=1))
    blocks = np.concatenate(sums)
    error = float(np.std(blocks, ddof=1) * np.sqrt(blocks.size)) if blocks.size > 1 else np.inf
    gain = float(np.sum(count * np.log(first / second)))
    return gain, float(blocks.sum()) / error if error > 0 else 0.0, float(np.mean(1.0 - second / first))


__all__ = ["Residue", "Whiteness", "any_structure", "gain_in_blocks", "gain_on", "residues", "together", "whiteness"]
