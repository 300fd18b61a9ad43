"""kS, kV, kA, kG, kP: what a drive asks for, as the constants that an engineer sets.

u = kS sign(v) + kV v + kA a + kP q + kG, fitted by least squares to what the model asks for along triangles of speed
(`signlin_ros.control.inverse`), so that every effect counts as far as constants can show it. Only the faster part of a
triangle counts: there hysteresis has settled and a play is crossed, and the same speeds are passed once faster and once
slower, which tells the inertia from the friction.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from signlin_ros.control.drive import NONE, Drive
from signlin_ros.control.inverse import Inverse
from signlin_ros.control.reference import triangle
from signlin_ros.errors import InputError

Array = NDArray[np.float64]
STEPS = 4000
"""Points of a motion that the constants are fitted to."""
STRETCHES = (0.5, 1.0, 2.0)
"""Periods of the motions, as multiples of the one asked for."""
FROM, TO = 0.4, 0.97
"""Shares of the largest speed between which a motion counts; the corner itself is a jump of the current."""


@dataclass(frozen=True)
class Constants:
    """u = kS sign(v) + kV v + kA a + kP q + kG; ``left`` is the RMS of what constants cannot show, in the input's unit.

    kS, kG, left in the unit of the input; kV, kA, kP per speed, acceleration and position.
    """

    kS: float
    kV: float
    kA: float
    kP: float
    kG: float
    left: float

    def feed(self, motion: Array) -> Array:
        """Return u (T,) for a motion (T, 3): position, speed, acceleration."""
        q, v, a = motion.T
        return np.asarray(self.kS * np.sign(v) + self.kV * v + self.kA * a + self.kP * q + self.kG)


def constants(drive: Drive, speed: float, period: float = 2.0) -> Constants:
    """Fit the constants to motions up to ``speed`` with a period of about ``period`` s; raise `InputError` if odd."""
    motions, inputs = [], []
    for stretch in STRETCHES:
        profile = triangle(speed, stretch * period, cycles=2)
        h = profile.duration / STEPS
        motion = np.column_stack(profile.at(h * (np.arange(STEPS) + 0.5)))
        wanted = Inverse(drive, 1e-3 * speed).along(motion, h)
        share = np.abs(motion[:, 1]) / speed
        counts = (np.arange(STEPS) > STEPS / 4) & (share > FROM) & (share < TO)
        motions.append(motion[counts])
        inputs.append(wanted[counts])
    return _fitted(drive, np.concatenate(motions), np.concatenate(inputs))


def _fitted(drive: Drive, motion: Array, u: Array) -> Constants:
    if not np.isfinite(u).all():
        raise InputError(f"{drive.model.source}: no finite input gives the motion; is an input dead or saturated?")
    q, v, a = motion.T
    columns = {"kS": np.sign(v), "kV": v, "kA": a, "kG": np.ones(v.size)}
    if drive.position != NONE:
        columns["kP"] = q
    table = np.column_stack(list(columns.values()))
    size = np.linalg.norm(table, axis=0)
    values = np.linalg.lstsq(table / size, u, rcond=None)[0] / size
    found = {"kP": 0.0, **dict(zip(columns, map(float, values), strict=True))}
    return Constants(**found, left=float(np.sqrt(np.mean((u - table @ values) ** 2))))
