"""Model files: what is read, what is refused and how, what comes out again; effects of one's own."""

import importlib.metadata
import math
import os
import pickle
import re
import subprocess
import sys

import numpy as np
import pytest
import yaml

from signlin_ros import effects as registry
from signlin_ros.effects import EFFECTS
from signlin_ros.errors import EffectError, InputError, ModelError
from signlin_ros.linearization import linearize
from signlin_ros.model import Model, shipped_models
from signlin_ros.plants import find_plant

MOTOR = {"R_a": 0.764, "L_a": 0.0026, "K_t": 0.0805, "K_m": 0.0805, "B": 0.0, "J": 0.0022}
BASE = {"plant": "dc_motor", "parameters": MOTOR, "effects": {"coulomb_friction": {"mu": 0.033}}}
MASS = {"plant": "mass_spring_damper", "parameters": {"m": 1.0, "c": 0.6, "k": 40.0}}
LOOP = {"alpha": 0.5, "D": 1.0, "lambda": 1.0, "beta": 0.5, "gamma": -0.7, "n": 1.0}


def write(folder, content, text=None):
    file = folder / "model.yaml"
    file.write_text(text if text is not None else yaml.safe_dump({"/**": {"ros__parameters": content}}))
    return file


def motor(**changes):
    return {**BASE, **changes}


def parameters(**changes):
    return motor(parameters={k: v for k, v in {**MOTOR, **changes}.items() if v is not None})


def effect(name, **values):
    return motor(effects={name: values})


