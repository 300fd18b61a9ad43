"""Viscous friction, proportional to velocity."""

from __future__ import annotations

from typing import Any

from signlin_ros.effects.base import Effect
from signlin_ros.par import Par


class ViscousFriction(Effect):
    """Viscous friction, proportional to velocity.

    F = -b v.   [Newton 1687; Olsson et al. 1998, doi:10.1016/S0947-3580(98)70113-X]
    """

    name = "viscous_friction"
    equation = "-b v"
    finding = "the residual {F} grows in proportion to the {V}: {b:.3g} {b.unit}"
    experiment = "move at several constant speeds"
    command = "staircase"
    family = "viscous friction"
    dissipative = True

    b = Par("F·s/Q", nominal=1e-3, doc="friction per unit of velocity")
    start = ({"b": 0.05},)

    def force(self, m: Any, x: Any, p: Any) -> Any:
        return -p.b * x.velocity
