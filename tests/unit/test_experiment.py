"""The next experiment: its parts, limits and rivals; a tie that is planned for, recorded and decided."""

from __future__ import annotations

import json
import re
import time
from dataclasses import replace
from importlib import resources
from types import SimpleNamespace

import jsonschema
import numpy as np
import pytest
import yaml

from signlin_ros import cli
from signlin_ros.diagnosis.criteria import DEFAULT_CRITERIA
from signlin_ros.diagnosis.dataset import dataset_of
from signlin_ros.diagnosis.output_error import FitCache, estimator_of
from signlin_ros.diagnosis.progress import CancelledError
from signlin_ros.diagnosis.rivals import rival
from signlin_ros.effects import EFFECTS
from signlin_ros.errors import InputError
from signlin_ros.experiment import setting
from signlin_ros.experiment.chain import MOST_COMMANDS, _added, _of_length, chained
from signlin_ros.experiment.common_scale import force_power, with_larger_forces
from signlin_ros.experiment.contenders import Contender, contender
from signlin_ros.experiment.distance import RivalBench
from signlin_ros.experiment.families import COMMAND_FAMILIES
from signlin_ros.experiment.limits import limits_of
from signlin_ros.experiment.minima import led_by, overlap
from signlin_ros.experiment.naming import open_names, with_named
from signlin_ros.experiment.parts import PART_KINDS, Part, in_words, rendered, slowed
from signlin_ros.experiment.plan import ExperimentPlan
from signlin_ros.experiment.search import NEEDED_EVIDENCE, CommandSearch, changed
from signlin_ros.experiment.setting import KnownLimits, bench_of, chosen
from signlin_ros.experiment.verbs import ended, experiment
from signlin_ros.fitting.problem import prepare
from signlin_ros.follow.data import load_sides
from signlin_ros.model import Model
from signlin_ros.nodes.diagnosing import Planning
from signlin_ros.simulation import simulate

DT = 0.005
T = DT * np.arange(1000)


def run(*arguments):
    return cli.main([str(a) for a in arguments])


# -------------------------------------------------------------------- parts of a command


@pytest.mark.parametrize("kind", [*PART_KINDS])
def test_a_part_stays_within_its_peak_and_comes_near_it(kind):
    values = Part(kind, 2.0, 2.0).values(np.arange(0.0, 2.0, 0.001), 2.0)
    assert np.abs(values).max() <= 2.0 + 1e-9
    assert np.abs(values).max() > 1.5 or kind == "rest"


@pytest.mark.parametrize("family", COMMAND_FAMILIES, ids=lambda f: f.name)
def test_a_command_rests_at_both_ends(family):
    u = rendered(family.at(3.0), T)
    assert np.all(u[:20] == 0.0)
    assert np.all(u[-20:] == 0.0)
    assert 2.0 < np.abs(u).max() <= 3.0 + 1e-9


@pytest.mark.parametrize("slew", [1.0, 20.0, 500.0])
def test_a_slew_limit_is_kept_and_the_ends_stay_at_rest(slew):
    u = rendered((Part("steps", 3.0, 1.0), Part("chirp", 2.0, 8.0)), T, slew)
    assert np.abs(np.diff(u)).max() <= slew * DT * (1.0 + 1e-9)
    assert u[0] == 0.0
    assert abs(u[-1]) <= slew * DT


def test_a_command_that_is_slow_enough_is_not_changed_by_a_slew_limit():
    u = np.sin(np.pi * T / T[-1])
    np.testing.assert_allclose(slowed(u, T, 10.0), u, atol=1e-12)


def test_changed_parts_keep_the_largest_peak():
    g, parts = np.random.default_rng(0), COMMAND_FAMILIES[0].at(2.0)
    for _ in range(50):
        parts = changed(g, parts)
        assert max(abs(p.peak) for p in parts) <= 2.0
    assert "V" in in_words(parts, 5.0, "V")


def test_every_text_of_an_effect_that_is_proposed_has_a_family_or_is_met_by_all():
    families = {family.name for family in COMMAND_FAMILIES}
    assert {e.command for e in EFFECTS.values()} - {""} <= families
    without = {n for n, e in EFFECTS.items() if e.experiment and e.proposed and not e.command}
    assert without == set()


# -------------------------------------------------------------------- a tie


def given():
    model = Model.load("dc_motor").without_effect("coulomb_friction").with_parameters({"B": 2e-4})
    return model.with_options(tolerance=0.05)


