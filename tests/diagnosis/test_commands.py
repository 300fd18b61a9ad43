"""`signlin diagnose`, `add` and `refine` as a user calls them."""

from __future__ import annotations

import json
from importlib import resources

import jsonschema
import pytest
from click.testing import CliRunner

from benchmarks.hidden.generator import draw, write
from signlin_ros.cli import main, signlin
from signlin_ros.console import compare_text, diagnosis_text
from signlin_ros.effects import EFFECTS
from signlin_ros.model import Model

pytestmark = pytest.mark.xdist_group("commands")  # what they share is worked out once


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


def test_the_first_rows_and_the_noise_are_the_same_in_every_verb(record, tmp_path):
    data = (record / "model.yaml", record / "estimation.csv")
    runs = [("compare", *data), ("diagnose", *data), ("add", "viscous_friction", *data, "-o", tmp_path / "new.yaml")]
    compared, *others = (json.loads(call(*run, "--json").stdout) for run in runs)
    first = compared["first_rows"]
    assert first["given"]["missing_force_percent"] > first["refitted"]["missing_force_percent"] > 0
    for found in others:
        assert first == {"given": found["given"], "refitted": found["ladder"][0], "horizon": found["horizon"]}
        assert found["noise"] == {n: c["noise"] for n, c in compared["channels"].items()}
        assert diagnosis_text(found).splitlines()[2:11] == compare_text(compared).splitlines()[2:11]


def test_text_says_verdict_and_reason_and_a_finding_about_the_record_once(record, tmp_path):
    rows = (record / "estimation.csv").read_text().splitlines()
    file = tmp_path / "gap.csv"
    file.write_text("\n".join([*rows[:700], *rows[760:]]) + "\n")
    for verb in ("compare", "diagnose"):
        result = call(verb, record / "model.yaml", file)
        assert result.exit_code == 0
        assert "about the record" in result.stdout
        assert result.stdout.count("gap in the time stamps") == 1
        for row in ("/ noise", "model as given", "refitted", "missing force", "noise of the sensors"):
            assert row in result.stdout
    assert result.stdout.split(":")[0] in ("MISSING", "ADEQUATE", "UNEXPLAINED")


def test_a_record_that_is_too_short_to_refit_is_compared_all_the_same(record, tmp_path):
    file = tmp_path / "short.csv"
    file.write_text("\n".join((record / "estimation.csv").read_text().splitlines()[:200]) + "\n")
    content = json.loads(call("compare", record / "model.yaml", file, "--json").stdout)
    assert content["first_rows"] is None
    assert [note for note in content["notes"] if "not refitted" in note and "at least 300 are needed" in note]
    assert "training" not in compare_text(content)
    assert "next 0.2 s" in compare_text(content)


FAN = '''
from signlin_ros.effects import Effect
from signlin_ros.par import Par

class Fan(Effect):
    """A fan.

    F = -b v |v|.
    """

    name = "test_commands_fan"
    equation = "-b v |v|"
    b = Par("F·s²/Q²", nominal=1e-4, doc="drag per squared velocity")

    def force(self, m, x, p):
        return -p.b * x.velocity * m.abs(x.velocity)
'''


@pytest.fixture(scope="module")
def added(record, tmp_path_factory):
    """Folder, JSON and text of an effect of one's own added to a record with faults, the file in another folder."""
    folder = tmp_path_factory.mktemp("added")
    (folder / "sub").mkdir()
    (folder / "fan.py").write_text(FAN)
    text = (record / "model.yaml").read_text()
    (folder / "model.yaml").write_text(f"{text}    effect_files: [fan.py]\n    signals: {{current: i_mot}}\n")
    rows = (record / "estimation.csv").read_text().splitlines()
    cells = rows[50].split(",")
    rows[50] = ",".join([cells[0], "", *cells[2:]])
    (folder / "run.csv").write_text("\n".join([*rows[:60], rows[59], *rows[60:1500]]) + "\n")
    arguments = ("add", "test_commands_fan", folder / "model.yaml", folder / "run.csv")
    result = call(*arguments, "-o", folder / "sub" / "new.yaml", "--report", folder / "r.html", "--json")
    assert result.exit_code == 0
    content = json.loads(result.stdout)
    yield folder, content, diagnosis_text(content)
    del EFFECTS["test_commands_fan"]


def test_what_was_done_to_a_record_is_said_everywhere(added):
    folder, content, text = added
    html = (folder / "r.html").read_text()
    for words in ("1 repeated row dropped", "1 missing samples hold", "i_mot"):
        assert [note for note in content["notes"] if words in note and "run.csv: " in note]
        assert words in text
        assert words in html


def test_the_written_model_loads_in_place_and_has_no_needless_position(added):
    folder, content, _ = added
    model = Model.load(folder / "sub" / "new.yaml")
    assert content["model"] == (folder / "sub" / "new.yaml").read_text()
    assert model.effect_files == ("../fan.py",)
    assert model.states == ("current", "speed")
    assert "position" in content["noise"]  # it was compared with all the same


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("diagnose", "model.yaml"), "DATA"),
        (("diagnose", "model.yaml", "none.csv"), "none.csv"),
        (("add", "coulumb_friction", "model.yaml", "estimation.csv", "-o", "new.yaml"), "coulomb_friction"),
        (("add", "bouc_wen_hysteresis", "model.yaml", "estimation.csv", "-o", "new.csv"), ".yaml"),
        (("refine", "model.yaml", "estimation.csv", "-o", "model.yaml"), "replace"),
        (("refine", "model.yaml", "estimation.csv", "-o", "no/new.yaml"), "folder"),
        (("refine", "model.yaml", "estimation.csv", "-o", "n.yaml", "--report", "estimation.csv"), "'.csv'"),
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

    monkeypatch.setattr("signlin_ros.cli.diagnosing._stage", interrupted)
    new, report = tmp_path / "new.yaml", tmp_path / "report.html"
    data = (record / "model.yaml", record / "estimation.csv")
    assert main(["refine", *map(str, data), "-o", str(new), "--report", str(report)]) == 130
    assert "interrupted" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
