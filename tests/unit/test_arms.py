"""Arms against their records: what is missing is named in its joint, and nothing where nothing is."""

import json
import os
from dataclasses import replace
from pathlib import Path

import jsonschema
import numpy as np
import pytest

from signlin_ros.arms.data import ArmRun, effort_step
from signlin_ros.arms.distance import BodyDistance
from signlin_ros.arms.laws import EXTRA, Loads, column, force
from signlin_ros.arms.notes import bent, unwritten, weighed_beside
from signlin_ros.arms.piece import ArmSegment, RegressionRows
from signlin_ros.arms.search import Key, settled
from signlin_ros.arms.told import compared_json, diagnosed_json, effects_named, sentences
from signlin_ros.arms.verbs import _told, add, compare, diagnose
from signlin_ros.cli import main
from signlin_ros.errors import ModelError
from signlin_ros.model import Model
from signlin_ros.robots import read_urdf
from signlin_ros.robots.inertia import TEN, least_eigenvalue
from tests.arm_records import record, small, written

MODEL = small()
SCHEMAS = Path(__file__).parents[2] / "signlin_ros/schemas"
BAND = 6.0
pytestmark = pytest.mark.slow


def run(truth, seed, **options):
    t, q, v, u = record(truth, seed, **options)
    return ArmRun(t, q, v, u, "simulated", np.zeros(q.shape[1]))


def heavier(model):
    """Return a model whose links are not quite those of its file."""
    text = model.folder.joinpath(model.arm.robot).read_text()
    text = text.replace('<mass value="1.8"/>', '<mass value="1.9"/>').replace(
        '<mass value="1.0"/>', '<mass value="0.95"/>'
    )
    return Model.from_dict({**model.to_dict(), "robot": text})


TRUE = heavier(MODEL)
HERE = {"robot": str(MODEL.folder / MODEL.arm.robot)}


def named(found):
    names = found.comparison.study.names
    return {names[i]: effects for i, effects in effects_named(found).items()}


@pytest.fixture(scope="module")
def nothing_hidden():
    return run(TRUE, 1), run(TRUE, 2)


@pytest.fixture(scope="module")
def nothing_found(nothing_hidden):
    known, unseen = nothing_hidden
    return diagnose(MODEL, [known], [unseen], BAND)


@pytest.fixture(scope="module")
def loaded_friction():
    truth = TRUE.with_effect("shoulder.load_dependent_friction", kappa_d=0.0, kappa_e=0.12)
    return run(truth, 3), run(truth, 4)


def test_nothing_is_named_where_nothing_is_missing(nothing_found):
    found = nothing_found
    assert named(found) == {}
    assert found.couplings == ()
    assert found.payload == {}
    content = diagnosed_json(found, "", "small_arm", [])
    assert content["verdict"] == "adequate"
    assert all("nothing listed is missing" in line for line in sentences(found)[:-1])


def test_friction_that_grows_with_the_load_is_named_in_its_joint(loaded_friction):
    known, unseen = loaded_friction
    found = diagnose(MODEL, [known], [unseen], BAND)
    assert named(found) == {"shoulder": ["load_dependent_friction"]}
    (law,) = found.found
    assert law.values[0] == pytest.approx(0.12, rel=0.25)
    table = found.comparison.table
    assert table.model[1] < 0.8 * table.basic[1]


def test_a_spring_is_named_written_and_not_named_again(tmp_path):
    """A balancer or a bundle of cables pulls on the elbow, which rests where the spring is longer than nothing."""

    def pulled(seed):
        t, q, v, u = record(TRUE, seed)
        u[:, 2] += 1.5 * (q[:, 2] - 0.2)
        return ArmRun(t, q, v, u, "simulated", np.zeros(3))

    known, unseen = pulled(8), pulled(9)
    found = diagnose(MODEL, [known], [unseen], BAND)
    assert named(found) == {"elbow": ["linear_stiffness"]}
    assert found.found[0].values[0] == pytest.approx(1.5, rel=0.05)
    assert any("a spring acts on it, 1.5 N·m/rad" in line for line in sentences(found))
    again = found.proposal.model
    assert dict(again.effects)["elbow.linear_stiffness"].parameters["k"] == pytest.approx(1.5, rel=0.05)
    assert (compare(again, [known], [unseen], BAND).table.model <= 1.02 * found.comparison.table.model).all()
    assert named(diagnose(again, [known], [unseen], BAND)) == {}


