"""The linearizer's logic, without ROS."""

from __future__ import annotations

import math

import numpy as np
import pytest

from signlin_ros.errors import InputError
from signlin_ros.linearization import Linearizer
from signlin_ros.model import Model
from signlin_ros.nodes.joint import joint_values, measured_states
from signlin_ros.nodes.linearizer_logic import MOST_LATE, LinearizerLogic
from signlin_ros.nodes.told import ERROR, LEVEL_OK, NANO, WARN, Refusal

PERIOD = NANO // 5
X = np.array([0.4, 5.0])


@pytest.fixture(scope="module")
def motor() -> Model:
    return Model.load("dc_motor")


@pytest.fixture
def logic(motor: Model) -> LinearizerLogic:
    return LinearizerLogic(motor, now=0)


def test_nothing_before_the_first_state(logic: LinearizerLogic) -> None:
    assert logic.updates(10 * PERIOD) == []
    logic.take_state(X, 10 * PERIOD + 1)
    assert logic.updates(10 * PERIOD + 2) == []
    (update,) = logic.updates(11 * PERIOD)
    assert (update.sequence, update.stamp) == (0, 10 * PERIOD + 1)


@pytest.mark.parametrize("tick", [NANO // 1000, NANO // 200, 7 * NANO // 1000, PERIOD, 3 * PERIOD // 2])
def test_exactly_300_updates_in_60_s(logic: LinearizerLogic, tick: int) -> None:
    """However the clock ticks: no period is lost and none is doubled."""
    updates = []
    now = 0
    while now < 60 * NANO:
        logic.take_state(X, now)
        now = min(now + tick, 60 * NANO)
        updates += logic.updates(now)
    assert [update.sequence for update in updates] == list(range(300))


def test_each_update_is_the_core_s(logic: LinearizerLogic, motor: Model) -> None:
    reference = Linearizer(motor)
    rng = np.random.default_rng(1)
    for k in range(1, 50):
        x, u = rng.normal(0, 10, 2), rng.normal(0, 2, 1)
        logic.take_input(u, k * PERIOD - 5)
        logic.take_state(x, k * PERIOD - 5)
        (update,) = logic.updates(k * PERIOD)
        expected = reference(x, u)
        for name in ("A", "B", "c", "x", "u"):
            np.testing.assert_array_equal(getattr(update.result, name), getattr(expected, name))


def test_no_update_from_a_state_that_is_too_old(logic: LinearizerLogic) -> None:
    logic.take_state(X, 0)
    assert len([u for k in range(1, 20) for u in logic.updates(k * PERIOD)]) == 3
    assert logic.health(19 * PERIOD).level == ERROR
    assert logic.updates(20 * PERIOD) == []
    logic.take_state(X, 20 * PERIOD)
    logic.take_input(np.zeros(1), 20 * PERIOD)
    (update,) = logic.updates(21 * PERIOD)
    assert update.sequence == 3
    assert logic.health(21 * PERIOD).level == LEVEL_OK


def test_state_timeout_is_a_parameter(motor: Model) -> None:
    logic = LinearizerLogic(motor, 0, state_timeout=1.0)
    logic.take_state(X, 0)
    assert len([u for k in range(1, 20) for u in logic.updates(k * PERIOD)]) == 5


def test_a_jump_of_the_clock_is_not_made_up_for(logic: LinearizerLogic) -> None:
    logic.take_state(X, 0)
    logic.updates(PERIOD)
    logic.take_state(X, 5000 * PERIOD)
    assert len(logic.updates(5000 * PERIOD)) == MOST_LATE + 1


def test_stamps(logic: LinearizerLogic) -> None:
    good = {"current": 0.4, "speed": 5.0}
    logic.take_measured(good, stamp=10 * PERIOD, now=10 * PERIOD)
    assert logic.accepted == 1
    for stamp, kind in ((10, "repeated"), (9, "out_of_order"), (2, "stale"), (100, "future")):
        logic.take_measured(good, stamp=stamp * PERIOD, now=11 * PERIOD)
        assert logic.last_refusal is not None
        assert logic.last_refusal.kind == kind
    logic.take_measured(good, stamp=0, now=11 * PERIOD)
    assert "header.stamp" in logic.last_refusal.detail
    assert logic.accepted == 1
    assert logic.refused == {"repeated": 1, "out_of_order": 1, "stale": 2, "future": 1}


def test_missing_velocity_is_refused_and_a_missing_current_is_carried(logic: LinearizerLogic) -> None:
    logic.take_measured({"current": 0.4}, stamp=PERIOD, now=PERIOD)
    assert logic.last_refusal == Refusal("missing", "no speed in the message")
    logic.take_measured({"speed": 5.0}, stamp=PERIOD, now=PERIOD)
    (update,) = logic.updates(2 * PERIOD)
    assert update.result.x[1] == pytest.approx(5.0)
    assert np.isfinite(update.result.A).all()


def test_time_that_jumps_back_starts_anew(logic: LinearizerLogic) -> None:
    logic.take_state(X, 100 * PERIOD)
    assert len(logic.updates(101 * PERIOD)) == 1
    logic.reset(5 * PERIOD)
    assert logic.updates(6 * PERIOD) == []
    logic.take_measured({"current": 0.0, "speed": 1.0}, stamp=6 * PERIOD + 1, now=6 * PERIOD + 1)
    (update,) = logic.updates(7 * PERIOD)
    assert update.sequence == 1


@pytest.mark.parametrize("value", [1e308, -1e308, 5e-324, 1e-300, 0.0])
def test_extreme_values_never_give_anything_that_is_not_finite(logic: LinearizerLogic, value: float) -> None:
    logic.take_state(np.array([value, value]), 0)
    for update in logic.updates(PERIOD):
        assert np.isfinite(np.concatenate([np.ravel(part) for part in update.result[:6]])).all()
    logic.take_state(X, PERIOD)
    assert len(logic.updates(2 * PERIOD)) == 1


def test_another_model_at_run_time(logic: LinearizerLogic, motor: Model) -> None:
    logic.take_state(X, 0)
    (before,) = logic.updates(PERIOD)
    logic.configure(motor.with_parameters({"coulomb_friction.mu": 0.0}))
    (after,) = logic.updates(2 * PERIOD)
    assert before.result.A[1, 1] < after.result.A[1, 1] == 0.0
    with pytest.raises(InputError):
        logic.configure(motor.with_parameters({"coulomb_friction.mu": -1.0}))
    with pytest.raises(InputError, match="update_period"):
        logic.configure(motor.with_options(update_period=1e-10))
    assert len(logic.updates(3 * PERIOD)) == 1


def test_health_tells_what_was_refused_and_why(logic: LinearizerLogic) -> None:
    assert logic.health(PERIOD).level == WARN
    assert logic.health(4 * PERIOD).level == ERROR
    logic.take_state(Refusal("length", "3 values, not 2"), PERIOD)
    logic.take_input(Refusal("layout", "sizes [2]"), 0)
    logic.take_state(np.array([0.0, 25.0]), 4 * PERIOD)
    logic.updates(5 * PERIOD)
    health = logic.health(5 * PERIOD)
    assert health.level == WARN
    assert "valid range" in health.message
    assert health.values["refused: length"] == health.values["refused: input_layout"] == "1"
    assert health.values["in_valid_range"] == "false"
    assert float(health.values["state age [s]"]) == pytest.approx(0.2)
    assert float(health.values["latency from state to model [s]"]) == pytest.approx(0.2)


def test_rate(logic: LinearizerLogic) -> None:
    for k in range(1, 30):
        logic.take_state(X, k * PERIOD - 1)
        logic.updates(k * PERIOD)
    assert logic.rate(29 * PERIOD) == pytest.approx(5.0)
    assert logic.rate(40 * PERIOD) == 0.0


def test_what_the_sensors_add_is_taken_off_before_linearizing(motor: Model) -> None:
    """The states that come are measurements; x_k is the true state."""
    model = motor.with_effect("sensor_offset", speed=0.5).with_effect("sensor_gain", current=2.0)
    logic = LinearizerLogic(model, 0)
    logic.take_state(np.array([0.8, 5.5]), 1)
    (whole,) = logic.updates(PERIOD)
    logic.take_measured({"current": 0.8, "speed": 5.5}, stamp=PERIOD + 1, now=PERIOD + 1)
    (named,) = logic.updates(2 * PERIOD)
    expected = Linearizer(motor)(X)
    for update in (whole, named):
        np.testing.assert_array_equal(update.result.x, X)
        np.testing.assert_array_equal(update.result.A, expected.A)


def test_carried_states_follow_the_true_measured_ones(motor: Model) -> None:
    offset = motor.with_effect("sensor_offset", speed=3.0)
    carried = []
    for model, added in ((motor, 0.0), (offset, 3.0)):
        logic = LinearizerLogic(model, 0)
        for k in range(1, 20):
            logic.take_measured({"speed": 0.5 * k + added}, stamp=k * NANO // 100, now=k * NANO // 100)
        (update,) = logic.updates(PERIOD)
        carried.append(update.result.x)
    np.testing.assert_allclose(carried[1], carried[0], rtol=1e-12)


def test_a_sensor_changed_at_run_time_counts_from_the_next_state(motor: Model) -> None:
    model = motor.with_effect("sensor_offset", speed=0.0)
    logic = LinearizerLogic(model, 0)
    logic.configure(model.with_parameters({"sensor_offset.speed": 1.0}))
    logic.take_state(X, 1)
    (update,) = logic.updates(PERIOD)
    assert update.result.x[1] == X[1] - 1.0


def test_a_measurement_beyond_all_numbers_is_refused(motor: Model) -> None:
    logic = LinearizerLogic(motor.with_effect("sensor_gain", speed=0.1), 0)
    logic.take_state(np.array([0.0, 1e308]), 1)
    assert logic.updates(PERIOD) == []
    assert logic.refused == {"no_result": 1}


@pytest.mark.parametrize(("observer", "why"), [("none", "no finite"), ("kalman", "the observer's state ran away")])
def test_states_without_a_finite_model_are_an_error(motor: Model, observer: str, why: str) -> None:
    logic = LinearizerLogic(motor, 0, observer=observer)
    huge = {"effort": 1e308, "velocity": 1.0}  # a current that no number holds
    for k in range(1, 4):
        logic.take_measured(measured_states(motor, huge), stamp=k * PERIOD, now=k * PERIOD)
        assert logic.updates(k * PERIOD) == []
    logic.take_measured(measured_states(motor, huge), stamp=3 * PERIOD + 1, now=3 * PERIOD + 1)
    health = logic.health(3 * PERIOD + 1)
    assert health.level == ERROR
    assert f"no model: {why}" in health.message
    logic.take_state(X, 4 * PERIOD - 1)
    logic.take_input(np.zeros(1), 4 * PERIOD - 1)
    assert len(logic.updates(4 * PERIOD)) == 1
    assert logic.health(4 * PERIOD).level == LEVEL_OK


def test_joint_and_states_are_inverse(motor: Model) -> None:
    joint = joint_values(motor, {"current": 2.0, "speed": 3.0}, np.array([1.0]))
    assert joint == {"velocity": 3.0, "effort": pytest.approx(0.161)}
    assert measured_states(motor, {**joint, "position": 7.0}) == {"current": pytest.approx(2.0), "speed": 3.0}
    mass = Model.load("mass_spring_damper")
    joint = joint_values(mass, {"displacement": 1.0, "velocity": 2.0}, np.array([3.0]))
    assert joint == {"position": 1.0, "velocity": 2.0, "effort": 3.0}
    assert measured_states(mass, {**joint, "effort": math.pi}) == {"displacement": 1.0, "velocity": 2.0}
