"""The command ``export``: its answer by the schema, its refusals, records, and targets whose engine is missing."""

import json
from importlib import resources
from pathlib import Path

import jsonschema
import numpy as np
import pytest

from signlin_ros import cli
from signlin_ros.cli.exporting import TARGETS as OFFERED
from signlin_ros.export import TARGETS, export, find_target
from signlin_ros.export.base import ranges
from signlin_ros.export.excitation import standard_excitation
from signlin_ros.export.loss import reference
from signlin_ros.export.matrix import cell, models, table
from signlin_ros.model import Model
from signlin_ros.simulation import simulate

SMALL_ARM = Path(__file__).resolve().parents[2] / "config" / "arm" / "small_arm.yaml"


@pytest.fixture
def run(capsys):
    def call(*arguments):
        code = cli.main([str(a) for a in arguments])
        streams = capsys.readouterr()
        return code, streams.out, streams.err

    return call


@pytest.fixture
def record(tmp_path):
    """A record of a motor whose friction is another than the model's: t, voltage, speed."""
    model = Model.load("dc_motor").with_parameters({"coulomb_friction.mu": 0.04})
    t = np.arange(0.0, 4.0, 0.005)
    u = 2.5 * np.sin(2 * np.pi * t)[:, None]
    rows = np.column_stack([t, u, simulate(model, t, u)["speed"]])
    path = tmp_path / "run.csv"
    np.savetxt(path, rows, delimiter=",", header="t,voltage,speed", comments="")
    return path


def _schema():
    found = json.loads((resources.files("signlin_ros") / "schemas" / "export.json").read_text(encoding="utf-8"))
    jsonschema.Draft202012Validator.check_schema(found)
    return found


def test_command_offers_every_target():
    assert tuple(TARGETS) == OFFERED
    assert {find_target(name).name for name in TARGETS} == set(TARGETS)


@pytest.mark.parametrize("target", ["c", "casadi"])
def test_json_is_as_the_schema_says(run, tmp_path, target):
    out = tmp_path / f"motor{find_target(target).suffix}"
    code, text, _ = run("export", "dc_motor", "--to", target, "-o", out, "--json")
    content = json.loads(text)
    assert code == 0
    jsonschema.validate(content, _schema(), cls=jsonschema.Draft202012Validator)
    assert content["files"][0] == str(out)
    assert content["against"] == "our exact model"
    assert content["loss"]["speed"]["ours"] == 0.0


def test_record_gives_errors_against_the_measurement(run, tmp_path, record):
    code, text, _ = run("export", "dc_motor", "--to", "casadi", "-o", tmp_path / "m.py", "--data", record, "--json")
    content = json.loads(text)
    jsonschema.validate(content, _schema(), cls=jsonschema.Draft202012Validator)
    speed = content["loss"]["speed"]
    assert code == 0
    assert content["against"] == "the measurement"
    assert speed["ours"] > 0.1  # the record's friction is another
    assert speed["target"] == pytest.approx(speed["ours"], rel=0.1)
    assert set(content["loss"]) == {"speed"}


def test_text_says_what_is_held_lost_and_how_much(run, tmp_path):
    code, out, _ = run("export", "dc_motor", "--to", "casadi", "-o", tmp_path / "m.py")
    assert code == 0
    assert "held: f_j as recorded" in out
    assert "lost: sign" in out
    assert "speed: 0 -> " in out


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("dc_motor", "--to", "mjfc", "-o", "m.xml"), "did you mean 'mjcf'?"),
        (("dc_motor", "--to", "c", "-o", "m.xml"), ".c"),
        (("force_element", "--to", "mjcf", "-o", "m.xml"), "imposed"),
        ((SMALL_ARM, "--to", "c", "-o", "m.c"), "does not take an arm"),
        (("dc_motor", "--to", "c", "-o", "no/such/folder/m.c"), "no"),
    ],
)
def test_refusals_are_one_line(run, tmp_path, monkeypatch, arguments, said):
    monkeypatch.chdir(tmp_path)
    code, out, err = run("export", *arguments)
    assert (code, out) == (2, "")
    assert said in err
    assert "Traceback" not in err


def test_without_its_engine_a_file_is_written_and_not_run(tmp_path, monkeypatch):
    from importlib import util

    known = util.find_spec
    monkeypatch.setattr(util, "find_spec", lambda name, *more: None if name == "mujoco" else known(name, *more))
    found = export(Model.load("dc_motor"), "mjcf", tmp_path / "m.xml")
    assert (tmp_path / "m.xml").is_file()
    assert "mujoco is not installed" in found.loss.not_run
    assert found.content()["loss"] == {}


def test_standard_excitation_reverses_and_moves():
    for name in ("dc_motor", "mass_spring_damper"):
        model = Model.load(name)
        drive = standard_excitation(model)
        speed = reference(model, drive)[model.plant.velocity]
        assert np.count_nonzero(np.diff(np.sign(speed)) != 0) >= 20


def test_ranges_are_of_what_is_uncertain_only():
    model = Model.load("dc_motor").with_options(tolerance=0.1, frozen=("K_m",))
    found = ranges(model)
    assert found["J"] == pytest.approx((0.8 * 0.0022, 1.2 * 0.0022))
    assert "K_m" not in found
    assert "coulomb_friction.mu" not in found


def test_table_has_a_cell_for_every_target(tmp_path):
    name, model = next(iter(models()))
    cells = [cell(name, model, target, tmp_path) for target in ("casadi", "sympy")]
    lines = table(cells)
    assert lines[0] == "| effect | casadi | sympy |"
    assert all(c.percent is not None and c.percent < 1.0 for c in cells)


def test_standard_errors_of_a_fit_are_the_ranges(tmp_path):
    path = tmp_path / "fitted.yaml"
    Model.load("dc_motor").save(path)
    text = path.read_text(encoding="utf-8")
    path.write_text(
        "# J: fitted, 0.00220 ± 0.00003 kg·m²; was 0.002\n# coulomb_friction.mu: fitted, 0.0330 ± 0.0004 N·m\n"
        "# K_t: fitted, 0.2 ± 0.001 N·m/A\n" + text,
        encoding="utf-8",
    )
    model = Model.load(str(path))
    found = ranges(model)
    assert found["J"] == pytest.approx((0.00214, 0.00226))
    assert found["coulomb_friction.mu"] == pytest.approx((0.0322, 0.0338))
    assert found["K_t"] == pytest.approx((0.9 * 0.0805, 1.1 * 0.0805))  # changed since: the tolerance
    find_target("c").write(model, tmp_path / "m.c", standard_excitation(model))
    assert "± 3e-05 (standard error of the fit)" in (tmp_path / "m.h").read_text(encoding="utf-8")
