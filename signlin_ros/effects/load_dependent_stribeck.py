"""Dry friction that grows with the load, and falls from breakaway to its sliding level as velocity grows."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from typing import Any

from signlin_ros.effects.base import Effect
from signlin_ros.effects.interest import MIN_SIZE_SHARE, Bounds, at_least, fading
from signlin_ros.par import Par
from signlin_ros.scale import Scale

MIN_EXCESS = 0.02
"""Excess beneath which there is none to speak of."""


class LoadDependentStribeck(Effect):
    """Dry friction that grows with the load, and falls from breakaway to its sliding level as velocity grows.

    F = -(kappa_d |F_drive| + kappa_e |F_ext|) [1 + excess exp(-(v/v_s)^2)] sign(v); `load_dependent_friction` for
    excess = 0.   [Hamon, Gautier and Garrec, IROS 2010; Rhoban BAM, model M4 and up]
    """

    name = "load_dependent_stribeck"
    equation = "-(kappa_d |F_drive| + kappa_e |F_ext|) [1 + excess exp(-(v/v_s)^2)] sign(v)"
    finding = (
        "the residual {F} changes sign with the {V} and its size follows the load, {kappa_d:.3g} of the driving {F} and"
        " {kappa_e:.3g} of the external one, by {excess:.3g} times more beneath {v_s:.3g} {v_s.unit}"
    )
    experiment = "move under different loads, and creep through standstill under each"
    command = "slow ramps through standstill"
    family = "dry friction"
    contains = ("stribeck_friction",)
    dissipative = True
    telling = ("excess",)
    essential = ("excess",)

    kappa_d = Par("-", nominal=0.1, high=0.99, doc="friction per unit of driving force")
    kappa_e = Par("-", nominal=0.1, high=0.99, doc="friction per unit of external force")
    excess = Par("-", nominal=0.5, high=100.0, doc="breakaway above the sliding level, as a share of it")
    v_s = Par("Q/s", nominal=2.0, positive=True, doc="velocity at which the excess has fallen to 1/e")
    start = tuple(
        {"kappa_d": 0.05, "kappa_e": 0.05, "excess": excess, "v_s": v_s}
        for excess, v_s in itertools.product((0.3, 1.5), (0.05, 0.2, 0.6))
    )

    @classmethod
    def simpler(cls, p: Mapping[str, float]) -> dict[str, dict[str, float]]:
        plain = {"kappa_d": p["kappa_d"], "kappa_e": p["kappa_e"]}
        return {"load_dependent_friction": plain} if p["excess"] < MIN_EXCESS else {}

    @classmethod
    def of_interest(cls, p: Mapping[str, float], scale: Scale) -> dict[str, Bounds]:
        return {"excess": at_least(MIN_SIZE_SHARE), "v_s": fading(scale)}

    def force(self, m: Any, x: Any, p: Any) -> Any:
        load = p.kappa_d * m.abs(x.drive_force) + p.kappa_e * m.abs(x.external_force)
        return -load * (1 + p.excess * m.exp(-((x.velocity / p.v_s) ** 2))) * m.sign(x.velocity)
