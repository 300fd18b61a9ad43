"""By the work that it does, whether an input is reversed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from signlin_ros.checks.look import MIN_SAMPLES, Look
from signlin_ros.checks.mixed_clocks import AHEAD

Array = NDArray[np.float64]

REST = 0.1
"""Part of the usual speed (RMS) below which a drive stands still."""
MAX_NET_TRAVEL = 0.2
"""How far a drive ends from where it began, as a part of its whole way: a weight that it lowers does work on it."""
MIN_BACK = 0.3
"""Net work that comes back, as a part of all that goes either way."""
LATE_PART = 0.5
"""Part of the work that comes back which an effort does that acts earlier, where it is late."""
MAX_SHIFT = 3
"""Samples by which an input may come early or late: of a spring or a mass alone the sign of the work is that of it."""


def reversed_by_work(looks: Sequence[Look]) -> str | None:
    """Return the name of the first input, or of a measured current, if it is reversed by its work; None if not.

    From standstill to standstill, and about where it began, a drive keeps no work and gives none back [Khalil,
    Nonlinear Systems, ch. 6]: force times velocity, voltage times current and voltage times velocity are positive on
    the whole, whatever its parameters are.
    """
    parts = [part for part in map(_part, looks) if part is not None]
    if len(parts) < len(looks) or not parts:
        return None
    inputs, moves = [u for u, _, _ in parts], [v for _, _, v in parts]
    between = [(u, i) for u, i, _ in parts if i is not None]
    of_motion = _net(list(zip(inputs, moves, strict=True)))
    first = looks[0].record.inputs[0]
    if len(between) < len(parts):
        pairs, found = list(zip(inputs, moves, strict=True)), first if of_motion[1] < -MIN_BACK else None
    else:
        pairs = between if _net(between)[1] < -MIN_BACK else []
        found = _current(looks[0]) if of_motion[0] > MIN_BACK else first if of_motion[1] < -MIN_BACK else None
    return found if pairs and not _late(pairs) else None


def _current(look: Look) -> str | None:
    """Return the measured channel between the input and the motion, whose product with either is a power."""
    return next((n for n in look.channels if look.unit(n) == "A"), None)


def _part(look: Look) -> tuple[Array, Array | None, Array] | None:
    """Return the first input, the current where it is measured, and the velocity (T,) of a record between its first and
    its last standstill; None where they are not half of it, or it ends elsewhere.
    """
    v = look.motion
    if v is None or not look.record.inputs or look.t.size < 5 * MIN_SAMPLES or look.model.plant.motion_is_imposed():
        return None
    rests = np.flatnonzero(np.abs(v) < REST * float(np.sqrt(np.mean(v**2))))
    if not rests.size or 2 * (rests[-1] - rests[0]) < v.size:
        return None
    part = slice(int(rests[0]), int(rests[-1]) + 1)
    v, steps = v[part], np.gradient(look.t[part])
    if abs(float(v @ steps)) > MAX_NET_TRAVEL * float(np.abs(v) @ steps):
        return None
    current = _current(look)
    i = None if current is None else np.nan_to_num(look.of(current)[part])
    return look.record.u[part, 0], i, v


def _net(pairs: Sequence[tuple[Array, Array]]) -> tuple[float, float]:
    """Return the least and the most net work of efforts and flows, each (T,), as a part of all that goes either way,
    whichever of both is a little late.
    """
    shares = [_share(pairs, shift) for shift in range(-MAX_SHIFT, MAX_SHIFT + 1)]
    return min(shares), max(shares)


def _late(pairs: Sequence[tuple[Array, Array]]) -> bool:
    """Tell whether efforts and flows, each (T,), do work where the effort acts earlier: it is late, not reversed."""
    least = min(a.size for a, _ in pairs)
    back = _share(pairs, 0)
    return any(_share(pairs, -k) > -LATE_PART * back for k in AHEAD if 2 * k < least)


def _share(pairs: Sequence[tuple[Array, Array]], shift: int) -> float:
    """Return the net work of efforts and flows, each (T,), as a part of all, the effort so many samples later."""
    powers = [a[: a.size - shift] * b[shift:] if shift >= 0 else a[-shift:] * b[:shift] for a, b in pairs]
    whole = sum(float(np.abs(p).sum()) for p in powers)
    return sum(float(p.sum()) for p in powers) / whole if whole else 0.0


__all__ = ["reversed_by_work"]
