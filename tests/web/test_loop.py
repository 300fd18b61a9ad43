"""The whole loop in a browser: drop two files, compare, diagnose, add, the error falls, export; and it is replayed."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from click.testing import CliRunner

from signlin_ros.cli import signlin

if TYPE_CHECKING:
    from conftest import Page, Server


def scores(page: Page) -> dict[str, dict[str, float]]:
    """What the table of scores says, every digit of it."""
    rows = page.driver.find_elements("css selector", "#stage-compare table.scores tbody tr")
    kinds = ("windowed", "free")
    return {r.get_attribute("data-channel"): {k: float(r.get_attribute(f"data-{k}")) for k in kinds} for r in rows}


def crosshair(page: Page, plots: str) -> list[str]:
    """Point into the middle of the first of some plots; return what stands at the crosshair of each."""
    from selenium.webdriver import ActionChains

    inside = page.driver.find_element("css selector", f"#{plots} .u-over")
    page.driver.execute_script("arguments[0].scrollIntoView({block: 'center', behavior: 'instant'})", inside)
    ActionChains(page.driver).move_to_element(inside).perform()
    text = "return [...document.querySelectorAll(`#${arguments[0]} .reading`)].map((e) => e.textContent)"
    return list(page.wait(lambda: [t for t in page.driver.execute_script(text, plots) if t], "values at the crosshair"))


def environment() -> dict[str, str]:
    places = (str(Path(__file__).parents[2]), os.environ.get("PYTHONPATH", ""))
    return {**os.environ, "PYTHONPATH": os.pathsep.join(places)}


def answered(*arguments: str) -> Any:
    """Return what the command line answers, here in this process."""
    return json.loads(CliRunner().invoke(signlin, [*arguments, "--json"], catch_exceptions=False).stdout)


def printed(content: Any) -> dict[str, dict[str, float]]:
    """The same scores as the command line prints them."""
    names = {"windowed": "windowed", "free": "free_run"}
    return {c: {k: s[n]["rmse"] for k, n in names.items()} for c, s in content["channels"].items()}


def test_the_loop_by_clicks_alone(
    server: Callable[..., Server], browser: Callable[..., Page], hidden_effect: Path, tmp_path: Path
) -> None:
    given, page = server(str(hidden_effect / "model.yaml")), browser()
    page.open(given.address)
    page.picture("1_empty")
    page.drop(hidden_effect / "estimation.csv", hidden_effect / "validation.csv")
    page.done("check")
    page.picture("2_record")
    page.picture("3_check", "stage-check")
    page.click("do-compare")
    page.done("compare")
    page.wait(lambda: page.driver.find_elements("css selector", "#plots-compare canvas"), "the curves")
    page.picture("4_compare", "stage-compare")
    page.still()
    readings = crosshair(page, "plots-compare")
    assert re.search(r"\d s: measured -?[\d.e-]+, simulated -?[\d.e-]+ rad/s", " ".join(readings)), readings
    before = scores(page)
    page.click("do-diagnose")
    page.picture("5_diagnosing", "stage-diagnose")
    page.done("diagnose")
    assert "Coulomb friction" in page.says("diagnose")
    page.picture("6_diagnosed", "stage-diagnose")
    page.click("do-add")
    page.done("add")
    page.wait(lambda: page.driver.find_elements("css selector", "#ladder svg"), "the ladder")
    page.picture("7_added", "stage-add")
    page.driver.execute_script("document.getElementById('shown-coulomb_friction').open = true")
    evidence = page.driver.find_element("id", "shown-coulomb_friction")
    page.wait(lambda: "their mean, ± 2 standard errors" in evidence.text, "the legend of the evidence")
    assert "computed with Coulomb friction" in evidence.text
    after = scores(page)
    assert after["speed"]["windowed"] < 0.5 * before["speed"]["windowed"]
    page.click("do-use")
    page.done("use")
    page.picture("8_exported", "stage-use")
    assert page.clicks <= 8

    (project,) = (given.folder / ".signlin").iterdir()
    validation = str(project / "validation.csv")
    assert printed(answered("compare", str(project / "export" / "model.yaml"), validation)) == after

    script = project / "export" / "replay.sh"
    path = tmp_path / "bin"
    path.mkdir()
    (path / "signlin").write_text(f'#!/bin/sh\nexec "{sys.executable}" -m signlin_ros.cli "$@"\n')
    (path / "signlin").chmod(0o755)
    env = environment()
    subprocess.run(["sh", str(script)], check=True, env={**env, "PATH": f"{path}:{env['PATH']}"}, capture_output=True)
    answers = sorted((project / "replay").glob("*_compare.json"))
    assert [printed(json.loads(a.read_text())) for a in answers] == [before, after]

    messages = [m for m in page.driver.get_log("browser") if m["level"] == "SEVERE"]
    assert messages == []