def test_an_effort_of_the_other_sign_is_a_gain_and_its_figures_are_sizes(nothing_hidden):
    def turned(run_):
        return replace(run_, tau=run_.tau * [1.0, 1.0, -1.0])

    known, unseen = nothing_hidden
    found = diagnose(MODEL, [turned(known)], [turned(unseen)], BAND)
    assert named(found) == {"elbow": ["sensor_gain"]}
    assert 1.0 + found.found[0].values[0] == pytest.approx(-1.0, abs=0.02)
    table = found.comparison.table
    assert (np.stack([table.as_given, table.rigid, table.basic, table.model]) > 0.0).all()
    assert (np.stack([found.found[0].before, found.found[0].after]) > 0.0).all()


def test_effects_that_are_not_worked_out_stay_as_the_file_has_them():
    """A cubic spring in the file: it is in the fit, in forward simulations, and in the model that is written once."""
    own = MODEL.to_dict()["elbow"]
    effects = {**own["effects"], "cubic_stiffness": {"k3": 2.0}}
    stiff = Model.from_dict({**MODEL.to_dict(), **HERE, "elbow": {**own, "effects": effects}})

    def pulled(seed):
        t, q, v, u = record(TRUE, seed)
        u[:, 2] += 2.0 * q[:, 2] ** 3
        return ArmRun(t, q, v, u, "simulated", np.zeros(3))

    known, unseen = pulled(8), pulled(9)
    found = diagnose(stiff, [known], [unseen], BAND)
    assert named(found) == {}
    assert dict(found.proposal.model.effects)["elbow.cubic_stiffness"].parameters["k3"] == 2.0
    table = found.comparison.table
    np.testing.assert_allclose(table.model, table.basic, rtol=0.02)
    without = diagnose(MODEL, [run(TRUE, 8)], [run(TRUE, 9)], BAND)
    np.testing.assert_allclose(table.basic, without.comparison.table.basic, rtol=0.05)
    np.testing.assert_allclose(found.ahead[1].rms, without.ahead[1].rms, rtol=0.1)


def test_the_motors_inertia_is_no_part_of_an_effort_behind_its_gear(nothing_hidden):
    known, unseen = nothing_hidden
    own = {**MODEL.to_dict()["elbow"], "effort": {"side": "link"}}
    sided = Model.from_dict({**MODEL.to_dict(), **HERE, "elbow": own})
    behind, before = (compare(model, [known], [unseen], BAND) for model in (sided, MODEL))
    assert {*before.basic.design.names} - {*behind.basic.design.names} == {"2.motor_inertia"}
    rows = before.study.new
    needed = before.study.left(sided, rows) - before.study.left(MODEL, rows)
    motor = MODEL.parameters["elbow.motor_inertia"] * rows.motor(2, lambda piece: piece.a[:, 2])
    np.testing.assert_allclose(needed, motor, atol=1e-12)
    assert diagnose(sided, [known], [unseen], BAND).proposal.model.value("elbow.motor_inertia") == 0.03


