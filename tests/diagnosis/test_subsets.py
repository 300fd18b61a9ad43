"""Sets of laws from inner products: what they say is left is what least squares leaves, and no pair hides."""

from __future__ import annotations

import os
import subprocess
import sys
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest

from signlin_ros.diagnosis.equation_error.search import SubsetSearch
from signlin_ros.diagnosis.equation_error.subsets import Subsets
from tests.diagnosis.test_equation_error import searched

pytestmark = pytest.mark.xdist_group("subsets")  # what they share is worked out once

WEIGHT, CABLE, FRICTION = 20.0, 3.0, 4.0


@cache
def search() -> SubsetSearch:
    """Return the sets fitted to a lift: a weight and dry friction, each of which explains little by itself."""
    return searched(lambda q, v: -WEIGHT - CABLE * q - FRICTION * np.tanh(1e4 * v), unit="m")


def test_what_is_left_is_what_least_squares_leaves():
    r = search().regression
    found = Subsets(r, search().shapes)
    rng = np.random.default_rng(0)
    for count in (1, 2, 3):
        sets = np.array([rng.choice(len(found.members), count, replace=False) for _ in range(60)])
        left = found.squared_error(sets, 1e-6)
        for row, error in zip(sets, left, strict=True):
            names = [found.members[j] for j in row]
            if not np.isfinite(error) or len({n for n, _ in names}) < count:
                continue
            columns = [r.training.columns(r.laws[n], shape) for n, shape in names]
            X = np.hstack([r.training.X, *columns])
            rest = r.training.y - X @ np.linalg.lstsq(X, r.training.y, rcond=1e-10)[0]
            assert error >= (1 - 1e-6) * float(rest @ rest) - 1e-6 * float(r.training.y @ r.training.y)


def test_no_coefficient_has_a_sign_that_it_cannot_have():
    """Friction that drives is no friction."""
    against = searched(lambda q, v: 2.0 * np.tanh(1e4 * v), unit="m")
    found = Subsets(against.regression, {"coulomb_friction": against.shapes["coulomb_friction"]})
    assert found.members
    assert np.isinf(found.squared_error(np.array([[0]]), 1e-6)).all()


def test_three_laws_are_found_of_which_none_stands_alone():
    names = {n for n, _ in search().chosen.members}
    assert names == {"constant_load", "linear_stiffness", "coulomb_friction"}


@pytest.mark.parametrize(("weight", "cancel"), [(1.0, False), (-0.97, True)])
def test_laws_that_all_but_cancel_are_no_set(weight, cancel):
    """A cubic spring, a weight and a load of 0.5 N·m each were named where a load of 0.01 N·m acted."""
    r, names = search().regression, ("linear_stiffness", "cubic_stiffness")
    members = tuple((n, search().shapes[n][0]) for n in names)
    forces = [r.validation.columns(r.laws[n], shape)[:, 0] for n, shape in members]
    along = float(forces[0] @ forces[1] / (forces[1] @ forces[1]))
    spans = {names[0]: slice(1), names[1]: slice(1, 2)}
    f = SimpleNamespace(members=members, theta=np.array([1.0, weight * along]), spans=spans)
    assert search().cancels(f) == cancel


def answer() -> str:
    s, chosen = search(), search().chosen
    return f"{[sorted(m) for m in s.models]} {chosen.members} {chosen.validation_mse!r}"


def test_the_answer_is_the_same_in_every_process():
    """Names are hashed with another seed in each: here with a random one, unless it is given."""
    other = "1" if os.environ.get("PYTHONHASHSEED") != "1" else "2"
    there = subprocess.run(
        [sys.executable, "-c", "from tests.diagnosis.test_subsets import answer; print(answer())"],
        env={**os.environ, "PYTHONHASHSEED": other, "PYTHONPATH": os.pathsep.join(sys.path)},
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    assert there.strip() == answer()
    assert "constant_load" in there


@pytest.mark.parametrize("most", [1, 2, 4])
def test_each_set_of_laws_comes_once_and_the_best_first(most):
    found = Subsets(search().regression, search().shapes)
    sets = found.best(most, 1e-3)
    names = [frozenset(n for n, _ in members) for members in sets]
    assert len(set(names)) == len(names)
    assert all(len(n) == most for n in names)
    errors = [search().regression.fitted(members).training_mse for members in sets[:3]]
    assert errors[0] <= 1.5 * min(errors)
