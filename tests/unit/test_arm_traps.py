"""Traps of fitting an arm that have no test elsewhere: frozen bodies, columns that are one, weights that change."""

import re

import numpy as np
import pytest

from signlin_ros.arms.data import ArmRun
from signlin_ros.arms.fit import FitDesign, fit
from signlin_ros.arms.notes import _too_wide, _without_mass, study_notes
from signlin_ros.arms.piece import RegressionRows
from signlin_ros.arms.told import compared_json
from signlin_ros.arms.verbs import compare, diagnose
from signlin_ros.model import Model
from signlin_ros.robots import read_urdf
from tests.arm_records import SMALL, record, small

MODEL, BAND, SHOULDER = small(), 6.0, 1


def run(truth, seed):
    t, q, v, u = record(truth, seed)
    return ArmRun(t, q, v, u, "simulated", np.zeros(q.shape[1]))


def with_urdf(model, **changes):
    """Return a model with its URDF in its file, masses changed, and other keys."""
    text = model.folder.joinpath(model.arm.robot).read_text()
    for before, after in changes.pop("masses", {}).items():
        text = text.replace(f'<mass value="{before}"/>', f'<mass value="{after}"/>')
    return Model.from_dict({**model.to_dict(), "robot": text, **changes})


@pytest.fixture(scope="module")
def comparisons():
    """Records of an arm whose links are not those of the file, bodies fitted near the file's and frozen at them."""
    truth = with_urdf(MODEL, masses={"1.8": "1.95", "1.0": "0.9"})
    known, unseen = run(truth, 61), run(truth, 62)
    frozen = with_urdf(MODEL, inertia={"tolerance": 1e-9})
    return tuple(compare(model, [known], [unseen], BAND) for model in (MODEL, frozen))


def test_bodies_are_fitted_with_the_friction_and_not_frozen_at_the_urdf(comparisons):
    fitted, frozen = (comparison.table.basic for comparison in comparisons)
    assert fitted[SHOULDER] < 0.2 * frozen[SHOULDER]


def test_a_motor_and_its_own_link_about_one_axis_are_one_column_and_the_fit_holds(comparisons):
    found = comparisons[0]
    estimate = found.basic
    alike = [estimate.design.known[:, estimate.design.at(name)] for name in ("waist.Izz", "0.motor_inertia")]
    own = estimate.rows.joint == 0
    first, second = (column[own] for column in alike)
    assert np.linalg.norm(first - second) < 1e-6 * np.linalg.norm(first)
    errors = estimate.errors()
    assert np.isfinite(errors).all()
    assert (errors > 0.0).all()
    told = compared_json(found, "", [])["joints"]["waist"]["cannot_tell"]
    assert "the inertia of its motor from that of its own link about the same axis" in told


def test_the_curvature_is_that_of_the_weights_which_the_fit_ends_with():
    rng, count = np.random.default_rng(3), 60

    class Rows:
        n, by_joint, counts = 2, RegressionRows.by_joint, RegressionRows.counts
        joint, block = np.repeat([0, 1], count), np.tile(np.arange(count) // 10, 2)

    rows, X = Rows(), rng.normal(size=(2 * count, 3))
    rows.y = X @ [1.0, -2.0, 0.5] + np.repeat([0.01, 3.0], count) * rng.normal(size=2 * count)
    sd = np.array([np.inf, 0.5, 0.1])
    estimate = fit(FitDesign(("a", "b", "c"), X, X, np.zeros(3), sd), rows, rows)
    W = estimate.weights[rows.joint] ** 2
    assert estimate.weights[0] > 50.0 * estimate.weights[1]
    np.testing.assert_allclose(estimate.G, (X.T * W) @ X + np.diag([0.0, 4.0, 100.0]), rtol=1e-6)
    assert np.linalg.eigvalsh(estimate.G).min() > 0.0


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda text: re.sub(r"<inertial>.*?</inertial>", "", text, flags=re.S), "no mass"),
        (lambda text: re.sub(r'(i[xyz]{2})="([^"]*)"', r'\1="\2e9"', text), "is its inertia in kg·m²"),
        (lambda text: text, ""),
    ],
    ids=["no inertials", "g·mm²", "as it is"],
)
def test_bodies_that_a_urdf_lacks_or_has_in_another_unit_are_told(change, said):
    robot = read_urdf(change(SMALL.with_suffix(".urdf").read_text(encoding="utf-8")))
    notes = [*_without_mass(robot), *_too_wide(robot)]
    assert (said in notes[0]) if said else notes == []


@pytest.mark.slow
def test_a_link_without_inertia_hides_nothing_in_its_neighbours():
    """Links of which the URDF says nothing: neither a payload nor a gain or a zero is told for what they weigh."""
    bare = re.sub(r'(<link name="upper_arm">.*?)<inertial>.*?</inertial>', r"\1", MODEL.urdf, count=1, flags=re.DOTALL)
    model = Model.from_dict({**MODEL.to_dict(), "robot": bare})
    assert model.robot.joints[SHOULDER].pi[0] == 0.0
    found = diagnose(model, [run(MODEL, 81)], [run(MODEL, 82)], BAND)
    assert found.found == found.missing == ()
    assert not found.comparison.bodies.beyond
    assert any("up to the heaviest one" in note for note in study_notes(found.comparison.study))
