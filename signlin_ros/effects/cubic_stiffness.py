"""A spring that hardens (or softens) with travel."""

from __future__ import annotations

from typing import Any

from signlin_ros.effects.base import Effect
from signlin_ros.par import Par


class CubicStiffness(Effect):
    """A spring that hardens (or softens) with travel.

    F = -k3 q^3.   [Duffing 1918]
    """

    name = "cubic_stiffness"
    equation = "-k3 q^3"
    finding = "the residual {F} grows with the cube of the {Q}: {k3:.3g} {k3.unit}"
    experiment = "move further out to both sides"
    command = "staircase"
    external = True
    family = "nonlinear stiffness"

    k3 = Par("F/Q³", nominal=0.1, low=-1e24, high=1e24, doc="cubic stiffness; positive hardens")
    start = ({"k3": 0.05},)
    contains = ("linear_stiffness",)

    def force(self, m: Any, x: Any, p: Any) -> Any:
        return -p.k3 * x.position**3
