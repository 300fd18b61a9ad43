"""Friction that grows with a power of velocity, below one: ever more slowly, without an end."""

from __future__ import annotations

from typing import Any

from signlin_ros.effects.base import Effect
from signlin_ros.par import Par


class PowerLawFriction(Effect):
    """Friction that grows with a power of velocity, below one: ever more slowly, without an end.

    F = -c |v|^a sign(v): what strain-wave and cycloidal gears show beside Coulomb friction, where viscous friction
    grows more slowly than velocity; linear for a = 1.   [Olsson, Åström, Canudas de Wit, Gäfvert and Lischinsky,
    European J. Control 4(3), 1998, sec. 2: F_v |v|^delta sgn(v)]
    """

    name = "power_law_friction"
    equation = "-c |v|^a sign(v)"
    finding = "the residual {F} grows more slowly than the {V}: {c:.3g} times its power {a:.3g}"
    experiment = "move at several constant speeds, from a crawl to the highest"
    family = "viscous friction"
    dissipative = True
    proposed = False
    """A drive's record tells it from Stribeck and cubic viscous friction only where speeds span decades."""

    c = Par("F", nominal=1e-3, doc="friction at a velocity of one")
    a = Par("-", nominal=0.6, low=0.1, high=1.0, structural=True, doc="power of the velocity")
    start = ({"c": 0.05, "a": 0.6},)

    def force(self, m: Any, x: Any, p: Any) -> Any:
        return -p.c * m.abs_power(x.velocity, p.a) * m.sign(x.velocity)
