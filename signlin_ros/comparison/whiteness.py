"""Is there anything left in a residual? Whiteness and correlation with the input, with bands that know the length.

A long record makes any trace of structure significant. So the hypothesis is not that there is none, but that the
correlations are at most `TOLERATED` in the root mean square: the statistics are compared with a noncentral chi-square.

[Ljung and Box, Biometrika 65 (1978) 297; prewhitening before cross-correlation: Box, Jenkins and Reinsel, Time Series
Analysis, 1994, sec. 11.2]
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_toeplitz
from scipy.special import chndtrix

Array = NDArray[np.float64]

LAGS, TOLERATED = 20, 0.01
"""Correlations of this size (RMS over the lags) are let pass whatever the length of the record."""
LEVEL = 0.01
"""Probability of calling a residual coloured, or correlated, that is just not."""
ORDER, RIDGE = 10, 1e-3
"""Order of the autoregression that whitens the input before the cross-correlation; what is added to the variance of the
whitened input, as a part of it: two channels may be one."""


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
        return {"lag1": self.lag1, "white": self.white, "input_correlated": self.input_correlated}


def residual_test(residuals: Sequence[Array], inputs: Sequence[Array], rho: float = 0.0) -> ResidualTest:
    """Test the residuals (T,) of several stretches, with their inputs (T, m); ``rho``: colour of the noise."""
    e = [_standardized(np.nan_to_num(r[1:] - rho * r[:-1])) for r in residuals]
    n = sum(r.size for r in e)
    lags = min(LAGS, max(1, n // 10))
    own = np.array([_pooled(e, e, k) for k in range(1, lags + 1)])
    white = not _exceeds(float(np.sum(own**2 * n * (n + 2) / (n - np.arange(1, lags + 1)))), lags, n)
    columns = range(inputs[0].shape[1])
    followed = any(_follows(e, [_standardized(u[1:, j]) for u in inputs], lags) for j in columns)
    return ResidualTest(float(own[0]), white, followed)


def _follows(e: Sequence[Array], u: Sequence[Array], lags: int) -> bool:
    """Whether residuals follow an input: both are filtered by what whitens the input."""
    every = _memory(e)
    e, u = ([x[: x.size // every * every].reshape(-1, every).mean(axis=1) for x in series] for series in (e, u))
    lags = min(lags, max(1, sum(x.size for x in e) // 10))
    pairs = [(_filtered(x, v), _filtered(v, v)) for x, v in zip(e, u, strict=True)]
    filtered, white = [_standardized(x) for x, _ in pairs], [_standardized(v) for _, v in pairs]
    n = sum(x.size for x in filtered)
    cross = np.array([_pooled(filtered, white, k) for k in range(lags + 1)])
    own = np.array([_pooled(filtered, filtered, k) for k in range(lags + 1)])
    own[0] = own[0] * (1 + RIDGE) + 1e-12
    return _exceeds(float(n * cross @ solve_toeplitz(own, cross)), lags + 1, n)


def _memory(e: Sequence[Array]) -> int:
    """Return after how many samples the correlation of the residuals has fallen to a half, at least 1."""
    limit = max(1, min(x.size for x in e) // 200)
    return next((lag for lag in range(1, limit) if _pooled(e, e, lag) <= 0.5), limit)


def _exceeds(statistic: float, degrees: int, n: int) -> bool:
    """Whether a statistic of ``degrees`` correlations of n samples is larger than tolerated, at the level `LEVEL`."""
    return bool(statistic > chndtrix(1 - LEVEL, degrees, n * degrees * TOLERATED**2))


def _standardized(x: Array) -> Array:
    centred = x - x.mean()
    size = float(np.sqrt(np.mean(centred**2)))
    return np.asarray(centred / size if size > 0 else centred)


def _pooled(a: Sequence[Array], b: Sequence[Array], lag: int) -> float:
    """Return the correlation of a with b ``lag`` samples before, over all stretches."""
    total = sum(x.size for x in a)
    return float(sum(x[lag:] @ y[: max(y.size - lag, 0)] for x, y in zip(a, b, strict=True)) / total)


def _filtered(x: Array, u: Array) -> Array:
    """Return x (T,) filtered by the autoregression of order `ORDER` that whitens u (T,) (Yule and Walker)."""
    order = min(ORDER, u.size // 4)
    covariance = np.array([u[k:] @ u[: u.size - k] for k in range(order + 1)]) / u.size
    if covariance[0] <= 0 or order < 1:
        return x
    column = covariance[:order].copy()
    column[0] *= 1 + 1e-6
    coefficients = solve_toeplitz(column, covariance[1:])
    return np.asarray(np.convolve(x, np.concatenate([[1.0], -coefficients]))[order : x.size])


__all__ = ["ResidualTest", "residual_test"]
