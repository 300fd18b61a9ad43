"""A second inertia behind a coupling with play."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from signlin_ros.effects.compliant_load import MAX_RESONANCE, MIN_RESONANCE, CompliantLoad
from signlin_ros.effects.interest import MIN_SIZE_SHARE, Bounds, at_least
from signlin_ros.par import Par
from signlin_ros.scale import Scale

BRED_STARTS = 216
LIGHTEST, HEAVIEST = 0.08, 0.7
"""Inertias that a fit starts from, as parts of force over acceleration,"""
LEAST_DAMPING, MOST_DAMPING = 0.02, 0.3
"""relative damping in contact,"""
MIN_GAP_START, MAX_GAP_START = 0.003, 0.8
"""and half widths of the play, in multiples of velocity² over acceleration (RMS)."""


class Backlash(CompliantLoad):
    """A second inertia behind a coupling with play.

    F = -T, T = k dz(q - q2) + c (v - v2) in contact only, J v2' = T; dz is a dead zone of half width gap.
    [Nordin, Galic and Gutman 1997, doi:10.1002/(SICI)1099-1115(199702)11:1<49::AID-ACS394>3.0.CO;2-X]
    """

    name = "backlash"
    equation = "-T, T = k dz(q - q2) + c (v - v2) in contact only, J v2' = T"
    finding = "an inertia of {J:.3g} {J.unit} is driven only after a play of {gap:.3g} {gap.unit} either way is crossed"
    experiment = "reverse the drive slowly while the load lags"
    command = "slow triangles"

    resonant = False
    rugged = True
    contains = ("compliant_load",)
    floating = True
    essential = ("gap",)
    telling = ("gap",)

    gap = Par("Q", nominal=0.01, doc="half width of the play")

    @classmethod
    def starts(cls, scale: Scale) -> list[dict[str, float]]:
        """Return many: loads of some parts of the inertia, resonances in contact, damping, parts of an excursion."""
        import numpy as np
        from scipy.stats.qmc import Halton

        highest = MAX_RESONANCE / scale.step
        low = np.log([LIGHTEST, min(4 * MIN_RESONANCE / scale.duration, highest / 4), LEAST_DAMPING, MIN_GAP_START])
        high = np.log([HEAVIEST, highest, MOST_DAMPING, MAX_GAP_START])
        points = np.exp(low + (high - low) * Halton(4, scramble=False).random(BRED_STARTS + 1)[1:])
        found = []
        for J, w, d, gap in points * [scale.of("F·s²/Q"), 1.0, 1.0, scale.excursion]:
            found.append({"k": J * w * w, "c": d * J * w, "J": J, "gap": gap})
        return [{name: float(value) for name, value in one.items()} for one in found]

    @classmethod
    def holding(cls, simple: str, p: Mapping[str, float]) -> dict[str, float]:
        return {n: p[n] for n in ("k", "c", "J")} if simple == "compliant_load" else {}

    @classmethod
    def simpler(cls, p: Mapping[str, float]) -> dict[str, dict[str, float]]:
        return {"compliant_load": {n: p[n] for n in ("k", "c", "J")}} if p["gap"] == 0.0 else {}

    @classmethod
    def plausible(cls, p: Mapping[str, float]) -> bool:
        """Refuse a play of nothing: an elastic coupling is another effect; and contact that is no such coupling."""
        return bool(p["gap"] > 0.0) and super().plausible(p)

    @classmethod
    def of_interest(cls, p: Mapping[str, float], scale: Scale) -> dict[str, Bounds]:
        """Return the play that a share of the driving force would close by its elasticity."""
        return {"gap": at_least(MIN_SIZE_SHARE * scale.force / max(p["k"], 1e-300))}

    def coupling(self, m: Any, x: Any, p: Any) -> Any:
        """Return the torque through the coupling, zero while the play is crossed."""
        twist = x.position - x.own.position
        in_contact = m.contact(twist - p.gap) + m.contact(-twist - p.gap)
        return p.k * m.dead_zone(twist, p.gap) + p.c * (x.velocity - x.own.velocity) * in_contact
