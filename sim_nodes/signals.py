"""Input signals of the simulator, as functions of time."""

from __future__ import annotations

import math
from collections.abc import Callable

Signal = Callable[[float], float]
INPUT_SIGNALS = ("external", "square", "sine", "multisine")
MULTISINE_HARMONICS = (1, 2, 3, 5, 7, 11, 13)
"""Of the multisine; the phases are Schroeder's, which keep the peak low."""


def input_signal(kind: str, amplitude: float, period: float) -> Signal | None:
    """Return the signal u(t) of a kind, largest |u| ``amplitude``, ``period`` in s; None for external."""
    shape = {"square": _square, "sine": _sine, "multisine": _multisine}.get(kind)
    if shape is None:
        return None
    return lambda t: amplitude * shape((t / period) % 1.0)


def _square(phase: float) -> float:
    return 1.0 if phase < 0.5 else -1.0


def _sine(phase: float) -> float:
    return math.sin(2.0 * math.pi * phase)


def _sum(phase: float) -> float:
    shifts = (math.pi * i * i / len(MULTISINE_HARMONICS) for i in range(len(MULTISINE_HARMONICS)))
    return sum(
        math.sin(2.0 * math.pi * n * phase + shift) for n, shift in zip(MULTISINE_HARMONICS, shifts, strict=True)
    )


_PEAK = max(abs(_sum(i / 4096)) for i in range(4096))


def _multisine(phase: float) -> float:
    return _sum(phase) / _PEAK
