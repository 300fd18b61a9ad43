"""What the page shows when something fails, is cancelled, is taken back, or the server dies."""

from __future__ import annotations

import json
import signal
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from conftest import Client, Page, Server

SERVED = "voltage,current,speed"


def table(path: Path, header: str, rows: int) -> Path:
    path.write_text(f"{header}\n" + "".join(f"{0.01 * k:g},{k % 3},{0.1 * k:g},{0.2 * k:g}\n" for k in range(rows)))
    return path


def test_what_cannot_be_read_or_used_is_told_where_it_fails(
    server: Callable[..., Server], browser: Callable[..., Page], tmp_path: Path
) -> None:
    page = browser(1280, 800)
    page.open(server().address)
    page.drop(table(tmp_path / "table.xyz", f"t,{SERVED}", 10))
    assert "is no record and no model" in page.error("record")
    page.picture("error_kind")
    torn = tmp_path / "torn.csv"
    torn.write_text(f"t,{SERVED}\n0,1,2,3\n0.01,1,two,3\n")
    page.drop(torn)
    page.wait(lambda: "torn.csv" in page.error("record") and "two" in page.error("record"), "the bad cell to be named")
    page.picture("error_record")
    page.click("drop-torn.csv")
    page.wait(lambda: not page.busy and not page.driver.find_elements("id", "drop-torn.csv"), "the record to be gone")
    page.drop(table(tmp_path / "odd.csv", "t,a,b,c", 200))
    page.wait(lambda: "No column for voltage" in page.says("record"), "the missing column")
    assert "mapping is not complete" in page.says("compare")
    page.picture("error_mapping")


@pytest.mark.parametrize("stage", ["compare", "diagnose", "add", "use"])
def test_each_stage_tells_what_failed_and_what_to_do(client: Client, stage: str) -> None:
    project = client.project()
    folder = client.server.folder / ".signlin" / project
    table(folder / "run.csv", f"t,{SERVED}", 300)
    client.act(project, "take", files=["run.csv"])
    state = client.settled(project)
    assert [b["error"] for b in state["stages"]] == [None] * 6
    assert "no such effect" in client.act(project, "add", effect="coulomb_friction")[1]
    if stage == "use":
        (folder / "export").write_text("in the way")
        client.act(project, "export")
    elif stage == "add":
        assert client.act(project, "keep", values={"J": -1.0}) == (200, '{"ok":true}')
    else:
        (folder / "run.csv").write_text("t\n")
        client.act(project, stage)
    state = client.settled(project)
    blocks = {b["id"]: b for b in state["stages"]}
    if stage in ("compare", "diagnose"):  # the file has changed: what was known of it is known no more
        assert blocks[stage]["why"] == "The files have changed: open the page anew to read them again."
    else:
        assert blocks[stage]["error"]["what"]
        assert blocks[stage]["error"]["do"]


def test_a_record_that_is_too_short_stops_at_compare_with_the_reason(
    server: Callable[..., Server], browser: Callable[..., Page], tmp_path: Path
) -> None:
    page = browser(1280, 800)
    page.open(server().address)
    page.drop(table(tmp_path / "short.csv", f"t,{SERVED}", 12))
    page.done("check")
    page.click("do-compare")
    assert "fewer than 20 samples" in page.error("compare")
    page.picture("error_compare", "stage-compare")


def test_a_diagnosis_is_cancelled_within_a_second_and_nothing_is_left(
    server: Callable[..., Server],
    browser: Callable[..., Page],
    hidden_effect: Path,
    longer: Callable[..., Path],
    tmp_path: Path,
) -> None:
    psutil = pytest.importorskip("psutil")
    record = longer(hidden_effect / "estimation.csv", 10, tmp_path / "long.csv")
    given, page = server(str(hidden_effect / "model.yaml"), str(record)), browser(1280, 800)
    page.open(given.address)
    page.done("check")
    page.click("do-diagnose")
    page.wait(lambda: page.driver.find_elements("id", "cancel"), "the diagnosis to run")
    page.wait(lambda: psutil.Process(given.process.pid).children(recursive=True), "its processes")
    workers = {p.pid for p in psutil.Process(given.process.pid).children(recursive=True)}
    page.picture("diagnosing", "stage-diagnose")
    page.click("cancel")
    assert "Cancelled" in page.error("diagnose")
    left = {p.pid for p in psutil.Process(given.process.pid).children(recursive=True)}
    assert workers - left
    page.picture("cancelled", "stage-diagnose")
    page.wait(lambda: page.driver.find_element("id", "do-diagnose").is_enabled(), "another diagnosis to be possible")


