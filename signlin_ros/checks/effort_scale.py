"""By what an effort is too large, from forces alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.signal import savgol_filter

from signlin_ros.checks.look import MIN_SAMPLES, Look
from signlin_ros.records.clean import gaps

Array = NDArray[np.float64]

POLYNOMIAL_SAMPLES, ORDER = 7, 2
"""Samples and order of the local polynomials that the acceleration is taken from."""
MIN_FACTOR_CORRELATION = 0.6
"""Squared correlation of both sides of the equation from which on its factor is known: regressed on each other either
way they differ by as much, and it lies in between [Frisch, Statistical Confluence Analysis, 1934]."""
FRICTION_AND_LOAD = 3
"""Columns of the equation up to which dry friction and a load go, behind the model's own force."""
CLEAR = 0.1
"""Part of the usual speed (RMS) from which on the direction is."""


@dataclass(frozen=True)
class EffortScale:
    """By what the first input of records is to be divided, None where that is not known; ``resisted``: what dry
    friction and a load alone leave of it, as a share.
    """

    factor: float | None
    resisted: float


def effort_scale(looks: Sequence[Look]) -> EffortScale | None:
    """Return by what the first input of records is to be divided so that it moves the model's inertia against its own
    forces, dry friction, a load and gravity, of whatever size; None where the input is no force.

    The equation error, by least squares [Ljung, System Identification, 1999, ch. 7]. An observer that follows a record
    tells a factor only to two or three where dry friction makes up for the rest.
    """
    rows = [one for one in map(_equation, looks) if one is not None]
    if not rows:
        return None
    A, y = np.concatenate([one[0] for one in rows]), np.concatenate([one[1] for one in rows])
    if y.size < MIN_SAMPLES * A.shape[1]:
        return None
    own, rest = A[:, 0], A[:, 1:]
    resisted = _left(A[:, 1:FRICTION_AND_LOAD], y)
    own, y = (x - rest @ np.linalg.lstsq(rest, x, rcond=None)[0] for x in (own, y))
    both, most = float(own @ y), float(y @ y)
    known = both * both > max(MIN_FACTOR_CORRELATION * most * float(own @ own), 0.0)
    return EffortScale(both / float(own @ own) if known else None, resisted)


def _left(A: Array, y: Array) -> float:
    """Return the share (RMS) that least squares on A (K, n) leave of y (K,)."""
    left = y - A @ np.linalg.lstsq(A, y, rcond=None)[0]
    return float(np.sqrt((left @ left) / max(float(y @ y), 1e-300)))


def _equation(look: Look) -> tuple[Array, Array] | None:
    """Return the model's own force, dry friction, a load and gravity (K, 5) of a record, and its effort (K,)."""
    base, record, v_name = look.base, look.record, look.velocity
    if base is None or v_name not in base.states or not record.inputs or look.motion is None:
        return None
    row = base.states.index(v_name)
    push = base.B[row, 0]
    unknown = [n for n, a in zip(base.states, base.A[row], strict=True) if a != 0.0 and n not in look.channels]
    if push == 0.0 or [n for n in unknown if n != v_name]:
        return None
    parts = []
    for first, last in pairwise(gaps(record.t)):
        part = slice(first, last)
        if last - first > 4 * POLYNOMIAL_SAMPLES:
            parts.append(_part(look, part, row, float(push)))
    return (np.concatenate([a for a, _ in parts]), np.concatenate([y for _, y in parts])) if parts else None


def _part(look: Look, part: slice, row: int, push: float) -> tuple[Array, Array]:
    base, record = look.base, look.record
    assert base is not None  # noqa: S101  `_equation` asked
    t, u = record.t[part], record.u[part, 0]
    step = float(np.median(np.diff(t)))
    measured = {n: _filled(t, look.of(n)[part]) for n in base.states if n in look.channels}
    if look.velocity in measured:
        v = savgol_filter(measured[look.velocity], POLYNOMIAL_SAMPLES, ORDER)
        a = savgol_filter(measured[look.velocity], POLYNOMIAL_SAMPLES, ORDER, deriv=1, delta=step)
    else:
        v = savgol_filter(measured[look.position], POLYNOMIAL_SAMPLES, ORDER + 1, deriv=1, delta=step)
        a = savgol_filter(measured[look.position], POLYNOMIAL_SAMPLES, ORDER + 1, deriv=2, delta=step)
    x = {**measured, look.velocity: v}
    own = a - sum((base.A[row, base.states.index(n)] * x[n] for n in x if n in base.states), np.zeros(t.size))
    moving = np.abs(v) > CLEAR * float(np.sqrt(np.mean(v**2)))
    turns = look.position in measured and look.model.turns(record.units)
    q = measured[look.position] if turns else np.zeros(t.size)
    A = np.column_stack([own / push, np.sign(v), np.ones(t.size), np.sin(q), np.cos(q) - 1.0])
    return A[moving], savgol_filter(u, POLYNOMIAL_SAMPLES, ORDER)[moving]


def _filled(t: Array, y: Array) -> Array:
    good = np.isfinite(y)
    return np.interp(t, t[good], y[good]) if good.any() else np.zeros(t.size)


__all__ = ["EffortScale", "effort_scale"]