NAN, INF = float("nan"), float("inf")
# what is wrong -> (content, what the line must say: the key, what was found, what is allowed, the nearest name)
BAD = {
    "unknown key": (motor(sign_ordre=50), ["sign_ordre", "unknown key", "did you mean 'sign_order'"]),
    "unknown plant": (motor(plant="dc_moter"), ["plant", "'dc_moter'", "did you mean 'dc_motor'"]),
    "plant is a number": (motor(plant=3), ["plant", "3", "bouc_wen"]),
    "no plant": ({"parameters": MOTOR}, ["plant", "missing"]),
    "no parameters": ({"plant": "dc_motor"}, ["parameters.R_a", "missing", "(0, 1e+09] Ohm", "armature"]),
    "parameters are a list": (motor(parameters=[1, 2]), ["parameters", "[1, 2]", "a mapping"]),
    "parameter missing": (parameters(J=None), ["parameters.J", "missing", "kg·m²"]),
    "parameter misspelt": (parameters(K_tt=1.0), ["parameters.K_tt", "unknown", "did you mean 'K_t'"]),
    "parameter is text": (parameters(J="big"), ["parameters.J", "'big'", "a number in (0, 1e+09]"]),
    "parameter is a boolean": (parameters(J=True), ["parameters.J", "True", "a number"]),
    "parameter is null": (motor(parameters={**MOTOR, "J": None}), ["parameters.J", "None", "a number"]),
    "parameter is NaN": (parameters(J=NAN), ["parameters.J", "nan", "(0, 1e+09]"]),
    "parameter is infinite": (parameters(J=INF), ["parameters.J", "inf", "(0, 1e+09]"]),
    "parameter is zero": (parameters(J=0.0), ["parameters.J", "found 0", "(0, 1e+09] kg·m²"]),
    "parameter is negative": (parameters(L_a=-1e-3), ["parameters.L_a", "-0.001", "[0, 1e+09] H"]),
    "unknown effect": (effect("coulomb_frictoin"), ["effects.coulomb_frictoin", "did you mean 'coulomb_friction'"]),
    "effects are a list": (motor(effects=["coulomb_friction"]), ["effects", "['coulomb_friction']", "a mapping"]),
    "effect is a number": (motor(effects={"coulomb_friction": 0.03}), ["effects.coulomb_friction", "0.03"]),
    "effect's parameter missing": (effect("coulomb_friction"), ["coulomb_friction.mu", "missing", "N·m"]),
    "effect's parameter misspelt": (
        effect("stribeck_friction", mu=0.03, exces=0.1, v_s=1.0),
        ["stribeck_friction.exces", "did you mean 'excess'"],
    ),
    "effect's parameter out of range": (
        effect("coulomb_friction", mu=-0.1),
        ["effects.coulomb_friction.mu", "-0.1", "[0, 1e+09]", "N·m"],
    ),
    "effect's type unknown": (effect("second", type="cogging", A=0.1), ["effects.second", "cogging"]),
    "effect for another plant": (
        {**MASS, "effects": {"thermal_resistance": {"a": 0.004, "C": 20.0, "R_th": 3.0}}},
        ["thermal_resistance", "does not apply to mass_spring_damper", "dc_motor"],
    ),
    "effect that needs a driving force": (
        {
            "plant": "force_element",
            "parameters": {"c": 1.0, "k": 0.0},
            "effects": {"load_dependent_friction": {"kappa_d": 0.1, "kappa_e": 0.1}},
        },
        ["load_dependent_friction", "force_element", "drive_force"],
    ),
    "effect that the plant has already": (
        {
            "plant": "bouc_wen",
            "parameters": MASS["parameters"] | LOOP,
            "effects": {"bouc_wen_hysteresis": LOOP},
        },
        ["bouc_wen_hysteresis", "is part of the plant"],
    ),
    "stiffness beside the plant's own": (
        {**MASS, "effects": {"bouc_wen_hysteresis": {**LOOP, "k": 3.0}}},
        ["bouc_wen_hysteresis.k", "spring of its own"],
    ),
    "lambda with an underscore and without": (
        {"plant": "bouc_wen", "parameters": MASS["parameters"] | {"lambda_": 1.0} | LOOP},
        ["parameters.lambda_", "did you mean 'lambda'"],
    ),
    "order too high": (motor(sign_order=10_001), ["sign_order", "10001", "1 to 10000"]),
    "order is a fraction": (motor(sign_order=2.5), ["sign_order", "2.5", "a whole number"]),
    "order is a boolean": (motor(sign_order=True), ["sign_order", "True", "a whole number"]),
    "order is text": (motor(sign_order="50"), ["sign_order", "'50'", "a whole number"]),
    "order is NaN": (motor(sign_order=NAN), ["sign_order", "nan", "a whole number"]),
    "scale is negative": (motor(sign_scale=-1.0), ["sign_scale", "-1", "[0, 1e+12]"]),
    "scale 0 without a range": (motor(sign_scale=0.0), ["operating_range", "missing", "sign_scale 0.0"]),
    "range of an unknown state": (motor(operating_range={"sped": 3.0}), ["operating_range", "did you mean 'speed'"]),
    "start of a current without inductance": (
        motor(parameters={**MOTOR, "L_a": 0.0}, initial_state={"current": 3.0}),
        ["initial_state", "current", "is no state"],
    ),
    "range is zero": (motor(operating_range={"speed": 0.0}), ["operating_range.speed", "found 0", "(0, inf)"]),
    "a start that is no number": (motor(initial_state={"speed": math.nan}), ["found nan", "allowed: a finite number"]),
    "a start that is text": (motor(initial_state={"speed": "slow"}), ["'slow'", "allowed: a finite number"]),
    "a weight that is text": (motor(state_weights={"speed": "no"}), ["'no'", "allowed: a number in [0, inf)"]),
    "unknown method": (motor(linearization="optimum"), ["linearization", "did you mean 'optimal'", "termwise"]),
    "unknown operating point": (motor(operating_point="middle"), ["operating_point", "'middle'", "start, midpoint"]),
    "period is zero": (motor(update_period=0.0), ["update_period", "found 0", "(0, 3600] s"]),
    "weight of an unknown state": (motor(state_weights={"position": 0.0}), ["state_weights", "position", "speed"]),
    "weight is negative": (motor(state_weights={"speed": -1.0}), ["state_weights.speed", "-1"]),
    "initial state of an unknown name": (motor(initial_state={"spede": 1.0}), ["initial_state", "'speed'"]),
    "initial state of an input": (motor(initial_state={"voltage": 1.0}), ["initial_state", "voltage", "no state"]),
    "initial state by name and alias": (
        motor(initial_state={"velocity": 1.0, "speed": 2.0}),
        ["initial_state", "speed is given twice, as speed and as velocity"],
    ),
    "range of a position that is no state": (
        motor(operating_range={"position": 3.0}),
        ["operating_range", "there are: current, speed, voltage; with_position: true"],
    ),
    "names are listed once": (motor(state_weights={"x": 1.0}), ["there are: current, speed, voltage"]),
    "a dot in a key": (
        motor(effects={"a.b": {"type": "coulomb_friction", "mu": 0.1}}),
        ["effects.a.b: a key must not have a dot"],
    ),
    "bounds without a sentence": (motor(tolerance=-0.2), ["tolerance: found -0.2; allowed: [0, 10]"]),
    "signal by name and alias": (motor(signals={"speed": "a", "velocity": "b"}), ["signals", "speed is given twice"]),
    "time by two names": (motor(signals={"t": "a", "stamp": "b"}), ["signals", "t is given twice, as stamp and as t"]),
    "signal of nothing": (motor(signals={"sensor_x": "q"}), ["signals", "'sensor_x'"]),
    "signal of an input of another plant": ({**MASS, "signals": {"load_torque": "q"}}, ["signals", "'load_torque'"]),
    "signal without a column": (motor(signals={"voltage": " "}), ["signals.voltage", "' '", "a column's name"]),
    "frozen is misspelt": (motor(frozen=["K_tt"]), ["frozen", "did you mean 'K_t'"]),
    "tolerance of a misspelt one": (motor(tolerance={"R_aa": 0.1}), ["tolerance", "did you mean 'R_a'"]),
    "initial state is text": (motor(initial_state={"speed": "fast"}), ["initial_state.speed", "'fast'"]),
    "tolerance is negative": (motor(tolerance=-0.1), ["tolerance", "-0.1", "[0, 10]"]),
    "tolerance of an unknown parameter": (motor(tolerance={"mass": 0.1}), ["tolerance", "'mass'", "K_t"]),
    "frozen is a word": (motor(frozen="K_m"), ["frozen", "'K_m'", "a list of names"]),
    "frozen is unknown": (motor(frozen=["K_x"]), ["frozen", "'K_x'", "K_m"]),
    "signal is a list": (motor(signals={"voltage": [3]}), ["signals.voltage"]),
    "signal of an unknown name": (motor(signals={"volts": "u"}), ["signals", "volts"]),
    "effect file is not there": (motor(effect_files=["nowhere.py"]), ["effect_files", "nowhere.py", "does not exist"]),
    "with_position is a word": (motor(with_position="yes"), ["with_position", "'yes'", "true or false"]),
    "with_load_torque is a number": (motor(with_load_torque=1), ["with_load_torque", "1", "true or false"]),
}
BAD_TEXTS = {
    "empty": ("", ["empty", "ROS 2 parameter file"]),
    "a list": ("- 1\n- 2\n", ["not a ROS 2 parameter file"]),
    "YAML syntax": ("/**:\n  ros__parameters: {plant: dc_motor\n", ["not a YAML file", "line 3"]),
    "tabs": ("/**:\n\tros__parameters:\n", ["not a YAML file", "line 2"]),
    "a key twice": (
        "/**:\n  ros__parameters:\n    plant: dc_motor\n    parameters: {J: 1.0,\n      J: 2.0}\n",
        ["J: given twice, in line 4 and in line 5"],
    ),
    "no ros__parameters": ("plant: dc_motor\n", ["plant", "ros__parameters"]),
    "two nodes": (
        "a: {ros__parameters: {plant: dc_motor}}\nb: {ros__parameters: {plant: bouc_wen}}\n",
        ["a, b", "one node"],
    ),
    "parameters below are a list": ("/**: {ros__parameters: [1]}\n", ["ros__parameters"]),
}


