"""Means of a quantity over bins of a coordinate, with their errors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from signlin_ros.comparison.scene import remembered

Array = NDArray[np.float64]

MIN_BIN_SAMPLES = 8
"""A bin with fewer samples says nothing."""


@dataclass(frozen=True)
class Band:
    """Means of a quantity over bins of a coordinate: ``at``, ``mean``, ``two_errors`` (bins,): ± 2 standard errors."""

    at: Array
    mean: Array
    two_errors: Array


def band(x: Array, values: Array, block: int, bins: int = 30, dense_at_zero: bool = False) -> Band:
    """Return the means of values (N,) over bins of x (N,), with errors that allow for correlation within ``block``
    samples. ``dense_at_zero``: bins are narrow near 0, where dry friction decides.
    """
    low, high = np.quantile(x, [0.002, 0.998])
    edges = np.linspace(low, high, bins + 1)
    if dense_at_zero and low < 0 < high:
        top = max(-low, high)
        scaled = np.linspace(-np.sqrt(-low / top), np.sqrt(high / top), bins + 1)
        edges = top * np.sign(scaled) * scaled**2
    index = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, bins - 1)
    count = np.bincount(index, minlength=bins)
    full = count >= MIN_BIN_SAMPLES
    mean = np.bincount(index, values, bins) / np.maximum(count, 1)
    at = np.bincount(index, x, bins) / np.maximum(count, 1)
    groups = np.arange(x.size) // max(block, 1) * bins + index
    sums = np.bincount(groups, values - mean[index], (groups.max() // bins + 1) * bins).reshape(-1, bins)
    errors = 2.0 * np.sqrt(np.sum(sums**2, axis=0)) / np.maximum(count, 1)
    return Band(at[full], mean[full], errors[full])


def memory(values: Array) -> int:
    """Return after how many samples a quantity (N,) has forgotten itself: twice the lag of correlation 0.1."""
    return min(2 * remembered(values), max(1, values.size // 20))


__all__ = ["MIN_BIN_SAMPLES", "Band", "band", "memory"]
