"""An input that is more by a constant than what was commanded."""

from __future__ import annotations

from typing import Any

from signlin_ros.effects.base import Effect
from signlin_ros.par import Par


class InputOffset(Effect):
    """An input that is more by a constant than what was commanded: the offset of an amplifier.

    u -> u + u0.   [Armstrong-Helouvry, Dupont and Canudas de Wit 1994, doi:10.1016/0005-1098(94)90209-7, sec. 2: an
    offset of the actuator is part of what looks like friction that differs by direction]
    """

    name = "input_offset"
    equation = "u -> u + u0"
    finding = "the input acts as if it were {u0:.3g} {u0.unit} more than commanded"
    experiment = "turn the machine, or its load, to the other side at the same input"
    proposed = False
    """Without a sensor behind the amplifier no record tells it from a constant load."""

    u0 = Par("U", nominal=0.1, low=-1e9, doc="offset")
    start = ({"u0": 0.05}, {"u0": -0.05})

    def input(self, m: Any, u: Any, p: Any) -> Any:
        return u + p.u0
