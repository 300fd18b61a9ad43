"""Efforts that are recorded later than the motion: told as a delay, not as friction, and put in time."""

import json
from pathlib import Path

import jsonschema
import numpy as np
import pytest

from signlin_ros.arms.data import ArmRun, in_time, shifted, with_delays
from signlin_ros.arms.faults import delays
from signlin_ros.arms.keys import DELAY, Key
from signlin_ros.arms.proposal import placed
from signlin_ros.arms.search import Promise, settled, stands
from signlin_ros.arms.study import study
from signlin_ros.arms.told import diagnosed_json, sentences
from signlin_ros.arms.verbs import compare, diagnose
from signlin_ros.errors import ModelError
from signlin_ros.model import Model
from tests.arm_records import record, small

MODEL, BAND, SHOULDER = small(), 6.0, 1
N = MODEL.robot.n
SCHEMA = json.loads((Path(__file__).parents[2] / "signlin_ros/schemas/arm_diagnose.json").read_text())


def run(seed, late):
    t, q, v, u = record(MODEL, seed)
    return shifted(ArmRun(t, q, v, u, "simulated", np.zeros(N)), -np.asarray(late))


def test_an_effort_is_put_in_time():
    t = np.arange(0.0, 2.0, 0.01)
    late = np.stack([np.sin(t - 0.004), np.sin(t)], axis=1)
    right = in_time(t, late, [0.004, 0.0])
    assert np.abs(right[:-1] - np.sin(t)[:-1, None]).max() < 2e-5
    assert in_time(t, late, [0.0, 0.0]) is late


def test_a_file_says_how_late_an_effort_is():
    model = with_delays(MODEL, np.array([0.0, 0.004, 0.0]))
    assert model.effort_delays == (0.0, 0.004, 0.0)
    assert with_delays(model, np.array([0.0, 0.001, 0.0])).effort_delays[SHOULDER] == pytest.approx(0.005)
    content = {**model.to_dict(), "robot": str(MODEL.folder / MODEL.arm.robot)}
    assert Model.from_dict(content).effort_delays[SHOULDER] == 0.004
    with pytest.raises(ModelError, match="delay"):
        Model.from_dict({**content, "shoulder": {"effort": {"delay": "soon"}}})


@pytest.mark.slow
@pytest.mark.parametrize(("late", "key"), [([0.0, 0.012, 0.0], "shoulder"), ([0.008] * N, "all")])
def test_a_delay_is_told_of_its_joint_or_of_all(late, key, tmp_path):
    known, unseen = run(51, late), run(52, late)
    found = diagnose(MODEL, [known], [unseen], BAND)
    assert delays(found) == pytest.approx(late, abs=0.002)
    content = diagnosed_json(found, "", "", []) | {"sentences": sentences(found), "record": {"findings": []}}
    jsonschema.validate(content, SCHEMA)
    assert list(content["robot"]["delays"]) == [key]
    assert [entry["effect"].rpartition(".")[2] for entry in content["ranking"]] == ["sensor_delay"]
    assert content["ranking"][0]["forward"]["says"] == "confirmed"
    assert any("later than the motion" in line for line in sentences(found))
    # the proposed file has the delay: the records are put in time by it, and the figures are those of the diagnosis
    text, urdf, path = placed(found.proposal, tmp_path / "new.yaml")
    path.write_text(urdf)
    (tmp_path / "new.yaml").write_text(text)
    new = Model.load(tmp_path / "new.yaml")
    assert new.effort_delays == pytest.approx(tuple(late), abs=0.002)
    runs = [[shifted(one, np.array(new.effort_delays))] for one in (known, unseen)]
    again = compare(new, *runs, BAND)
    np.testing.assert_allclose(again.table.model, found.comparison.table.model, rtol=0.02)
    assert (found.comparison.table.model <= 1.02 * found.comparison.table.basic).all()


@pytest.mark.slow
def test_what_is_in_time_and_friction_that_sets_in_late_are_no_delay():
    t, q, v, u = record(MODEL, 53)
    lag = np.round(0.03 / (t[1] - t[0])).astype(int)
    runs = []
    for seed in (53, 54):
        t, q, v, u = record(MODEL, seed)
        dry = 1.2 * np.tanh(v[:, SHOULDER] / 2e-3)
        u[lag:, SHOULDER] += dry[:-lag] - dry[lag:]
        runs.append(ArmRun(t, q, v, u, "simulated", np.zeros(N)))
    found = diagnose(MODEL, [runs[0]], [runs[1]], BAND)
    assert not delays(found).any()
    assert not delays(diagnose(MODEL, [run(55, np.zeros(N))], [run(56, np.zeros(N))], BAND)).any()


def delay_that_stands(late, dry):
    """Return what stands of a delay of the shoulder where so much of the rigid body's effort, and of a dry friction, is
    late (s).
    """
    sides = []
    for seed in (57, 58):
        t, q, v, u = record(MODEL, seed)
        friction = dry * np.tanh(v[:, SHOULDER] / 2e-3)
        u[:, SHOULDER] = np.interp(t - late[0], t, u[:, SHOULDER]) + np.interp(t - late[1], t, friction)
        sides.append([ArmRun(t, q, v, u, "simulated", np.zeros(N))])
    state = study(MODEL, *sides, BAND).state()
    estimate = settled(state)
    key = Key(DELAY, SHOULDER)
    return stands(state, estimate, Promise(1.0, key, None, *state.columns(key, None, state.loads(estimate))), 1)


def test_a_delay_stands_only_if_efforts_that_are_put_in_time_are_explained_better():
    told = delay_that_stands((0.02, 0.02), 2.0)
    assert told is not None
    assert told[0].values[0] == pytest.approx(0.02, abs=0.003)
    # what the rigid body needs comes late, and dry friction as large in time: no delay of the effort
    assert delay_that_stands((0.02, 0.0), 2.0) is None
