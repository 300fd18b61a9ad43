"""A base parameter that is wrong, where another thing would show the same."""

from __future__ import annotations

import numpy as np
import pytest

from signlin_ros.diagnosis import diagnose
from signlin_ros.model import Model
from signlin_ros.records import ModelData
from tests.drawn_tones import as_data, drawn_tones, noisy_states

STEP = 0.002
MOTOR = Model.from_dict(
    {
        "plant": "dc_motor",
        "parameters": {"R_a": 1.4, "L_a": 0.001, "K_t": 0.08, "K_m": 0.08, "B": 1e-3, "J": 9e-4},
        "tolerance": {"J": 0.15, "B": 1.0},
    }
)


def run(seed: int) -> ModelData:
    """Return 3 s of the motor."""
    random, t = np.random.default_rng(seed), np.arange(1500) * STEP
    voltage = drawn_tones(random, t, count=12, band=(0.2, 8.0), fall=0.5, deviation=6.0)
    return as_data(MOTOR, t, voltage, noisy_states(random, MOTOR, t, voltage, (0.02, 0.05)))


@pytest.mark.slow
def test_a_resistance_and_a_gain_of_the_current_are_not_told_apart():
    """A resistance 1.36 times too large in the model file: the gain of the current's sensor was "confirmed"."""
    found = diagnose(MOTOR.with_parameters(R_a=1.9), run(39), validation=run(40))
    assert {e.status for e in found.missing} <= {"ambiguous"}
    assert "R_a ends" in found.sentence
    assert found.verdict == "unexplained" or "either may be off" in found.sentence
