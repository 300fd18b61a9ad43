"""Verbs of an arm: check of its records joint by joint, gains, report, export, and what is refused."""

import json
import xml.etree.ElementTree as ET
from pathlib import Path

import jsonschema
import numpy as np
import pytest

from signlin_ros.arms.check import check
from signlin_ros.arms.data import ArmRun, read_data
from signlin_ros.arms.feedforward import friction, gains_content
from signlin_ros.arms.told import diagnosed_json
from signlin_ros.arms.verbs import diagnose
from signlin_ros.cli import main
from signlin_ros.errors import InputError, ModelError
from signlin_ros.export import export
from signlin_ros.export.arm import motion_drive, parts_of
from signlin_ros.model import Model
from signlin_ros.robots import read_urdf
from tests.arm_records import SMALL, record, small, written

MODEL = small()
NAMES = MODEL.robot.names
SCHEMAS = Path(__file__).parents[2] / "signlin_ros/schemas"
T, Q, V, U = record(MODEL, 1)
COARSE = 0.5 * U[:, 0].std()


def found(tmp_path, q=Q, v=V, u=U, cures=()):
    """Return records with cures, and findings, of a table with these columns."""
    path = written(tmp_path / "run.csv", NAMES, T, q, v, u)
    return check(MODEL, read_data(MODEL, [path], {}), cures)


def told(findings):
    return {(f.check, f.channel, f.severity) for f in findings}


# ---------------------------------------------------------------- check


def test_a_sound_record_has_no_findings(tmp_path):
    assert found(tmp_path)[1] == []


