"""Torque that repeats with the turn, several harmonics together."""

from __future__ import annotations

from typing import Any

from signlin_ros.effects.base import Effect
from signlin_ros.par import Par


class TorqueRipple(Effect):
    """Torque that repeats with the turn, several harmonics together.

    F = -sum_i A_i sin(N_i q + phi_i), the N_i = orders whole numbers where the axis turns.
    [Holtz and Springob, IEEE Trans. Industrial Electronics 43(2), 1996]
    """

    name = "torque_ripple"
    equation = "-sum_i A_i sin(N_i q + phi_i), N = orders"
    finding = "the residual {F} repeats with the {Q}: {A[0]:.3g} {A[0].unit} high at order {orders[0]:.4g}, and others"
    experiment = "move slowly over a full turn at constant input"
    command = "creep to and fro"
    angular = True
    family = "waves"
    proposed = False  # it is found wave by wave, from a single one on
    several = ("orders", "A", "phi")
    telling = ("A",)

    orders = Par("1/Q", nominal=1.0, low=0, high=1e5, positive=True, elements=(1.0, 2.0), doc="periods per 2 pi of q")
    A = Par("F", nominal=0.01, low=-1e9, elements=(0.02, 0.01), along="orders", doc="amplitude of each")
    phi = Par(
        "rad", nominal=0.0, low=-1e4, high=1e4, elements=(0.3, 0.8), along="orders", default=0.0, doc="phase at q = 0"
    )
    whole_orders = ("orders",)

    def force(self, m: Any, x: Any, p: Any) -> Any:
        waves = zip(p.orders, p.A, p.phi, strict=True)
        return -sum(A * m.sin(order * x.position + phi) for order, A, phi in waves)
