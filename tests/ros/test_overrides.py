"""ROS parameters to a model and back, without ROS."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
import yaml

from signlin_ros.effects import EFFECTS
from signlin_ros.errors import InputError, ModelError
from signlin_ros.model import Model, shipped_models
from signlin_ros.nodes.overrides import Overridable, changed, check_none_lost, entries_of, model_of, nested

EFFECT = '''
from signlin_ros.effects import Effect
from signlin_ros.par import Par


class {name}(Effect):
    """Half of it.  F = -b v / 2."""

    name = "half_viscous"
    equation = "-b v / 2"
    b = Par("F·s/Q", nominal=0.1, doc="friction")

    def force(self, m, x, p):
        return -0.5 * p.b * x.velocity
'''


def flat(tree: dict, prefix: str = "") -> dict:
    """Flatten a mapping as ROS does."""
    items = {}
    for key, value in tree.items():
        items |= flat(value, f"{prefix}{key}.") if isinstance(value, dict) else {f"{prefix}{key}": value}
    return items


@pytest.mark.parametrize("name", sorted(shipped_models()))
def test_shipped_models_survive_being_parameters(name: str) -> None:
    path = shipped_models()[name]
    content = yaml.safe_load(path.read_text())["/**"]["ros__parameters"]
    model = model_of(flat(content), ["linearizer", "--ros-args", "--params-file", str(path)])
    assert model == Model.load(path)
    declared = {key: entry.value for key, entry in entries_of(model).items()}
    assert Model.from_dict(nested(declared)).parameters == model.parameters
    for entry in entries_of(model).values():
        assert entry.description


def test_a_misspelt_name_is_refused_with_the_nearest() -> None:
    content = {"plant": "dc_motor", **flat({"parameters": Model.load("dc_motor").parameters})}
    with pytest.raises(ModelError, match="sign_order"):
        model_of({**content, "sign_ordr": 3}, [])
    with pytest.raises(ModelError, match="R_a"):
        model_of({**content, "parameters.R_aa": 3}, [])
    with pytest.raises(ModelError, match="params-file"):
        model_of({}, [])


def test_names_with_dots_and_effects_with_types() -> None:
    content = {
        "plant": "dc_motor",
        **flat({"parameters": Model.load("dc_motor").parameters}),
        "effects.cogging_2.type": "cogging_torque",
        "effects.cogging_2.A": 1,
        "effects.cogging_2.N": 14,
        "effects.cogging_2.phi": 0,
        "effects.dahl_presliding.F_c": 0.1,
        "effects.dahl_presliding.sigma": 100,
        "initial_state.dahl_presliding.z": 0.001,
        "use_sim_time": True,
        "qos_overrides./state.publisher.depth": 3,
        "joint_name": "wheel",
    }
    model = model_of(content, [])
    assert model.effects["cogging_2"].type == "cogging_torque"
    assert model.initial_state == {"dahl_presliding.z": 0.001}
    assert model.states == ("current", "speed", "position", "dahl_presliding.z")


def test_sensors_are_parameters_by_channel() -> None:
    content = {"plant": "dc_motor", **flat({"parameters": Model.load("dc_motor").parameters})}
    model = model_of({**content, "effects.sensor_offset.velocity": 1, "effects.sensor_gain.position": 0.9}, [])
    entries = entries_of(model)
    offset, gain = entries["effects.sensor_offset.speed"], entries["effects.sensor_gain.position"]
    assert (offset.value, offset.read_only) == (1.0, False)
    assert "[rad/s]" in offset.description
    assert (gain.value, gain.low, gain.high) == (0.9, 0.0, 10.0)
    assert "0 excluded" in gain.description
    assert changed(model, {"effects.sensor_offset.speed": 0.2}).sensors["speed"].offset == 0.2
    with pytest.raises(InputError, match=r"sensor_gain\.position"):
        changed(model, {"effects.sensor_gain.position": 0.0})


@pytest.fixture
def effects_restored() -> Iterator[None]:
    """Forget the effects that a test reads: others would find them in what they try."""
    known = dict(EFFECTS)
    yield
    EFFECTS.clear()
    EFFECTS.update(known)


@pytest.mark.usefixtures("effects_restored")
def test_effect_files_lie_beside_the_parameter_file_that_names_them(tmp_path: Path) -> None:
    (tmp_path / "a").mkdir()
    (tmp_path / "b").mkdir()
    (tmp_path / "a" / "half.py").write_text(EFFECT.format(name="Half"))
    content = {
        "plant": "mass_spring_damper",
        **flat({"parameters": {"m": 1.0, "c": 0.0, "k": 0.0}}),
        "effects.half_viscous.b": 2.0,
        "effect_files": ["half.py"],
    }
    files = [
        "--params-file",
        str(tmp_path / "a" / "model.yaml"),
        "--params-file",
        str(tmp_path / "b" / "more.yaml"),
    ]
    model = model_of(content, files)
    assert model.folder == tmp_path / "a"


@pytest.mark.parametrize("name", ["frozen", "effect_files", "signals", "operating_range", "effects", "tolerance"])
def test_what_is_empty_in_the_file_has_no_value_in_ros_and_is_as_if_left_out(name: str) -> None:
    content = {"plant": "dc_motor", **flat({"parameters": Model.load("dc_motor").parameters})}
    assert model_of({**content, name: None}, []) == model_of(content, [])
    with pytest.raises(ModelError, match="sign_order"):
        model_of({**content, "sign_order": None}, [])


@pytest.mark.parametrize(
    ("kept", "arguments", "lost"),
    [
        ({"a.b": 1}, ["-p", "a.b:=0.5"], "0.5"),
        ({"a.b": 1}, ["--param", "a.b:=heavy"], "'heavy'"),
        ({"a.b": 1}, ["-p", "a.b:=2", "-p", "a.b:=1", "-p", "a.b:=0.5"], "0.5"),
        ({"a.b": 1}, ["-p", "a.b:=1.0"], ""),
        ({"a.b": 2}, ["-p", "a.b:=2"], ""),
        ({"a.b": 100000.0}, ["-p", "a.b:=1e5"], ""),
        ({"a.b": float("nan")}, ["-p", "a.b:=1.5", "-p", "a.b:=.nan"], ""),
        ({"a.b": 1}, ["-p", "other:a.b:=0.5"], ""),
        ({"a.b": 1}, ["-p", "node:a.b:=1", "-p", "node:a.b:=0.5"], "0.5"),
        ({"a.b": 1}, ["-p", "a.b:=2", "-p", "node:a.b:=1"], ""),
        ({"a.b": 1}, ["-p", "a.b:=0.5", "-p", "node:a.b:=1"], ""),
        ({"a.b": 1}, ["-p", "a.b:=true", "-p", "a.b:=2"], ""),
        ({"a.b": 1}, ["-p", "node:a.b:=1", "-p", "a.b:=0.5", "-p", "node:a.b:=heavy"], "'heavy'"),
        ({"a.b": 1}, ["-p", "a.b:=0.5", "--params-file", "/OTHER"], "0.5"),
        ({"a.b": 1}, ["-p", "a.b:=2"], ""),
        ({"a.b": 1}, ["-p", "a.b:={"], ""),
        ({"a.b": 1}, ["--params-file", "/nowhere/and/never.yaml"], ""),
    ],
)
def test_a_value_that_ros_loses_for_its_type_is_refused(
    tmp_path: Path, kept: dict, arguments: list[str], lost: str
) -> None:
    file = tmp_path / "model.yaml"
    file.write_text("/**:\n  ros__parameters:\n    a: {b: 1}\nother:\n")
    other = tmp_path / "other.yaml"
    other.write_text("/elsewhere/node:\n  ros__parameters:\n    a: {b: 7}\n")
    arguments = [str(other) if one == "/OTHER" else one for one in arguments]
    command = ["node", "--ros-args", "--params-file", str(file), *arguments]
    if lost:
        with pytest.raises(InputError, match=rf"^a\.b: {lost} is not taken: ROS keeps the 1 "):
            check_none_lost(kept, command, "node")
    else:
        check_none_lost(kept, command, "node")


@pytest.mark.parametrize(
    ("section", "node", "applies"),
    [
        *((section, "/node", True) for section in ("/**", "**", "/*", "*", "node", "/node", "/**/node")),
        *((section, "/node", False) for section in ("/x/node", "/*/node", "x/node", "other", "/**/other")),
        *((section, "/x/node", True) for section in ("/**", "/x/node", "/*/node", "/x/*", "/**/node")),
        *((section, "/x/node", False) for section in ("node", "/node", "/*")),
    ],
)
def test_sections_are_told_apart_as_ros_does(section: str, node: str, applies: bool) -> None:
    command = ["node", "--ros-args", "-p", f"{section}:a.b:=1", "-p", f"{section}:a.b:=0.5"]
    if applies:
        with pytest.raises(InputError, match=r"0\.5 is not taken"):
            check_none_lost({"a.b": 1}, command, node)
    else:
        check_none_lost({"a.b": 1}, command, node)


def test_changes_at_run_time() -> None:
    model = Model.load("dc_motor")
    new = changed(
        model,
        {
            "parameters.J": 0.003,
            "effects.coulomb_friction.mu": 0.04,
            "sign_order": 20,
            "linearization": "optimal",
            "state_weights.current": 0.0,
            "use_sim_time": True,
        },
    )
    assert (new.value("J"), new.value("coulomb_friction.mu"), new.sign_order) == (0.003, 0.04, 20)
    assert (new.linearization, new.state_weights) == ("optimal", {"current": 0.0})
    assert changed(model, {"state_timeout": 1.0}) == model


@pytest.mark.parametrize(
    ("name", "value", "text"),
    [
        ("parameters.J", -1.0, "parameters.J"),
        ("parameters.J", float("nan"), "parameters.J"),
        ("parameters.L_a", 0.0, "restart"),
        ("linearization", "optimum", "optimal"),
        ("sign_order", 0, "sign_order"),
        ("sign_scale", 0.0, "operating_range"),
        ("update_period", 0.0, "update_period"),
    ],
)
def test_bad_changes_are_refused_with_the_reason(name: str, value: object, text: str) -> None:
    with pytest.raises(InputError, match=text):
        changed(Model.load("dc_motor"), {name: value})


def test_entries_check_types_ranges_and_choices() -> None:
    assert Overridable(1.0, "").check("rate", 2) == 2.0
    assert isinstance(Overridable(1.0, "").check("rate", 2), float)
    for entry, value, text in (
        (Overridable(1.0, "", 0.0, 5.0), 9, r"rate: found 9; allowed: \[0, 5\]"),
        (Overridable(1.0, "", 0.0, 5.0), float("nan"), "nan"),
        (Overridable(1, ""), 2.5, "a whole number"),
        (Overridable(False, ""), 1, "true or false"),
        (Overridable("a", "", choices=("array", "joint_state")), "arry", "did you mean 'array'"),
    ):
        with pytest.raises(InputError, match=text):
            entry.check("rate", value)