def test_what_bodies_that_exist_cost_is_told_where_the_fit_asks_for_others_beyond_doubt(nothing_found):
    found = nothing_found
    assert bent(found) == []
    estimate, at = found.estimate, found.estimate.design.at("elbow.Ixx")
    theta = estimate.theta.copy()
    theta[at] += 0.5  # more than the two others together
    asked = replace(found, estimate=replace(estimate, theta=theta))
    assert bent(asked) == []  # the row is no worse than the fit's
    table = replace(found.comparison.table, model=1.5 * asked.estimate.rms)
    (line,) = bent(replace(asked, comparison=replace(found.comparison, table=table)))
    assert line.startswith("elbow: the fit asks for a pseudo-inertia with the eigenvalue -0.2")
    assert "which no body has" in line
    assert all(f"of {name}'s effort are left" in line for name in ("waist", "shoulder", "elbow"))
    theta[estimate.design.at("1.motor_inertia")] = -0.5
    (line,) = bent(replace(asked, comparison=replace(found.comparison, table=table)))
    assert "shoulder: the fit asks for a motor's inertia of -0.5" in line


def test_friction_that_the_file_leaves_out_of_a_joint_is_named(nothing_hidden):
    known, unseen = nothing_hidden
    found = diagnose(MODEL.without_effect("elbow.coulomb_friction"), [known], [unseen], BAND)
    assert named(found) == {"elbow": ["coulomb_friction"]}


def test_a_payload_is_named_and_weighed(nothing_hidden):
    known, _ = nothing_hidden
    truth = TRUE.with_arm(TRUE.arm).with_payload(None)
    loaded = Model.from_dict({**truth.to_dict(), "payload": {"on": "tool", "m": 1.2, "com": [0.05, 0.0, 0.0]}})
    first, second = run(loaded, 5), run(loaded, 6)
    found = diagnose(MODEL, [first], [second], BAND)
    assert [f.key.law for f in found.found] == ["payload"]
    assert found.payload["m"][0] == pytest.approx(1.2, rel=0.1)
    assert any("refined without a load weighs it alone" in note for note in weighed_beside(found))
    # its error is that of links within their tolerance, and larger by as much as they are farther off
    assert not found.comparison.bodies.beyond
    assert not any("its mass is known to" in note for note in weighed_beside(found))
    far = replace(found.comparison, bodies=BodyDistance(25.0 * 9.0, 25, "elbow.m", 5.0))
    (said,) = weighed_beside(replace(found, comparison=far))
    assert f"its mass is known to {3.0 * found.payload['m'][1]:.2g} kg" in said
    # links and payload are written apart, and weigh together what was fitted
    assert (found.comparison.table.model <= 1.02 * found.estimate.rms).all()
    assert min(least_eigenvalue(joint.pi) for joint in found.proposal.model.unloaded.joints) > 0.0
    free = diagnose(Model.from_dict({**MODEL.to_dict(), **HERE, "inertia": {"consistent": False}}), [first], [second])
    np.testing.assert_allclose(free.proposal.model.robot.pi, free.state.body(free.estimate), rtol=1e-6, atol=1e-9)
    # a model refined without the load, and then the load alone
    refined = diagnose(MODEL, [known], [run(TRUE, 7)], BAND).proposal.model
    asked = Model.from_dict(
        {**refined.to_dict(), "payload": {"on": "tool", "m": 0.0, "tolerance": {"m": 5.0, "com": 0.1}}}
    )
    alone = diagnose(asked, [first], [second], BAND)
    assert alone.only_payload
    assert not alone.comparison.bodies.beyond  # beside the payload they are those of the file
    assert weighed_beside(alone) == []
    assert "as right as the model" in sentences(alone)[-1]
    assert alone.payload["m"][0] == pytest.approx(1.2, rel=0.1)
    assert alone.proposal.model.arm.payload.m == pytest.approx(1.2, rel=0.1)
    left = alone.comparison.table
    assert (left.model <= 1.5 * diagnose(loaded, [first], [second], BAND).comparison.table.basic + 0.02).all()


