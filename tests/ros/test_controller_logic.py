"""The controller without ROS: it tracks, and stops for whatever is missing, stale or bad."""

from __future__ import annotations

import numpy as np
import pytest

from signlin_ros.control.controller import Controller, ControllerSettings
from signlin_ros.errors import InputError
from signlin_ros.linearization import Linearizer
from signlin_ros.model import Model
from signlin_ros.nodes.controller_logic import ControllerLogic
from signlin_ros.nodes.told import NANO, Refusal
from signlin_ros.simulation import Stepper

MODEL = Model.load("dc_motor")
PERIOD = 20_000_000
SETTINGS = ControllerSettings(limit=12.0, speed=5.0)


def message(model: Model, now: int) -> list[float]:
    """What a linearizer publishes."""
    r = Linearizer(model)(np.zeros(len(model.states)))
    return [*divmod(now, NANO), 0.0, 1.0, *r.B.shape, *r.A.ravel(), *r.B.ravel(), *r.c, *r.x, *r.u]


class Loop:
    """A plant and a controller in simulated time; ``drop`` names what no longer comes."""

    def __init__(self, logic: ControllerLogic, plant: Model = MODEL) -> None:
        self.logic, self.plant, self.now, self.u = logic, Stepper(plant), 10 * NANO, np.zeros(1)
        self.errors: list[float] = []
        self.sent: list[np.ndarray | None] = []

    def run(self, seconds: float, speed, drop: tuple[str, ...] = ()) -> None:
        for _ in range(round(seconds * NANO / PERIOD)):
            v = speed(self.now / NANO)
            if "reference" not in drop:
                ahead = speed(self.now / NANO + 1e-4)
                self.logic.take_reference(np.array([v, (ahead - v) / 1e-4]), self.now)
            if "state" not in drop:
                self.logic.take_state(self.plant.x, self.now)
            if "model" not in drop:
                self.logic.take_model(message(self.logic.model, self.now))
            got = self.logic.output(self.now)
            self.sent.append(got)
            self.errors.append(v - self.plant.x[MODEL.states.index("speed")])
            self.plant.advance(PERIOD / NANO, self.u)  # one period of delay
            self.u = np.zeros(1) if got is None else got
            self.now += PERIOD


def sine(t: float) -> float:
    return float(3.0 * np.sin(2 * np.pi * t / 4.0))


def test_it_tracks_and_friction_is_what_makes_the_difference():
    rms = {}
    for design in ("friction_free", "turning_integral"):
        loop = Loop(ControllerLogic(MODEL, ControllerSettings(limit=12.0, speed=5.0, design=design)))
        loop.run(8.0, sine)
        rms[design] = np.sqrt(np.mean(np.square(loop.errors[200:])))
    assert rms["turning_integral"] < 0.3 * rms["friction_free"]


@pytest.mark.parametrize("name", ["state", "reference", "model"])
def test_it_stops_within_two_periods_of_the_timeout_and_goes_on_when_all_is_well(name):
    logic = ControllerLogic(MODEL, SETTINGS)
    loop = Loop(logic)
    loop.run(2.0, sine)
    assert any(u is not None and u[0] != 0.0 for u in loop.sent)
    loop.run(3.0, sine, drop=(name,))
    timeout = {"state": 0.06, "reference": 0.5, "model": 0.6}[name]
    late = loop.sent[-150:][int(timeout * NANO / PERIOD) + 2 :]
    assert all(u is not None and u[0] == 0.0 for u in late)
    health = logic.health(loop.now)
    assert health.level == 2
    assert name in health.message
    loop.run(1.0, sine)
    assert logic.health(loop.now).message == "tracking"
    assert loop.sent[-1] is not None


def test_nothing_is_sent_before_the_first_run():
    logic = ControllerLogic(MODEL, SETTINGS)
    assert logic.output(0) is None
    logic.take_reference(np.array([1.0]), 0)
    logic.take_state(np.zeros(2), 0)
    assert logic.output(PERIOD) is None
    assert "model" in logic.health(PERIOD).message
    assert logic.health(PERIOD).level == 1


