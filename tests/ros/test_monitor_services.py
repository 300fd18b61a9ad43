"""What the monitor's services do, without a graph of ROS: apply and revert; a diagnosis tells, and is cancelled."""

from __future__ import annotations

import asyncio
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import psutil
import pytest

pytest.importorskip("rclpy", reason="ROS 2 is not installed: pip install 'signlin_ros[ros]'")

from signlin_ros.model import Model
from signlin_ros.nodes import diagnoses
from signlin_ros.nodes.diagnosing import DiagnosisProcess
from signlin_ros.nodes.exchange import ModelExchange
from signlin_ros.nodes.monitor_logic import MonitorLogic, MonitorSettings
from signlin_ros.nodes.sources import STATE_OPTIONS, StateReader
from signlin_ros.nodes.told import LEVEL_OK, NANO, WARN, Update
from signlin_ros.records import Record, Signal
from signlin_ros.simulation import simulate

MOTOR = Model.load("dc_motor").with_options(with_position=True, update_period=0.1)
PATIENCE = 120.0


# ------------------------------------------------------------------ apply and revert


class Linearizer:
    """A node that makes clients; they ask this one for its parameter ``model_file``."""

    def __init__(self, file: str = "", there: bool = True) -> None:
        self.file, self.there, self.given = file, there, list[str]()

    def create_client(self, kind: Any, name: str, callback_group: Any) -> Any:
        call = self._set if name.endswith("set_parameters") else self._get
        return SimpleNamespace(service_is_ready=lambda: self.there, call_async=call)

    def destroy_client(self, client: Any) -> None:
        pass

    async def _get(self, request: Any) -> Any:
        assert request.names == ["model_file"]
        return SimpleNamespace(values=[SimpleNamespace(string_value=self.file)])

    async def _set(self, request: Any) -> Any:
        value = request.parameters[0].value.string_value
        refused = "bad" in value
        self.given.append(value)
        self.file = self.file if refused else value
        return SimpleNamespace(results=[SimpleNamespace(successful=not refused, reason="no model" if refused else "")])


def ask(exchange: ModelExchange, what: str, *file: str) -> tuple[bool, str]:
    return asyncio.run(getattr(exchange, what)(*file))


def test_applied_twice_and_reverted_once_is_what_was_there_before() -> None:
    linearizer = Linearizer()
    exchange = ModelExchange(linearizer, "linearizer", None)
    assert ask(exchange, "apply", "better.yaml") == (True, "better.yaml")
    assert ask(exchange, "apply", "better.yaml") == (True, "better.yaml is applied already")
    assert linearizer.given == ["better.yaml"]
    assert ask(exchange, "revert") == (True, "the model that it began with")
    assert linearizer.file == ""
    assert ask(exchange, "revert") == (False, "no model was applied")


def test_reverting_goes_back_one_model_at_a_time_to_the_file_that_it_was_started_with() -> None:
    linearizer = Linearizer("mine.yaml")
    exchange = ModelExchange(linearizer, "linearizer", None)
    for file in ("one.yaml", "two.yaml"):
        assert ask(exchange, "apply", file)[0]
    assert ask(exchange, "apply", "bad.yaml") == (False, "no model")
    assert ask(exchange, "revert") == (True, "one.yaml")
    assert ask(exchange, "revert") == (True, "mine.yaml")
    assert linearizer.file == "mine.yaml"


def test_what_somebody_else_has_changed_is_not_taken_back() -> None:
    linearizer = Linearizer()
    exchange = ModelExchange(linearizer, "linearizer", None)
    assert ask(exchange, "apply", "better.yaml")[0]
    linearizer.file = "other.yaml"
    done, why = ask(exchange, "revert")
    assert not done
    assert "other.yaml: nothing is taken back" in why
    assert linearizer.file == "other.yaml"


