"""What is said of a residual that is as small as the noise, and has structure."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from signlin_ros.diagnosis.criteria import Criteria
from signlin_ros.diagnosis.output_error.residual import ResidualStructure
from signlin_ros.diagnosis.wording import verdicts


@pytest.mark.parametrize(
    ("dependent", "structured", "said"),
    [(0.0, True, "goes on from sample to sample"), (0.1, True, "follows from the motion"), (0.0, False, "")],
)
def test_why_a_small_residual_is_no_noise_is_said(dependent, structured, said):
    """A torque logged in steps of 0.1 %: the right law "explains a part", all errors near the noise, and no reason."""
    tests = [
        ResidualStructure("position", 1.39, dependent, structured, 9.0),
        ResidualStructure("speed", 1.0, 0.0, False, 1.0),
    ]
    verdict = SimpleNamespace(final=SimpleNamespace(residual_tests=tests))
    sentence = verdicts._structure(SimpleNamespace(criteria=Criteria()), verdict)
    assert (said in sentence) if said else not sentence
    assert ("position" in sentence) is structured
    assert "noise in size" not in sentence  # beside a speed that errs by twice its noise it was said to be about that
