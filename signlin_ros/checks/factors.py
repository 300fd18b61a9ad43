"""Units in which people log what a model has in SI units, and what a value reads in each."""

from __future__ import annotations

import math

TURN = 2.0 * math.pi
LENGTH = {"mm": 1e3, "cm": 1e2, "inches": 1 / 0.0254, "um": 1e6}
ANGLE = {"degrees": 360.0 / TURN, "turns": 1.0 / TURN, "mrad": 1e3}
SPEED = {"mm/s": 1e3, "cm/s": 1e2, "in/s": 1 / 0.0254, "m/min": 60.0}
TURNING = {"rpm": 60.0 / TURN, "deg/s": 360.0 / TURN, "turns/s": 1.0 / TURN}
FORCE = {"kN": 1e-3, "mN": 1e3, "lbf": 1 / 4.4482216, "kgf": 1 / 9.80665}
TORQUE = {"mN·m": 1e3, "N·cm": 1e2, "oz·in": 1 / 0.00706155, "lbf·in": 1 / 0.1129848, "kgf·cm": 1 / 0.0980665}
UNITS: dict[str, dict[str, float]] = {
    "m": LENGTH,
    "rad": ANGLE,
    "m/s": SPEED,
    "rad/s": TURNING,
    "N": FORCE,
    "N·m": TORQUE,
    "A": {"mA": 1e3},
    "V": {"mV": 1e3, "kV": 1e-3},
}
"""By the model's unit: other units, and how many of them one of it is."""
TOGETHER = (
    ("rad", "degrees", "deg/s"),
    ("rad", "turns", "turns/s"),
    ("rad", "turns", "rpm"),
    ("rad", "degrees", "rpm"),
    ("m", "mm", "mm/s"),
    ("m", "cm", "cm/s"),
    ("m", "inches", "in/s"),
)
"""Units in which position and velocity are logged together: the model's, the position's, the velocity's."""
ROTARY = {"m": "rad", "m/s": "rad/s", "N": "N·m"}
"""What a unit of a plant that stands for both kinds of drive may stand for."""


def other_units(unit: str, turns: bool | None = None) -> dict[str, float]:
    """Return other units for what a model has in ``unit``, and how many of them one of it is; ``turns``: whether the
    axis does, None where nothing says: then those of either kind.
    """
    turning = UNITS.get(ROTARY.get(unit, ""), {})
    return {**({} if turns and turning else UNITS.get(unit, {})), **({} if turns is False else turning)}


def word(unit: str) -> str:
    """Return a unit as a part of a name: ``speed_in_rpm``, ``position_in_deg_s``."""
    return unit.replace("/", "_").replace("·", "")


__all__ = ["TOGETHER", "TURN", "other_units", "word"]
