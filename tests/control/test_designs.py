"""Gains against python-control, constants against closed forms, A_k against what a design may take of it."""

from __future__ import annotations

import numpy as np
import pytest

from signlin_ros.control.constants import constants
from signlin_ros.control.designs import DESIGNS, Task, Tuning, find_design, known, secants
from signlin_ros.control.drive import Drive, friction_free
from signlin_ros.control.lqr import Weights, held, lqr_gains, pid_gains, rigid, sampled
from signlin_ros.errors import InputError
from signlin_ros.model import Model

WEIGHTS = Weights(12.0, 0.8, 0.4)
KV, KA, KP = 0.09, 0.02, 0.3


@pytest.mark.parametrize("position", [False, True])
def test_gains_without_delay_are_python_controls_dlqr(position):
    import control

    A, B = rigid(KV, KA, KP, position)
    F, G = held(A, B, 0.02)
    Q, R = WEIGHTS.matrices(KA, position)
    want = control.dlqr(F, G, Q, R)[0][0]
    got = lqr_gains(KV, KA, KP, WEIGHTS, 0.02, 0.0, position)
    order = [got.k_i, got.k_q, got.k_v] if position else [got.k_i, got.k_v]
    np.testing.assert_allclose(order, want, rtol=1e-8)
    assert got.past == ()


@pytest.mark.parametrize("position", [False, True])
def test_pid_is_python_controls_lqr(position):
    import control

    model = Model.load("dc_motor")
    c = known(model, Task(position, 0.02, 0.0, 10.0, 5.0))
    A, B = rigid(c.kV, c.kA, c.kP, position)
    Q, R = WEIGHTS.matrices(c.kA, position)
    want = control.lqr(A, B, Q, R)[0][0]
    got = pid_gains(c, WEIGHTS, position)
    np.testing.assert_allclose([got.k_i, got.k_v], [want[0], want[-1]], rtol=1e-8)


@pytest.mark.parametrize("delay", [0.0, 0.007, 0.02, 0.033, 0.05])
def test_a_sampled_delay_is_that_of_the_continuous_system(delay):
    """The sampled system, driven by random inputs, ends where a simulation in small steps does."""
    A, B = rigid(KV, KA, KP, True)
    F, G = sampled(A, B, 0.02, delay)
    u = np.random.default_rng(1).standard_normal(30)
    z = np.zeros(len(F))
    for value in u:
        z = F @ z + G[:, 0] * value
    parts = 200
    small, push = held(A, B, 0.02 / parts)
    x = np.zeros(3)
    for k in range(30 * parts):
        past = int(np.floor((k + 0.5) / parts - delay / 0.02))
        x = small @ x + push[:, 0] * (u[past] if past >= 0 else 0.0)
    np.testing.assert_allclose(z[:3], x, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("delay", [0.0, 0.02, 0.033])
@pytest.mark.parametrize("position", [False, True])
def test_the_closed_loop_is_stable_with_its_delay(delay, position):
    F, G = sampled(*rigid(KV, KA, KP, position), 0.02, delay)
    got = lqr_gains(KV, KA, KP, Weights(20.0), 0.02, delay, position)
    place = [got.k_i, got.k_q, got.k_v] if position else [got.k_i, got.k_v]
    closed = F - G @ np.array([[*place, *got.past]])
    assert np.abs(np.linalg.eigvals(closed)).max() < 1.0


def test_constants_of_a_motor_are_its_data_sheet():
    model = Model.load("dc_motor").with_parameters({"L_a": 0.0, "B": 0.001})
    p, c = model.parameters, constants(Drive.of(model), 5.0)
    scale = p["R_a"] / p["K_t"]
    np.testing.assert_allclose(c.kV, p["K_m"] + scale * p["B"], rtol=1e-6)
    np.testing.assert_allclose(c.kA, scale * p["J"], rtol=1e-6)
    np.testing.assert_allclose(c.kS, scale * 0.033, rtol=1e-6)
    assert abs(c.kG) < 1e-9
    assert c.left < 1e-9


def test_constants_hold_springs_loads_and_hanging_inertia():
    model = Model.load("mass_spring_damper").with_effect("constant_load", F0=2.0)
    c = constants(Drive.of(model), 0.3)
    np.testing.assert_allclose([c.kA, c.kP, c.kG], [1.0, 40.0, -2.0], rtol=1e-6)
    free = Model.load("dc_motor").with_effect("compliant_load", k=20.0, c=0.05, J=0.0022)
    np.testing.assert_allclose(constants(Drive.of(free), 5.0).kA, 2 * 0.764 / 0.0805 * 0.0022, rtol=1e-6)


def test_a_k_has_the_secant_of_the_friction():
    """mu sign_j(v)/v beside the back-EMF: true at speed, many times the friction near standstill."""
    model = Model.load("dc_motor")
    scale = 0.764 / 0.0805
    found = secants(model, np.array([5.0, 1e-3]))
    np.testing.assert_allclose(found.kV[0], 0.0805 + scale * 0.033 / 5.0, rtol=1e-3)
    assert found.kV[1] > 100 * 0.0805
    np.testing.assert_allclose(found.kA, scale * 0.0022, rtol=1e-9)


def test_a_raw_a_k_takes_the_feedback_away_near_standstill_and_a_floor_keeps_it():
    model, task = Model.load("dc_motor"), Task(False, 0.02, 0.02, 12.0, 5.0)
    tuning = Tuning(Weights(15.0), floor=0.2)
    free = DESIGNS["friction_free"].law(model, task, tuning).gains[0, 1]
    raw = DESIGNS["ak_raw"].law(model, task, tuning).gains[0, 1]
    floored = DESIGNS["ak_reference"].law(model, task, tuning).gains[0, 1]
    assert raw < 0.02 * free
    assert floored > 0.3 * free


def test_the_feed_forward_from_a_k_at_the_state_is_clipped_to_the_friction():
    model, task = Model.load("dc_motor"), Task(False, 0.02, 0.02, 12.0, 5.0)
    tables = DESIGNS["ak_state_clipped"].law(model, task, Tuning(Weights(15.0))).tables
    np.testing.assert_allclose(tables[-1, 1], 0.764 / 0.0805 * 0.033, rtol=1e-3)
    assert (tables[:, 1] <= tables[-1, 1] * (1 + 1e-3)).all()


def test_friction_free_keeps_delays_and_drops_forces():
    model = Model.load("dc_motor").with_effect("input_delay", T=0.01).with_effect("cogging_torque")
    assert set(friction_free(model).effects) == {"input_delay"}


def test_what_cannot_be_controlled_is_refused():
    with pytest.raises(InputError, match="imposed"):
        Drive.of(Model.load("force_element"))
    with pytest.raises(InputError, match=r"design: found 'lqg'; allowed: .*ak_reference"):
        find_design("lqg")
    with pytest.raises(InputError, match="bandwidth"):
        Weights(0.0)
