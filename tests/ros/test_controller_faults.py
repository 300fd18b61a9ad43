"""Faults of the loop, in simulated time: whatever comes late, in heaps, wrong or not at all, no drive runs away.

A plant of another make than the controller's model, with what is between: states that are delayed, queued or come in
bursts, an executor that is starved, an input that is dead, of the wrong sign or late. No ROS and no clock in it.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import pytest

from signlin_ros.control.controller import ControllerSettings
from signlin_ros.model import Model
from signlin_ros.nodes.controller_logic import ControllerLogic
from signlin_ros.nodes.told import ERROR, LEVEL_OK, NANO, WARN, Refusal
from signlin_ros.simulation import Stepper

MODEL = Model.load("dc_motor")
PERIOD = 20_000_000
PARTS = 4
"""States within a period: 200 Hz."""
LIMIT = 12.0


def settings(**more) -> ControllerSettings:
    return ControllerSettings(limit=LIMIT, speed=5.0, **more)


def sine(t: float) -> tuple[float, float]:
    return 2.0 * np.sin(2.0 * t), 4.0 * np.cos(2.0 * t)


def constant(_: float) -> tuple[float, float]:
    return 2.0, 0.0


@dataclass
class World:
    """A plant, a controller, and what is between them.

    Every state passes ``deliver``, which returns what arrives now, each with the time at which it was sent if that is
    told; ``act`` gives what the plant gets of an input; ``awake`` says whether the controller's turn comes.
    """

    logic: ControllerLogic
    plant: Model = MODEL
    reference: Callable[[float], tuple[float, float]] = sine
    deliver: Callable[[World, np.ndarray], list[tuple[np.ndarray, int]]] = lambda w, x: [(x, w.now)]
    act: Callable[[float], float] = float
    awake: Callable[[World], bool] = lambda _: True
    late: int = 0
    """Parts of a period after which an input acts."""
    now: int = 10 * NANO
    u: float = 0.0
    speeds: list[float] = field(default_factory=list)
    inputs: list[float] = field(default_factory=list)
    levels: list[int] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.machine = Stepper(self.plant)
        self.coming: deque[float] = deque([0.0] * self.late)
        self.broken = False
        self.seen = 0.0

    @property
    def measured(self) -> np.ndarray:
        return self.machine.x[: len(self.logic.measured)]

    def run(self, seconds: float) -> World:
        for _ in range(round(seconds * NANO / PERIOD)):
            self.period()
        return self

    def period(self) -> None:
        for _ in range(PARTS):
            self.coming.append(self.u)
            self.machine.advance(PERIOD / PARTS / NANO, [self.act(self.coming.popleft())])
            self.now += PERIOD // PARTS
            for x, sent in [] if self.broken else self.deliver(self, self.measured.copy()):
                self.logic.take_state(x, sent)
                self.seen = float(x[MODEL.states.index("speed")])
            if self.broken:
                self.logic.take_state(Refusal("not_finite", "value 0"), self.now)
        t = (self.now - 10 * NANO) / NANO
        self.logic.take_reference(np.array(self.reference(t)), self.now)
        if self.awake(self):
            got = self.logic.output(self.now)
            self.u = 0.0 if got is None else float(got[0])
            self.levels.append(self.logic.health(self.now).level)
        self.speeds.append(self.seen)
        self.inputs.append(self.u)

    @property
    def message(self) -> str:
        return self.logic.health(self.now).message

    def largest_while_driven(self, wait: int = 0) -> float:
        """The largest speed seen in periods in which there is an input, ``wait`` periods after it was first seen."""
        beyond = np.abs(self.speeds) > 1.5 * 2.0
        driven = np.array(self.inputs) != 0.0
        for k in np.flatnonzero(beyond):
            if k + 2 + wait < len(driven) and driven[k + 1 + wait] and beyond[k + 1 : k + 2 + wait].all():
                return float(np.abs(self.speeds[k + 1 + wait]))
        return 0.0


def logic(model: Model = MODEL, **more) -> ControllerLogic:
    return ControllerLogic(model, settings(**more), needs_model=False)


def other_motor() -> Model:
    """A motor that is not the model's: more inertia, Stribeck friction, a weight."""
    motor = Model.load("dc_motor").without_effect("coulomb_friction").with_options(with_position=True)
    motor = motor.with_effect("stribeck_friction", mu=0.03, excess=0.015, v_s=0.3)
    motor = motor.with_effect("gravity_load", A=0.02)
    return motor.with_parameters(J=1.3 * motor.parameters["J"])


# --------------------------------------------------------------------------- nothing is wrong


