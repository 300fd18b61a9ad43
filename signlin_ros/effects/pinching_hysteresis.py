"""A yielding force that slips where it is small, so that its loops are pinched: loose joints, worn bearings, timber."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from typing import Any

from signlin_ros.effects.base import Effect
from signlin_ros.effects.interest import MIN_SIZE_SHARE, Bounds, at_least, soft
from signlin_ros.par import Par
from signlin_ros.scale import Scale

MIN_PINCHING = 0.02
"""Share of the stiffness that must be gone for loops to be pinched."""
MAX_SLIP_FORCE = 0.8
"""Part of the settled force up to which it slips at most: what slips all the way is softer, and not pinched."""


class PinchingHysteresis(Effect):
    """A yielding force that slips where it is small, so that its loops are pinched: loose joints, bearings, timber.

    F = -sigma z, z' = [1 - zeta exp(-(z/z_p)^2)] (v - sigma |v| z / F_c); Dahl's friction for zeta = 0.
    [Baber and Noori 1986, ASME J. Vibration and Acoustics 108(4), without their degradation]
    """

    name = "pinching_hysteresis"
    equation = "-sigma z, z' = [1 - zeta exp(-(z/z_p)^2)] (v - sigma |v| z / F_c)"
    finding = (
        "the residual {F} against the {Q} is a loop that settles at {F_c:.3g} {F_c.unit} and has lost {zeta:.2f} of its"
        " stiffness where the {F} is small"
    )
    experiment = "cycle slowly between two positions, with several amplitudes"
    command = "sines that grow"
    states = {"z": "Q"}
    family = "dry friction"
    telling = ("F_c", "zeta", "z_p")
    essential = ("zeta",)

    F_c = Par("F", nominal=0.03, positive=True, doc="force once it has yielded")
    sigma = Par("F/Q", nominal=1.0, positive=True, doc="stiffness where it does not slip")
    zeta = Par("-", nominal=0.7, high=0.999, doc="share of the stiffness that is lost in the slip")
    z_p = Par("Q", nominal=0.02, positive=True, doc="deflection within which it slips")
    start = tuple(
        {"F_c": 0.3, "sigma": sigma, "zeta": 0.8, "z_p": share * 0.3 / sigma}
        for share, sigma in itertools.product((0.3, 0.7), (1.5, 6.0))
    )

    @classmethod
    def simpler(cls, p: Mapping[str, float]) -> dict[str, dict[str, float]]:
        return {"dahl_presliding": {"F_c": p["F_c"], "sigma": p["sigma"]}} if p["zeta"] < MIN_PINCHING else {}

    @classmethod
    def plausible(cls, p: Mapping[str, float]) -> bool:
        """Refuse what slips up to where it settles: that is Dahl's friction of less stiffness."""
        return p["sigma"] * p["z_p"] < MAX_SLIP_FORCE * p["F_c"]

    @classmethod
    def of_interest(cls, p: Mapping[str, float], scale: Scale) -> dict[str, Bounds]:
        """What hardly slips, over hardly any way, or is too stiff to be seen yielding, is dry friction."""
        way = p["F_c"] / min(p["sigma"], soft(scale)[1])
        slips = (MIN_SIZE_SHARE * way, MAX_SLIP_FORCE * way)
        return {"zeta": at_least(MIN_SIZE_SHARE), "z_p": slips, "sigma": soft(scale)}

    def force(self, m: Any, x: Any, p: Any) -> Any:
        return -p.sigma * x.own.z

    def rates(self, m: Any, x: Any, p: Any) -> dict[str, Any]:
        v, z = x.velocity, x.own.z
        stays = 1 - p.zeta * m.exp(-((z / p.z_p) ** 2))
        return {"z": stays * (v - p.sigma * m.abs(v) * z / p.F_c)}
