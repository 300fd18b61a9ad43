"""Viscous friction that does not grow in proportion to velocity."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from signlin_ros.effects.base import Effect
from signlin_ros.par import Par


class CubicViscousFriction(Effect):
    """Viscous friction that does not grow in proportion to velocity.

    F = -b v - b3 v^3; b3 is negative in strain-wave gears whose friction grows ever more slowly, and the law then holds
    for |v| < sqrt(-b/b3) only.   [Tuttle and Seering, IEEE Trans. Robotics and Automation 12(3), 1996]
    """

    name = "cubic_viscous_friction"
    equation = "-b v - b3 v^3"
    finding = "the residual {F} grows with the {V}, but not in proportion: {b:.3g} {b.unit}, and {b3:.3g} {b3.unit}"
    experiment = "move at several constant speeds, up to the highest"
    command = "staircase"
    family = "viscous friction"
    telling = ("b3",)
    essential = ("b3",)

    b = Par("F·s/Q", nominal=1e-3, doc="friction per unit of velocity, near standstill")
    b3 = Par("F·s³/Q³", nominal=1e-5, low=-1e9, doc="cubic term")
    start = ({"b": 0.05, "b3": 0.02},)

    @classmethod
    def simpler(cls, p: Mapping[str, float]) -> dict[str, dict[str, float]]:
        return {"viscous_friction": {"b": p["b"]}} if p["b3"] == 0.0 else {}

    def force(self, m: Any, x: Any, p: Any) -> Any:
        v = x.velocity
        return -p.b * v - p.b3 * v**3
