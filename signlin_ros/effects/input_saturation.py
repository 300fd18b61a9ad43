"""An input that is limited in size."""

from __future__ import annotations

from typing import Any

from signlin_ros.effects.base import Effect
from signlin_ros.par import Par


class InputSaturation(Effect):
    """An input that is limited in size.

    u -> clip(u, -u_max, u_max).   [Khalil, Nonlinear Systems, 2002, sec. 1.2]
    """

    name = "input_saturation"
    equation = "u -> clip(u, -u_max, u_max)"
    finding = "inputs above {u_max:.3g} {u_max.unit} have no more effect than this"
    only_beyond = True
    experiment = "apply larger inputs"
    command = "steps with rests"

    u_max = Par("U", nominal=10.0, positive=True, doc="largest input")
    start = ({"u_max": 0.5}, {"u_max": 0.75}, {"u_max": 0.9})

    def input(self, m: Any, u: Any, p: Any) -> Any:
        return m.clip(u, p.u_max)
