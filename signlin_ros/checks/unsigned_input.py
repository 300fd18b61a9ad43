"""An input without a sign."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from signlin_ros.checks.base import Check
from signlin_ros.checks.finding import Finding
from signlin_ros.checks.look import MIN_SAMPLES, Look
from signlin_ros.checks.observer import Followed, prediction

Array = NDArray[np.float64]

BOTH = 0.1
"""Least share of the time that the drive moves either way, clear of its noise."""
MAX_SIGNED_RATIO = 0.5
"""What the model leaves if the input had the sign that it needs, as a share of what it leaves without."""
GUESSED = "signed"
PULSE = 60
"""So many samples tell what a pulse of the input leaves."""


class UnsignedInput(Check):
    """The input never changes sign though the drive runs both ways: its direction stands in another column.

    Test: it moves one tenth of the time either way; the linear base needs an input of either sign for a tenth of the
    time, and with these signs leaves `MAX_SIGNED_RATIO` of what it leaves without. A load or a spring that drives back
    needs no such input. Of a right record the base needs hardly any sign but the input's. Cure: none, a sign that the
    model asks for is no measurement. Refused, with the mapping that would state it.
    """

    name = "unsigned_input"
    needs_time = True

    def find(self, look: Look) -> Iterator[Finding]:
        """Yield the input."""
        v = _velocity(look)
        for j, name in enumerate(look.record.inputs[:1] if v is not None and look.base else ()):
            u = look.record.u[:, j]
            if not (u.min() >= 0.0 or u.max() <= 0.0) or np.ptp(u) == 0.0 or v is None or look.base is None:
                continue
            sign = None if look.followed is None else required_sign(look.followed, look.t)
            if sign is None or min(np.mean(sign > 0), np.mean(sign < 0)) < BOTH:
                continue
            p = prediction(look.base, look.record, look.channels, {GUESSED: u * sign})
            if p is None or p.left({name: 0.0, GUESSED: 1.0}) > MAX_SIGNED_RATIO * p.left({GUESSED: 0.0}):
                continue
            yield Finding(self.name, name, "refuse", _sentence(look, name))


def _sentence(look: Look, name: str) -> str:
    columns = look.record.unused
    listed = f" (such as one of {', '.join(map(repr, columns[:8]))})" if columns else ""
    return (
        f"the {name} never changes sign while the {look.velocity} does: its direction is in another column{listed};"
        f' map both, as --signal "{name} = sign(dir) * pwm"'
    )


def _velocity(look: Look) -> Array | None:
    """Return the velocity (T,) where it goes both ways clear of its noise; 0 where it does not."""
    v = look.motion
    if v is None:
        return None
    both = min(float(np.mean(v > 0)), float(np.mean(v < 0)))
    return v if v.size > MIN_SAMPLES and both > BOTH else None


def required_sign(f: Followed, t: Array) -> Array:
    """Return the sign that the first input must have had for a base to follow a record, at the stamps t (T,) s; 0 where
    the record is not followed.

    What is left without the input is matched with what a pulse of it leaves.
    """
    from scipy.signal import fftconvolve

    spread = f.y.std(axis=0)
    left = f.parts()[1:].sum(axis=0) / spread
    shape = replace(f, u=np.eye(PULSE, f.u.shape[1]), t=f.t[:PULSE], y=np.zeros((PULSE, spread.size))).parts()[0]
    pairs = zip(left.T, (-shape / spread).T, strict=True)
    wanted = np.sum([fftconvolve(e, g[::-1])[g.size - 1 :] for e, g in pairs], axis=0)
    at = np.clip(np.searchsorted(f.t, t, side="right") - 1, 0, f.t.size - 1)
    return np.where((t >= f.t[0]) & (t <= f.t[-1] + f.step), np.sign(wanted)[at], 0.0)
