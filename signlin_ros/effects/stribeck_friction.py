"""Dry friction that falls from breakaway to its sliding level as velocity grows."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from typing import Any

from signlin_ros.effects.base import Effect
from signlin_ros.effects.interest import MIN_SIZE_SHARE, Bounds, at_least, fading
from signlin_ros.par import Par
from signlin_ros.scale import Scale


class StribeckFriction(Effect):
    """Dry friction that falls from breakaway to its sliding level as velocity grows.

    F = -[mu + excess exp(-(v/v_s)^2)] sign(v).   [Stribeck 1902; Armstrong-Helouvry et al. 1994,
    doi:10.1016/0005-1098(94)90209-7]
    """

    name = "stribeck_friction"
    equation = "-[mu + excess exp(-(v/v_s)^2)] sign(v)"
    finding = (
        "the residual {F} jumps where the {V} changes sign, by {mu:.3g} {mu.unit} either way"
        " plus {excess:.3g} that fades within {v_s:.3g} {v_s.unit}"
    )
    experiment = "creep through standstill, slower than the speed at which friction settles"
    command = "slow ramps through standstill"
    family = "dry friction"
    contains = ("coulomb_friction",)
    dissipative = True
    telling = ("excess",)

    mu = Par("F", nominal=0.025, doc="friction at high velocity")
    excess = Par("F", nominal=0.02, doc="breakaway level above mu")
    v_s = Par("Q/s", nominal=2.0, positive=True, doc="velocity at which the excess has fallen to 1/e")
    start = tuple(
        {"mu": mu, "excess": excess, "v_s": v_s}
        for mu, excess, v_s in itertools.product((0.05, 0.15, 0.4), (0.05, 0.15, 0.4, 1.0), (0.05, 0.2, 0.6))
    )

    @classmethod
    def holding(cls, simple: str, p: Mapping[str, float]) -> dict[str, float]:
        return {"mu": p["mu"]} if simple == "coulomb_friction" else {}

    @classmethod
    def simpler(cls, p: Mapping[str, float]) -> dict[str, dict[str, float]]:
        return {"coulomb_friction": {"mu": p["mu"]}} if p["excess"] < 0.02 * p["mu"] else {}

    @classmethod
    def of_interest(cls, p: Mapping[str, float], scale: Scale) -> dict[str, Bounds]:
        return {"excess": at_least(MIN_SIZE_SHARE * abs(p["mu"])), "v_s": fading(scale)}

    def force(self, m: Any, x: Any, p: Any) -> Any:
        level = p.mu + p.excess * m.exp(-((x.velocity / p.v_s) ** 2))
        return -level * m.sign(x.velocity)
