"""Joints in a position loop that is five times as fast as its log, which is taken at times of its own.

What the torque does between two samples is not in the log: it acts sooner or later than that tells, by another part of
a step each time. The encoder is coarse, so that within a step this is lost in its steps; over a second it is not.
Integrated here, in small steps, with the set-valued law.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from signlin_ros.diagnosis import diagnose
from signlin_ros.diagnosis.problem import Gains, changes, driven_by_changes, prepare
from signlin_ros.model import Model
from signlin_ros.records import ModelData

TICK, FINE, QUANTUM, STEP, JITTER = 1e-3, 20, 1.5e-3, 5.2e-3, 1.5e-4
M, C, LIMIT = 0.033, 0.9, 7.5
JOINT = {
    "plant": "mass_spring_damper",
    "parameters": {"m": 0.035, "c": 0.85, "k": 0.0},
    "tolerance": {"m": 0.12, "c": 0.25},
}
Force = Callable[[float], float]


def logged(seed: int, dry: float, force: Force = lambda q: 0.0) -> ModelData:
    """Return a record of a joint with dry friction and a force that goes with its position, while its loop follows
    steps and a fast sine.
    """
    rng = np.random.default_rng(seed)
    count = round(16.0 / TICK)
    t = np.arange(count) * TICK
    steps = np.repeat(rng.uniform(-1.0, 1.0, count // 400 + 1), 400)[:count]
    wanted = np.where(t < 9.0, steps, np.sin(rng.uniform(3.0, 4.0) * t) + 0.4 * np.sin(rng.uniform(9.0, 12.0) * t))
    position, torque = np.empty(count), np.empty(count)
    q, v, h = 0.0, 0.0, TICK / FINE
    for k in range(count):
        position[k] = q
        torque[k] = np.clip(14.0 * (wanted[k] - np.round(q / QUANTUM) * QUANTUM), -LIMIT, LIMIT)
        for _ in range(FINE):
            free = v + h * (torque[k] - C * v - force(q)) / M
            v = float(np.copysign(max(abs(free) - h * dry / M, 0.0), free))
            q += h * v
    times = np.arange(STEP, t[-1] - STEP, STEP)
    times += rng.normal(0.0, JITTER, times.size)
    held = torque[np.floor(times / TICK).astype(int)]
    shown = np.round(np.interp(times, t, position) / QUANTUM) * QUANTUM
    units = {"displacement": "rad", "force": "N·m"}
    return ModelData(times, held[:, None], {"displacement": shown}, None, ("force",), ("displacement",), units)


def known(**effects: dict[str, float]) -> Model:
    return Model.from_dict(JOINT | {"effects": effects})


def test_friction_is_named_where_the_torque_acts_sooner_or_later_than_its_log_tells():
    found = diagnose(known(), logged(1, 0.1), logged(2, 0.1))
    assert found.verdict == "missing"
    assert found.ladder[-1].effects == ("coulomb_friction",)
    assert found.parameters["coulomb_friction.mu"].value == pytest.approx(0.1, rel=0.05)
    assert any("sooner or later" in note for note in found.notes)


def test_a_right_model_lacks_nothing_but_when_the_torque_acts():
    found = diagnose(known(coulomb_friction={"mu": 0.11}), logged(3, 0.1), logged(4, 0.1))
    assert found.verdict == "adequate"


def test_a_force_that_is_not_listed_is_not_taken_for_timing():
    given = (logged(seed, 0.1, lambda q: 0.5 * np.sin(7.0 * q) * (q > 0)) for seed in (5, 6))
    found = diagnose(known(coulomb_friction={"mu": 0.11}), *given)
    assert found.verdict == "unexplained"


def filtered(gains: Gains, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return gains (T, n, ny) and deviations (T, ny) of the innovations by the textbook's Kalman filter."""
    m = gains.moved
    assert m is not None
    P, R = m.first, np.diag(m.noise**2)
    found = []
    for moved in np.sqrt(m.floor**2 + (m.share * changes(u)) ** 2):
        S = m.C @ P @ m.C.T + R
        K = P @ m.C.T @ np.linalg.inv(S)
        found.append((K, np.sqrt(np.diag(S))))
        P = m.A @ (P - K @ S @ K.T) @ m.A.T + (m.B * moved) @ (m.B * moved).T
    return np.array([K for K, _ in found]), np.array([s for _, s in found])


def test_gains_along_a_record_are_those_of_the_kalman_filter():
    data = logged(7, 0.1)
    problem = driven_by_changes(prepare(known(), [data]))
    assert problem is not None
    (record,) = problem.segments
    for gains in problem.levels:
        here = gains.along(record)
        values, deviations = filtered(gains, record.u)
        assert here.values == pytest.approx(values, rel=1e-6, abs=1e-9 * np.abs(values).max())
        assert here.weights == pytest.approx(gains.expected / deviations, rel=1e-6)
        assert np.mean(np.log(here.weights)) == pytest.approx(0.0, abs=1e-9)
        assert gains.along(record) is here
        assert gains.along(replace(record)) is not here


def test_where_nothing_changes_nothing_acts_sooner_or_later():
    data = logged(8, 0.1)
    still = replace(data, u=np.ones_like(data.u))
    assert driven_by_changes(prepare(known(), [still])) is None


def test_changes_are_those_to_and_from_every_sample():
    assert changes(np.array([[1.0], [1.0], [3.0], [2.0], [2.0]])).ravel().tolist() == [0.0, 2.0, 2.0, 1.0, 0.0]
