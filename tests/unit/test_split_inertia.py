"""A nominal inertia may be that of the driven side of a coupling, or of all that moves."""

from __future__ import annotations

import numpy as np
import pytest

from signlin_ros.fitting.candidate import Candidate, candidate
from signlin_ros.fitting.prepare import prepared
from signlin_ros.model import Model
from signlin_ros.records import ModelData

MOTOR = Model.load("dc_motor").without_effect("coulomb_friction").with_parameters({"J": 1e-3})
LOAD = {"k": 6.0, "c": 0.002, "J": 6e-4}


def with_load() -> Candidate:
    t, rng = 0.002 * np.arange(500), np.random.default_rng(1)
    measured = {"speed": rng.standard_normal(500)}
    data = ModelData(t, rng.standard_normal((500, 1)), measured, None, MOTOR.inputs, MOTOR.states, MOTOR.units)
    problem, _ = prepared(MOTOR, [data], [data])
    return candidate(problem, MOTOR.with_effect("compliant_load", **LOAD), ("compliant_load",))


def deviation(c: Candidate, J: float) -> float:
    theta = c.start({"J": J})
    i = next(i for i, k in enumerate(c.coordinates) if k.name == "J")
    return float(c.prior(theta)[0][i] * c.coordinates[i].spread)


def test_what_is_known_of_an_inertia_holds_of_the_nearer_of_both():
    c = with_load()
    assert deviation(c, 1e-3) == pytest.approx(0.0)  # the driven side alone
    assert deviation(c, 4e-4) == pytest.approx(0.0)  # with the load it is the nominal one
    assert deviation(c, 9e-4) == pytest.approx(np.log(0.9))
    assert deviation(c, 5e-4) == pytest.approx(np.log(1.1))


@pytest.mark.parametrize("J", [9e-4, 5e-4])
def test_its_slope_is_that_of_small_differences(J):
    c = with_load()
    theta, step = c.start({"J": J}), 1e-6
    found = c.prior(theta)[1]
    for j in range(theta.size):
        move = np.eye(theta.size)[j] * step
        assert found[:, j] == pytest.approx(
            (c.prior(theta + move)[0] - c.prior(theta - move)[0]) / (2 * step), abs=1e-6
        )
