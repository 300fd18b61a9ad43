"""A winding whose resistance grows as it warms up."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from signlin_ros.effects.base import Effect
from signlin_ros.par import Par
from signlin_ros.scale import Scale

QUICKEST = 0.2
"""Time constant R_th C in s of the smallest windings: some milligrams of copper in air take longer."""


class ThermalResistance(Effect):
    """A winding whose resistance grows as it warms up.

    R_a -> R = R_a (1 + a Theta), C Theta' = R i^2 - Theta / R_th.
    [Hendershot and Miller, Design of Brushless PM Machines, 2010]
    """

    name = "thermal_resistance"
    equation = "R_a -> R = R_a (1 + a Theta), C Theta' = R i^2 - Theta / R_th"
    finding = "the resistance drifts with the losses, as a winding that warms up by {R_th:.3g} K for each watt"
    experiment = "run for long at high current, then cool down"
    command = "long holds"
    states = {"temperature_rise": "K"}
    plants = ("dc_motor",)

    a = Par("1/K", nominal=0.0039, doc="temperature coefficient (copper: 0.0039)")
    C = Par("J/K", nominal=50.0, positive=True, doc="heat capacity of the winding")
    R_th = Par("K/W", nominal=5.0, positive=True, doc="thermal resistance to the surroundings")

    held = {"a": 0.0039}

    @classmethod
    def starts(cls, scale: Scale) -> list[dict[str, float]]:
        """A rise that adds 5 % to the resistance under the record's mean losses, slow or fast in the record."""
        R_th = 0.05 / 0.0039 / (scale.input * scale.current)
        return [{"R_th": R_th, "C": share * scale.duration / R_th} for share in (0.1, 0.5)]

    @classmethod
    def plausible(cls, p: Mapping[str, float]) -> bool:
        """A resistance that follows the losses within milliseconds is a voltage that sags, or what a model lacks."""
        return p["R_th"] * p["C"] >= QUICKEST

    def resistance(self, m: Any, x: Any, p: Any, R_a: Any) -> Any:
        return R_a * (1 + p.a * x.own.temperature_rise)

    def rates(self, m: Any, x: Any, p: Any) -> dict[str, Any]:
        heat = x.resistance * x.current**2
        return {"temperature_rise": (heat - x.own.temperature_rise / p.R_th) / p.C}