@pytest.mark.parametrize("name", BAD)
def test_a_bad_file_is_refused_in_one_line(name, tmp_path):
    content, wanted = BAD[name]
    file = write(tmp_path, content)
    with pytest.raises(ModelError) as caught:
        Model.load(file)
    line = str(caught.value)
    assert "\n" not in line
    assert line.startswith(str(file))
    assert "()" not in line
    for word in wanted:
        assert word in line, line


@pytest.mark.parametrize("name", BAD_TEXTS)
def test_a_file_of_another_kind_is_refused_in_one_line(name, tmp_path):
    text, wanted = BAD_TEXTS[name]
    file = write(tmp_path, None, text)
    with pytest.raises(ModelError) as caught:
        Model.load(file)
    line = str(caught.value)
    assert "\n" not in line
    assert line.startswith(str(file))
    for word in wanted:
        assert word in line, line


def test_bytes_that_are_no_text_are_refused(tmp_path):
    file = tmp_path / "model.yaml"
    file.write_bytes(b"\xff\xfe\x00plant")
    with pytest.raises(ModelError, match="not a YAML file"):
        Model.load(file)


def test_a_file_that_is_not_there_names_the_shipped_models(tmp_path):
    with pytest.raises(ModelError, match=r"dc_moter: no such model file; .*did you mean 'dc_motor'"):
        Model.load("dc_moter")
    with pytest.raises(ModelError, match="is a folder"):
        Model.load(tmp_path)


# -------------------------------------------------------------------- reading


@pytest.mark.parametrize("name", sorted(shipped_models()))
def test_every_shipped_model_loads_and_linearizes(name):
    model = Model.load(name)
    result = linearize(model, np.full(len(model.states), 0.1))
    assert np.isfinite(result.A).all()


def test_the_papers_motor_is_shipped():
    model = Model.load("dc_motor")
    assert model.parameters == MOTOR
    assert model.effects["coulomb_friction"].parameters == {"mu": 0.033}
    options = (model.sign_order, model.sign_scale, model.linearization, model.operating_point, model.update_period)
    assert options == (50, 1.0, "termwise", "start", 0.2)


def test_defaults(tmp_path):
    model = Model.load(write(tmp_path, {"plant": "dc_motor", "parameters": MOTOR}))
    assert (model.sign_order, model.sign_scale, model.linearization) == (50, 1.0, "termwise")
    assert (model.operating_point, model.update_period, model.tolerance) == ("start", 0.2, 0.05)
    assert model.effects == {}
    np.testing.assert_array_equal(model.x0, 0.0)


def test_whole_numbers_are_numbers_and_optional_parameters_have_defaults(tmp_path):
    model = Model.load(write(tmp_path, motor(parameters=MOTOR | {"J": 1}, effects={"gravity_load": {"A": 1}})))
    assert model.parameters["J"] == 1.0
    assert model.effects["gravity_load"].parameters == {"A": 1.0, "q0": 0.0}


def test_keys_of_ros_and_of_the_nodes_are_taken_by_every_verb(tmp_path):
    extra = {"use_sim_time": True, "qos_overrides": {"/a": 1}, "publish_rate": 100.0, "state_source": "array"}
    model = Model.load(write(tmp_path, motor(**extra)))
    assert model.node_options == extra
    assert Model.from_dict(model.to_dict()) == model


def test_one_node_beside_others_that_are_no_models(tmp_path):
    text = "linearizer: {ros__parameters: {plant: force_element, parameters: {c: 1.0, k: 0.0}}}\nrviz: {}\n"
    assert Model.load(write(tmp_path, None, text)).plant.name == "force_element"


def test_aliases_and_own_states_in_options():
    model = Model.from_dict(
        motor(
            effects={"dahl_presliding": {"F_c": 0.03, "sigma": 1.0}},
            initial_state={"velocity": 2.0, "dahl_presliding": {"z": 0.01}},
        )
    )
    np.testing.assert_array_equal(model.x0, [0.0, 2.0, 0.01])


def test_lambda_is_an_attribute_with_an_underscore_and_a_key_without():
    model = Model.from_dict({"plant": "bouc_wen", "parameters": MASS["parameters"] | LOOP})
    assert model.value("lambda") == 1.0
    assert model.with_parameters(lambda_=1.5).value("lambda") == 1.5
    assert "parameters.lambda" in model.par_declarations()
    own = {("lambda_" if n == "lambda" else n): v for n, v in LOOP.items()}
    assert Model.from_dict({"plant": "bouc_wen", "parameters": MASS["parameters"] | own}).value("lambda") == 1.0
    assert "lambda: 1.0" in model.to_yaml()