def test_a_long_comparison_tells_what_it_does_and_is_cancelled(
    client: Client, hidden_effect: Path, longer: Callable[..., Path], tmp_path: Path
) -> None:
    project = client.project()
    record = longer(hidden_effect / "estimation.csv", 60, tmp_path / "long.csv")  # some 96,000 rows
    bodies = {"model.yaml": (hidden_effect / "model.yaml").read_bytes(), "long.csv": record.read_bytes()}
    names = [json.loads(client.put(project, name, body)[1])["file"] for name, body in bodies.items()]
    client.act(project, "take", files=names)
    assert client.settled(project)["stages"][1]["done"]
    assert client.act(project, "compare")[0] == 200
    while not (busy := client.state(project)["busy"]) or busy["share"] == 0.0:
        assert busy, "it ended before anything was told"
    assert busy["stage"] == "compare"
    assert busy["what"]
    client.act(project, "cancel")
    state = client.settled(project)
    (block,) = (b for b in state["stages"] if b["id"] == "compare")
    assert block["error"]["what"] == "Cancelled."
    assert not block["done"]
    assert not list((client.server.folder / ".signlin" / project / "results").glob("compare-*"))
    assert client.act(project, "check")[0] == 200  # something else goes at once
    assert client.settled(project)["stages"][1]["done"]


def test_nothing_is_lost_when_the_server_is_killed(
    server: Callable[..., Server], browser: Callable[..., Page], hidden_effect: Path
) -> None:
    port = "18" + str(time.time_ns())[-3:]
    given, page = (
        server(str(hidden_effect / "model.yaml"), str(hidden_effect / "validation.csv"), "--port", port, copied=False),
        browser(),
    )
    page.open(given.address)
    page.done("check")
    page.click("do-compare")
    page.done("compare")
    shown, address = page.says("compare"), page.driver.current_url
    given.stop(signal.SIGKILL)
    page.wait(lambda: page.driver.find_element("id", "lost").is_displayed(), "the loss to be told")
    page.picture("lost")
    given.arguments = ("--port", port)
    given.start()
    page.wait(lambda: not page.driver.find_element("id", "lost").is_displayed(), "the page to go on by itself")
    page.open(address)
    assert page.says("compare") == shown
    page.wait(lambda: page.driver.find_elements("css selector", "#plots-compare canvas"), "the curves")


def test_a_server_that_is_ended_while_a_page_looks_ends_at_once_and_says_nothing(
    server: Callable[..., Server], browser: Callable[..., Page]
) -> None:
    psutil = pytest.importorskip("psutil")
    given, page = server(copied=False), browser(1280, 800)
    page.open(given.address)
    page.click("tab-live")
    page.wait(lambda: psutil.Process(given.process.pid).children(), "the workers")
    workers = psutil.Process(given.process.pid).children(recursive=True)
    given.stop(signal.SIGINT)
    assert given.process.returncode in (0, 130, -signal.SIGINT)
    assert "Error" not in given.log.read_text()
    assert "Traceback" not in given.log.read_text()
    _, alive = psutil.wait_procs(workers, timeout=30)
    assert alive == []


def test_steps_are_taken_back_and_taken_again(
    server: Callable[..., Server], browser: Callable[..., Page], hidden_effect: Path
) -> None:
    page = browser(1280, 800)
    page.open(server(str(hidden_effect / "model.yaml")).address)
    page.drop(hidden_effect / "estimation.csv", hidden_effect / "validation.csv")
    page.done("check")
    page.choose("role-validation.csv", "estimation")
    page.wait(lambda: page.chosen("role-validation.csv") == "estimation", "the role to change")
    page.wait(lambda: not page.busy, "the check")
    page.click("undo")
    page.wait(lambda: page.chosen("role-validation.csv") == "validation", "the role to be back")
    page.click("redo")
    page.wait(lambda: page.chosen("role-validation.csv") == "estimation", "the role to change again")


@pytest.mark.parametrize("dark", [False, True])
def test_the_keyboard_alone_reaches_and_zooms(
    server: Callable[..., Server], browser: Callable[..., Page], hidden_effect: Path, dark: bool
) -> None:
    from selenium.webdriver import ActionChains, Keys

    page = browser(1280, 800)
    page.open(server(str(hidden_effect / "model.yaml"), str(hidden_effect / "validation.csv")).address)
    page.done("check")
    if dark and page.driver.find_element("id", "theme").get_attribute("aria-pressed") == "false":
        page.click("theme")
    page.still()
    page.click("to-record")
    for _ in range(60):
        ActionChains(page.driver).send_keys(Keys.TAB).perform()
        if page.focused == "do-compare":
            break
    assert page.focused == "do-compare"
    ActionChains(page.driver).send_keys(Keys.ENTER).perform()
    page.done("compare")
    plots = page.wait(lambda: page.driver.find_elements("css selector", "#plots-compare[data-drawn]"), "the curves")[0]
    page.driver.execute_script("arguments[0].focus()", plots)
    ActionChains(page.driver).send_keys("+").perform()
    page.wait(lambda: plots.get_attribute("data-drawn") == "2", "the zoom")
    page.picture(f"compare_1280_{'dark' if dark else 'light'}", "stage-compare")