def test_bad_messages_are_refused_and_counted():
    logic = ControllerLogic(MODEL, SETTINGS)
    logic.take_reference(Refusal("length", "4 values"), 0)
    logic.take_state(Refusal("not_finite", "value 0"), 0)
    logic.take_model([0.0] * 3)
    logic.take_model([*message(MODEL, 0)[:-1], float("nan")])
    logic.take_model(message(Model.load("mass_spring_damper").with_effect("dahl_presliding"), 0))
    logic.take_measured({"position": 1.0}, -NANO, 0)
    logic.take_yaml("/**: {ros__parameters: {plant: rocket}}")
    assert set(logic.refused) == {
        *("reference_length", "not_finite", "model_not_finite", "another_model", "stale", "model_yaml"),
    }
    assert logic.model is MODEL
    assert "rocket" in logic.last_refusal.detail


def test_a_model_of_the_linearizer_changes_the_feed_forward_without_a_restart():
    """A controller that knows no friction tracks badly until it is told."""
    bare = MODEL.without_effect("coulomb_friction")
    loop = Loop(ControllerLogic(bare, SETTINGS))
    loop.run(6.0, sine)
    loop.logic.take_yaml(MODEL.to_yaml())
    loop.run(6.0, sine)
    before, after = np.array(loop.errors[100:300]), np.array(loop.errors[400:])
    assert np.std(after) < 0.4 * np.std(before)


def test_a_model_with_states_that_nobody_measures_is_taken():
    loop = Loop(ControllerLogic(MODEL, SETTINGS))
    loop.run(1.0, sine)
    more = MODEL.without_effect("coulomb_friction").with_effect("dahl_presliding", sigma=3.0, F_c=0.033)
    loop.logic.take_yaml(more.to_yaml())
    loop.run(3.0, sine)
    assert loop.logic.model.states == ("current", "speed", "dahl_presliding.z")
    assert loop.logic.health(loop.now).message == "tracking"
    assert np.std(loop.errors[100:]) < 0.3


@pytest.mark.parametrize(
    ("shown", "ignored"), [({}, ""), ({"velocity": 0.0}, ""), ({"velocity": 7.0}, "velocity"), ({"effort": 0.0}, "")]
)
def test_positions_without_speeds_and_without_rates_of_the_reference_suffice(shown, ignored):
    """Also where a driver fills in a velocity that is 0 throughout, or one to be ignored: it ran away."""
    settings = ControllerSettings(limit=12.0, speed=5.0, position=True)
    logic = ControllerLogic(MODEL, settings, needs_model=False, ignored=ignored)
    plant = Stepper(MODEL.with_options(with_position=True))
    u, errors, now = 0.0, [], NANO
    for _ in range(400):
        for part in range(4):  # states at 200 Hz
            stamp = now + part * PERIOD // 4
            if part:
                plant.advance(PERIOD / 4 / NANO, [u])
            logic.take_measured({"position": float(plant.x[2]), **shown}, stamp, stamp)
        at = now + 3 * PERIOD // 4
        r = 1.0 - np.cos(2 * np.pi * (at - NANO) / NANO / 4.0)
        logic.take_reference(np.array([r]), at)
        got = logic.output(at)
        errors.append(r - plant.x[2])
        u = 0.0 if got is None else float(got[0])
        plant.advance(PERIOD / 4 / NANO, [u])
        now += PERIOD
    assert np.sqrt(np.mean(np.square(errors[100:]))) < 0.02


def test_the_input_stays_within_the_limit_and_is_finite():
    logic = ControllerLogic(MODEL, ControllerSettings(limit=1.0, speed=5.0))
    rng = np.random.default_rng(3)
    for k in range(200):
        now = k * PERIOD
        logic.take_reference(rng.standard_normal(2) * 10 ** rng.uniform(-3, 6), now)
        logic.take_state(rng.standard_normal(2) * 10 ** rng.uniform(-3, 6), now)
        logic.take_model(message(MODEL, now))
        u = logic.output(now)
        assert u is not None
        assert np.isfinite(u).all()
        assert abs(u[0]) <= 1.0


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        (lambda: ControllerSettings(limit=0.0), "limit"),
        (lambda: ControllerSettings(limit=float("inf")), "limit"),
        (lambda: Controller(MODEL.with_options(with_load_torque=True), SETTINGS), "load_torque"),
        (lambda: Controller(Model.load("force_element"), SETTINGS), "imposed"),
        (lambda: Controller(MODEL, ControllerSettings(limit=1.0, design="lqg")), "lqg"),
    ],
)
def test_what_does_not_go_is_refused(settings, words):
    with pytest.raises(InputError, match=words):
        settings()
