"""What unseen rows say of a law: by themselves, or in what a fit to other rows foretells for them."""

from types import SimpleNamespace

import numpy as np
import pytest

from signlin_ros.arms.fit import FitDesign, blocks, fit
from signlin_ros.arms.heldout import again, agree, foretells, foretold_both_ways, ratio_on_all
from signlin_ros.arms.keys import GAIN, Key
from signlin_ros.arms.laws import EXTRA
from signlin_ros.arms.piece import RegressionRows
from signlin_ros.arms.search import Promise, _beaten, needed_errors, stands

FRICTION = next(law for law in EXTRA if law.loaded)
LAW, NOISE, COUNT = ("law",), 0.05, 200


class Rows:
    """Rows of one joint whose effort is a mass times x and, where there is one, a law times z."""

    n, by_joint, counts = 1, RegressionRows.by_joint, RegressionRows.counts

    def __init__(self, seed, law, turn=1.0, apart=1.0):
        rng = np.random.default_rng(seed)
        self.joint, self.block = np.zeros(COUNT, dtype=int), np.arange(COUNT) // 10
        self.x = rng.normal(size=COUNT)
        self.z = turn * self.x + apart * rng.normal(size=COUNT)  # little apart: the law looks like the mass
        self.y = 2.0 * self.x + law * self.z + NOISE * rng.normal(size=COUNT)


def fitted(known, unseen):
    """Return the fits without the law and with it."""
    one = np.array([np.inf])
    before = FitDesign(("mass",), known.x[:, None], unseen.x[:, None], np.zeros(1), one)
    weights = np.array([1.0 / NOISE])
    trial = before.plus(LAW, known.z[:, None], unseen.z[:, None])
    return tuple(fit(design, known, unseen, weights) for design in (before, trial))


@pytest.mark.parametrize(("law", "there"), [(0.3, True), (0.0, False), (-0.3, False)])
def test_rows_that_tell_a_law_apart_say_it_again_by_themselves(law, there):
    known, unseen = Rows(1, 0.3), Rows(2, law)
    before, trial = fitted(known, unseen)
    assert again(trial, LAW) == there
    assert foretells(before, trial, LAW, 0) == there


@pytest.mark.parametrize(("law", "there"), [(0.3, True), (0.0, False), (-0.3, False)])
def test_rows_in_which_a_law_looks_like_another_one_tell_whether_what_is_foretold_is_there(law, there):
    known, unseen = Rows(3, 0.3), Rows(4, law, turn=3.0, apart=1e-3)
    before, trial = fitted(known, unseen)
    assert not again(trial, LAW)
    assert foretells(before, trial, LAW, 0) == there


def test_a_few_blocks_are_no_scatter():
    known, unseen = Rows(3, 0.3), Rows(4, 0.3, turn=3.0, apart=1e-3)
    unseen.block = np.arange(COUNT) // 100
    assert not foretells(*fitted(known, unseen), LAW, 0)


def test_two_motions_together_tell_what_one_does_not():
    known, unseen = Rows(5, 0.3, apart=0.04), Rows(6, 0.3, turn=3.0, apart=0.04)
    _, trial = fitted(known, unseen)
    alone = abs(trial["law"] / trial.errors()[-1])
    assert alone < 5.0
    assert ratio_on_all(trial, LAW) > 20.0 > alone
    assert trial.rows.y.size == COUNT  # the rows of the fit stay as they were


@pytest.mark.parametrize("law", [0.3, 0.0])
def test_a_law_of_friction_that_the_fit_leaves_in_doubt_stands_if_all_rows_tell_it(law):
    known, unseen = Rows(5, law, apart=0.03), Rows(6, law, turn=3.0, apart=0.5)
    before, trial = fitted(known, unseen)
    assert abs(trial["law"] / trial.errors()[-1]) < needed_errors(50)
    state = SimpleNamespace(rows=known, new=unseen)
    promise = Promise(1.0, Key(FRICTION.effect, 0), FRICTION, known.z[:, None], unseen.z[:, None])
    assert (stands(state, before, promise, 50) is not None) == (law > 0.0)


