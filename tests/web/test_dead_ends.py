"""A log of somebody who has no model file, no unit of the time, a wide table or bad luck: there is always a way on."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from signlin_ros.errors import InputError, ModelError
from signlin_ros.model import Model
from signlin_ros.records import Record, Signal
from signlin_ros.workbench import commands, further, proposing, sheet
from signlin_ros.workbench.calls import WORKER_CALLS
from signlin_ros.workbench.wording import on_page

if TYPE_CHECKING:
    from conftest import Client


def log(head: str, rows: int = 400, step: float = 5.0) -> bytes:
    """Return a log of a motor: time from row to row, what drives it, current in mA, speed in rpm."""
    t = np.arange(rows)
    columns = [t * step, 6 * np.sin(0.02 * t), 300 * np.cos(0.02 * t), 200 * np.sin(0.02 * t - 0.3)]
    lines = [",".join(f"{x:.6g}" for x in row) for row in zip(*columns, strict=True)]
    return "\n".join([head, *lines, ""]).encode()


def taken(client: Client, **files: bytes) -> tuple[str, Any]:
    project = client.project()
    names = [json.loads(client.put(project, f"{name}.csv", body)[1])["file"] for name, body in files.items()]
    assert client.act(project, "take", files=names)[0] == 200
    return project, client.settled(project)


def record_of(state: Any) -> Any:
    return state["stages"][0]


# -------------------------------------------------------------------- time


def test_a_time_without_a_unit_is_asked_for_and_read_by_one_click(client: Client) -> None:
    project, state = taken(client, run=log("t,voltage,current [mA],speed [rpm]"))
    said = record_of(state)
    assert said["asked"] == "t [ms]"
    assert said["error"] is None
    assert "Is the time t in ms? In s it would be 1,995 s." in said["sentence"]
    assert "In which unit is the time?" in state["stages"][1]["why"]
    client.act(project, "map_signal", file="run.csv", signal="t", formula=said["asked"])
    state = client.settled(project)
    assert state["records"][0]["found"]["end"] == pytest.approx(1.995)
    assert state["stages"][0]["done"]


@pytest.fixture(scope="module")
def timed(client: Client) -> str:
    """A project with a record whose time is right."""
    return taken(client, run=log("t [ms],voltage,current [mA],speed [rpm]"))[0]


@pytest.mark.parametrize("formula", ["nonsense", "3 * speed", "t [parsec]", "0", "(t"])
def test_a_refused_time_leaves_all_in_place(client: Client, timed: str, formula: str) -> None:
    project, before = timed, client.state(timed)
    client.act(project, "map_signal", file="run.csv", signal="t", formula=formula)
    state = client.settled(project)
    assert "It is left as it was" in record_of(state)["error"]["what"]
    assert "--" not in record_of(state)["error"]["what"]
    for key in ("mapping", "records", "undo", "redo"):
        assert state[key] == before[key]
    assert client.ask("POST", f"/p/{project}/show/record", b"{}", {"x-signlin": "1"})[0] == 200


def test_a_table_without_a_time_is_shown_and_takes_the_time_from_row_to_row(client: Client) -> None:
    project, state = taken(client, run=log("a,voltage,current [mA],speed [rpm]", step=0.0))
    assert "cannot be read as it is" in record_of(state)["sentence"]
    what = record_of(state)["error"]["what"]
    assert "no time column" in what
    assert "--" not in what
    assert "row time below" in what
    (table,) = state["mapping"]
    assert [c["label"] for c in table["columns"]] == ["a", "voltage", "current [mA]", "speed [rpm]"]
    shown = json.loads(client.ask("POST", f"/p/{project}/show/record", b"{}", {"x-signlin": "1"})[1])
    assert len(shown["plots"]) == 4
    assert shown["rows"]
    client.act(project, "map_signal", file="run.csv", signal="t", formula="0.005")
    state = client.settled(project)
    assert state["stages"][1]["done"] or state["stages"][1]["findings"]
    assert state["records"][0]["found"]["end"] == pytest.approx(1.995)


def test_a_file_that_is_no_table_is_said_to_be_none_and_others_go_on(client: Client) -> None:
    project, state = taken(client, good=log("t [ms],voltage,current [mA],speed [rpm]"), torn=b"\x89PNG\r\n\x1a\n" * 50)
    assert "torn.csv" in record_of(state)["error"]["what"]
    found = {r["name"]: r["found"] for r in state["records"]}
    assert found["good.csv"]["samples"] == 400
    assert found["torn.csv"]["error"]
    assert not found["torn.csv"]["untimed"]
    client.act(project, "drop", file="torn.csv")
    assert client.settled(project)["stages"][0]["done"]


def test_the_page_speaks_of_its_own_fields() -> None:
    said = [
        "a.csv: no time column (t, time); it has 'a'; name it with --signal t=COLUMN (or signals: {t: COLUMN}), or ...",
        "a.csv: the time column 't' is in 'parsec'; allowed: s, ms; state it: --signal 't = COLUMN [ms]', or --dt 0.01",
        "a.csv: speed is in 'furlong' (column 'v'), the model in 'rad/s'; say what it is: --signal 'speed = v [UNIT]'",
        "a.csv: no time column 'zz'; it has 'a'; or say --dt 0.01 where the rows are 0.01 s apart",
        "no listed effect explains it; `signlin add learned_force` learns it as a curve",
        "12 samples are too few to hold a third of them out; give --validation",
    ]
    for text in said:
        assert "--" not in on_page(text)
        assert "signlin " not in on_page(text)
        assert on_page(text)[:12] == text[:12]


# -------------------------------------------------------------------- no model file


def test_numbers_of_a_data_sheet_make_a_model(client: Client) -> None:
    project, state = taken(client, run=log("t [ms],pwm,current [mA],rate [rpm]"))
    values = {"R": ["1,2", "Ohm"], "L": ["0.5", "mH"], "K": ["8.4", "V/krpm"], "J": [650, "g·cm²"]}
    values["B"] = [0, "N·m·s/rad"]
    assert client.act(project, "write", form="motor", values=values)[0] == 200
    state = client.settled(project)
    assert state["model_name"] == "model_1.yaml"
    model = Model.load(client.server.folder / ".signlin" / project / "model_1.yaml")
    assert model.parameters["J"] == pytest.approx(6.5e-5)
    assert model.parameters["K_t"] == model.parameters["K_m"] == pytest.approx(8.4 * 60 / (2000 * np.pi))
    assert {r["signal"]: r["column"] for r in state["mapping"][0]["rows"]}["speed"] == "rate [rpm]"
    for bad in ({**values, "J": ["0", "g·cm²"]}, {**values, "R": ["", "Ohm"]}, {**values, "K": ["1", "m"]}, {}):
        client.act(project, "write", form="motor", values=bad)
        error = client.settled(project)["stages"][0]["error"]
        assert error["what"][:2] in ("J:", "R:", "K:")
    assert client.state(project)["model_name"] == "model_1.yaml"


@pytest.mark.parametrize(
    ("angle", "taken_with"), [("winkel [deg]", True), ("encoder", False), ("soll_winkel [deg]", False)]
)
def test_an_angle_that_was_recorded_is_in_the_model(client: Client, angle: str, taken_with: bool) -> None:
    project, _ = taken(client, run=log(f"t [ms],pwm,current [mA],{angle}"))
    values = {"R": [1.2, "Ohm"], "L": [0.5, "mH"], "K": [42, "mN·m/A"], "J": [650, "g·cm²"], "B": [0, "N·m·s/rad"]}
    assert client.act(project, "write", form="motor", values=values)[0] == 200
    state = client.settled(project)
    assert ("position" in state["model"]["states"]) is taken_with
    rows = {r["signal"]: r["column"] for r in state["mapping"][0]["rows"]}
    assert rows.get("position") == (angle if taken_with else None)


@pytest.mark.parametrize("form", [f["id"] for f in sheet.forms()])
def test_every_form_makes_a_model_in_every_unit(form: str) -> None:
    (one,) = (f for f in sheet.forms() if f["id"] == form)
    for k in range(3):
        values = {f["name"]: [1.5, f["units"][min(k, len(f["units"]) - 1)]] for f in one["fields"]}
        again = Model.from_yaml(sheet.model_of(form, values).to_yaml())
        assert all(v > 0 for v in again.parameters.values())
    with pytest.raises((InputError, ModelError)):
        sheet.model_of("nothing", {})


def test_the_refitted_values_are_taken_by_one_click(hidden_effect: Path, tmp_path: Path) -> None:
    truth = Model.load(hidden_effect / "model.yaml").with_effect("coulomb_friction", mu=0.033)
    truth.with_parameters({"J": 0.0011, "R_a": 1.0}).save(tmp_path / "off.yaml")
    args = {"model": str(tmp_path / "off.yaml"), "data": [str(hidden_effect / "estimation.csv")]}
    args |= {"validation": [str(hidden_effect / "validation.csv")], "output": str(tmp_path / "refit.yaml")}
    WORKER_CALLS["refit"](args, lambda _: None)
    found = Model.load(tmp_path / "refit.yaml")
    assert found.parameters["J"] == pytest.approx(0.0022, rel=0.1)
    assert found.parameters["R_a"] == pytest.approx(0.764, rel=0.1)


@pytest.mark.parametrize(
    ("channels", "blamed"),
    [
        ([{"name": "speed", "given": -40.0, "refitted": 98.2, "follows": True}], False),
        ([{"name": "speed", "given": 30.0, "refitted": 31.0, "follows": False}], True),
        ([{"name": "speed", "given": 30.0, "refitted": None, "follows": None}], True),
    ],
)
def test_the_record_is_not_blamed_where_the_refitted_model_follows_it(
    channels: list[dict[str, Any]], blamed: bool
) -> None:
    said = further._lost(channels)
    assert ("column" in said) is blamed
    assert ("its numbers are off, not the record" in said) is not blamed
    assert "sensor that fails" not in said


# -------------------------------------------------------------------- what is offered


def diagnosed(verdict: str, proposal: list[str], **status: str) -> Any:
    ranking = [{"effect": name, "status": one, "why": ""} for name, one in status.items()]
    return {"json": {"verdict": verdict, "ladder": [{"effects": []}, {"effects": proposal}], "ranking": ranking}}


def test_what_is_offered_first_is_what_the_verdict_names(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(further, "described", lambda _: {"effects": ["gravity_load"]})
    session: Any = SimpleNamespace()
    named = diagnosed("missing", ["backlash"], backlash="confirmed", gravity_load="confirmed", hard_stop="rejected")
    assert (further._offers(session, named), further._sure(named)) == (["backlash"], True)
    refused = diagnosed("unexplained", ["backlash"], backlash="rejected")
    assert (further._offers(session, refused), further._sure(refused)) == ([], False)
    part = diagnosed("unexplained", ["backlash"], backlash="ambiguous")
    assert (further._offers(session, part), further._sure(part)) == (["backlash"], False)
    assert further._nothing_named(part)


def test_a_curve_is_learned_where_nothing_has_a_name(hidden_effect: Path, tmp_path: Path) -> None:
    args = {"model": str(hidden_effect / "model.yaml"), "data": [str(hidden_effect / "estimation.csv")]}
    args |= {"validation": [str(hidden_effect / "validation.csv")], "output": str(tmp_path / "learned.yaml")}
    args |= {"effect": "learned_force", "over": "speed"}
    found = WORKER_CALLS["add"](args, lambda _: None)
    assert "learned_force" in Model.load(tmp_path / "learned.yaml").effects
    assert "Learned:" in found["json"]["sentence"]
    words = commands.command({"verb": "add", **args})
    assert "--over speed" in words


# -------------------------------------------------------------------- columns


def record(**columns: Any) -> Record:
    t = np.arange(500) / 100.0
    signals = {n.split("_[")[0]: Signal(np.asarray(y), u, label=n) for n, (y, u) in columns.items()}
    return Record(t, signals)


def test_german_names_and_units_at_their_end_are_understood() -> None:
    t = np.arange(500) / 100.0
    given = record(
        pwm=(np.sin(t), ""), strom_mA=(np.cos(t), "mA"), drehzahl_rpm=(np.cos(2 * t), "rpm"), drehzahl_soll=(t, "rpm")
    )
    rows = {r["signal"]: r for r in proposing.mapping(Model.load("dc_motor"), [given], {})}
    assert rows["current"]["column"] == "strom_mA"
    assert rows["speed"]["column"] == "drehzahl_rpm"


def test_of_two_columns_the_one_that_moves_is_taken() -> None:
    t, still = np.arange(500) / 100.0, np.zeros(500)
    for names in (("speed", "rpm"), ("rpm", "rate"), ("rate", "speed")):
        for moving in names:
            columns = {n: (np.cos(2 * t) if n == moving else still, "") for n in names}
            given = record(voltage=(np.sin(t), "V"), **columns)
            rows = {r["signal"]: r for r in proposing.mapping(Model.load("dc_motor"), [given], {})}
            assert rows["speed"]["column"] == moving, (names, moving)
    only = record(voltage=(np.sin(t), "V"), speed=(still, "rad/s"))
    rows = {r["signal"]: r for r in proposing.mapping(Model.load("dc_motor"), [only], {})}
    assert rows["speed"]["column"] == "speed"


def test_what_is_not_mapped_is_named(client: Client) -> None:
    _, state = taken(client, run=log("t [ms],voltage,xyz,speed [rpm]"))
    assert "Not measured, as it is mapped: current" in record_of(state)["sentence"]
    assert "columns not used: xyz" in record_of(state)["sentence"]


def test_a_wide_table_is_looked_through_by_words(client: Client) -> None:
    width = 3000
    head = ",".join(["t", "voltage", "speed", *(f"drive/axis{k % 7}/temperature_{k}" for k in range(width))])
    cells = "," + ",".join(["20.5"] * width)
    rows = "".join(f"{0.01 * k:g},{k % 3},{0.2 * k:g}{cells}\n" for k in range(60))
    project, state = taken(client, wide=f"{head}\n{rows}".encode())
    assert len(json.dumps(state)) < 200_000
    assert state["mapping"][0]["count"] == width + 2
    ask = json.dumps({"filter": "axis3 2999"}).encode()
    found = json.loads(client.ask("POST", f"/p/{project}/show/search", ask, {"x-signlin": "1"})[1])
    assert [c["label"] for c in found["columns"]] == ["drive/axis3/temperature_2999"]
    ask = json.dumps({"filter": "axis3"}).encode()
    found = json.loads(client.ask("POST", f"/p/{project}/show/search", ask, {"x-signlin": "1"})[1])
    assert (len(found["columns"]), found["count"]) == (50, 429)
    ask = json.dumps({"columns": ["speed", "drive/axis3/temperature_2999"]}).encode()
    shown = json.loads(client.ask("POST", f"/p/{project}/show/record", ask, {"x-signlin": "1"})[1])
    assert [p["name"] for p in shown["plots"]] == ["speed", "drive/axis3/temperature_2999"]
    everything = json.loads(client.ask("POST", f"/p/{project}/show/record", b"{}", {"x-signlin": "1"})[1])
    assert len(everything["plots"]) <= 40


def test_a_pwm_is_offered_its_sign_and_its_full_scale() -> None:
    t = np.arange(500) / 100.0
    given = record(
        pwm=(np.round(200 * np.abs(np.sin(t))), ""), richtung=((np.sin(t) > 0) * 1.0, ""), speed=(np.cos(t), "rad/s")
    )
    rows = {r["signal"]: r for r in proposing.mapping(Model.load("dc_motor"), [given], {})}
    assert (rows["voltage"]["direction"], rows["voltage"]["full"][0]) == ("richtung", 255.0)
    signed = record(voltage=(np.sin(t), "V"), richtung=((np.sin(t) > 0) * 1.0, ""), speed=(np.cos(t), "rad/s"))
    rows = {r["signal"]: r for r in proposing.mapping(Model.load("dc_motor"), [signed], {})}
    assert "direction" not in rows["voltage"]
    assert "full" not in rows["voltage"]


@pytest.mark.parametrize("said", [{}, {"voltage": "duty [%]"}])
def test_a_duty_in_per_cent_is_offered_its_full_scale(said: dict[str, str]) -> None:
    t = np.arange(500) / 100.0
    given = Record(t, {"duty": Signal(60 * np.sin(t), "%", label="duty [%]"), "speed": Signal(np.cos(t), "rad/s")})
    rows = {r["signal"]: r for r in proposing.mapping(Model.load("dc_motor"), [given], said)}
    assert (rows["voltage"]["column"], rows["voltage"]["full"][0]) == ("duty [%]", 100.0)


@pytest.mark.parametrize(
    ("names", "right"),
    [
        (("tensión", "corriente", "velocidad"), ("voltage", "current", "speed")),
        (("napięcie silnika", "prąd", "prędkość"), ("voltage", "current", "speed")),
        (("电压", "电流", "转速"), ("voltage", "current", "speed")),
        (("tensione_motore", "corrente_motore", "velocità"), ("voltage", "current", "speed")),
    ],
)
def test_names_in_other_languages_are_understood(names: tuple[str, ...], right: tuple[str, ...]) -> None:
    t = np.arange(500) / 100.0
    waves = (np.sin(t), np.cos(2 * t), np.sin(3 * t))
    units = ("V", "A", "rad/s")
    given = Record(t, {n: Signal(y, u, label=n) for n, y, u in zip(names, waves, units, strict=True)})
    rows = {r["signal"]: r["column"] for r in proposing.mapping(Model.load("dc_motor"), [given], {})}
    assert [rows[name] for name in right] == list(names)


def test_a_table_without_numbers_and_a_urdf_alone_say_what_comes_next(client: Client) -> None:
    lines = b"t,voltage,speed\n" + b"".join(b"%d,on,fast\n" % k for k in range(50))
    project, state = taken(client, words=lines)
    assert record_of(state)["error"]["what"].startswith("words.csv holds no column of numbers")
    client.act(project, "model", name="dc_motor")
    assert "A record cannot be read" in client.settled(project)["stages"][1]["why"]
    project = client.project()
    client.put(project, "robot.urdf", b"<robot name='r'/>")
    client.act(project, "take", files=["robot.urdf"])
    assert "robot.urdf is there; drop the model file" in record_of(client.settled(project))["sentence"]


# -------------------------------------------------------------------- a time that nothing is called


def french(step: float = 4000.0) -> bytes:
    """Return a log in JSON lines, in another language: a clock, a count of the rows, a voltage, a speed."""
    t = np.arange(400)
    jitter = np.random.default_rng(1).integers(-100, 100, t.size)
    columns = (t * step + jitter + 5_000_000, t, 6e3 * np.sin(0.02 * t), 200 * np.sin(0.02 * t - 0.3))
    names = ("horodatage_us", "no_ligne", "tension_mV", "vitesse_tr_min")
    rows = ({n: float(v) for n, v in zip(names, row, strict=True)} for row in zip(*columns, strict=True))
    return "\n".join(map(json.dumps, rows)).encode()


def test_a_clock_that_is_called_like_no_time_is_asked_for_and_read_by_one_click(client: Client) -> None:
    project = client.project()
    name = json.loads(client.put(project, "essai.jsonl", french())[1])["file"]
    client.act(project, "take", files=[name])
    state = client.settled(project)
    said = record_of(state)
    assert said["asked"] == "horodatage_us [us]"
    assert said["sentence"] == "1 record. No column is called like a time. Is it horodatage_us, in us?"
    assert said["error"] is None
    assert not any("rows are" in note for note in state["records"][0]["found"]["notes"])
    client.act(project, "map_signal", file="essai.jsonl", signal="t", formula=said["asked"])
    found = client.settled(project)["records"][0]["found"]
    assert found["step"] == pytest.approx(0.004, rel=0.05)
    assert {c["label"]: c["unit"] for c in found["columns"]}["vitesse_tr_min"] == "tr_min"


def test_what_only_counts_or_could_be_either_is_not_guessed_to_be_the_time() -> None:
    from signlin_ros.workbench.clocks import asked_time

    n, g = np.arange(500.0), np.random.default_rng(2)
    clock = Signal(1e3 * (n + 0.1 * g.uniform(size=500)), "")
    assert asked_time(record(zeile=(n, ""), u=(np.sin(n), "V"))) == ""
    assert asked_time(record(takt=(clock.values, ""), zeile=(n, ""), u=(np.sin(n), "V"))) == "takt [us]"
    assert asked_time(record(takt=(clock.values, ""), wecker=(2 * clock.values, ""))) == ""
    assert asked_time(record(takt=(clock.values, ""), wecker=(2 * clock.values, "ms"))) == "wecker [ms]"
    assert asked_time(record(weg=(np.cumsum(g.exponential(size=500) ** 4), ""))) == ""


def test_no_record_of_two_can_be_read_is_said_of_both(client: Client) -> None:
    lines = "\n".join(["a,b", *("1,2" for _ in range(50)), ""]).encode()
    _, state = taken(client, one=lines, two=lines)
    assert "None can be read as they are." in record_of(state)["sentence"]
