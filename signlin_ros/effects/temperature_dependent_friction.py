"""Dry and viscous friction that fall as a drive warms up."""

from __future__ import annotations

from typing import Any

from signlin_ros.effects.base import Effect
from signlin_ros.par import Par


class TemperatureDependentFriction(Effect):
    """Dry and viscous friction that fall as a drive warms up.

    F = -mu exp(-a_c (T - T_0)) sign(v) - b exp(-a_v (T - T_0)) v, T the temperature, an input that a record
    must hold.   [Simoni, Beschi, Legnani and Visioli, IROS 2015]
    """

    name = "temperature_dependent_friction"
    equation = "-mu exp(-a_c (T - T_0)) sign(v) - b exp(-a_v (T - T_0)) v"
    finding = (
        "the residual {F} changes sign with the {V}, {mu:.3g} {mu.unit}, grows with it, {b:.3g} {b.unit}, and falls by"
        " {a_c:.2g} and {a_v:.2g} of itself for each K"
    )
    experiment = "record the temperature from a cold start on, moving to and fro at several speeds"
    command = "long holds"
    dissipative = True
    start = ({"mu": 0.1, "b": 0.05, "a_c": 0.01, "a_v": 0.01, "T_0": 293.15},)

    mu = Par("F", nominal=0.03, doc="dry friction at T_0")
    b = Par("F·s/Q", nominal=1e-3, doc="viscous friction at T_0")
    a_c = Par("1/K", nominal=0.01, low=-1.0, high=1.0, doc="by how much dry friction falls for each K, relative")
    a_v = Par("1/K", nominal=0.03, low=-1.0, high=1.0, doc="by how much viscous friction falls for each K, relative")
    T_0 = Par("K", nominal=293.15, low=0.0, high=2000.0, default=293.15, doc="temperature at which mu and b hold")
    held = {"T_0": 293.15}

    def force(self, m: Any, x: Any, p: Any) -> Any:
        warmer = x.temperature - p.T_0
        dry = p.mu * m.exp(-p.a_c * warmer)
        return -dry * m.sign(x.velocity) - p.b * m.exp(-p.a_v * warmer) * x.velocity
