"""Records on which uncertain parameters or several effects together imitate another one."""

from __future__ import annotations

import numpy as np
import pytest

from signlin_ros.diagnosis import diagnose
from signlin_ros.model import Model
from signlin_ros.records import ModelData
from signlin_ros.simulation import simulate
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


@pytest.mark.parametrize(("drift", "verdict"), [(0.0, "adequate"), (0.06, "unexplained")])
def test_of_a_single_step_no_test_shows_that_what_is_left_is_noise(drift: float, verdict: str) -> None:
    """A motor that is 6 % faster once it is warm; held out is its last, steady speed, in steps of an encoder."""
    parameters = {"R_a": 5.0, "L_a": 0.0, "K_t": 0.6, "K_m": 0.78, "B": 0.0, "J": 0.006}
    tolerance = {"R_a": 0.5, "K_t": 0.3, "K_m": 0.3, "J": 1.0}
    motor = Model.from_dict(
        {"plant": "dc_motor", "parameters": parameters, "tolerance": tolerance, "update_period": 0.1}
    )
    t, step = np.arange(300) * 0.02, 0.7272
    u = np.where(t >= 2.0, 9.0, 0.0)[:, None]
    speed = simulate(motor, t, u).x[:, motor.states.index("speed")]
    warm = speed * (1.0 + drift * (1.0 - np.exp(-np.maximum(t - 2.0, 0.0))))
    shown = step * np.round((warm + 0.15 * np.random.default_rng(0).normal(size=t.size)) / step)
    data = ModelData(t, u, {"speed": shown}, None, motor.inputs, motor.states, dict(motor.units), "run.csv")
    found = diagnose(motor.with_parameters(K_m=0.7, J=0.004), data)
    assert found.verdict == verdict
    assert ("Too little was recorded to tell whether something is missing" in found.sentence) == bool(drift)
