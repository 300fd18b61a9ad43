"""Shared records of real machines, as a user asks about them: `signlin diagnose` on the command line."""

from __future__ import annotations

import json
import os
import shutil
from functools import cache
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
import yaml
from click.testing import CliRunner
from scipy.signal import butter, sosfiltfilt

from signlin_ros.cli import signlin
from signlin_ros.diagnosis import load_records
from signlin_ros.diagnosis.dataset import dataset_of
from signlin_ros.diagnosis.equation_error.estimate import estimate_equation_error
from signlin_ros.model import Model
from tests.diagnosis.test_hidden_effects import risen
from tests.notebooks import cells_run

DATA = Path(os.environ.get("SIGNLIN_DATA", "../shared/data"))
pytestmark = [
    pytest.mark.skipif(not DATA.is_dir(), reason=f"no measurement records at {DATA} (set SIGNLIN_DATA)"),
    pytest.mark.xdist_group("shared_records"),  # what they share is worked out once
]
SCHEMA = Path(__file__).resolve().parents[2] / "signlin_ros" / "schemas" / "diagnose.json"
RECORDS = {
    "null": ("field/verdicts/null-effect-confirmed", "a.csv", "b.csv"),
    "headline": ("field/verdicts/headline-vs-table", "a.csv", "b.csv"),
    "cogging": ("real/cogging_motor", "speed_loop_a.csv", "speed_loop_b.csv"),
    "damper": ("real/friction_damper", "0.5Hz_1in.csv", "1Hz_0.5in.csv"),
}
PLACES = {which: DATA / folder for which, (folder, *_) in RECORDS.items()}
HALVED = {"null"}
"""What the first halves of its records tell as well."""
LONG = {"headline", "cogging"}
"""What takes half a minute: rows that get worse are looked for in test_hidden_effects, too; waves below."""
EACH = [pytest.param(which, marks=[pytest.mark.long] * (which in LONG)) for which in RECORDS]
ALIKE = 1.01
"""Errors that differ by less than this look the same in a table."""


