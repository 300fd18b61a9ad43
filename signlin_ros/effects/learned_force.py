"""A force that was learned from records: a curve over one coordinate, or a surface over two."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

from signlin_ros.effects.base import COORDINATE_UNIT, Effect
from signlin_ros.par import Par

LEARNED_OVER = ("speed", "position", "load", "speed, position", "speed, load", "position, load")
"""What a force may be learned over; the load is the driving force."""


def learned_curve(m: Any, at: Sequence[Any], knots: Sequence[Sequence[float]], values: Sequence[Any]) -> Any:
    """Return f at one coordinate or two.

    ``knots`` are those of each coordinate, ``values`` f at all of them; of two, the second coordinate's knots follow
    each other fastest. Beyond the outermost knots it goes on in a straight line.
    """
    if len(at) == 1:
        return m.spline(at[0], knots[0], values)
    count = len(knots[1])
    rows = [m.spline(at[1], knots[1], values[i : i + count]) for i in range(0, len(values), count)]
    return m.spline(at[0], knots[0], rows)


class LearnedForce(Effect):
    """A force that was learned from records: a curve over one coordinate, or a surface over two.

    F = -f(over) - jump sign(v), f the curve through ``values`` at ``knots`` (and ``knots_2``): smooth, rising and
    falling only where the values do, and straight on beyond the last knots, where no record has been.
    [Fritsch and Butland 1984, doi:10.1137/0905021]
    """

    name = "learned_force"
    equation = "-f(over) - jump sign(v), f a curve through values at knots (knots_2)"
    finding = "the residual {F} follows a curve of no listed shape"
    experiment = "visit all of the coordinate, in both directions"
    proposed = False  # a curve fits nearly anything: who wants one asks for it

    over = Par("-", nominal=0.0, words=LEARNED_OVER, structural=True, doc="coordinate, or two of them")
    knots = Par(
        *(COORDINATE_UNIT, 0.0, -1e9, 1e9), elements=(-1.0, 0.0, 1.0), structural=True, doc="where f is given, rising"
    )
    knots_2 = Par(
        *(COORDINATE_UNIT, 0.0, -1e9, 1e9), elements=(), structural=True, doc="the same over a second coordinate"
    )
    values = Par("F", nominal=0.0, low=-1e9, elements=(-0.02, 0.0, 0.02), doc="f at the knots, row by row of knots_2")
    jump = Par("F", nominal=0.0, default=0.0, doc="dry friction besides, where it is over the speed")

    @classmethod
    def fault(cls, p: Any) -> str:
        given = {"knots": p.knots, "knots_2": p.knots_2}
        for name, knots in list(given.items())[: 2 if "," in p.over else 1]:
            if len(knots) < 2 or any(high <= low for low, high in pairwise(knots)):
                return f"{name}: found {list(knots)}; allowed: two numbers or more, each larger than the one before"
        if p.knots_2 and "," not in p.over:
            return f"knots_2: found {list(p.knots_2)}; allowed: none, as the force is over the {p.over} alone"
        count = len(p.knots) * (len(p.knots_2) or 1)
        if len(p.values) != count:
            return f"values: found {len(p.values)} numbers; allowed: {count}, one for each knot"
        if p.jump and "speed" not in p.over:
            return f"jump: found {p.jump:g}; allowed: 0, as the force is not over the speed"
        return ""

    def force(self, m: Any, x: Any, p: Any) -> Any:
        asked = {"speed": "velocity", "position": "position", "load": "drive_force"}
        at = [getattr(x, asked[word]) for word in p.over.split(", ")]
        learned = learned_curve(m, at, (p.knots, p.knots_2), p.values)
        return -learned - p.jump * m.sign(x.velocity) if "speed" in p.over else -learned
