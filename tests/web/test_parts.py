"""Projects, commands, curves, mapping proposals and sliders, without a server."""

from __future__ import annotations

import json
import shlex
import subprocess
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from signlin_ros import units
from signlin_ros.errors import InputError, ModelError
from signlin_ros.model import Model
from signlin_ros.nodes.feed_logic import POINTS_PER_FRAME, Feed, predicted
from signlin_ros.records import Record, Signal
from signlin_ros.simulation import simulate
from signlin_ros.workbench import commands, proposing, stages, tuning
from signlin_ros.workbench.project import DROPPED_SUFFIXES, MODELS, Project, safe_name

# -------------------------------------------------------------------- projects


@given(st.text(max_size=300))
def test_a_safe_name_is_a_name_and_stays_as_it_is(text: str) -> None:
    try:
        name = safe_name(text + ".csv")
    except InputError:
        return
    assert Path(name).name == name
    assert name.endswith((*DROPPED_SUFFIXES, *MODELS))
    assert not name.startswith((".", "-"))
    assert name.isprintable()
    assert len(name) <= 100
    assert safe_name(name) == name


def test_choices_survive_and_are_taken_back(tmp_path: Path) -> None:
    project = Project.create(tmp_path)
    project.change("one", model="a.yaml")
    project.change("two", model="b.yaml")
    project.amend(exported=True)
    again = Project(tmp_path, project.id)
    assert again.choices["model"] == "b.yaml"
    assert again.choices["exported"]
    again.undo()
    assert again.choices["model"] == "a.yaml"
    again.undo()
    assert again.choices["model"] is None
    again.undo()
    again.redo()
    again.redo()
    assert Project(tmp_path, project.id).choices["model"] == "b.yaml"
    again.undo()
    again.change("three", model="c.yaml")
    again.redo()
    assert again.choices["model"] == "c.yaml"


def test_a_result_is_found_again_until_a_file_changes(tmp_path: Path) -> None:
    project, file = Project.create(tmp_path), tmp_path / "a.csv"
    file.write_text("t,x\n0,1\n")
    asked = {"model": "dc_motor", "data": [str(file)]}
    project.keep(project.key("compare", asked), {"found": 1})
    assert Project(tmp_path, project.id).result(project.key("compare", dict(asked))) == {"found": 1}
    assert project.key("diagnose", asked) != project.key("compare", asked)
    file.write_text("t,x\n0,1\n1,2\n")
    assert project.result(project.key("compare", asked)) is None


@pytest.mark.parametrize("identity", ["../..", "", "A" * 12, "a" * 11, "a" * 13, "aaaaaaaaaaa/"])
def test_a_project_has_an_identity_and_nothing_else(tmp_path: Path, identity: str) -> None:
    with pytest.raises(InputError, match="no such project"):
        Project(tmp_path, identity)


# -------------------------------------------------------------------- commands

STEP = {
    "verb": "add",
    "effect": "coulomb_friction",
    "model": "my motor.yaml",
    "data": ["a b.csv"],
    "output": "p/m.yaml",
}


def test_a_command_is_what_a_shell_takes() -> None:
    step = {**STEP, "validation": ["$(rm x).csv"], "signals": {"speed": "-0.1 * rpm [rpm]"}, "cures": ["unwrap"]}
    words = shlex.split(commands.command(step))
    assert words[:5] == ["signlin", "add", "coulomb_friction", "my motor.yaml", "a b.csv"]
    assert words[5:] == [
        *("--validation", "$(rm x).csv", "--signal", "speed=-0.1 * rpm [rpm]", "--cure", "unwrap", "-o", "p/m.yaml")
    ]


def test_a_script_reads_the_models_that_it_has_made(tmp_path: Path) -> None:
    after = {"verb": "compare", "model": "p/m.yaml", "data": ["a b.csv"]}
    by_hand = {"verb": "set", "model": "p/m.yaml", "data": [], "output": "p/n.yaml", "text": "x: 1\n"}
    text = commands.script(tmp_path, "re play", [STEP, after, by_hand], {"p/n.yaml": by_hand["text"]})
    lines = [shlex.split(line) for line in text.splitlines() if line.startswith("signlin")]
    assert lines[0][lines[0].index("-o") + 1] == "re play/m.yaml"
    assert lines[1][2] == "re play/m.yaml"
    assert lines[1][-2:] == [">", "re play/2_compare.json"]
    assert "cat > 're play/n.yaml' <<'END_OF_MODEL'\nx: 1\nEND_OF_MODEL" in text


