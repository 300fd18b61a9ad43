"""The models, the points and the records that the product and the reference are compared on."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray
from reference_linearize import Reference

Content = dict[str, Any]
METHODS = ("termwise", "optimal", "jacobian")

MOTOR = {
    "R_a": 0.764,
    "L_a": 0.0026,
    "K_t": 0.0805,
    "K_m": 0.0805,
    "B": 0.0,
    "J": 0.0022,
}  # the paper's Table I
QUASI_STATIC = {**MOTOR, "L_a": 0.0, "B": 1e-4, "K_t": 0.081}
OSCILLATOR = {"m": 1.0, "c": 0.6, "k": 40.0}
FREE_DRIVE = {"m": 95.1, "c": 203.5, "k": 0.0}
LOOP = {"alpha": 0.4, "D": 0.08, "lambda": 1.0, "beta": 0.6, "gamma": 0.35, "n": 2.0}

COULOMB = {"coulomb_friction": {"mu": 0.033}}
GRAVITY = {"gravity_load": {"A": 0.08, "q0": 0.3}}
LOAD = {"constant_load": {"F0": 0.02}}
STRIBECK = {"stribeck_friction": {"mu": 0.025, "excess": 0.03, "v_s": 2.5}}
DRAG = {"quadratic_drag": {"c2": 6e-5}}
STOP = {"hard_stop": {"gap": 0.8, "k_s": 2.0}}
LOAD_DEPENDENT = {"load_dependent_friction": {"kappa_d": 0.1, "kappa_e": 0.2}}
SPRINGS = {
    "linear_stiffness": {"k": 0.05},
    "cubic_stiffness": {"k3": 0.004},
    "asymmetric_stiffness": {"k2": 0.01, "k3": 0.004},
}
HOT = {"thermal_resistance": {"a": 0.004, "C": 20.0, "R_th": 3.0}}
LUGRE = {"lugre_friction": {"sigma0": 20.0, "sigma1": 0.05, "sigma2": 1e-4, "F_c": 0.03, "F_s": 0.05, "v_s": 1.5}}
DAHL = {"dahl_presliding": {"F_c": 0.033, "sigma": 2.0}}
COMPLIANT = {"k": 0.6, "c": 0.001, "J": 0.001}


def case(plant: str, parameters: dict[str, float], effects: Content | None = None, **options: Any) -> Content:
    return {"plant": plant, "parameters": parameters, "effects": effects or {}, **options}


CASES: dict[str, Content] = {
    # dc_motor with an armature inductance
    "motor": case("dc_motor", MOTOR, COULOMB),
    "motor_with_position": case("dc_motor", MOTOR, COULOMB, with_position=True),
    "motor_loads": case("dc_motor", MOTOR, COULOMB | LOAD | GRAVITY, state_weights={"position": 0.0}),
    "motor_weights": case(
        "dc_motor",
        MOTOR,
        STRIBECK | GRAVITY | LOAD,
        state_weights={"current": 4.0, "speed": 0.01, "position": 0.3},
    ),
    "motor_cogging": case(
        "dc_motor",
        MOTOR,
        {
            "cogging_torque": {"A": 0.01, "N": 14.0, "phi": 0.2},
            "second": {"type": "cogging_torque", "A": 0.004, "N": 28.0, "phi": 1.0},
            "viscous_friction": {"b": 1e-4},
        }
        | STRIBECK,
        sign_order=51,
        sign_scale=0.5,
    ),
    "motor_asymmetric_auto_scale": case(
        "dc_motor",
        MOTOR,
        {"asymmetric_viscous_friction": {"b_p": 2e-4, "b_n": 3e-4}} | DRAG | LOAD,
        sign_scale=0.0,
        operating_range={"speed": 30.0},
    ),
    "motor_order_4": case("dc_motor", MOTOR, COULOMB | DRAG, sign_order=4, sign_scale=0.4),
    "motor_load_dependent": case(
        "dc_motor", MOTOR, LOAD_DEPENDENT | GRAVITY | LOAD | SPRINGS, sign_scale=0.05, with_load_torque=True
    ),
    "motor_load_dependent_auto_scale": case(
        "dc_motor",
        MOTOR,
        LOAD_DEPENDENT | LOAD | {"linear_stiffness": {"k": 0.05}},
        sign_scale=0.0,
        operating_range={"speed": 30.0, "current": 3.0, "position": 4.0},
    ),
    "motor_hot_and_saturated": case("dc_motor", MOTOR, HOT | COULOMB | {"torque_constant_saturation": {"kappa": 0.03}}),
    "motor_hard_stop": case("dc_motor", MOTOR, STOP | COULOMB | SPRINGS, sign_scale=0.02),
    "motor_dahl": case("dc_motor", MOTOR, DAHL | LOAD),
    "motor_lugre": case("dc_motor", MOTOR, LUGRE | GRAVITY),
    "motor_compliant": case("dc_motor", MOTOR, {"compliant_load": COMPLIANT} | COULOMB),
    "motor_backlash": case(
        "dc_motor", MOTOR, COULOMB | {"backlash": {**COMPLIANT, "gap": 0.05}}, sign_scale=0.01, sign_order=20
    ),
    "motor_dead_zone": case("dc_motor", MOTOR, COULOMB | {"input_deadzone": {"d": 0.9}}, sign_scale=0.1),
    "motor_saturation": case(
        "dc_motor", MOTOR, COULOMB | {"input_saturation": {"u_max": 1.5}, "input_delay": {"T": 0.004}}
    ),
    "motor_bouc_wen": case(
        "dc_motor", MOTOR, {"bouc_wen_hysteresis": {**LOOP, "gamma": -0.2, "k": 0.5}}, sign_scale=0.1
    ),
    # dc_motor, quasi-static
    "quasi_static": case("dc_motor", QUASI_STATIC, COULOMB | GRAVITY, with_load_torque=True),
    "quasi_static_load_dependent": case("dc_motor", QUASI_STATIC, LOAD_DEPENDENT | LOAD, sign_scale=0.05),
    "quasi_static_hot": case("dc_motor", QUASI_STATIC, HOT | COULOMB, with_load_torque=True),
    "quasi_static_saturated": case(
        "dc_motor", QUASI_STATIC, STRIBECK | {"torque_constant_saturation": {"kappa": 0.03}}
    ),
    "quasi_static_hot_and_saturated": case(
        "dc_motor", QUASI_STATIC, {"torque_constant_saturation": {"kappa": 0.03}} | HOT | LOAD
    ),
    # mass_spring_damper
    "oscillator": case("mass_spring_damper", OSCILLATOR, {"coulomb_friction": {"mu": 1.2}}, sign_scale=0.05),
    "oscillator_stop": case(
        "mass_spring_damper",
        OSCILLATOR,
        {"hard_stop": {"gap": 0.1, "k_s": 220.0}, "cubic_stiffness": {"k3": 120.0}} | LOAD,
        sign_scale=0.01,
    ),
    "oscillator_load_dependent": case(
        "mass_spring_damper",
        OSCILLATOR,
        LOAD_DEPENDENT | LOAD | {"input_deadzone": {"d": 0.5}},
        sign_scale=0.1,
    ),
    "oscillator_backlash": case(
        "mass_spring_damper",
        OSCILLATOR,
        {"backlash": {"gap": 0.2, "k": 30.0, "c": 0.3, "J": 0.5}},
        sign_scale=0.05,
    ),
    "oscillator_bouc_wen": case("mass_spring_damper", OSCILLATOR, {"bouc_wen_hysteresis": {**LOOP, "n": 3.0}}),
    "free_drive": case(
        "mass_spring_damper",
        FREE_DRIVE,
        {"coulomb_friction": {"mu": 20.4}, "constant_load": {"F0": -3.2}} | LOAD_DEPENDENT,
        sign_scale=0.01,
    ),
    "free_drive_lugre": case("mass_spring_damper", FREE_DRIVE, LUGRE | GRAVITY, sign_scale=0.1),
    # bouc_wen
    "bouc_wen": case("bouc_wen", OSCILLATOR | LOOP, sign_scale=0.1),
    "bouc_wen_n1_loads": case(
        "bouc_wen", OSCILLATOR | LOOP | {"n": 1.0}, LOAD | {"coulomb_friction": {"mu": 0.3}}, sign_order=21
    ),
    "bouc_wen_n3_auto_scale": case(
        "bouc_wen",
        OSCILLATOR | LOOP | {"n": 3.0, "gamma": -1.2},
        sign_scale=0.0,
        operating_range={"velocity": 0.8, "hysteresis": 1.5},
    ),
    "bouc_wen_n1.5": case("bouc_wen", OSCILLATOR | LOOP | {"n": 1.5}, sign_scale=0.1),
    # force_element: the input is the velocity
    "element_dahl": case("force_element", {"c": 5.0, "k": 100.0}, DAHL, sign_scale=0.1),
    "element_lugre": case("force_element", {"c": 5.0, "k": 0.0}, LUGRE | {"input_deadzone": {"d": 0.02}}),
    "element_bouc_wen": case("force_element", {"c": 5.0, "k": 100.0}, {"bouc_wen_hysteresis": LOOP}),
    "element_backlash": case(
        "force_element", {"c": 5.0, "k": 1.0}, {"backlash": {"gap": 0.2, "k": 30.0, "c": 0.3, "J": 0.5}}
    ),
}

# an ordinary size of each state and input, by the last part of its name
SIZE = {
    "dc_motor": {"current": 1.5, "speed": 12.0, "position": 2.0, "voltage": 2.0, "load_torque": 0.02},
    "linear": {"displacement": 0.3, "velocity": 0.5, "hysteresis": 0.8, "force": 2.0, "position": 0.3},
    "own": {"z": 0.015, "h": 0.8, "temperature_rise": 30.0},
}


def size(content: Content, name: str) -> float:
    sizes = SIZE["own"] | (SIZE["dc_motor"] if content["plant"] == "dc_motor" else SIZE["linear"])
    if name.endswith(".velocity") and content["plant"] == "dc_motor":
        return sizes["speed"]
    return sizes[name.rsplit(".", 1)[-1]]


def points(name: str) -> Iterator[tuple[dict[str, float], dict[str, float]]]:
    """(x, u): ordinary, large and small ones, 1e-14, 0 (with and without input), partly zero."""
    reference, content = Reference(CASES[name]), CASES[name]
    rng = np.random.default_rng(sum(name.encode()))

    def draw(names: list[str], factor: float) -> dict[str, float]:
        return {n: factor * size(content, n) * float(rng.uniform(-1, 1)) for n in names}

    for factor in (1.0, 1.0, 2.5, 0.02, 1e-6, 1e-14):
        yield draw(reference.states, factor), draw(reference.inputs, 1.0)
    yield draw(reference.states, 1e-14), {}
    yield {}, draw(reference.inputs, 1.0)
    yield {}, {}
    x = draw(reference.states, 1.0)
    yield {n: 0.0 if i % 2 else value for i, (n, value) in enumerate(x.items())}, draw(reference.inputs, 1.0)
    # only the last state is not zero: where its weight is 0, the remainder has no direction
    yield {reference.states[-1]: x[reference.states[-1]]}, draw(reference.inputs, 1.0)


def write_model(content: Content, path: Path) -> Path:
    path.write_text(yaml.safe_dump({"/**": {"ros__parameters": content}}, sort_keys=False))
    return path


# --- records: inputs for `simulate`


def sampled(seconds: float, period: float = 0.005) -> NDArray[np.float64]:
    return np.arange(round(seconds / period) + 1) * period


def multisine(t: NDArray[np.float64], amplitude: float, lines: tuple[float, ...], seed: int) -> NDArray[np.float64]:
    phase = np.random.default_rng(seed).uniform(0, 2 * np.pi, len(lines))
    return amplitude * np.sum([np.sin(2 * np.pi * f * t + p) for f, p in zip(lines, phase, strict=True)], axis=0)
