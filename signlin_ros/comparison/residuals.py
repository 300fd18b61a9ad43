"""What is left in a residual: slow, coloured or white noise, and what it goes together with, an input or a channel.
Small correlations never matter, however long a record is.

[Ljung and Box 1978, doi:10.1093/biomet/65.2.297; correlated series: Bartlett 1946, doi:10.2307/2983611; prewhitening
before cross-correlation: Box, Jenkins and Reinsel, Time Series Analysis, 1994, sec. 11.2]
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_toeplitz
from scipy.signal import lfilter
from scipy.special import chdtri, chndtrix

Array = NDArray[np.float64]

WHITENESS_LAGS, FURTHEST = 12, 200
"""Lags that are looked at, and how many at most where samples may go together for long."""
CROSS_LAGS, CROSS_AVERAGED, MIN_CROSS_CORRELATION, OWN_LAGS = 12, 5, 0.1, 50
"""Lags either way at which two series are compared, how many are averaged, least correlation, lags of their own."""
TOLERATED, LIKELY, EXCESS = 0.05, 0.9999, 1.5
"""Correlations that never matter; quantile of chi squared below so many times of which a residual is white."""
SURER, COMMON_CAUSE_ERRORS = 4.0, 5.0
"""Standard errors beyond which a residual is not white; and two channels have a common cause."""
ACROSS, PASSED_CORRELATION, TEST_LEVEL = 20, 0.01, 0.01
"""Lags at which a residual may follow an input; correlations (RMS) that are let pass, and how rarely they are told."""
WHITENING_ORDER, WHITENING_RIDGE = 10, 1e-3
"""Order of the autoregression that whitens the input; what is added to a variance: two channels may be one."""
MAX_NOISE_CORRELATION, SHARE_TOLERANCE, SLOW_STANDARD_ERRORS = 0.9, 0.02, 3.0
"""Largest first correlation of noise with a white part; how well shares are known; standard errors of slow ones."""
PURE, POLE_SHARE, ROUGH = 0.998, 20.0, 0.05
"""Noise of one pole alone may last longer, up to this correlation: whitened by it, nothing but white noise is left
beside no more than a share of that; and the record must be so many times as long as it lasts."""


@dataclass(frozen=True)
class ResidualTest:
    """What is left in the residual of a channel: ``lag1``, correlation of neighbouring samples without the noise's own
    colour; ``white``: portmanteau test passed; ``input_correlated``: it follows an input.
    """

    lag1: float
    white: bool
    input_correlated: bool

    def to_json(self) -> dict[str, float | bool]:
        """Return the test as the contract writes it."""
        return asdict(self)


def residual_test(residuals: Sequence[Array], inputs: Sequence[Array], rho: float = 0.0) -> ResidualTest:
    """Test the residuals (T,) of several stretches, with their inputs (T, m); ``rho``: colour of the noise."""
    e = [_centred(r[1:] - rho * r[:-1]) for r in residuals]
    columns = ([_centred(u[1:, j]) for u in inputs] for j in range(inputs[0].shape[1]))
    return ResidualTest(float(correlations(e, 1)[0][0]), white(e), any(_follows(e, u) for u in columns))


def _centred(values: Array) -> Array:
    known = np.nan_to_num(values)
    return np.asarray(known - known.mean())


def _follows(e: Sequence[Array], u: Sequence[Array]) -> bool:
    """Whether residuals follow an input, in means over their memory: both are filtered by what whitens the input."""
    r = correlations(e, max(1, min(x.size for x in e) // 200))[0]
    every = 1 + int(np.argmax(np.append(r[:-1] <= 0.5, True)))
    e, u = ([x[: x.size // every * every].reshape(-1, every).mean(axis=1) for x in series] for series in (e, u))
    n, pairs = sum(x.size for x in e), [(_filtered(x, v), _filtered(v, v)) for x, v in zip(e, u, strict=True)]
    lags = min(ACROSS, max(1, n // 10))
    (own, size, n), (_, moved, _) = (correlations(side, lags) for side in zip(*pairs, strict=True))
    sums = [sum(_product(*pair, k) for pair in pairs) for k in range(lags + 1)]
    cross = np.array(sums) / max(n * np.sqrt(size * moved), 1e-300)
    statistic = n * cross @ solve_toeplitz(np.append(1.0 + WHITENING_RIDGE, own), cross)
    return bool(statistic > chndtrix(1.0 - TEST_LEVEL, lags + 1, n * (lags + 1) * PASSED_CORRELATION**2))


def _filtered(x: Array, u: Array) -> Array:
    """Return x (T,) filtered by the autoregression of order `WHITENING_ORDER` that whitens u (T,) (Yule and Walker)."""
    r = correlations([u], max(1, min(WHITENING_ORDER, u.size // 4)))[0]
    weights = solve_toeplitz(np.append(1.0 + 1e-6, r[:-1]), r)
    return np.asarray(lfilter(np.append(1.0, -weights), 1.0, x))


def correlations(parts: Sequence[Array], lags: int) -> tuple[Array, float, int]:
    """Return autocorrelations at lags 1..``lags``, the variance and the number of samples, over several records."""
    sums, total, count = np.zeros(lags), 0.0, 0
    for part in parts:
        e = np.where(np.isfinite(part), part, 0.0)
        total += float(e @ e)
        count += int(np.count_nonzero(e))
        size = 1 << (e.size + max(e.size - 1, lags)).bit_length()
        sums += np.fft.irfft(np.abs(np.fft.rfft(e, size)) ** 2, size)[1 : lags + 1]
    return sums / max(total, 1e-300), total / max(count, 1), count


def white(parts: Sequence[Array]) -> bool:
    """Test whether residuals are white."""
    lags = int(min(FURTHEST, max(20, sum(p.size for p in parts) // 20)))
    r, _, count = correlations(parts, lags)
    statistic = count * (count + 2) * float(np.sum(r**2 / np.maximum(count - np.arange(1, lags + 1), 1)))
    bound = TOLERATED + SURER / np.sqrt(max(count, 1))
    small = statistic < EXCESS * float(chdtri(lags, 1.0 - LIKELY)) or float(np.max(np.abs(r))) < bound
    return bool(small and abs(float(r[:WHITENESS_LAGS].mean())) < bound / 2)


def related(a: Sequence[Array], b: Sequence[Array]) -> bool:
    """Tell whether the slow parts of two series (T,) are correlated: sensors, say, do not know of each other."""
    (r, v, _), (s, w, _), count = correlations(a, OWN_LAGS), correlations(b, OWN_LAGS), sum(x.size for x in a)
    error = np.sqrt(max(1.0 + 2.0 * float(np.sum(r * s)), 1.0) / count)
    pairs = [(np.nan_to_num(x), np.nan_to_num(y)) for x, y in zip(a, b, strict=True)]
    sums = np.sum([[_product(*pair, k) for k in range(-CROSS_LAGS, CROSS_LAGS + 1)] for pair in pairs], axis=0)
    both = np.convolve(sums / max(np.sqrt(v * w) * count, 1e-300), np.ones(CROSS_AVERAGED) / CROSS_AVERAGED, "valid")
    return bool(np.max(np.abs(both)) > max(MIN_CROSS_CORRELATION, COMMON_CAUSE_ERRORS * error))


def _product(x: Array, y: Array, k: int) -> float:
    both = max(x.size - abs(k), 0)
    return float(x[max(k, 0) :][:both] @ y[max(-k, 0) :][:both])


@dataclass(frozen=True)
class Colour:
    """Shares of a residual's ``variance``: ``slow``, ``coloured`` (of correlation ``rho``, ``pure``: of one pole), the
    rest white. ``alone``: first correlation of the coloured part if nothing is slow; so many samples go ``together``.
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
        return bool(self.slow > SHARE_TOLERANCE + SLOW_STANDARD_ERRORS * error)

    def limited(self, white: float, whole: bool) -> Colour:
        """Return the same with all but ``white`` (a share) as structure, if that lasts too long or is ``whole``."""
        lasting = self.rho > MAX_NOISE_CORRELATION - SHARE_TOLERANCE and self.coloured > 0.0 and not self.pure
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
    """Return r_k = slow + coloured rho^k, neither below 0, fitted to the autocorrelations at k =
    1..`WHITENESS_LAGS`.
    """
    r, variance, count = correlations(parts, max(WHITENESS_LAGS, min(FURTHEST, min(p.size for p in parts) // 4)))
    vanished = np.append(r < 2.0 / np.sqrt(max(count, 1)), True)
    together, r = 1.0 + 2.0 * float(np.sum(r[: int(np.argmax(vanished))])), r[:WHITENESS_LAGS]
    pole = _pole(parts, r, count)
    if pole is not None:
        return Colour(variance, 0.0, pole[1], pole[0], count, float(r[0]), True, together)
    best, alone, k = (np.inf, 0.0, 0.0, 0.0), (np.inf, 0.0), np.arange(1, WHITENESS_LAGS + 1)
    for rho in np.linspace(0.1, MAX_NOISE_CORRELATION, 33).tolist():
        shape = rho**k
        slow, fast = np.linalg.lstsq(np.column_stack([np.ones(WHITENESS_LAGS), shape]), r, rcond=None)[0]
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
    if not (
        MAX_NOISE_CORRELATION - SHARE_TOLERANCE < rho <= PURE
        and count * (1.0 - rho) >= POLE_SHARE
        and share >= 1.0 - ROUGH
    ):
        return None
    first = rho * (1 - share) / (share * (1 - rho**2) + (1 - share) * (1 + rho**2))
    theta = 2.0 * first / (1.0 + np.sqrt(max(1.0 - 4.0 * first**2, 0.0)))
    left = [lfilter([1.0, -rho], [1.0, -theta], np.nan_to_num(part))[1:] for part in parts]
    return (rho, share) if white(left) else None


__all__ = ["Colour", "ResidualTest", "colours", "residual_test", "white"]
