"""A servo: its loop, what is known of its records, and logs as BAM writes them."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from signlin_ros.checks.look import Look
from signlin_ros.checks.too_fast import TooFast
from signlin_ros.checks.unit_or_sign import _consistent
from signlin_ros.errors import ModelError, RecordError
from signlin_ros.fitting.prepare import held_in_turn
from signlin_ros.linearization import linearize
from signlin_ros.model import Model
from signlin_ros.records import ModelData, read_for_model
from signlin_ros.simulation import simulate

VALUES = {
    "K_t": 0.35,
    "R": 3.5,
    "J": 0.002,
    "mass": 0.5,
    "length": 0.1,
    "kp": 400.0,
    "duty_per_error": 0.003,
    "vin": 7.4,
}
BOTH = ["torque_enable", "supply"]


def servo(effects=None, with_inputs=BOTH, **values):
    content = {"plant": "servo", "parameters": {**VALUES, **values}, "effects": effects or {}}
    return Model.from_dict({**content, "with_inputs": list(with_inputs)})


def reference(p, t, goal, on, supply, start, friction):
    """Integrate the equations of the docstring by another method, held from sample to sample; position (T,)."""
    moved = p["J"] + p["mass"] * p["length"] ** 2
    x, found = list(start), [start[0]]
    for k in range(t.size - 1):

        def rates(_, x, k=k):
            duty = np.clip(
                p["duty_per_error"] * (p["kp"] * (goal[k] - x[0]) - p.get("kd", 0.0) * x[1] + p.get("ki", 0.0) * x[2]),
                -p.get("duty_limit", 1.0),
                p.get("duty_limit", 1.0),
            )
            current = (duty * supply[k] - p["K_t"] * x[1]) / (p["R"] + p.get("sag", 0.0) * duty**2)
            limit = p.get("current_limit", 0.0) or np.inf
            torque = on[k] * p["K_t"] * np.clip(current, -limit, limit)
            weight = p["mass"] * 9.80665 * p["length"] * np.sin(x[0])
            return [x[1], (torque - weight - friction * x[1]) / moved, goal[k] - x[0]]

        x = solve_ivp(rates, (t[k], t[k + 1]), x, rtol=1e-10, atol=1e-12).y[:, -1]
        found.append(x[0])
    return np.array(found)


@pytest.mark.parametrize(
    "more",
    [{}, {"kd": 20.0}, {"ki": 300.0}, {"sag": 0.5, "duty_limit": 0.8}, {"current_limit": 1.2}],
    ids=["P", "PD", "PI", "sag", "current limit"],
)
def test_the_exact_simulation_is_that_of_the_equations(more):
    t = np.arange(0.0, 0.6, 0.01)
    goal, on = np.where(t < 0.2, 0.9, -0.4), np.where((t > 0.4) & (t < 0.5), 0.0, 1.0)
    supply = 7.4 + 0.4 * np.sin(20 * t)
    model = servo({"viscous_friction": {"b": 0.006}}, **more)
    x0 = np.array([{"position": 0.1, "speed": 0.5}.get(name, 0.0) for name in model.states])
    found = simulate(model, t, np.column_stack([goal, on, supply]), x0, rtol=1e-9)["position"]
    np.testing.assert_allclose(
        found, reference({**VALUES, **more}, t, goal, on, supply, [0.1, 0.5, 0.0], 0.006), atol=1e-6
    )


def test_the_loop_holds_its_own_states_only_where_it_has_them():
    assert servo().states == ("position", "speed")
    assert servo(ki=1.0).states == ("position", "speed", "integral")
    assert servo(profile_time=0.05).states == ("position", "speed", "goal")


def test_inputs_of_which_nothing_is_said_are_torque_on_and_the_models_supply():
    model = servo()
    assert model.u0.tolist() == [0.0, 1.0, 7.4]
    np.testing.assert_array_equal(model.input_vector({"goal_position": 0.2}), [0.2, 1.0, 7.4])
    A = linearize(model, [0.0, 0.0]).A
    np.testing.assert_allclose(A, linearize(servo(with_inputs=[]), [0.0, 0.0]).A, rtol=1e-13)
    weight = VALUES["mass"] * 9.80665 * VALUES["length"] / (VALUES["J"] + VALUES["mass"] * VALUES["length"] ** 2)
    assert linearize(model, [0.0, 0.0], [0.0, 0.0, 7.4]).A[1, 0] == pytest.approx(-weight)  # switched off
    with pytest.raises(ModelError, match=r"with_inputs: 'supplly'.*supply"):
        servo(with_inputs=["supplly"])


def test_effects_of_the_input_act_on_the_loops_error():
    """A dead band of the error: the arm stays where the goal is near, wherever the goal is."""
    model = servo({"input_deadzone": {"d": 0.1}}, with_inputs=[], mass=0.0)
    t = np.arange(0.0, 2.0, 0.01)
    end = simulate(model, t, np.full((t.size, 1), 1.0), [0.0, 0.0])["position"][-100:]
    assert np.ptp(end) < 1e-3
    assert 0.01 < abs(end[-1] - 1.0) < 0.1 + 1e-3


def log(path, kp=100, rows=200, **more):
    t = 0.005 * np.arange(rows)
    goal = 0.5 * np.sin(6 * t)
    entries = [
        {
            "position": 0.9 * g,
            "speed": 0.0,
            "load": round(kp * g) % 65536,
            "input_volts": 7.3,
            "timestamp": s,
            "goal_position": g,
            "torque_enable": True,
        }
        for s, g in zip(t.tolist(), goal.tolist(), strict=True)
    ]
    content = {"mass": 0.4, "length": 0.15, "kp": kp, "vin": 7.5, "motor": "xl330", "entries": entries, **more}
    path.write_text(json.dumps(content))
    return path


MAPPED = {"supply": "input_volts"}


def test_a_log_of_bam_holds_its_conditions_and_signed_numbers(tmp_path):
    data = read_for_model(log(tmp_path / "a.json"), servo(), MAPPED)
    assert dict(data.conditions) == {"mass": 0.4, "length": 0.15, "kp": 100.0, "vin": 7.5}
    assert data.units["goal_position"] == "rad"
    np.testing.assert_array_equal(data.u[:, 1:], np.tile([1.0, 7.3], (len(data), 1)))
    assert any("65535 is read as -1" in note for note in data.notes)
    assert any(note == "kp is 100 in this record (its file says so)" for note in data.notes)


def test_a_column_that_is_said_to_be_the_goal_is_no_state_of_that_name(tmp_path):
    """A servo with a profile has a state ``goal``, which a column of ticks was taken for as well, and refused."""
    path = tmp_path / "ticks.csv"
    path.write_text("ms,goal,pos\n0,2048,2050\n10,2058,2052\n20,2068,2055\n30,2078,2058\n")
    said = {"goal_position": "0.001 * (goal - 2048)", "position": "0.001 * (pos - 2048)"}
    data = read_for_model(path, servo(with_inputs=[], profile_time=0.08), said)
    np.testing.assert_allclose(data.u[:, 0], [0.0, 0.01, 0.02, 0.03], atol=1e-12)
    assert set(data.measured) == {"position"}


def test_where_no_supply_is_recorded_it_is_that_of_the_record(tmp_path):
    data = read_for_model(log(tmp_path / "a.json"), servo())
    np.testing.assert_array_equal(data.u[:, 2], 7.5)


def test_what_is_said_of_a_record_wins_over_its_file_and_holds_for_it_alone(tmp_path):
    one, two = log(tmp_path / "one.json"), log(tmp_path / "two.json")
    said = {"one.json:kp": "250", "vin": "6", **MAPPED}
    assert [read_for_model(p, servo(), said).conditions["kp"] for p in (one, two)] == [250.0, 100.0]
    assert read_for_model(two, servo(), said).conditions["vin"] == 6.0


def test_a_column_that_is_the_same_all_through_is_a_condition(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("t,goal_position,position,kp\n" + "".join(f"{0.01 * k},0.1,0.1,40\n" for k in range(30)))
    assert read_for_model(path, servo()).conditions == {"kp": 40.0}
    assert read_for_model(path, servo(), {"mass": "kp"}).conditions == {"kp": 40.0, "mass": 40.0}
    path.write_text("t,goal_position,position,kp\n" + "".join(f"{0.01 * k},0.1,0.1,{k}\n" for k in range(30)))
    assert read_for_model(path, servo()).conditions == {}
    with pytest.raises(RecordError, match="'kp' goes from 0 to 29; a known condition is one number a record"):
        read_for_model(path, servo(), {"mass": "kp"})


@pytest.mark.parametrize(
    ("said", "words"),
    [
        ({"kp": "-3"}, "found -3; allowed"),
        ({"ki": "5"}, "in the model it is 0: what is 0 is no part of the equations; write ki: 5 into the model file"),
        ({"mass": "weight"}, "weight"),
    ],
)
def test_conditions_that_cannot_be_are_refused(tmp_path, said, words):
    with pytest.raises(RecordError, match=words):
        read_for_model(log(tmp_path / "a.json"), servo(), {**MAPPED, **said})


@pytest.mark.parametrize(
    "text", ["[1, 2]", "{}", '{"entries": []}', '{"entries": [3]}', "{", '{"entries": [{"a": "x"}]}']
)
def test_json_that_is_no_log_is_refused_in_one_line(tmp_path, text):
    path = tmp_path / "a.json"
    path.write_text(text)
    with pytest.raises(RecordError, match=r"a\.json: "):
        read_for_model(path, servo())


def test_a_record_is_simulated_under_its_own_conditions(tmp_path):
    from signlin_ros.cli import main

    model, out = tmp_path / "servo.yaml", tmp_path / "out.csv"
    servo(kp=1.0).save(model)
    path = log(tmp_path / "a.json", kp=300)
    assert main(["simulate", str(model), str(path), "-o", str(out), "--signal", "supply=input_volts"]) == 0
    found = np.genfromtxt(out, delimiter=",", names=True)
    data = read_for_model(path, servo(), MAPPED)
    again = simulate(servo(kp=300.0, mass=0.4, length=0.15, vin=7.5), data.t, data.u, data.x0)
    np.testing.assert_allclose(found["position"], again["position"], atol=1e-9)


def simulated(kp, seed, truth=None, mass=0.5):
    """A record (ModelData) of a servo under a goal that is held for random times."""
    rng, t = np.random.default_rng(seed), 0.005 * np.arange(600)
    goal = np.repeat(rng.uniform(-1.2, 1.2, 30), 20)
    model = (truth or servo(with_inputs=[])).under({"kp": kp, "mass": mass})
    run = simulate(model, t, goal[:, None], [0.0, 0.0])
    seen = {"position": run["position"] + 1e-4 * rng.normal(size=t.size)}
    names = model.inputs, model.states
    return ModelData(
        t, goal[:, None], seen, None, *names, model.units, f"{kp:g}-{seed}", conditions={"kp": kp, "mass": mass}
    )


def test_records_are_held_out_in_turn_by_condition_or_each_by_itself():
    model = servo({"viscous_friction": {"b": 0.006}}, with_inputs=[])
    _, unseen = held_in_turn(model, [simulated(kp, seed) for kp in (100.0, 200.0, 400.0) for seed in (1, 2)])
    assert unseen.folds == ((0, 1), (2, 3), (4, 5))
    problem, unseen = held_in_turn(model, [simulated(100.0, seed) for seed in (1, 2, 3)])
    assert unseen.folds == ((0,), (1,), (2,))
    assert {"kp", "mass"} <= set(problem.base.frozen)
    assert problem.base.value("kp") == 100.0
    with pytest.raises(RecordError, match="one record only"):
        held_in_turn(model, [simulated(100.0, 1)])


@pytest.mark.slow
def test_a_hidden_law_is_named_and_a_right_model_is_left_alone():
    from signlin_ros.diagnosis.verbs import diagnose

    given = servo({"viscous_friction": {"b": 0.006}, "coulomb_friction": {"mu": 0.01}}, with_inputs=[])
    conditions = [(100.0, 0.3), (200.0, 0.5), (400.0, 0.5), (400.0, 0.3)]
    truth = given.with_effect("load_dependent_friction", kappa_d=0.25, kappa_e=0.1)
    hidden = [simulated(kp, seed, truth, mass) for seed, (kp, mass) in enumerate(conditions, 1)]
    found = diagnose(given, hidden)
    assert found.ladder[-1].effects == ("load_dependent_friction",)
    assert found.parameters["load_dependent_friction.kappa_d"].value == pytest.approx(0.25, abs=0.03)
    right = [simulated(kp, seed, given, mass) for seed, (kp, mass) in enumerate(conditions, 1)]
    assert diagnose(given, right).verdict == "adequate"


def test_records_of_a_condition_are_held_apart():
    from signlin_ros.records.conditions import held_apart

    records = [simulated(kp, 1) for kp in (100.0, 200.0, 400.0)]
    known, unseen = held_apart(records, None, {"kp": 200.0})
    assert [r.conditions["kp"] for r in known] == [100.0, 400.0]
    assert [r.conditions["kp"] for r in unseen] == [200.0]
    with pytest.raises(RecordError, match="kp=300: no record has it; kp is known to be 100, 200, 400"):
        held_apart(records, None, {"kp": 300.0})
    with pytest.raises(RecordError, match="all records have it"):
        held_apart(records, None, {"mass": 0.5})
    with pytest.raises(RecordError, match="nothing of this name is known"):
        held_apart(records, None, {"temperature": 20.0})


def test_a_record_without_speed_is_simulated_from_its_first_position(tmp_path):
    from signlin_ros.cli import main

    model, path, out = tmp_path / "servo.yaml", tmp_path / "a.csv", tmp_path / "out.csv"
    servo(with_inputs=[]).save(model)
    path.write_text("t,goal_position,position\n" + "".join(f"{0.01 * k},0.3,0.3\n" for k in range(30)))
    assert main(["simulate", str(model), str(path), "-o", str(out), "--set", "kp=200", "--set", "mass=0"]) == 0
    np.testing.assert_allclose(np.genfromtxt(out, delimiter=",", names=True)["position"], 0.3, atol=1e-12)


def kept_apart(kp):
    """Return a record of a servo with a gain."""
    return of_gain(servo(with_inputs=()), kp)


def of_gain(model, kp):
    """Return a record of a model with a gain."""
    from dataclasses import replace

    model = model.with_parameters({"kp": kp})
    t = np.arange(0.0, 2.0, 0.01)
    u = np.tile(model.u0, (t.size, 1))
    u[:, 0] = 0.5 * np.sin(3.0 * t)
    run = simulate(model, t, u, np.zeros(len(model.states)))
    data = ModelData(
        t,
        u,
        {"position": run["position"] + 1e-4 * np.sin(50.0 * t)},
        np.zeros(len(model.states)),
        model.inputs,
        model.states,
        model.units,
        f"kp{kp:g}.csv",
    )
    return replace(data, conditions={"kp": kp})


def test_hold_out_makes_records_of_a_condition_validation_data_in_python_too():
    from signlin_ros import compare

    records = [kept_apart(kp) for kp in (100.0, 200.0, 400.0)]
    model = servo(with_inputs=()).with_options(input_hold="forward")
    found = compare(model, records, hold_out={"kp": 200.0})
    assert found.sources == ("kp100.csv", "kp400.csv")
    with pytest.raises(RecordError, match="kp=300: no record has it; kp is known to be 100, 200, 400"):
        compare(model, records, hold_out={"kp": 300.0})


@pytest.mark.parametrize(
    ("shown", "factor", "consistent"), [(1.0, 2 * np.pi, False), (57.3, 57.3, True), (1.0, -1.0, True)]
)
def test_a_position_in_a_loop_is_in_a_unit_in_which_it_comes_to_its_goal(shown, factor, consistent):
    model, record = servo(with_inputs=(), kp=400.0), simulated(400.0, 1)
    measured = {**record.measured, "position": shown * record.measured["position"]}
    look = Look(model, replace(record, measured=measured))
    assert _consistent(look, {"position": factor}) == consistent


def with_load(said, true, full=885.0):
    """Return a record of a servo whose log holds what its loop puts out; ``said``: the gain that is stated."""
    from dataclasses import replace

    model = servo(kp=true, with_inputs=())
    data = kept_apart(true)
    duty = model.parameters["duty_per_error"] * true * (data.u[:, 0] - data.measured["position"])
    return replace(data, conditions={"kp": said}, beside={"load": np.round(full * np.clip(duty, -1.0, 1.0))})


def loop_output(records):
    from signlin_ros.checks.loop_output import LoopOutput
    from signlin_ros.checks.run import check

    return check(servo(with_inputs=()), records, ["none"], kinds=[LoopOutput])[1]


def test_the_output_of_the_loop_is_held_against_gain_and_error():
    records = [with_load(kp, kp) for kp in (100.0, 200.0, 400.0)]
    found = loop_output(records)
    assert [f.severity for f in found] == ["note"] * 3
    assert all("885 of it full duty" in f.sentence for f in found)


def test_a_gain_that_the_output_contradicts_is_told():
    records = [with_load(said, 200.0) for said in (200.0, 200.0, 400.0)]
    *_, wrong = loop_output(records)
    assert wrong.severity == "offer"
    assert "the gain is rather 200" in wrong.sentence


def test_what_does_not_follow_the_error_is_no_output_of_the_loop():
    from dataclasses import replace

    record = with_load(200.0, 200.0)
    found = loop_output([replace(record, beside={"load": 100.0 + 50.0 * np.cos(9.0 * record.t)})])
    assert "is not what the loop puts out" in found[0].sentence


@pytest.mark.slow
def test_warm_compiles_the_laws_that_are_tried_on_records(monkeypatch):
    from signlin_ros.cli.warming import warm_laws
    from signlin_ros.fitting.candidate import candidate
    from signlin_ros.follow.equations import equations

    asked, true = [], equations
    monkeypatch.setattr("signlin_ros.fitting.candidate.equations", lambda *a: asked.append(a) or true(*a))
    model = Model.load("xl330_servo")
    warm_laws(model)
    compiled = set(asked)
    problem, _ = held_in_turn(model, [of_gain(model, kp) for kp in (100.0, 400.0)])
    candidate(problem, problem.base, ())
    more = problem.base.with_effect("load_dependent_friction", "load_dependent_friction", kappa_d=0.1, kappa_e=0.1)
    candidate(problem, more, ("load_dependent_friction",))
    assert set(asked) == compiled


def test_tables_of_several_records_have_names_of_their_own():
    from signlin_ros import compare

    columns = [
        {"t": r.t, "goal_position": r.u[:, 0], "position": r.measured["position"]}
        for r in map(kept_apart, (400.0, 400.0))
    ]
    found = compare(servo(with_inputs=()), columns, cures=["none"])
    assert found.sources == ("table 1", "table 2")


WAYS = {"degrees": (180.0 / np.pi, 0.0, slice(0, 2)), "counts": (2048.0 / np.pi, 2048.0, slice(2, 4))}
"""How many of it a rad is, what it is at 0 rad, and where in a refusal it is said how to say so."""


@pytest.mark.parametrize("kp", [100.0, 400.0, 1600.0])
def test_positions_that_no_motor_follows_are_told_and_those_in_rad_never_are(kp):
    model = servo(with_inputs=[], kp=kp)
    for seed in range(20):
        run = simulated(kp, seed)
        assert not list(TooFast().find(Look(model, run)))
        for scale, zero, _ in WAYS.values():
            measured = {"position": scale * run.measured["position"] + zero}
            (found,) = TooFast().find(Look(model, replace(run, u=scale * run.u + zero, measured=measured)))
            assert (found.severity, found.channel) == ("refuse", "position")


@pytest.mark.parametrize("way", WAYS)
def test_what_is_said_of_the_unit_of_a_servo_reads_it(way, tmp_path):
    model, run = servo(with_inputs=[]), simulated(400.0, 1)
    scale, zero, place = WAYS[way]
    rows = zip(run.t, scale * run.u[:, 0] + zero, scale * run.measured["position"] + zero, strict=True)
    file = tmp_path / "run.csv"
    file.write_text("\n".join(["t,goal_position,present", *(f"{t:.3f},{g:.9g},{x:.9g}" for t, g, x in rows)]) + "\n")
    (found,) = TooFast().find(Look(model, read_for_model(file, model, {"position": "present"})))
    said = dict(part.split(" = ", 1) for part in re.findall(r"--signal '(.*?)'", found.sentence)[place])
    data = read_for_model(file, model, said)
    np.testing.assert_allclose(data.measured["position"], run.measured["position"], atol=1e-5)
    np.testing.assert_allclose(data.u[:, 0], run.u[:, 0], atol=1e-5)
