"""A second inertia behind a coupling with play."""

from __future__ import annotations

from typing import Any

from signlin_ros.effects.compliant_load import CompliantLoad
from signlin_ros.par import Par
from signlin_ros.scale import Scale

PLAYS = (0.1, 0.5)
"""Half widths of the play that a fit starts from, in multiples of velocity² over acceleration (RMS)."""


class Backlash(CompliantLoad):
    """A second inertia behind a coupling with play.

    F = -T, T = k dz(q - q2) + c (v - v2) in contact only, J v2' = T; dz is a dead zone of half width gap.
    [Nordin, Galic and Gutman 1997, doi:10.1002/(SICI)1099-1115(199702)11:1<49::AID-ACS394>3.0.CO;2-X]
    """

    name = "backlash"
    equation = "-T, T = k dz(q - q2) + c (v - v2) in contact only, J v2' = T"
    finding = "an inertia of {J:.3g} {J.unit} is driven only after a play of {gap:.3g} {gap.unit} either way is crossed"
    experiment = "reverse the drive slowly while the load lags"

    gap = Par("Q", nominal=0.01, doc="half width of the play")

    @classmethod
    def starts(cls, scale: Scale) -> list[dict[str, float]]:
        """Return the stiffer loads of `CompliantLoad`, with plays of some parts of an excursion."""
        excursion = min(scale.travel, scale.velocity**2 / scale.acceleration)
        stiff = super().starts(scale)[-2:]
        return [{**one, "gap": gap * excursion} for one in stiff for gap in PLAYS]

    def coupling(self, m: Any, x: Any, p: Any) -> Any:
        """Return the torque through the coupling, zero while the play is crossed."""
        twist = x.position - x.own.position
        in_contact = m.contact(twist - p.gap) + m.contact(-twist - p.gap)
        return p.k * m.dead_zone(twist, p.gap) + p.c * (x.velocity - x.own.velocity) * in_contact
