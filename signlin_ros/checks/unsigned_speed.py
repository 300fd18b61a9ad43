"""A speed without a sign."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from signlin_ros.checks.base import Check, with_channel, without_channel
from signlin_ros.checks.finding import Finding
from signlin_ros.checks.look import MIN_SAMPLES, SIGNED_OVER_NOISE, Look

Array = NDArray[np.float64]

BOTH = 0.1
"""Least share of the moving time that the drive moves either way."""
MAX_SIGNED_RATIO = 0.5
"""What the model leaves of a speed with the sign of the work, as a share of what it leaves without."""
REST = 0.1
"""Part of the usual speed (RMS) below which a drive may turn round."""
MIN_TURNS = 4
"""So many stretches between standstills tell which way each of them went."""


class UnsignedSpeed(Check):
    """The speed never changes sign though the drive runs both ways: a tachometer, or a counter of pulses.

    Test: where the position is measured, it goes either way for one tenth of the moving time, and the speed goes with
    the size of its rate. Else, from one standstill
    to the next the input does work on the drive, which keeps none of it [Khalil, ch. 6: the drive is passive]: where
    that is negative, the speed has the other sign; such stretches hold one tenth of the moving time, and with the signs
    of the work the linear base leaves `MAX_SIGNED_RATIO` of what it leaves without. A drive that runs one way alone
    brakes within the same stretch. Cure: the speed is left out where the position is there; else none, a sign that the
    input asks for is no measurement.
    """

    name = "unsigned_speed"
    needs_time = True
    needs_input = True

    def find(self, look: Look) -> Iterator[Finding]:
        """Yield the velocity."""
        name, v = look.velocity, _unsigned(look)
        if v is None:
            return
        if look.position in look.channels:
            if _to_and_fro(look, v):
                words = f"the {name} never changes sign while the {look.position} goes to and fro: it has no direction"
                remedy = f"the {name} is left out"
                yield Finding(
                    self.name, name, "refuse", words, f"leave_out_{name}", remedy, action=without_channel(name)
                )
            return
        signed = _by_work(look, v)
        if signed is None or look.resisted is None:
            return
        other = Look(look.model, with_channel(look.record, name, signed)).resisted
        if other is None or other.left() > MAX_SIGNED_RATIO * look.resisted.left():
            return
        yield Finding(
            self.name,
            name,
            "refuse",
            f"the {name} never changes sign while the {look.record.inputs[0]} does, and by its work drives both ways: "
            f'it has no direction; map its sign from another column, as --signal "{name} = sign(dir) * speed", '
            f"or record the {look.position}",
        )


def _unsigned(look: Look) -> Array | None:
    """Return a measured velocity (T,) that varies and has one sign; None where it has both, or is none."""
    if look.velocity not in look.channels or not look.record.inputs:
        return None
    v = np.nan_to_num(look.of(look.velocity))
    least = SIGNED_OVER_NOISE * look.noise(look.velocity).sigma
    if v.size < MIN_SAMPLES or np.ptp(v) <= 2.0 * least:
        return None
    return v if v.min() >= -least or v.max() <= least else None


def _to_and_fro(look: Look, v: Array) -> bool:
    """Tell whether the position goes either way, and the speed (T,) goes with how fast it does rather than with its
    rate, as one with an offset: by means over stretches in which the position moves clear of its noise.
    """
    q = np.interp(look.t, *look.finite(look.position))
    usual = REST * float(np.sqrt(np.mean(v**2))) * look.step
    length = int(np.clip(SIGNED_OVER_NOISE * look.noise(look.position).sigma / usual, 1, max(1, q.size // MIN_SAMPLES)))
    count = q.size // length
    rate = np.diff(q[: count * length : length])
    speed = np.abs(v[: (count - 1) * length].reshape(count - 1, length).mean(axis=1))
    moving = np.abs(rate) > REST * float(np.sqrt(np.mean(rate**2)))
    both = min(np.mean(rate[moving] > 0), np.mean(rate[moving] < 0)) if moving.any() else 0.0
    if both < BOTH or np.ptp(speed) == 0.0:
        return False
    of_size, of_rate = (abs(float(np.corrcoef(speed, one)[0, 1])) for one in (np.abs(rate), rate))
    return of_size > of_rate


def _by_work(look: Look, v: Array) -> Array | None:
    """Return the speed (T,) with the sign of the input's work from one standstill to the next; None where that is one.

    What begins or ends within the record tells nothing and is as it is.
    """
    u = look.of(look.record.inputs[0])
    moving = np.abs(v) > max(REST * float(np.sqrt(np.mean(v**2))), SIGNED_OVER_NOISE * look.noise(look.velocity).sigma)
    stretch = np.cumsum(np.diff(moving.astype(int), prepend=0) == 1) * moving
    count = int(stretch.max(initial=0))
    whole = np.arange(count + 1) > int(moving[0])
    whole[0], whole[-1] = False, whole[-1] and not moving[-1]
    if np.count_nonzero(whole) < MIN_TURNS:
        return None
    work = np.bincount(stretch, u * v, count + 1) * whole
    time = np.bincount(stretch, minlength=count + 1) * whole
    if time[work < 0.0].sum() < BOTH * time.sum() or time[work > 0.0].sum() < BOTH * time.sum():
        return None
    return np.asarray(v * np.where(work < 0.0, -1.0, 1.0)[stretch])


__all__ = ["UnsignedSpeed"]
