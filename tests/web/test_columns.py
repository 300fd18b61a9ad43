"""Which column is which signal: said by hand for each layout of columns, kept, refused, put right."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import yaml

if TYPE_CHECKING:
    from conftest import Client, Page, Server

RIGHT = {"voltage": "c2", "current": "c3", "speed": "c4"}
"""Columns of a record without a header, as `bare` writes it: time, voltage, current, speed."""


def bare(source: Path, target: Path, order: tuple[int, ...] = (0, 1, 2, 3), rows: int = 1600) -> Path:
    """Write a record without its header, its columns in another order."""
    values = np.loadtxt(source, delimiter=",", skiprows=1)[:rows, list(order)]
    np.savetxt(target, values, fmt="%.9g", delimiter=",")
    return target


def with_direction(source: Path, target: Path) -> Path:
    """Write a record whose voltage has no sign, which stands in a column of letters."""
    t, u, i, w = np.loadtxt(source, delimiter=",", skiprows=1).T
    rows = (f"{a:.9g},{abs(b):.9g},{'FR'[int(b < 0)]},{c:.9g},{d:.9g}\n" for a, b, c, d in zip(t, u, i, w, strict=True))
    target.write_text("t,pwm,dir,current,speed\n" + "".join(rows))
    return target


class Project:
    """A project that is driven without a browser."""

    def __init__(self, client: Client) -> None:
        self.client, self.id = client, client.project()
        self.folder = client.server.folder / ".signlin" / self.id

    def do(self, action: str, **args: Any) -> Any:
        """Do something, and return the state that it leads to."""
        status, text = self.client.act(self.id, action, **args)
        assert status == 200, text
        return self.client.settled(self.id)

    def take(self, *files: Path) -> Any:
        for file in files:
            assert self.client.put(self.id, file.name, file.read_bytes())[0] == 200
        return self.do("take", files=[file.name for file in files])

    def map(self, columns: Mapping[str, str], file: str) -> Any:
        for signal, column in columns.items():
            self.do("map_signal", file=file, signal=signal, column=column)
        return self.client.settled(self.id)


@pytest.fixture
def project(client: Client) -> Project:
    return Project(client)


def stages(state: Any) -> dict[str, Any]:
    return {block["id"]: block for block in state["stages"]}


def mapped(state: Any, table: int = 0) -> dict[str, str | None]:
    return {row["signal"]: row["column"] for row in state["mapping"][table]["rows"]}


def test_columns_are_listed_with_what_they_hold(project: Project, hidden_effect: Path, tmp_path: Path) -> None:
    file = tmp_path / "run.csv"
    lines = [f"{0.01 * k:g},{k % 3},F,7,{0.5 * k:g}" for k in range(100)]
    file.write_text("t_ms,voltage,dir,c,speed [rpm]\n" + "\n".join(lines) + "\n")
    found = project.take(file)["records"][0]["found"]
    columns = {c["label"]: (c["low"], c["high"]) for c in found["columns"]}
    assert columns == {"voltage": (0.0, 2.0), "c": (7.0, 7.0), "speed [rpm]": (0.0, 49.5)}
    assert found["texts"] == ["dir"]
    assert "time from 't_ms', converted from ms to s" in found["notes"]
    state = project.do("model", name="dc_motor")
    (speed,) = (row for row in state["mapping"][0]["rows"] if row["signal"] == "speed")
    assert {"rad/s", "rpm", "turns/s"} <= set(speed["units"])
    assert "m/s" not in speed["units"]


def test_no_two_signals_are_one_column_and_no_stage_says_otherwise(
    project: Project, hidden_effect: Path, tmp_path: Path
) -> None:
    file = bare(hidden_effect / "estimation.csv", tmp_path / "bare.csv")
    project.take(file)
    project.do("model", name="dc_motor")
    state = project.map({**RIGHT, "current": "c4"}, file.name)
    blocks = stages(state)
    assert "the column 'c4' is read as current and as speed" in blocks["record"]["error"]["what"]
    assert not blocks["record"]["done"]
    assert blocks["record"]["needs"]
    assert "All that the model needs" not in blocks["record"]["sentence"]
    assert {blocks[name]["why"] for name in ("check", "compare", "use")} == {"The mapping is not complete: see Record."}
    state = project.map(RIGHT, file.name)
    assert stages(state)["record"]["error"] is None
    assert stages(state)["check"]["done"]
    looked = " ".join(stages(state)["check"]["looked"])
    assert "as you set it: voltage = c2, current = c3, speed = c4" in looked


SERVO = {
    "plant": "servo",
    "parameters": {"K_t": 0.6, "R": 2.5, "J": 0.005, "mass": 0.3, "length": 0.2, "kp": 800.0, "vin": 11.1}
    | {"duty_per_error": 0.004},
    "effects": {"viscous_friction": {"b": 0.02}, "coulomb_friction": {"mu": 0.03}},
    "frozen": ["mass", "length", "kp", "duty_per_error", "vin"],
    "tolerance": 0.2,
    "update_period": 0.05,
}


def test_what_is_known_of_a_record_is_said_of_it_alone(project: Project, client: Client, tmp_path: Path) -> None:
    t = 0.01 * np.arange(300)
    for name, size in (("a.csv", 0.4), ("b.csv", 0.8)):
        table = np.column_stack([t, size * np.sin(4 * t), 0.9 * size * np.sin(4 * t - 0.1)])
        np.savetxt(tmp_path / name, table, delimiter=",", header="t,goal_position,position", comments="", fmt="%.6g")
    (tmp_path / "servo.yaml").write_text(yaml.safe_dump({"/**": {"ros__parameters": SERVO}}))
    state = project.take(tmp_path / "servo.yaml", tmp_path / "a.csv", tmp_path / "b.csv")
    assert state["model"]["conditions"] == {"kp": 800.0, "mass": 0.3, "length": 0.2, "vin": 11.1}
    project.do("known", file="a.csv", name="kp", value="400")
    state = project.do("known", file="b.csv", name="mass", value="0,5")
    assert [r.get("known") for r in state["records"]] == [{"kp": "400"}, {"mass": "0.5"}]
    assert stages(state)["check"]["command"].endswith("--signal a.csv:kp=400 --signal b.csv:mass=0.5")
    assert [table["files"] for table in state["mapping"]] == [["a.csv", "b.csv"]]
    state = project.do("known", file="a.csv", name="kp", value="")
    assert stages(state)["check"]["command"].endswith("b.csv --signal b.csv:mass=0.5")
    for name, value, words in (
        ("kp", "much", "found 'much'; allowed: a number"),
        ("J", "1", "there are: kp, mass, length"),
    ):
        status, text = client.act(project.id, "known", file="a.csv", name=name, value=value)
        assert status == 400
        assert words in text


def test_a_mapping_is_kept_when_another_model_or_record_comes(
    project: Project, hidden_effect: Path, tmp_path: Path
) -> None:
    first = bare(hidden_effect / "estimation.csv", tmp_path / "bare.csv")
    project.take(first)
    project.do("model", name="dc_motor")
    project.map(RIGHT, first.name)
    assert mapped(project.take(hidden_effect / "model.yaml")) == RIGHT
    same = bare(hidden_effect / "validation.csv", tmp_path / "same.csv")
    state = project.take(same)
    assert [table["files"] for table in state["mapping"]] == [["bare.csv", "same.csv"]]
    assert mapped(state) == RIGHT
    assert stages(state)["check"]["command"].endswith("--signal voltage=c2 --signal current=c3 --signal speed=c4")

    other = bare(hidden_effect / "validation.csv", tmp_path / "other.csv", (0, 0, 3, 2, 1))
    state = project.take(other)
    assert [table["files"] for table in state["mapping"]] == [["bare.csv", "same.csv"], ["other.csv"]]
    assert mapped(state) == RIGHT
    assert mapped(state, 1) == dict.fromkeys(RIGHT)
    assert stages(state)["record"]["sentence"].endswith("other.csv: No column for voltage: choose one below.")
    state = project.map({"voltage": "c5", "current": "c4", "speed": "c3"}, other.name)
    assert mapped(state) == RIGHT
    assert stages(state)["check"]["done"]
    command = stages(state)["check"]["command"]
    assert "--signal other.csv:speed=c3" in command
    assert "--signal bare.csv:speed=c4" in command
    assert stages(project.do("compare"))["compare"]["done"]


def test_records_with_the_same_columns_can_be_mapped_one_by_one(
    project: Project, hidden_effect: Path, tmp_path: Path
) -> None:
    one = bare(hidden_effect / "estimation.csv", tmp_path / "one.csv")
    two = bare(hidden_effect / "validation.csv", tmp_path / "two.csv", (0, 3, 2, 1))
    project.take(one, two)
    project.do("model", name="dc_motor")
    project.map(RIGHT, one.name)
    state = project.do("apart", file=one.name)
    assert [table["files"] for table in state["mapping"]] == [["one.csv"], ["two.csv"]]
    state = project.map({"voltage": "c4", "speed": "c2"}, two.name)
    assert mapped(state) == RIGHT
    assert mapped(state, 1) == {"voltage": "c4", "current": "c3", "speed": "c2"}
    assert stages(state)["check"]["done"]
    state = project.do("apart", file=one.name)
    assert [table["files"] for table in state["mapping"]] == [["one.csv", "two.csv"]]
    assert mapped(state) == RIGHT
    assert project.client.act(project.id, "apart", file="none.csv")[0] != 200


def test_columns_that_are_mixed_up_are_put_right_by_a_click(
    server: Callable[..., Server], browser: Callable[..., Page], hidden_effect: Path, tmp_path: Path
) -> None:
    page = browser(1280, 900)
    page.open(server().address)
    with page.settling():
        page.drop(bare(hidden_effect / "estimation.csv", tmp_path / "bare.csv"))
    page.choose("model", "dc_motor")
    for signal, column in {**RIGHT, "current": "c4", "speed": "c3"}.items():
        page.choose(f"map-{signal}", column)
    assert "1 finding must be cured" in page.says("check")
    assert "Check comes first" in page.says("compare")
    page.wait(lambda: "needs you" in page.driver.find_element("id", "to-check").text, "the check to ask")
    page.picture("mixed_up", "stage-check")
    page.press("as-they-are")
    page.click("do-compare")
    page.done("compare")
    assert page.says("compare").startswith("The model follows current")
    assert "with current and speed exchanged the model follows the record" in page.says("compare")
    page.picture("fits_no_model", "stage-compare")
    page.click("to-columns")
    assert page.driver.switch_to.active_element.get_attribute("id") == "map-voltage"
    page.press("remap-1")  # beside the note on the time
    assert {signal: page.chosen(f"map-{signal}") for signal in RIGHT} == RIGHT
    assert page.says("check") == "Nothing forbids to go on. The columns are taken as you named them."


def test_a_formula_is_written_or_taken_from_the_check(
    server: Callable[..., Server], browser: Callable[..., Page], hidden_effect: Path, tmp_path: Path
) -> None:
    from selenium.webdriver import Keys

    page = browser(1280, 900)
    given = server()
    page.open(given.address)
    with page.settling():
        page.drop(with_direction(hidden_effect / "estimation.csv", tmp_path / "driver.csv"))
    page.choose("model", "dc_motor")
    page.shows("record", "guessed: called 'pwm'; in what unit? Taken in V")
    page.press("remap-0")
    assert page.chosen("formula-voltage") == "sign(dir) * pwm"
    assert page.says("check") == "Nothing was found wrong. The columns are taken as you named them."
    page.picture("direction", "stage-record")
    page.write("formula-voltage", "0.5 * sign(dir) * pwm +")
    assert "it ends where a number or a column should be" in page.error("record")
    assert page.says("check") == "The mapping is not complete: see Record."
    page.picture("error_formula", "stage-record")
    page.write("formula-voltage", "1.0 * sign(dir) * pwm - 0")
    assert not page.driver.find_elements("id", "error-record")
    assert page.says("check") == "Nothing was found wrong. The columns are taken as you named them."
    page.shows("check", "--signal 'voltage=1.0 * sign(dir) * pwm - 0'")

    with page.settling():
        page.type("formula-speed", "2 * spe")
        given.client().act(page.driver.current_url.rsplit("/", 1)[1], "check")
    assert page.chosen("formula-speed") == "2 * spe"
    page.type("formula-speed", Keys.CONTROL, "a", Keys.NULL, Keys.DELETE)
    page.write("formula-voltage", "")
    assert page.chosen("map-voltage") == "pwm"
    page.write("formula-t", "t [ms]")
    page.shows("record", "converted from ms to s")


def test_what_is_launched_is_a_file_that_is_there(project: Project, hidden_effect: Path) -> None:
    project.take(hidden_effect / "estimation.csv")
    state = project.do("model", name="dc_motor")

    def launched(state: Any) -> Path:
        file = project.client.server.folder / stages(state)["use"]["command"].split("--params-file ")[1]
        assert "/**" in yaml.safe_load(file.read_text())
        return file

    assert launched(state).name == "dc_motor.yaml"
    assert launched(project.do("export")) == project.folder / "export" / "model.yaml"
    assert launched(project.take(hidden_effect / "model.yaml")) == project.folder / "model.yaml"


def test_a_single_record_shows_the_values_and_why_there_is_no_picture(
    project: Project, hidden_effect: Path, tmp_path: Path
) -> None:
    short = tmp_path / "short.csv"
    short.write_text("".join((hidden_effect / "estimation.csv").read_text().splitlines(keepends=True)[:401]))
    project.take(hidden_effect / "model.yaml", short)
    state = project.do("diagnose")
    found = stages(state)["diagnose"]["result"]
    assert list(found["values"]) == ["coulomb_friction"]
    value, error = found["values"]["coulomb_friction"]["mu"].removesuffix(" N·m").split(" ± ")
    estimate = found["json"]["parameters"]["coulomb_friction.mu"]
    assert float(value) == pytest.approx(estimate["value"], abs=estimate["std"])
    assert float(error) == pytest.approx(estimate["std"], rel=0.1)
    assert set(found["evidence"]) | set(found["unseen"]) == {"coulomb_friction"}
    added = stages(project.do("add", effect="coulomb_friction"))["add"]
    assert added["result"]["values"]["coulomb_friction"]["mu"].endswith(" N·m")
    assert added["unseen"] == "the last third of the record, held out"


def test_projects_are_listed_and_led_to(
    server: Callable[..., Server], browser: Callable[..., Page], hidden_effect: Path
) -> None:
    given = server(str(hidden_effect / "model.yaml"), str(hidden_effect / "estimation.csv"))
    page = browser(1280, 800)
    page.open(given.address)
    page.done("check")
    (first,) = (folder.name for folder in (given.folder / ".signlin").iterdir())
    page.click("arrange-open")
    page.click("new")
    page.wait(lambda: first not in page.driver.current_url, "the new project")
    page.wait(lambda: page.driver.find_elements("css selector", "#projects option + option"), "the list of projects")
    assert "model.yaml, estimation.csv" in page.driver.find_element("id", "projects").text
    listed = json.loads(given.client().ask("GET", "/projects")[1])
    assert [p["id"] for p in listed][-1] == first
    page.driver.execute_script(
        "const s = document.getElementById('projects'); s.value = arguments[0]; s.dispatchEvent(new Event('change'))",
        first,
    )
    page.wait(lambda: first in page.driver.current_url, "the first project")
    page.wait(lambda: page.driver.find_elements("id", "says-record"), "its page")
    page.wait(lambda: "All that the model needs is there" in page.says("record"), "its record")


def test_a_single_record_cannot_be_held_out(
    server: Callable[..., Server], browser: Callable[..., Page], hidden_effect: Path
) -> None:
    page = browser(1280, 800)
    page.open(server(str(hidden_effect / "model.yaml"), str(hidden_effect / "estimation.csv")).address)
    page.done("check")
    (role,) = page.driver.find_elements("css selector", "#stage-record select[id^=role]")
    assert not role.is_enabled()
    page.shows("record", "but its last third")
