"""Validation data that repeat the motion of the fit: they tell noise, and not whether the bodies are right."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.signal import fftconvolve

from signlin_ros.arms.data import ArmRun

Array = NDArray[np.float64]
LOOKED_AT = 20.0
"""Samples per second at which motions are held against each other."""
MAX_MOTION_DIFFERENCE = 0.1
"""RMS difference of two motions, in their spread, up to which one repeats the other."""


def repeated(known: Sequence[ArmRun], unseen: Sequence[ArmRun]) -> list[str]:
    """Return a sentence for each source whose unseen motion a record of the fit has already."""
    found = []
    for run in unseen:
        same = [other for other in known if _nearest(other, run) < MAX_MOTION_DIFFERENCE]
        if same:
            whose = "its own part to fit" if same[0].source == run.source else same[0].source
            said = f"{run.source}: its validation data repeat the motion of {whose}"
            found.append(f"{said}: errors on them do not test the bodies; give a record of another motion")
    return list(dict.fromkeys(found))


def _nearest(known: ArmRun, unseen: ArmRun) -> float:
    """Return the smallest RMS difference of an unseen motion from a stretch of a known one, in its spread."""
    step = max(1.0 / LOOKED_AT, known.step, unseen.step)
    a, b = (_at(run, step) for run in (known, unseen))
    spread = b.std(axis=0)
    moved = spread > 0.0
    if len(b) > len(a) or not moved.any():
        return np.inf
    a, b = a[:, moved] / spread[moved], b[:, moved] / spread[moved]
    a, b = a - b.mean(axis=0), b - b.mean(axis=0)
    total = np.concatenate([np.zeros((1, b.shape[1])), np.cumsum(a**2, axis=0)])
    squares = (total[len(b) :] - total[: len(a) - len(b) + 1]).sum(axis=1)
    common = sum(fftconvolve(x, y[::-1], mode="valid") for x, y in zip(a.T, b.T, strict=True))
    left = squares - 2.0 * common + float(np.sum(b**2))
    return float(np.sqrt(max(left.min(), 0.0) / b.size))


def _at(run: ArmRun, step: float) -> Array:
    """Return the positions of a run at times ``step`` s apart."""
    times = np.arange(run.t[0], run.t[-1], step)
    return np.stack([np.interp(times, run.t, column) for column in run.q.T], axis=1)


__all__ = ["repeated"]
