"""The weight of an arm or pendulum."""

from __future__ import annotations

from typing import Any

from signlin_ros.effects.base import Effect
from signlin_ros.par import Par


class GravityLoad(Effect):
    """The weight of an arm or pendulum.

    F = -A sin(q - q0); q = q0 hangs down.   [Spong, Hutchinson and Vidyasagar, Robot Modeling and Control, 2006, ch. 7]
    """

    name = "gravity_load"
    equation = "-A sin(q - q0)"
    external = True

    A = Par("F", nominal=0.05, low=-1e9, doc="largest gravity torque")
    q0 = Par("Q", nominal=0.0, low=-1e4, high=1e4, default=0.0, doc="position that hangs down")

    def force(self, m: Any, x: Any, p: Any) -> Any:
        return -p.A * m.sin(x.position - p.q0)
