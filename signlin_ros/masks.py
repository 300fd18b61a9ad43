"""Runs of samples that a mask marks."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Mask = NDArray[np.bool_]
Index = NDArray[np.intp]


def ends_of_runs(at: Mask) -> tuple[Index, Index]:
    """Return where the runs of a mask (T,) begin, and where they have ended."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], at, [False]]).astype(np.int8)))
    return edges[::2], edges[1::2]


def of_runs(size: int, begins: Index, ends: Index) -> Mask:
    """Return the samples (size,) of runs that begin and have ended somewhere."""
    edges = np.zeros(size + 1, dtype=np.intp)
    np.add.at(edges, begins, 1)
    np.add.at(edges, ends, -1)
    return np.asarray(np.cumsum(edges)[:-1] > 0)


__all__ = ["ends_of_runs", "of_runs"]
