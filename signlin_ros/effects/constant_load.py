"""A constant force or torque, such as a weight on a vertical axis."""

from __future__ import annotations

from typing import Any

from signlin_ros.effects.base import Effect
from signlin_ros.par import Par


class ConstantLoad(Effect):
    """A constant force or torque, such as a weight on a vertical axis.

    F = F0 (a load torque T_L is -F0).   [paper eq. (28)]
    """

    name = "constant_load"
    equation = "F0"
    finding = "the residual {F} is the same everywhere: {F0:.3g} {F0.unit}"
    experiment = "move both ways at the same speed"
    command = "steps with rests"
    external = True

    F0 = Par("F", nominal=0.01, low=-1e9, doc="constant force, positive accelerates")
    start = ({"F0": 0.0},)

    def force(self, m: Any, x: Any, p: Any) -> Any:
        return p.F0
