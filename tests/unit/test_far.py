"""How far a base parameter is from nominal, in its tolerances."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from signlin_ros.diagnosis.criteria import DEFAULT_CRITERIA
from signlin_ros.diagnosis.output_error.fitted import FittedCoordinate, FittedModel
from signlin_ros.fitting.candidate import Coordinate
from signlin_ros.model import Model


def far(nominal: float, tolerance: float, value: float) -> dict[str, float]:
    k, model, fit = Coordinate("c", True, nominal, -50.0, 50.0, 0.0, tolerance), cast(Any, None), cast(Any, None)
    one, nothing = FittedCoordinate(k, k.theta(value), 0.0, k.theta(value)), np.zeros((1, 1))
    found = FittedModel((), model, {}, nothing, nothing, np.ones(1), fit, (one,), (), tuple, lambda index: 0.0)
    return found.far_from_nominal(DEFAULT_CRITERIA)


@pytest.mark.parametrize(
    ("tolerance", "value", "off"),
    [(1.0, 1e-6, None), (0.05, 0.5, -10.0), (0.05, 1.9, 100 * np.log(1.9) / 5), (0.05, 0.8, None), (0.05, 1.25, None)],
    ids=["nothing, of what is known to within itself", "half", "twice", "four tolerances less", "and more"],
)
def test_what_is_known_to_within_all_of_itself_may_be_nothing(tolerance, value, off):
    found = far(1.0, tolerance, value)
    assert found == ({} if off is None else {"c": pytest.approx(off)})


@pytest.mark.parametrize(("std", "key"), [(0.02, "backlash"), (1e-4, "")], ids=["known to twice itself", "known"])
def test_an_effect_that_a_simpler_one_replaces_is_told_by_its_key_whatever_is_said_of_it(std, key):
    """A sentence was searched for the key: reworded, it let a play of nothing stand for an elastic coupling."""
    values = {"k": 6.0, "c": 0.002, "J": 6e-4, "gap": 0.01}
    model, label = Model.load("dc_motor").with_effect("backlash", **values), ("backlash",)
    k, nothing = Coordinate("backlash.gap", True, 0.01, -12.0, 12.0, 0.0, 3.0), np.zeros((1, 1))
    one = FittedCoordinate(k, 0.0, std / 0.01, 0.0)
    fit = cast(Any, SimpleNamespace(candidate=SimpleNamespace(label=label)))
    found = FittedModel(label, model, {}, nothing, nothing, np.ones(1), fit, (one,), (), tuple, lambda index: 0.0)
    assert found.insignificant_key(DEFAULT_CRITERIA) == key
    assert bool(found.insignificant(DEFAULT_CRITERIA)) is bool(key)
