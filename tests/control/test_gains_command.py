"""`signlin gains`: its schema, its text, and what it refuses."""

from __future__ import annotations

import json
from importlib import resources

import jsonschema
import numpy as np
import pytest

from signlin_ros import cli


@pytest.fixture
def run(capsys):
    def call(*arguments):
        code = cli.main([str(a) for a in arguments])
        captured = capsys.readouterr()
        return code, captured.out, captured.err

    return call


def checked(text):
    schema = json.loads((resources.files("signlin_ros") / "schemas" / "gains.json").read_text(encoding="utf-8"))
    jsonschema.Draft202012Validator.check_schema(schema)
    content = json.loads(text)
    jsonschema.validate(content, schema, cls=jsonschema.Draft202012Validator)
    return content


@pytest.mark.parametrize("model", ["dc_motor", "bouc_wen", "emps"])
def test_gains_keep_their_schema(run, model):
    code, out, err = run("gains", model, "--speed", "0.2", "--json")
    assert (code, err) == (0, "")
    content = checked(out)
    assert content["speed"] == 0.2
    assert content["feed_forward"]["kA"] > 0


def test_the_constants_of_the_papers_motor_and_what_its_friction_is_worth(run):
    content = checked(run("gains", "dc_motor", "--speed", "5", "--json")[1])
    scale = 0.764 / 0.0805
    want = {"kS": scale * 0.033, "kV": 0.0805, "kA": scale * 0.0022}
    for name, value in want.items():
        np.testing.assert_allclose(content["feed_forward"][name], value, rtol=1e-3)
    assert abs(content["friction_free"]["kS"]) < 1e-6
    for errors in content["predicted"].values():
        assert [e["without"] for e in errors] == ["", "coulomb_friction"]
        assert errors[0]["rms"] < 0.4 * errors[1]["rms"]


def test_an_operating_point_is_looked_at_and_one_below_the_floor_is_told(run):
    content = checked(run("gains", "dc_motor", "--at", "speed=2", "--speed", "5", "--json")[1])
    (point,) = content["operating_points"]
    assert point["state"] == {"current": 0.0, "speed": 2.0}
    np.testing.assert_allclose(point["kV"], 0.0805 + 0.764 / 0.0805 * 0.033 / 2.0, rtol=1e-3)
    text = run("gains", "dc_motor", "--at", "speed=0.001", "--speed", "5")[1]
    assert "below the floor" in text


def test_the_text_has_units_and_the_worth_of_every_effect(run):
    code, out, _ = run("gains", "emps", "--bandwidth", "20")
    assert code == 0
    for word in ("kS", "N/(m/s²)", "all but coulomb_friction", "none of the effects", "bandwidth 20 rad/s", "LQR"):
        assert word in out


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("force_element",), "imposed"),
        (("dc_motor", "--period", "-1"), "--period: found -1; allowed: a positive number"),
        (("dc_motor", "--bandwidth", "0"), "--bandwidth: found 0"),
        (("dc_motor", "--at", "rpm=3"), "--at: unknown state 'rpm'"),
    ],
)
def test_what_does_not_go_is_told_in_one_line(run, arguments, words):
    code, out, err = run("gains", *arguments)
    assert (code, out) == (2, "")
    assert words in err
    assert err.count("\n") == 1
