"""A machine that nothing drives: forces are known beside its inertia only."""

from __future__ import annotations

import numpy as np
import pytest

from signlin_ros.diagnosis import diagnose
from signlin_ros.model import Model
from signlin_ros.records import ModelData
from signlin_ros.simulation import simulate

STEP, HIDDEN = 0.005, {"gravity_load.A": 0.35, "quadratic_drag.c2": 6e-4, "coulomb_friction.mu": 0.004}
PENDULUM = Model.from_dict(
    {
        "plant": "mass_spring_damper",
        "axis": "rotary",
        "parameters": {"m": 0.012, "c": 4e-4, "k": 0.0},
        "tolerance": {"m": 0.1, "c": 1.0},
    }
)


def decay(seed: int, angle: float) -> ModelData:
    """Return 20 s of a pendulum that is let go at an ``angle`` in rad: an encoder of 4096 steps, a rate gyro."""
    random, t, model = np.random.default_rng(seed), np.arange(4000) * STEP, PENDULUM
    for name, value in HIDDEN.items():
        effect, _, parameter = name.partition(".")
        model = model.with_effect(effect, **{parameter: value})
    x = simulate(model, t, np.zeros(t.size), [angle, 0.0]).x
    steps = 2 * np.pi / 4096
    measured = {"displacement": np.round(x[:, 0] / steps) * steps, "velocity": x[:, 1] + random.normal(0, 0.02, t.size)}
    return ModelData(t, np.zeros((t.size, 1)), measured, None, model.inputs, PENDULUM.states, dict(PENDULUM.units))


@pytest.mark.slow
def test_what_slows_a_pendulum_that_nothing_drives():
    """UNEXPLAINED, "110 % of the inertial force": the band of the forces was chosen beside an effort of nothing, and
    held none of them. Then the inertia ended three tolerances off, with all that is known beside it.
    """
    found = diagnose(PENDULUM, decay(7, 2.6), validation=decay(8, 2.1))
    assert found.verdict == "missing"
    assert {e.effect for e in found.missing} == {name.partition(".")[0] for name in HIDDEN}
    inertia = found.model.value("m")
    assert inertia == pytest.approx(PENDULUM.value("m"), rel=0.03)
    for name, value in HIDDEN.items():
        effect, _, parameter = name.partition(".")
        told = found.model.effects[effect].parameters[parameter]
        assert told / inertia == pytest.approx(value / PENDULUM.value("m"), rel=0.05)
