"""A spring that is stiffer one way than the other."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from signlin_ros.effects.base import Effect
from signlin_ros.par import Par


class AsymmetricStiffness(Effect):
    """A spring that is stiffer one way than the other, as one that hardens about another place than zero.

    F = -k2 q^2 - k3 q^3: beside a spring k q the oscillator of Helmholtz and Duffing.
    [Kovacic and Brennan, The Duffing Equation, 2011, ch. 8, doi:10.1002/9780470977859]
    """

    name = "asymmetric_stiffness"
    equation = "-k2 q^2 - k3 q^3"
    finding = (
        "the residual {F} is that of a spring which hardens one way more than the other: {k2:.3g} {k2.unit} by the"
        " square of the {Q}, {k3:.3g} {k3.unit} by its cube"
    )
    experiment = "move further out to both sides"
    command = "staircase"
    external = True
    family = "nonlinear stiffness"
    contains = ("linear_stiffness", "cubic_stiffness")
    telling = ("k2",)
    essential = ("k2",)

    k2 = Par("F/Q²", nominal=0.1, low=-1e24, high=1e24, doc="quadratic stiffness; positive is stiffer forward")
    k3 = Par("F/Q³", nominal=0.1, low=-1e24, high=1e24, doc="cubic stiffness; positive hardens")
    start = ({"k2": 0.02, "k3": 0.05},)

    @classmethod
    def simpler(cls, p: Mapping[str, float]) -> dict[str, dict[str, float]]:
        return {"cubic_stiffness": {"k3": p["k3"]}} if p["k2"] == 0.0 else {}

    @classmethod
    def is_met(cls, p: Mapping[str, float], low: float, high: float) -> bool:
        """Far from position zero it is a spring and a load: the way must be half as long as the farthest position."""
        return high - low >= 0.5 * max(abs(low), abs(high))

    def force(self, m: Any, x: Any, p: Any) -> Any:
        return -p.k2 * x.position**2 - p.k3 * x.position**3
