"""Units in which people log what a model has in SI units, and what a value reads in each."""

from __future__ import annotations

import math

RADIANS_PER_TURN = 2.0 * math.pi
LENGTH_UNITS = {"mm": 1e3, "cm": 1e2, "inches": 1 / 0.0254, "um": 1e6}
ANGLE = {"degrees": 360.0 / RADIANS_PER_TURN, "turns": 1.0 / RADIANS_PER_TURN, "mrad": 1e3}
LINEAR_SPEED_UNITS = {"mm/s": 1e3, "cm/s": 1e2, "in/s": 1 / 0.0254, "m/min": 60.0}
ANGULAR_SPEED_UNITS = {
    "rpm": 60.0 / RADIANS_PER_TURN,
    "deg/s": 360.0 / RADIANS_PER_TURN,
    "turns/s": 1.0 / RADIANS_PER_TURN,
}
FORCE_UNITS = {"kN": 1e-3, "mN": 1e3, "lbf": 1 / 4.4482216, "kgf": 1 / 9.80665}
TORQUE = {"mN·m": 1e3, "N·cm": 1e2, "oz·in": 1 / 0.00706155, "lbf·in": 1 / 0.1129848, "kgf·cm": 1 / 0.0980665}
UNITS_OF: dict[str, dict[str, float]] = {
    "m": LENGTH_UNITS,
    "rad": ANGLE,
    "m/s": LINEAR_SPEED_UNITS,
    "rad/s": ANGULAR_SPEED_UNITS,
    "N": FORCE_UNITS,
    "N·m": TORQUE,
    "A": {"mA": 1e3},
    "V": {"mV": 1e3, "kV": 1e-3},
}
"""By the model's unit: other units, and how many of them one of it is."""
LOGGED_TOGETHER = (
    ("rad", "degrees", "deg/s"),
    ("rad", "turns", "turns/s"),
    ("rad", "turns", "rpm"),
    ("rad", "degrees", "rpm"),
    ("m", "mm", "mm/s"),
    ("m", "cm", "cm/s"),
    ("m", "inches", "in/s"),
)
"""Units in which position and velocity are logged together: the model's, the position's, the velocity's."""
ROTARY_COUNTERPARTS = {"m": "rad", "m/s": "rad/s", "N": "N·m"}
"""What a unit of a plant that stands for both kinds of drive may stand for."""


def other_units(unit: str, turns: bool | None = None) -> dict[str, float]:
    """Return other units for what a model has in ``unit``, and how many of them one of it is; ``turns``: whether the
    axis does, None where nothing says: then those of either kind.
    """
    turning = UNITS_OF.get(ROTARY_COUNTERPARTS.get(unit, ""), {})
    return {**({} if turns and turning else UNITS_OF.get(unit, {})), **({} if turns is False else turning)}


def word(unit: str) -> str:
    """Return a unit as a part of a name: ``speed_in_rpm``, ``position_in_deg_s``."""
    return unit.replace("/", "_").replace("·", "")


__all__ = ["LOGGED_TOGETHER", "RADIANS_PER_TURN", "other_units", "word"]