WRONG = {
    "degrees": ({"q": np.degrees(Q)}, ("unit", "waist.position", "refuse"), "waist_position_in_deg"),
    "degrees of both": (
        {"q": np.degrees(Q), "v": np.degrees(V)},
        ("unit", "elbow.position", "refuse"),
        "elbow_position_in_deg",
    ),
    "degrees per s": ({"v": np.degrees(V)}, ("unit", "waist.velocity", "refuse"), "waist_velocity_in_deg"),
    "sign of a velocity": ({"v": V * [1, -1, 1]}, ("sign", "shoulder.velocity", "refuse"), "turn_shoulder_velocity"),
    "sign of an effort": ({"u": U * [1, 1, -1]}, ("sign", "elbow.effort", "refuse"), "turn_elbow_effort"),
    "efforts exchanged": (
        {"u": U[:, [1, 0, 2]]},
        ("joint_names", "waist.effort, shoulder.effort", "refuse"),
        "exchange_waist_shoulder",
    ),
    "joints exchanged as a whole": (
        {"q": Q[:, [1, 0, 2]], "v": V[:, [1, 0, 2]], "u": U[:, [1, 0, 2]]},
        ("joint_names", "waist, shoulder", "refuse"),
        "exchange_joints_waist_shoulder",
    ),
    "velocities exchanged": ({"v": V[:, [1, 0, 2]]}, ("joint_names", "waist.velocity", "refuse"), ""),
    "a joint that does not move": (
        {"q": Q * [1, 1, 0], "v": V * [1, 1, 0]},
        ("no_motion", "elbow.position", "offer"),
        "",
    ),
    "an effort that is not measured": ({"u": U * [1, 1, 0]}, ("frozen_channel", "elbow.effort", "refuse"), ""),
    "coarse efforts": (
        {"u": np.where([True, False, False], np.round(U / COARSE) * COARSE, U)},
        ("coarse_effort", "waist.effort", "offer"),
        "",
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_is_wrong_is_told_of_its_joint(tmp_path, case):
    columns, wanted, cure = WRONG[case]
    _, findings = found(tmp_path, **columns)
    assert wanted in told(findings)
    assert cure in {f.cure for f in findings}
    neighbours = {f.channel.partition(".")[0] for f in findings if f.severity == "refuse"}
    if case.startswith("sign"):
        assert neighbours == {wanted[1].partition(".")[0]}


@pytest.mark.parametrize("v", [V, np.degrees(V)], ids=["positions", "velocities, too"])
def test_a_cure_puts_it_right(tmp_path, v):
    cures = [f"{name}_position_in_deg" for name in NAMES]
    (cured,), findings = found(tmp_path, q=np.degrees(Q), v=v, cures=cures)
    np.testing.assert_allclose(cured.measured["elbow.position"], Q[:, 2], atol=1e-5)
    np.testing.assert_allclose(cured.measured["elbow.velocity"], V[:, 2], atol=1e-5)
    assert not any(f.open for f in findings)


def test_joints_that_were_exchanged_are_exchanged_back(tmp_path):
    swapped = {"q": Q[:, [1, 0, 2]], "v": V[:, [1, 0, 2]], "u": U[:, [1, 0, 2]]}
    (cured,), findings = found(tmp_path, **swapped, cures=["exchange_joints_waist_shoulder"])
    np.testing.assert_allclose(cured.measured["shoulder.position"], Q[:, 1], atol=1e-5)
    np.testing.assert_allclose(cured.u, U, atol=1e-4)
    assert not any(f.open for f in findings)


def test_an_unknown_cure_is_refused_with_those_that_there_are(tmp_path):
    with pytest.raises(InputError, match=r"turn_elbow.*turn_elbow_effort"):
        found(tmp_path, u=U * [1, 1, -1], cures=["turn_elbow"])


def test_currents_without_a_gain_are_seen_by_their_size(tmp_path):
    _, findings = found(tmp_path, u=U / [8.0, 9.0, 10.0])
    gains = {f.channel: float(f.sentence.rpartition("gain: ")[2].partition("}")[0]) for f in findings}
    assert gains == pytest.approx({"waist.effort": 8.0, "shoulder.effort": 9.0, "elbow.effort": 10.0}, rel=0.1)


def test_no_gain_is_offered_for_a_joint_whose_urdf_leaves_open_what_it_needs(tmp_path, monkeypatch):
    """A balanced wrist: a centre of mass that is off by a centimetre needs a multiple of the effort."""
    text = SMALL.with_suffix(".urdf").read_text().replace('<mass value="0.25"/>', '<mass value="0.001"/>')
    balanced, true = (text.replace('xyz="0.12 0.005 0"', f'xyz="{x} 0 0"') for x in (0.008, 0.03))
    model, truth = (Model.from_dict({**MODEL.to_dict(), "robot": urdf}) for urdf in (balanced, true))
    data = written(tmp_path / "run.csv", NAMES, *record(truth, 3))
    records = read_data(model, [data], {})
    assert not [f for f in check(model, records)[1] if f.check == "effort_scale"]
    monkeypatch.setattr("signlin_ros.arms.check.URDF_ERRORS", 0.0)
    assert [f.channel for f in check(model, records)[1] if f.check == "effort_scale"] == ["elbow.effort"]


def test_an_angle_that_wraps_is_unwrapped(tmp_path):
    turned = (Q + np.pi) % (2 * np.pi) - np.pi
    turned[:, 0] = (Q[:, 0] - Q[:, 0].min() + 2.5 + np.pi) % (2 * np.pi) - np.pi
    (cured,), findings = found(tmp_path, q=turned)
    assert ("wrapped_angle", "waist.position", "note") in told(findings)
    assert np.abs(np.diff(cured.measured["waist.position"])).max() < 0.5


def test_joints_at_other_rates_are_told(tmp_path):
    q = Q.copy()
    q[::2, 1] = np.nan
    _, findings = found(tmp_path, q=q)
    assert ("mixed_rates", "shoulder.position", "offer") in told(findings)


def test_compare_refuses_what_check_refuses_and_says_the_way_out(tmp_path, capsys):
    path = written(tmp_path / "run.csv", NAMES, T, Q, V, U * [1, 1, -1])
    assert main(["compare", str(SMALL), path]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "elbow.effort" in error
    assert "--cure turn_elbow_effort" in error
    assert main(["check", str(SMALL), path, "--json"]) == 0
    content = json.loads(capsys.readouterr().out)
    jsonschema.validate(content, json.loads((SCHEMAS / "check.json").read_text()))
    assert [f["cure"] for f in content["findings"]] == ["turn_elbow_effort"]


# ---------------------------------------------------------------- gains


def test_friction_is_a_table_in_the_unit_of_the_input(capsys):
    content = MODEL.to_dict()
    content["elbow"] = {**content["elbow"], "effort": {"gain": 2.0}}
    content["shoulder"]["effects"]["load_dependent_friction"] = {"kappa_d": 0.0, "kappa_e": 0.1}
    model = Model.from_dict(content, folder=MODEL.folder)
    found_ = gains_content(model, {"shoulder.position": 0.5}, 0.01, bandwidth=30.0)
    jsonschema.validate(found_, json.loads((SCHEMAS / "arm_gains.json").read_text()))
    elbow, shoulder = found_["joints"]["elbow"], found_["joints"]["shoulder"]
    assert elbow["unit"] == "A"
    assert elbow["kS"] == pytest.approx(0.6 / 2.0)
    assert elbow["kV"] == pytest.approx(0.4 / 2.0)
    last = elbow["friction"][-1]
    assert last["forward"] == pytest.approx((0.6 + 0.4 * last["speed"]) / 2.0)
    assert last["backward"] == pytest.approx(-last["forward"])
    assert shoulder["dry_here"] == pytest.approx(1.2 + 0.1 * abs(shoulder["kG"]))
    assert main(["gains", str(SMALL), "--at", "shoulder.position=0.5"]) == 0
    assert "shoulder" in capsys.readouterr().out


def test_a_law_that_would_drive_its_joint_beyond_the_record_is_told():
    content = MODEL.to_dict()
    content["shoulder"]["effects"].pop("viscous_friction")
    content["shoulder"]["effects"]["cubic_viscous_friction"] = {"b": 0.5, "b3": -0.5}
    content["operating_range"] = {}
    beyond, within = (
        gains_content(Model.from_dict({**content, "operating_range": own}, folder=MODEL.folder), {}, 0.01)
        for own in ({"shoulder.velocity": 4.0}, {"shoulder.velocity": 0.5})
    )
    assert [note for note in beyond["notes"] if note.startswith("shoulder: its friction would drive it")]
    assert not within["notes"]
    assert within["joints"]["shoulder"]["kV"] == pytest.approx(0.5 - 0.5 * 0.25)


def test_friction_of_a_joint_is_what_its_equations_have():
    model, v = MODEL, np.array([-1.0, -0.1, 0.1, 1.0])
    for i, name in enumerate(NAMES):
        own = {use.type: use.parameters for key, use in model.effects.items() if key.startswith(f"{name}.")}
        wanted = own["viscous_friction"]["b"] * v + own["coulomb_friction"]["mu"] * np.sign(v)
        np.testing.assert_allclose(friction(model, i, v, 0.0), wanted, atol=1e-12)


def test_a_limit_is_refused_in_one_line(capsys):
    assert main(["gains", str(SMALL), "--limit", "3"]) == 2
    assert "--limit: is not taken for an arm" in capsys.readouterr().err


# ---------------------------------------------------------------- export


def test_a_urdf_has_the_friction_of_the_model(tmp_path):
    export(MODEL, "urdf", tmp_path / "arm.urdf")
    joints = {j.get("name"): j for j in ET.parse(tmp_path / "arm.urdf").getroot().findall("joint")}
    for name in NAMES:
        dynamics = joints[name].find("dynamics")
        own = {use.type: use.parameters for key, use in MODEL.effects.items() if key.startswith(f"{name}.")}
        assert float(dynamics.get("damping")) == own["viscous_friction"]["b"]
        assert float(dynamics.get("friction")) == own["coulomb_friction"]["mu"]
    np.testing.assert_allclose(read_urdf(tmp_path / "arm.urdf").pi, MODEL.robot.pi)


def test_what_a_joint_has_no_element_for_is_lost():
    model = MODEL.with_effect("elbow.load_dependent_friction", kappa_d=0.0, kappa_e=0.1)
    model = model.with_effect("waist.constant_load", F0=0.2)
    lost = parts_of(model).lost
    assert [line.partition(":")[0] for line in lost] == ["waist.constant_load", "elbow.load_dependent_friction"]


@pytest.mark.slow
@pytest.mark.parametrize("target", ["mjcf", "casadi", "python-control"])
def test_a_target_moves_as_our_exact_model(tmp_path, target):
    pytest.importorskip({"mjcf": "mujoco", "casadi": "casadi", "python-control": "control"}[target])
    content = MODEL.to_dict()
    if target == "mjcf":
        content["couplings"] = {"wrist": {"joints": ["shoulder", "elbow"], "position": [1, 0, 0.5, 1]}}
    model = Model.from_dict(content, folder=MODEL.folder)
    suffix = ".xml" if target == "mjcf" else ".py"
    result = export(model, target, tmp_path / f"arm{suffix}")
    assert set(result.loss.channels) == set(model.states)
    assert all(c.percent < 3.0 for c in result.loss.channels.values())


def test_targets_of_one_mass_are_refused_with_the_reason(tmp_path, capsys):
    for target, suffix in (("c", ".c"), ("sdf", ".sdf"), ("bam", ".json")):
        assert main(["export", str(SMALL), "--to", target, "-o", str(tmp_path / f"x{suffix}")]) == 2
        error = capsys.readouterr().err
        assert f"--to {target}: does not take an arm" in error
        assert "mjcf" in error


def test_a_joint_without_inertia_is_named():
    text = SMALL.with_suffix(".urdf").read_text()
    root = ET.fromstring(text)
    for link in root.findall("link"):
        if link.get("name") in ("forearm", "tool"):
            for own in link.findall("inertial"):
                link.remove(own)
    content = {**MODEL.to_dict(), "robot": ET.tostring(root, encoding="unicode")}
    content["elbow"] = {"effects": {"viscous_friction": {"b": 0.4}}}
    with pytest.raises(ModelError, match="elbow carries no inertia"):
        motion_drive(Model.from_dict(content))


# ---------------------------------------------------------------- refused


@pytest.mark.parametrize("option", ["--horizon", "--cutoff", "--hold-out"])
def test_options_of_one_mass_are_refused(tmp_path, capsys, option):
    data = written(tmp_path / "run.csv", NAMES, T, Q, V, U)
    value = "kp=3" if option == "--hold-out" else "3"
    assert main(["compare", str(SMALL), data, option, value]) == 2
    error = capsys.readouterr().err
    assert error.startswith(f"signlin: {option}: ")
    assert error.count("\n") == 1


@pytest.mark.parametrize("words", [["experiment", "MODEL", "DATA", "-o", "OUT.csv"]])
def test_verbs_that_do_not_take_arms_say_so(tmp_path, capsys, words):
    data = written(tmp_path / "run.csv", NAMES, T, Q, V, U)
    put = {"MODEL": str(SMALL), "DATA": data, "OUT.csv": str(tmp_path / "out.csv")}
    assert main([put.get(word, word) for word in words]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert f"{words[0]}: does not take an arm" in error


# ---------------------------------------------------------------- reports, and what records do not show


@pytest.mark.slow
def test_a_report_has_a_row_and_pictures_of_every_joint(tmp_path, capsys):
    data, out = written(tmp_path / "run.csv", NAMES, T, Q, V, U), tmp_path / "arm.html"
    model = tmp_path / "arm.yaml"
    MODEL.without_effect("elbow.coulomb_friction").placed_in(tmp_path).save(model)
    assert main(["diagnose", str(model), data, "--band", "6", "--report", str(out), "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    jsonschema.validate(said, json.loads((SCHEMAS / "arm_diagnose.json").read_text()))
    page = out.read_text(encoding="utf-8")
    assert "elbow.Coulomb friction" in page
    assert all(f"<td>{name}</td>" in page for name in NAMES)
    assert "signlin diagnose" in page
    assert {p.name for p in (tmp_path / "arm_files").iterdir()} == {"left_over_time.png", "left_by_speed.png"}


def light_wrist(seeds, payload=None):
    """Return a model whose last link hardly weighs, and records whose last effort shows 1.2 times what acts."""
    text = SMALL.with_suffix(".urdf").read_text()
    for heavy, light in (("1.0", "0.005"), ("0.25", "0.0025")):
        text = text.replace(f'<mass value="{heavy}"/>', f'<mass value="{light}"/>')
    text = text.replace('iyy="0.006" iyz="0" izz="0.006"', 'iyy="0.001" iyz="0" izz="0.001"')
    model = Model.from_dict({**MODEL.to_dict(), "robot": text, **({"payload": payload} if payload else {})})
    runs = []
    for seed in seeds:
        t, q, v, u = record(model, seed)
        u[:, 2] *= 1.2
        runs.append(ArmRun(t, q, v, u, "simulated", np.zeros(3)))
    return model, runs


@pytest.mark.slow
def test_a_gain_is_said_not_to_be_seen_where_friction_is_all_of_an_effort(tmp_path):
    """A light wrist: what its motor shows is friction, and a gain scales that along."""
    model, runs = light_wrist((21, 22))
    found_ = diagnose(model, runs[:1], runs[1:], 6.0)
    assert not found_.found
    sizes = {key.at: size for key, size in found_.detectable.items() if key.law == "sensor_gain"}
    assert sizes[2] > 0.2
    assert sizes[1] < 0.2
    lines = diagnosed_json(found_, "", "", [])["joints"]["elbow"]["cannot_tell"]
    assert any("the gain of its effort is off" in line for line in lines)
    assert any("Coulomb and viscous friction are 1.20 and 1.20 times the file's" in line for line in lines)
    mine = diagnosed_json(found_, "", "", [])["joints"]["shoulder"]["cannot_tell"]
    assert not any("times the file's" in line for line in mine)


@pytest.mark.slow
def test_a_known_weight_tells_the_gain_of_a_joint_whose_effort_is_friction():
    model, runs = light_wrist((21, 22), {"on": "tool", "m": 1.5, "com": [0.1, 0.0, 0.0]})
    found_ = diagnose(model, runs[:1], runs[1:], 6.0)
    (law,) = found_.found
    assert (law.key.law, law.key.at) == ("sensor_gain", 2)
    assert 1.0 + law.values[0] == pytest.approx(1.2, abs=0.03)
