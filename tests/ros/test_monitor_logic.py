"""The monitor's logic in simulated time: errors, changes, names, records; without ROS."""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from signlin_ros.errors import InputError, SignlinError
from signlin_ros.linearization import Linearizer
from signlin_ros.model import Model
from signlin_ros.nodes.diagnosing import Naming
from signlin_ros.nodes.monitor_logic import MonitorLogic, MonitorScore, MonitorSettings
from signlin_ros.nodes.told import ERROR, LEVEL_OK, NANO, WARN, Refusal, Update
from signlin_ros.observe.naming import Question

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))
from live_changes import CHANGES, NOISE, QUANTUM, STEP, Machine

sys.path.pop(0)

MOTOR = Model.load("dc_motor").with_options(with_position=True, update_period=0.1)
LEARN, AT = 20.0, 24.0


class Run:
    """A machine under the monitor, and a linearizer that is always right about the state."""

    def __init__(self, seed: int, model: Model = MOTOR) -> None:
        self.rig, self.logic = Machine(np.random.default_rng(seed)), MonitorLogic(MonitorSettings(learn=LEARN), 0)
        self.model, self.core, self.k = model, Linearizer(model), 0
        self.scores: list[MonitorScore] = []
        self.alarms: list[float] = []
        self.logic.configure(model, 0)

    def go(self, until: float) -> None:
        while self.k * STEP < until:
            now, x = round(self.k * STEP * NANO), self.rig.plant.x[: len(self.model.states)].copy()
            shown, u = self.rig.step(self.k * STEP)
            self.logic.take_input(np.array([u]), now)
            self.logic.take_shown({"position": shown}, now)
            if self.k % 20 == 0:
                self.logic.take_update(Update(now, self.k // 20, self.core(x, [u])))
                scores, alarm = self.logic.work(now)
                self.scores += scores
                self.alarms += [] if alarm is None else [alarm.t]
            self.k += 1


def answered(question: Question, apart: bool) -> list[dict[str, Any]]:
    """Return what a question is answered with, ``apart``: in a process of its own, as the node asks it."""
    if not apart:
        return [{**vars(one), "sentence": one.sentence} for one in question.answer()]
    naming = Naming(question)
    while naming.running:
        time.sleep(0.1)
    return naming.result()


@pytest.mark.parametrize("change", ["friction", "shift"])
def test_a_change_is_called_and_named(change: str) -> None:
    run = Run(3001 + list(CHANGES).index(change))
    run.go(AT)
    run.rig.change(change)
    run.go(AT + 22.0)
    assert run.alarms
    assert 0 <= run.alarms[0] - AT < 10.0
    assert run.logic.health(run.k * round(STEP * NANO)).level == ERROR
    question = run.logic.question(run.k * round(STEP * NANO))
    assert question is not None
    assert run.logic.question(round((AT + 1.0) * NANO)) is None
    (told,) = answered(question, apart=change == "shift")
    assert told["name"] == CHANGES[change]
    assert told["sentence"].startswith(told["name"])
    if change == "friction":
        assert told["value"] == pytest.approx(1.5, abs=0.2)
    elif told["value"] is not None:  # a shift of ten times the noise: its size is told where the moment shows it
        assert abs(told["value"]) == pytest.approx(10 * np.hypot(NOISE, QUANTUM / 12**0.5), rel=0.3)


def test_what_has_changed_is_not_asked_where_too_little_is_kept() -> None:
    run = Run(3001)
    run.logic = MonitorLogic(MonitorSettings(keep=5.0, learn=LEARN), 0)
    run.logic.configure(MOTOR, 0)
    run.go(AT)
    run.rig.change("friction")
    run.go(AT + 22.0)
    assert run.alarms
    with pytest.raises(InputError, match="nothing to record"):
        run.logic.question(run.k * round(STEP * NANO))


def test_a_first_word_that_fails_says_why() -> None:
    naming = Naming(None)  # type: ignore[arg-type]
    with pytest.raises(SignlinError, match="what has changed was not found"):
        naming.result()
    naming.stop()


def test_a_healthy_machine_is_left_alone_and_friction_in_the_model_pays() -> None:
    run = Run(3100)
    run.go(60.0)
    assert not run.alarms
    assert run.logic.health(round(60.0 * NANO)).level == LEVEL_OK
    speed = MOTOR.states.index("speed")
    errors = np.abs([(score.error[speed], score.bare[speed]) for score in run.scores])
    model, bare = np.median(errors, axis=0)
    assert model < bare / 4
    moving = [abs(run.rig.reference(score.stamp / NANO)[1]) > 1.0 for score in run.scores]
    settled = np.convolve(moving, np.ones(8))[: len(moving)] == 8  # a secant is far off where a standing machine starts
    model, bare = np.sqrt(np.mean(errors[settled] ** 2, axis=0))
    assert model < bare / 2


def test_a_machine_that_never_stops_is_predicted_well() -> None:
    run = Run(3100)
    start = float(run.rig.plant.x[2])
    run.rig.reference = lambda t: (start + 6.0 * t + 3.0 * (1.0 - np.cos(t)), 6.0 + 3.0 * np.sin(t))
    run.go(40.0)
    speed = MOTOR.states.index("speed")
    assert not run.alarms
    assert run.scores[-1].rms[speed] < run.scores[-1].rms_bare[speed] / 2
    assert run.scores[-1].fit[speed] > 90


def test_what_is_kept_becomes_a_record() -> None:
    run = Run(3200)
    with pytest.raises(InputError, match="nothing to record"):
        run.logic.record()
    run.go(3.0)
    record = run.logic.record()
    assert set(record.signals) == {"voltage", "position"}
    assert record.t.size == 600
    assert np.diff(record.t) == pytest.approx(STEP)


def test_bad_messages_change_nothing() -> None:
    logic = MonitorLogic(MonitorSettings(), 0)
    assert logic.health(0).level == WARN
    logic.configure(MOTOR, 0)
    logic.take_shown({"position": 1.0}, NANO)
    logic.take_shown({"position": 2.0}, NANO)
    logic.take_shown({"position": 2.0}, NANO // 2)
    logic.take_shown(Refusal("not_finite", ""), 0)
    logic.take_input(Refusal("length", ""), 0)
    assert logic.refused == {"repeated": 1, "out_of_order": 1, "not_finite": 1, "input_length": 1}


def test_a_jump_of_the_clock_starts_anew() -> None:
    run = Run(3300)
    run.go(2.0)
    run.logic.reset(0)
    with pytest.raises(InputError):
        run.logic.record()
