"""Axes in closed loop whose encoders are so fine that the loop's own restless force moves them more than their noise.

The loop runs five times as fast as its log; integrated here, in small steps, with the set-valued or the bristle law.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from signlin_ros.diagnosis import add, diagnose
from signlin_ros.diagnosis.comparison import compare
from signlin_ros.follow.segments import PreparedSegment, quanta
from signlin_ros.model import Model
from signlin_ros.records import ModelData

TICK, FINE, EVERY, QUANTUM = 1e-3, 20, 5, 5e-7
M, C, SECONDS = 60.0, 900.0, 12.0
AXIS = {
    "plant": "mass_spring_damper",
    "parameters": {"m": 61.5, "c": 930.0, "k": 0.0},
    "tolerance": {"m": 0.1, "c": 0.2},
}
RESTLESS = "nothing allows for a force that acts between its samples: unexplained, and LuGre friction ends at F_s 186 N"
LAW = {"sigma0": 2e6, "sigma1": 2500.0, "F_c": 180.0, "F_s": 320.0, "v_s": 0.008}
Friction = Callable[[float, float, float, float, float], tuple[float, float]]


def bristle(q: float, v: float, free: float, z: float, h: float) -> tuple[float, float]:
    """Return the velocity after a step with LuGre friction, and its bristle's bend, which is taken implicitly;
    ``free``: the velocity without.
    """
    level = LAW["F_c"] + (LAW["F_s"] - LAW["F_c"]) * np.exp(-((v / LAW["v_s"]) ** 2))
    after = (z + h * v) / (1.0 + h * LAW["sigma0"] * abs(v) / level)
    return free - h * (LAW["sigma0"] * after + LAW["sigma1"] * (after - z) / h) / M, after


def dry(level: Callable[[float], float]) -> Friction:
    """Return dry friction by position, clipped at standstill."""
    return lambda q, v, free, z, h: (float(np.copysign(max(abs(free) - h * level(q) / M, 0.0), free)), z)


def moved(seed: int, friction: Friction, amplitude: float, speed: float) -> ModelData:
    """Return a record of an axis that follows a slow sine, which grows, in a loop with a restless force."""
    rng = np.random.default_rng(seed)
    count = round(SECONDS / TICK)
    t = np.arange(count) * TICK
    wanted = amplitude * np.sin(2 * np.pi * speed * t) * np.interp(t, [0.0, SECONDS], [0.15, 1.0])
    shown, force = np.empty(count), np.empty(count)
    q, v, z, h, before = 0.0, 0.0, 0.0, TICK / FINE, 0.0
    for k in range(count):
        shown[k] = np.round(q / QUANTUM) * QUANTUM
        slope = (shown[k] - before) / TICK
        before = shown[k]
        force[k] = 9.5e4 * (wanted[k] - shown[k]) - 1200.0 * slope + rng.normal(0.0, 1.5)
        for _ in range(FINE):
            v, z = friction(q, v, v + h * (force[k] - C * v) / M, z, h)
            q += h * v
    units = {"displacement": "m", "force": "N"}
    log = slice(None, None, EVERY)
    return ModelData(t[log], force[log, None], {"displacement": shown[log]}, None, ("force",), ("displacement",), units)


@pytest.fixture(scope="module")
def sticking() -> list[ModelData]:
    return [moved(seed, bristle, 0.012, speed) for seed, speed in ((1, 0.4), (2, 0.48))]


@pytest.mark.limit(RESTLESS)
def test_friction_is_named_where_every_slip_is_lost_over_a_longer_time(sticking):
    found = diagnose(Model.from_dict(AXIS), *sticking)
    assert found.verdict == "missing"
    assert found.ladder[-1].effects == ("lugre_friction",)
    for name in ("F_c", "F_s", "v_s", "sigma0"):
        assert found.parameters[f"lugre_friction.{name}"].value == pytest.approx(LAW[name], rel=0.05)


@pytest.mark.limit(RESTLESS)
def test_what_is_added_by_name_is_fitted_in_the_same_way(sticking):
    found = add("lugre_friction", Model.from_dict(AXIS), *sticking)
    assert found.parameters["lugre_friction.F_s"].value == pytest.approx(LAW["F_s"], rel=0.05)
    windowed = [compare(m, sticking[1]).channels["displacement"].windowed for m in (Model.from_dict(AXIS), found.model)]
    assert windowed[1].rmse < 0.7 * windowed[0].rmse


@pytest.mark.long
def test_friction_that_changes_along_the_way_is_not_given_a_name():
    known = Model.from_dict(AXIS | {"effects": {"coulomb_friction": {"mu": 21.0}}})
    uneven = dry(lambda q: 20.0 + 12.0 * np.sin(2 * np.pi * q / 0.04) * (q > 0))
    found = diagnose(known, *(moved(seed, uneven, 0.05, 0.5) for seed in (5, 6)))
    assert found.verdict == "unexplained"


def test_steps_of_an_encoder_are_seen_where_a_wide_motion_does_not_fill_them():
    """Over many turns neighbouring values lie steps apart: none was seen, and the steps counted as a force."""
    t = np.arange(5000) * 0.004
    turned, step = 30.0 * np.sin(0.7 * t) + 4.0 * np.sin(3.1 * t), 2 * np.pi / 4096
    columns = [np.round(turned / step) * step, turned, np.random.default_rng(1).normal(size=t.size)]
    record = PreparedSegment(t, np.zeros((t.size, 1)), np.column_stack(columns), {}, "record")
    assert quanta([record]) == pytest.approx([step, 0.0, 0.0], rel=1e-3)