def test_a_wrong_gain_is_told_from_friction_and_its_neighbour_is_left_in_peace(nothing_hidden):
    wrong = []
    for one in nothing_hidden:
        tau = one.tau.copy()
        tau[:, 1] *= 1.25
        wrong.append(ArmRun(one.t, one.q, one.v, tau, one.source, one.steps))
    found = diagnose(MODEL, [wrong[0]], [wrong[1]], BAND)
    assert set(named(found)) == {"shoulder"}
    assert named(found)["shoulder"][0] == "sensor_gain"
    assert not unwritten(found)
    assert found.proposal.model.parameters["shoulder.gain"] == pytest.approx(1.0 / 1.25, rel=0.05)


def test_a_model_is_written_as_if_an_elastic_gear_that_it_cannot_have_were_not_known(nothing_hidden):
    comparison = compare(MODEL, [nothing_hidden[0]], [nothing_hidden[1]], BAND)
    written_ = []
    for terms in ([], [(Key("compliant_load", 1), None)]):
        state = comparison.study.state()
        state.terms = list(terms)
        estimate = settled(state)
        written_.append(_told(comparison, state, estimate, (), []).proposal.model)
    plain, elastic = written_
    np.testing.assert_allclose(elastic.robot.pi, plain.robot.pi, rtol=1e-3, atol=1e-5)


def test_a_coupling_that_the_file_does_not_have_is_named_on_both_joints():
    couplings = {"c": {"joints": ["shoulder", "elbow"], "position": [1, 0, 1, 1]}}
    truth = Model.from_dict({**TRUE.to_dict(), "couplings": couplings})
    found = diagnose(MODEL, [run(truth, 8)], [run(truth, 9)], BAND)
    assert found.couplings == (("shoulder", "elbow"),)
    assert found.proposal.model.arm_plant.motors[2].tolist() == [0.0, 1.0, 1.0]


@pytest.mark.parametrize(
    ("chain", "geared", "said"),
    [(0.0, 0.0, "one motor turns with both"), (1.0, 0.0, "one motor"), (0.0, -1.0, "both motors turn with both")],
    ids=["palletiser", "two rods", "differential"],
)
def test_efforts_of_motors_that_turn_several_joints_are_told_as_such(chain, geared, said):
    """Rods hold the elbow's motor to the base, the shoulder's motor turns with the waist, too, or with the elbow."""
    P = np.array([[1.0, 0.0, 0.0], [chain, 1.0, geared], [0.0, 1.0, 1.0]])
    couplings = {"rods": {"joints": list(MODEL.robot.names), "position": P.ravel().tolist()}}
    truth = Model.from_dict({**TRUE.to_dict(), "couplings": couplings})
    at_motors = [replace(one, tau=one.tau @ np.linalg.inv(P)) for one in (run(truth, 8), run(truth, 9))]
    found = diagnose(MODEL, at_motors[:1], at_motors[1:], BAND)
    pairs = {("shoulder", "elbow"), ("waist", "shoulder")} if chain else {("shoulder", "elbow")}
    assert set(found.couplings) == pairs
    assert named(found) == {}
    proposed = found.proposal.model
    assert proposed.arm_plant.motors.tolist() == P.tolist()
    assert proposed.arm_plant.at_motor == (bool(chain), True, True)
    content = diagnosed_json(found, "", "", [])
    assert len(content["robot"]["couplings"]) == 1
    assert said in sentences(found)[-1]
    assert "and their efforts are the motors'" in sentences(found)[-1]
    written_ = Model.from_dict(proposed.to_dict())
    again = diagnose(written_, [replace(one, tau=one.tau @ P) for one in at_motors[:1]], [run(truth, 9)], BAND)
    assert again.found == again.couplings == ()
    assert (again.comparison.table.model < 1.1 * found.comparison.table.model).all()


