"""What the stamps say: shared by the checks on time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

LONG = 1.5
"""A step longer than so many median steps is a gap, unless many are."""
MANY = 0.05


def regular_steps(t: Array) -> Array:
    """Return the steps of stamps (T,) without those across gaps."""
    steps = np.diff(t)
    kept = steps[steps <= LONG * np.median(steps)] if steps.size else steps
    return kept if kept.size >= (1.0 - MANY) * steps.size else steps


__all__ = ["regular_steps"]