def recorded(folder, name, model, t, u, seed, skip=0):
    found = simulate(model, t, u[:, None])
    g = np.random.default_rng(seed)
    i, w = (found[c][skip:] + sd * g.standard_normal(t.size - skip) for c, sd in (("current", 0.05), ("speed", 0.4)))
    table = np.column_stack([t[skip:] - t[skip], u[skip:], i, w])
    np.savetxt(folder / name, table, delimiter=",", header="t,voltage,current,speed", comments="", fmt="%.7g")
    return folder / name


@pytest.fixture(scope="module")
def one_way(tmp_path_factory):
    """A motor that turned one way: dry friction is a load there."""
    folder = tmp_path_factory.mktemp("one_way")
    given().save(folder / "model.yaml")
    u = (3.5 + np.sin(2 * np.pi * 1.3 * T) + 0.5 * np.sin(2 * np.pi * 3.1 * T)) * np.clip(T / 0.2, 0, 1)
    true = given().with_effect("coulomb_friction", mu=0.03)
    recorded(folder, "first.csv", true, T, u, 1, skip=60)
    return folder


BETWEEN = ("--between", "coulomb_friction,constant_load")


@pytest.mark.slow
def test_a_size_that_the_first_record_leaves_open_is_the_least_of_interest(one_way):
    """Where it never turned slowly, a breakaway friction of 6 N·m would have shown nothing, and no command moved it."""
    model, data, _ = load_sides(Model.load(one_way / "model.yaml"), [one_way / "first.csv"], ())
    bench = bench_of(model, data, with_named([], model, data, ["stribeck_friction"]))
    (c,) = bench.contenders
    values = c.candidate.named(c.theta)
    assert values["stribeck_friction.excess"] == pytest.approx(c.size.least)
    assert c.size.least < 0.01
    ends = [c.candidate.named(one) for one in c.minima]  # nor does the record say how fast it fades
    told = [values["stribeck_friction.v_s"], *(one["stribeck_friction.v_s"] for one in ends)]
    assert (min(told), max(told)) == pytest.approx(c.size.bounds["stribeck_friction.v_s"])
    assert all(one["stribeck_friction.excess"] == pytest.approx(c.size.least) for one in ends)
    started = [m.effects["stribeck_friction"].parameters["v_s"] for m in c.planned().starts]
    assert min(started) == pytest.approx(min(told))
    shown = bench.segment(
        0, bench.run(0, T, np.sin(np.pi * T), c.minima[0]), c.minima[0]
    )  # and a refit comes back to either end
    assert bench.refitted(0, shown)[0] < NEEDED_EVIDENCE < bench.refitted(0, shown, [c.theta])[0]


@pytest.fixture(scope="module")
def planned(one_way):
    out = one_way / "next.csv"
    arguments = ("experiment", one_way / "model.yaml", one_way / "first.csv", *BETWEEN)
    assert run(*arguments, "--limit", "voltage=6,speed=60", "-o", out, "--report", one_way / "next.html") == 0
    return out


@pytest.mark.slow
def test_a_plan_is_at_rest_at_both_ends_and_within_its_limits_for_either_rival(planned):
    t, u = np.loadtxt(planned, delimiter=",", skiprows=1).T
    assert u[0] == u[-1] == 0.0
    assert np.abs(u).max() <= 6.0
    for name, values in (("coulomb_friction", {"mu": 0.03}), ("constant_load", {"F0": -0.03})):
        shown = simulate(given().with_effect(name, **values), t, u[:, None])
        assert np.abs(shown["speed"]).max() <= 60.0


@pytest.mark.slow
def test_a_plan_decides_what_the_first_record_could_not(one_way, planned, capsys):
    t, u = np.loadtxt(planned, delimiter=",", skiprows=1).T
    true = given().with_effect("coulomb_friction", mu=0.03)
    files = [recorded(one_way, f"{n}.csv", true, t, u, seed) for n, seed in (("run", 2), ("again", 3))]
    capsys.readouterr()
    first = ("diagnose", one_way / "model.yaml", one_way / "first.csv")
    rivals = ("--rivals", planned.with_suffix(".rivals.json"))
    assert run(*first, files[0], "--validation", files[1], *rivals, "--json") == 0
    content = json.loads(capsys.readouterr().out)
    assert content["ladder"][-1]["effects"] == ["coulomb_friction"]
    status = {e["effect"]: e["status"] for e in content["ranking"]}
    assert status["coulomb_friction"] == "confirmed"
    assert status["constant_load"] == "rejected"
    assert "Refitted from the values of the plan constant load loses by" in content["sentence"]


