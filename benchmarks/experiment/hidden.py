"""What the machines of a tie have beside: effects that no plan knows of, some of which no diagnosis proposes either."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from benchmarks.experiment.ties import Tie
from signlin_ros.effects import register
from signlin_ros.effects.base import Effect
from signlin_ros.par import Par


@register
class UnevenFriction(Effect):
    """Dry friction that changes over a turn: a shaft that is bent, a gear that runs eccentrically.

    F = -mu_1 sin(q) sign(v)
    """

    name = "uneven_friction"
    equation = "-mu_1 sin(q) sign(v)"
    finding = "the dry friction changes by {mu_1:.3g} {mu_1.unit} over a turn"
    experiment = "move slowly over a full turn, both ways"
    angular = True
    proposed = False

    mu_1 = Par("F", nominal=0.01, low=-1e9, doc="amplitude of the change")

    def force(self, m: Any, x: Any, p: Any) -> Any:
        return -p.mu_1 * m.sin(x.position) * m.sign(x.velocity)


RIPPLE = 0.007
"""Amplitude of each wave in N·m: together nearly half of the friction."""
HIDDEN: dict[str, dict[str, dict[str, Any]]] = {
    "ripple": {"torque_ripple": {"orders": [7.0, 11.0], "A": [RIPPLE, RIPPLE], "phi": [0.3, 1.1]}},
    "uneven": {"uneven_friction": {"mu_1": 0.01}},
    "cogging": {"cogging_torque": {"A": 0.008, "N": 9.0, "phi": 0.7}},
    "asymmetric": {"asymmetric_viscous_friction": {"b_p": 0.0, "b_n": 3e-4}},
}
"""Effects by kind. Nothing proposes the first two; the others are in the catalogue, and no rival of a plan."""
UNLISTED = ("torque_ripple", "uneven_friction")


def hiding(tie: Tie, kind: str) -> Tie:
    """Return a tie of machines that have a kind of effects beside; the same for none."""
    effects = HIDDEN.get(kind, {})
    listed = tuple(n for n in effects if n not in UNLISTED)
    first, second = (replace(m, effects={**m.effects, **effects}, listed=listed) for m in tie.machines)
    return replace(tie, machines=(first, second))


__all__ = ["HIDDEN", "hiding"]
