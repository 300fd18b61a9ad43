"""Which of MJCF's own laws holds which plant and which effect of ours, with its numbers."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

from signlin_ros.export.mjcf_parts import LostError, MjcfParts
from signlin_ros.model import Model

Values = Mapping[str, float]
BRISTLE_STIFFNESS = 300.0
"""Bristles that stand for a sign are so stiff that they give by this part of the travel (RMS) before they slip."""


def _list(p: Values, name: str) -> list[float]:
    return [value for key, value in p.items() if key.startswith(f"{name}[")]


def viscous(parts: MjcfParts, p: Values, key: str) -> str:
    """Return the element damping for a law."""
    parts.damping[0] += p["b"]
    return "damping"


def coulomb(parts: MjcfParts, p: Values, key: str) -> str:
    """Return the element frictionloss for a law."""
    parts.frictionloss += p["mu"]
    return "frictionloss (a soft constraint: a stuck joint creeps a little)"


def stribeck(parts: MjcfParts, p: Values, key: str) -> str:
    """Return the MJCF elements of a law: stiff bristles: presliding over a small part of the travel stands for the
    sign.
    """
    top = p["mu"] + max(p["excess"], 0.0)
    stiffness = parts.bristle * BRISTLE_STIFFNESS * top / parts.travel
    damping = 0.2 * math.sqrt(stiffness * parts.inertia)
    parts.bristle_is_free = True
    parts.bristles(key, (stiffness, damping, p["mu"], p["mu"] + p["excess"], p["v_s"]))
    return f"lugre, with bristles of {stiffness:.3g} in place of the sign"


def lugre(parts: MjcfParts, p: Values, key: str) -> str:
    """Return the element lugre for a law; its viscous part is damping."""
    parts.bristles(key, (p["sigma0"], p["sigma1"], p["F_c"], p["F_s"], p["v_s"]))
    parts.damping[0] += p["sigma2"]
    return "lugre, sigma2 as damping"


def dahl(parts: MjcfParts, p: Values, key: str) -> str:
    """Return the element lugre without a Stribeck curve for a law."""
    parts.bristles(key, (p["sigma"], 0.0, p["F_c"], p["F_c"], 1.0))
    return "lugre with one level and no damping"


def cogging(parts: MjcfParts, p: Values, key: str) -> str:
    """Return the element cogging for a law: whole orders."""
    if abs(p["N"] - round(p["N"])) > 1e-9:
        raise LostError(f"its order {p['N']:g} is no whole number, as MuJoCo's poles must be")
    parts.wave(key, p["A"], round(p["N"]), p["phi"] + math.pi)
    return "cogging"


def ripple(parts: MjcfParts, p: Values, key: str) -> str:
    """Return the MJCF elements of a law: a motor without inputs for each wave."""
    orders, sizes, phases = _list(p, "orders"), _list(p, "A"), _list(p, "phi")
    if any(abs(N - round(N)) > 1e-9 for N in orders):
        raise LostError("an order is no whole number, as MuJoCo's poles must be")
    for i, (N, A, phi) in enumerate(zip(orders, sizes, phases, strict=True)):
        parts.wave(f"{key}_{i}", A, round(N), phi + math.pi)
    return "cogging, a motor without inputs for each further wave"


def gravity(parts: MjcfParts, p: Values, key: str) -> str:
    """Return the MJCF elements of a law: a wave of order 1, wherever the joint is in a robot."""
    parts.passively(key, cogging=f"{p['A']!r} 1 {math.pi - p['q0']!r}")
    return "cogging with one pole (in a robot of yours its own weight takes this one's place)"


def constant(parts: MjcfParts, p: Values, key: str) -> str:
    """Return the MJCF elements of a law: a wave of order 0."""
    parts.passively(key, cogging=f"{p['F0']!r} 0 {math.pi / 2!r}")
    return "cogging with no pole: a constant"


def drag(parts: MjcfParts, p: Values, key: str) -> str:
    """Return the MJCF elements of a law: the second coefficient of damping."""
    parts.damping[1] += p["c2"]
    parts.needs = max(parts.needs, "3.8", key=_numbers)
    return "damping's second coefficient"


def cubic_viscous(parts: MjcfParts, p: Values, key: str) -> str:
    """Return the MJCF elements of a law: the first and third coefficient of damping."""
    parts.damping[0] += p["b"]
    parts.damping[2] += p["b3"]
    parts.needs = max(parts.needs, "3.8", key=_numbers)
    return "damping's first and third coefficient"


def asymmetric(parts: MjcfParts, p: Values, key: str) -> str:
    """Return the mean of both directions; the difference is lost."""
    parts.damping[0] += (p["b_p"] + p["b_n"]) / 2
    parts.lost.append(
        f"{key}: the difference of the directions ({p['b_p']:.4g} and {p['b_n']:.4g}); damping is their mean"
    )
    return "damping, the mean of both directions"


def stiffness(parts: MjcfParts, p: Values, key: str) -> str:
    """Return the element stiffness for a law."""
    parts.stiffness[0] += p["k"]
    return "stiffness"


def cubic_stiffness(parts: MjcfParts, p: Values, key: str) -> str:
    """Return the MJCF elements of a law: the third coefficient of stiffness."""
    parts.stiffness[2] += p["k3"]
    parts.needs = max(parts.needs, "3.8", key=_numbers)
    return "stiffness's third coefficient"


def asymmetric_stiffness(parts: MjcfParts, p: Values, key: str) -> str:
    """Return the MJCF elements of a law: the second and the third coefficient of stiffness."""
    parts.stiffness[1] += p["k2"]
    cubic_stiffness(parts, p, key)
    return "stiffness's second and third coefficients"


def stop(parts: MjcfParts, p: Values, key: str) -> str:
    """Return the MJCF elements of a law: a tendon with a dead band."""
    gap = p["gap"]
    parts.tendons.append({"name": key, "springlength": f"{-gap!r} {gap!r}", "stiffness": repr(p["k_s"])})
    return "a fixed tendon with a dead band"


def compliant(parts: MjcfParts, p: Values, key: str) -> str:
    """Return the MJCF elements of a law: a second joint with a spring and a damper."""
    _alone(parts)
    parts.second = ("load", p["J"], {"stiffness": repr(p["k"]), "damping": repr(p["c"])})
    return "a second joint with stiffness and damping"


def play(parts: MjcfParts, p: Values, key: str) -> str:
    """Return the MJCF elements of a law: a second joint with soft limits: spring and damper in contact only."""
    _alone(parts)
    per_force = 1 / parts.inertia + 1 / p["J"]
    solref = f"{-p['k'] * per_force!r} {-p['c'] * per_force!r}"
    soft = {"range": f"{-p['gap']!r} {p['gap']!r}", "limited": "true", "solreflimit": solref}
    parts.second = ("load", p["J"], {**soft, "solimplimit": "0.001 0.001 0.001 0.5 2"})
    return "play as a second joint whose limits are spring and damper"


def _alone(parts: MjcfParts) -> None:
    if parts.second:
        raise LostError("there is a second inertia already")


def bouc_wen(parts: MjcfParts, p: Values, key: str) -> str:
    """Return the MJCF elements of a law: bristles: hysteresis with n = 1 and gamma = 0 is Dahl's beside a spring."""
    if p["n"] != 1 or p["gamma"] != 0.0 or p["beta"] <= 0.0:
        raise LostError("MuJoCo's bristles are hysteresis with n = 1, gamma = 0 and beta > 0 only")
    force = (1 - p["alpha"]) * p["D"] * p["k"]
    parts.stiffness[0] += p["alpha"] * p["k"]
    rate, level = p["lambda"] / p["D"], p["lambda"] / p["beta"]
    parts.bristles(key, (force * rate, 0.0, force * level, force * level, 1.0))
    return "stiffness and lugre with one level"


