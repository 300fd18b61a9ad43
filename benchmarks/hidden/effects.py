"""Sizes of hidden effects, drawn relative to the motion and the force of the drive without them.

A force has between about 12 and 40 % of the root mean square of the driving force; input and sensor effects have a
comparable share of their signal. `weaken` turns an effect into a third of itself. The laws are in `laws`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from benchmarks.hidden.drives import CHANNELS, MOTOR, Drive, Scale, spread

Values = dict[str, float]


@dataclass(frozen=True)
class Setting:
    """What an effect is drawn for: T, dt in s."""

    rng: np.random.Generator
    drive: Drive
    scale: Scale
    T: float
    dt: float

    def share(self) -> float:
        """Return a share of the drive force."""
        return float(self.rng.uniform(0.12, 0.4))

    def force(self) -> float:
        """Return a share of the drive force, N or N·m."""
        return self.share() * self.scale.drive

    def sign(self) -> float:
        return float(self.rng.choice([-1.0, 1.0]))

    def phase(self) -> float:
        return float(self.rng.uniform(0, 2 * np.pi))

    def order(self, least: float = 1.5, most: float = 7.0) -> float:
        """Return waves per radian (a motor's: whole, at least 2): a few over the motion, and slower than a quarter of
        the sampling rate at the speed's root mean square; not a number where the motion is too fast for that.
        """
        limit = 2 * np.pi / self.dt / 4 / self.scale.speed
        lowest = 0.8 / self.scale.position
        if self.drive.plant == MOTOR:
            lowest, limit = max(2.0, np.ceil(lowest)), np.floor(min(limit, 14.0))
            return float(self.rng.integers(lowest, limit + 1)) if lowest <= limit else float("nan")
        N = self.rng.uniform(least, most) / (0.5 * self.scale.stroke)
        return float(max(min(N, limit), lowest)) if lowest <= limit else float("nan")


def _damping(s: Setting) -> float:
    c = s.drive.true.get("c", 0.0)
    return s.rng.uniform(0.8, 2.0) * c if c > 0 else s.force() / s.scale.speed


def _viscous(s: Setting) -> Values:
    return {"b": _damping(s)}


def _coulomb(s: Setting) -> Values:
    return {"mu": s.force()}


def _stribeck(s: Setting) -> Values:
    mu = 0.7 * s.force()
    return {"mu": mu, "excess": mu * s.rng.uniform(0.6, 1.5), "v_s": s.scale.speed * s.rng.uniform(0.06, 0.3)}


def _asymmetric(s: Setting) -> Values:
    large = 1.5 * _damping(s)
    small = large * s.rng.uniform(0.05, 0.4)
    return {"b_p": large, "b_n": small} if s.rng.random() < 0.5 else {"b_p": small, "b_n": large}


def _drag(s: Setting) -> Values:
    return {"c2": s.force() / s.scale.speed**2}


def _load_dependent(s: Setting) -> Values:
    external = s.drive.spring > 0
    return {"kappa_d": s.share(), "kappa_e": 0.5 * s.share() if external else 0.0}


def _constant(s: Setting) -> Values:
    return {"F0": s.sign() * s.force()}


def _gravity(s: Setting) -> Values:
    return {"A": 1.3 * s.force(), "q0": 0.0 if s.rng.random() < 0.7 else s.rng.uniform(-0.6, 0.6)}


def _cogging(s: Setting) -> Values:
    return {"A": 1.3 * s.force(), "N": s.order(), "phi": s.phase()}


def _stiffness(s: Setting) -> Values:
    k = s.drive.spring
    return {"k": s.rng.uniform(0.4, 0.9) * k if k > 0 else s.force() / s.scale.position}


def _cubic(s: Setting) -> Values:
    return {"k3": s.force() / s.scale.position**3}


def _stop(s: Setting) -> Values:
    gap = s.rng.uniform(0.3, 0.65) * s.scale.reach
    return {"gap": gap, "k_s": s.rng.uniform(2.0, 6.0) * s.scale.drive / (s.scale.reach - gap)}


def _dahl(s: Setting) -> Values:
    F_c = s.force()
    return {"F_c": F_c, "sigma": F_c / (spread(s.rng, 0.06, 0.6) * 0.5 * s.scale.stroke)}


def _lugre(s: Setting) -> Values:
    F_c = 0.8 * s.force()
    sigma0 = F_c / (spread(s.rng, 0.03, 0.3) * 0.5 * s.scale.stroke)
    return {
        "sigma0": sigma0,
        "sigma1": s.rng.uniform(0.1, 0.6) * float(np.sqrt(sigma0 * s.drive.inertia)),
        "sigma2": float(s.rng.choice([0.0, 0.3])) * F_c / s.scale.speed,
        "F_c": F_c,
        "F_s": F_c * s.rng.uniform(1.3, 2.0),
        "v_s": s.scale.speed * s.rng.uniform(0.06, 0.3),
    }


def _bouc_wen(s: Setting) -> Values:
    beta = s.rng.uniform(0.4, 0.8)
    shape = {"lambda": 1.0, "beta": beta, "gamma": (1 - beta) * s.rng.uniform(-0.3, 0.9)}
    shape["n"] = float(s.rng.choice([1.0, 2.0, 2.0, 3.0]))
    D = 0.5 * s.scale.stroke * spread(s.rng, 0.15, 0.7)
    if s.drive.spring > 0:
        return {"alpha": s.rng.uniform(0.2, 0.6), "D": D, **shape, "k": 0.0}
    alpha = s.rng.uniform(0.02, 0.15)
    return {"alpha": alpha, "D": D, **shape, "k": 1.3 * s.force() / ((1 - alpha) * D)}


def _coupling(s: Setting, low: float, high: float) -> Values:
    """Return a load of some of the drive's inertia, its own frequency low to high times the motion's."""
    J = s.rng.uniform(0.2, 0.7) * s.drive.inertia
    f = max(s.drive.omega / (2 * np.pi), 0.6)
    omega = 2 * np.pi * min(f * s.rng.uniform(low, high), 0.08 / s.dt)
    return {"k": J * omega**2, "c": 2 * s.rng.uniform(0.03, 0.1) * J * omega, "J": J}


def _compliant(s: Setting) -> Values:
    return _coupling(s, 1.5, 6.0)


def _backlash(s: Setting) -> Values:
    return {"gap": 0.5 * s.scale.stroke * spread(s.rng, 0.04, 0.4), **_coupling(s, 3.0, 8.0)}


def _dead(s: Setting) -> Values:
    return {"d": s.scale.input * s.rng.uniform(0.15, 0.4)}


def _saturation(s: Setting) -> Values:
    return {"u_max": s.scale.peak_input * s.rng.uniform(0.4, 0.75)}


def _delay(s: Setting) -> Values:
    longest = max(5.0 * s.dt, min(0.06, 0.2 / s.drive.omega))
    return {"T": s.rng.uniform(0.3 * longest + s.dt, longest)}


def _torque_saturation(s: Setting) -> Values:
    return {"kappa": s.rng.uniform(0.1, 0.4) / s.scale.current**2}


def _thermal(s: Setting) -> Values:
    heat = s.drive.true["R_a"] * s.scale.current**2
    R_th = s.rng.uniform(0.12, 0.4) / (0.0039 * heat)
    return {"a": 0.0039, "C": s.rng.uniform(0.12, 0.6) * s.T / R_th, "R_th": R_th}


def _channel(s: Setting, position: bool) -> str:
    names = [n for n in CHANNELS[s.drive.plant] if position or n not in ("position", "displacement")]
    return str(s.rng.choice(names))


def _offset(s: Setting) -> Values:
    name = _channel(s, position=False)
    size = s.scale.current if name == "current" else s.scale.speed
    return {name: s.sign() * s.share() * size}


def _gain(s: Setting) -> Values:
    return {_channel(s, position=True): 1.0 + s.sign() * s.rng.uniform(0.1, 0.25)}


def _sensor_delay(s: Setting) -> Values:
    return {_channel(s, position=True): s.rng.uniform(2.0, 6.0) * max(s.dt, 0.005)}


LISTED: dict[str, Callable[[Setting], Values]] = {
    "viscous_friction": _viscous,
    "coulomb_friction": _coulomb,
    "stribeck_friction": _stribeck,
    "asymmetric_viscous_friction": _asymmetric,
    "quadratic_drag": _drag,
    "load_dependent_friction": _load_dependent,
    "constant_load": _constant,
    "gravity_load": _gravity,
    "cogging_torque": _cogging,
    "linear_stiffness": _stiffness,
    "cubic_stiffness": _cubic,
    "hard_stop": _stop,
    "dahl_presliding": _dahl,
    "lugre_friction": _lugre,
    "bouc_wen_hysteresis": _bouc_wen,
    "compliant_load": _compliant,
    "backlash": _backlash,
    "input_deadzone": _dead,
    "input_saturation": _saturation,
    "input_delay": _delay,
    "torque_constant_saturation": _torque_saturation,
    "thermal_resistance": _thermal,
    "sensor_offset": _offset,
    "sensor_gain": _gain,
    "sensor_delay": _sensor_delay,
}


def _position_viscosity(s: Setting) -> Values:
    return {"b": 1.2 * _damping(s), "N": s.order(1.0, 4.0), "phi": s.phase()}


def _drifting(s: Setting) -> Values:
    return {"mu": s.force()}


def _root(s: Setting) -> Values:
    return {"c": s.force() / float(np.sqrt(s.scale.speed))}


def _parametric(s: Setting) -> Values:
    k = s.drive.spring
    size = s.rng.uniform(0.15, 0.4) * k if k > 0 else s.force() / s.scale.position
    return {"k": size, "w": s.rng.uniform(0.3, 0.8) * min(s.drive.omega, 12.0)}


def _product(s: Setting) -> Values:
    b = s.drive.true.get("c", 0.0)
    if s.drive.plant == MOTOR:
        b = s.drive.true["K_t"] ** 2 / s.drive.true["R_a"]
    return {"p": s.sign() * s.rng.uniform(0.5, 0.85) * b, "q": s.scale.position}


def _patterned(s: Setting) -> Values:
    return {"mu": s.force(), "a": s.rng.uniform(0.7, 0.98), "N": s.order(1.5, 5.0), "phi": s.phase()}


def _ripple(s: Setting) -> Values:
    return {"A": 1.3 * s.force(), "N": s.order()}


def _burst(s: Setting) -> Values:
    return {"F0": s.sign() * 1.5 * s.force()}


def _negative(s: Setting) -> Values:
    return {"b": _damping(s), "v0": s.scale.speed * s.rng.uniform(0.5, 0.9)}


def _inertia(s: Setting) -> Values:
    return {"a": s.rng.uniform(0.3, 0.6), "N": s.order(1.0, 4.0), "phi": s.phase()}


def _vibration(s: Setting) -> Values:
    return {"F0": 1.3 * s.force(), "w": s.rng.uniform(1.3, 3.0) * min(max(s.drive.omega, 4.0), 20.0)}


def _saturating(s: Setting) -> Values:
    return {"F": 1.3 * s.force(), "q": s.scale.position * s.rng.uniform(0.2, 0.6)}


def _detent(s: Setting) -> Values:
    return {"F": 1.3 * s.sign() * s.force(), "q": s.scale.position * s.rng.uniform(0.2, 0.6)}


def _steps(s: Setting) -> Values:
    return {"step": s.scale.peak_input * s.rng.uniform(0.3, 0.6)}


def _play(s: Setting) -> Values:
    return {"half": s.scale.peak_input * s.rng.uniform(0.15, 0.3)}


OUTSIDE: dict[str, Callable[[Setting], Values]] = {
    "position_viscosity": _position_viscosity,
    "drifting_coulomb": _drifting,
    "root_friction": _root,
    "parametric_stiffness": _parametric,
    "position_velocity_product": _product,
    "patterned_coulomb": _patterned,
    "wandering_ripple": _ripple,
    "burst_load": _burst,
    "negative_resistance": _negative,
    "varying_inertia": _inertia,
    "vibration": _vibration,
    "input_steps": _steps,
    "input_play": _play,
}
"""Not in the catalogue: the right answer is "unexplained"."""
SPRINGS: dict[str, Callable[[Setting], Values]] = {"saturating_spring": _saturating, "detent": _detent}
"""Forces over the position that the catalogue has not: the same."""


def _place(s: Setting) -> str:
    return "position" if s.drive.plant == MOTOR else "displacement"


def _moving(s: Setting, factor: float) -> Values:
    """Return a share of a sensor's signal, of the position or the speed."""
    if s.rng.random() < 0.5:
        return {_place(s): factor * s.scale.position}
    return {"speed" if s.drive.plant == MOTOR else "velocity": factor * s.scale.speed}


def _slew(s: Setting) -> Values:
    return {"most": s.scale.peak_input * s.dt * s.rng.uniform(2.0, 6.0)}


def _square(s: Setting) -> Values:
    return {"top": s.scale.peak_input}


def _one_sided(s: Setting) -> Values:
    return {"gain": s.rng.uniform(0.5, 0.8)}


def _drifting_gain(s: Setting) -> Values:
    return {"by": s.rng.uniform(0.15, 0.35)}


def _eccentric(s: Setting) -> Values:
    return {_place(s): 0.5 * s.share() * s.scale.position}


def _clip(s: Setting) -> Values:
    return _moving(s, s.rng.uniform(0.9, 1.4))


def _counts(s: Setting) -> Values:
    return {_place(s): 0.3 * s.share() * s.scale.position}


def _even_drag(s: Setting) -> Values:
    return {"c2": s.sign() * s.force() / s.scale.speed**2}


def _at_random(s: Setting) -> Values:
    return {"F0": s.force()}


SIGNALS: dict[str, Callable[[Setting], Values]] = {
    "input_slew": _slew,
    "input_square": _square,
    "asymmetric_gain": _one_sided,
    "drifting_gain": _drifting_gain,
    "sensor_eccentricity": _eccentric,
    "sensor_clip": _clip,
    "missed_counts": _counts,
    "even_drag": _even_drag,
    "step_load": _burst,
    "random_load": _at_random,
}
"""What amplifiers, sensors and loads do that no listed effect does: the same."""
UNLISTED = {"outside": OUTSIDE, "springs": SPRINGS, "signals": SIGNALS}
"""Laws outside the catalogue, by group."""


def _tanh(s: Setting) -> Values:
    return {"mu": s.force(), "v0": s.scale.speed * s.rng.uniform(0.02, 0.08)}


def _power(s: Setting) -> Values:
    n = float(s.rng.choice([1.7, 2.4]))
    return {"c": s.force() / s.scale.speed**n, "n": n}


def _harmonic(s: Setting) -> Values:
    return {**_cogging(s), "second": s.rng.uniform(0.15, 0.35)}


def _quintic(s: Setting) -> Values:
    return {"k5": 0.6 * s.force() / s.scale.position**5}


def _damped_stop(s: Setting) -> Values:
    stop = _stop(s)
    damping = 2 * s.rng.uniform(0.05, 0.2) * float(np.sqrt(stop["k_s"] * s.drive.inertia))
    return {**stop, "c_s": damping}


def _curved_dahl(s: Setting) -> Values:
    return {**_dahl(s), "n": s.rng.uniform(0.6, 1.6)}


def _sharp_bouc_wen(s: Setting) -> Values:
    return {**_bouc_wen(s), "n": 1.5}


def _lag(s: Setting) -> Values:
    return _delay(s)


def _linear_saturation(s: Setting) -> Values:
    return {"kappa": s.rng.uniform(0.15, 0.4) / s.scale.current}


SIMILAR: dict[str, tuple[str, str, Callable[[Setting], Values]]] = {
    "tanh_friction": ("coulomb_friction", "tanh_friction", _tanh),
    "hyperbolic_stribeck": ("stribeck_friction", "hyperbolic_stribeck", _stribeck),
    "power_drag": ("quadratic_drag", "power_drag", _power),
    "harmonic_cogging": ("cogging_torque", "harmonic_cogging", _harmonic),
    "quintic_stiffness": ("cubic_stiffness", "quintic_stiffness", _quintic),
    "damped_stop": ("hard_stop", "damped_stop", _damped_stop),
    "curved_dahl": ("dahl_presliding", "curved_dahl", _curved_dahl),
    "bouc_wen_n_1.5": ("bouc_wen_hysteresis", "bouc_wen_hysteresis", _sharp_bouc_wen),
    "arctan_saturation": ("input_saturation", "arctan_saturation", _saturation),
    "input_lag": ("input_delay", "input_lag", _lag),
    "linear_current_saturation": ("torque_constant_saturation", "linear_current_saturation", _linear_saturation),
}
"""Equations only similar to the catalogue's: the effect that comes nearest, the law's name, its size."""

MOTOR_ONLY = ("torque_constant_saturation", "thermal_resistance", "linear_current_saturation")
MASS_ONLY = ("maxwell_element",)

PAIRS = (
    ("coulomb_friction", "quadratic_drag"),
    ("coulomb_friction", "cogging_torque"),
    ("coulomb_friction", "constant_load"),
    ("coulomb_friction", "linear_stiffness"),
    ("coulomb_friction", "gravity_load"),
    ("coulomb_friction", "viscous_friction"),
    ("coulomb_friction", "cubic_stiffness"),
    ("coulomb_friction", "hard_stop"),
    ("coulomb_friction", "input_delay"),
    ("coulomb_friction", "compliant_load"),
    ("coulomb_friction", "sensor_offset"),
    ("coulomb_friction", "input_saturation"),
    ("stribeck_friction", "constant_load"),
    ("stribeck_friction", "gravity_load"),
    ("load_dependent_friction", "gravity_load"),
    ("quadratic_drag", "constant_load"),
    ("cogging_torque", "constant_load"),
    ("viscous_friction", "gravity_load"),
    ("coulomb_friction", "torque_constant_saturation"),
    ("coulomb_friction", "thermal_resistance"),
)

AMPLITUDES: dict[str, tuple[str, ...]] = {
    "viscous_friction": ("b",),
    "coulomb_friction": ("mu",),
    "stribeck_friction": ("mu", "excess"),
    "asymmetric_viscous_friction": ("b_p", "b_n"),
    "quadratic_drag": ("c2",),
    "load_dependent_friction": ("kappa_d", "kappa_e"),
    "constant_load": ("F0",),
    "gravity_load": ("A",),
    "cogging_torque": ("A",),
    "linear_stiffness": ("k",),
    "cubic_stiffness": ("k3",),
    "hard_stop": ("k_s",),
    "dahl_presliding": ("F_c", "sigma"),
    "lugre_friction": ("sigma0", "sigma1", "sigma2", "F_c", "F_s"),
    "compliant_load": ("k", "c", "J"),
    "backlash": ("k", "c", "J"),
    "input_deadzone": ("d",),
    "input_delay": ("T",),
    "torque_constant_saturation": ("kappa",),
    "thermal_resistance": ("R_th",),
}
"""What is a third where the effect is a third; the others need a word more, in `weaken`."""


def weaken(effect: str, values: Values, factor: float, u: np.ndarray) -> Values:
    """Return a factor of an effect: the force, the part of the input that is lost, the error of the sensor."""
    new = {n: v * factor if n in AMPLITUDES.get(effect, ()) else v for n, v in values.items()}
    if effect == "thermal_resistance":
        new["C"] = values["C"] / factor  # the same time constant
    elif effect == "bouc_wen_hysteresis" and values["k"] > 0:
        new["k"] = values["k"] * factor
    elif effect == "bouc_wen_hysteresis":
        new["alpha"] = 1.0 - factor * (1.0 - values["alpha"])
    elif effect == "sensor_gain":
        new = {n: 1.0 + factor * (v - 1.0) for n, v in values.items()}
    elif effect in ("sensor_offset", "sensor_delay"):
        new = {n: factor * v for n, v in values.items()}
    elif effect == "input_saturation":
        levels = np.linspace(values["u_max"], np.abs(u).max(), 400)
        lost = np.array([np.sqrt(np.mean(np.maximum(np.abs(u) - level, 0) ** 2)) for level in levels])
        new["u_max"] = float(levels[np.argmin(np.abs(lost - factor * lost[0]))])
    return new


def applies(effect: str, plant: str) -> bool:
    """Tell whether a plant can have an effect."""
    return effect not in (MASS_ONLY if plant == MOTOR else MOTOR_ONLY)
