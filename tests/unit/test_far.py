"""How far a base parameter is from nominal, in its tolerances."""

from __future__ import annotations

from typing import Any, cast

import numpy as np
import pytest

from signlin_ros.diagnosis.criteria import DEFAULT_CRITERIA
from signlin_ros.diagnosis.output_error.fitted import FittedCoordinate, FittedModel
from signlin_ros.fitting.candidate import Coordinate


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
