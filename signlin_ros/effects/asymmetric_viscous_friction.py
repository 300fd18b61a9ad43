"""Viscous friction that differs by direction."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from signlin_ros.effects.base import Effect
from signlin_ros.par import Par


class AsymmetricViscousFriction(Effect):
    """Viscous friction that differs by direction.

    F = -b_p v for v > 0, -b_n v for v < 0.   [Janot, Gautier and Brunot 2019, EMPS benchmark]
    """

    name = "asymmetric_viscous_friction"
    equation = "-b_p v for v > 0, -b_n v for v < 0"
    finding = "the residual {F} grows with the {V}, by {b_p:.3g} {b_p.unit} forward and {b_n:.3g} backward"
    experiment = "move both ways at several speeds"
    command = "staircase"
    family = "viscous friction"
    dissipative = True

    b_p = Par("F·s/Q", nominal=1e-3, doc="friction per unit of velocity, forward")
    b_n = Par("F·s/Q", nominal=1e-3, doc="friction per unit of velocity, backward")
    start = ({"b_p": 0.05, "b_n": 0.05},)

    @classmethod
    def simpler(cls, p: Mapping[str, float]) -> dict[str, dict[str, float]]:
        mean = (p["b_p"] + p["b_n"]) / 2
        return {"viscous_friction": {"b": mean}} if abs(p["b_p"] - p["b_n"]) < 0.02 * mean else {}

    def force(self, m: Any, x: Any, p: Any) -> Any:
        return -p.b_p * m.positive(x.velocity) + p.b_n * m.positive(-x.velocity)
