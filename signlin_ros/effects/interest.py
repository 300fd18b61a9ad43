"""From which size on a law is of interest beside a simpler one that it contains: see `Effect.of_interest`."""

from __future__ import annotations

import math

from signlin_ros.scale import Scale

Bounds = tuple[float, float]

MIN_SIZE_SHARE = 0.2
"""Part of the friction, or of a law's own larger term, that a smaller one must be to be of interest."""
MIN_VIBRATION_SAMPLES = 16.0
"""Samples in a period of the vibration on a bristle or a shaft that is soft enough to be of interest."""
MIN_FADING_SPEED, MAX_FADING_SPEED = 0.02, 0.25
"""Parts of the RMS speed between which is that up to which friction falls, if it is to be told from one that does not:
below, nobody sees it fall, beyond, it is lower everywhere."""


def at_least(value: float) -> Bounds:
    """Return the bounds of what must be so large."""
    return value, math.inf


def soft(scale: Scale) -> Bounds:
    """Return the bounds of a stiffness on which the moving mass vibrates with `MIN_VIBRATION_SAMPLES` samples in a
    period, or with more.
    """
    return -math.inf, scale.inertia * (2 * math.pi / (MIN_VIBRATION_SAMPLES * scale.step)) ** 2


def fading(scale: Scale) -> Bounds:
    """Return the bounds of the speed up to which friction falls."""
    return MIN_FADING_SPEED * scale.velocity, MAX_FADING_SPEED * scale.velocity


__all__ = ["MIN_SIZE_SHARE", "Bounds", "at_least", "fading", "soft"]
