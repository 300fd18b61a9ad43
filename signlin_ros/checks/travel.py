"""How the change of a position goes with the integral of a velocity."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from signlin_ros.records.clean import MIN_HOLE_STEPS

Array = NDArray[np.float64]

MIN_AGREEMENT = 0.9
"""Least squared correlation of travel and integral where one follows from the other: a factor that is twice as large in
one half of the motion has just this."""
MIN_EXCESS_OVER_NOISE = 10.0
"""By how much both must exceed what their noise does, for anything to be said."""
EQUAL = 0.6
"""Factors nearer to 1 than this are a matter of the sensors' gains, which a diagnosis tells."""
FACTOR_TOLERANCE = 0.04
"""By how much a factor may miss that of a unit."""
MIN_OFFSET_STANDARD_ERRORS, MIN_OFFSET_SHARE = 10.0, 0.1
"""Standard errors of an offset of the velocity that is told, and its least size, as a share of the velocity (RMS)."""
MIN_TRAVEL_SAMPLES = 100
"""Fewer samples tell nothing."""


@dataclass(frozen=True)
class Travel:
    """How the change of the position goes with the integral of the velocity over the same time: ``factor`` of the
    velocity over the position's rate, squared ``correlation``, and by how much both exceed their noise; ``offset``: by
    how much the velocity exceeds that rate on average, 0 where that is not sure.
    """

    factor: float
    correlation: float
    clear: float
    offset: float = 0.0

    @property
    def known(self) -> bool:
        """Whether one follows from the other, so that the factor is known."""
        return self.clear > MIN_EXCESS_OVER_NOISE and self.correlation > MIN_AGREEMENT


def travel(t: Array, q: Array, v: Array, of_q: float, of_v: float) -> Travel | None:
    """Return how travel and integral go together, over the stretches in which the position changes most, and in which
    no sample is missing for long.
    """
    if q.size < MIN_TRAVEL_SAMPLES:
        return None
    steps = np.diff(t)
    hole = steps > MIN_HOLE_STEPS * np.median(steps)  # nobody knows the velocity meanwhile
    path = np.concatenate([[0.0], np.cumsum(0.5 * (v[1:] + v[:-1]) * steps)])
    holes = np.concatenate([[0], np.cumsum(hole)])
    found = [(w, holes[w:] == holes[:-w]) for w in (2**k for k in range(1, 14)) if w <= q.size // 10]
    found = [(w, whole) for w, whole in found if whole.sum() > q.size // 2]
    if not found:
        return None
    w, whole = max(found, key=lambda one: float(np.std((q[one[0] :] - q[: -one[0]])[one[1]])))
    dq, dp = (q[w:] - q[:-w])[whole], (path[w:] - path[:-w])[whole]
    noise = max(np.sqrt(2.0) * of_q, 1e-300), max(of_v * float(np.median(steps)) * np.sqrt(w), 1e-300)
    pairs = [_regressed(dq, dp, noise), _regressed(dq - dq.mean(), dp - dp.mean(), noise)]
    best = max((one for one in pairs if one is not None), key=lambda one: one.correlation, default=None)
    if best is None or best.correlation <= MIN_AGREEMENT:
        return best
    return replace(best, offset=_offset(dq, dp, w, w * float(np.median(steps))))


def _offset(dq: Array, dp: Array, count: int, time: float) -> float:
    """Return by how much a velocity exceeds the position's rate, of changes (T,) over ``count`` samples and a time. A
    drive that runs one way does not tell an offset from a gain, or from a lag at its start.
    """
    spread, around = float(dq.std()), dq - dq.mean()
    if spread <= abs(dq.mean()):
        return 0.0
    factor = float(np.mean(around * (dp - dp.mean()))) / spread**2
    left = dp - factor * dq
    error = float(left.std()) / np.sqrt(dq.size / count)
    large = abs(left.mean()) > MIN_OFFSET_SHARE * float(np.sqrt(np.mean((factor * dq) ** 2)))
    return float(left.mean()) / time if large and abs(left.mean()) > MIN_OFFSET_STANDARD_ERRORS * error else 0.0


def _regressed(dq: Array, dp: Array, noise: tuple[float, float]) -> Travel | None:
    """Return how two changes (T,) go together, as they are: a drive that runs one way tells by its mean, another one
    better without it, for a velocity may have an offset.
    """
    sizes = float(np.sqrt(np.mean(dq**2))), float(np.sqrt(np.mean(dp**2)))
    if min(sizes) == 0.0:
        return None
    r = float(np.mean(dq * dp)) / (sizes[0] * sizes[1])
    clear = min(sizes[0] / noise[0], sizes[1] / noise[1])
    return Travel(float(np.sign(r)) * sizes[1] / sizes[0], r * r, clear)


__all__ = ["EQUAL", "FACTOR_TOLERANCE", "MIN_AGREEMENT", "MIN_EXCESS_OVER_NOISE", "Travel", "travel"]
