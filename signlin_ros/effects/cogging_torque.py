"""Torque of a permanent-magnet motor that repeats N times a turn."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from signlin_ros.effects.base import Effect
from signlin_ros.par import Par


class CoggingTorque(Effect):
    """Torque of a permanent-magnet motor that repeats N times a turn.

    F = -A sin(N q + phi).   [Hanselman, Brushless Permanent Magnet Motor Design, 2003]
    """

    name = "cogging_torque"
    equation = "-A sin(N q + phi)"
    finding = "the residual {F} repeats with the {Q}: {A:.3g} {A.unit} high, of order {N:.4g}"
    angular = True
    family = "waves"
    experiment = "move slowly over a full turn at constant input"
    command = "creep to and fro"

    turning = ("A", "phi")

    A = Par("F", nominal=0.02, low=-1e9, doc="amplitude")
    N = Par("1/Q", nominal=7.0, low=0, high=1e5, doc="periods per 2 pi of position")
    phi = Par("rad", nominal=0.0, low=-1e4, high=1e4, doc="phase at q = 0")

    start = ({"A": 0.05, "phi": 0.0},)
    periodic = ("N", "A", "phi")

    @classmethod
    def simpler(cls, p: Mapping[str, float]) -> dict[str, dict[str, float]]:
        return {"gravity_load": {"A": p["A"], "q0": -p["phi"]}} if abs(p["N"] - 1.0) < 0.02 else {}

    def force(self, m: Any, x: Any, p: Any) -> Any:
        return -p.A * m.sin(p.N * x.position + p.phi)
