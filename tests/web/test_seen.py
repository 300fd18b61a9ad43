"""What one looks at: what repeats, several models, one quantity over another, names of projects, the report."""

from __future__ import annotations

import base64
import json
import re
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from signlin_ros.comparison import waves
from signlin_ros.diagnosis import effect_evidence
from signlin_ros.errors import InputError
from signlin_ros.model import Model
from signlin_ros.workbench import further, stages
from signlin_ros.workbench.calls import WORKER_CALLS

if TYPE_CHECKING:
    from conftest import Client, Page, Server

STATIC = Path(__file__).parents[2] / "signlin_ros" / "workbench" / "static"
GROW = """
const grown = document.createElement('div');
grown.style.height = `${arguments[1]}px`;
document.querySelector(arguments[0]).append(grown);
delete document.documentElement.dataset.grown;
requestAnimationFrame(() => requestAnimationFrame(() => { document.documentElement.dataset.grown = true; }));
"""
GROWN = "return document.documentElement.dataset.grown"


def numbers(packed: dict[str, str]) -> Any:
    return np.frombuffer(base64.b64decode(packed["f8"]), "<f8")


# -------------------------------------------------------------------- what repeats


def rippled() -> Model:
    model = Model.load("dc_motor").with_options(with_position=True)
    return model.with_effect("torque_ripple", orders=[12.0, 24.0, 5.0], A=[0.0045, -0.001, 0.0002], phi=[0.1, 0.2, 0.3])


def test_waves_of_an_effect_are_told_by_how_often_and_how_large() -> None:
    found = waves.waves_of(rippled(), "torque_ripple")
    assert [(w.order, w.amplitude) for w in found] == [(12.0, 0.0045), (24.0, 0.001), (5.0, 0.0002)]
    assert waves.said(found, True, "N·m") == "12 per turn, 0.0045 N·m; 24 per turn, 0.001 N·m; 5 per turn, 0.0002 N·m"
    assert waves.said(found, True, "N·m", 1) == "12 per turn, 0.0045 N·m; and 2 weaker"
    slide = Model.load("mass_spring_damper").with_effect("cogging_torque", A=2.0, N=500.0, phi=0.0)
    assert waves.said(waves.waves_of(slide, "cogging_torque"), False, "N") == "every 0.0126 m, 2 N"
    assert waves.waves_of(Model.load("dc_motor"), "coulomb_friction") == []


def test_a_spectrum_by_order_shows_each_wave_where_it_is() -> None:
    random = np.random.default_rng(3)
    q = np.cumsum(random.uniform(0.0, 0.05, 6000))
    force = 0.0045 * np.sin(12 * q + 0.3) + 0.001 * np.cos(24 * q) + 0.0003 * random.standard_normal(q.size) + 0.02
    found = waves.spectrum(q, force, force - 0.0045 * np.sin(12 * q + 0.3), waves.waves_of(rippled(), "torque_ripple"))
    assert found is not None
    by_order = dict(zip(found.orders.astype(int).tolist(), found.missing.tolist(), strict=True))
    assert by_order[12] == pytest.approx(0.0045, rel=0.05)
    assert by_order[24] == pytest.approx(0.001, rel=0.05)
    assert max(v for k, v in by_order.items() if k not in (12, 24)) < 0.0001
    assert found.left[11] < 0.0001
    assert waves.spectrum(q[:100], force[:100], force[:100], waves.waves_of(rippled(), "torque_ripple")) is None


def test_a_spectrum_of_a_part_of_the_turn_is_no_larger_than_the_force() -> None:
    random = np.random.default_rng(4)
    q = 2 * np.pi * random.integers(0, 3, 800) + random.uniform(0.0, 2.5, 800)
    force = 0.0045 * np.sin(12 * q + 0.3) + 0.0003 * random.standard_normal(q.size)
    found = waves.spectrum(q, force, force, waves.waves_of(rippled(), "torque_ripple"))
    assert found is not None
    assert found.missing.max() < 0.0045
    assert found.orders[np.argmax(found.missing)] == pytest.approx(12, abs=2)


