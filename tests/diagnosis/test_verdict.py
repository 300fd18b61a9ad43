"""Records on which uncertain parameters, uncertain starts or several effects together imitate another one."""

from __future__ import annotations

import pytest

from signlin_ros.diagnosis import diagnose
from tests.diagnosis.test_sensitive import drawn
from tests.diagnosis.test_traps import proposed


def test_where_a_velocity_starts_and_what_a_loop_remembers_are_found_together(tmp_path):
    """Fitted one by one to the first samples, they left 1.4 times the noise with the true parameters."""
    given, truth = drawn(tmp_path, "single", 125, 37)
    found = diagnose(*given)
    assert found.verdict == "missing"
    assert proposed(found) == {"bouc_wen_hysteresis"}
    true = truth["values"]["bouc_wen_hysteresis"]
    assert found.parameters["bouc_wen_hysteresis.k"].value == pytest.approx(true["k"], rel=0.03)
    assert found.ladder[-1].validation.channels["velocity"].rmse_over_noise < 1.1


def test_what_the_uncertainty_of_parameters_makes_on_other_motion_decides_nothing(tmp_path):
    """A slow record hardly tells the mass, steps depend on it: presliding gained there by chance, the spring lost."""
    given, _ = drawn(tmp_path, "single", 62, 37)
    found = diagnose(*given)
    assert proposed(found) == {"linear_stiffness"}


def test_several_effects_that_imitate_one_are_not_named_for_what_noise_in_the_input_may_leave(tmp_path):
    """Coulomb friction, presliding and a cubic spring explained 95 %."""
    given, truth = drawn(tmp_path, "outside", 12, 39)
    assert truth["laws"] == ["root_friction"]
    assert diagnose(*given).verdict == "unexplained"
