"""A second inertia behind an elastic coupling."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from signlin_ros.effects.base import Effect
from signlin_ros.effects.interest import Bounds, soft
from signlin_ros.par import Par
from signlin_ros.scale import Scale

MIN_RESONANCE, MAX_RESONANCE, RESONANCES = 25.0, 0.6, 8
"""Angular frequencies that a fit starts from: four periods in a record, a tenth of the sampling rate; how many."""
INERTIA_RATIOS = (0.1, 0.3, 1.0)
"""Inertias of the load beside that of the plant that a fit starts from: the heavier, the further apart are the
resonance and the antiresonance."""
MIN_DAMPING_RATIO, OVERDAMPED = 0.002, 1.0
"""Damping ratios of the load on its coupling: least of one that is real, largest of one that is called elastic."""


class CompliantLoad(Effect):
    """A second inertia behind an elastic coupling.

    F = -T, T = k (q - q2) + c (v - v2), J v2' = T.   [Leonhard, Control of Electrical Drives, 2001, ch. 2]
    """

    name = "compliant_load"
    equation = "-T, T = k (q - q2) + c (v - v2), J v2' = T"
    finding = "an inertia of {J:.3g} {J.unit} swings on a coupling of {k:.3g} {k.unit}"
    experiment = "excite with a sweep up to the resonance"
    command = "chirps"
    telling = ("J",)
    load_inertia = "J"
    resonant = True
    states = {"position": "Q", "velocity": "Q/s"}

    k = Par("F/Q", nominal=1.0, doc="stiffness of the coupling")
    c = Par("F·s/Q", nominal=0.01, doc="damping of the coupling")
    J = Par("F·s²/Q", nominal=1e-3, positive=True, doc="inertia of the load")

    @classmethod
    def starts(cls, scale: Scale) -> list[dict[str, float]]:
        """Return light and heavy loads with resonances over the band of the record, all weakly damped."""
        import numpy as np

        resonances = np.geomspace(MIN_RESONANCE / scale.duration, MAX_RESONANCE / scale.step, RESONANCES).tolist()
        loads = [(w, ratio * scale.of("F·s²/Q")) for w in resonances for ratio in INERTIA_RATIOS]
        return [{"k": J * w * w, "c": 0.1 * J * w, "J": J} for w, J in loads]

    @classmethod
    def plausible(cls, p: Mapping[str, float]) -> bool:
        """Refuse a coupling on which nothing swings: without stiffness it is a damper, and damped beyond the
        critical value, c = 2 sqrt(k J), a lag, as an input that changed between its samples leaves it. Nor does
        anything swing on and on, as a force that vibrates by itself does.
        """
        critical = float(2.0 * (p["k"] * p["J"]) ** 0.5)
        return bool(p["k"] > 0.0 and MIN_DAMPING_RATIO * critical < p["c"] < OVERDAMPED * critical)

    @classmethod
    def of_interest(cls, p: Mapping[str, float], scale: Scale) -> dict[str, Bounds]:
        return {"k": soft(scale)}

    def coupling(self, m: Any, x: Any, p: Any) -> Any:
        """Return the torque through the coupling."""
        return p.k * (x.position - x.own.position) + p.c * (x.velocity - x.own.velocity)

    def force(self, m: Any, x: Any, p: Any) -> Any:
        return -self.coupling(m, x, p)

    def rates(self, m: Any, x: Any, p: Any) -> dict[str, Any]:
        return {"position": x.own.velocity, "velocity": self.coupling(m, x, p) / p.J}
