"""Is there anything left in a residual? Whiteness, and what it goes together with: an input, another channel.

A long record makes any trace of structure significant. So small correlations never matter, however long it is.

[Ljung and Box 1978, doi:10.1093/biomet/65.2.297; correlated series: Bartlett 1946, doi:10.2307/2983611; prewhitening
before cross-correlation: Box, Jenkins and Reinsel, Time Series Analysis, 1994, sec. 11.2]
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_toeplitz
from scipy.signal import lfilter
from scipy.special import chdtri, chndtrix

Array = NDArray[np.float64]

LAGS, FURTHEST = 12, 200
"""Lags that are looked at, and how many at most where samples may go together for long."""
SPAN, NEAR, ALIKE, MEMORY = 12, 5, 0.1, 50
"""Lags either way at which two series are compared, how many are averaged, least correlation, lags of their own."""
TOLERATED, LIKELY, EXCESS = 0.05, 0.9999, 1.5
"""Correlations that never matter; quantile of chi squared below so many times of which a residual is white."""
SURER, SUREST = 4.0, 5.0
"""Standard errors beyond which a residual is not white; and two channels have a common cause."""
ACROSS, SMALL, LEVEL = 20, 0.01, 0.01
"""Lags at which a residual may follow an input; correlations (RMS over them) that are let pass; and the probability of
saying that it does where they are just that."""
ORDER, RIDGE = 10, 1e-3
"""Order of the autoregression that whitens the input before; what is added to the variance of the whitened residual, as
a part of it: two channels may be one."""


@dataclass(frozen=True)
class ResidualTest:
    """What is left in the residual of a channel.

    ``lag1``: correlation of neighbouring samples, after the noise's own colour is taken out; ``white``: portmanteau
    test passed; ``input_correlated``: the residual follows an input.
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
    """Whether residuals follow an input, in means over as long as they remember themselves: both are filtered by what
    whitens the input, so that the correlations at all lags have the covariance of the filtered residual over n.
    """
    r = correlations(e, max(1, min(x.size for x in e) // 200))[0]
    every = 1 + int(np.argmax(np.append(r[:-1] <= 0.5, True)))
    e, u = ([x[: x.size // every * every].reshape(-1, every).mean(axis=1) for x in series] for series in (e, u))
    n, pairs = sum(x.size for x in e), [(_filtered(x, v), _filtered(v, v)) for x, v in zip(e, u, strict=True)]
    lags = min(ACROSS, max(1, n // 10))
    (own, size, n), (_, moved, _) = (correlations(side, lags) for side in zip(*pairs, strict=True))
    sums = [sum(_product(*pair, k) for pair in pairs) for k in range(lags + 1)]
    cross = np.array(sums) / max(n * np.sqrt(size * moved), 1e-300)
    statistic = n * cross @ solve_toeplitz(np.append(1.0 + RIDGE, own), cross)
    return bool(statistic > chndtrix(1.0 - LEVEL, lags + 1, n * (lags + 1) * SMALL**2))


def _filtered(x: Array, u: Array) -> Array:
    """Return x (T,) filtered by the autoregression of order `ORDER` that whitens u (T,) (Yule and Walker)."""
    r = correlations([u], max(1, min(ORDER, u.size // 4)))[0]
    weights = solve_toeplitz(np.append(1.0 + 1e-6, r[:-1]), r)
    return np.asarray(lfilter(np.append(1.0, -weights), 1.0, x))


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


def white(parts: Sequence[Array]) -> bool:
    """Test whether residuals are white."""
    lags = int(min(FURTHEST, max(20, sum(p.size for p in parts) // 20)))
    r, _, count = correlations(parts, lags)
    statistic = count * (count + 2) * float(np.sum(r**2 / np.maximum(count - np.arange(1, lags + 1), 1)))
    bound = TOLERATED + SURER / np.sqrt(max(count, 1))
    small = statistic < EXCESS * float(chdtri(lags, 1.0 - LIKELY)) or float(np.max(np.abs(r))) < bound
    return bool(small and abs(float(r[:LAGS].mean())) < bound / 2)


def related(a: Sequence[Array], b: Sequence[Array]) -> bool:
    """Tell whether the slow parts of two series (T,) are correlated: sensors, say, do not know of each other."""
    (r, v, _), (s, w, _), count = correlations(a, MEMORY), correlations(b, MEMORY), sum(x.size for x in a)
    error = np.sqrt(max(1.0 + 2.0 * float(np.sum(r * s)), 1.0) / count)
    pairs = [(np.nan_to_num(x), np.nan_to_num(y)) for x, y in zip(a, b, strict=True)]
    sums = np.sum([[_product(*pair, k) for k in range(-SPAN, SPAN + 1)] for pair in pairs], axis=0)
    both = np.convolve(sums / max(np.sqrt(v * w) * count, 1e-300), np.ones(NEAR) / NEAR, "valid")
    return bool(np.max(np.abs(both)) > max(ALIKE, SUREST * error))


def _product(x: Array, y: Array, k: int) -> float:
    return float(x[max(k, 0) : x.size + min(k, 0)] @ y[max(-k, 0) : x.size - max(k, 0)])


__all__ = ["FURTHEST", "LAGS", "SURER", "ResidualTest", "correlations", "related", "residual_test", "white"]
