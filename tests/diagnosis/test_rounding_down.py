"""Encoders that count whole steps only: they read half a step too little, which is no effect that a model lacks."""

import numpy as np
import pytest

from signlin_ros.diagnosis import diagnose
from signlin_ros.model import Model
from signlin_ros.records import ModelData
from signlin_ros.simulation import simulate

STEP, QUANTUM = 0.01, 2e-3
PENDULUM = {
    "plant": "mass_spring_damper",
    "axis": "rotary",
    "parameters": {"m": 0.052, "c": 0.0015, "k": 0.0},
    "tolerance": {"m": 0.1, "c": 0.5},
    "update_period": 0.02,
}
EFFECTS = {"gravity_load": {"A": 1.27}, "coulomb_friction": {"mu": 0.006}}
UNITS = {"displacement": "rad", "force": "N·m"}


def swung(start: float, offset: float, seconds: float = 12.0) -> ModelData:
    """Return a pendulum that swings out, seen by an encoder that rounds down and reads an ``offset`` besides."""
    t = np.arange(0.0, seconds, STEP)
    u = np.zeros((t.size, 1))
    true = Model.from_dict({**PENDULUM, "effects": EFFECTS})
    q = simulate(true, t, u, x0=np.array([start, 0.0]), kind="exact").to_frame()["displacement"].to_numpy()
    shown = np.floor(q / QUANTUM) * QUANTUM + offset
    return ModelData(t, u, {"displacement": shown}, None, ("force",), ("displacement",), UNITS)


@pytest.mark.parametrize(
    ("without", "named"),
    [((), ()), pytest.param(("coulomb_friction",), ("coulomb_friction",), marks=pytest.mark.long)],
)
def test_half_a_step_of_an_encoder_is_no_effect(without, named):
    given = Model.from_dict({**PENDULUM, "effects": {n: v for n, v in EFFECTS.items() if n not in without}})
    found = diagnose(given, swung(1.1, 0.0), swung(1.4, 0.0))
    assert found.verdict == ("missing" if named else "adequate")
    assert found.ladder[-1].effects == named


def test_an_offset_of_many_steps_is_one():
    given = Model.from_dict({**PENDULUM, "effects": EFFECTS})
    found = diagnose(given, swung(1.1, 0.05, 6.0), swung(1.4, 0.05, 6.0))
    assert found.verdict == "missing"
    assert found.parameters["sensor_offset.displacement"].value == pytest.approx(0.05, abs=QUANTUM)
