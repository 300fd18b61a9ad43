"""Efforts whose gain is off: told of their joint, written, and as good in the new file as was promised."""

import json
from types import SimpleNamespace

import numpy as np
import pytest

from signlin_ros.arms import search
from signlin_ros.arms.data import ArmRun, gains_of, resized, with_gains
from signlin_ros.arms.faults import faults, not_again, shown, told_with
from signlin_ros.arms.fit import FitDesign, fit
from signlin_ros.arms.keys import DELAY, GAIN, Key, SearchResult
from signlin_ros.arms.piece import RegressionRows
from signlin_ros.arms.rivals import rivals_left
from signlin_ros.arms.search import Promise, _beside, stands
from signlin_ros.cli import main
from signlin_ros.model import Model
from tests.arm_records import record, small, written

MODEL, SHOULDER, N = small(), 1, 3


def test_efforts_are_put_in_their_sizes():
    t, q, v, u = record(MODEL, 1, duration=3.0)
    run = ArmRun(t, q, v, u, "simulated", np.array([0.0, 0.2, 0.0]))
    right = resized(run, np.array([1.0, 0.8, 1.0]))
    np.testing.assert_allclose(right.tau[:, SHOULDER], u[:, SHOULDER] / 0.8)
    np.testing.assert_array_equal(right.tau[:, [0, 2]], u[:, [0, 2]])
    assert right.steps.tolist() == pytest.approx([0.0, 0.25, 0.0])


def test_a_file_says_the_gain_that_was_found_and_keeps_the_unit(tmp_path):
    gains = np.array([1.0, 0.8, 1.0])
    model = with_gains(MODEL, gains)
    assert gains_of(model).tolist() == [1.0, 1.25, 1.0]
    content = {**model.to_dict(), "robot": str(MODEL.folder / MODEL.arm.robot)}
    again = Model.from_dict(content)
    assert gains_of(again).tolist() == [1.0, 1.25, 1.0]
    assert [effort.unit for _, effort in again.arm.efforts] == ["N·m"] * N
    current = Model.from_dict({**content, "elbow": {"effort": {"gain": 8.0}}})
    other = with_gains(current, np.array([1.0, 1.0, 0.5]))
    assert gains_of(other).tolist() == [1.0, 1.25, 16.0]
    assert dict(other.arm.efforts)["elbow"].unit == "A"
    same = Model.from_dict({**other.to_dict(), "robot": content["robot"]})
    assert (gains_of(same).tolist(), same.arm.efforts) == (gains_of(other).tolist(), other.arm.efforts)


def law(key, value, worth=1.0):
    one = np.ones(N)
    return SearchResult(key, (f"{key.at}.{key.law}",), np.array([value]), np.array([0.01]), 2.0 * one, one, worth)


def diagnosed(*laws, at_motor=(False,) * N):
    study = SimpleNamespace(model=SimpleNamespace(arm_plant=SimpleNamespace(at_motor=at_motor)))
    table = SimpleNamespace()
    return SimpleNamespace(comparison=SimpleNamespace(study=study, table=table), found=laws)


def test_sizes_are_those_of_the_gains_that_were_found():
    assert shown([law(Key(GAIN, 2), -0.15), law(Key(DELAY, 0), 0.01)], N).tolist() == [1.0, 1.0, 0.85]


def test_a_fault_that_was_put_right_is_not_asked_for_again():
    assert not_again(diagnosed(), GAIN) == {Key(GAIN, i) for i in range(N)}
    assert not_again(diagnosed(at_motor=(False, True, True)), GAIN) == {Key(GAIN, 0)}
    assert not_again(diagnosed(), DELAY) == {Key(DELAY, i) for i in range(-1, N)}


def test_a_gain_that_may_be_nothing_is_told_and_not_written():
    found = diagnosed(law(Key(GAIN, 0), -0.15), law(Key(GAIN, 2), -0.98))
    assert [fault.key.at for fault in faults(found, GAIN)] == [0]
    assert not_again(found, GAIN) == {Key(GAIN, 0), Key(GAIN, 1)}


def test_what_had_no_fault_stays_as_it_was_told():
    whole = diagnosed()
    assert told_with(whole, []) is whole


# ---------------------------------------------------------------- a neighbour


