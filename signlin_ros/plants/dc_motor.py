"""A permanent-magnet DC motor."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from signlin_ros.par import Par
from signlin_ros.plants.base import Acting, Plant


def quasi_static_current(voltage: Any, speed: Any, K_m: Any, resistance: Any) -> Any:
    """Return the current in A of a motor without inductance, V = R i + K_m w; numbers, arrays or symbols."""
    return (voltage - K_m * speed) / resistance


class DcMotor(Plant):
    """A permanent-magnet DC motor.

    L_a i' = V - R_a i - K_m w,  J w' = K_t i - B w - T_L + effects,  q' = w.   [paper eq. (28)]
    With L_a = 0 the current follows the voltage at once, i = (V - K_m w) / R_a, and is an output instead of a state
    [singular perturbation: Khalil, Nonlinear Systems, 3rd ed., example 11.1].
    """

    name = "dc_motor"
    equation = "L_a i' = V - R_a i - K_m w,  J w' = K_t i - B w - T_L + effects,  q' = w"
    force_unit, position_unit, input_unit = "N·m", "rad", "V"
    position, velocity, effort = "position", "speed", ""
    position_optional = True
    zero_matters = ("L_a",)
    sometimes = {"current": "with L_a = 0 the current follows the voltage at once and is no state"}
    inputs = {"voltage": "V"}
    inertia_parameter = "J"
    scaled_by_effort = ("R_a", "L_a", "K_m")
    optional_inputs = {"load_torque": "N·m"}

    R_a = Par("Ohm", nominal=0.764, positive=True, doc="armature resistance")
    L_a = Par("H", nominal=0.0026, doc="armature inductance; 0: the current follows the voltage at once")
    K_t = Par("N·m/A", nominal=0.0805, positive=True, doc="torque constant")
    K_m = Par("V·s/rad", nominal=0.0805, doc="back-EMF constant")
    B = Par("N·m·s/rad", nominal=0.0, doc="viscous friction")
    J = Par("kg·m²", nominal=0.0022, positive=True, doc="inertia of rotor and load")

    @classmethod
    def states(cls, values: Mapping[str, float]) -> dict[str, str]:
        """Return current (where there is an inductance) and speed."""
        current = {} if values["L_a"] == 0.0 else {"current": "A"}
        return {**current, "speed": "rad/s"}

    @classmethod
    def algebraic(cls, values: Mapping[str, float]) -> dict[str, str]:
        """Return the current where there is no inductance."""
        return {"current": "A"} if values["L_a"] == 0.0 else {}

    @classmethod
    def settling_times(cls, values: Mapping[str, float]) -> dict[str, float]:
        """Return the time constant of the winding, L_a / R_a."""
        return {"L_a": values["L_a"] / values["R_a"]}

    def rates(self, m: Any, x: Any, u: Any, p: Any, act: Acting) -> dict[str, Any]:
        """Paper eq. (28)."""
        resistance = x.resistance = act.resistance(p.R_a)
        quasi_static = not hasattr(x, "current")
        if quasi_static:
            x.current = quasi_static_current(u.voltage, x.velocity, p.K_m, resistance)
        torque = act.torque_constant(p.K_t) * x.current
        load = getattr(u, "load_torque", 0)
        rate = (torque - p.B * x.velocity - load + act.force(torque, 0)) / p.J
        drop = u.voltage - resistance * x.current - p.K_m * x.velocity
        return {"speed": rate, "current": x.current if quasi_static else drop / p.L_a}