def test_without_a_linearizer_nothing_is_applied() -> None:
    exchange = ModelExchange(Linearizer(there=False), "left/linearizer", None)
    assert ask(exchange, "apply", "better.yaml") == (False, "left/linearizer is not there")


# ------------------------------------------------------------------ what is told of states


class Reader(StateReader):
    """A node that reads states, with what it logs."""

    def __init__(self, namespace: str = "/", **options: Any) -> None:
        self.options = {name: entry.value for name, entry in STATE_OPTIONS.items()} | options
        self.model, self.logged, self._namespace = MOTOR, list[str](), namespace

    def get_namespace(self) -> str:
        return self._namespace

    def get_logger(self) -> Any:
        return SimpleNamespace(warning=self.logged.append)


def test_one_warning_of_a_kind_however_often_it_comes() -> None:
    node = Reader()
    for k in range(1000):
        node.warn_once("missing", f"no joint: {k}")
        node.warn_once("stale", f"too old: {k}")
    assert node.logged == ["no joint: 0", "too old: 0"]


def test_every_joint_has_an_id_of_its_own() -> None:
    joint = {"state_source": "joint_state", "joint_name": "wheel"}
    assert Reader("/left", **joint).hardware_id == "left/wheel"
    assert Reader("/right", **joint).hardware_id == "right/wheel"
    assert Reader(**joint).hardware_id == "wheel"
    assert Reader("/left").hardware_id == "left/dc_motor"


def test_when_a_message_is_of() -> None:
    message = SimpleNamespace(header=SimpleNamespace(stamp=SimpleNamespace(sec=0, nanosec=0)))
    assert Reader().stamp_of(message, 7) == 0
    assert Reader(stamps="reception").stamp_of(message, 7) == 7


# ------------------------------------------------------------------ a diagnosis


def until(condition: Any) -> None:
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.05)


@pytest.mark.slow
def test_a_diagnosis_tells_how_far_it_is_and_leaves_nothing_behind_when_it_is_cancelled(tmp_path: Path) -> None:
    t = 0.005 * np.arange(8000)
    u = (2.0 * np.sin(1.6 * t) + np.sin(4.8 * t))[:, None]
    x = simulate(MOTOR, t, u).x
    noise = 1e-4 * np.random.default_rng(1).standard_normal(t.size)
    position = Signal(x[:, MOTOR.states.index("position")] + noise, "rad")
    record = Record(t, {"voltage": Signal(u[:, 0], "V"), "position": position})
    diagnosis = DiagnosisProcess(MOTOR.without_effect("coulomb_friction"), record, tmp_path)
    assert diagnosis.stage == (0.0, "reading the record")
    until(lambda: diagnosis.stage[0] > 0.0)
    share, stage = diagnosis.stage
    assert 0.0 < share < 1.0
    assert stage
    assert diagnosis.running
    mine = [psutil.Process(diagnosis._process.pid), *psutil.Process(diagnosis._process.pid).children(recursive=True)]
    diagnosis.stop()
    until(lambda: not any(p.is_running() and p.status() != psutil.STATUS_ZOMBIE for p in mine))
    assert not diagnosis.running


def test_what_is_not_there_is_neither_planned_nor_cancelled_and_says_why(tmp_path: Path) -> None:
    told: list[Any] = []
    empty = diagnoses.Diagnoses(tmp_path, 20_000, told.append, told.append, told.append)
    nothing = "nothing to record yet: states and inputs must have come for a while"
    assert empty.diagnose(MonitorLogic(MonitorSettings(), 0), 0) == (False, nothing)
    assert empty.experiment() == (False, "there is no diagnosis: call ~/diagnose first")
    assert empty.cancel() == (False, "neither a diagnosis nor a plan is being made")
    assert told == []