class TwoJoints:
    """Rows of two joints that need the mass m of one body; the second one's effort shows 0.8 times what acts."""

    n, by_joint, counts = 2, RegressionRows.by_joint, RegressionRows.counts
    noise = np.array([0.05, 1e-3])

    def __init__(self, seed, count=300):
        rng = np.random.default_rng(seed)
        self.joint, self.block = np.repeat([0, 1], count), np.tile(np.arange(count) // 10, 2)
        self.a = rng.normal(size=2 * count)
        self.y = self.a * np.where(self.joint == 1, 0.8, 1.0) + self.noise[self.joint] * rng.normal(size=2 * count)

    def shown(self, i):
        """What a gain of a joint adds to the rows."""
        return (self.a * (self.joint == i))[:, None]


def test_a_gain_stands_whose_neighbour_shows_it():
    known, unseen = TwoJoints(1), TwoJoints(2)
    design = FitDesign(("m",), known.a[:, None], unseen.a[:, None], np.zeros(1), np.array([np.inf]))
    estimate = fit(design, known, unseen, 1.0 / TwoJoints.noise)
    promise = Promise(1.0, Key(GAIN, 1), None, known.shown(1), unseen.shown(1))
    found, _ = stands(SimpleNamespace(rows=known, new=unseen), estimate, promise, 10)
    assert found.values[0] == pytest.approx(-0.2, abs=0.02)
    assert found.after[0] < 0.5 * found.before[0]  # the mass that fits the wrong effort is wrong for the other joint
    assert found.after[1] > 0.9 * found.before[1]


def as_good(prior):
    """Return the gains that are as good as one of 0.8 that was found in the second of two joints."""
    known, unseen = TwoJoints(1), TwoJoints(2)
    sides = {i: [r.shown(i) for r in (known, unseen)] for i in (0, 1)}
    design = FitDesign(("m",), known.a[:, None], unseen.a[:, None], np.ones(1), np.array([prior]))
    names = {i: f"{i}.{GAIN}" for i in (0, 1)}
    estimate = fit(design.plus((names[1],), *sides[1]), known, unseen, 1.0 / TwoJoints.noise)
    state = SimpleNamespace(
        robot=SimpleNamespace(n=2),
        barred=frozenset(),
        terms=[(Key(GAIN, 1), None)],
        found=[law(Key(GAIN, 1), -0.2)],
        rows=known,
        new=unseen,
        loads=lambda estimate: None,
        columns=lambda key, term, loads: sides[key.at],
        without=lambda estimate, *names, weights: fit(estimate.design.without(*names), known, unseen, weights),
    )
    (found,) = rivals_left(state, estimate)
    return [key.at for key in found.rivals]


def test_one_of_two_gains_is_off_and_no_record_says_which():
    assert as_good(np.inf) == [0]  # the body may be any, so one effort is too large or the other too small
    assert as_good(1e-6) == []  # the body is known


class Fitted:
    """Coefficients and their standard errors by name."""

    def __init__(self, **values):
        self.design = SimpleNamespace(names=tuple(f"{name[1:]}.{GAIN}" for name in values))
        self.theta, self._errors = np.array(list(values.values())).T

    def errors(self):
        return self._errors


def test_a_gain_that_is_not_there_beside_another_is_taken_out(monkeypatch):
    beside, alone = Fitted(_1=(0.02, 0.01), _2=(-0.15, 0.01)), Fitted(_2=(-0.16, 0.01))
    monkeypatch.setattr(search, "settled", lambda state, estimate: alone)
    monkeypatch.setattr(search, "ratio_on_all", lambda estimate, names: 2.5)
    keys = [Key(GAIN, 1), Key(GAIN, 2)]
    state = SimpleNamespace(terms=[(key, None) for key in keys], found=[law(key, 0.15) for key in keys])
    assert _beside(state, beside) is alone
    assert [key for key, _ in state.terms] == [law.key for law in state.found] == keys[1:]
    assert _beside(state, alone) is alone
    assert len(state.terms) == 1


def test_a_gain_stays_that_all_rows_together_tell(monkeypatch):
    found = Fitted(_2=(-0.15, 0.05))
    monkeypatch.setattr(search, "ratio_on_all", lambda estimate, names: 9.0)
    state = SimpleNamespace(terms=[(Key(GAIN, 2), None)], found=[law(Key(GAIN, 2), 0.15)])
    assert _beside(state, found) is found
    assert len(state.terms) == len(state.found) == 1


@pytest.mark.slow
def test_a_gain_is_written_and_the_new_file_is_as_good_as_was_promised(tmp_path, capsys):
    names, files = MODEL.robot.names, []
    for k, seed in enumerate((61, 62)):
        t, q, v, u = record(MODEL, seed)
        u[:, SHOULDER] *= 0.85
        files.append(written(tmp_path / f"{k}.csv", names, t, q, v, u))
    new, data = str(tmp_path / "new.yaml"), [files[0], "--validation", files[1], "--band", "6", "--json"]
    assert main(["refine", str(MODEL.source), *data, "-o", new]) == 0
    said = json.loads(capsys.readouterr().out)
    (entry,) = said["ranking"]
    assert entry["effect"] == "shoulder.sensor_gain"
    assert entry["parameters"]["gain"]["value"] == pytest.approx(0.85, rel=0.03)
    assert "wrong gain" not in said["sentences"][-1]
    own, seen = said["joints"]["shoulder"]["forward"], entry["forward"]
    assert (own["basic"], own["model"]) == (pytest.approx(seen["without"]), pytest.approx(seen["with"]))
    assert Model.load(new).parameters["shoulder.gain"] == pytest.approx(1.0 / 0.85, rel=0.03)
    assert main(["compare", new, *data]) == 0
    again = json.loads(capsys.readouterr().out)
    for name in names:
        own, before = again["joints"][name], said["joints"][name]
        assert own["model"] == pytest.approx(before["model"], rel=1e-3)
        assert own["effort"] == pytest.approx(before["effort"], rel=1e-3)
        assert own["model"] <= 1.05 * own["basic"]
        promised = entry["validation"][f"{name}.effort"]
        assert own["model"] <= 1.05 * promised["after"]
    worst = max(said["joints"][name]["basic"] / again["joints"][name]["model"] for name in names)
    assert worst > 1.5
    assert main(["diagnose", new, *data]) == 0
    assert json.loads(capsys.readouterr().out)["verdict"] != "missing"