# -------------------------------------------------------------------- writing


def test_yaml_without_loss_for_every_option(tmp_path):
    model = Model.from_dict(
        motor(
            parameters=MOTOR | {"B": 1e-7, "J": 0.1 + 0.2},
            effects={
                "coulomb_friction": {"mu": 1 / 3},
                "cogging_2": {"type": "cogging_torque", "A": 1e-5, "N": 14.0, "phi": -1e-300},
            },
            sign_order=51,
            sign_scale=0.0,
            operating_range={"speed": 30.0, "position": 3.0},
            linearization="optimal",
            operating_point="midpoint",
            update_period=1 / 7,
            state_weights={"position": 0.0},
            initial_state={"speed": -1e22},
            tolerance={"J": 0.1},
            frozen=["K_m"],
            signals={"voltage": "u [V]"},
            with_position=True,
            with_load_torque=True,
            publish_rate=100.0,
        )
    )
    model.save(tmp_path / "out.yaml")
    again = Model.load(tmp_path / "out.yaml")
    assert again == model
    assert again.to_yaml() == model.to_yaml()
    assert not list(tmp_path.glob("*.part"))


def test_numbers_stay_floats_for_ros():
    """ROS 2 tells 1 from 1.0, and YAML 1.1 reads 1e-06 as text."""
    text = Model.from_dict(parameters(B=1e-7, J=2)).to_yaml()
    tree = yaml.safe_load(text)["/**"]["ros__parameters"]
    assert all(type(value) is float for value in tree["parameters"].values())
    assert re.search(r"B: 1\.0e-07", text)


def test_writing_where_there_is_no_folder_is_refused(tmp_path):
    with pytest.raises(InputError, match="cannot write"):
        Model.from_dict(BASE).save(tmp_path / "nowhere" / "m.yaml")


# -------------------------------------------------------------------- changing


def test_a_model_that_was_looked_at_can_be_sent_to_another_process():
    model = Model.load("dc_motor")
    states = model.states
    again = pickle.loads(pickle.dumps(model))
    assert again == model
    assert again.states == states


def test_without_an_effect_options_forget_the_states_that_go_with_it():
    model = Model.from_dict(
        {
            **BASE,
            "effects": {"coulomb_friction": {"mu": 0.02}, "gravity_load": {"A": 0.05}},
            "sign_scale": 0.0,
            "operating_range": {"current": 5.0, "speed": 40.0, "position": 6.3},
            "state_weights": {"position": 2.0, "speed": 3.0},
            "initial_state": {"position": 0.1},
        }
    )
    model = model.with_effect("dahl_presliding")
    own = [name for name in model.states if "." in name]
    assert own
    model = model.with_options(state_weights={**model.state_weights, **dict.fromkeys(own, 0.5)})
    bare = model
    for key in model.effects:
        bare = bare.without_effect(key)
    assert bare.states == ("current", "speed")
    assert bare.operating_range == {"current": 5.0, "speed": 40.0}
    assert (bare.state_weights, bare.initial_state) == ({"speed": 3.0}, {})
    assert model.without_effect("coulomb_friction").operating_range == model.operating_range
    alone = Model.from_dict(
        {**BASE, "effects": {"gravity_load": {"A": 0.05}}, "sign_scale": 0.0, "operating_range": {"position": 6.3}}
    )
    assert alone.without_effect("gravity_load").sign_scale == 1.0


def test_changes_return_new_models():
    model = Model.from_dict(BASE)
    more = model.with_effect("stribeck_friction", excess=0.5)
    assert list(model.effects) == ["coulomb_friction"]
    assert more.effects["stribeck_friction"].parameters["excess"] == 0.5
    assert more.without_effect("stribeck_friction") == model
    other = model.with_parameters({"J": 0.003, "coulomb_friction.mu": 0.05, "parameters.B": 1e-4})
    assert (other.value("J"), other.value("coulomb_friction.mu"), other.value("B")) == (0.003, 0.05, 1e-4)
    assert model.value("J") == 0.0022
    assert model.with_options(sign_order=20).sign_order == 20


@pytest.mark.parametrize(
    ("change", "word"),
    [
        (lambda m: m.with_effect("coulomb_friction"), "another key"),
        (lambda m: m.with_effect("coulomb"), "did you mean"),
        (lambda m: m.without_effect("drag"), "there are: coulomb_friction"),
        (lambda m: m.with_parameters(JJ=1.0), "unknown parameter"),
        (lambda m: m.with_parameters({"coulomb_friction.nu": 1.0}), "did you mean 'coulomb_friction.mu'"),
        (lambda m: m.with_parameters(J=-1.0), "parameters.J"),
        (lambda m: m.with_options(sign_order=0), "sign_order"),
        (lambda m: m.with_options(nonsense=0), "unknown key"),
        (lambda m: m.value("nonsense"), "unknown parameter"),
        (lambda m: m.state_vector({"voltage": 1.0}), "no state"),
        (lambda m: m.input_vector({"speed": 1.0}), "no input"),
    ],
)
def test_bad_changes_are_refused(change, word):
    with pytest.raises(ModelError, match=re.escape(word)):
        change(Model.from_dict(BASE))


# -------------------------------------------------------------------- effects of one's own