def test_a_force_folded_at_its_order_is_one_curve() -> None:
    q = np.linspace(-40.0, 60.0, 5000)
    x, order = waves.folded(q, 12.0), np.argsort(waves.folded(q, 12.0))
    assert x.min() >= 0.0
    assert x.max() < 2 * np.pi / 12
    wave = np.sin(12 * q + 0.4)[order]
    assert np.abs(np.diff(wave)).max() < 0.1


@pytest.mark.parametrize(
    ("turns", "force", "over"),
    [
        (20.0, lambda t, q: np.sin(q), "position within a turn"),
        (0.2, lambda t, q: np.sin(q), "position"),
        (20.0, lambda t, q: np.sin(9.0 * t), "time"),
    ],
)
def test_a_force_of_the_angle_is_shown_within_a_turn_however_far_it_turns(turns: float, force: Any, over: str) -> None:
    t = np.linspace(0.0, 10.0, 4000)
    position = 2 * np.pi * turns * (np.sin(1.3 * t) + 0.6 * np.sin(3.1 * t + 1.0))
    values = {"position": position, "speed": np.gradient(position, t)}
    piece = SimpleNamespace(values=values, kept=slice(None), t=t, cutoff=20.0)
    plant = Model.load("dc_motor").plant
    training = SimpleNamespace(shown=lambda unit: "rad", units={"position": "rad"})
    evidence: Any = SimpleNamespace(dataset=SimpleNamespace(plant=plant, training=training))
    found: Any = SimpleNamespace(validation=SimpleNamespace(pieces=[piece]))
    place = effect_evidence._place(evidence, found, force(t, position), ())
    assert place.name == over
    assert over != "position within a turn" or place.x.max() < 2 * np.pi


