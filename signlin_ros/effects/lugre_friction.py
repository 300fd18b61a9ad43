"""LuGre friction: elastic presliding with a Stribeck curve."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from signlin_ros.effects.base import Effect
from signlin_ros.effects.interest import MIN_SIZE_SHARE, Bounds, at_least, fading, soft
from signlin_ros.par import Par
from signlin_ros.scale import Scale

LARGER_BREAKAWAY = 1.2
"""Breakaway friction over sliding friction from which a fit starts where the simpler law has none."""


class LuGreFriction(Effect):
    """LuGre friction: elastic presliding with a Stribeck curve.

    F = -(sigma0 z + sigma1 z' + sigma2 v), z' = v - sigma0 |v| z / g, g = F_c + (F_s - F_c) exp(-(v/v_s)^2).
    [Canudas de Wit et al. 1995, doi:10.1109/9.376053]
    """

    name = "lugre_friction"
    equation = "-(sigma0 z + sigma1 z' + sigma2 v), z' = v - sigma0 |v| z / g, g = F_c + (F_s - F_c) exp(-(v/v_s)^2)"
    finding = (
        "the residual {F} bends like a spring of {sigma0:.3g} {sigma0.unit} after reversals,"
        " breaks away at {F_s:.3g} {F_s.unit} and slides at {F_c:.3g}"
    )
    experiment = "ramp the force slowly up to breakaway and back"
    command = "slow ramps through standstill"
    family = "dry friction"
    contains = ("coulomb_friction", "stribeck_friction", "dahl_presliding")
    states = {"z": "Q"}
    telling = ("F_c", "sigma0")

    sigma0 = Par("F/Q", nominal=10.0, positive=True, doc="stiffness of the bristles")
    sigma1 = Par("F·s/Q", nominal=0.01, doc="damping of the bristles")
    sigma2 = Par("F·s/Q", nominal=0.0, doc="viscous friction")
    F_c = Par("F", nominal=0.03, positive=True, doc="friction at high velocity")
    F_s = Par("F", nominal=0.05, positive=True, doc="breakaway level")
    v_s = Par("Q/s", nominal=1.0, positive=True, doc="Stribeck velocity")
    start = tuple(
        {"sigma0": sigma0, "sigma1": 0.01, "sigma2": 0.01, "F_c": 0.1, "F_s": 0.15, "v_s": 0.2} for sigma0 in (5.0, 0.7)
    )

    @classmethod
    def after(cls, simple: str, p: Mapping[str, float]) -> list[dict[str, float]]:
        """Return Dahl's bristles under a Stribeck curve about his level."""
        if simple != "dahl_presliding":
            return []
        return [{"sigma0": p["sigma"], "sigma1": 0.0, "sigma2": 0.0, "F_c": 0.8 * p["F_c"], "F_s": 1.1 * p["F_c"]}]

    @classmethod
    def holding(cls, simple: str, p: Mapping[str, float]) -> dict[str, float]:
        if simple == "coulomb_friction":
            return {"F_c": p["mu"], "F_s": LARGER_BREAKAWAY * p["mu"]}
        if simple == "stribeck_friction":
            return {"F_c": p["mu"], "F_s": p["mu"] + p["excess"], "v_s": p["v_s"]}
        if simple == "dahl_presliding":
            return {"sigma0": p["sigma"], "F_c": p["F_c"], "F_s": LARGER_BREAKAWAY * p["F_c"]}
        return {}

    @classmethod
    def nearby(cls, p: Mapping[str, float]) -> list[dict[str, float]]:
        """Return a breakaway level above the sliding one, where a curve that rises stands for viscous friction."""
        if p["F_s"] >= p["F_c"]:
            return []
        viscous = p["sigma2"] + (p["F_c"] - p["F_s"]) / p["v_s"]
        return [{**p, "sigma2": viscous, "F_c": p["F_s"], "F_s": 1.5 * p["F_s"], "v_s": 0.1 * p["v_s"]}]

    @classmethod
    def simpler(cls, p: Mapping[str, float]) -> dict[str, dict[str, float]]:
        """Return presliding without a rising level, and a rising level without presliding."""
        excess = max(p["F_s"] - p["F_c"], 0.01 * p["F_c"])
        return {
            "dahl_presliding": {"F_c": p["F_c"], "sigma": p["sigma0"]},
            "stribeck_friction": {"mu": p["F_c"], "excess": excess, "v_s": p["v_s"]},
        }

    @classmethod
    def plausible(cls, p: Mapping[str, float]) -> bool:
        return p["F_s"] > 0.8 * p["F_c"]  # breaking away takes no less than sliding

    @classmethod
    def of_interest(cls, p: Mapping[str, float], scale: Scale) -> dict[str, Bounds]:
        """Return soft bristles, and a breakaway level so much above the sliding one: else they are Dahl's."""
        breakaway = at_least((1.0 + MIN_SIZE_SHARE) * abs(p["F_c"]))
        return {"sigma0": soft(scale), "F_s": breakaway, "v_s": fading(scale)}

    def force(self, m: Any, x: Any, p: Any) -> Any:
        z_rate = self.rates(m, x, p)["z"]
        return -(p.sigma0 * x.own.z + p.sigma1 * z_rate + p.sigma2 * x.velocity)

    def rates(self, m: Any, x: Any, p: Any) -> dict[str, Any]:
        v = x.velocity
        g = p.F_c + (p.F_s - p.F_c) * m.exp(-((v / p.v_s) ** 2))
        return {"z": v - p.sigma0 * m.abs(v) * x.own.z / g}