@pytest.mark.slow
def test_the_same_seed_gives_the_same_file_and_the_json_keeps_its_schema(one_way, planned, tmp_path, capsys):
    arguments = ("experiment", one_way / "model.yaml", one_way / "first.csv", *BETWEEN)
    capsys.readouterr()
    assert run(*arguments, "--limit", "voltage=6,speed=60", "-o", tmp_path / "again.csv", "--json") == 0
    assert (tmp_path / "again.csv").read_bytes() == planned.read_bytes()
    content = json.loads(capsys.readouterr().out)
    place = resources.files("signlin_ros") / "schemas" / "experiment.json"
    jsonschema.validate(content, json.loads(place.read_text(encoding="utf-8")), cls=jsonschema.Draft202012Validator)
    (pair,) = content["pairs"]
    assert content["verdict"] == "enough"
    assert pair["expected"] >= 60.0 > pair["so_far"]
    assert f"{pair['expected']:.3g}" in content["sentence"]


@pytest.mark.slow
def test_the_report_has_a_preview_of_both_rivals(one_way, planned):
    assert planned.exists()
    text = (one_way / "next.html").read_text(encoding="utf-8")
    assert "Coulomb friction" in text
    assert "signlin diagnose" in text
    assert (one_way / "next_files" / "preview_1.png").exists()


@pytest.fixture(scope="module")
def tie(one_way):
    """What the JSON of a diagnosis of the first record tells of a tie, and the record."""
    model, data, _ = load_sides(Model.load(one_way / "model.yaml"), [one_way / "first.csv"], ())
    made = dataset_of(model, data)
    motion = estimator_of(made.training, made.validation, DEFAULT_CRITERIA, FitCache(), jobs=1)
    rivals = [rival(motion.fitted([name])).to_json() for name in ("coulomb_friction", "constant_load")]
    content = {"ranking": [], "ladder": [{"effects": ["coulomb_friction"]}], "rivals": rivals}
    return content | {"given_model": made.model.to_yaml(), "data": ["first.csv"]}, data


@pytest.mark.slow
def test_a_plan_that_somebody_stops_ends_soon(tie):
    content, data = tie
    asked, told = [], []

    def cancelled():
        asked.append(1)
        return len(asked) > 50

    with pytest.raises(CancelledError):
        experiment(content, data, {"voltage": 6.0}, progress=lambda what, share: told.append(what), cancelled=cancelled)
    assert len(asked) == 51
    assert told[0] == "rivals"


@pytest.mark.slow
def test_the_json_of_a_diagnosis_is_planned_for_in_a_process_of_its_own(one_way, tie, tmp_path):
    content, _ = tie
    (tmp_path / "verdict.json").write_text(json.dumps(content))
    (tmp_path / "first.csv").write_bytes((one_way / "first.csv").read_bytes())
    planning = Planning(tmp_path)
    while planning.running:
        time.sleep(0.05)
    plan = planning.result()
    assert plan["rivals"] == ["Coulomb friction", "constant load"]
    assert (tmp_path / "next.csv").exists()


def test_what_ties_and_was_not_fitted_is_planned_for():
    row = {"effect": "coulomb_friction", "status": "ambiguous", "indistinguishable_from": ["constant_load"]}
    kin = {"effect": "stribeck_friction", "status": "rejected", "indistinguishable_from": []}
    content = {"ladder": [{"effects": ["coulomb_friction"]}], "ranking": [row, kin]}
    content["rivals"] = [{"effects": ["coulomb_friction"]}]
    assert open_names(content) == ["constant_load", "stribeck_friction"]


def test_a_law_that_takes_most_of_the_force_away_is_planned_for():
    named = {"effect": "gravity_load", "status": "confirmed", "indistinguishable_from": [], "parameters": {}}
    left = {"linear_stiffness": 4.0, "cubic_stiffness": 30.0, "viscous_friction": 80.0}
    rows = [{**named, "effect": n, "status": "rejected", "missing_force_percent": x} for n, x in left.items()]
    ladder = [{"effects": [], "missing_force_percent": 88.0}, {"effects": ["gravity_load"]}]
    content = {"ladder": ladder, "ranking": [named, *rows], "rivals": [{"effects": ["gravity_load"]}]}
    assert open_names(content) == ["linear_stiffness", "cubic_stiffness"]