@pytest.mark.parametrize("plant", [MODEL, other_motor()], ids=["as modelled", "another one"])
@pytest.mark.parametrize("reference", [sine, constant])
@pytest.mark.parametrize("noise", [0.0, 0.05])
def test_where_nothing_is_wrong_nothing_stops(plant, reference, noise):
    random = np.random.default_rng(1)

    def noisy(world: World, x: np.ndarray) -> list[tuple[np.ndarray, int]]:
        return [(x + noise * random.standard_normal(x.size), world.now)]

    world = World(logic(), plant=plant, reference=reference, deliver=noisy).run(8.0)
    assert ERROR not in world.levels
    assert world.logic.stops == 0
    assert max(np.abs(world.speeds)) < 1.5 * 2.0


def test_the_model_itself_is_tracked_at_level_0():
    world = World(logic()).run(10.0)
    assert set(world.levels[100:]) == {LEVEL_OK}


def test_friction_that_the_model_does_not_know_is_told():
    bare = MODEL.without_effect("coulomb_friction")
    world = World(logic(bare), plant=bare.with_effect("coulomb_friction", mu=0.06))
    world.run(10.0)
    assert ERROR not in world.levels
    assert WARN in world.levels
    told = [world.message for _ in range(200) if world.period() is None and world.levels[-1] == WARN]
    assert any("tracks worse than simulation foretells: RMS error" in words for words in told)


# --------------------------------------------------------------------------- states


def queued(depth: int, every: int) -> Callable[[World, np.ndarray], list[tuple[np.ndarray, int]]]:
    """A queue from which one state is taken for every ``every`` that come, the oldest first, and no time is told."""
    waiting: deque[np.ndarray] = deque(maxlen=depth)
    count = 0

    def deliver(world: World, x: np.ndarray) -> list[tuple[np.ndarray, int]]:
        nonlocal count
        waiting.append(x)
        count += 1
        return [(waiting.popleft(), world.now)] if count % every == 0 else []

    return deliver


def delayed(seconds: float, told: bool) -> Callable[[World, np.ndarray], list[tuple[np.ndarray, int]]]:
    coming: deque[tuple[int, np.ndarray]] = deque()

    def deliver(world: World, x: np.ndarray) -> list[tuple[np.ndarray, int]]:
        coming.append((world.now, x))
        found = []
        while coming and world.now - coming[0][0] >= seconds * NANO:
            sent, value = coming.popleft()
            found.append((value, sent if told else world.now))
        return found

    return deliver


@pytest.mark.parametrize("seconds", [0.05, 0.1, 0.2, 0.5])
@pytest.mark.parametrize("reference", [sine, constant])
def test_states_that_are_delayed_and_do_not_say_so_do_not_run_the_drive_away(seconds, reference):
    world = World(logic(), reference=reference, deliver=delayed(seconds, told=False)).run(8.0)
    assert world.largest_while_driven() == 0.0


def test_states_that_are_queued_do_not_run_the_drive_away():
    world = World(logic(), reference=constant, deliver=queued(50, every=2)).run(12.0)
    assert world.largest_while_driven() == 0.0
    assert world.logic.fault
    assert world.levels[-1] == ERROR
    assert world.inputs[-1] == 0.0


@pytest.mark.parametrize("seconds", [0.1, 0.5])
def test_states_that_say_how_old_they_are_count_as_none(seconds):
    world = World(logic(), deliver=delayed(seconds, told=True)).run(3.0)
    assert not world.logic.active
    assert "the state is" in world.message


@pytest.mark.parametrize("seconds", [0.04, 0.055])
@pytest.mark.parametrize("reference", [sine, constant])
def test_states_that_say_how_old_they_are_are_brought_up_to_the_delay_of_the_design(seconds, reference):
    heavier = MODEL.with_parameters(J=1.3 * MODEL.parameters["J"])
    world = World(logic(), plant=heavier, reference=reference, deliver=delayed(seconds, told=True)).run(10.0)
    assert world.logic.fault == ""
    assert max(np.abs(world.speeds)) < 1.5 * 2.0
    errors = np.array([reference(0.02 * k + 0.02 - seconds)[0] - v for k, v in enumerate(world.speeds)])
    assert np.sqrt(np.mean(errors[200:] ** 2)) < 0.1 * 2.0
    assert "older than the 0.02 s that the loop is made for" in world.message


