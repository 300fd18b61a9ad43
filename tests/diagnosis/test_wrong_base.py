"""A base parameter that is wrong, where another thing would show the same."""

from __future__ import annotations

import numpy as np
import pytest

from signlin_ros.diagnosis import diagnose
from signlin_ros.model import Model
from signlin_ros.records import ModelData
from signlin_ros.simulation import simulate

STEP = 0.002
MOTOR = Model.from_dict(
    {
        "plant": "dc_motor",
        "parameters": {"R_a": 1.4, "L_a": 0.001, "K_t": 0.08, "K_m": 0.08, "B": 1e-3, "J": 9e-4},
        "tolerance": {"J": 0.15, "B": 1.0},
    }
)


def run(seed: int) -> ModelData:
    """Return 6 s of the motor."""
    random, t = np.random.default_rng(seed), np.arange(3000) * STEP
    frequencies, phases = np.exp(random.uniform(np.log(0.2), np.log(8.0), 12)), random.uniform(0, 2 * np.pi, 12)
    voltage = np.sum(np.sin(2 * np.pi * np.outer(t, frequencies) + phases) / frequencies**0.5, axis=1)
    voltage *= 6.0 / voltage.std()
    x = simulate(MOTOR, t, voltage).x + random.normal(size=(t.size, 2)) * (0.02, 0.05)
    measured = {"current": x[:, 0], "speed": x[:, 1]}
    return ModelData(t, voltage[:, None], measured, None, MOTOR.inputs, MOTOR.states, dict(MOTOR.units))


@pytest.mark.slow
def test_a_resistance_and_a_gain_of_the_current_are_not_told_apart():
    """A resistance 1.36 times too large in the model file: the gain of the current's sensor was "confirmed"."""
    found = diagnose(MOTOR.with_parameters(R_a=1.9), run(39), validation=run(40))
    assert {e.status for e in found.missing} <= {"ambiguous"}
    assert "R_a ends" in found.sentence
    assert found.verdict == "unexplained" or "either may be off" in found.sentence
