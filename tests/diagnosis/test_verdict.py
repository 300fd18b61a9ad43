"""Records on which uncertain parameters or several effects together imitate another one."""

from __future__ import annotations

import pytest

from signlin_ros.diagnosis import diagnose
from tests.diagnosis.test_hidden_effects import halved
from tests.diagnosis.test_sensitive import drawn
from tests.diagnosis.test_traps import proposed


def test_what_the_uncertainty_of_parameters_makes_on_other_motion_decides_nothing(tmp_path):
    """A slow record hardly tells the mass, steps depend on it: presliding gained there by chance, the spring lost."""
    given, _ = drawn(tmp_path, "single", 62, 37)
    found = diagnose(*halved(*given))
    assert proposed(found) == {"linear_stiffness"}


@pytest.mark.long  # a friction of this shape on a lift: test_several
def test_several_effects_are_not_named_for_an_unlisted_one(tmp_path):
    """Coulomb friction, presliding and a cubic spring explained 95 %."""
    given, truth = drawn(tmp_path, "outside", 12, 39)
    assert truth["laws"] == ["root_friction"]
    assert diagnose(*given).verdict == "unexplained"
