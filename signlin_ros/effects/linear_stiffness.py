"""A linear spring."""

from __future__ import annotations

from typing import Any

from signlin_ros.effects.base import Effect
from signlin_ros.par import Par


class LinearStiffness(Effect):
    """A linear spring.

    F = -k q.   [Hooke 1678]
    """

    name = "linear_stiffness"
    equation = "-k q"
    finding = "the residual {F} grows in proportion to the {Q}: {k:.3g} {k.unit}"
    experiment = "rest at several positions"
    command = "staircase"
    external = True

    k = Par("F/Q", nominal=0.1, doc="stiffness")
    start = ({"k": 0.05},)

    def force(self, m: Any, x: Any, p: Any) -> Any:
        return -p.k * x.position
