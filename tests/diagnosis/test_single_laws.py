"""One law is told before several: a loop that hardens, of the field's benchmark and drawn by an independent program."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from benchmarks.hidden import catalogue
from benchmarks.hidden import laws as equations
from benchmarks.hidden.generator import draw, plan, write
from benchmarks.hidden.score import Task, judge, run
from signlin_ros.diagnosis import diagnose
from signlin_ros.effects import CATALOGUE
from signlin_ros.follow.data import load_records
from signlin_ros.model import Model

BENCHMARK = Path(os.environ.get("SIGNLIN_DATA", "../shared/data")) / "real/bouc_wen_benchmark"
LEFT_OUT = {"learned_force", "temperature_dependent_friction"}
SEED = 1
ENTRIES = catalogue.entries()


def index_of(plant: str, law: str, variant: str = "") -> int:
    return ENTRIES.index(catalogue.Entry(plant, law, variant))


@pytest.mark.skipif(not BENCHMARK.is_dir(), reason=f"no records in {BENCHMARK}; set SIGNLIN_DATA")
@pytest.mark.long  # drawn loops: below and in test_loops; this record is fitted in test_input_hold
def test_the_benchmark_of_hysteresis_is_one_loop(tmp_path):
    """Noël and Schoukens: m 2, c 10, k 5e4 and z' = 5e4 v - 1e3 (0.8 |v| z - 1.1 v |z|), so alpha 0.5, gamma < 0."""
    path = tmp_path / "nominal.yaml"
    text = (BENCHMARK / "nominal.yaml").read_text(encoding="utf-8")
    path.write_text(f"{text.rstrip()}\n    input_hold: centred\n", encoding="utf-8")
    files = [str(BENCHMARK / f"multisine_{part}.csv") for part in ("train", "test")]
    model, data = load_records(Model.load(path), files)
    found = diagnose(model, data[:1], data[1:])
    assert (found.verdict, found.ladder[-1].effects) == ("missing", ("bouc_wen_hysteresis",))
    assert found.ladder[-1].validation.channels["displacement"].rmse < 1.5e-5
    own = {name: p.value for name, p in found.parameters.items()}
    assert own["bouc_wen_hysteresis.alpha"] == pytest.approx(0.5, rel=0.02)
    assert own["bouc_wen_hysteresis.gamma"] / own["bouc_wen_hysteresis.beta"] == pytest.approx(-1.1 / 0.8, rel=0.02)
    assert (own["m"], own["k"]) == (pytest.approx(2.0, rel=0.01), pytest.approx(1e5, rel=0.01))


def test_the_catalogue_is_drawn_whole():
    laws = {e.law for e in ENTRIES}
    assert set(equations.CATALOGUE) <= laws <= set(CATALOGUE) - LEFT_OUT
    loops = {e.variant for e in ENTRIES if e.law == "bouc_wen_hysteresis"}
    assert loops == {f"{shape}, n {n}" for shape in ("softens", "hardens", "runs off") for n in (1, 2)}
    drawn = [plan("catalogue", index, SEED) for index in range(len(ENTRIES))]
    assert [(p.plant, *p.laws, p.variant) for p in drawn] == [tuple(e) for e in ENTRIES]


@pytest.mark.parametrize(("variant", "sign"), [("softens, n 1", 1.0), ("hardens, n 2", -1.0), ("runs off, n 1", -1.0)])
def test_a_loop_is_drawn_as_its_variant_says(variant, sign):
    values = draw("catalogue", index_of("mass_spring_damper", "bouc_wen_hysteresis", variant), SEED).truth["values"]
    own = values["bouc_wen_hysteresis"]
    assert own["gamma"] * sign > 0.0
    assert own["n"] == float(variant[-1])
    assert (own["gamma"] < -own["beta"]) is variant.startswith("runs off")


def scored(index: int) -> dict:
    return judge(run(Task("catalogue", index, SEED)))


@pytest.mark.parametrize("variant", ["hardens, n 1", "runs off, n 2"])
def test_a_loop_that_hardens_is_told_alone(variant):
    found = scored(index_of("mass_spring_damper", "bouc_wen_hysteresis", variant))
    assert (found["right"], found["several"]) == (True, False)


@pytest.mark.long
@pytest.mark.parametrize(
    ("group", "index", "seed"),
    [
        pytest.param("catalogue", 64, 1, id="a gain that training data tell nothing of an inductance beside"),
        pytest.param("catalogue", 4, 2, id="a motion that creeps from step to step of its encoder"),
        pytest.param("catalogue", 23, 1, id="a wave whose order two laws show"),
        pytest.param("single", 13, 69, id="friction whose level rises for that of a real one"),
        pytest.param("single", 15, 69, id="friction that leaves a base which no force is right about"),
        pytest.param(
            *("single", 0, 69),
            id="a play with minima around the one that breeding finds",
            marks=pytest.mark.limit("a play whose minimum none of two searches comes near is not named"),
        ),
        pytest.param("single", 42, 80, id="a play that validation data alone show to be another one"),
        pytest.param("single", 84, 80, id="a play that nobody sees the load cross"),
    ],
)
def test_a_law_is_told_alone_where_another_minimum_or_a_rise_by_chance_hid_it(group, index, seed):
    found = judge(run(Task(group, index, seed)))
    assert (found["right"], found["several"]) == (True, False)


def test_a_play_is_told_where_its_first_minimum_is_not_its_own():
    found = judge(run(Task("single", 97, 80)))
    assert (found["right"], found["several"]) == (True, False)


@pytest.mark.long
@pytest.mark.parametrize("index", range(len(ENTRIES)), ids=[" ".join(filter(None, e)) for e in ENTRIES])
def test_no_law_alone_is_told_as_several(index):
    assert not scored(index)["several"]


def test_records_are_written_as_the_other_groups_are(tmp_path):
    folder = write(draw("catalogue", index_of("dc_motor", "pinching_hysteresis"), SEED), tmp_path)
    assert {p.name for p in folder.iterdir()} == {"model.yaml", "truth.json", "estimation.csv", "validation.csv"}
