"""A spring and a damper in series: a force that relaxes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from signlin_ros.effects.base import Effect
from signlin_ros.par import Par
from signlin_ros.scale import Scale

SHORTEST_RELAXATION, LONGEST_RELAXATION, RELAXATION_TIMES = 3.0, 0.2, 6
"""Relaxation times that a fit starts from: samples, part of a record; how many."""


class MaxwellElement(Effect):
    """A spring and a damper in series: a force that relaxes, as that of rubber, of a bushing, of oil that yields.

    F = -k z, z' = v - z / tau; the damper is k tau. Beside a spring: the standard linear solid.
    [Makris and Constantinou 1991, doi:10.1061/(ASCE)0733-9445(1991)117:9(2708)]
    """

    name = "maxwell_element"
    equation = "-k z, z' = v - z / tau"
    finding = (
        "the residual {F} relaxes in {tau:.3g} {tau.unit} after each change of speed, as a spring of {k:.3g} {k.unit}"
        " in series with a damper"
    )
    experiment = "move by steps, and hold for some relaxation times after each"
    command = "steps with rests"
    contains = ("viscous_friction", "linear_stiffness")
    plants = ("mass_spring_damper", "force_element")
    states = {"z": "Q"}
    telling = ("k", "tau")

    k = Par("F/Q", nominal=1.0, positive=True, doc="stiffness of the spring")
    tau = Par("s", nominal=0.05, positive=True, doc="relaxation time")

    @classmethod
    def starts(cls, scale: Scale) -> list[dict[str, float]]:
        """Return relaxation times from some samples to a part of the record."""
        import numpy as np

        times = np.geomspace(
            SHORTEST_RELAXATION * scale.step, LONGEST_RELAXATION * scale.duration, RELAXATION_TIMES
        ).tolist()
        return [{"k": 0.3 * scale.of("F/Q"), "tau": tau} for tau in times]

    @classmethod
    def holding(cls, simple: str, p: Mapping[str, float]) -> dict[str, float]:
        return {"k": p["k"]} if simple == "linear_stiffness" else {}

    @classmethod
    def is_resolved(cls, p: Mapping[str, float], step: float) -> bool:
        """A force that has relaxed before the next sample is that of a damper."""
        return p["tau"] >= step

    def force(self, m: Any, x: Any, p: Any) -> Any:
        return -p.k * x.own.z

    def rates(self, m: Any, x: Any, p: Any) -> dict[str, Any]:
        return {"z": x.velocity - x.own.z / p.tau}