def test_each_row_is_foretold_once_by_the_others():
    """Which of two records is fitted does not matter; a law that is there is worth it, one that is not is not."""
    known, unseen = Rows(1, 0.3), Rows(2, 0.3)
    falls = [foretold_both_ways(*fitted(*pair))[0] for pair in ((known, unseen), (unseen, known))]
    assert falls[0] == pytest.approx(falls[1], rel=1e-12)
    assert falls[0] > 0.9
    assert foretold_both_ways(*fitted(Rows(1, 0.0), Rows(2, 0.0)))[0] < 0.02


@pytest.mark.parametrize(("other", "said"), [(0.3, True), (-0.3, False)])
def test_a_gain_that_one_record_leaves_open_stands_if_both_agree_and_together_tell_it(other, said):
    known, unseen = Rows(1, 0.3), Rows(2, other, apart=0.02)
    before, trial = fitted(known, unseen)
    assert not again(trial, LAW)
    assert agree(trial, LAW) == said
    state = SimpleNamespace(rows=known, new=unseen)
    promise = Promise(1.0, Key(GAIN, 0), None, known.z[:, None], unseen.z[:, None])
    assert (stands(state, before, promise, 50) is not None) == said


def test_errors_allow_for_what_a_fit_takes_of_a_few_blocks():
    """Twelve blocks, six coefficients that are alike within a block, noise that is, too: how large errors are."""
    rng, count, blocks_ = np.random.default_rng(7), 6, 12
    rows = SimpleNamespace(n=1, joint=np.zeros(10 * blocks_, dtype=int), block=np.arange(10 * blocks_) // 10)
    rows.by_joint, rows.counts = (lambda r: np.array([np.sqrt(np.mean(r**2))])), np.array([10 * blocks_])
    values, told, without = [], [], []
    for _ in range(300):
        X = np.repeat(rng.normal(size=(blocks_, count)), 10, axis=0) + 0.1 * rng.normal(size=(10 * blocks_, count))
        rows.y = np.repeat(rng.normal(size=blocks_), 10) + 0.1 * rng.normal(size=10 * blocks_)
        names = tuple(map(str, range(count)))
        found = fit(FitDesign(names, X, X, np.zeros(count), np.full(count, np.inf)), rows, rows, np.ones(1))
        seen = np.linalg.norm(blocks(X * found.residual[:, None], rows.block) @ found.inverse(), axis=0)
        values.append(found.theta)
        told.append(found.errors())
        without.append(seen)
    true, few, least = (float(np.mean(np.square(x))) for x in (values, told, without))
    assert few == pytest.approx(true, rel=0.2)
    assert least < 0.6 * true  # residuals of rows that the fit sees


def test_unabsorbed_residuals_lie_between_those_of_fits_with_and_without_the_block():
    rows = Rows(8, 0.3)
    _, trial = fitted(rows, rows)
    own = rows.block == 3
    X, y = trial.design.known[~own], rows.y[~own]
    theta = np.linalg.lstsq(X, y, rcond=None)[0]
    expected = (rows.y[own] - trial.design.known[own] @ theta) / NOISE
    found, seen = trial.unabsorbed[own], trial.residual[own] * trial.weights[trial.rows.joint[own]]
    assert found @ found == pytest.approx(seen @ expected, rel=1e-5)
    assert np.linalg.norm(seen) < np.linalg.norm(found) < np.linalg.norm(expected)


@pytest.mark.parametrize("truth_first", [False, True])
def test_a_law_that_another_joints_law_leaves_nothing_of_is_not_the_first(truth_first):
    """One joint's law imitates another's: all rows know the true one beside it, and it no more."""
    known, unseen = Rows(9, 0.3), Rows(10, 0.3)
    before, _ = fitted(known, unseen)
    rng = np.random.default_rng(11)
    true, like = ([rows.z[:, None] for rows in (known, unseen)] for _ in range(2))
    like = [z + 0.3 * rng.normal(size=z.shape) for z in like]
    promises = [Promise(1.0, Key("spring", joint), None, *columns) for joint, columns in enumerate((true, like))]
    first, other = promises if truth_first else promises[::-1]
    state = SimpleNamespace(rows=known, new=unseen)
    assert _beaten(state, before, first, other) != truth_first