def test_a_law_with_a_size_of_interest_is_looked_at_beside_a_simpler_one_of_its_family():
    load = {"effect": "constant_load", "status": "ambiguous", "indistinguishable_from": ["coulomb_friction"]}
    rows = [{"effect": n, "status": "rejected", "indistinguishable_from": []} for n in
            ("lugre_friction", "stribeck_friction", "dahl_presliding")]  # fmt: skip
    fitted = [{"effects": [n]} for n in ("constant_load", "coulomb_friction", "viscous_friction", "play_friction")]
    content = {"ladder": [{"effects": ["constant_load"]}], "ranking": [load, *rows], "rivals": fitted}
    assert open_names(content) == ["dahl_presliding", "stribeck_friction"]


def test_where_nothing_ties_the_best_of_what_was_rejected_is_looked_at():
    rows = [{"effect": n, "status": "rejected", "indistinguishable_from": [], "parameters": {"x": 1.0}}
            for n in ("linear_stiffness", "hard_stop")]  # fmt: skip
    rows.insert(0, {"effect": "gravity_load", "status": "confirmed", "indistinguishable_from": [], "parameters": {}})
    content = {"ladder": [{"effects": ["gravity_load"]}], "ranking": rows, "rivals": [{"effects": ["gravity_load"]}]}
    assert open_names(content) == ["linear_stiffness", "hard_stop"]


def test_a_richer_law_starts_from_the_simpler_one_that_it_contains():
    found = led_by("lugre_friction", "stribeck_friction", {"mu": 0.02, "excess": 0.005, "v_s": 3.0})
    assert found == {"F_c": 0.02, "F_s": 0.025, "v_s": 3.0}
    assert led_by("coulomb_friction", "stribeck_friction", {"mu": 0.02}) == {}
    assert led_by("backlash", "compliant_load", {}) == {}


@pytest.mark.parametrize(
    ("one", "other", "same"),
    [
        ("hard_stop", "linear_stiffness", True),
        ("hard_stop", "bouc_wen_hysteresis", True),
        ("backlash", "compliant_load", True),
        ("gravity_load", "linear_stiffness", False),
        ("input_delay", "sensor_delay", False),
    ],
)
def test_laws_that_are_the_same_for_some_values_are_known(one, other, same):
    assert overlap(one, other) == overlap(other, one) == same


def test_what_is_far_behind_is_to_lose_but_is_not_thought_to_be_true():
    bench = RivalBench(None, (None,) * 4, None, None, {}, behind=np.array([30.0, 0.0, 5.0, np.nan]))
    assert len(bench.pairs) == 12
    assert setting.likely_ones(bench) == {0, 1, 2}
    pairs = replace(bench, likely=setting.likely_ones(bench)).pairs
    assert {i for i, _ in pairs} == {0, 1, 2}
    assert {j for _, j in pairs} == {0, 1, 2, 3}


def test_of_each_family_the_simplest_laws_are_planned_for():
    def known(effect, size):
        return KnownLimits((effect,), None, ("p",) * size, np.eye(size))

    rivals = [known("lugre_friction", 6), known("constant_load", 1), known("stribeck_friction", 3)]
    rivals += [known("dahl_presliding", 2), known("coulomb_friction", 1), known("play_friction", 3)]
    kept, rest = chosen(rivals)
    assert [r.effects[0] for r in kept][:2] == ["lugre_friction", "constant_load"]
    assert "coulomb_friction" in {r.effects[0] for r in kept}
    assert "dahl_presliding" in {r.effects[0] for r in kept}
    assert len(rest) == 1


# -------------------------------------------------------------------- several commands in one record


def test_parts_of_a_record_keep_their_share_beside_each_other():
    parts = _of_length([Part("sine", 1.0, 1.0, 2.0), Part("hold", 1.0, 1.0, 1.0), Part("rest", 0.0, 1.0, 1.0)], 2.0)
    assert [p.share for p in parts] == [1.0, 0.5, 0.5]


def test_commands_are_added_by_what_they_bring_the_pairs_that_lack_most():
    now, none = np.array([5.0, 20.0, 200.0]), np.zeros(3)
    first, second = np.array([100.0, 0.0, 500.0]), np.array([0.0, 70.0, 0.0])
    assert _added(now, [none, second, first]) == [2, 1]
    assert _added(now, [none]) == []
    assert _added(now, []) == []


