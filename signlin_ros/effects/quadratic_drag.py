"""Drag of a fluid or a fan, with the square of velocity."""

from __future__ import annotations

from typing import Any

from signlin_ros.effects.base import Effect
from signlin_ros.par import Par


class QuadraticDrag(Effect):
    """Drag of a fluid or a fan, with the square of velocity.

    F = -c2 |v| v.   [Batchelor, An Introduction to Fluid Dynamics, 1967, sec. 5.11]
    """

    name = "quadratic_drag"
    equation = "-c2 |v| v"
    finding = "the residual {F} grows with the square of the {V}, against it: {c2:.3g} {c2.unit}"
    experiment = "move at several constant speeds, up to the highest"
    command = "staircase"
    dissipative = True

    c2 = Par("F·s²/Q²", nominal=1e-5, doc="drag per squared velocity")
    start = ({"c2": 0.05},)

    def force(self, m: Any, x: Any, p: Any) -> Any:
        return -p.c2 * m.abs(x.velocity) * x.velocity