def test_the_text_of_a_model_does_not_end_its_place_in_a_script(tmp_path: Path) -> None:
    text = "a: 1\nEND_OF_MODEL\ntouch hacked\nEND_OF_MODEL1\n"
    step = {"verb": "set", "model": "m.yaml", "data": [], "output": "n.yaml", "text": text}
    script = tmp_path / "replay.sh"
    script.write_text(commands.script(tmp_path, "replay", [step], {"n.yaml": text}))
    subprocess.run(["sh", str(script)], check=True)
    assert (tmp_path / "replay" / "n.yaml").read_text() == text
    assert not (tmp_path / "hacked").exists()


@pytest.mark.parametrize(
    ("findings", "cures", "done", "says"),
    [
        ([], [], True, "Nothing was found wrong."),
        ([{"severity": "note"}], [], True, "Nothing forbids"),
        ([{"severity": "offer"}], [], True, "1 finding with a cure"),
        ([{"severity": "refuse"}, {"severity": "refuse"}], [], False, "2 findings must be cured"),
        ([{"severity": "refuse", "applied": True}], ["unwrap"], True, "Nothing forbids"),
        ([{"severity": "refuse"}], ["none"], True, "must be cured"),
    ],
)
def test_what_the_check_found_decides_whether_one_may_go_on(
    findings: list[dict[str, Any]], cures: list[str], done: bool, says: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    row = {"check": "clipped", "record": "a.csv", "applied": False, "channel": "speed", "sentence": ""}
    rows = [{**row, **f} for f in findings]
    found = {"json": {"findings": rows}, "directions": [None] * len(rows)}
    choices = {"cures": cures, "records": [], "model": "dc_motor"}
    project = SimpleNamespace(choices=choices, files=lambda _: ["a.csv"], path=str)
    session: Any = SimpleNamespace(project=project, tables=None)
    monkeypatch.setattr(stages, "_estimated", lambda _: False)
    monkeypatch.setattr(stages, "before", lambda _: "")
    monkeypatch.setattr(stages, "result", lambda *_: found)
    block = stages.check(session)
    assert block["done"] is done
    assert says in block["sentence"]


# -------------------------------------------------------------------- curves


@pytest.mark.parametrize("count", [10, 5001, 200_000])
def test_thinned_curves_keep_peaks_holes_and_ends(count: int) -> None:
    pytest.importorskip("tsdownsample")
    from signlin_ros.workbench import arrays

    t = np.linspace(0.0, 10.0, count)
    a, b = np.sin(40 * t), np.cos(3 * t)
    a[count // 3], b[count // 2] = 50.0, -70.0
    a[2 * count // 3 : 2 * count // 3 + 3] = np.nan
    at = arrays.thinned(t, [a, b])
    assert at.size <= arrays.MAX_CURVE_POINTS
    assert {0, count - 1, count // 3, count // 2} <= set(at.tolist())
    assert np.isnan(a[at]).any()
    assert (np.diff(at) > 0).all()


@given(st.floats(-1, 12), st.floats(-1, 12))
def test_a_window_holds_all_between_two_times(one: float, other: float) -> None:
    from signlin_ros.workbench import arrays

    low, high = min(one, other), max(one, other)
    t = np.arange(0.0, 10.0, 0.01)
    part = arrays.window(t, low, high)
    inside = np.flatnonzero((t >= low) & (t <= high))
    assert t[part].size >= 1
    if inside.size:
        assert part.start <= inside[0]
        assert part.stop > inside[-1]


# -------------------------------------------------------------------- mapping


def record(**columns: Any) -> Record:
    t = np.arange(500) / 100.0
    return Record(
        t, {name: Signal(np.asarray(y), u, label=f"{name} [{u}]" if u else name) for name, (y, u) in columns.items()}
    )


def test_columns_are_proposed_by_name_unit_and_derivative() -> None:
    t = np.arange(500) / 100.0
    given = record(
        u_motor=(np.sin(t), "V"), i_q=(np.cos(t), "A"), noise=(np.cos(70 * t), ""), w_meas=(np.cos(2 * t), "rad/s")
    )
    rows = {r["signal"]: r for r in proposing.mapping(Model.load("dc_motor"), [given], {})}
    assert {n: rows[n]["column"] for n in ("voltage", "current", "speed")} == {
        "voltage": "u_motor [V]",
        "current": "i_q [A]",
        "speed": "w_meas [rad/s]",
    }
    assert all(rows[n]["proposed"] and rows[n]["why"] for n in ("voltage", "current", "speed"))
    nameless = record(
        force=(np.sin(t), ""), c1=(np.sin(2 * t), ""), c2=(np.sin(9 * t), ""), velocity=(2 * np.cos(2 * t), "")
    )
    rows = {r["signal"]: r for r in proposing.mapping(Model.load("mass_spring_damper"), [nameless], {})}
    assert rows["velocity"]["why"] == "found by its name"
    assert rows["displacement"]["column"] == "c1"
    assert "derivative" in rows["displacement"]["why"]


def test_a_proposal_says_that_it_is_one_and_asks_for_the_unit() -> None:
    t = np.arange(500) / 100.0
    given = record(pwm=(np.sin(t), ""), current=(np.cos(t), "mA"), rate=(np.cos(2 * t), "deg/s"), c=(t, ""))
    rows = {r["signal"]: r for r in proposing.mapping(Model.load("dc_motor"), [given], {})}
    assert rows["voltage"]["why"] == "guessed: called 'pwm'; in what unit? Taken in V"
    assert rows["speed"]["why"] == "guessed: called 'rate' and in deg/s"
    assert rows["current"]["why"] == "found by its name"
    left_out = {r["signal"]: r for r in proposing.mapping(Model.load("dc_motor"), [given], {"speed": ""})}["speed"]
    assert (left_out["column"], left_out["set"], left_out["why"]) == (None, True, "as you set it")
    assert rows["speed"]["units"] == ["rad/s", "rpm", "deg/s", "turns/s"]
    assert all(units.conversion(u, r["unit"]) for r in rows.values() for u in r["units"])


def test_what_was_asked_for_is_not_what_was_measured() -> None:
    t = np.arange(500) / 100.0
    given = record(q_goal=(np.sin(t), "rad"), q_meas=(np.sin(t + 1), "rad"), torque=(np.cos(t), "N·m"))
    rows = {r["signal"]: r for r in proposing.mapping(Model.load("mass_spring_damper"), [given], {})}
    assert (rows["displacement"]["column"], rows["force"]["column"]) == ("q_meas [rad]", "torque [N·m]")
    told = Model.load("mass_spring_damper").with_options(signals={"force": "torque [N·m]"})
    rows = {r["signal"]: r for r in proposing.mapping(told, [given], {})}
    assert rows["displacement"]["column"] is None


def test_a_column_in_another_quantity_is_not_proposed() -> None:
    t = np.arange(500) / 100.0
    given = record(voltage=(np.sin(t), "V"), speed_of_sound=(t, "degC"))
    rows = {r["signal"]: r for r in proposing.mapping(Model.load("dc_motor"), [given], {})}
    assert rows["speed"]["column"] is None


def test_what_goes_with_a_derivative_is_no_command_no_error_and_of_the_right_quantity() -> None:
    t = np.arange(500) / 100.0
    q, w = np.sin(2 * t), 2 * np.cos(2 * t)
    given = record(yaw_ref=(q, "rad"), pressure=(q, "bar"), yaw_error=(q, ""), yaw=(q, "rad"), gyro=(w, "rad/s"))
    motor = Model.load("dc_motor").with_options(with_position=True)
    rows = {r["signal"]: r for r in proposing.mapping(motor, [given], {})}
    assert (rows["speed"]["column"], rows["position"]["column"]) == ("gyro [rad/s]", "yaw [rad]")


def test_of_two_joints_with_like_motions_the_one_of_the_same_size_is_proposed() -> None:
    t = np.arange(500) / 100.0
    q, w = np.sin(2 * t), 2 * np.cos(2 * t)
    given = record(position_0=(q, ""), rate_1=(0.3 * w, ""), rate_0=(w, ""), rate_2=(5 * w, ""), target_tau=(w, ""))
    rows = {r["signal"]: r for r in proposing.mapping(Model.load("mass_spring_damper"), [given], {})}
    found = {n: rows[n]["column"] for n in ("force", "displacement", "velocity")}
    assert found == {"force": "target_tau", "displacement": "position_0", "velocity": "rate_0"}


# -------------------------------------------------------------------- sliders


def test_sliders_stay_within_what_is_declared() -> None:
    for name in ("dc_motor", "bouc_wen", "mass_spring_damper"):
        model = Model.load(name)
        for p in tuning.parameters(model):
            assert p["from"] <= p["value"] <= p["to"]
            for value in (p["from"], p["to"]):
                assert tuning.changed(model, {p["name"]: value}).value(p["name"]) == value


def test_the_bench_shows_what_simulation_and_linearization_say() -> None:
    pytest.importorskip("tsdownsample")
    from signlin_ros.linearization import Linearizer

    model = Model.load("dc_motor")
    t = np.arange(800) / 200.0
    u = 2.0 * np.sin(4 * t)
    run = simulate(model, t, u[:, None])
    data = Record(
        t, {"voltage": Signal(u), "current": Signal(run["current"]), "speed": Signal(run["speed"])}
    ).for_model(model)
    bench = tuning.TuningBench(model, data)
    same = bench.answer({}, 2.0, (None, None), 5000)
    assert max(same["rms"].values()) < 1e-3
    other = bench.answer({"coulomb_friction.mu": 0.0}, 2.0, (None, None), 5000)
    assert other["rms"]["speed"] > 100 * same["rms"]["speed"]
    k = 400
    A = Linearizer(model)(run.x[k], u[[k]]).A
    np.testing.assert_allclose(same["linear"]["A"], A, rtol=1e-3)
    np.testing.assert_allclose(
        sorted(p[0] for p in same["linear"]["poles"]), sorted(np.linalg.eigvals(A).real), rtol=1e-3
    )
    with pytest.raises(ModelError):
        bench.answer({"J": -1.0}, None, (None, None), 100)


# -------------------------------------------------------------------- live


def test_a_frame_holds_the_extremes_and_never_too_much() -> None:
    feed, random = Feed(), np.random.default_rng(0)
    rows = random.standard_normal((3000, 8))
    shown: list[list[float]] = [[] for _ in range(8)]
    for k, row in enumerate(rows):
        feed.state.put(k * 1e-3, row)
        if k % 50 == 49:
            frame = feed.frame(k * 1e-3)
            json.dumps(frame, allow_nan=False)
            for j, y in enumerate(frame["state"]["y"]):
                assert len(y) <= POINTS_PER_FRAME
                shown[j] += y
    for j in range(8):
        assert max(shown[j]) == pytest.approx(rows[:, j].max(), rel=1e-6)
        assert min(shown[j]) == pytest.approx(rows[:, j].min(), rel=1e-6)
    assert 60 * 20 * POINTS_PER_FRAME <= 5000
    assert "state" not in feed.frame(4.0)


def test_samples_are_forgotten_after_a_minute_and_taken_as_a_record() -> None:
    feed = Feed()
    for k in range(9000):
        if k % 10 == 0:
            feed.input.put(0.01 * k, np.array([float(k)]))
        feed.state.put(0.01 * k, np.array([float(k), -float(k)]))
        if k % 100 == 0:
            feed.frame(0.01 * k)
    assert len(feed.state.kept) <= 6100
    t, x, u = feed.recorded(30.0)
    assert t[0] == 0.0
    assert t[-1] == pytest.approx(30.0)
    assert x[-1].tolist() == [8999.0, -8999.0]
    assert u[-1].tolist() == [8990.0]


def test_the_error_of_a_models_prediction_is_what_it_is_off_by() -> None:
    A, B, c = np.array([[0.0, 1.0], [-2.0, -0.3]]), np.array([[0.0], [1.0]]), np.array([0.0, 0.1])
    feed, x, u = Feed(), np.array([1.0, 0.0]), np.array([0.5])
    feed.input.put(-0.1, u)
    for k in range(41):
        t = 0.01 * k
        feed.state.put(t, predicted(A, B, c, x, u, t))
        if k % 20 == 0:
            feed.take_model(t, 2, 1, True, (A, B, c))
    assert len(feed.error.kept) == 2
    assert np.abs(np.array([row for _, row in feed.error.kept])).max() < 1e-12
    feed.state.put(0.6, np.add(predicted(A, B, c, x, u, 0.6), [0.0, 0.25]))
    feed.take_model(0.6, 2, 1, True, (A, B, c))
    np.testing.assert_allclose(feed.error.kept[-1][1], [0.0, 0.25], atol=1e-12)


# -------------------------------------------------------------------- compare


def test_a_comparison_tells_what_it_does_from_the_start(hidden_effect: Path, tmp_path: Path) -> None:
    from signlin_ros.workbench.calls import WORKER_CALLS

    told: list[dict[str, Any]] = []
    data = [str(hidden_effect / "validation.csv")]
    args = {"model": str(hidden_effect / "model.yaml"), "data": data, "store": str(tmp_path / "curves.npz")}
    WORKER_CALLS["compare"](args, told.append)
    assert told[0]["what"] == "reading the record"
    assert len(told) >= 6
    shares = [one["share"] for one in told]
    assert shares == sorted(shares)
    assert 0 < shares[0] < shares[-1] < 1