def test_the_pair_that_is_told_apart_least_gets_a_command_before_more_is_shown_of_many():
    """A sum of distances preferred the one that shows more of two pairs, and left the third at 28."""
    now, many, one = np.array([9.0, 0.0, 13.0]), np.array([34.0, 41.0, 15.0]), np.array([9.0, 7.0, 37.0])
    assert _added(now, [many, one])[:2] == [0, 1]


@pytest.fixture(scope="module")
def searched(one_way):
    """The search of a record for three laws of dry friction."""
    model, data, _ = load_sides(Model.load(one_way / "model.yaml"), [one_way / "first.csv"], ())
    names = ["coulomb_friction", "stribeck_friction", "dahl_presliding"]
    bench = bench_of(model, data, with_named([], model, data, names))
    return ended(CommandSearch(bench, limits_of(bench.problem, {"voltage": 1.0}), T[:400], 0.2, lambda what, share: 0))


@pytest.mark.slow
def test_commands_one_after_the_other_show_more_and_rest_at_the_ends(searched):
    """As if machines that are drawn had told of two pairs apart less than is asked for."""
    hard = [replace(one, expected=20.0) for one in searched.told[:2]]
    longer = chained(replace(searched, told=(*hard, *searched.told[2:])))
    assert longer.best.u.size in [400 * count for count in range(2, MOST_COMMANDS + 1)]
    assert longer.best.u[0] == longer.best.u[-1] == 0.0
    assert longer.best.share <= 0.8
    assert longer.best.parts[0].kind == searched.best.parts[0].kind
    assert [one.rivals for one in longer.told] == [one.rivals for one in searched.told]
    for one, before in zip(longer.told, searched.told, strict=True):
        assert one.expected > before.expected
        assert one.most >= one.expected


@pytest.mark.slow
def test_a_command_that_is_enough_is_not_followed_by_another(searched):
    sure = tuple(replace(one, expected=100.0) for one in searched.told)
    first = replace(searched, told=sure)
    found = chained(first)
    assert found.best is first.best
    assert found.told == sure


# -------------------------------------------------------------------- what no command tells


@pytest.mark.slow
def test_a_weight_and_a_spring_are_alike_within_a_small_travel_and_the_remedy_is_named(tmp_path, capsys):
    base = given().with_parameters({"L_a": 0.0}).with_options(with_position=True)
    base = base.with_effect("coulomb_friction", mu=0.004)
    base.save(tmp_path / "model.yaml")
    u = 0.15 * np.sin(2 * np.pi * (0.1 * T + 0.12 * T * T)) * np.clip(T / 0.2, 0, 1)
    q = simulate(base.with_effect("gravity_load", A=0.08, q0=0.0), T, u[:, None])["position"]
    noisy = q + 0.0015 * np.random.default_rng(4).standard_normal(T.size)
    table = np.column_stack([T, u, noisy])
    np.savetxt(tmp_path / "first.csv", table, delimiter=",", header="t,voltage,position", comments="", fmt="%.8g")
    arguments = ("experiment", tmp_path / "model.yaml", tmp_path / "first.csv", "-o", tmp_path / "next.csv", "--json")
    rivals = ("--between", "gravity_load,linear_stiffness")
    capsys.readouterr()
    assert run(*arguments, *rivals, "--limit", "voltage=6,speed=80,travel=0.2") == 0
    content = json.loads(capsys.readouterr().out)
    assert content["verdict"] == "none"
    assert content["sentence"].startswith("No command within these limits tells gravity load from linear stiffness")
    assert run(*arguments, *rivals, "--limit", "voltage=6,speed=80,travel=1.5") == 0
    content = json.loads(capsys.readouterr().out)
    assert content["verdict"] == "enough"


SYMMETRIC = [
    (
        "constant_load,input_offset",
        {"coulomb_friction": {"mu": 0.02}},
        {"input_offset": {"u0": -0.12}},
        {"L_a": 0.0026},
    ),
    ("nothing,viscous_friction", {}, {"viscous_friction": {"b": 0.0015}}, {"B": 0.0, "L_a": 0.0}),
]
"""An amplifier's offset, and a load; a back-EMF that nobody knows, and viscous friction: the speed shows the same."""


