"""What every plant keeps, and the names that the contract fixes for each."""

import numpy as np
import pytest

from signlin_ros.console import catalogue
from signlin_ros.errors import ModelError
from signlin_ros.linearization import METHODS, linearize
from signlin_ros.model import Model
from signlin_ros.plants import PLANTS

every_plant = pytest.mark.parametrize("plant", PLANTS.values(), ids=lambda p: p.name)
NAMES = {  # contract, section 1
    "dc_motor": (
        ["current", "speed"],
        ["voltage"],
        ["current", "speed"],
        ["R_a", "L_a", "K_t", "K_m", "B", "J"],
        ["A", "rad/s", "V"],
    ),
    "mass_spring_damper": (
        ["displacement", "velocity"],
        ["force"],
        ["displacement", "velocity"],
        ["m", "c", "k"],
        ["m", "m/s", "N"],
    ),
    "bouc_wen": (
        ["displacement", "velocity", "hysteresis"],
        ["force"],
        ["displacement", "velocity", "hysteresis"],
        ["m", "c", "k", "alpha", "D", "lambda", "beta", "gamma", "n"],
        ["m", "m/s", "-", "N"],
    ),
    "force_element": (["displacement"], ["velocity"], ["force"], ["c", "k"], ["m", "m/s", "N"]),
    "servo": (
        ["position", "speed"],
        ["goal_position"],
        ["position", "speed"],
        [
            *("K_t", "R", "J", "mass", "length", "arm_mass", "inertia", "q0", "kp", "ki", "kd", "duty_per_error"),
            *("vin", "sag", "duty_limit", "current_limit", "profile_time"),
        ],
        ["rad", "rad/s", "rad"],
    ),
}
ALIASES = {
    "dc_motor": {"velocity": "speed"},
    "mass_spring_damper": {"position": "displacement", "velocity": "velocity", "effort": "force"},
    "bouc_wen": {"position": "displacement", "velocity": "velocity", "effort": "force"},
    "force_element": {"position": "displacement", "velocity": "velocity", "effort": "force"},
    "servo": {"position": "position", "velocity": "speed"},
}
MOTOR = {"R_a": 0.764, "L_a": 0.0026, "K_t": 0.0805, "K_m": 0.0805, "B": 0.0, "J": 0.0022}


def motor(effects=None, **options):
    parameters = {**MOTOR, **options.pop("parameters", {})}
    return Model.from_dict({"plant": "dc_motor", "parameters": parameters, "effects": effects or {}, **options})


def test_the_contract_covers_every_plant():
    assert list(NAMES) == list(PLANTS)


@every_plant
def test_names_and_units(plant):
    model = catalogue.nominal_model(plant)
    states, inputs, outputs, parameters, units = NAMES[plant.name]
    assert list(model.states) == states
    assert list(model.inputs) == inputs
    assert list(model.outputs) == outputs
    assert list(model.parameters) == parameters
    assert [model.units[name] for name in dict.fromkeys([*states, *inputs, *outputs])] == units
    assert model.linearization == ("optimal" if plant.name == "bouc_wen" else "termwise")


@every_plant
def test_aliases(plant):
    model = catalogue.nominal_model(plant)
    for alias, name in ALIASES[plant.name].items():
        assert model.canonical(alias) == name
    for name in (*model.states, *model.inputs, *model.outputs):
        assert model.canonical(name) == name
    with pytest.raises(ModelError, match="no state, input or output"):
        model.canonical("nonsense")


@every_plant
def test_every_parameter_has_a_unit_bounds_and_a_sentence(plant):
    for name, par in plant.pars().items():
        assert par.unit, name
        assert len(par.doc) > 3, name
        assert par.check(par.nominal, name) == par.nominal
    assert plant.summary().endswith(".")
    assert plant.equation


