"""The controllers' table: trials are what they say, resumable, and the same when repeated."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[2]))
from benchmarks.controllers import search, table, trial
from benchmarks.controllers.plants import corner, mismatched, rigs

sys.path.pop(0)

RIGS = rigs()
NAMES = ("friction_free", "along_reference")


@pytest.fixture
def short(monkeypatch):
    """A search of four points."""
    monkeypatch.setattr(search, "WIDE", 2)
    monkeypatch.setattr(search, "CLOSE", 2)


def test_there_are_twenty_plants_of_both_kinds_with_every_effect():
    effects = {use.type for rig in RIGS.values() for use in rig.model.effects.values()}
    wanted = {"coulomb_friction", "stribeck_friction", "bouc_wen_hysteresis", "backlash", "cogging_torque"}
    assert len(RIGS) == 20
    assert wanted <= effects
    assert sum(rig.model.plant.name == "dc_motor" for rig in RIGS.values()) == 10


def test_a_mismatched_plant_is_ten_percent_off_in_every_number_but_shapes():
    model = RIGS["motor_stribeck_cogging"].model
    for other in (mismatched(model, np.random.default_rng(0)), corner(model, 1.0)):
        for name in ("R_a", "J", "stribeck_friction.mu", "cogging_torque.A"):
            assert abs(other.value(name) / model.value(name) - 1.0) == pytest.approx(0.1)
        assert other.value("cogging_torque.N") == model.value("cogging_torque.N")


def test_a_trial_is_repeated_to_the_last_digit_and_measures_what_it_says(short):
    one = trial.Trial(RIGS["mass_coulomb"], True, 0.02, 0)
    first, second = (trial.all_designs(one, NAMES) for _ in range(2))
    assert json.dumps(first) == json.dumps(second)
    for name in NAMES:
        assert len(first[name]["runs"]) == 1 + trial.MEASURED_ON
        assert set(first[name]["runs"][0]) == {"position sine", "position ramps with stops"}
        assert first[name]["runs"][0]["position ramps with stops"]["oscillation"] >= 0.0
    nominal, mismatch = table.ratios(first, "along_reference", "position sine")
    assert nominal < mismatch < 1.0


def test_chatter_and_oscillation_beyond_their_bounds_cost(short):
    one = trial.Trial(RIGS["motor_coulomb"], False, 0.02, 0)
    stand = trial.Stand(one, one.tuned_on[:1], "tuning")
    design = trial.DESIGNS["friction_free"]
    runs = stand.runs(design, one.rig.model, trial.default_tuning(0.02, 0.02))
    calm = trial.cost(one, runs)
    rough = [{k: _with_chatter(r, one.rig.limit) for k, r in by_name.items()} for by_name in runs]
    assert trial.cost(one, rough) > 5 * calm


def _with_chatter(run, limit):
    flips = 0.1 * limit * (-1.0) ** np.arange(run.u.size)
    return type(run)(run.t, run.reference, run.motion, run.u + flips, run.position, run.finished)


def test_what_is_there_is_not_done_again(tmp_path):
    todo = table.trials(["mass_coulomb"], 1, [0.02])
    done = []

    def once(one):
        done.append(one.name)
        return {"friction_free": {"runs": []}}

    folder = tmp_path / "designs"
    folder.mkdir()
    (folder / f"{todo[0].name}.json").write_text("{}")
    table.work(todo[:1], folder, 1, once)
    assert done == []
    assert list(table.read(todo, folder)) == todo[:1]
