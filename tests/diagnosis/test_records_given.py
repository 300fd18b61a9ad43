"""What is said of records that are too short, in which nothing moves, or whose input is the same all along."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from signlin_ros.diagnosis import diagnose, load_records
from signlin_ros.diagnosis.comparison import compare
from signlin_ros.diagnosis.results import ParameterEstimate, RankingEntry
from signlin_ros.errors import InputError, RecordError, SimulationError
from signlin_ros.fitting.prepare import held_out, prepared
from signlin_ros.follow.outliers import without_outliers
from signlin_ros.model import Model
from signlin_ros.records import ModelData
from signlin_ros.simulation import simulate

MOTOR = Model.load("dc_motor")
T = np.arange(1200) * 0.005


def record(name: str = "run.csv", size: float = 4.0, t: np.ndarray = T, offset: float = 0.0) -> ModelData:
    u = size * np.sin(2 * np.pi * 0.7 * T[: t.size]) + offset
    run = simulate(MOTOR, T[: t.size], u[:, None])
    shown = run.x + 1e-3 * np.random.default_rng(1).standard_normal(run.x.shape)
    measured = dict(zip(MOTOR.states, shown.T, strict=True))
    return ModelData(t, u[:, None], measured, None, MOTOR.inputs, MOTOR.states, MOTOR.units, name)


def still(name: str) -> ModelData:
    found = record(name)
    return replace(found, measured={n: np.zeros_like(v) for n, v in found.measured.items()})


def stopping(name: str) -> ModelData:
    found, end = record(name), T.size * 2 // 3
    return replace(found, measured={n: np.where(np.arange(T.size) < end, v, 0.0) for n, v in found.measured.items()})


@pytest.mark.parametrize(
    ("data", "validation", "words"),
    [
        (lambda: [record()], lambda: [still("zeros.csv")], "zeros.csv: nothing moves"),
        (lambda: [record(), still("zeros.csv")], lambda: [record("other.csv")], "zeros.csv: nothing moves"),
        (lambda: [stopping("stops.csv")], None, "stops.csv: nothing moves in the last third, which is held out"),
        (
            lambda: [record().part(0, 5)],
            None,
            "5 samples, of which the last third is held out; at least 300 are needed",
        ),
        (lambda: [record()], lambda: [record().part(0, 5)], "5 samples; at least 100 are needed"),
    ],
)
def test_a_record_that_tells_nothing_is_refused(data, validation, words):
    with pytest.raises(RecordError, match=words):
        prepared(MOTOR, *((data(), validation()) if validation else held_out(data())))


def test_runs_that_are_short_are_taken_together():
    runs = [record().part(0, 60), record().part(60, 120), record("short.csv").part(120, 130)]
    problem, _ = prepared(MOTOR, runs, [record("other.csv")])
    assert [s.t.size for s in problem.segments] == [60, 60]
    assert "short.csv: 10 samples are left out" in problem.notes
    with pytest.raises(RecordError, match="60 samples in runs of at least 25; at least 100 are needed"):
        prepared(MOTOR, runs[1:], [record("other.csv")])


@pytest.mark.parametrize(
    ("size", "offset", "words"),
    [(0.0, 2.0, ["is 2 V", "constant load"]), (0.0, 0.0, ["is 0 from", "free decay"]), (4.0, 0.0, None)],
)
def test_an_input_that_is_the_same_all_along_is_told(size, offset, words):
    problem, unseen = prepared(MOTOR, [record("a.csv", size, offset=offset)], [record("b.csv")])
    notes = [note for note in (*problem.notes, *unseen.notes) if "the voltage is" in note]
    assert len(notes) == (words is not None)
    for word in words or ():
        assert word in notes[0]
        assert notes[0].startswith("a.csv: ")


@pytest.mark.parametrize(("per_second", "unit"), [(1e3, "ms"), (1e6, "us"), (1e9, "ns")])
def test_a_time_in_another_unit_is_asked_for(per_second, unit):
    slow = record(t=T[:600] * per_second)
    with pytest.raises(InputError, match=rf"samples are .* apart, .* update_period of 0\.2 s; is .*t \[{unit}\];"):
        compare(MOTOR, slow)


def test_a_diagnosis_asks_for_the_unit_of_the_time_too():
    with pytest.raises(SimulationError, match="is the time in ms"):
        diagnose(MOTOR, [record(t=1e3 * T)])


def test_a_time_that_may_be_in_seconds_is_not_asked_for():
    with pytest.raises(InputError, match=r"the samples are 0\.2 s apart") as caught:
        compare(MOTOR, record(t=T[:600] * 40))
    assert "the time in" not in str(caught.value)


def test_an_outlier_of_any_size_is_one():
    found = record()
    lost = found.measured["speed"].copy()
    lost[500] = 1e15
    cleaned, (note,) = without_outliers(replace(found, measured=found.measured | {"speed": lost}), ("speed",))
    assert np.flatnonzero(np.isnan(cleaned.measured["speed"])).tolist() == [500]
    assert "1 outlier" in note


def test_one_record_is_given_by_its_path_alone(tmp_path):
    found = record()
    columns = np.column_stack([T, found.u, *found.measured.values()])
    np.savetxt(tmp_path / "run.csv", columns, delimiter=",", header="t,voltage,current,speed", comments="")
    for path in (tmp_path / "run.csv", str(tmp_path / "run.csv"), [tmp_path / "run.csv"]):
        _, (data,) = load_records(MOTOR, path)
        assert len(data) == T.size


def test_an_entry_of_a_ranking_shows_itself_as_a_table():
    entry = RankingEntry("lip_seal", "confirmed", {"mu": ParameterEstimate(0.08, 0.001, "N·m")}, None, (), "a < b")
    shown = entry._repr_html_()
    for words in ("<table>", "lip_seal", "mu = 0.0800 ± 0.0010 N·m", "a &lt; b"):
        assert words in shown


@pytest.mark.parametrize(
    ("first", "second", "lengths"), [(70, 60, [70, 60]), (110, 20, [110]), (40, 90, [40, 90]), (15, 95, [110])]
)
def test_what_comes_after_a_pause_starts_anew(first: int, second: int, lengths: list[int]) -> None:
    """With a pause of 20 s: the motion after it has nothing to do with that before it."""
    whole = record("paused.csv")
    rows = np.concatenate([np.arange(first), 600 + np.arange(second)])
    t = np.where(rows < 600, T[rows], T[rows] + 20.0)
    measured = {n: v[rows] for n, v in whole.measured.items()}
    paused = replace(whole, t=t, u=whole.u[rows], measured=measured)
    _, unseen = prepared(MOTOR, [record()], [paused])
    assert [s.t.size for s in unseen.segments] == lengths
    assert [len(part) for part in unseen.parts] == lengths
    said = [note for note in unseen.notes if "left out" in note or "too short" in note]
    assert len(said) == (len(lengths) == 1)