@pytest.mark.parametrize("parts", [12, 20, 40])
def test_states_in_bursts_do_not_run_the_drive_away(parts):
    waiting: list[np.ndarray] = []

    def bursts(world: World, x: np.ndarray) -> list[tuple[np.ndarray, int]]:
        waiting.append(x)
        if len(waiting) < parts:
            return []
        found = [(one, world.now) for one in waiting]
        waiting.clear()
        return found

    world = World(logic(), reference=constant, deliver=bursts).run(10.0)
    assert max(np.abs(world.speeds)) < 1.5 * 2.0


def test_states_that_come_out_of_order_are_refused():
    def reversed_pairs(world: World, x: np.ndarray) -> list[tuple[np.ndarray, int]]:
        return [(x, world.now), (x + 100.0, world.now - PERIOD)]

    world = World(logic(), deliver=reversed_pairs).run(2.0)
    assert world.logic.refused["out_of_order"] > 100
    assert world.logic.fault == ""


# --------------------------------------------------------------------------- the executor


def test_a_starved_executor_begins_anew_from_where_the_drive_is():
    random = np.random.default_rng(5)
    until = 0

    def seldom(world: World) -> bool:
        nonlocal until
        if world.now >= until and random.random() < 0.1:
            until = world.now + int(random.uniform(0.05, 0.4) * NANO)
        return world.now >= until

    world = World(logic(), reference=constant, awake=seldom).run(30.0)
    assert world.logic.times.late > 25
    assert world.logic.stops > 10
    assert "this node was held up" in world.logic.last_stop
    assert max(np.abs(world.speeds)) < 1.5 * 2.0
    assert ERROR not in world.levels
    assert any("inputs are late" in text for text in _messages(world, 100))


def test_a_drive_that_got_too_fast_while_the_node_was_held_up_is_stopped_and_begins_again():
    world = World(logic(), reference=constant).run(3.0)
    world.awake = lambda _: False
    world.run(0.04)
    world.machine = Stepper(MODEL, [0.0, 9.0])
    world.awake = lambda _: True
    world.run(0.06)
    assert world.logic.fault == ""
    assert "runs away" in world.logic.last_stop
    assert "after this node or its states were held up" in world.logic.last_stop
    assert world.levels[-1] == ERROR
    assert world.inputs[-1] == 0.0
    world.run(5.0)
    assert world.speeds[-1] == pytest.approx(2.0, abs=0.05)
    assert world.levels[-1] == LEVEL_OK


@pytest.mark.parametrize("before", [0.1, 0.3, 0.6, 3.0], ids=lambda s: f"{s:g} s after the start")
@pytest.mark.parametrize("stall", [0, 3, 10], ids=lambda n: f"held up for {n} periods")
@pytest.mark.parametrize("speed", [3.01, 6.0, -3.5])
def test_beyond_the_reference_by_half_there_is_an_error_and_no_input_within_two_periods(before, stall, speed):
    world = World(logic(), reference=constant)
    while not world.logic.active:
        world.period()
    world.run(before)
    world.awake = lambda _: False
    world.run(stall * PERIOD / NANO)
    world.awake = lambda _: True
    world.deliver = lambda w, _: [(np.array([0.0, speed]), w.now)]
    world.run(2 * PERIOD / NANO)
    assert world.inputs[-1] == 0.0
    assert world.levels[-1] == ERROR


def _messages(world: World, periods: int) -> list[str]:
    found = []
    for _ in range(periods):
        world.period()
        found.append(world.message)
    return found


# --------------------------------------------------------------------------- the loop


def test_an_input_that_acts_later_than_designed_is_a_fault_before_the_drive_runs_away():
    world = World(logic(), reference=constant, late=24).run(8.0)  # six periods
    assert world.logic.fault
    assert world.largest_while_driven() == 0.0
    assert world.levels[-1] == ERROR
    assert set(world.inputs[-100:]) == {0.0}


@pytest.mark.parametrize(
    ("act", "words"), [(lambda u: -u, ""), (lambda _: 0.0, "does not follow"), (lambda u: 20.0 * u, "")]
)
@pytest.mark.parametrize("reference", [sine, constant])
def test_an_input_that_is_dead_or_of_another_sign_or_size_stops_the_drive_and_is_told(act, words, reference):
    world = World(logic(), reference=reference, act=act).run(12.0)
    assert world.logic.fault
    assert words in world.message
    assert world.levels[-1] == ERROR
    assert world.largest_while_driven() == 0.0
    assert set(world.inputs[-100:]) == {0.0}


