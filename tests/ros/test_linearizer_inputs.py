"""What the linearizer does without an input, with noisy states and with channels that nobody measures, without ROS."""

from __future__ import annotations

import numpy as np
import pytest

from signlin_ros.errors import InputError
from signlin_ros.linearization import Linearizer
from signlin_ros.model import Model
from signlin_ros.nodes.channels import LEAST_MOTION, Channels
from signlin_ros.nodes.joint import effort_input
from signlin_ros.nodes.linearizer_logic import LinearizerLogic
from signlin_ros.nodes.told import LEVEL_OK, NANO, WARN, Update
from signlin_ros.simulation import Stepper

MIDPOINT = Model.load("dc_motor").with_options(operating_point="midpoint")
PERIOD = NANO // 5
SPEED = 1
X, U = np.array([0.41, 1.2]), np.array([0.41])  # where it goes on at 1.2 rad/s; without the input it would stand still


def one(logic: LinearizerLogic, k: int) -> Update:
    (update,) = logic.updates(k * PERIOD)
    return update


# ------------------------------------------------------------------ no input


def test_without_an_input_no_midpoint_is_predicted_and_that_is_said() -> None:
    logic = LinearizerLogic(MIDPOINT, 0)
    logic.take_state(X, PERIOD - 1)
    result = one(logic, 1).result
    at_state = Linearizer(MIDPOINT.with_options(operating_point="start"))(X, np.zeros(1))
    np.testing.assert_array_equal(result.A, at_state.A)
    np.testing.assert_array_equal(result.x, X)
    assert Linearizer(MIDPOINT)(X, np.zeros(1)).A[SPEED, SPEED] < 5 * result.A[SPEED, SPEED]  # what came before
    health = logic.health(PERIOD)
    assert health.level == WARN
    assert "no input has come" in health.message
    assert health.values["operating point"] == "start: no input has come"


def test_with_an_input_the_midpoint_is_predicted_until_the_input_is_too_old() -> None:
    logic = LinearizerLogic(MIDPOINT, 0)
    logic.take_input(U, PERIOD - 1)
    for k in range(1, 6):
        logic.take_state(X, k * PERIOD - 1)
        result, health = one(logic, k).result, logic.health(k * PERIOD)
        fresh = k <= 3
        model = MIDPOINT.with_options(operating_point="midpoint" if fresh else "start")
        np.testing.assert_array_equal(result.A, Linearizer(model)(X, U).A)
        assert health.level == (LEVEL_OK if fresh else WARN)
    assert "the last input is 0.8 s old" in health.message
    logic.take_input(U, 6 * PERIOD - 1)
    logic.take_state(X, 6 * PERIOD - 1)
    assert one(logic, 6).result.x[SPEED] != X[SPEED]
    assert logic.health(6 * PERIOD).level == LEVEL_OK


def test_an_input_that_is_held_may_be_as_old_as_a_parameter_says() -> None:
    logic = LinearizerLogic(MIDPOINT, 0, input_timeout=1e6)
    logic.take_input(U, 0)
    logic.take_state(X, 1000 * PERIOD - 1)
    assert one(logic, 1000).result.x[SPEED] != X[SPEED]
    assert logic.health(1000 * PERIOD).level == LEVEL_OK


def test_after_a_jump_of_the_clock_the_input_is_not_known() -> None:
    logic = LinearizerLogic(MIDPOINT, 0)
    logic.take_input(U, 100 * PERIOD)
    logic.reset(PERIOD)
    assert logic.unknown_input(PERIOD) == "no input has come"


def test_the_effort_of_a_mass_is_its_input_and_that_of_a_motor_is_not() -> None:
    mass = Model.load("mass_spring_damper")
    assert effort_input(mass, {"position": 0.1, "effort": 2.0}) == 2.0
    assert effort_input(mass, {"position": 0.1}) is None
    assert effort_input(MIDPOINT, {"position": 0.1, "effort": 2.0}) is None


# ------------------------------------------------------------------ noise