@pytest.mark.parametrize("of_motors", [False, True], ids=["efforts of joints", "efforts of motors"])
@pytest.mark.parametrize("ratio", [0.8, -0.45])
def test_a_coupling_of_another_ratio_is_named_with_it(ratio, of_motors):
    P = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, ratio, 1.0]])
    couplings = {"rods": {"joints": list(MODEL.robot.names), "position": P.ravel().tolist()}}
    truth = Model.from_dict({**TRUE.to_dict(), "couplings": couplings})
    back = np.linalg.inv(P) if of_motors else np.eye(3)
    known, unseen = (replace(one, tau=one.tau @ back) for one in (run(truth, 8), run(truth, 9)))
    found = diagnose(MODEL, [known], [unseen], BAND)
    (told,) = found.ratios
    assert (told.motor, told.joint) == (2, 1)
    assert abs(told.value - ratio) < 3.0 * told.error
    assert told.error < 0.02
    assert named(found) == {}
    assert found.proposal.model.arm_plant.motors[2, 1] == told.value
    assert found.proposal.model.arm_plant.at_motor == (False, of_motors, of_motors)
    assert "as much with shoulder as with its own joint" in sentences(found)[-1]
    (content,) = diagnosed_json(found, "", "", [])["robot"]["ratios"]
    assert content["ratio"] == {"value": told.value, "std": told.error, "unit": "-"}


def test_the_load_of_friction_is_the_models_and_never_the_measured_effort(nothing_hidden):
    known, _ = nothing_hidden
    law = next(law for law in EXTRA if law.loaded)
    loads = Loads(MODEL.robot, MODEL.robot.pi)

    def columns(one):
        return column(law, 0.0, RegressionRows([ArmSegment(MODEL.robot, MODEL.arm_plant.places, one, BAND)]), 1, loads)

    other = ArmRun(known.t, known.q, known.v, 3.0 * known.tau, known.source, known.steps)
    assert (columns(known) == columns(other)).all()


def test_a_column_is_the_effects_own_force(nothing_hidden):
    known, _ = nothing_hidden
    piece = ArmSegment(MODEL.robot, MODEL.arm_plant.places, known, BAND)
    load = Loads(MODEL.robot, MODEL.robot.pi).of(piece)
    values = {"mu": 0.5, "excess": 0.3, "v_s": 0.2}
    v = piece.speed[:, 1]
    fast = np.abs(v) > 4 * piece.noise[1]
    expected = -(0.5 + 0.3 * np.exp(-((v / 0.2) ** 2))) * np.sign(v)
    assert np.allclose(force("stribeck_friction", values, piece, 1, load)[fast], expected[fast])


def test_refined_bodies_exist_and_cost_little(loaded_friction):
    known, unseen = loaded_friction
    tight = Model.from_dict(
        {**MODEL.to_dict(), "robot": str(MODEL.folder / MODEL.arm.robot), "inertia": {"tolerance": 0.5}}
    )
    free = Model.from_dict({**tight.to_dict(), "inertia": {"tolerance": 0.5, "consistent": False}})
    with_, without = (diagnose(m, [known], [unseen], BAND) for m in (tight, free))
    bodies = read_urdf(with_.proposal.urdf).pi.reshape(-1, TEN)
    assert min(least_eigenvalue(body) for body in bodies) > 0.0
    assert (with_.comparison.table.model <= 1.02 * without.comparison.table.model).all()


def test_joints_are_found_by_name_and_a_missing_one_is_named(tmp_path, capsys, nothing_hidden):
    known, _ = nothing_hidden
    names = list(MODEL.robot.names)
    order = [2, 0, 1]
    swapped = [x[:, order] for x in (known.q, known.v, known.tau)]
    first = written(tmp_path / "a.csv", names, known.t, known.q, known.v, known.tau)
    second = written(tmp_path / "b.csv", [names[k] for k in order], known.t, *swapped)
    tables = []
    for file in (first, second):
        assert main(["compare", str(MODEL.source), file, "--band", "6", "--json"]) == 0
        tables.append(json.loads(capsys.readouterr().out)["joints"])
    assert tables[0] == tables[1]
    third = written(tmp_path / "c.csv", names[:2], known.t, known.q[:, :2], known.v[:, :2], known.tau[:, :2])
    assert main(["compare", str(MODEL.source), third]) == 2
    assert "elbow" in capsys.readouterr().err


