"""Elastic stops at both ends of the travel."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from signlin_ros.effects.base import Effect
from signlin_ros.par import Par


class HardStop(Effect):
    """Elastic stops at both ends of the travel.

    F = -k_s [max(q - gap, 0) - max(-q - gap, 0)].   [Brogliato, Nonsmooth Mechanics, 2016, ch. 2]
    """

    name = "hard_stop"
    equation = "-k_s [max(q - gap, 0) - max(-q - gap, 0)]"
    finding = "the residual {F} is zero up to {gap:.3g} {gap.unit} of travel and rises by {k_s:.3g} {k_s.unit} beyond"
    only_beyond = True
    experiment = "move to both ends of the travel"
    command = "staircase"
    telling = ("gap", "k_s")
    contains = ("linear_stiffness",)

    gap = Par("Q", nominal=0.5, doc="travel to either stop")
    k_s = Par("F/Q", nominal=10.0, doc="stiffness of the stops")
    start = tuple({"gap": gap, "k_s": k_s} for gap in (0.4, 0.6, 0.8) for k_s in (0.5, 20.0))

    @classmethod
    def simpler(cls, p: Mapping[str, float]) -> dict[str, dict[str, float]]:
        return {"linear_stiffness": {"k": p["k_s"]}} if p["gap"] == 0.0 else {}

    @classmethod
    def free_within(cls, p: Mapping[str, float]) -> float:
        return p["gap"]

    def force(self, m: Any, x: Any, p: Any) -> Any:
        return -p.k_s * m.dead_zone(x.position, p.gap)