@pytest.mark.slow
@pytest.mark.parametrize(("pair", "known", "hidden", "parameters"), SYMMETRIC, ids=[one[0] for one in SYMMETRIC])
def test_a_symmetry_is_said_and_only_the_sensor_that_breaks_it_is_a_remedy(
    pair, known, hidden, parameters, tmp_path, capsys
):
    model = Model.load("dc_motor").without_effect("coulomb_friction").with_parameters(parameters)
    model = model.with_options(tolerance={"R_a": 0.05, "K_t": 0.05, "J": 0.05, "K_m": 1.0})
    for name, values in known.items():
        model = model.with_effect(name, **values)
    true = model
    for name, values in hidden.items():
        true = true.with_effect(name, **values)
    u = 4.0 * np.sin(2 * np.pi * (0.3 * T + 0.4 * T * T)) * np.clip(T / 0.2, 0, 1)
    speed = simulate(true, T, u[:, None])["speed"] + 0.4 * np.random.default_rng(1).standard_normal(T.size)
    model.save(tmp_path / "model.yaml")
    np.savetxt(
        tmp_path / "first.csv", np.column_stack([T, u, speed]), delimiter=",", header="t,voltage,speed", comments=""
    )
    rivals, limits = ("--between", pair), ("--limit", "voltage=6,speed=80")
    capsys.readouterr()
    files = (tmp_path / "model.yaml", tmp_path / "first.csv", "-o", tmp_path / "next.csv")
    assert run("experiment", *files, *rivals, *limits, "--json") == 0
    content = json.loads(capsys.readouterr().out)
    assert content["verdict"] == "none"
    assert [one["alike"] for one in content["pairs"]] == [True]
    assert [one["what"].split(" (")[0] for one in content["remedies"]] == ["record the current too"]


@pytest.mark.parametrize(
    ("unit", "power"),
    [("N·m/A", 1), ("kg·m²", 1), ("N·m·s/rad", 1), ("V·s/rad", 0), ("Ohm", 0), ("1/N", -1), ("", 0), ("N/N", 0)],
)
def test_the_power_of_the_force_in_a_unit(unit, power):
    assert force_power(unit) == power


@pytest.mark.slow
def test_a_common_scale_of_all_forces_is_a_symmetry_that_a_known_inertia_breaks(one_way, tmp_path, capsys):
    files = (one_way / "model.yaml", one_way / "first.csv", "-o", tmp_path / "next.csv", "--json")
    rivals, limits = ("--between", "coulomb_friction,coulomb_friction+all_forces"), ("--limit", "voltage=6,speed=80")
    capsys.readouterr()
    assert run("experiment", *files, *rivals, *limits) == 0
    content = json.loads(capsys.readouterr().out)
    assert content["verdict"] == "none"
    (pair,) = content["pairs"]
    assert pair["alike"]
    assert pair["most"] < 1.0
    told = "No command within these limits tells Coulomb friction from Coulomb friction with all forces"
    assert told in content["sentence"]
    (remedy,) = content["remedies"]
    added = float(re.fullmatch(r"add a known inertia of (\S+) kg·m²", remedy["what"])[1])
    assert remedy["distance"] >= 10.0
    t, u = np.loadtxt(tmp_path / "next.csv", delimiter=",", skiprows=1).T
    own = given().parameters
    shown = []
    for scale in (1.0, 1.1):
        more = {"J": scale * own["J"] + added, "K_t": scale * own["K_t"], "B": scale * own["B"]}
        model = given().with_parameters(more).with_effect("coulomb_friction", mu=0.03 * scale)
        shown.append(simulate(model, t, u[:, None])["speed"] / 0.4)
    assert np.sum((shown[1] - shown[0]) ** 2) > 10.0


@pytest.mark.slow
def test_a_scale_of_forces_shows_where_the_input_is_a_force(tmp_path, capsys):
    model = Model.load("mass_spring_damper").without_effect("coulomb_friction").with_options(tolerance=0.05)
    model.save(tmp_path / "model.yaml")
    u = 3.0 * np.sin(2 * np.pi * (0.3 * T + 0.3 * T * T))
    found = simulate(model.with_effect("coulomb_friction", mu=0.3), T, u[:, None])
    g, names = np.random.default_rng(1), ("displacement", "velocity")
    shown = [found[c] + sd * g.standard_normal(T.size) for c, sd in zip(names, (1e-3, 0.01), strict=True)]
    head = "t,force,displacement,velocity"
    np.savetxt(tmp_path / "first.csv", np.column_stack([T, u, *shown]), delimiter=",", header=head, comments="")
    files = (tmp_path / "model.yaml", tmp_path / "first.csv", "-o", tmp_path / "next.csv", "--json")
    rivals = ("--between", "coulomb_friction,coulomb_friction+all_forces")
    capsys.readouterr()
    assert run("experiment", *files, *rivals, "--limit", "force=5,displacement=1") == 0
    assert json.loads(capsys.readouterr().out)["verdict"] == "enough"


