"""kS, kV, kA, kG, kP: what a drive asks for, as the constants that an engineer sets.

u = kS sign(v) + kV v + kA a + kP q + kG. kA is that of the equations; the others are fitted by least squares to what
the model asks for along triangles of speed (`signlin_ros.control.inverse`), so that every effect counts as far as
constants can show it. Only the faster part of a triangle counts: there hysteresis has settled and a play is crossed.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from signlin_ros.control.drive import NO_SLOT, Drive
from signlin_ros.control.inverse import InverseModel
from signlin_ros.control.reference import Profile, triangle
from signlin_ros.effects import find_effect
from signlin_ros.errors import InputError

Array = NDArray[np.float64]
CONSTANT_POINTS = 2000
"""Points of a motion that the constants are fitted to."""
PERIOD_FACTORS = (0.5, 1.0, 2.0)
"""Periods of the motions, as multiples of the one asked for."""
OFFSETS = (-1.0, -1 / 3, 1 / 3, 1.0)
"""Where the motions start, as multiples of their travel: what goes by the position must not pass for inertia."""
SETTLED_TIME = 1e9
"""Seconds after which a current has settled."""
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
    for stretch in PERIOD_FACTORS:
        for offset in OFFSETS:
            start = offset * speed * stretch * period / 4
            motion, wanted = _asked(drive, replace(triangle(speed, stretch * period, cycles=2), start=start), speed)
            motions.append(motion)
            inputs.append(wanted)
    return _fitted(drive, np.concatenate(motions), np.concatenate(inputs), inertia(drive, speed, speed / period))


def inertia(drive: Drive, speed: float, change: float) -> float:
    """Return kA: by how much more input accelerates more, per acceleration, with the loads that hang on the drive."""
    kinds = [(use.parameters, find_effect(use.type, "effects").load_inertia) for use in drive.model.effects.values()]
    hanging = sum(parameters[name] for parameters, name in kinds if name)
    own = drive.model.parameters[next(name for name in ("J", "m") if name in drive.model.parameters)]
    motion = np.array([[0.0, 0.5 * speed, 0.0], [0.0, 0.5 * speed, change]])
    low, high = (InverseModel(drive, 1e-3 * speed).along(point[None, :], SETTLED_TIME)[0] for point in motion)
    return float(high - low) / change * (1.0 + hanging / own)


def _asked(drive: Drive, profile: Profile, speed: float) -> tuple[Array, Array]:
    """Return the part of a triangle that counts (T, 3), and what it takes (T,)."""
    h = profile.duration / CONSTANT_POINTS
    motion = np.column_stack(profile.at(h * (np.arange(CONSTANT_POINTS) + 0.5)))
    inverse = InverseModel(drive, 1e-3 * speed)
    inverse.reset(profile.start)
    wanted = inverse.along(motion, h)
    share = np.abs(motion[:, 1]) / speed
    counts = (np.arange(CONSTANT_POINTS) > CONSTANT_POINTS / 4) & (share > FROM) & (share < TO)
    return motion[counts], wanted[counts]


def _fitted(drive: Drive, motion: Array, u: Array, kA: float) -> Constants:
    """Fit the constants beside a kA that is known."""
    if not np.isfinite(u).all():
        raise InputError(f"{drive.model.source}: no finite input gives the motion; is an input dead or saturated?")
    q, v, a = motion.T
    columns = {"kS": np.sign(v), "kV": v, "kG": np.ones(v.size)}
    if drive.position != NO_SLOT:
        columns["kP"] = q
    left = u - kA * a
    table = np.column_stack(list(columns.values()))
    size = np.linalg.norm(table, axis=0)
    values = np.linalg.lstsq(table / size, left, rcond=None)[0] / size
    found = {"kP": 0.0, "kA": kA, **dict(zip(columns, map(float, values), strict=True))}
    return Constants(**found, left=float(np.sqrt(np.mean((left - table @ values) ** 2))))