@pytest.fixture(scope="module")
def cogging(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """The diagnosis of a motor with cogging of 12 a turn that its model lacks."""
    from signlin_ros.records import Record, Signal, write_record
    from signlin_ros.simulation import simulate

    folder = tmp_path_factory.mktemp("cogging")
    base = Model.load("dc_motor").without_effect("coulomb_friction").with_options(with_position=True)
    truth = base.with_effect("cogging_torque", A=0.012, N=12.0, phi=0.4)
    base.save(folder / "model.yaml")
    for name, seed in (("fit", 1), ("unseen", 2)):
        random = np.random.default_rng(seed)
        t = np.arange(2400) / 200.0
        voltage = sum(a * np.sin(2 * np.pi * f * t + random.uniform(0, 6)) for f, a in ((0.2, 1.2), (0.7, 0.7)))
        run = simulate(truth, t, np.asarray(voltage)[:, None])
        noise = {"current": 0.02, "speed": 0.05, "position": 0.002}
        signals = {n: Signal(run[n] + s * random.standard_normal(t.size), truth.units[n]) for n, s in noise.items()}
        write_record(Record(t, {"voltage": Signal(voltage, "V"), **signals}), folder / f"{name}.csv")
    args = {"model": str(folder / "model.yaml"), "data": [str(folder / "fit.csv")]}
    return WORKER_CALLS["diagnose"]({**args, "validation": [str(folder / "unseen.csv")], "key": "x"}, lambda _: None)


@pytest.mark.slow
def test_the_evidence_of_a_ripple_is_folded_and_its_verdict_says_how_often(cogging: Any) -> None:
    (name,) = (n for n in cogging["values"] if "cogging" in n or "ripple" in n)
    assert re.match(r"12 per turn, 0\.01[12]\d* N·m", cogging["values"][name][""])
    picture = cogging["evidence"][name]
    assert picture["over"] == "position within 1/12 of a turn"
    assert numbers(picture["x"]).max() < 2 * np.pi / 12
    missing, left = (numbers(picture["spectrum"][k]) for k in ("missing", "left"))
    assert missing.argmax() == 11
    assert left[11] < 0.3 * missing[11]
    found, curve = (numbers(picture["named"][k][0]["mean"]) for k in ("found", "curve"))
    assert np.std(found - curve) < 0.3 * np.std(found)
    words = name.replace("_", " ")
    said = further._with_waves(f"The model lacks {words}: on validation data ...", cogging["values"])
    assert said.startswith(f"The model lacks {words} (12 per turn, 0.01")


# -------------------------------------------------------------------- compare


@pytest.fixture(scope="module")
def compared(hidden_effect: Path, tmp_path_factory: pytest.TempPathFactory) -> Any:
    store = tmp_path_factory.mktemp("compared") / "curves.npz"
    args = {"model": str(hidden_effect / "model.yaml"), "data": [str(hidden_effect / "validation.csv")]}
    found = WORKER_CALLS["compare"]({**args, "store": str(store)}, lambda _: None)
    return {"store": str(store), "channels": found["channels"], "inputs": found["inputs"]}


def test_the_input_stands_under_the_outputs_and_other_models_beside(compared: Any) -> None:
    shown = WORKER_CALLS["compare_curves"]({**compared, "also": [compared["store"]]}, lambda _: None)
    assert [(p["name"], p["unit"]) for p in shown["plots"]] == [("current", "A"), ("speed", "rad/s"), ("voltage", "V")]
    assert set(shown["plots"][0]["curves"]) == {"measured", "simulated", "also0", "residual"}
    assert set(shown["plots"][2]["curves"]) == {"recorded"}
    one = shown["plots"][1]["curves"]
    np.testing.assert_array_equal(numbers(one["simulated"]), numbers(one["also0"]))


def test_one_quantity_is_shown_over_another(compared: Any) -> None:
    found = WORKER_CALLS["compare_xy"]({**compared, "x": "speed", "y": "residual of speed"}, lambda _: None)
    assert set(found["curves"]) == {"measured", "simulated"}
    x, y = map(numbers, found["curves"]["measured"])
    assert x.size == y.size <= 4000
    assert np.nanstd(y) < np.nanstd(x)
    with pytest.raises(InputError, match="no such quantity"):
        WORKER_CALLS["compare_xy"]({**compared, "x": "speed", "y": "temperature"}, lambda _: None)


@pytest.mark.parametrize(
    ("score", "says"),
    [
        ({"rmse": 2.1e-4, "fit_percent": 99.9, "rmse_over_noise": 1.34e5}, "0.00021 m (RMS), 0.1 % of its spread"),
        (
            {"rmse": 0.3, "fit_percent": 80.0, "rmse_over_noise": 12.0},
            "0.3 m (RMS), 20 % of its spread, 12 times the noise",
        ),
        ({"rmse": 0.3, "fit_percent": None, "rmse_over_noise": 2.0}, "0.3 m (RMS), 2 times the noise"),
    ],
)
def test_an_error_is_told_in_its_unit(score: dict[str, Any], says: str) -> None:
    assert further._off(score, "m") == says


def test_what_was_not_computed_is_no_bar() -> None:
    text = (STATIC / "svg.js").read_text()
    assert "not computed" in text
    assert "(s?.rmse ?? 0)) / top, 1)" not in text


@pytest.mark.parametrize(("effects", "shown"), [(0, True), (1, False)])
def test_what_a_diagnosis_has_found_with_its_error_is_not_said_to_be_unknown(
    monkeypatch: pytest.MonkeyPatch, effects: int, shown: bool
) -> None:
    from types import SimpleNamespace

    finding = {"check": "excitation", "severity": "note", "channel": "", "sentence": "the record tells nothing of B"}
    found = {
        "check": {"json": {"findings": [finding]}, "directions": [None]},
        "diagnose": {"json": {"ladder": [{}] * (1 + effects)}},
    }
    session = SimpleNamespace(project=SimpleNamespace(choices={"cures": []}))
    monkeypatch.setattr(stages, "before", lambda _: "")
    monkeypatch.setattr(stages, "question", lambda *_: {"data": [], "validation": []})
    monkeypatch.setattr(stages, "result", lambda _, name, __: found[name])
    monkeypatch.setattr(stages.commands, "command", lambda _: "")
    for name in ("_named", "_looked"):
        monkeypatch.setattr(stages, name, lambda _: "")
    monkeypatch.setattr(stages, "_whose_numbers", lambda *_: "")
    monkeypatch.setattr(stages, "_remaps", lambda _, found: found["directions"])
    block = stages.check(session)  # type: ignore[arg-type]
    assert bool(block["findings"]) is shown


# -------------------------------------------------------------------- projects


def arranged(client: Client, project: str, verb: str, **args: Any) -> tuple[int, Any]:
    status, text, _ = client.ask("POST", f"/projects/{project}/{verb}", json.dumps(args).encode(), {"x-signlin": "1"})
    return status, json.loads(text)


def test_projects_are_named_duplicated_and_deleted(client: Client) -> None:
    project = client.project()
    folder = client.server.folder / ".signlin"
    file = json.loads(client.put(project, "run.csv", b"t,voltage,speed\n" + b"0,1,2\n0.1,2,3\n" * 1)[1])["file"]
    client.act(project, "take", files=[file])
    client.settled(project)
    assert arranged(client, project, "rename", name="  Achse\n 3 <b>")[0] == 200
    titles = {p["id"]: p["title"] for p in json.loads(client.ask("GET", "/projects")[1])}
    assert titles[project] == "Achse 3 <b>"
    status, answer = arranged(client, project, "duplicate")
    assert status == 200
    copy = answer["id"]
    assert (folder / copy / "run.csv").read_bytes() == (folder / project / "run.csv").read_bytes()
    titles = {p["id"]: p["title"] for p in json.loads(client.ask("GET", "/projects")[1])}
    assert titles[copy] == "copy of Achse 3 <b>"
    assert arranged(client, copy, "delete")[0] == 200
    assert not (folder / copy).exists()
    assert (folder / project / "run.csv").exists()
    assert client.ask("GET", f"/p/{copy}/state")[0] == 404
    assert arranged(client, project, "explode")[0] == 404


# -------------------------------------------------------------------- use


def test_the_model_can_be_had_before_the_report_which_speaks_of_the_model_as_it_is(
    client: Client, hidden_effect: Path
) -> None:
    project = client.project()
    for name in ("model.yaml", "estimation.csv", "validation.csv"):
        client.put(project, name, (hidden_effect / name).read_bytes())
    client.act(project, "take", files=["model.yaml", "estimation.csv", "validation.csv"])
    client.settled(project)
    client.act(project, "diagnose")
    assert "Coulomb friction" in client.settled(project)["stages"][3]["sentence"]
    client.act(project, "add", effect="coulomb_friction")
    client.settled(project)
    client.act(project, "export")
    while not client.state(project)["stages"][5].get("files"):
        pass
    state = client.state(project)
    if state["busy"]:
        assert state["stages"][5]["files"] == ["model.yaml", "replay.sh"]
        assert client.ask("GET", f"/p/{project}/export/model.yaml")[0] == 200
    assert client.settled(project)["stages"][5]["files"] == ["model.yaml", "report.html", "replay.sh"]
    report = client.ask("GET", f"/p/{project}/export/report.html")[1]
    assert "an effect is missing" not in report
    assert "What was added to the model" in report
    assert "The model has Coulomb friction, added from these records." in report
    assert "+ Coulomb friction" in report


def test_the_model_is_had_for_another_tool_with_what_is_lost(client: Client, hidden_effect: Path) -> None:
    project = client.project()
    for name in ("model.yaml", "estimation.csv"):
        client.put(project, name, (hidden_effect / name).read_bytes())
    client.act(project, "take", files=["model.yaml", "estimation.csv"])
    client.settled(project)
    assert client.act(project, "use", target="spreadsheet")[0] == 404
    client.act(project, "use", target="casadi")
    block = client.settled(project)["stages"][5]
    assert block["target"] == "casadi"
    assert block["made"] == ["model_casadi.py"]
    assert block["loss"]["against"] == "the measurement"
    assert all(channel["target"] >= 0 for channel in block["loss"]["loss"].values())
    assert block["loss"]["loss"]
    status, text = client.ask("GET", f"/p/{project}/export/model_casadi.py")[:2]
    assert status == 200
    assert "def dynamics" in text


# -------------------------------------------------------------------- in the browser


def test_what_is_looked_at_stays_where_it_is_and_numbers_are_typed(
    server: Callable[..., Server], browser: Callable[..., Page], hidden_effect: Path
) -> None:
    page = browser(1280, 900)
    page.open(server(str(hidden_effect / "model.yaml"), str(hidden_effect / "validation.csv")).address)
    page.done("check")
    page.press("do-compare")
    page.done("compare")
    page.driver.execute_script("document.getElementById('tuner').open = true")
    page.wait(lambda: page.driver.find_elements("css selector", "#plots-tune[data-drawn]"), "the simulation")
    from selenium.webdriver import Keys

    page.type("type-J", Keys.CONTROL, "a", Keys.NULL, "0", Keys.ENTER)
    assert page.driver.execute_script("return document.getElementById('type-J').validationMessage").startswith(
        "allowed"
    )
    page.type("type-J", Keys.CONTROL, "a", Keys.NULL, "0,0021", Keys.ENTER)
    page.wait(lambda: page.driver.find_element("id", "keep").is_enabled(), "the value to be taken")
    page.still()
    before = page.centre("keep")
    for button in ("keep", "undo"):
        with page.settling():
            page.click(button, scroll=False)
        page.still()
        page.wait(lambda: abs(page.top("keep") - before) < 60, "the button to be where it was")
    page.driver.execute_script(GROW, "#stage-compare .head", 700)  # long after the last click, something above grows
    page.wait(lambda: page.driver.execute_script(GROWN), "the growth")
    assert abs(page.top("keep") - before) < 60
    before = page.centre("scores")  # somewhere else, and nothing clicked on
    page.driver.execute_script(GROW, "#stage-record .head", 300)
    page.wait(lambda: page.driver.execute_script(GROWN), "the growth")
    assert abs(page.top("scores") - before) < 60
    wide = "return document.documentElement.scrollWidth - document.documentElement.clientWidth"
    assert page.driver.execute_script(wide) <= 0
    assert page.chosen("type-J") == "0.0022"


def test_ten_thousand_columns_are_a_page_of_a_few_screens(
    server: Callable[..., Server], browser: Callable[..., Page], tmp_path: Path
) -> None:
    """What is tested is how much is drawn, and that the rest is found: not how long it takes."""
    width, wide = 10_000, tmp_path / "wide.csv"
    head = ",".join(["t", "voltage", "speed", *(f"drive/axis{k % 7}/temperature_{k}" for k in range(width))])
    cells = "," + ",".join(["20.5"] * width)
    wide.write_text("\n".join([head, *(f"{0.01 * k:g},{k % 3},{0.2 * k:g}{cells}" for k in range(40)), ""]))
    page = browser(1280, 900)
    page.open(server("dc_motor", str(wide)).address)
    page.done("record")
    page.still()
    run = page.driver.execute_script
    assert run("return document.querySelectorAll('*').length") < 3000
    assert run("return document.documentElement.scrollHeight") < 6000
    assert run("return document.documentElement.scrollWidth - document.documentElement.clientWidth") <= 0
    assert page.driver.find_element("id", "find-column").get_attribute("placeholder") == f"one of {width + 2} columns"
    page.type("find-column", "axis3 9999")
    column = "see-column-drive/axis3/temperature_9999"
    page.wait(lambda: len(page.driver.find_elements("css selector", "#tree input")) == 1, "one column to be found")
    page.click(column)
    label = '#plots-record [aria-label^="drive/axis3/temperature_9999"]'
    page.wait(lambda: page.driver.find_elements("css selector", label), "its curve")
    assert len(page.driver.find_elements("css selector", "#plots-record .plot")) <= 4
