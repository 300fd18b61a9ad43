"""Friction that differs from record to record: told, and not taken for a law, nor a law for it."""

from dataclasses import replace

import numpy as np
import pytest

from signlin_ros.arms.ahead import ahead
from signlin_ros.arms.data import ArmRun
from signlin_ros.arms.fit import IN_RECORD
from signlin_ros.arms.keys import Key, names_of
from signlin_ros.arms.laws import EXTRA
from signlin_ros.arms.notes import of_records, warmth_notes
from signlin_ros.arms.search import settled
from signlin_ros.arms.verbs import compare, diagnose
from signlin_ros.arms.warmth import Warmth, _scatter, differing, name_of_size
from tests.arm_records import record, small

MODEL, BAND, SHOULDER = small(), 6.0, 1
SIZES = {"cold.csv": 1.2, "warm.csv": 0.85, "between.csv": 1.0}
LAW = next(law for law in EXTRA if law.effect == "load_dependent_friction")


def run(source, seed, size=1.0, kappa=0.0, duration=24.0):
    """Return a record in which all friction is some times as large as elsewhere."""
    own = {
        f"{name}.{effect}.{one}": size * MODEL.effects[f"{name}.{effect}"].parameters[one]
        for name in MODEL.robot.names
        for effect, one in (("coulomb_friction", "mu"), ("viscous_friction", "b"))
    }
    truth = MODEL.with_parameters(own)
    truth = truth.with_effect("shoulder.load_dependent_friction", kappa_d=0.0, kappa_e=size * kappa)
    t, q, v, u = record(truth, seed, duration=duration)
    return ArmRun(t, q, v, u, source, np.zeros(q.shape[1]))


def records(sizes, kappa=0.0):
    return [run(source, seed, size, kappa) for seed, (source, size) in enumerate(sizes.items(), 31)]


@pytest.fixture(scope="module")
def loaded():
    return compare(MODEL, records(SIZES, 0.12), [run("hot.csv", 40, 0.8, 0.12)], BAND).study


def test_sizes_scatter_by_what_they_differ_beyond_their_errors():
    rng = np.random.default_rng(3)
    errors = np.full((6, 40), 0.02)
    alike = rng.normal(0.3, 0.02, errors.shape)  # one size that is not one is no scatter
    assert _scatter(alike, errors) < 0.006
    assert _scatter(alike + rng.normal(0.0, 0.08, errors.shape), errors) == pytest.approx(0.08, rel=0.15)


def test_records_that_tell_nothing_of_a_joint_do_not_count():
    sizes, errors = np.array([[0.1, -0.1, 5.0], [0.0, 0.0, 0.0]]), np.array([[0.01, 0.01, np.inf], [np.inf] * 3])
    ((joint, told),) = differing(Warmth(("a", "b", "c"), sizes, errors, 0.1))
    assert joint == 0
    np.testing.assert_allclose(told, [1.1, 0.9, np.nan])
    assert _scatter(sizes, errors) == pytest.approx(np.sqrt(0.02 - 0.0001), rel=1e-6)


def test_one_record_has_one_friction():
    run_ = run("only.csv", 31)
    found = compare(MODEL, [run_.part(0.0, 0.6)], [run_.part(0.6, 1.0)], BAND).study
    assert found.warmth is None
    assert warmth_notes(found) == []
    assert not any(IN_RECORD in name for name in settled(found.state()).design.names)


@pytest.mark.slow
def test_records_of_one_warmth_do_not_differ():
    found = compare(MODEL, records(dict.fromkeys(SIZES, 1.0)), [run("d.csv", 40)], BAND).study
    assert found.warmth.spread < 0.01
    assert warmth_notes(found) == []


@pytest.mark.slow
def test_how_much_friction_differs_is_told_by_joint_and_record(loaded):
    true = np.array([*SIZES.values(), 0.8])
    found = dict(differing(loaded.warmth))
    assert sorted(found) == [0, 1, 2]
    for sizes in (found[0], found[2]):  # of the shoulder a law is missing
        np.testing.assert_allclose(sizes / sizes.mean(), true / true.mean(), rtol=0.03)
    assert loaded.warmth.spread == pytest.approx(np.std(true / true.mean()), rel=0.4)
    (said,) = warmth_notes(loaded)
    assert "(hot.csv) to" in said
    assert "(cold.csv)" in said


@pytest.mark.slow
def test_only_joints_whose_friction_differs_have_something_that_is_their_records_own(loaded):
    assert of_records(replace(loaded, drift=None)) == {i for i, _ in differing(loaded.warmth)} != set()
    errors = np.full_like(loaded.warmth.sizes, 0.02)
    scattered = replace(loaded.warmth, sizes=0.02 * np.sign(loaded.warmth.sizes), errors=errors, spread=0.01)
    assert of_records(replace(loaded, drift=None, warmth=scattered)) == set()


def test_a_law_is_found_in_records_of_different_warmth(loaded):
    found = diagnose(MODEL, *loaded.runs, BAND)
    (law,) = found.found
    assert (law.key.law, law.key.at) == (LAW.effect, SHOULDER)
    mean = np.mean(list(SIZES.values()))
    assert law.values[0] == pytest.approx(0.12 * mean, rel=0.15)
    assert law.after[SHOULDER] < 0.5 * law.before[SHOULDER]
    assert found.witnesses[0].says == "confirmed"


@pytest.mark.slow
def test_what_is_foretold_has_the_friction_of_its_record(loaded):
    state = loaded.state()
    state.terms = [(Key(LAW.effect, SHOULDER), LAW)]
    estimate = settled(state)
    matched = dict(zip(estimate.design.names, estimate.matched, strict=True))
    unseen = 3  # of the records, in their order
    assert all(estimate[name_of_size(i, unseen)] == 0.0 for i in range(3))
    size = 0.8 / np.mean(list(SIZES.values()))
    assert [matched[name_of_size(i, unseen)] for i in range(3)] == pytest.approx([size - 1.0] * 3, abs=0.04)
    assert (estimate.matched_rms < 0.7 * estimate.rms).all()
    of_all = settled(replace(state, spread=0.0))
    assert (ahead(state, estimate).rms < 0.7 * ahead(replace(state, spread=0.0), of_all).rms).all()
    without = state.without(estimate, *names_of(Key(LAW.effect, SHOULDER)))
    sizes = [without[name_of_size(SHOULDER, k)] for k in range(3)]
    assert max(np.abs(sizes)) < 0.5  # the law comes in by no other door