def test_of_a_record_of_many_rows_the_newest_are_diagnosed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """How long a fit takes goes with the rows: 93 s at 500 Hz must not take minutes."""
    logic = MonitorLogic(MonitorSettings(), 0)
    logic.configure(MOTOR, 0)
    for k in range(1001):
        logic.take_input(np.array([float(k % 4)]), k * NANO // 500)
        logic.take_shown({"position": 0.001 * k}, k * NANO // 500)
    whole, newest = logic.record(), logic.record(most=300)
    assert (len(whole), len(newest)) == (1001, 300)
    for name in ("voltage", "position"):
        assert newest.signals[name].values == pytest.approx(whole.signals[name].values[-300:])
    assert len(logic.record(most=2000)) == 1001
    asked: list[Record] = []
    process = SimpleNamespace(folder=tmp_path, seconds=0.0, stage=(0.0, ""))
    monkeypatch.setattr(diagnoses, "DiagnosisProcess", lambda model, record, folder: asked.append(record) or process)
    done, said = diagnoses.Diagnoses(tmp_path, 300, print, print, print).diagnose(logic, 0)
    assert done, said
    assert len(asked[0]) == 300
    assert "300 rows" in said


# ------------------------------------------------------------------ usual is not right


class Judged:
    """A monitor that watches a motor with friction by a model, with a linearizer on that model."""

    def __init__(self, model: Model, noise: float = 1e-4, steady: bool = False, more: float = 1.0) -> None:
        """``steady``: 2 V with all states shown, of which ``more`` times as much acts after 12 s as is told."""
        from signlin_ros.linearization import Linearizer
        from signlin_ros.simulation import Stepper

        self.logic = MonitorLogic(MonitorSettings(learn=10.0, **({"window": 2.0} if steady else {})), 0)
        self.logic.configure(model, 0)
        plant, core, random, k = Stepper(MOTOR, MOTOR.x0.copy()), Linearizer(model), np.random.default_rng(8), 0
        for _ in range(4000 if steady else 0):
            plant.advance(0.005, np.array([2.0]))
        while k < 2800:
            now, t = k * NANO // 200, k / 200
            u = np.array([2.0 if steady else 2.0 * np.sin(1.3 * t) + np.sin(3.1 * t)])
            self.logic.take_input(u, now)
            error = noise * random.standard_normal()
            names = MOTOR.states if steady else ("position",)
            self.logic.take_shown({n: float(plant.x[MOTOR.states.index(n)]) + error for n in names}, now)
            if k % 20 == 0:
                self.logic.take_update(Update(now, k // 20, core(plant.x, u)))
                self.logic.work(now)
            plant.advance(0.005, u if t < 12 else more * u)
            k += 1
        self.health = self.logic.health(k * NANO // 200)


def test_a_model_that_is_right_says_so_with_its_fits() -> None:
    health = Judged(MOTOR).health
    assert health.level == LEVEL_OK
    assert "as usual; the model is right to about 0.3 %" in health.message
    assert "speed fits to" in health.message


def test_a_machine_without_noise_may_err_by_what_the_model_is_trusted_to() -> None:
    judged = Judged(MOTOR, noise=0.0, steady=True, more=1.002)
    assert "times as wrong" not in judged.health.message
    assert judged.logic.usual_error is not None
    speed, trust = judged.logic._judged[-1].truth[MOTOR.states.index("speed")], 0.003
    assert judged.logic.usual_error[MOTOR.states.index("speed")] == pytest.approx(trust * speed, rel=0.01)


def test_a_model_without_its_friction_is_as_usual_but_not_right() -> None:
    health = Judged(MOTOR.without_effect("coulomb_friction")).health
    assert health.level == WARN
    assert "as usual, but the model is not right" in health.message
    assert "~/diagnose" in health.message


def test_after_a_reset_there_is_no_alarm_and_what_is_usual_is_learnt_anew() -> None:
    judged = Judged(MOTOR)
    assert judged.logic._watch is not None
    judged.logic.learn_anew(14 * NANO)
    assert judged.logic.alarm is None
    assert judged.logic.health(14 * NANO).message == "learning what is usual"
    assert len(judged.logic.record()) == 2800  # what was seen stays
