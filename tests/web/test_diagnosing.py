"""What the page is told of a diagnosis: stages, what was tried, evidence; without a server."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest


@pytest.fixture(scope="module")
def diagnosed(hidden_effect: Path) -> tuple[Any, list[dict[str, Any]]]:
    """The answer about a model without its dry friction, and what was told on the way."""
    pytest.importorskip("tsdownsample")
    from signlin_ros.workbench import calls

    told: list[dict[str, Any]] = []
    files = {"data": [str(hidden_effect / "estimation.csv")], "validation": [str(hidden_effect / "validation.csv")]}
    asked = {"model": str(hidden_effect / "model.yaml"), **files, "key": "here"}
    return calls.diagnose(asked, lambda one: told.append(json.loads(json.dumps(one, allow_nan=False)))), told


def test_what_is_tried_is_told_as_it_is_fitted_best_first(diagnosed: tuple[Any, list[dict[str, Any]]]) -> None:
    _, told = diagnosed
    shares = [one["share"] for one in told]
    assert shares == sorted(shares)
    assert len({one["what"] for one in told}) >= 3
    counts = [one["found"]["count"] for one in told]
    assert counts == sorted(counts)
    assert counts[-1] > 10
    simulated = [row for row in told[-1]["found"]["tried"] if row["error"] is not None]
    assert any(row["effects"] == ["coulomb_friction"] for row in simulated)
    assert simulated[0]["effects"] == ["coulomb_friction"]  # no richer law promised more, and none was simulated
    assert simulated[0]["error"] < 1.5
    base = next(row for one in told for row in one["found"]["tried"] if row["effects"] == [])
    assert base["error"] > 3 * simulated[0]["error"]


def test_every_named_effect_has_its_evidence_beside_its_rival(diagnosed: tuple[Any, list[dict[str, Any]]]) -> None:
    answer, _ = diagnosed
    assert answer["json"]["verdict"] == "missing"
    seen = answer["evidence"]["coulomb_friction"]
    assert (seen["quantity"], seen["unit"]) == ("missing torque", "N·m")
    assert (seen["over"], seen["over_unit"]) == ("speed", "rad/s")
    assert seen["named"]["effect"] == "coulomb_friction"
    assert len(seen["named"]["curve"]) == 2  # one for each direction
    assert seen["rival"]["effect"] not in ("", "coulomb_friction")
    assert seen["named"]["parameters"]


def test_an_adequate_model_is_shown_with_the_best_that_was_refused(hidden_effect: Path, tmp_path: Path) -> None:
    pytest.importorskip("tsdownsample")
    from signlin_ros.model import Model
    from signlin_ros.workbench import calls

    Model.load("dc_motor").save(tmp_path / "whole.yaml")
    asked = {"model": str(tmp_path / "whole.yaml"), "data": [str(hidden_effect / "estimation.csv")], "validation": []}
    answer = calls.diagnose({**asked, "key": "whole"}, lambda _: None)
    assert answer["json"]["verdict"] == "adequate"
    assert len(answer["evidence"]) == 1
    assert calls.report(
        {"diagnosis": "whole", "report": str(tmp_path / "r.html"), "command": "signlin diagnose"}, print
    )
    assert "signlin diagnose" in (tmp_path / "r.html").read_text()