def test_refine_writes_a_model_and_a_urdf_that_are_read_again(tmp_path, capsys, loaded_friction):
    known, unseen = loaded_friction
    names = MODEL.robot.names
    files = [written(tmp_path / f"{k}.csv", names, r.t, r.q, r.v, r.tau) for k, r in enumerate((known, unseen))]
    new = tmp_path / "new.yaml"
    arguments = [
        "refine",
        str(MODEL.source),
        files[0],
        "--validation",
        files[1],
        "--band",
        "6",
        "-o",
        str(new),
        "--json",
    ]
    assert main(arguments) == 0
    said = json.loads(capsys.readouterr().out)
    jsonschema.validate(said, json.loads((SCHEMAS / "arm_diagnose.json").read_text()))
    assert said["joints"]["shoulder"]["effects"] == ["load_dependent_friction"]
    assert main(["compare", str(new), files[0], "--validation", files[1], "--band", "6", "--json"]) == 0
    again = json.loads(capsys.readouterr().out)
    jsonschema.validate(again, json.loads((SCHEMAS / "arm_compare.json").read_text()))
    for name in names:
        assert again["joints"][name]["model"] == pytest.approx(said["joints"][name]["model"], rel=0.02)
    assert main(["diagnose", str(new), files[0], "--validation", files[1], "--band", "6"]) == 0
    text = capsys.readouterr().out
    assert "Left of the efforts, RMS below 6 Hz" in text
    # what the file has now is not missing any more, and stays in it
    assert text.startswith("adequate")
    assert "load-dependent" not in text


def test_a_law_of_the_file_that_drives_its_joint_in_these_records_is_taken_out(loaded_friction):
    model = MODEL.with_effect("shoulder.load_dependent_friction", kappa_d=0.0, kappa_e=0.1)
    turned = [
        replace(one, tau=2.0 * run(TRUE, k).tau - one.tau) for k, one in zip((3, 4), loaded_friction, strict=True)
    ]
    found = diagnose(model, [turned[0]], [turned[1]], BAND)
    assert "shoulder.load_dependent_friction" not in found.proposal.model.effects


def test_an_effect_is_added_to_a_joint(loaded_friction):
    known, unseen = loaded_friction
    found = add("shoulder.load_dependent_friction", MODEL, [known], [unseen], BAND)
    assert "shoulder.load_dependent_friction" in found.proposal.model.effects
    with pytest.raises(ModelError, match="no joint 'hip'"):
        add("hip.load_dependent_friction", MODEL, [known], [unseen], BAND)


def test_an_effort_of_the_links_side_confirms_nothing(loaded_friction):
    known, unseen = loaded_friction
    content = MODEL.to_dict()
    for name in MODEL.robot.names:
        content[name] = {**content[name], "effort": {"side": "link"}}
    content["robot"] = str(MODEL.folder / MODEL.arm.robot)
    found = diagnose(Model.from_dict(content), [known], [unseen], BAND)
    assert named(found) == {}
    assert all("link's side" in line for line in sentences(found)[:-1])


def test_an_effort_of_few_levels_is_refused(nothing_hidden):
    coarse = []
    for one in nothing_hidden:
        tau = one.tau.copy()
        step = 0.4 * tau[:, 2].std()
        tau[:, 2] = step * np.round(tau[:, 2] / step)
        steps = np.array([effort_step(c) for c in tau.T])
        coarse.append(ArmRun(one.t, one.q, one.v, tau, one.source, steps))
    assert coarse[0].steps[0] == 0.0
    found = diagnose(MODEL.without_effect("elbow.coulomb_friction"), [coarse[0]], [coarse[1]], BAND)
    assert "refused" in sentences(found)[2]
    assert "elbow" not in named(found)


