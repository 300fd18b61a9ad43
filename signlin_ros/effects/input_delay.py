"""An input that arrives late."""

from __future__ import annotations

from typing import Any

from signlin_ros.effects.base import Effect
from signlin_ros.par import Par


class InputDelay(Effect):
    """An input that arrives late.

    u(t) -> u(t - T).   [Astrom and Wittenmark, Computer-Controlled Systems, 1997, sec. 2.3]
    """

    name = "input_delay"
    equation = "u(t) -> u(t - T)"
    finding = "the response comes {T:.3g} s after the input"
    experiment = "apply steps of the input and sample faster"

    T = Par("s", nominal=0.005, high=10.0, doc="delay")
    start = ({"T": 1.5}, {"T": 4.5})

    def delay(self, p: Any) -> Any:
        return p.T