def errors(noisy: dict[str, float], seed: int, observer: str = "kalman") -> tuple[float, float]:
    """Return how wrong A[speed, speed] is (relative, 90th percentile) and the RMS error of the speed in x_k.

    Of a motor that turns to and fro slowly, with a 14-bit encoder, and what else is measured with its noise.
    """
    random, step, rate = np.random.default_rng(seed), 0.005, 200
    model = MIDPOINT.with_options(with_position=True, update_period=0.05)
    plant, logic = Stepper(model, model.x0.copy()), LinearizerLogic(model, 0, observer=observer)
    exact, quantum, i = Linearizer(model), 2 * np.pi / 2**14, model.states.index("speed")
    of_A, of_x = [], []
    for k in range(12 * rate):
        now, u = round(k * step * NANO), np.array([0.45 * np.sin(np.pi * k * step / 2)])
        x = dict(zip(model.states, plant.x.tolist(), strict=True))
        logic.take_input(u, now)
        shown = {"position": float(np.round(x["position"] / quantum) * quantum), "current": x["current"]}
        shown |= {name: x[name] + sigma * random.standard_normal() for name, sigma in noisy.items()}
        logic.take_measured({name: shown[name] for name in ("position", *noisy)}, now, now)
        good = exact(plant.x, u)
        for update in logic.updates(now) if k * step > 3 else ():
            of_A.append(abs(update.result.A[i, i] / good.A[i, i] - 1))
            of_x.append(update.result.x[i] - good.x[i])
        plant.advance(step, u)
    return float(np.percentile(of_A, 90)), float(np.sqrt(np.mean(np.square(of_x))))


@pytest.mark.parametrize("noisy", [{"speed": 0.02}, {"speed": 0.02, "current": 0.01}, {"speed": 0.5}])
@pytest.mark.parametrize("seed", [1, 2])
def test_a_noisy_velocity_makes_no_model_worse_than_the_position_alone(noisy: dict[str, float], seed: int) -> None:
    assert np.all(np.array(errors(noisy, seed)) < 1.05 * np.array(errors({}, seed)))


def test_without_an_observer_the_noise_is_in_the_model() -> None:
    everything = {"speed": 0.02, "current": 0.01}
    assert np.all(np.array(errors(everything, 1, "none")) > 1.4 * np.array(errors(everything, 1)))


# ------------------------------------------------------------------ channels that nobody measures


def test_a_velocity_that_is_zero_while_the_position_moves_is_left_out_and_that_is_said() -> None:
    channels = Channels(MIDPOINT.with_options(with_position=True))
    for k in range(LEAST_MOTION):
        assert channels.told({"position": 0.01 * k, "speed": 0.0, "current": 0.1}).keys() == {
            "position",
            "speed",
            "current",
        }
    assert channels.told({"position": 1.0, "speed": 0.0, "current": 0.1}).keys() == {"position", "current"}
    assert channels.dead == ("speed",)
    assert "speed 0 throughout" in channels.sentence
    assert "speed" in channels.told({"position": 1.0, "speed": 0.3, "current": 0.1})
    assert channels.sentence == ""


def test_what_stands_still_is_not_dead() -> None:
    channels = Channels(MIDPOINT.with_options(with_position=True))
    for k in range(10 * LEAST_MOTION):
        assert len(channels.told({"position": 0.0, "speed": 0.0, "current": 0.01 * k})) == 3
    assert channels.dead == ()


@pytest.mark.parametrize("name", ["effort", "current"])
def test_a_channel_is_left_out_by_an_option_under_either_name(name: str) -> None:
    channels = Channels(MIDPOINT, f" {name} ")
    assert channels.told({"speed": 1.0, "current": 0.2}) == {"speed": 1.0}
    assert channels.sentence == "current left out, as asked"


def test_an_unknown_channel_is_refused_with_the_choices() -> None:
    with pytest.raises(InputError, match=r"'efort' is no channel; there are: .*effort.*did you mean 'effort'"):
        Channels(MIDPOINT, "efort")


@pytest.mark.parametrize("whole", [True, False])
def test_a_model_does_not_take_a_dead_current_for_none(whole: bool) -> None:
    """Of an array of all states, and of a joint: x_k has the current that the model knows, not the 0 that comes."""
    model = MIDPOINT.with_options(operating_point="start", update_period=0.05)
    logic, plant, step = LinearizerLogic(model, 0), Stepper(model, model.x0.copy()), 0.005
    updates = []
    for k in range(400):
        now = round(k * step * NANO)
        logic.take_input(np.array([2.0]), now)
        if whole:
            logic.take_state(np.array([0.0, plant.x[SPEED]]), now)
        else:
            logic.take_measured({"current": 0.0, "speed": float(plant.x[SPEED])}, now, now)
        updates += logic.updates(now)
        plant.advance(step, [2.0])
    assert updates[-1].result.x[0] == pytest.approx(plant.x[0], rel=0.05)
    health = logic.health(now)
    assert health.level == WARN
    assert "current 0 throughout" in health.message