OWN = '''
from signlin_ros.effects import Effect
from signlin_ros.par import Par

class Fan(Effect):
    """A fan.

    F = -b v |v|.
    """

    name = "my_fan"
    equation = "-b v |v|"
    dissipative = True
    b = Par("F·s²/Q²", nominal=1e-4, doc="drag per squared velocity")

    def force(self, m, x, p):
        return -p.b * x.velocity * m.abs(x.velocity)
'''


@pytest.fixture
def catalogue(monkeypatch):
    """The registry, put back afterwards."""
    monkeypatch.setattr(registry, "EFFECTS", EFFECTS)
    kept = dict(EFFECTS)
    yield EFFECTS
    EFFECTS.clear()
    EFFECTS.update(kept)


def test_an_effect_file_of_ones_own(tmp_path, catalogue):
    (tmp_path / "fan.py").write_text(OWN)
    own = motor(effects={"my_fan": {"b": 6e-5}}, effect_files=["fan.py"])
    model = Model.load(write(tmp_path, own))
    drag = Model.from_dict(motor(effects={"quadratic_drag": {"c2": 6e-5}}))
    for method in ("termwise", "optimal", "jacobian"):
        a, b = linearize(model, [0.4, 5.0], method=method), linearize(drag, [0.4, 5.0], method=method)
        np.testing.assert_allclose(a.A, b.A, rtol=1e-14)
    assert model.par_declarations()["effects.my_fan.b"].unit == "N·m·s²/rad²"
    assert Model.from_dict(model.to_dict(), folder=tmp_path) == model


def test_a_model_saved_elsewhere_finds_its_effect_files(tmp_path, catalogue):
    (tmp_path / "fan.py").write_text(OWN)
    (tmp_path / "new" / "deep").mkdir(parents=True)
    (tmp_path / "link").symlink_to(tmp_path / "new" / "deep")
    model = Model.load(write(tmp_path, motor(effects={"my_fan": {"b": 6e-5}}, effect_files=["fan.py"])))
    assert model.files == {tmp_path / "model.yaml": f"the model {tmp_path}/model.yaml"} | {
        tmp_path / "fan.py": "the effect file fan.py"
    }
    for folder, name in ((tmp_path, "fan.py"), (tmp_path / "new", "../fan.py"), (tmp_path / "link", "../../fan.py")):
        model.save(folder / "m.yaml")
        assert Model.load(folder / "m.yaml").effect_files == (name,)
        assert Model.load(folder / "m.yaml").effects == model.effects
    absolute = model.with_options(effect_files=[str(tmp_path / "fan.py")])
    assert absolute.placed_in(tmp_path / "new").effect_files == absolute.effect_files


def test_an_effect_file_is_run_once_so_that_a_changed_model_keeps_its_equations(tmp_path, catalogue):
    (tmp_path / "fan.py").write_text(OWN)
    model = Model.load(write(tmp_path, motor(effects={"my_fan": {"b": 6e-5}}, effect_files=["fan.py"])))
    assert model.with_parameters({"my_fan.b": 1e-4}).structure == model.structure


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("raise RuntimeError('no')", "RuntimeError: no"),
        ("def f(:\n", "SyntaxError"),
        ("import sys\nsys.exit(3)\n", "SystemExit: 3"),
        ("x = 3\n", "no subclass of signlin_ros.effects.Effect"),
        ("from signlin_ros.effects import Effect\nclass A(Effect):\n    '''A.'''\n", "class A lacks name"),
    ],
)
def test_a_bad_effect_file_is_refused(text, word, tmp_path, catalogue):
    (tmp_path / "fan.py").write_text(text)
    with pytest.raises(ModelError, match=re.escape(word)) as caught:
        Model.load(write(tmp_path, motor(effect_files=["fan.py"])))
    assert "fan.py" in str(caught.value)


FINDING = 'finding = "it grows to {b:.3g} {b.unit}"'
SLIPS = {
    "a misspelt law": ("def force", "def froce", ["defines no force, input,", "did you mean 'force' by 'froce'?"]),
    "a misspelt unit of a finding": (
        FINDING,
        FINDING.replace("unit", "unt"),
        ["finding: there is no {b.unt}", "'b.unit'"],
    ),
    "a parameter that a finding has not": (FINDING, FINDING.replace("b:", "bb:"), ["finding: there is no {bb}", "'b'"]),
    "a brace that is not closed": (FINDING, FINDING.replace("b.unit}", "b.unit"), ["finding: ", "expected '}'"]),
    "a format that is none": (FINDING, FINDING.replace("b:.3g", "F:.3g"), ["finding: ", "'g'"]),
    "a start of no parameter": ('"b": 0.05', '"bb": 0.05', ["start: no parameter 'bb'", "did you mean 'b'?"]),
    "a start that is text": ('"b": 0.05', '"b": "large"', ["start: b: found 'large'"]),
    "a start without its comma": (
        "0.05},)",
        "0.05})",
        ["start: found {'b': 0.05}", "tuple of mappings", "({'b': 0.05},)"],
    ),
    "a name for a tuple of names": ('("b",)', '("b")', ["essential: found 'b'", "tuple"]),
    "a name of nothing": ('("b",)', '("bb",)', ["essential: no parameter 'bb'"]),
    "a unit that is none": ("F·s²/Q²", "wurlitz", ["b: the unit is 'wurlitz'", "F, Q, U"]),
    "a unit of the wrong letter": ("F·s²/Q²", "F·s²/q²", ["b: the unit is 'F·s²/q²'"]),
    "a method that asks for what is not there": ('p["b"]', 'p["bb"]', ["plausible fails: KeyError: 'bb'"]),
}


