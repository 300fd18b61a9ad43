"""From a record to an effect: what inverse dynamics leaves is learned, and the model with it is better on new data."""

import json
from functools import cache
from pathlib import Path

import jsonschema
import numpy as np
import pytest

import signlin_ros
from signlin_ros.cli import main
from signlin_ros.diagnosis.comparison import compare
from signlin_ros.errors import InputError
from signlin_ros.learning.missing import learn_missing, with_learned
from signlin_ros.model import Model
from signlin_ros.records import ModelData

pytestmark = pytest.mark.xdist_group("learned")  # what they share is worked out once

STEP = 2e-3
SIZE = 5_000
UNITS = {"displacement": "m", "force": "N", "velocity": "m/s"}
BASE = Model.from_dict(
    {"plant": "mass_spring_damper", "parameters": {"m": 2.0, "c": 1.0, "k": 0.0}, "update_period": 0.05}
)


def law(v):
    """No listed friction: it saturates, dips and rises, and takes more on the way back."""
    return 3.0 * np.tanh(v / 0.05) + 1.5 * v + np.where(v < 0, 0.4 * np.sin(6.0 * v), 0.0)


def record(seed):
    """A drive that follows a reference in a known way; the force that it took, with noise."""
    rng = np.random.default_rng(seed)
    t = np.arange(SIZE) * STEP
    tones, phases = 2 * np.pi * rng.uniform(0.2, 1.2, 4), rng.uniform(0.0, 2 * np.pi, 4)
    v = 0.25 * np.sin(tones * t[:, None] + phases).sum(axis=1)
    a = 0.25 * (tones * np.cos(tones * t[:, None] + phases)).sum(axis=1)
    q = -0.25 * ((np.cos(tones * t[:, None] + phases) - np.cos(phases)) / tones).sum(axis=1)
    force = 2.0 * a + v + law(v) + rng.normal(0.0, 0.05, SIZE)
    measured = {"displacement": q, "velocity": v + rng.normal(0.0, 1e-3, SIZE)}
    return ModelData(t, force[:, None], measured, None, ("force",), ("displacement", "velocity"), UNITS)


@cache
def learned_over(coordinate):
    return learn_missing(BASE, record(1), coordinate)


def test_a_friction_of_no_listed_shape_is_learned_over_the_speed_and_predicts_new_data():
    learned = learned_over("speed")
    v = np.linspace(-0.6, 0.6, 241)
    assert learned.explained > 0.9
    assert np.sqrt(np.mean((learned.force(v) + law(v)) ** 2)) < 0.1 * np.sqrt(np.mean(law(v) ** 2))
    before, after = (compare(model, record(2)).to_json() for model in (BASE, with_learned(BASE, learned)))
    assert after["inverse"]["force"]["rmse"] < 0.3 * before["inverse"]["force"]["rmse"]
    scores = [one["channels"]["velocity"]["windowed"]["rmse"] for one in (after, before)]
    assert scores[0] < 0.3 * scores[1]


def test_what_is_over_the_speed_is_not_over_the_position():
    assert learned_over("position").unseen > 2 * learned_over("speed").unseen


def test_a_coordinate_that_is_not_there_is_refused():
    with pytest.raises(InputError, match="over: found 'velocity'; allowed: speed; position; load"):
        learn_missing(BASE, record(1), "velocity")
    motor = Model.load("dc_motor")
    t = np.arange(SIZE) * STEP
    w, v = 10.0 * np.sin(t), 2.0 * np.sin(t) + 0.1 * np.sin(7.0 * t)
    data = ModelData(t, v[:, None], {"speed": w, "current": 0.1 * np.cos(t)}, None, ("voltage",), ("speed", "current"),
                     {"voltage": "V", "speed": "rad/s", "current": "A"})  # fmt: skip
    with pytest.raises(InputError, match="over: position: the position is neither measured nor a state of the model"):
        learn_missing(motor, data, "position")


def test_a_force_is_learned_from_the_command_line(tmp_path, capsys):
    model, new = tmp_path / "drive.yaml", tmp_path / "drive_2.yaml"
    BASE.save(model)
    data = record(3)
    columns = np.column_stack([data.t, data.u[:, 0], data.measured["displacement"], data.measured["velocity"]])
    file = tmp_path / "run.csv"
    np.savetxt(file, columns, delimiter=",", header="t,force,displacement,velocity", comments="")
    code = main(["add", "learned_force", str(model), str(file), "--over", "speed", "-o", str(new), "--json"])
    content = json.loads(capsys.readouterr().out)
    assert code == 0
    schema = json.loads((Path(signlin_ros.__file__).parent / "schemas" / "diagnose.json").read_text())
    jsonschema.validate(content, schema)
    assert content["verdict"] == "missing"
    before, after = (rung["validation"]["velocity"]["rmse"] for rung in content["ladder"])
    assert after < 0.3 * before
    saved = Model.load(new)
    assert saved.effects["learned_force"].type == "learned_force"
    assert Model.from_dict(saved.to_dict()) == saved
    assert content["model"] == new.read_text()
    assert main(["add", "coulomb_friction", str(model), str(file), "--over", "speed", "-o", str(new)]) == 2
    assert "--over: only learned_force" in capsys.readouterr().err
