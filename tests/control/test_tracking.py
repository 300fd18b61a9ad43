"""Closed loops: the compiled one is the exact plant under the inputs it says; feed-forward cancels what it knows."""

from __future__ import annotations

import numpy as np
import pytest

from signlin_ros.control.designs import DEFAULT_DESIGN, DESIGNS, Task, Tuning, feed_along
from signlin_ros.control.drive import Drive, friction_free
from signlin_ros.control.inverse import InverseModel, feed_forward
from signlin_ros.control.law import ControlLaw, RunningLaw, constant
from signlin_ros.control.lqr import Weights
from signlin_ros.control.reference import ramps, sine, swing, triangle
from signlin_ros.control.tracking import TrackingBench
from signlin_ros.model import Model
from signlin_ros.simulation import simulate

PERIOD = 0.02
MOTOR = Model.load("dc_motor").with_options(with_position=True)
EFFECTS = {
    "coulomb": {},
    "stribeck": {"stribeck_friction": {"mu": 0.02, "excess": 0.01, "v_s": 1.0}},
    "dahl": {"dahl_presliding": {"sigma": 3.0, "F_c": 0.02}},
    "lugre": {"lugre_friction": {"sigma0": 4.0, "sigma1": 0.02, "F_c": 0.02, "F_s": 0.03, "v_s": 0.6}},
    "cogging": {"cogging_torque": {"A": 0.015, "N": 14.0, "phi": 0.3}},
    "load": {"constant_load": {"F0": 0.01}, "gravity_load": {"A": 0.02}},
}


def motor(name: str) -> Model:
    model = MOTOR
    for key, values in EFFECTS[name].items():
        model = model.with_effect(key, **values)
    return model


@pytest.mark.parametrize("name", EFFECTS)
@pytest.mark.parametrize("delay", [0.0, 0.013, 0.045])
def test_the_loop_is_the_exact_simulation_under_its_own_inputs(name, delay):
    """Inputs of the closed loop, given to `simulate` with the same delay, give the same motion."""
    model = motor(name)
    drive, profile = Drive.of(model), triangle(3.0, 2.0, 1)
    bench = TrackingBench(drive, profile, PERIOD, delay)
    law = ControlLaw(*constant(0.0, 0.2, 0.5), PERIOD, 12.0, False)
    run = bench.run(law, feed_forward(drive, profile, PERIOD, bench.count, 0.05, delay), rtol=1e-9)
    held = np.repeat(run.u, 20)
    t = PERIOD / 20 * np.arange(held.size)
    late = np.where(t >= delay - 1e-9, np.interp(t, t, t), 0.0)
    index = np.floor((late - delay) / PERIOD + 1e-9).astype(int)
    u = np.where(index >= 0, run.u[np.clip(index, 0, None)], 0.0)
    if delay == 0.013:  # on the finer grid of 1 ms the delay is a whole number of steps
        assert np.isclose(delay / (PERIOD / 20), 13)
    truth = simulate(model, t, u[:, None], np.zeros(len(model.states)), rtol=1e-9)
    np.testing.assert_allclose(run.motion[:, 1], truth["speed"][::20], atol=2e-6)
    np.testing.assert_allclose(run.motion[:, 0], truth["position"][::20], atol=2e-6)


@pytest.mark.parametrize("name", EFFECTS)
def test_the_inverse_gives_the_input_that_gives_the_motion(name):
    """The exact plant, driven by the inverse at small steps from the reference's start, follows it."""
    model = motor(name)
    drive, profile = Drive.of(model), swing(1.0, 3.0, 1)
    h = 5e-4
    t = h * np.arange(int(profile.duration / h))
    u = InverseModel(drive, 1e-3).along(np.column_stack(profile.at(t + h / 2)), h)
    truth = simulate(model, t, u[:, None], np.zeros(len(model.states)))
    q, v, _ = profile.at(t)
    assert np.sqrt(np.mean((truth["position"] - q) ** 2)) < 0.01 * np.ptp(q)
    assert np.sqrt(np.mean((truth["speed"] - v) ** 2)) < 0.02 * np.ptp(v)


def test_a_reference_at_rest_asks_for_no_friction_and_for_all_of_the_load():
    drive = Drive.of(motor("load"))
    rest = np.zeros((50, 3))
    u = InverseModel(drive, 0.01).along(rest, 1e-3)[-1]
    np.testing.assert_allclose(u, -0.764 / 0.0805 * 0.01, rtol=1e-6)


