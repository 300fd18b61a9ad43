"""The weight of an arm or pendulum."""

from __future__ import annotations

from typing import Any

from signlin_ros.effects.base import Effect
from signlin_ros.par import Par
from signlin_ros.scale import Scale


class GravityLoad(Effect):
    """The weight of an arm or pendulum.

    F = -A sin(q - q0); q = q0 hangs down.   [Spong, Hutchinson and Vidyasagar, Robot Modeling and Control, 2006, ch. 7]
    """

    name = "gravity_load"
    equation = "-A sin(q - q0)"
    finding = "the residual {F} is one sine of the {Q}, {A:.3g} {A.unit} high, zero at {q0:.3g} {q0.unit}"
    angular = True
    experiment = "rest at several positions over a full turn"
    command = "staircase"
    external = True

    turning = ("A", "q0")

    A = Par("F", nominal=0.05, low=-1e9, doc="largest gravity torque")
    q0 = Par("Q", nominal=0.0, low=-1e4, high=1e4, default=0.0, doc="position that hangs down")

    @classmethod
    def starts(cls, scale: Scale) -> list[dict[str, float]]:
        """Two phases a quarter turn apart: in radians whatever the travel. Of a small load the angle runs away."""
        return [{"A": 0.2 * scale.force, "q0": 0.0}, {"A": 0.2 * scale.force, "q0": 1.5}]

    def force(self, m: Any, x: Any, p: Any) -> Any:
        return -p.A * m.sin(x.position - p.q0)
