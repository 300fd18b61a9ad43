"""Dry friction that grows with the load on gears and bearings."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from signlin_ros.effects.base import Effect
from signlin_ros.effects.interest import MIN_SIZE_SHARE, Bounds, at_least
from signlin_ros.par import Par
from signlin_ros.scale import Scale


class LoadDependentFriction(Effect):
    """Dry friction that grows with the load on gears and bearings.

    F = -(kappa_d |F_drive| + kappa_e |F_ext|) sign(v).   [Hamon, Gautier and Garrec, IROS 2010;
    Rhoban BAM, model M2 and up]
    """

    name = "load_dependent_friction"
    equation = "-(kappa_d |F_drive| + kappa_e |F_ext|) sign(v)"
    finding = (
        "the residual {F} changes sign with the {V} and its size follows the load:"
        " {kappa_d:.3g} of the driving {F}, {kappa_e:.3g} of the external one"
    )
    experiment = "move at the same speed under different loads"
    command = "staircase"
    family = "dry friction"
    dissipative = True

    kappa_d = Par("-", nominal=0.1, high=0.99, doc="friction per unit of driving force")
    kappa_e = Par("-", nominal=0.1, high=0.99, doc="friction per unit of external force")
    start = ({"kappa_d": 0.05, "kappa_e": 0.05},)

    @classmethod
    def of_interest(cls, p: Mapping[str, float], scale: Scale) -> dict[str, Bounds]:
        return {"kappa_d": at_least(MIN_SIZE_SHARE * (p["kappa_d"] + p["kappa_e"]))}

    def force(self, m: Any, x: Any, p: Any) -> Any:
        load = p.kappa_d * m.abs(x.drive_force) + p.kappa_e * m.abs(x.external_force)
        return -load * m.sign(x.velocity)
