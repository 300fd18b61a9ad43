"""Nominal values that were fitted without what is missing hold a part of it."""

from __future__ import annotations

import pytest

from signlin_ros.diagnosis import diagnose
from signlin_ros.diagnosis.criteria import DEFAULT_CRITERIA
from signlin_ros.diagnosis.output_error import FitCache, estimator_of
from signlin_ros.fitting.prepare import prepared
from tests.diagnosis.test_traps import AXIS, proposed, recorded

HIDDEN = {"coulomb_friction": {"mu": 20.0}}


@pytest.mark.parametrize("seed", [0, 1])
def test_dry_friction_is_named_beside_a_viscous_friction_that_was_fitted_without_it(tmp_path, seed):
    model, known, unseen = recorded(tmp_path, AXIS, HIDDEN, exc=("multisine", "multisine"), seed=seed)
    sides = prepared(model.with_options(tolerance=5.0), known, unseen)
    line = estimator_of(*sides, DEFAULT_CRITERIA, FitCache(), jobs=1).base.model
    fitted = model.with_parameters({n: line.value(n) for n in ("m", "c")})
    assert fitted.value("c") > 1.4 * AXIS.true["c"]
    found = diagnose(fitted, known, unseen)
    assert found.verdict == "missing"
    assert proposed(found) == {"coulomb_friction"}
    assert "c ends" in found.sentence.partition(". The model lacks")[0]
    assert found.parameters["coulomb_friction.mu"].value == pytest.approx(20.0, rel=0.03)
    assert found.parameters["c"].value == pytest.approx(AXIS.true["c"], rel=0.05)