def test_a_scale_of_forces_that_is_known_is_no_rival(problem):
    base = problem.base.with_options(frozen=("J",))
    with pytest.raises(InputError, match="no inertia that is free"):
        with_larger_forces([contender(replace(problem, base=base), base, (), None)], [False])


# -------------------------------------------------------------------- limits, and what is refused


@pytest.fixture(scope="module")
def problem(one_way):
    model, data, _ = load_sides(Model.load(one_way / "model.yaml"), [one_way / "first.csv"], ())
    return prepare(model, data)


def test_limits_that_nobody_gave_are_what_the_first_record_visited(problem):
    found = limits_of(problem, {"voltage": 9.0})
    assert found.input == 9.0
    assert found.assumed == ("speed",)
    assert found.states["speed"] == pytest.approx(max(map(abs, problem.ranges["speed"])))


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({"voltag": 3.0}, "unknown name 'voltag'"),
        ({"speed": -1.0}, "allowed: a positive number"),
        ({"speed": 1.0, "velocity": 2.0}, "given twice"),
    ],
)
def test_a_limit_that_cannot_be_is_refused(problem, given, told):
    with pytest.raises(InputError, match=told):
        limits_of(problem, given)


def test_a_diagnosis_of_an_older_version_is_refused_with_the_command_to_repeat(tmp_path, capsys):
    (tmp_path / "old.json").write_text(json.dumps({"verdict": "missing", "ranking": []}))
    assert run("experiment", tmp_path / "old.json", "-o", tmp_path / "next.csv") == 2
    assert "repeat: signlin diagnose MODEL DATA... --json" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("between", "told"),
    [("coulomb_friction", "name two rivals"), ("coulomb_friction,colomb", "unknown effect 'colomb'")],
)
def test_rivals_that_are_none_are_refused(one_way, tmp_path, capsys, between, told):
    arguments = ("experiment", one_way / "model.yaml", one_way / "first.csv", "--between", between)
    assert run(*arguments, "-o", tmp_path / "next.csv") == 2
    err = capsys.readouterr().err
    assert told in err
    assert len(err.strip().splitlines()) == 1


# -------------------------------------------------------------------- a reference of a closed loop


def test_a_reference_is_written_as_a_trajectory_message():
    t = 0.5 * np.arange(4)
    told = {"verdict": "enough", "sentence": "", "words": "", "input": "goal_position", "unit": "rad", "rivals": ()}
    none = {"pairs": (), "families": (), "limits": {}, "assumed": (), "visits": {}, "units": {}, "smallest": {}}
    plan = ExperimentPlan(t=t, u=np.array([0.0, 1.0, 1.0, 0.0]), spare=0.2, reference=True, **told, **none)
    message = yaml.safe_load(plan.to_trajectory("elbow"))
    assert message["joint_names"] == ["elbow"]
    assert [p["positions"] for p in message["points"]] == [[0], [1], [1], [0]]
    assert message["points"][3]["time_from_start"] == {"sec": 1, "nanosec": 500000000}
    np.testing.assert_allclose([p["velocities"][0] for p in message["points"]], [2.0, 1.0, -1.0, -2.0])
    assert plan.to_csv().splitlines()[:2] == ["t,goal_position", "0,0"]


# -------------------------------------------------------------------- points beside an estimate


def test_a_rival_that_nothing_moves_is_planned_for_at_its_size_of_interest_or_left_out(problem):
    """A machine that turned all the time may have been fitted with any friction at rest: 957 N·m of a motor, and then
    no command under which every rival moves was within the limits.
    """
    stuck = {"stribeck_friction": {"mu": 0.03, "excess": 900.0, "v_s": 7.5}, "coulomb_friction": {"mu": 900.0}}
    every = [contender(problem, given().with_effect(n, **values), (n,), None) for n, values in stuck.items()]
    x0 = dict(zip(problem.base.states, problem.base.x0.tolist(), strict=True))
    bench = RivalBench(problem, tuple(every), setting.gains_of(problem), problem.noise, x0)
    found, held = setting.movable(bench, limits_of(problem, {"voltage": 6.0, "speed": 60.0}))
    assert held == {1}
    c = found.contenders[0]
    assert c.candidate.named(c.theta)["stribeck_friction.excess"] == pytest.approx(c.size.least)
    assert found.behind[0] < found.behind[1]
    assert setting.movable(replace(bench, contenders=found.contenders[:1]), limits_of(problem, {}))[1] == frozenset()


