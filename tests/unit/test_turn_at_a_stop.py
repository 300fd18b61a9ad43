"""A motion that turns back within a few samples is one; a lost reading is not."""

from __future__ import annotations

import numpy as np
import pytest

from signlin_ros.model import Model
from signlin_ros.records import ModelData
from signlin_ros.records.outliers import wild
from signlin_ros.simulation import simulate

STEP, STOP = 0.005, 0.1
SLIDE = Model.from_dict(
    {
        "plant": "mass_spring_damper",
        "parameters": {"m": 2.0, "c": 1.0, "k": 0.0},
        "effects": {"hard_stop": {"gap": STOP, "k_s": 2e4}},
    }
)


@pytest.fixture(scope="module")
def between_stops() -> ModelData:
    """20 s of a slide that is thrown from one stop to the other: each contact lasts six samples."""
    rng = np.random.default_rng(5)
    t = STEP * np.arange(4000)
    force = np.repeat(30.0 * np.sign(rng.normal(size=50)), 80)[:, None]
    x = simulate(SLIDE, t, force)["displacement"] + 2e-5 * rng.normal(size=t.size)
    units = {"displacement": "m", "force": "N"}
    return ModelData(t, force, {"displacement": x}, None, ("force",), ("displacement",), units)


def test_no_reading_is_lost_where_a_motion_turns_back(between_stops):
    x = between_stops.measured["displacement"]
    assert np.abs(x).max() > STOP
    assert not wild(between_stops, "displacement").any()


def test_lost_readings_are_found_beside_such_turns(between_stops):
    x, lost = between_stops.measured["displacement"].copy(), np.arange(250, 4000, 93)
    x[lost] = 0.35
    data = ModelData(between_stops.t, between_stops.u, {"displacement": x}, None, ("force",), ("displacement",), {})
    assert np.flatnonzero(wild(data, "displacement")).tolist() == lost.tolist()


def test_the_last_digit_of_a_large_number_is_no_lost_reading():
    """A position of a thousand rad was written with six digits, in steps of 0.01, and ten times finer when smaller."""
    t = np.arange(60_000) * 1e-3
    angle = 1150.0 * np.sin(2 * np.pi * t / 60.0) + 0.02 * np.sin(2 * np.pi * 7.0 * t)
    angle += np.random.default_rng(3).normal(0.0, 5e-4, t.size)
    printed = np.array([float(f"{x:.6g}") for x in angle])
    data = ModelData(t, np.zeros((t.size, 1)), {"position": printed}, None, ("voltage",), ("position",), {})
    assert not wild(data, "position").any()
    lost = np.arange(1500, 60_000, 1571)
    printed[lost] = 0.0
    assert np.flatnonzero(wild(data, "position")).tolist() == lost.tolist()
