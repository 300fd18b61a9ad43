"""What the stamps say: shared by the checks on time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

MIN_GAP_STEPS = 1.5
"""A step longer than so many median steps is a gap, unless many are."""
MAX_GAP_SHARE = 0.05


RATE_TOLERANCE, MAX_OTHER_STEPS = 0.01, 0.01
"""Steps of one rate are its own but for this share of it, and of all steps no more than this share is another one, or
one at which the rate changes."""


def two_rates(steps: Array) -> tuple[float, float, int] | None:
    """Return two steps in s of which nearly all ``steps`` (N,) are, for long the one and for long the other, the first
    of them first, and how often they change; None where there are no such two.
    """
    low, high = np.percentile(steps, (1, 99))
    large = steps > np.sqrt(max(low, 0.0) * high)
    if large.all() or not large.any():
        return None
    rates = np.array([np.median(steps[~large]), np.median(steps[large])])
    other = np.abs(steps / rates[large.astype(int)] - 1.0) > RATE_TOLERANCE
    changes = int(np.count_nonzero(np.diff(large)))
    if max(changes, int(other.sum())) > MAX_OTHER_STEPS * steps.size:
        return None
    first, second = rates[::-1] if large[0] else rates
    return float(first), float(second), changes


def regular_steps(t: Array) -> Array:
    """Return the steps of stamps (T,) without those across gaps."""
    steps = np.diff(t)
    kept = steps[steps <= MIN_GAP_STEPS * np.median(steps)] if steps.size else steps
    return kept if kept.size >= (1.0 - MAX_GAP_SHARE) * steps.size else steps


__all__ = ["regular_steps", "two_rates"]
