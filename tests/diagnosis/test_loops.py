"""Hysteresis of all signs, from an independent program: what starts in motion, with a base that forces misread."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks.hidden.generator import draw, write
from signlin_ros.diagnosis import diagnose
from signlin_ros.diagnosis.criteria import Criteria
from signlin_ros.diagnosis.output_error import FitCache, estimator_of
from signlin_ros.fitting.prepare import prepared
from signlin_ros.follow.data import load_sides
from signlin_ros.model import Model


@pytest.fixture(scope="module")
def records(tmp_path_factory):
    """Return a function that draws an entry of seed 3 of the catalogue, and returns its folder and what it hides."""

    def drawn(index: int):
        one = draw("catalogue", index, 3)
        return write(one, tmp_path_factory.mktemp("loops")), one.truth

    return drawn


def _sides(folder: Path):
    known, unseen = ([folder / f"{name}.csv"] for name in ("estimation", "validation"))
    return load_sides(Model.load(folder / "model.yaml"), known, unseen)


def test_where_a_record_starts_is_no_matter_of_what_observes_it(records):
    """A loop that runs off was started astray for one observer, by a fit that passed there: 138 times the noise was
    left of the position, and the right law was refused for that.
    """
    free = estimator_of(*prepared(*_sides(records(46)[0])), Criteria(), FitCache(), jobs=1)
    estimator = free.holding({"J": 0.002074, "B": 0.0})
    (found,) = estimator.extensions(estimator.base, ["bouc_wen_hysteresis"], share=0.5)
    assert found.within_noise(1.2)
    assert found.residual_is_noise


def test_a_loop_that_takes_no_energy_is_a_spring_and_a_load(records):
    """A valve whose packing sticks got it from forces, with a load in what h begins with: "confirmed", 0.003 ± 0.028
    of beta.
    """
    criteria = Criteria()
    estimator = estimator_of(*prepared(*_sides(records(46)[0])), criteria, FitCache(), jobs=1)
    (found,) = estimator.extensions(estimator.base, ["bouc_wen_hysteresis"], share=0.5)
    (key,) = found.added
    assert found.together_t(key) > 10.0 * criteria.min_coefficient_t
    flat = estimator.at_values_of(
        found.effects, found.model.with_parameters({f"{key}.beta": 1e-9, f"{key}.gamma": 0.0})
    )
    assert flat.together_t(key) < criteria.min_coefficient_t
    assert flat.insignificant(criteria)


def test_a_loop_that_is_another_law_is_no_second_one_of_it(records):
    """Of a cyclic test: "Dahl presliding and Dahl presliding explain a part", and no picture of it could be drawn."""
    estimator = estimator_of(*prepared(*_sides(records(46)[0])), Criteria(), FitCache(), jobs=1)
    (found,) = estimator.extensions(estimator.base, ["bouc_wen_hysteresis"], share=0.5)
    (key,) = found.added
    dahls = {f"{key}.n": 1.0, f"{key}.alpha": 1e-3, f"{key}.beta": 1.0, f"{key}.gamma": 0.0}
    model = found.model.with_parameters(dahls).with_effect("dahl_presliding", F_c=1.0, sigma=100.0)
    both = estimator.at_values_of(("bouc_wen_hysteresis", "dahl_presliding"), model)
    assert {one.effects for one in estimator.simplified(both)} == {("dahl_presliding",)}


@pytest.mark.parametrize("index", [pytest.param(39, marks=pytest.mark.long), 41, 45])
def test_one_loop_is_named_alone(records, index):
    """39: forces misread the mass by 4 %, at which it was held: a compliant load beside it. 41: a position that nobody
    measured. 45: a proposal of another law had tried its own values of this one only.
    """
    found = diagnose(*_sides(records(index)[0]))
    assert found.verdict == "missing"
    assert [one.effect for one in found.ranking if one.status == "confirmed"] == ["bouc_wen_hysteresis"]
