"""A torque constant that falls with current, as the iron saturates."""

from __future__ import annotations

from typing import Any

from signlin_ros.effects.base import Effect
from signlin_ros.par import Par


class TorqueConstantSaturation(Effect):
    """A torque constant that falls with current, as the iron saturates.

    K_t -> K_t / (1 + kappa i^2); the back-EMF constant K_m is unchanged.
    [Krause et al., Analysis of Electric Machinery, 2013]
    """

    name = "torque_constant_saturation"
    equation = "K_t -> K_t / (1 + kappa i^2)"
    finding = "the torque per ampere falls as the current grows: kappa is {kappa:.3g} {kappa.unit}"
    experiment = "load the motor up to its highest current"
    command = "steps with rests"
    plants = ("dc_motor",)

    kappa = Par("1/A²", nominal=0.01, doc="loss of torque per squared current")
    start = ({"kappa": 0.05},)

    def torque_constant(self, m: Any, x: Any, p: Any, K_t: Any) -> Any:
        return K_t / (1 + p.kappa * x.current**2)
