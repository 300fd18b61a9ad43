"""A payload that is not the same in all records: weighed beside the lightest, and not taken for laws."""

import numpy as np
import pytest

from signlin_ros.arms.data import ArmRun
from signlin_ros.arms.loaded import Loaded, more_than, names_in_record
from signlin_ros.arms.told import diagnosed_json, sentences
from signlin_ros.arms.verbs import compare, diagnose
from signlin_ros.model import Model
from tests.arm_records import record, small

MODEL, BAND, N = small(), 6.0, 3
HERE = {"robot": str(MODEL.folder / MODEL.arm.robot)}


def run(source, seed, mass=0.0, truth=MODEL):
    """Return a record in which the arm carries a mass."""
    truth = Model.from_dict({**truth.to_dict(), **HERE, "payload": {"on": "tool", "m": mass, "com": [0.05, 0.0, 0.02]}})
    t, q, v, u = record(truth, seed)
    return ArmRun(t, q, v, u, source, np.zeros(N))


def test_records_that_carry_more_are_named_beside_the_lightest():
    found = Loaded(("a", "b", "c"), np.array([0.4, 0.0, 0.01]), np.array([0.02, 0.0, 0.02]))
    said = more_than(found, ["a.csv", "b.csv", "c.csv"], "tool", 4.0)
    assert said == "payload on tool: a.csv 0.4 ± 0.02 kg more than b.csv"


@pytest.fixture(scope="module")
def bare():
    """A diagnosis of records in which nobody carries anything."""
    return diagnose(MODEL, [run("first", 51), run("second", 52)], [run("unseen", 53)], BAND)


@pytest.mark.slow
@pytest.mark.parametrize("heavy", ["first", "second", "unseen"])
def test_a_payload_in_one_record_is_weighed_and_nothing_else_is_named(heavy, bare):
    masses = {name: 0.8 if name == heavy else 0.0 for name in ("first", "second", "unseen")}
    runs = {name: run(name, seed, mass) for seed, (name, mass) in enumerate(masses.items(), 51)}
    found = diagnose(MODEL, [runs["first"], runs["second"]], [runs["unseen"]], BAND)
    study, estimate = found.comparison.study, found.estimate
    assert found.found == found.missing == found.couplings == ()
    at = study.loaded.sources.index(heavy)
    assert study.loaded.masses[at] == pytest.approx(0.8, rel=0.05)
    assert study.loaded.lightest != at
    (note,) = [n for n in diagnosed_json(found, "", "", [])["notes"] if n.startswith("payload on ")]
    assert f"{heavy} 0.8" in note
    assert f"{heavy} 0.8" in sentences(found)[-1]
    assert diagnosed_json(found, "", "", [])["robot"]["payloads"][heavy]["value"] == study.loaded.masses[at]
    own = [estimate.matched[estimate.design.names.index(name)] for name in names_in_record(at)]
    centre = MODEL.robot.frame("tool")[2] + np.array([0.05, 0.0, 0.02])
    np.testing.assert_allclose(own[:4], 0.8 * np.array([1.0, *centre]), atol=0.03)
    # what is left beside it is what is left where nobody carries anything, and windows have it, too
    assert bare.comparison.study.loaded is None
    assert (found.comparison.matched < 1.5 * bare.estimate.matched_rms).all()
    assert (found.ahead[1].rms < 1.5 * bare.ahead[1].rms).all()
    if heavy == "unseen":
        assert any("beside what is that record's own" in line for line in sentences(found))


@pytest.mark.slow
def test_a_payload_of_all_records_is_none_of_one():
    study = compare(MODEL, [run("first", 51, 0.8), run("second", 52, 0.8)], [run("unseen", 53, 0.8)], BAND).study
    assert study.loaded is None


@pytest.mark.slow
def test_friction_that_grows_with_the_load_sees_what_its_record_carries():
    law = "shoulder.load_dependent_friction"
    truth = MODEL.with_effect(law, kappa_d=0.0, kappa_e=0.1)
    sides = [[run(f"bare {s}", s, 0.0, truth), run(f"loaded {s}", s + 1, 3.0, truth)] for s in (51, 53)]
    found = diagnose(MODEL, *sides, BAND)
    (one,) = found.found
    assert one.key.law == "load_dependent_friction"
    assert one.values[0] == pytest.approx(0.1, rel=0.05)