@every_plant
@pytest.mark.parametrize("method", METHODS)
def test_without_effects_at_rest_the_linear_model_is_the_textbooks(plant, method):
    model = catalogue.nominal_model(plant)
    r = linearize(model, np.zeros(len(model.states)), method=method)
    p = model.parameters
    if plant.name == "dc_motor":
        want = [[-p["R_a"] / p["L_a"], -p["K_m"] / p["L_a"]], [p["K_t"] / p["J"], -p["B"] / p["J"]]]
        gain = [[1 / p["L_a"]], [0]]
    elif plant.name == "mass_spring_damper":
        want, gain = [[0, 1], [-p["k"] / p["m"], -p["c"] / p["m"]]], [[0], [1 / p["m"]]]
    elif plant.name == "bouc_wen":
        soft = (1 - p["alpha"]) * p["D"] * p["k"] / p["m"]
        want = [
            [0, 1, 0],
            [-p["alpha"] * p["k"] / p["m"], -p["c"] / p["m"], -soft],
            [0, p["lambda"] / p["D"], 0],
        ]
        gain = [[0], [1 / p["m"]], [0]]
    elif plant.name == "servo":
        moved = p["J"] + p["mass"] * p["length"] ** 2
        loop = p["K_t"] / p["R"] * p["vin"] * p["kp"] * p["duty_per_error"] / moved
        weight = p["mass"] * 9.80665 * p["length"] / moved
        want, gain = [[0, 1], [-loop - weight, -(p["K_t"] ** 2) / p["R"] / moved]], [[0], [loop]]
    else:
        want, gain = [[0]], [[1]]
    np.testing.assert_allclose(r.A, want, rtol=1e-14, atol=1e-14)
    np.testing.assert_allclose(r.B, gain, rtol=1e-14)
    np.testing.assert_array_equal(r.c, 0.0)


def test_without_inductance_the_current_is_no_state():
    model = motor(parameters={"L_a": 0.0, "B": 1e-4})
    assert model.states == ("speed",)
    r = linearize(model, [3.0], [2.0])
    back_emf = MOTOR["K_t"] * MOTOR["K_m"] / MOTOR["R_a"]
    assert r.A[0, 0] == pytest.approx(-(back_emf + 1e-4) / MOTOR["J"], rel=1e-13)
    assert r.B[0, 0] == pytest.approx(MOTOR["K_t"] / MOTOR["R_a"] / MOTOR["J"], rel=1e-13)


@pytest.mark.parametrize(
    ("options", "states"),
    [
        ({}, ("current", "speed")),
        ({"with_position": True}, ("current", "speed", "position")),
        ({"signals": {"position": "q [rad]"}}, ("current", "speed", "position")),
        ({"effects": {"gravity_load": {"A": 0.1}}}, ("current", "speed", "position")),
        ({"effects": {"viscous_friction": {"b": 0.1}}}, ("current", "speed")),
        (
            {"parameters": {"L_a": 0.0}, "effects": {"cogging_torque": {"A": 0.1, "N": 7.0, "phi": 0.0}}},
            ("speed", "position"),
        ),
    ],
)
def test_a_motor_has_a_position_exactly_where_something_needs_it(options, states):
    assert motor(**options).states == states


def test_states_come_as_plant_position_and_own_states_in_the_files_order():
    compliant = {"k": 1.0, "c": 0.01, "J": 0.001}
    dahl = {"F_c": 0.03, "sigma": 1.0}
    model = motor({"compliant_load": compliant, "dahl_presliding": dahl})
    own = ("compliant_load.position", "compliant_load.velocity", "dahl_presliding.z")
    assert model.states == ("current", "speed", "position", *own)
    model = motor({"dahl_presliding": dahl, "compliant_load": compliant})
    assert model.states == ("current", "speed", "position", own[2], *own[:2])
    hot = motor({"thermal_resistance": {"a": 0.004, "C": 20.0, "R_th": 3.0}})
    assert hot.states == ("current", "speed", "thermal_resistance.temperature_rise")