def saturation(parts: MjcfParts, p: Values, key: str) -> str:
    """Return the attribute ctrlrange for a law."""
    limit = p["u_max"] * parts.control
    parts.motor["ctrlrange"] = f"{-limit!r} {limit!r}"
    return "ctrlrange"


def delay(parts: MjcfParts, p: Values, key: str) -> str:
    """Return the actuator's delay for a law."""
    parts.delay += p["T"]
    parts.needs = max(parts.needs, "3.5", key=_numbers)
    return "delay"


def warming(parts: MjcfParts, p: Values, key: str) -> str:
    """Return the MJCF elements of a law: thermal; with a scaled control the heat is scaled alike."""
    share = parts.control**2
    numbers = (p["R_th"] / share, p["C"] * share, 0.0, p["a"], 0.0, 0.0)
    parts.motor["thermal"] = " ".join(repr(float(v)) for v in numbers)
    parts.needs = max(parts.needs, "3.7", key=_numbers)
    return "thermal, reference and ambient temperature 0: the state is the rise"


def play_friction(parts: MjcfParts, p: Values, key: str) -> str:
    """Return the level as frictionloss; that it comes late after a reversal is lost."""
    parts.frictionloss += p["F_c"]
    parts.lost.append(f"{key}: that the force comes after {2 * p['gap']:.3g} of way only; frictionloss is at once")
    return "frictionloss, its level"


def load_dependent(parts: MjcfParts, p: Values, key: str) -> str:
    """Refuse: no element depends on the load."""
    raise LostError("no element of MJCF has friction that grows with the load")


