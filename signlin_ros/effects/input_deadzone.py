"""An input that does nothing until it exceeds a threshold."""

from __future__ import annotations

from typing import Any

from signlin_ros.effects.base import Effect
from signlin_ros.par import Par


class InputDeadzone(Effect):
    """An input that does nothing until it exceeds a threshold.

    u -> max(u - d, 0) - max(-u - d, 0).   [Tao and Kokotovic, Adaptive Control of Systems with Actuator and Sensor
    Nonlinearities, 1996]
    """

    name = "input_deadzone"
    equation = "u -> max(u - d, 0) - max(-u - d, 0)"
    finding = "inputs below {d:.3g} {d.unit} have no effect, and larger ones lack as much"
    experiment = "ramp the input slowly through zero"
    command = "slow triangles"

    d = Par("U", nominal=0.5, doc="threshold")
    start = ({"d": 0.05}, {"d": 0.2})

    def input(self, m: Any, u: Any, p: Any) -> Any:
        return m.dead_zone(u, p.d)
