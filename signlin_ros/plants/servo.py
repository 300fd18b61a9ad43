"""A position-controlled servo: its firmware's loop, its motor and its load."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

from signlin_ros.par import Par
from signlin_ros.plants.base import Acting, Plant

GRAVITY = 9.80665
"""Standard gravity in m/s²."""


class Servo(Plant):
    """A position-controlled servo: its firmware's loop, its motor and its load.

    e = goal - q,  duty = clip(duty_per_error (kp e + ki int e + kd e'), ±duty_limit),
    i = (duty V - K_t w) / R, 0 where the torque is switched off,
    (J + inertia + (mass + arm_mass/3) length²) w' = K_t i - (mass + arm_mass/2) g length sin(q - q0) + effects,
    q' = w.  The motor has no inductance; all is on the side of the joint.
    [Duclusaud et al., ICRA 2025, arXiv:2410.08650]
    """

    name = "servo"
    equation = (
        "duty = clip(duty_per_error (kp e + ki int e + kd e'), ±duty_limit), e = goal - q,  i = (duty V - K_t w) / R,"
        "  (J + inertia + (mass + arm_mass/3) length²) w' = K_t i - (mass + arm_mass/2) g length sin(q - q0) + effects,"
        "  q' = w"
    )
    force_unit, position_unit, input_unit = "N·m", "rad", "rad"
    position, velocity, effort = "position", "speed", ""
    inputs: ClassVar[dict[str, str]] = {"goal_position": "rad"}
    optional_inputs: ClassVar[dict[str, str]] = {"torque_enable": "-", "supply": "V", "goal_velocity": "rad/s"}
    zero_matters = ("ki", "kd", "sag", "current_limit", "profile_time")
    sometimes: ClassVar[dict[str, str]] = {
        "integral": "with ki = 0 the firmware's loop has no integrator",
        "goal": "with profile_time = 0 the loop follows the goal position at once",
    }
    closed_loop = True
    beside = ("load",)
    benches: ClassVar[tuple[str, ...]] = ("kp", "mass", "length", "vin")
    scaled_by_effort = ("J", "inertia")

    K_t = Par("N·m/A", nominal=0.35, positive=True, doc="torque constant, and back-EMF constant in V·s/rad")
    R = Par("Ohm", nominal=3.5, positive=True, doc="resistance of the winding")
    J = Par("kg·m²", nominal=0.002, positive=True, doc="inertia of rotor and gear, at the joint")
    mass = Par("kg", nominal=0.5, default=0.0, doc="point mass on the arm; 0: no weight")
    length = Par("m", nominal=0.1, default=0.1, doc="length of the arm")
    arm_mass = Par("kg", nominal=0.0, default=0.0, doc="mass of the arm, an even rod")
    inertia = Par("kg·m²", nominal=0.0, default=0.0, doc="further inertia at the joint")
    q0 = Par("rad", nominal=0.0, low=-1e3, high=1e3, default=0.0, doc="position at which the arm hangs down")
    kp = Par("-", nominal=400.0, doc="proportional gain, in the firmware's units")
    ki = Par("1/s", nominal=0.0, default=0.0, doc="integral gain, in the firmware's units per s; 0: none")
    kd = Par("s", nominal=0.0, default=0.0, doc="derivative gain, in the firmware's units times s; 0: none")
    duty_per_error = Par("1/rad", nominal=0.00288, positive=True, doc="duty for a radian of error and a gain of 1")
    vin = Par("V", nominal=7.4, positive=True, doc="supply voltage, where no supply is recorded")
    sag = Par("Ohm", nominal=0.0, default=0.0, doc="resistance of the supply and its leads; 0: stiff")
    duty_limit = Par("-", nominal=1.0, high=1.0, default=1.0, positive=True, doc="largest duty")
    current_limit = Par("A", nominal=0.0, default=0.0, doc="largest current; 0: none")
    profile_time = Par("s", nominal=0.0, default=0.0, doc="time constant of the filter of the goal; 0: none")

    @classmethod
    def states(cls, values: Mapping[str, float]) -> dict[str, str]:
        """Return position and speed, and what the loop holds: the integral of the error, the filtered goal."""
        integral = {} if values["ki"] == 0.0 else {"integral": "rad·s"}
        return {"position": "rad", "speed": "rad/s", **integral} | (
            {} if values["profile_time"] == 0.0 else {"goal": "rad"}
        )

    @classmethod
    def unrecorded(cls, values: Mapping[str, float]) -> dict[str, float]:
        """Return default values of optional inputs: torque on, the supply of the model in V."""
        return {"torque_enable": 1.0, "supply": values["vin"], "goal_velocity": 0.0}

    @classmethod
    def free_speed(cls, values: Mapping[str, float]) -> float | None:
        """Return the speed in rad/s at which the back-EMF is what the loop puts out at most."""
        return float(values["duty_limit"] * values["vin"] / values["K_t"])

    @classmethod
    def moved(cls, values: Mapping[str, float]) -> float:
        """Return the inertia of rotor, gear and load in kg·m²."""
        load = (values["mass"] + values["arm_mass"] / 3) * values["length"] ** 2
        return float(values["J"] + values["inertia"] + load)

    @classmethod
    def driven(cls, m: Any, values: Mapping[str, float], q: Any, acceleration: Any) -> Any:
        """Return the torque in N·m (T,) that a motion q (T,) takes without friction."""
        weight = (values["mass"] + values["arm_mass"] / 2) * GRAVITY * values["length"]
        return cls.moved(values) * acceleration + weight * m.sin(q - values["q0"])

    def rates(self, m: Any, x: Any, u: Any, p: Any, act: Acting) -> dict[str, Any]:
        """Newton's second law of the joint under the duty that the firmware asks for."""
        rates = {"position": x.velocity}
        goal = u.goal_position
        if not _zero(p.profile_time):
            rates["goal"], goal = (goal - x.goal) / p.profile_time, x.goal
        duty = self._duty(m, x, u, p, act.input(goal - x.position), rates)
        x.duty = m.clip(duty, p.duty_limit)
        x.resistance = act.resistance(p.R) + (0 if _zero(p.sag) else p.sag * x.duty**2)
        x.current = (x.duty * getattr(u, "supply", p.vin) - p.K_t * x.velocity) / x.resistance
        if not _zero(p.current_limit):
            x.current = m.clip(x.current, p.current_limit)
        x.current = getattr(u, "torque_enable", 1) * x.current
        torque = act.torque_constant(p.K_t) * x.current
        weight = (p.mass + p.arm_mass / 2) * GRAVITY * p.length * m.sin(x.position - p.q0)
        moved = p.J + p.inertia + (p.mass + p.arm_mass / 3) * p.length**2
        rates["speed"] = (torque - weight + act.force(torque, -weight)) / moved
        return rates

    @staticmethod
    def _duty(m: Any, x: Any, u: Any, p: Any, error: Any, rates: dict[str, Any]) -> Any:
        """Return the duty before its limit; the rate of the integral goes into ``rates``."""
        asked = p.kp * error
        if not _zero(p.ki):
            asked, rates["integral"] = asked + p.ki * x.integral, error
        if not _zero(p.kd):
            asked += p.kd * (getattr(u, "goal_velocity", 0) - x.velocity)
        return p.duty_per_error * asked


def _zero(value: Any) -> bool:
    """Tell whether a parameter is exactly 0, so that what it stands for is no part of the equations."""
    return isinstance(value, float) and value == 0.0