MJCF_LAWS: dict[str, Callable[[MjcfParts, Values, str], str]] = {
    "viscous_friction": viscous,
    "coulomb_friction": coulomb,
    "stribeck_friction": stribeck,
    "lugre_friction": lugre,
    "dahl_presliding": dahl,
    "cogging_torque": cogging,
    "torque_ripple": ripple,
    "gravity_load": gravity,
    "constant_load": constant,
    "quadratic_drag": drag,
    "cubic_viscous_friction": cubic_viscous,
    "asymmetric_viscous_friction": asymmetric,
    "linear_stiffness": stiffness,
    "cubic_stiffness": cubic_stiffness,
    "asymmetric_stiffness": asymmetric_stiffness,
    "hard_stop": stop,
    "compliant_load": compliant,
    "backlash": play,
    "bouc_wen_hysteresis": bouc_wen,
    "input_saturation": saturation,
    "input_delay": delay,
    "thermal_resistance": warming,
    "play_friction": play_friction,
    "load_dependent_friction": load_dependent,
    "load_dependent_stribeck": load_dependent,
}
"""By effect of the catalogue: what puts it into the parts and says what holds it."""


def _numbers(text: str) -> tuple[int, ...]:
    return tuple(int(part) for part in text.split("."))


def motor(parts: MjcfParts, p: Values, model: Model) -> None:
    """Put a dc_motor into the parts; where torque and back-EMF constants differ, the control is scaled."""
    K = math.sqrt(p["K_t"] * p["K_m"]) if p["K_m"] > 0 else p["K_t"]
    parts.kind, parts.needs = "dcmotor", "3.7"
    parts.motor = {"motorconst": f"{K!r} {K!r}", "resistance": repr(p["R_a"])}
    if p["L_a"] > 0:
        parts.motor["inductance"] = f"{p['L_a']!r} 0"
    parts.damping[0] += p["B"]
    if p["K_m"] != p["K_t"]:
        parts.control = math.sqrt(p["K_t"] / p["K_m"]) if p["K_m"] > 0 else 1.0
        parts.notes.append(
            f"MuJoCo has one constant for torque and back-EMF: set ctrl = {parts.control:.8g} x voltage, K = {K:.8g}"
        )
    if p["K_m"] == 0:
        parts.lost.append("K_m = 0: MuJoCo's motor has the back-EMF of its torque constant")


def mass(parts: MjcfParts, p: Values, model: Model) -> None:
    """Put a mass on a spring and a damper into the parts."""
    parts.damping[0] += p["c"]
    if "bouc_wen_hysteresis" not in {use.type for use in model.effects.values()} and model.plant.name != "bouc_wen":
        parts.stiffness[0] += p["k"]


def servo(parts: MjcfParts, p: Values, model: Model) -> None:
    """Put a position-controlled servo into the parts: gain, limit of the duty, motor, arm and its weight."""
    per_volt = p["K_t"] / p["R"]
    gain = per_volt * p["vin"] * p["duty_per_error"]
    limit = per_volt * p["vin"] * p["duty_limit"]
    parts.kind = "position" if not p["ki"] else "pid"
    parts.motor = {"kp": repr(gain * p["kp"]), "kv": repr(gain * p["kd"]), "forcerange": f"{-limit!r} {limit!r}"}
    if p["ki"]:
        parts.motor |= {"ki": repr(gain * p["ki"]), "input": "pos"}
        parts.needs = "3.12"
    parts.damping[0] += per_volt * p["K_t"]
    parts.notes.append(
        "damping holds the motor's back-EMF, K_t²/R, beside the friction; kp = K_t/R vin duty_per_error kp"
    )
    weight = p["mass"] + p["arm_mass"]
    if weight and p["length"]:
        centre = (p["mass"] + p["arm_mass"] / 2) * p["length"] / weight
        about = (p["mass"] + p["arm_mass"] / 3) * p["length"] ** 2 - weight * centre**2
        about = max(about, 1e-12)
        parts.load = {"pos": f"0 0 {-centre!r}", "mass": repr(weight), "diaginertia": f"{about!r} {about!r} {about!r}"}
        parts.gravity, parts.reference = 9.80665, p["q0"]
    for name, what in {"sag": "the supply's sag", "current_limit": "the limit of the current"}.items():
        if p[name]:
            parts.lost.append(f"{name}: MJCF's position actuator has nothing for {what}")
    if p["profile_time"]:
        parts.lost.append("profile_time: the filter of the goal")
    for name in ("torque_enable", "supply", "goal_velocity"):
        if name in model.inputs:
            parts.lost.append(f"input {name}: the file has the model's own value throughout")


MJCF_PLANTS: dict[str, tuple[Callable[[MjcfParts, Values, Model], None], str]] = {
    "dc_motor": (motor, "J"),
    "mass_spring_damper": (mass, "m"),
    "bouc_wen": (mass, "m"),
    "servo": (servo, ""),
}
"""By plant: what puts it into the parts, and the parameter that is its inertia."""

__all__ = ["MJCF_LAWS", "MJCF_PLANTS"]