@pytest.mark.parametrize("position", [False, True])
@pytest.mark.parametrize("name", ["coulomb", "stribeck", "dahl", "cogging"])
def test_the_default_design_beats_the_friction_free_one_by_far(name, position):
    model, drive = motor(name), Drive.of(motor(name))
    task = Task(position, PERIOD, PERIOD, 12.0, 3.0)
    tuning = Tuning(Weights(15.0), turning=1.0)
    profile = swing(1.0, 4.0, 2) if position else sine(3.0, 4.0, 2)
    bench = TrackingBench(drive, profile, PERIOD, PERIOD)
    rms = {}
    for design in ("friction_free", DEFAULT_DESIGN):
        law = DESIGNS[design].law(model, task, tuning)
        rms[design] = bench.run(law, feed_along(DESIGNS[design], model, task, tuning, profile, bench.count)).rms
    assert rms[DEFAULT_DESIGN] < 0.25 * rms["friction_free"]


def test_no_standing_oscillation_at_a_stop_with_stribeck_friction():
    model = motor("stribeck")
    task, tuning = Task(True, PERIOD, PERIOD, 12.0, 3.0, 2e-3), Tuning(Weights(15.0), turning=1.0)
    profile = ramps(1.5, 2.0, 0.6, cycles=1, last=6.0)
    bench = TrackingBench(Drive.of(model), profile, PERIOD, PERIOD)
    design = DESIGNS[DEFAULT_DESIGN]
    run = bench.run(design.law(model, task, tuning), feed_along(design, model, task, tuning, profile, bench.count))
    assert run.oscillation(3.0) < 5e-3


def test_a_raw_a_k_at_the_state_is_worse_than_no_friction_at_all():
    model = motor("coulomb")
    task, tuning = Task(False, PERIOD, PERIOD, 12.0, 3.0), Tuning(Weights(15.0))
    profile = sine(3.0, 4.0, 2)
    bench = TrackingBench(Drive.of(model), profile, PERIOD, PERIOD)
    rms = {}
    for design in ("friction_free", "ak_raw"):
        law = DESIGNS[design].law(model, task, tuning)
        rms[design] = bench.run(law, feed_along(DESIGNS[design], model, task, tuning, profile, bench.count)).rms
    assert rms["ak_raw"] > rms["friction_free"]


def test_the_law_is_limited_and_does_not_wind_up():
    law = ControlLaw(*constant(0.0, 0.0, 1.0), 0.1, 0.5, False)
    running = RunningLaw(law)
    for _ in range(100):
        assert abs(running(np.array([0.0, 10.0]), np.zeros(2), 0.0)) <= 0.5
    after = [running(np.array([0.0, -10.0]), np.zeros(2), 0.0) for _ in range(3)]
    assert after[-1] == -0.5  # a second later, not a hundred


def test_the_integral_action_rests_within_the_tolerance_at_a_stop():
    running = RunningLaw(ControlLaw(*constant(1.0, 0.0, 5.0), 0.1, 10.0, True, tolerance=0.01))
    for _ in range(50):
        u = running(np.zeros(2), np.array([0.005, 0.0]), 0.0)
    assert u == pytest.approx(-0.005)


def test_the_turning_part_changes_its_sign_with_the_direction():
    running = RunningLaw(ControlLaw(*constant(0.0, 0.0, 1.0), 0.1, 10.0, False, turning=1.0, width=0.1))
    for _ in range(10):
        running(np.array([0.0, 1.0]), np.array([0.0, 0.5]), 0.0)
    forward = running(np.array([0.0, 1.0]), np.array([0.0, 1.0]), 0.0)
    back = running(np.array([0.0, -1.0]), np.array([0.0, -1.0]), 0.0)
    assert forward == pytest.approx(1.0)  # 0.5 from each part
    assert back == pytest.approx(0.0)


def test_profiles_are_consistent():
    for profile in (sine(2.0, 3.0), triangle(2.0, 3.0), swing(1.0, 3.0), ramps(1.0, 2.0, 0.5)):
        t = np.linspace(0.0, profile.duration, 20001)
        q, v, a = profile.at(t)
        h = t[1]
        np.testing.assert_allclose(np.diff(q) / h, (v[1:] + v[:-1]) / 2, atol=2e-2 * np.abs(v).max())
        assert abs(profile.at([profile.duration])[1][0]) < 1e-9
        assert np.isfinite(a).all()


def test_friction_free_plants_need_no_friction():
    """On a plant without effects the whole model and the friction-free one feed the same."""
    model = friction_free(MOTOR)
    task, tuning = Task(False, PERIOD, PERIOD, 12.0, 3.0), Tuning(Weights(15.0))
    profile = sine(3.0, 4.0, 1)
    whole = feed_along(DESIGNS[DEFAULT_DESIGN], model, task, tuning, profile, 100)
    linear = feed_along(DESIGNS["friction_free"], model, task, tuning, profile, 100)
    np.testing.assert_allclose(whole, linear, atol=1e-9)