@pytest.mark.parametrize("name", SLIPS)
def test_a_slip_in_the_declarations_of_an_effect_is_told_when_its_file_is_loaded(name, tmp_path, catalogue):
    right, wrong, words = SLIPS[name]
    more = f"""    {FINDING}
    start = ({{"b": 0.05}},)
    essential = ("b",)

    @classmethod
    def plausible(cls, p):
        return p["b"] > 0

"""
    text = OWN.replace("    b = Par", more + "    b = Par")
    model = write(tmp_path, motor(effect_files=["fan.py"]))
    (tmp_path / "fan.py").write_text(text)
    assert Model.load(model)
    assert right in text
    (tmp_path / "fan.py").write_text(text.replace(right, wrong))
    os.utime(tmp_path / "fan.py", (1, 1))
    with pytest.raises(ModelError) as caught:
        Model.load(model)
    line = str(caught.value)
    for word in (f"effect_files: {tmp_path / 'fan.py'}: class Fan", *words):
        assert word in line, line
    assert "\n" not in line


def test_a_unit_beside_those_of_the_plant_is_shown_with_them(tmp_path, catalogue):
    (tmp_path / "fan.py").write_text(OWN.replace("F·s²/Q²", "F/A²"))
    model = Model.load(write(tmp_path, motor(effects={"my_fan": {"b": 6e-5}}, effect_files=["fan.py"])))
    assert model.par_declarations()["effects.my_fan.b"].unit == "N·m/A²"


def test_a_model_shows_itself_as_a_table():
    shown = Model.from_dict(motor(effects={"sensor_offset": {"speed": 0.1}}))._repr_html_()
    for words in (
        "<table>",
        "dc_motor",
        "<td>J</td>",
        "kg·m²",
        "<td>sensor_offset.speed</td><td>0.1</td><td>rad/s</td>",
    ):
        assert words in shown


def test_a_folder_is_no_effect_file(tmp_path):
    with pytest.raises(ModelError, match="is a folder"):
        Model.load(write(tmp_path, motor(effect_files=["."])))


FAULTS = {
    "an if on a coordinate": ("if x.velocity > 0: pass", ["force fails", "symbols", "m.sign", "m.positive"]),
    "a misspelt parameter": ("return p.bb", ["force: there is no p.bb", "did you mean 'b'"]),
    "a misspelt coordinate": ("return x.velocty", ["there is no x.velocty", "did you mean 'velocity'"]),
    "an own state that is none": ("return x.own.z", ["there is no x.own.z"]),
    "a word that is none": ("return m.arctan(x.velocity)", ["there is no m.arctan", "signed_power"]),
    "nothing returned": ("return", ["force returns nothing"]),
    "text returned": ("return 'F'", ["force returns str"]),
    "a function of numbers": ("import math; return math.tanh(x.velocity)", ["no number", "m.sign"]),
    "an attribute of a symbol": ("return x.velocity.abs()", ["force fails", "'abs'"]),
    "rates of no state": ("return 0\n    def rates(self, m, x, p): return {'z': 1}", ["rates returns z", "(none)"]),
}


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_in_the_code_of_an_effect_is_named(name, tmp_path, catalogue):
    law, words = FAULTS[name]
    (tmp_path / "fan.py").write_text(OWN.replace("return -p.b * x.velocity * m.abs(x.velocity)", law))
    with pytest.raises(EffectError) as caught:
        _ = Model.load(write(tmp_path, motor(effects={"my_fan": {"b": 6e-5}}, effect_files=["fan.py"]))).trace
    line = str(caught.value)
    assert line.startswith(f"effect file {tmp_path / 'fan.py'}: my_fan: ")
    assert "\n" not in line
    for word in words:
        assert word in line, line


def test_an_effect_that_asks_for_what_a_plant_lacks_does_not_apply(tmp_path, catalogue):
    (tmp_path / "fan.py").write_text(OWN.replace("return -p.b", "return -x.current"))
    model = {**MASS, "effects": {"my_fan": {"b": 6e-5}}, "effect_files": ["fan.py"]}
    with pytest.raises(ModelError, match="my_fan does not apply to plant mass_spring_damper: it has no current"):
        _ = Model.load(write(tmp_path, model)).trace


@pytest.mark.parametrize(
    ("first", "second", "words"),
    [
        (None, OWN.replace("my_fan", "coulomb_friction"), ["the catalogue", "'coulomb_friction'", "another name"]),
        (OWN, OWN.replace("v |v|", "v^2"), ["other.py", "fan.py", "'my_fan'"]),
        (None, OWN + OWN.replace("class Fan", "class Other"), ["two effects are called 'my_fan'"]),
    ],
)
def test_no_effect_takes_the_name_of_another(first, second, words, tmp_path, catalogue):
    for text, name in ((first, "other.py"), (second, "fan.py")):
        (tmp_path / name).write_text(text or OWN.replace("my_fan", "my_other"))
    with pytest.raises(ModelError) as caught:
        Model.load(write(tmp_path, motor(effect_files=["other.py", "fan.py"])))
    for word in words:
        assert word in str(caught.value)
    assert EFFECTS["coulomb_friction"].__module__.startswith("signlin_ros.")


def test_a_changed_effect_file_replaces_what_it_gave(tmp_path, catalogue):
    for number, text in enumerate((OWN, OWN.replace("v |v|", "v^2"))):
        (tmp_path / "fan.py").write_text(text)
        os.utime(tmp_path / "fan.py", (number, number))
        Model.load(write(tmp_path, motor(effect_files=["fan.py"])))
    assert EFFECTS["my_fan"].equation == "-b v^2"


