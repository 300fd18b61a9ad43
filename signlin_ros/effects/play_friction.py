"""Dry friction behind a play: after a reversal nothing is felt until the play is taken up."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from typing import Any

from signlin_ros.effects.base import Effect
from signlin_ros.effects.interest import MIN_SIZE_SHARE, Bounds, at_least, soft
from signlin_ros.par import Par
from signlin_ros.scale import Scale

MIN_GAP_SHARE = 0.02
"""Share of the elastic way beneath which a gap is not worth its name."""


class PlayFriction(Effect):
    """Dry friction behind a play: after a reversal nothing is felt until the play is taken up.

    F = -sigma dz(z), z' = v - sigma |v| dz(z) / F_c, with dz(z) = max(z - gap, 0) - max(-z - gap, 0): no force over a
    way of 2 gap after a reversal; Dahl's friction for gap = 0.
    [Dahl 1968, TOR-0158(3107-18)-1; Nordin and Gutman 2002, doi:10.1016/S0005-1098(02)00047-X]
    """

    name = "play_friction"
    equation = "-sigma dz(z), z' = v - sigma |v| dz(z) / F_c, dz: a dead zone of half width gap"
    finding = (
        "the residual {F} is gone over {gap:.3g} {gap.unit} either way after a reversal, then rises by"
        " {sigma:.3g} {sigma.unit} and settles at {F_c:.3g} {F_c.unit}"
    )
    experiment = "move slowly to and fro, over ways that are longer and shorter than the play"
    command = "slow ramps through standstill"
    family = "dry friction"
    states = {"z": "Q"}
    telling = ("F_c", "gap")
    essential = ("gap",)

    F_c = Par("F", nominal=0.03, positive=True, doc="friction while sliding")
    sigma = Par("F/Q", nominal=1.0, positive=True, doc="stiffness once the play is taken up")
    gap = Par("Q", nominal=0.02, doc="half of the play")
    start = tuple(
        {"F_c": 0.3, "sigma": sigma, "gap": gap} for gap, sigma in itertools.product((0.03, 0.15, 0.4), (10.0, 1.5))
    )

    @classmethod
    def after(cls, simple: str, p: Mapping[str, float]) -> list[dict[str, float]]:
        """Return plays of about the elastic way that Dahl's friction was fitted with."""
        if simple != "dahl_presliding" or min(p["F_c"], p["sigma"]) <= 0:
            return []
        way = p["F_c"] / p["sigma"]
        return [{"F_c": p["F_c"], "sigma": 3.0 * p["sigma"], "gap": share * way} for share in (0.3, 1.0)]

    @classmethod
    def simpler(cls, p: Mapping[str, float]) -> dict[str, dict[str, float]]:
        dahl = {"F_c": p["F_c"], "sigma": p["sigma"]}
        return {"dahl_presliding": dahl} if p["gap"] < MIN_GAP_SHARE * p["F_c"] / p["sigma"] else {}

    @classmethod
    def of_interest(cls, p: Mapping[str, float], scale: Scale) -> dict[str, Bounds]:
        way = p["F_c"] / min(p["sigma"], soft(scale)[1])
        return {"gap": at_least(MIN_SIZE_SHARE * way), "sigma": soft(scale)}

    def force(self, m: Any, x: Any, p: Any) -> Any:
        return -p.sigma * m.dead_zone(x.own.z, p.gap)

    def rates(self, m: Any, x: Any, p: Any) -> dict[str, Any]:
        v = x.velocity
        return {"z": v - p.sigma * m.abs(v) * m.dead_zone(x.own.z, p.gap) / p.F_c}
