"""`signlin diagnose`, `add` and `refine` as a user calls them."""

from __future__ import annotations

import json
from importlib import resources

import jsonschema
import pytest
from click.testing import CliRunner

from benchmarks.hidden.generator import draw, write
from signlin_ros.cli import main, signlin
from signlin_ros.model import Model


@pytest.fixture(scope="module")
def record(tmp_path_factory):
    return write(draw("single", 1, 1), tmp_path_factory.mktemp("records"))


def schema():
    return json.loads((resources.files("signlin_ros") / "schemas" / "diagnose.json").read_text(encoding="utf-8"))


def call(*arguments):
    return CliRunner().invoke(signlin, [str(a) for a in arguments], catch_exceptions=False)


def test_refine_writes_a_model_and_valid_json(record, tmp_path):
    data = (record / "model.yaml", record / "estimation.csv", "--validation", record / "validation.csv")
    result = call("refine", *data, "-o", tmp_path / "new.yaml", "--jobs", 2, "--json")
    assert result.exit_code == 0
    content = json.loads(result.stdout)
    jsonschema.validate(content, schema(), cls=jsonschema.Draft202012Validator)
    model = Model.load(tmp_path / "new.yaml")
    assert {use.type for use in model.effects.values()} == set(content["ladder"][-1]["effects"])
    assert {e["status"] for e in content["ranking"]} >= {"rejected"}
    assert not list(tmp_path.glob(".*"))


def test_text_says_verdict_and_reason(record):
    result = call("diagnose", record / "model.yaml", record / "estimation.csv")
    assert result.exit_code == 0
    assert result.stdout.split(":")[0] in ("MISSING", "ADEQUATE", "UNEXPLAINED")
    assert "/ noise" in result.stdout


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("diagnose", "model.yaml"), "DATA"),
        (("diagnose", "model.yaml", "none.csv"), "none.csv"),
        (("add", "coulumb_friction", "model.yaml", "estimation.csv", "-o", "new.yaml"), "coulomb_friction"),
        (("add", "bouc_wen_hysteresis", "model.yaml", "estimation.csv", "-o", "new.csv"), ".yaml"),
        (("refine", "model.yaml", "estimation.csv", "-o", "model.yaml"), "replace"),
        (("refine", "model.yaml", "estimation.csv", "-o", "no/new.yaml"), "folder"),
    ],
)
def test_bad_input_is_one_line_and_exit_2(record, monkeypatch, capsys, arguments, said):
    monkeypatch.chdir(record)
    assert main(list(arguments)) == 2
    error = capsys.readouterr().err
    assert said in error
    assert "Traceback" not in error


def test_an_interrupt_leaves_no_file(record, tmp_path, monkeypatch, capsys):
    def interrupted(what, share):
        if share > 0.0:
            raise KeyboardInterrupt

    monkeypatch.setattr("signlin_ros.cli._stage", interrupted)
    new, report = tmp_path / "new.yaml", tmp_path / "report.html"
    data = (record / "model.yaml", record / "estimation.csv")
    assert main(["refine", *map(str, data), "-o", str(new), "--report", str(report)]) == 130
    assert "interrupted" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