class _Entry:
    """An entry point as an installed package would offer it."""

    name, value = "my_fan", "my_package.fan:Fan"

    def __init__(self, load):
        self.load = load


def offer(monkeypatch, load):
    def entry_points(**_):
        return [_Entry(load)]

    monkeypatch.setattr(importlib.metadata, "entry_points", entry_points)


def test_an_effect_of_an_installed_package(monkeypatch, catalogue):
    scope = {"__name__": "my_package.fan"}
    exec(OWN, scope)
    offer(monkeypatch, lambda: scope["Fan"])
    model = Model.from_dict(motor(effects={"my_fan": {"b": 6e-5}}))
    assert np.isfinite(linearize(model, [0.4, 5.0]).A).all()
    assert "my_fan" in catalogue


@pytest.mark.parametrize("load", [lambda: 1 / 0, lambda: int, lambda: 3])
def test_a_bad_entry_point_is_named(load, monkeypatch, catalogue):
    offer(monkeypatch, load)
    with pytest.raises(ModelError, match=r"my_package\.fan:Fan"):
        Model.from_dict(motor(effects={"my_fan": {"b": 6e-5}}))


# -------------------------------------------------------------------- imports


@pytest.mark.parametrize(
    ("modules", "heavy"),
    [
        ("signlin_ros", "casadi numpy numba scipy yaml rclpy matplotlib sympy rosbags click"),
        ("signlin_ros.cli", "casadi numpy numba scipy yaml rclpy matplotlib sympy rosbags"),
        ("signlin_ros.effects signlin_ros.plants", "casadi numpy numba rclpy matplotlib sympy"),
        (
            "signlin_ros.linearization signlin_ros.simulation signlin_ros.records signlin_ros.console.catalogue",
            "rclpy matplotlib sympy std_msgs",
        ),
    ],
)
def test_imports_load_no_more_than_they_need(modules, heavy):
    check = f"import sys\nfor m in {modules.split()!r}: __import__(m)\n"
    check += f"print([m for m in {heavy.split()!r} if m in sys.modules])"
    run = subprocess.run([sys.executable, "-c", check], capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "[]"


def test_numbers_are_read_as_ros_2_reads_them(tmp_path):
    """YAML 1.1 takes 1.0e5 for text; ROS 2 does not."""
    file = tmp_path / "m.yaml"
    file.write_text(
        "/**:\n  ros__parameters:\n    plant: mass_spring_damper\n    parameters: {m: 1e0, c: 1.0e-3, k: 1.0e5}\n"
    )
    assert Model.load(file).parameters == {"m": 1.0, "c": 0.001, "k": 1e5}


@pytest.mark.parametrize(("given", "kept", "early"), [
    (0, "forward", 0.0), (0.5, "centred", 0.5), (0.4, 0.4, 0.4), ("held", "forward", 0.0), ("auto", "auto", 0.0),
    ("linear", "linear", 0.0),
])  # fmt: skip
def test_an_input_precedes_its_sample_by_steps_or_by_name(given, kept, early):
    model = Model.load("mass_spring_damper").with_options(input_hold=given)
    assert (model.input_hold, model.early) == (kept, early)
    assert Model.from_dict(model.to_dict()).early == early


@pytest.mark.parametrize("wrong", [-0.1, 1.5, "later", True, None, float("nan")])
def test_an_input_is_no_more_than_a_step_early(wrong):
    with pytest.raises(ModelError, match=r"input_hold.*auto, forward, centred, backward, linear, or by how many steps"):
        Model.load("mass_spring_damper").with_options(input_hold=wrong)


# -------------------------------------------------------------------- axis, gear, lists


def ripple(plant="mass_spring_damper", orders=(72.0, 18.0), **options):
    parameters = {name: par.nominal for name, par in find_plant(plant, "plant").pars().items()}
    effect = {"orders": list(orders), "A": [0.1] * len(orders)}
    return Model.from_dict({"plant": plant, "parameters": parameters, "effects": {"torque_ripple": effect}, **options})


def test_axis_and_gear_have_the_defaults_of_the_contract_and_are_kept():
    plain = ripple()
    assert (plain.axis, plain.gear, plain.is_rotary) == ("", 1.0, None)
    assert not {"axis", "gear"} & set(plain.to_dict())
    assert ripple("dc_motor").is_rotary is True
    given = ripple(axis="linear", gear=50.0)
    assert given.is_rotary is False
    assert Model.from_dict(given.to_dict()) == given
    assert given.to_dict()["gear"] == 50.0


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"axis": "rotery"}, "axis: found 'rotery'; allowed: rotary, linear; did you mean 'rotary'"),
        ({"gear": 0.0}, r"gear: found 0; allowed: \(0, 1e\+06\]"),
        ({"plant": "dc_motor", "axis": "linear"}, "axis: found 'linear'; allowed: rotary, the plant dc_motor turns"),
        ({"axis": "rotary", "orders": (72.5,)}, r"torque_ripple.orders\[0\]: found 72.5; allowed: a whole number"),
        ({"plant": "dc_motor", "orders": (3.0, 1.5)}, r"torque_ripple.orders\[1\]: found 1.5; allowed: a whole number"),
        ({"axis": "rotary", "gear": 50.5, "orders": (100.0, 76.0, 75.75)}, "or such a number times the gear 50.5"),
    ],
)
def test_a_bad_axis_gear_or_order_is_refused(options, words):
    with pytest.raises(ModelError, match=words):
        ripple(**options)