def test_after_a_fault_it_goes_on_only_when_it_is_asked_to():
    turned = [-1.0]
    world = World(logic(), reference=constant, act=lambda u: turned[0] * u).run(5.0)
    assert world.logic.fault
    turned[0] = 1.0  # mended
    world.run(5.0)
    assert set(world.inputs[-200:]) == {0.0}
    assert "it goes on when it is asked to (~/resume)" in world.message
    was = world.logic.resume()
    assert "runs away" in was
    world.run(5.0)
    assert world.levels[-1] == LEVEL_OK
    assert world.speeds[-1] == pytest.approx(2.0, abs=0.01)
    assert world.logic.resume() == ""


# --------------------------------------------------------------------------- restart


def test_a_drive_that_is_ahead_on_the_way_to_its_reference_does_not_run_away():
    """It may be as fast as half above what was sent, though the way there has only begun."""
    world = World(logic(), reference=constant)
    while not world.logic.active:
        world.period()
    world.machine = Stepper(MODEL, [0.0, 2.6])
    world.run(5.0)
    assert world.logic.fault == ""
    assert world.levels[-1] == LEVEL_OK


def test_after_nan_for_a_while_a_speed_is_approached_gently():
    world = World(logic(), reference=sine).run(5.0)
    world.broken = True
    world.run(1.5)
    assert set(world.inputs[-20:]) == {0.0}
    world.broken = False
    begun = len(world.inputs)
    world.run(3.0)
    needed = 0.0805 * 2.0 + 0.32 + 0.021 * 4.0  # back EMF, friction, acceleration of the reference
    assert max(np.abs(world.inputs[begun:])) < 1.5 * needed
    assert max(np.abs(world.speeds[begun:])) < 1.5 * 2.0
    assert world.levels[-1] == LEVEL_OK
    assert "not_finite" in world.logic.refused


def test_a_drive_that_is_too_fast_is_not_driven_before_it_has_slowed_down():
    world = World(logic(), reference=constant)
    world.machine = Stepper(MODEL, [0.0, 10.0])
    world.run(0.1)
    assert world.speeds[-1] > 1.5 * 2.0
    assert not world.logic.active
    assert "the drive is faster than its reference" in world.message
    world.run(5.0)
    assert world.largest_while_driven() == 0.0
    assert world.levels[-1] == LEVEL_OK


def swing(t: float) -> tuple[float, float, float]:
    return 1.57 * np.sin(t), 1.57 * np.cos(t), -1.57 * np.sin(t)


def test_after_nan_for_a_while_a_position_is_approached_gently():
    """The reference has gone on by more than a radian meanwhile."""
    plant = MODEL.with_options(with_position=True)
    controlled = ControllerLogic(plant, settings(position=True), needs_model=False)
    world = World(controlled, plant=plant, reference=swing).run(5.0)
    world.broken = True
    world.run(1.5)
    world.broken = False
    begun = len(world.inputs)
    world.run(6.0)
    assert max(np.abs(world.inputs[begun:])) < 0.25 * LIMIT
    assert max(np.abs(world.speeds[begun:])) < 5.0  # 13.4 rad/s at full limit before
    assert world.levels[-1] == LEVEL_OK
    t = (world.now - 10 * NANO) / NANO
    assert world.machine.x[2] == pytest.approx(swing(t)[0], abs=0.02)


def test_a_reference_that_jumps_is_approached():
    plant = MODEL.with_options(with_position=True)
    controlled = ControllerLogic(plant, settings(position=True), needs_model=False)
    world = World(controlled, plant=plant, reference=lambda t: (0.0,) if t < 2.0 else (10.0,)).run(12.0)
    assert ERROR not in world.levels[5:]
    assert max(np.abs(world.speeds)) < 0.6 * 5.0
    assert world.machine.x[2] == pytest.approx(10.0, abs=0.01)


def test_the_integral_action_is_gone_after_a_stop():
    loaded = MODEL.with_effect("constant_load", F0=-0.04)
    world = World(logic(), plant=loaded, reference=lambda _: (0.0, 0.0)).run(5.0)
    assert abs(world.inputs[-1]) > 0.03  # what holds the load that the model does not know
    world.broken = True
    world.run(0.2)
    world.machine = Stepper(MODEL)  # the load is taken away, and the drive held
    world.broken = False
    world.run(0.1)
    assert max(np.abs(world.inputs[-4:])) < 0.02


def test_after_a_loss_it_can_be_told_to_wait():
    controlled = ControllerLogic(MODEL, settings(), needs_model=False, asks=True)
    world = World(controlled, reference=constant).run(3.0)
    world.broken = True
    world.run(1.0)
    world.broken = False
    world.run(3.0)
    assert set(world.inputs[-100:]) == {0.0}
    assert "the state is" in world.logic.resume()
    world.run(3.0)
    assert world.levels[-1] == LEVEL_OK
