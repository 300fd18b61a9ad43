"""Twenty plants: motors and oscillators with what makes real ones hard."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from signlin_ros.control.reference import Profile, ramps, sine, swing, triangle
from signlin_ros.model import Model

MOTOR = {"R_a": 0.764, "L_a": 0.0, "K_t": 0.0805, "K_m": 0.0805, "B": 0.0002, "J": 0.0022}
SLOW_COIL = {**MOTOR, "L_a": 0.0026}
MASS = {"m": 1.0, "c": 0.6, "k": 40.0}
FREE = {"m": 1.0, "c": 0.6, "k": 0.0}

COULOMB = {"coulomb_friction": {"mu": 0.033}}
STRIBECK = {"stribeck_friction": {"mu": 0.025, "excess": 0.015, "v_s": 0.8}}
DAHL = {"dahl_presliding": {"sigma": 3.0, "F_c": 0.033}}
LUGRE = {"lugre_friction": {"sigma0": 4.0, "sigma1": 0.02, "sigma2": 0.0, "F_c": 0.028, "F_s": 0.04, "v_s": 0.6}}
COGGING = {"cogging_torque": {"A": 0.015, "N": 14.0, "phi": 0.3}}
PLAY = {"backlash": {"gap": 0.02, "k": 12.0, "c": 0.06, "J": 0.0012}}
LOAD = {"constant_load": {"F0": 0.02}}
GRAVITY = {"gravity_load": {"A": 0.03, "q0": 0.0}}
BOUC_WEN = {"alpha": 0.4, "D": 0.03, "lambda": 1.0, "beta": 0.6, "gamma": 0.4, "n": 1.0}

MOTORS: dict[str, tuple[dict[str, float], dict[str, Any]]] = {
    "motor_coulomb": (SLOW_COIL, COULOMB),
    "motor_stribeck": (MOTOR, STRIBECK),
    "motor_coulomb_cogging": (MOTOR, COULOMB | COGGING),
    "motor_stribeck_cogging": (SLOW_COIL, STRIBECK | COGGING),
    "motor_dahl": (MOTOR, DAHL),
    "motor_lugre": (MOTOR, LUGRE),
    "motor_play": (MOTOR, COULOMB | PLAY),
    "motor_coulomb_load": (MOTOR, COULOMB | LOAD),
    "motor_stribeck_gravity": (MOTOR, STRIBECK | GRAVITY),
    "motor_dahl_cogging": (MOTOR, DAHL | COGGING),
}
_COULOMB = {"coulomb_friction": {"mu": 1.5}}
_STRIBECK = {"stribeck_friction": {"mu": 1.1, "excess": 0.8, "v_s": 0.03}}
_DAHL = {"dahl_presliding": {"sigma": 600.0, "F_c": 1.5}}
_LUGRE = {"lugre_friction": {"sigma0": 800.0, "sigma1": 8.0, "sigma2": 0.0, "F_c": 1.2, "F_s": 1.8, "v_s": 0.03}}
_HYSTERESIS = {"bouc_wen_hysteresis": BOUC_WEN}
OSCILLATORS: dict[str, tuple[dict[str, float], dict[str, Any]]] = {
    "mass_coulomb": (MASS, _COULOMB),
    "mass_stribeck": (MASS, _STRIBECK),
    "mass_hysteresis": (MASS, _HYSTERESIS),
    "mass_dahl": (MASS, _DAHL),
    "mass_lugre": (MASS, _LUGRE),
    "mass_play": (MASS, _COULOMB | {"backlash": {"gap": 0.001, "k": 800.0, "c": 6.0, "J": 0.5}}),
    "mass_cubic": (MASS, _COULOMB | {"cubic_stiffness": {"k3": 150.0}}),
    "mass_hysteresis_coulomb": (MASS, _HYSTERESIS | {"coulomb_friction": {"mu": 0.8}}),
    "mass_stribeck_load": (MASS, _STRIBECK | {"constant_load": {"F0": 1.0}}),
    "axis_coulomb_cogging": (FREE, _COULOMB | {"cogging_torque": {"A": 0.6, "N": 200.0, "phi": 0.3}}),
}
KEPT = ("N", "phi", "n", "q0", "alpha", "lambda")
"""Parameters that are not 10 % wrong: orders, phases and shapes."""
WRONG = 0.1


@dataclass(frozen=True)
class Rig:
    """A plant as it is nominally, with its limits: |u|, largest speed and travel of the references, noise."""

    name: str
    model: Model
    limit: float
    speed: float
    travel: float
    noise: tuple[float, float]

    @property
    def oscillation_bound(self) -> float:
        """5 mrad for the motors' 4 rad, and as much of the travel for the others."""
        return 5e-3 / 4.0 * self.travel

    def profiles(self, position: bool) -> dict[str, Profile]:
        """Slow reversing references, with and without stops."""
        if position:
            return {"position sine": swing(0.25 * self.travel, 4.0, 2), "position ramps with stops": self.stop(3.0)}
        return {"speed sine": sine(self.speed, 4.0, 2), "speed triangle": triangle(self.speed, 4.0, 2)}

    def stop(self, last: float) -> Profile:
        """Ramps with stops, the last of which lasts so many seconds."""
        return ramps(0.5 * self.speed, 0.5 * self.travel, 0.6, cycles=1, last=last)


def rigs() -> dict[str, Rig]:
    """Return the twenty rigs by name."""
    found = {}
    for name, (parameters, effects) in MOTORS.items():
        model = _model("dc_motor", name, parameters, effects, with_position=True, sign_scale=0.5)
        found[name] = Rig(name, model, 12.0, 3.0, 4.0, (1e-4, 0.01))
    for name, (parameters, effects) in OSCILLATORS.items():
        model = _model("mass_spring_damper", name, parameters, effects, sign_scale=0.02)
        found[name] = Rig(name, model, 30.0, 0.15, 0.2, (5e-6, 5e-4))
    pairs = zip(MOTORS, OSCILLATORS, strict=True)  # in turn, so that a table half done is one of both kinds
    return {name: found[name] for pair in pairs for name in pair}


def _model(plant: str, name: str, parameters: dict[str, float], effects: dict[str, Any], **more: Any) -> Model:
    content = {"plant": plant, "parameters": parameters, "effects": effects, **more}
    return Model.from_dict(content, name)


def mismatched(model: Model, rng: np.random.Generator) -> Model:
    """Return a plant each of whose numbers is 10 % off, up or down."""
    return _changed(model, lambda _: float(rng.choice((-1.0, 1.0))))


def corner(model: Model, toward: float) -> Model:
    """Return the plant that answers most (``toward`` 1) or least (-1) to its input: all is lighter, or heavier."""
    return _changed(model, lambda name: toward if name == "K_t" else -toward)


def _changed(model: Model, sign: Callable[[str], float]) -> Model:
    changes = {}
    for name, par in model.par_declarations().items():
        plain = name.split(".", 1)[1]
        if plain.rsplit(".", 1)[-1] not in KEPT and not par.structural:
            changes[plain] = model.value(plain) * (1.0 + WRONG * sign(plain))
    return model.with_parameters(changes)
