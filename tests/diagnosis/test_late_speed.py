"""Dry friction beside a speed that is recorded late, where forces tell nothing."""

from __future__ import annotations

import numpy as np
import pytest

from signlin_ros.diagnosis import diagnose
from signlin_ros.model import Model
from signlin_ros.records import ModelData
from tests.drawn_tones import as_data, drawn_tones, noisy_states

STEP, LATE, MU = 0.005, 6, 0.018
MOTOR = Model.from_dict(
    {
        "plant": "dc_motor",
        "parameters": {"R_a": 0.9, "L_a": 0.0012, "K_t": 0.062, "K_m": 0.062, "B": 2e-5, "J": 3.1e-4},
        "tolerance": {"J": 0.15, "B": 0.5},
    }
)


def late(seed: int) -> ModelData:
    """Return 3 s of a motor with Coulomb friction whose speed is recorded 30 ms late."""
    random, t = np.random.default_rng(seed), np.arange(600) * STEP
    voltage = drawn_tones(random, t, count=9, band=(0.2, 6.0), fall=0.3, deviation=3.0)
    x = noisy_states(random, MOTOR.with_effect("coulomb_friction", mu=MU), t, voltage, (0.01, 0.15))
    return as_data(MOTOR, t[LATE:], voltage[LATE:], np.column_stack([x[LATE:, 0], x[:-LATE, 1]]))


@pytest.mark.slow
def test_friction_is_found_beside_a_late_speed():
    """MISSING Bouc-Wen hysteresis and sensor delay: Coulomb friction was not tried beside a late sensor, since forces
    that were read from the speed as it was recorded did not show it. UNEXPLAINED: the record begins in motion while
    its speed still shows rest, and was followed from rest; what that left of the first second was no noise.
    """
    found = diagnose(MOTOR, late(301), validation=late(302))
    assert found.verdict == "missing"
    assert {e.effect for e in found.missing} == {"coulomb_friction", "sensor_delay"}
    friction = found.model.effects["coulomb_friction"].parameters["mu"]
    assert friction == pytest.approx(MU, rel=0.03)
    assert found.model.sensors["speed"].delay == pytest.approx(LATE * STEP, rel=0.03)
    assert found.model.value("B") < 10 * MOTOR.value("B")