def test_orders_may_be_whole_for_the_joint_or_for_the_motor_or_anything_on_a_slide():
    assert ripple(axis="rotary", gear=50.5, orders=(3.0, 101.0, 151.5)).value("torque_ripple.orders[2]") == 151.5
    assert ripple(axis="linear", orders=(72.5,)).value("torque_ripple.orders[0]") == 72.5
    assert ripple(orders=(72.5,)).is_rotary is None


@pytest.mark.parametrize(
    ("effect", "words"),
    [
        ({"orders": [72.0], "A": [1.0, 2.0]}, "A: found 2 numbers; allowed: 1, one for each of effects.e.orders"),
        ({"orders": 72.0, "A": [1.0]}, "orders: found 72.0; allowed: a list of numbers"),
        ({"orders": [], "A": []}, "orders: found an empty list; allowed: at least one number"),
        ({"A": [1.0]}, "orders: missing; allowed: a list of numbers"),
        ({"orders": [72.0], "A": ["x"]}, r"A\[0\]: found 'x'; allowed: a number in"),
        ({"orders": [-1.0], "A": [1.0]}, r"orders\[0\]: found -1; allowed: \(0, 100000\]"),
        ({"orders": [72.0], "A": [1.0], "A[0]": 1.0}, r"A\[0\]: unknown parameter"),
    ],
)
def test_a_bad_list_is_refused(effect, words):
    with pytest.raises(ModelError, match=words):
        Model.load("dc_motor").with_options(effects={"e": {"type": "torque_ripple", **effect}})


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"over": "sped"}, "over: found 'sped'; allowed: speed, position, load, .* did you mean 'speed'"),
        ({"knots": [0.0, 2.0, 1.0]}, r"knots: found \[0.0, 2.0, 1.0\]; allowed: two numbers or more, each larger"),
        ({"values": [0.0, 1.0]}, "values: found 2 numbers; allowed: 3, one for each knot"),
        ({"over": ["speed", "load"]}, r"knots_2: found \[\]; allowed: two numbers or more"),
        ({"knots_2": [0.0, 1.0]}, "knots_2: found .* allowed: none, as the force is over the speed alone"),
        ({"over": "position", "jump": 0.5}, "jump: found 0.5; allowed: 0, as the force is not over the speed"),
    ],
)
def test_a_bad_curve_is_refused(changes, words):
    good = {"over": "speed", "knots": [-1.0, 0.0, 1.0], "values": [-1.0, 0.0, 2.0]}
    with pytest.raises(ModelError, match=words):
        Model.load("dc_motor").with_effect("learned_force", **{**good, **changes})


def test_a_list_is_given_by_its_elements_too():
    model = Model.load("dc_motor")
    elements = {"orders[0]": 72.0, "orders[1]": 18.0, "A[1]": 0.2, "A[0]": 0.1}
    given = model.with_effect("torque_ripple", **elements)
    assert given == model.with_effect("torque_ripple", orders=[72.0, 18.0], A=[0.1, 0.2])
    with pytest.raises(ModelError, match=r"orders: found the elements \[1\]; allowed: all from 0 on"):
        model.with_effect("torque_ripple", **{"orders[1]": 18.0})


def test_words_and_lists_are_written_as_they_are_read():
    grid = {"over": ["speed", "load"], "knots": [-1.0, 1.0], "knots_2": [0.0, 1.0, 2.0], "values": [0.0] * 6}
    model = Model.load("dc_motor").with_effect("learned_force", **grid)
    assert model.to_dict()["effects"]["learned_force"] == {**grid, "jump": 0.0}
    assert Model.from_dict(model.to_dict()) == model


def test_the_temperature_is_an_input_where_an_effect_asks_for_it():
    model = Model.load("dc_motor").with_effect("temperature_dependent_friction")
    assert model.inputs == ("voltage", "temperature")
    assert model.units["temperature"] == "K"
    assert Model.load("dc_motor").inputs == ("voltage",)


def test_the_units_of_a_rotary_axis_are_rotary() -> None:
    """ "m 81 kg", "c N·s/m", "the velocity is 6.283 m/s" where the file says `axis: rotary`."""
    free = {"plant": "mass_spring_damper", "parameters": {"m": 1.0, "c": 1.0, "k": 0.0}}
    free["effects"] = {"gravity_load": {"A": 1.0, "q0": 0.1}}
    linear, rotary = Model.from_dict(free), Model.from_dict({**free, "axis": "rotary"})
    assert linear.units == {"displacement": "m", "velocity": "m/s", "force": "N"}
    assert rotary.units == {"displacement": "rad", "velocity": "rad/s", "force": "N·m"}
    units = {name.rpartition(".")[2]: par.unit for name, par in rotary.par_declarations().items()}
    assert units == {"m": "kg·m²", "c": "N·m·s/rad", "k": "N·m/rad", "A": "N·m", "q0": "rad"}


def test_what_a_record_calls_a_state_of_an_effect_goes_with_the_effect():
    drive = {"plant": "mass_spring_damper", "axis": "rotary", "parameters": {"m": 0.001, "c": 0.002, "k": 0.0}}
    signals = {"force": "M", "displacement": "motor", "compliant_load.position": "load"}
    effects = {"compliant_load": {"k": 9.0, "c": 0.004, "J": 0.002}}
    model = Model.from_dict({**drive, "effects": effects, "signals": signals})
    assert model.without_effect("compliant_load").signals == {"force": "M", "displacement": "motor"}