def test_load_torque_is_a_second_input_and_minus_a_constant_load():
    model = motor({"coulomb_friction": {"mu": 0.03}}, with_load_torque=True)
    assert model.inputs == ("voltage", "load_torque")
    assert model.units["load_torque"] == "N·m"
    r = linearize(model, [0.4, 5.0], [2.0, 0.01])
    np.testing.assert_allclose(r.B[:, 1], [0.0, -1 / MOTOR["J"]], rtol=1e-13)
    loaded = motor({"coulomb_friction": {"mu": 0.03}, "constant_load": {"F0": -0.01}})
    np.testing.assert_allclose(linearize(loaded, [0.4, 5.0], [2.0]).f, r.f, rtol=1e-13)


def test_bouc_wen_is_mass_spring_damper_with_bouc_wen_hysteresis():
    base, loop = (
        {"m": 1.1, "c": 0.6, "k": 40.0},
        {"alpha": 0.4, "D": 0.08, "lambda": 1.0, "beta": 0.6, "n": 2.0},
    )
    loop["gamma"] = -0.35
    one = Model.from_dict({"plant": "bouc_wen", "parameters": base | loop})
    other = Model.from_dict(
        {
            "plant": "mass_spring_damper",
            "parameters": base,
            "effects": {"bouc_wen_hysteresis": loop},
            "linearization": "optimal",
        }
    )
    assert other.states == ("displacement", "velocity", "bouc_wen_hysteresis.h")
    for x in np.random.default_rng(1).normal(0.0, 0.5, (20, 3)):
        a, b = linearize(one, x, [1.3]), linearize(other, x, [1.3])
        for name in ("A", "B", "c", "f"):
            np.testing.assert_array_equal(getattr(a, name), getattr(b, name))


def test_a_free_drive_takes_the_loop_with_a_stiffness_of_its_own():
    loop = {"alpha": 0.4, "D": 0.08, "lambda": 1.0, "beta": 0.6, "gamma": 0.3, "n": 1.0}
    free = {"plant": "mass_spring_damper", "parameters": {"m": 2.0, "c": 0.5, "k": 0.0}}
    with pytest.raises(ModelError, match=r"bouc_wen_hysteresis\.k: missing"):
        Model.from_dict({**free, "effects": {"bouc_wen_hysteresis": loop}})
    model = Model.from_dict({**free, "effects": {"bouc_wen_hysteresis": {**loop, "k": 40.0}}})
    sprung = Model.from_dict({"plant": "bouc_wen", "parameters": {"m": 2.0, "c": 0.5, "k": 40.0, **loop}})
    x, u = [0.1, -0.2, 0.3], [0.7]
    np.testing.assert_allclose(linearize(model, x, u).f, linearize(sprung, x, u).f, rtol=1e-14)


@pytest.mark.parametrize("effects", [{}, {"coulomb_friction": {"mu": 3.0}}, {"constant_load": {"F0": 2.0}}])
def test_a_force_elements_output_is_the_force_that_moves_it(effects):
    from signlin_ros.simulation import simulate

    model = Model.from_dict({"plant": "force_element", "parameters": {"c": 5.0, "k": 100.0}, "effects": effects})
    t = np.linspace(0.0, 1.0, 101)
    v = 0.2 * np.cos(7 * t)
    run = simulate(model, t, v[:, None], [0.05])
    q = 0.05 + np.concatenate([[0.0], np.cumsum(v[:-1] * np.diff(t))])
    dry = {"coulomb_friction": -3.0 * np.sign(v), "constant_load": 2.0}.get(next(iter(effects), ""), 0.0)
    np.testing.assert_allclose(run["displacement"], q, atol=1e-6)
    inside = slice(1, -1)
    np.testing.assert_allclose(run["force"][inside], (5.0 * v + 100.0 * q - dry)[inside], atol=1e-3)


@every_plant
def test_yaml_round_trip(plant, tmp_path):
    model = catalogue.nominal_model(plant).with_options(sign_order=21, update_period=1 / 3)
    model.save(tmp_path / "m.yaml")
    assert Model.load(tmp_path / "m.yaml") == model
