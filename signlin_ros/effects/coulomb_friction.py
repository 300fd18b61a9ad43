"""Dry (Coulomb) friction."""

from __future__ import annotations

from typing import Any

from signlin_ros.effects.base import Effect
from signlin_ros.par import Par


class CoulombFriction(Effect):
    """Dry (Coulomb) friction.

    F = -mu sign(v), and anything within [-mu, mu] at rest.   [Coulomb 1785; paper eq. (30)]
    """

    name = "coulomb_friction"
    equation = "-mu sign(v)"
    finding = "the residual {F} is {mu:.3g} {mu.unit} against the motion, the same at any {V}"
    experiment = "reverse the motion slowly, many times"
    command = "slow triangles"
    family = "dry friction"
    dissipative = True

    mu = Par("F", nominal=0.03, doc="friction while sliding")
    start = ({"mu": 0.05},)

    def force(self, m: Any, x: Any, p: Any) -> Any:
        return -p.mu * m.sign(x.velocity)