@pytest.mark.parametrize("theta", [[0.0, 0.0], [-1.0, 0.0], [-0.9, 0.3], [1.0, 1.0]])
def test_points_beside_an_estimate_are_within_bounds_and_a_standard_error_away_at_most(theta):
    low, high = -np.ones(2), np.ones(2)
    along, across = np.array([1.0, -1.0]) / np.sqrt(2), np.array([1.0, 1.0]) / np.sqrt(2)
    information = 4.0 * np.outer(along, along) + 1e4 * np.outer(across, across)  # only the difference is unknown
    c = Contender((), SimpleNamespace(bounds=(low, high)), np.array(theta), information)
    for x in c.sigma_points:
        assert np.all((x >= low - 1e-12) & (x <= high + 1e-12))
        assert (x - theta) @ information @ (x - theta) <= 1.0 + 1e-9
    for x in c.drawn(np.random.default_rng(1), 50):
        assert np.all((x >= low - 1e-12) & (x <= high + 1e-12))


@pytest.mark.parametrize(("theta", "at"), [([0.4, 0.0], 0), ([0.9, 0.0], 1), ([0.6, 0.0], 0)])
def test_what_is_known_about_one_minimum_is_not_asked_of_another(theta, at):
    """The last one is nearer to the second, which the first records leave behind."""
    every = (np.zeros(2), np.array([1.0, 0.0]))
    c = Contender((), SimpleNamespace(), every[0], 9.0 * np.eye(2), minima=every[1:], behind=(4.0,))
    found, behind = c.nearest(np.array(theta))
    assert found is every[at]
    assert behind == 4.0 * at


class ToneBench(RivalBench):
    """A rival whose record is a tone of a frequency that it has to find."""

    def _followed(self, c, theta, s):
        return 10.0 * (np.sin(theta[0] * s.t) - s.y[:, 0]), 10.0 * (s.t * np.cos(theta[0] * s.t))[:, None]


def test_what_is_promised_does_not_trust_a_single_step_of_a_refit():
    """From beside the other minimum one step foretells no less than the first minimum leaves, and several lead to 0."""
    t = np.linspace(0.0, 10.0, 200)
    shown = SimpleNamespace(t=t, y=np.sin(3.0 * t)[:, None])
    whole = SimpleNamespace(bounds=(np.zeros(1), np.full(1, 10.0)))
    c = Contender((), whole, np.array([4.2]), np.full((1, 1), 1e-9), minima=(np.array([3.4]),), behind=(0.0,))
    bench = ToneBench(None, (c,), None, np.ones(1), {})
    alone = [bench.refitted(0, shown, [start])[0] for start in (c.theta, c.minima[0])]
    distance, where = bench.imitated(0, shown)
    assert distance <= min(alone) < NEEDED_EVIDENCE < max(alone)
    assert where[0] == pytest.approx(3.0, abs=1e-3)
    assert bench.refitted(0, shown)[0] > NEEDED_EVIDENCE  # which screens many commands, and may give up
    noisy = with_noise(shown, 0.1)
    own = bench.squares(0, noisy, np.array([3.0]))
    assert bench.margin(0, noisy, own, [where]) < 1.0 < NEEDED_EVIDENCE < bench.margin(0, noisy, own, [])


def with_noise(shown, sd):
    """Return a record with noise."""
    noise = sd * np.random.default_rng(1).standard_normal(shown.y.shape)
    return SimpleNamespace(t=shown.t, y=shown.y + noise)


@pytest.mark.parametrize("law", ["play_friction", "pinching_hysteresis"])
@pytest.mark.parametrize("sigma", [1.0, 1e6])
def test_a_yielding_that_no_sample_resolves_is_of_no_interest(problem, law, sigma):
    """Drawn from an estimate, such machines are dry friction, and no observer follows them."""
    values = {name: par.nominal for name, par in EFFECTS[law].pars().items()} | {"sigma": sigma, "F_c": 0.03}
    bounds = EFFECTS[law].of_interest(values, problem.scale)
    softest = EFFECTS["dahl_presliding"].of_interest({"F_c": 0.03, "sigma": sigma}, problem.scale)["sigma"]
    assert bounds["sigma"] == softest
    size, (least, most) = next(iter(bounds.items()))
    assert 0.0 < least < most
    assert size == {"play_friction": "gap", "pinching_hysteresis": "zeta"}[law]
