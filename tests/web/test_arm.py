"""An arm on the page: its records are checked, its joints compared and diagnosed; what the page cannot do is said."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from tests.arm_records import SMALL, record, small, written

if TYPE_CHECKING:
    from conftest import Client, Page, Server

MODEL = small()
NAMES = MODEL.robot.names


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A model that lacks the elbow's Coulomb friction, its URDF, and two records."""
    shutil.copy(SMALL.with_suffix(".urdf"), tmp_path / "small_arm.urdf")
    text = SMALL.read_text(encoding="utf-8")
    lines = [line for line in text.splitlines() if "coulomb_friction: {mu: 0.6}" not in line]
    (tmp_path / "small_arm.yaml").write_text("\n".join(lines), encoding="utf-8")
    for k in (1, 2):
        written(tmp_path / f"run_{k}.csv", NAMES, *record(MODEL, k))
    return tmp_path


FILES = ("small_arm.yaml", "small_arm.urdf", "run_1.csv", "run_2.csv")


def stages(state: Any) -> dict[str, Any]:
    return {block["id"]: block for block in state["stages"]}


@pytest.mark.slow
def test_joints_are_compared_and_what_is_missing_is_told(client: Client, folder: Path) -> None:
    project = client.project()
    for name in FILES:
        client.put(project, name, (folder / name).read_bytes())
    client.act(project, "take", files=list(FILES))
    found = stages(client.settled(project))
    assert found["record"]["done"]
    assert found["check"]["sentence"] == "Nothing was found wrong."
    client.act(project, "compare")
    found = stages(client.settled(project))
    assert set(found["compare"]["result"]["json"]["joints"]) == set(NAMES)
    assert "elbow" in found["compare"]["sentence"]
    client.act(project, "diagnose")
    found = stages(client.settled(project))
    assert found["diagnose"]["sentence"] == "Missing: elbow.Coulomb friction."
    assert any(line.startswith("elbow: Coulomb friction") for line in found["diagnose"]["result"]["json"]["sentences"])
    assert "signlin refine" in found["add"]["why"]
    assert "signlin export" in found["use"]["why"]
    for action, args in (("add", {"effect": "elbow.coulomb_friction"}), ("use", {"target": "mjcf"}), ("refit", {})):
        client.act(project, action, **args)
        state = client.settled(project)
        assert not any("fault" in str(block["error"]) for block in state["stages"])


@pytest.mark.slow
def test_a_finding_of_a_joint_is_cured_on_the_page(client: Client, folder: Path) -> None:
    t, q, v, u = record(MODEL, 1)
    written(folder / "run_1.csv", NAMES, t, q, v, u * np.array([1, 1, -1]))
    project = client.project()
    for name in FILES[:3]:
        client.put(project, name, (folder / name).read_bytes())
    client.act(project, "take", files=list(FILES[:3]))
    found = stages(client.settled(project))
    assert not found["check"]["done"]
    assert [f["cure"] for f in found["check"]["findings"]] == ["turn_elbow_effort"]
    client.act(project, "cure", name="turn_elbow_effort")
    found = stages(client.settled(project))
    assert found["check"]["done"]
    client.act(project, "compare")
    assert stages(client.settled(project))["compare"]["done"]


@pytest.mark.slow
def test_a_model_without_its_urdf_is_told(client: Client, folder: Path) -> None:
    project = client.project()
    client.put(project, FILES[0], (folder / FILES[0]).read_bytes())
    client.act(project, "take", files=[FILES[0]])
    error = stages(client.settled(project))["record"]["error"]
    assert "small_arm.urdf" in error["what"]


@pytest.mark.slow
def test_the_page_shows_the_table_and_the_sentences(
    server: Callable[..., Server], browser: Callable[..., Page], folder: Path
) -> None:
    page = browser(1280, 1600)
    page.open(server().address)
    page.drop(*(folder / name for name in FILES))
    page.done("check")
    page.click("do-compare")
    page.done("compare")
    page.wait(lambda: "elbow" in page.stage("compare").text, "the table of joints")
    page.picture("arm_compare")
    page.click("do-diagnose")
    page.done("diagnose")
    page.wait(lambda: "elbow: Coulomb friction" in page.stage("diagnose").text, "the sentence of the elbow")
    page.picture("arm_diagnose")