@pytest.fixture(scope="module", autouse=True)
def first_halves(tmp_path_factory):
    """Write a model, and the first halves of its records, for the tests of this file."""
    for which in HALVED:
        folder, *names = RECORDS[which]
        PLACES[which] = tmp_path_factory.mktemp(which)
        shutil.copy(DATA / folder / "nominal.yaml", PLACES[which])
        for name in names:
            header, *rows = (DATA / folder / name).read_text(encoding="utf-8").splitlines(keepends=True)
            (PLACES[which] / name).write_text("".join([header, *rows[: len(rows) // 2]]), encoding="utf-8")


@cache
def answer(which: str) -> dict[str, Any]:
    """Return what `signlin diagnose --json` says of a record, validated on another one; of the damper, what the
    notebook of it says, whose last cell is that diagnosis.
    """
    if which == "damper":
        return json.loads(json.dumps(cells_run("damper")["measured"].to_json()))
    place, (_, known, unseen) = PLACES[which], RECORDS[which]
    arguments = ["diagnose", place / "nominal.yaml", place / known, "--validation", place / unseen, "--json"]
    result = CliRunner().invoke(signlin, [str(a) for a in arguments], catch_exceptions=False)
    assert result.exit_code == 0, result.output
    content: dict[str, Any] = json.loads(result.stdout)
    return content


def confirmed(found: dict[str, Any]) -> set[str]:
    return {e["effect"] for e in found["ranking"] if e["status"] == "confirmed"}


def proposed(found: dict[str, Any]) -> list[str]:
    return list(found["ladder"][-1]["effects"])


@pytest.mark.parametrize("which", EACH)
def test_answers_are_what_the_contract_says(which):
    schema = json.loads(SCHEMA.read_text(encoding="utf-8"))
    jsonschema.validate(answer(which), schema, cls=jsonschema.Draft202012Validator)
    assert answer(which)["given"] is not None
    assert answer(which)["horizon"] > 0


@pytest.mark.parametrize("which", EACH)
def test_no_effect_is_confirmed_by_which_a_printed_row_gets_worse(which):
    """It was "93 %, confirmed, error falls by 3.8 standard errors" over a table that rose from 0.0512 to 0.0677."""
    found = answer(which)
    if found["verdict"] == "missing" or confirmed(found):
        assert risen(found["ladder"]) == []


@pytest.mark.parametrize("which", EACH)
def test_the_first_rows_are_the_model_as_given_and_its_base_refitted(which):
    found = answer(which)
    first, given = found["ladder"][0], found["given"]
    assert first["effects"] == given["effects"] == []
    assert first["validation"] == found["base"]["validation"]
    better = [first["estimation"][n]["rmse"] / given["estimation"][n]["rmse"] for n in first["estimation"]
              if n != "score"]  # fmt: skip
    assert min(better) < ALIKE


def test_a_load_that_changes_no_number_is_not_named():
    """Right: Coulomb friction first, 0.0020 N·m at the nominal K_t; gravity was "confirmed, 70 standard errors"."""
    found = answer("null")
    assert proposed(found) == ["coulomb_friction"]  # with a play beside it the speed's error rises by 15 %
    assert "gravity_load" not in confirmed(found)
    mu, K_t = (found["parameters"][name]["value"] for name in ("coulomb_friction.mu", "K_t"))
    assert mu / K_t == pytest.approx(0.0020 / 0.025, rel=0.03)  # both scale with K_t, known to 30 %, and J to 50 %


def test_a_slow_log_tells_what_it_leaves_and_the_friction_with_its_input_in_between():
    """Right: 0.033 N·m; 0.0227 ± 0.0037 with the voltage held for 50 ms, and no word of the 13.8 % that are left."""
    folder = DATA / "field/channels"
    arguments = ["diagnose", str(folder / "nominal.yaml"), str(folder / "hz20.csv"), "--json"]
    plain, cured = (
        json.loads(CliRunner().invoke(signlin, [*arguments, *cure], catch_exceptions=False).stdout)
        for cure in ([], ["--cure", "input_between"])
    )
    assert [f["cure"] for f in plain["record"]["findings"]] == ["input_between"]
    for found in (plain, cured):
        assert proposed(found) == ["coulomb_friction"]
        assert "times what the sensors' noise makes of it" in found["sentence"]
    mu = cured["parameters"]["coulomb_friction.mu"]
    assert abs(mu["value"] - 0.033) < 2.5 * mu["std"] < 0.0066


BAND = butter(4, 60.0, fs=1000.0, output="sos")
WITHIN = slice(200, -200)
MOTOR_CONSTANT = 0.0318


def sides_of_the_current(file: Path) -> tuple[np.ndarray, np.ndarray]:
    """Return current in A and position in rad, samples 1 ms apart: each side of an equation is filtered once, as the
    README has it. A position filtered before its waves are worked out is no position that was measured, and the 53 Hz
    of the waves of 72 would pass that filter twice.
    """
    table = np.genfromtxt(file, delimiter=",", skip_header=1)
    return table[:, 1], table[:, 2]


def left_of_the_current(found: dict[str, Any], file: Path) -> float:
    """Return the RMS of the current in A that a model does not explain of a record: motion from the position,
    Butterworth 4 at 60 Hz, zero phase, on both sides; written here with NumPy alone.
    """
    current, q = sides_of_the_current(file)
    v = np.gradient(q, 1e-3)
    content = yaml.safe_load(found["model"])["/**"]["ros__parameters"]
    base, force = content["parameters"], np.zeros_like(q)
    for effect in content["effects"].values():
        if effect.get("type", "") == "torque_ripple" or "orders" in effect:
            waves = zip(effect["orders"], effect["A"], effect["phi"], strict=True)
            force += sum(A * np.sin(N * q + phi) for N, A, phi in waves)
        elif "mu" in effect:
            force += effect["mu"] * np.sign(np.gradient(sosfiltfilt(BAND, q)))
        elif "F0" in effect:
            force -= effect["F0"]
    torque = base["m"] * np.gradient(v, 1e-3) + base["c"] * v
    left = sosfiltfilt(BAND, current - (torque + force) / MOTOR_CONSTANT)
    return float(np.sqrt(np.mean(left[WITHIN] ** 2)))


@pytest.mark.parametrize(("name", "published"), [("speed_loop_a", 0.0136), ("speed_loop_b", 0.0273)])
def test_least_squares_leave_of_the_current_what_the_readme_says(name, published):
    current, q = sides_of_the_current(DATA / "real" / "cogging_motor" / f"{name}.csv")
    v, orders = np.gradient(q, 1e-3), (72, 18, 12, 24, 36, 48, 144)
    columns = [np.gradient(v, 1e-3), v, *(wave(N * q) for N in orders for wave in (np.sin, np.cos))]
    table, current = (sosfiltfilt(BAND, side, axis=0)[WITHIN] for side in (np.column_stack(columns), current))
    left = current - table @ np.linalg.lstsq(table, current, rcond=None)[0]
    assert float(np.sqrt(np.mean(left**2))) == pytest.approx(published, abs=5e-5)


def test_the_force_shows_the_waves_of_a_motor():
    """Least squares: 0.117 A without waves, 0.0273 with 72, 18, 12, 24, 36, 48 and 144 periods a turn."""
    place = DATA / "real" / "cogging_motor"
    files = [str(place / f"speed_loop_{name}.csv") for name in "ab"]
    model, (known, unseen) = load_records(Model.load(str(place / "nominal.yaml")), files)
    dataset = dataset_of(model, known, unseen)
    found = estimate_equation_error(dataset.training, dataset.validation)
    assert "torque_ripple" in found.effects
    orders = found.values(found.fit, "torque_ripple")["orders"]
    assert {72.0, 18.0, 12.0, 24.0, 36.0, 48.0, 144.0} <= set(orders)
    assert found.percent() < 10.0 < 40.0 < found.percent(found.base)


@pytest.mark.long
def test_a_motor_that_its_own_waves_throw_back_and_forth():
    """A ripple in 72, 18, 12, 24, 36, 48 and 144 periods a turn; Coulomb friction is a tie beside it."""
    found = answer("cogging")
    assert "torque_ripple" in proposed(found)
    orders = [p["value"] for n, p in found["parameters"].items() if n.startswith("torque_ripple.orders")]
    model = yaml.safe_load(found["model"])["/**"]["ros__parameters"]["effects"]
    orders = orders or next(e["orders"] for e in model.values() if "orders" in e)
    assert {18.0, 72.0} <= {float(N) for N in orders}
    assert found["verdict"] == "missing"
    assert found["ladder"][-1]["missing_force_percent"] < 10.0 < 50.0 < found["given"]["missing_force_percent"]


@pytest.mark.long
def test_a_motor_whose_current_its_waves_explain():
    """Least squares: 0.117 A without waves, 0.0273 with seven of them."""
    assert left_of_the_current(answer("cogging"), DATA / "real" / "cogging_motor" / "speed_loop_b.csv") < 0.03


def test_a_damper_with_play_in_series_with_its_friction():
    """Least squares leave 15 % of the force's standard deviation with a play of 2 mm to each side, 43 % without."""
    found = answer("damper")
    assert "play_friction" in proposed(found)
    left = 100.0 - found["ladder"][-1]["validation"]["force"]["fit_percent"]
    assert left < 20.0


# ---------------------------------------------------------------- the same first rows in every verb


@pytest.mark.parametrize("which", [one for one in EACH if one.values[0] in ("null", "cogging")])
def test_compare_shows_the_first_rows_and_the_noise_of_diagnose(which):
    """Speed of "null": noise was 0.427 rad/s in compare, 0.162 in diagnose, and each had windows of its own."""
    place, found, (_, known, unseen) = PLACES[which], answer(which), RECORDS[which]
    arguments = ["compare", place / "nominal.yaml", place / known, "--validation", place / unseen, "--json"]
    result = CliRunner().invoke(signlin, [str(a) for a in arguments], catch_exceptions=False)
    assert result.exit_code == 0, result.output
    content = json.loads(result.stdout)
    jsonschema.validate(content, json.loads((SCHEMA.parent / "compare.json").read_text(encoding="utf-8")))
    assert content["first_rows"] == {"given": found["given"], "refitted": found["ladder"][0],
                                     "horizon": found["horizon"]}  # fmt: skip
    assert {n: content["channels"][n]["noise"] for n in found["noise"]} == found["noise"]
