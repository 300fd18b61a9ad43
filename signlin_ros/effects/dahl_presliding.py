"""Dry friction with elastic presliding: bristles bend before they slip."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from signlin_ros.effects.base import Effect
from signlin_ros.effects.interest import Bounds, soft
from signlin_ros.par import Par
from signlin_ros.scale import Scale


class DahlPresliding(Effect):
    """Dry friction with elastic presliding: bristles bend before they slip.

    F = -sigma z, z' = v - sigma |v| z / F_c.   [Dahl 1968, TOR-0158(3107-18)-1]
    """

    name = "dahl_presliding"
    equation = "-sigma z, z' = v - sigma |v| z / F_c"
    finding = (
        "the residual {F} lags behind reversals: it settles at {F_c:.3g} {F_c.unit},"
        " with a slope of {sigma:.3g} {sigma.unit} after each"
    )
    experiment = "ramp the force slowly up and down without breaking away"
    command = "slow ramps through standstill"
    family = "dry friction"
    contains = ("coulomb_friction",)
    states = {"z": "Q"}
    telling = ("F_c", "sigma")

    F_c = Par("F", nominal=0.03, positive=True, doc="friction while sliding")
    sigma = Par("F/Q", nominal=1.0, positive=True, doc="stiffness of the bristles")
    start = (
        {"F_c": 0.1, "sigma": 5.0},
        {"F_c": 0.1, "sigma": 0.7},
        {"F_c": 0.1, "sigma": 0.2},
    )

    @classmethod
    def holding(cls, simple: str, p: Mapping[str, float]) -> dict[str, float]:
        return {"F_c": p["mu"]} if simple == "coulomb_friction" else {}

    @classmethod
    def of_interest(cls, p: Mapping[str, float], scale: Scale) -> dict[str, Bounds]:
        return {"sigma": soft(scale)}

    def force(self, m: Any, x: Any, p: Any) -> Any:
        return -p.sigma * x.own.z

    def rates(self, m: Any, x: Any, p: Any) -> dict[str, Any]:
        v = x.velocity
        return {"z": v - p.sigma * m.abs(v) * x.own.z / p.F_c}
