"""What shows a force that repeats with the position: folded at its strongest order, and a spectrum by order."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from signlin_ros.effects import find_effect
from signlin_ros.model import Model

Array = NDArray[np.float64]

FULL_TURN = 2.0 * np.pi
MAX_SPECTRUM_SAMPLES = 20_000
"""So many samples tell a spectrum."""
MIN_SHOWN_ORDERS, MAX_SHOWN_ORDERS = 12, 60
"""A spectrum shows at least, and at most, so many orders."""
MIN_RELATIVE_INFORMATION = 0.1
"""What samples tell less well than a tenth of the best, as where a part of the turn was hardly seen, is left out."""
TURNS = 2.0
"""A spectrum by order takes so many turns."""


@dataclass(frozen=True)
class Wave:
    """A wave of an effect: ``order`` (periods in 2 pi of position), ``amplitude`` in the plant's unit of force."""

    order: float
    amplitude: float


@dataclass(frozen=True, eq=False)
class Spectrum:
    """Amplitudes by whole order (M,): of what is missing without an effect, and of what is left with it."""

    orders: Array
    missing: Array
    left: Array


def waves_of(model: Model, effect: str) -> list[Wave]:
    """Return the waves of an effect of a model, the strongest first; none where it is none that repeats."""
    found = find_effect(effect, "effects")
    names = (found.periodic[:1] or found.whole_orders[:1]) if found.angular else ()
    uses = [use.parameters for use in model.effects.values() if use.type == effect]
    waves = [
        Wave(value, abs(p[name.replace(names[0], "A", 1)]))
        for p in uses
        for name, value in p.items()
        if names and name.partition("[")[0] == names[0] and name.replace(names[0], "A", 1) in p
    ]
    return sorted((w for w in waves if w.order > 0), key=lambda w: -w.amplitude)


def folded(position: Array, order: float) -> Array:
    """Return the position (N,) within one period of an order, from 0 on."""
    return np.asarray(np.mod(position, FULL_TURN / order), dtype=np.float64)


def spectrum(position: Array, missing: Array, left: Array, waves: Sequence[Wave]) -> Spectrum | None:
    """Return the amplitudes of two forces (N,) by order over the position (N,) in rad; None for less than two turns."""
    if float(np.ptp(position)) < TURNS * FULL_TURN:
        return None
    most = int(np.clip(2 * max(w.order for w in waves), MIN_SHOWN_ORDERS, MAX_SHOWN_ORDERS))
    every = slice(None, None, max(1, position.size // MAX_SPECTRUM_SAMPLES))
    orders = np.arange(1.0, most + 1)
    angle = np.outer(position[every], orders)
    columns = np.concatenate([np.cos(angle), np.sin(angle), np.ones((angle.shape[0], 1))], axis=1)
    values = np.stack([missing[every], left[every]], axis=1)
    found = np.linalg.lstsq(columns, values, rcond=MIN_RELATIVE_INFORMATION)[0]
    sizes = np.hypot(found[:most], found[most : 2 * most])
    return Spectrum(orders, sizes[:, 0], sizes[:, 1])


def said(waves: Sequence[Wave], rotary: bool, unit: str, most: int = 3) -> str:
    """Return waves in words: ``12 per turn, 0.0045 N·m; 24 per turn, 0.001 N·m``; on a slide ``every 0.0125 m``."""
    places = [f"{w.order:.4g} per turn" if rotary else f"every {FULL_TURN / w.order:.3g} m" for w in waves[:most]]
    labels = [f"{place}, {w.amplitude:.2g} {unit}" for place, w in zip(places, waves, strict=False)]
    return "; ".join(labels) + (f"; and {len(waves) - most} weaker" if len(waves) > most else "")


__all__ = ["Spectrum", "Wave", "folded", "said", "spectrum", "waves_of"]