def test_all_efforts_off_by_one_factor_change_no_name(loaded_friction):
    scaled = [ArmRun(r.t, r.q, r.v, 1.3 * r.tau, r.source, r.steps) for r in loaded_friction]
    content = {**MODEL.to_dict(), "robot": str(MODEL.folder / MODEL.arm.robot)}
    for name in MODEL.robot.names:
        content[name] = {"effects": content[name]["effects"]}
    free = Model.from_dict({**content, "inertia": {"tolerance": 1.0}})
    assert named(diagnose(free, [scaled[0]], [scaled[1]], BAND)).get("shoulder") == ["load_dependent_friction"]


def test_the_band_is_told_beside_the_numbers(nothing_hidden):
    known, unseen = nothing_hidden
    narrow, wide = (compare(MODEL, [known], [unseen], band) for band in (3.0, 20.0))
    assert (narrow.study.band, wide.study.band) == (3.0, 20.0)
    assert (wide.table.basic != narrow.table.basic).all()
    assert compared_json(wide, "small_arm", [])["joints"]["elbow"]["band_hz"] == 20.0


def test_without_a_prior_at_the_urdf_a_payload_is_swallowed_by_the_links(nothing_hidden):
    loaded = Model.from_dict({**TRUE.to_dict(), "payload": {"on": "tool", "m": 1.2, "com": [0.05, 0.0, 0.0]}})
    free = Model.from_dict(
        {**MODEL.to_dict(), "robot": str(MODEL.folder / MODEL.arm.robot), "inertia": {"tolerance": 1000.0}}
    )
    assert diagnose(free, [run(loaded, 5)], [run(loaded, 6)], BAND).payload == {}


def test_no_name_comes_of_chance_where_many_laws_are_tried(nothing_hidden):
    known, unseen = nothing_hidden
    rng = np.random.default_rng(7)
    for _ in range(3):  # other noise on the same motion
        noisy = [
            ArmRun(r.t, r.q, r.v, r.tau + 0.02 * rng.normal(size=r.tau.shape), r.source, r.steps)
            for r in (known, unseen)
        ]
        assert named(diagnose(MODEL, [noisy[0]], [noisy[1]], BAND)) == {}


def test_an_added_effect_leaves_those_of_the_file(loaded_friction):
    known, unseen = loaded_friction
    model = MODEL.with_effect("shoulder.load_dependent_friction", kappa_d=0.0, kappa_e=0.1)
    found = add("elbow.power_law_friction", model, [known], [unseen], BAND)
    effects = found.proposal.model.effects
    assert effects["shoulder.load_dependent_friction"].parameters["kappa_e"] == pytest.approx(0.12, rel=0.25)
    assert 0.3 <= effects["elbow.power_law_friction"].parameters["a"] <= 0.8
    assert (found.comparison.table.model <= 1.1 * found.comparison.table.basic).all()


@pytest.mark.long
def test_records_of_another_program_with_controller_and_creep_name_what_is_hidden():
    """Pinocchio's forward dynamics under a controller, wrong links, gears that ripple, 3 % noise."""
    pytest.importorskip("pinocchio")
    file = Path(os.environ.get("SIGNLIN_DATA", "../shared/data")) / "joints/ur10e.urdf"
    if not file.is_file():
        pytest.skip("needs the shared records")
    from benchmarks.arms import Truth, judged, model_of

    robot, rng = read_urdf(file), np.random.default_rng(11)
    hidden = ("load_dependent", 2, 0.1, 0.0)
    truth = Truth(str(file), robot, rng, hidden)
    known, unseen = truth.run(rng), truth.run(rng)
    content = diagnosed_json(diagnose(model_of(str(file), robot, hidden), [known], [unseen]), "", "", [])
    key, more = judged(hidden, robot.names, content)
    assert key in ("right", "tie")
    assert more == []
