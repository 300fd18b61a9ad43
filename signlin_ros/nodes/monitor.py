"""The node ``monitor``: how wrong the linearizer's model is, since when, and what would make it right.

Subscribes ``state`` or ``joint_states``, ``input``, ``linearizer/model`` and ``linearizer/model_yaml``; publishes
``~/error``, ``~/verdict``, ``~/plan``, ``~/plot/...`` and ``/diagnostics``; services ``~/diagnose``, ``~/experiment``,
``~/cancel``, ``~/apply``, ``~/revert``, ``~/reset``, ``~/record``.
"""

from __future__ import annotations

import json
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.clock import Clock, ClockType, JumpThreshold
from rclpy.duration import Duration
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, Header, String
from std_srvs.srv import Trigger

from signlin_ros.errors import SignlinError
from signlin_ros.model import Model
from signlin_ros.nodes import convert
from signlin_ros.nodes.channels import Channels
from signlin_ros.nodes.diagnoses import Diagnoses
from signlin_ros.nodes.diagnosing import Naming
from signlin_ros.nodes.exchange import ModelExchange
from signlin_ros.nodes.gather import Gathering, pump_in_turn
from signlin_ros.nodes.joint import measured_states
from signlin_ros.nodes.joints import refuse_arm
from signlin_ros.nodes.managed import ManagedNode
from signlin_ros.nodes.monitor_logic import MonitorLogic, MonitorSettings
from signlin_ros.nodes.overrides import Overridable
from signlin_ros.nodes.plotted import ScalarTopics
from signlin_ros.nodes.qos import LATCHED, RECORD_QOS, RELIABLE
from signlin_ros.nodes.runner import run
from signlin_ros.nodes.sources import STATE_OPTIONS, StateReader
from signlin_ros.nodes.told import NANO, Refusal

OPTIONS = {
    **STATE_OPTIONS,
    "linearizer": Overridable(
        "linearizer", "name of the linearizer that is watched, and that a better model is given to"
    ),
    "keep": Overridable(120.0, "data that are kept [s], for diagnose and record", 1.0, 86400.0),
    "window": Overridable(10.0, "over which errors are taken together [s]", 0.1, 3600.0),
    "learn": Overridable(
        30.0, "time at the start, while all is well, in which is learnt what is usual [s]", 5.0, 86400.0
    ),
    "warn_above": Overridable(3.0, "multiple of the usual error of a prediction above which it warns", 1.0, 1e6),
    "most_rows": Overridable(
        20_000,
        "rows of a record that is diagnosed, the newest: a fit takes as long as there are rows",
        1000,
        10_000_000,
    ),
    "plot": Overridable(True, "single numbers with names on ~/plot/..., for PlotJuggler and Foxglove"),
    "folder": Overridable("", "where diagnoses and records are written; empty: a temporary folder"),
}
MIN_TIME_SINCE_CHANGE = 20
"""Seconds of data since a change from which on a diagnosis takes them alone."""
INSTEAD = "record the topics and use signlin diagnose; the linearizer's diagnostics tell range and faults of each joint"
"""What there is for an arm."""
LOOK_PERIOD = 0.1
"""Seconds between two looks at what has come."""
GATHER_REST = 0.02
"""Seconds for which messages gather: nobody waits for what the monitor says."""


class MonitorNode(StateReader, ManagedNode):
    """Reads messages into `MonitorLogic`, publishes what comes out, and runs the diagnosis."""

    def __init__(self) -> None:
        super().__init__("monitor", OPTIONS)
        refuse_arm(self.model, "monitor", INSTEAD)
        option = self.options
        self.logic: Any = None
        self._naming: Naming | None = None
        self._named: int | None = None
        self._changed_in = ""
        self._exchange: Any = None
        folder = Path(option["folder"] or tempfile.mkdtemp(prefix="signlin_monitor_"))
        self._diagnoses = Diagnoses(folder, option["most_rows"], self._tell, self._tell_plan, self.get_logger().info)
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._slow_timer = self.create_timer(1.0, self._on_second, clock=steady)
        backward = JumpThreshold(min_forward=None, min_backward=Duration(nanoseconds=-1), on_clock_change=True)
        self._jump = self.get_clock().create_jump_callback(backward, post_callback=self._on_jump)
        self.start()

    # ---------------------------------------------------------------- life

    def set_up(self) -> None:
        """Make the logic, the publishers and the services."""
        option = self.options
        judged = (option[name] for name in ("keep", "window", "learn", "warn_above", "ignore"))
        settings = MonitorSettings(*judged)
        Channels(self.model, settings.ignored)  # what is no channel is refused at the start
        self.logic = MonitorLogic(settings, self.now())
        self._plotted = ScalarTopics(self, option["plot"])
        self._errors = self.create_publisher(Float64MultiArray, "~/error", RELIABLE)
        self._verdicts = self.create_publisher(String, "~/verdict", LATCHED)
        self._plans = self.create_publisher(String, "~/plan", LATCHED)
        aside = ReentrantCallbackGroup()  # who waits for the linearizer's answer must not keep it, and all else, away
        self._exchange = ModelExchange(self, option["linearizer"], aside)
        calls = {
            "diagnose": self._on_diagnose,
            "cancel": self._on_cancel,
            "reset": self._on_reset,
            "record": self._on_record,
            "experiment": self._on_experiment,
        }
        self._made = [self.create_service(Trigger, f"~/{name}", call) for name, call in calls.items()]
        self._made += [
            self.create_service(Trigger, "~/apply", self._on_apply, callback_group=aside),
            self.create_service(Trigger, "~/revert", self._on_revert, callback_group=aside),
        ]

    def begin(self) -> None:
        """Listen."""
        self.logic.reset(self.now())
        watched = self.options["linearizer"]
        self._heard = [
            self.create_subscription(String, f"{watched}/model_yaml", self._on_yaml, LATCHED),
            self.create_subscription(Float64MultiArray, f"{watched}/model", self._on_update, LATCHED),
        ]
        kind, topic, take = {
            "array": (Float64MultiArray, "state", self._take_state),
            "joint_state": (JointState, "joint_states", self._take_joint_state),
        }[self.options["state_source"]]
        waking = bool(self.get_parameter("use_sim_time").value)  # then a message counts from when it is taken
        self._gathered = [
            Gathering(self, *of, RECORD_QOS, lambda: GATHER_REST, sent=True, waking=waking)
            for of in ((kind, topic, take), (Float64MultiArray, "input", self._take_input))
        ]
        self._timer = self.create_timer(LOOK_PERIOD, self._on_tick, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def end(self) -> None:
        """Listen no more; a diagnosis is given up."""
        self.destroy_timer(self._timer)
        for subscription in self._heard:
            self.destroy_subscription(subscription)
        for gathering in self._gathered:
            gathering.destroy()
        self._give_up()

    def take_down(self) -> None:
        """Undo `set_up`."""
        for service in getattr(self, "_made", []):
            self.destroy_service(service)
        for publisher in (getattr(self, n, None) for n in ("_errors", "_verdicts", "_plans")):
            if publisher is not None:
                self.destroy_publisher(publisher)
        if self._exchange is not None:
            self._exchange.close()
        self._exchange = None
        if self.logic is not None:
            self._plotted.close()
        self._made, self._errors, self._verdicts = [], None, None
        self._give_up()

    def destroy_node(self) -> None:
        """End a diagnosis that is still running, and the node."""
        self._give_up()
        super().destroy_node()

    def _give_up(self) -> None:
        self._diagnoses.stop()
        if self._naming is not None:
            self._naming.stop()
        self._naming = None

    # ---------------------------------------------------------------- messages

    def _on_yaml(self, message: String) -> None:
        try:
            content = yaml.safe_load(message.data)["/**"]["ros__parameters"]
            model = Model.from_dict(content, source=f"{self.options['linearizer']}/model_yaml")
        except (SignlinError, yaml.YAMLError, KeyError, TypeError) as error:
            self.get_logger().warning(f"model_yaml refused: {error}")
            return
        if self.logic.model is None or model != self.logic.model:
            self.logic.configure(model, self.now())
            self._plotted.take_model(model, self.logic.bare_linearizer)

    def _on_update(self, message: Float64MultiArray) -> None:
        try:
            update = convert.read_model(message)
        except (ValueError, IndexError):
            self.logic.take_shown(Refusal("model_layout", "not the layout of ~/model"), 0)
            return
        if self.logic.take_update(update):
            self._plotted.tell_update(update)

    def _take_input(self, message: Float64MultiArray, came: int) -> None:
        self._has_input = True
        if self.logic.model is not None:
            self.logic.take_input(convert.read_input(message, self.logic.model), came)

    def _take_state(self, message: Float64MultiArray, came: int) -> None:
        model = self.logic.model
        if model is None:
            return
        value = convert.read_vector(message, len(message.data))
        names = self._state_names(len(message.data))
        if isinstance(value, Refusal) or names is None:
            self.logic.take_shown(value if isinstance(value, Refusal) else Refusal("length", "not the states"), 0)
            return
        pairs = zip(names, value.tolist(), strict=True)
        self.logic.take_shown({name: v for name, v in pairs if name in model.states}, came)

    def _state_names(self, length: int) -> tuple[str, ...] | None:
        """Return the names of an array of this length: the states of the present model, or of the one at the start."""
        for model in (self.logic.model, self.model):
            if length == len(model.states):
                return tuple(model.states)
        return None

    def _take_joint_state(self, message: JointState, came: int) -> None:
        model = self.logic.model
        if model is None:
            return
        joint, stamp = convert.read_joint(message, self.options["joint_name"]), self.stamp_of(message, came)
        values = joint if isinstance(joint, Refusal) else measured_states(model, joint)
        effort = None if isinstance(joint, Refusal) else self.effort_as_input(joint, self.logic.channels)
        if effort is not None:
            self.logic.take_input(np.array([effort]), stamp)
        self.logic.take_shown(values, stamp)

    # ---------------------------------------------------------------- time

    def _on_jump(self, _: Any) -> None:
        if self.logic is not None:
            self.get_logger().warning("the clock has jumped back or changed: starting anew")
            self.logic.reset(self.now())

    def _on_tick(self) -> None:
        pump_in_turn(*self._gathered)
        scores, alarm = self.logic.work(self.now())
        for score in scores:
            self._errors.publish(convert.error_message(score))
            self._plotted.tell_score(score)
        if alarm is not None:
            since = self.logic.alarm_stamp or 0
            sentence = f"the machine has changed, since {since / NANO:.2f} s; in what is not known yet"
            self.get_logger().warning(sentence)
            self._tell({"state": "changed", "kind": "change", "since": since / NANO, "sentence": sentence})
        self._look_after_naming()
        self._diagnoses.look()

    def _on_second(self) -> None:
        if not self.active or self.logic is None:
            return
        now = self.now()
        health = self.logic.health(now)
        status = DiagnosticStatus(
            level=bytes([health.level]),
            name=f"{self.get_fully_qualified_name()}: model",
            message=health.message + (f"; {self._changed_in}" if self._changed_in else ""),
            hardware_id=self.hardware_id,
            values=[KeyValue(key=key, value=value) for key, value in health.values.items()],
        )
        self._diagnostics.publish(DiagnosticArray(header=Header(stamp=convert.stamp_of(now)), status=[status]))
        if self.logic.model is not None and self.logic.channels.sentence:
            self.warn_once("channels", self.logic.channels.sentence)
        self._diagnoses.tell_running()

    def _tell(self, verdict: dict[str, Any]) -> None:
        self._verdicts.publish(String(data=json.dumps(verdict)))

    def _tell_plan(self, plan: dict[str, Any]) -> None:
        self._plans.publish(String(data=json.dumps(plan)))

    def _look_after_naming(self) -> None:
        """Ask what has changed, once for each change, and tell the answer."""
        changed = self.logic.alarm_stamp
        if changed != self._named:
            self._ask_for_names(changed)
        if self._naming is None or self._naming.running or changed is None:
            return
        found, self._naming = self._naming, None
        try:
            names = found.result()
        except SignlinError as error:
            self.get_logger().warning(str(error))
            return
        listed = "; or ".join(name["sentence"] for name in names)
        self._changed_in = listed or "nothing that is tried at once: ask for a diagnosis"
        sentence = f"what has changed: {self._changed_in}"
        self.get_logger().warning(sentence)
        self._tell({"state": "named", "since": changed / NANO, "names": names, "sentence": sentence})

    def _ask_for_names(self, changed: int | None) -> None:
        """Ask what has changed as soon as there are data enough; what was asked of another change is given up."""
        self._changed_in = ""
        if self._naming is not None:
            self._naming.stop()
            self._naming = None
        try:
            question = None if changed is None else self.logic.question(self.now())
        except SignlinError as error:  # less is kept than is asked of
            self._named = changed
            self.get_logger().warning(f"what has changed is not tried: {error}")
            return
        if changed is None or question is not None:
            self._named = changed
        if question is not None:
            self._naming = Naming(question)

    # ---------------------------------------------------------------- services

    def _on_diagnose(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        return _answer(response, *self._diagnoses.diagnose(self.logic, self._since()))

    def _on_experiment(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        return _answer(response, *self._diagnoses.experiment())

    def _on_cancel(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        return _answer(response, *self._diagnoses.cancel())

    def _on_record(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        return _answer(response, *self._diagnoses.record(self.logic))

    def _on_reset(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        """Forget an alarm, and learn anew what is usual."""
        had = self.logic.alarm is not None
        self.logic.learn_anew(self.now())
        self._ask_for_names(None)
        sentence = f"{'the alarm is reset; ' if had else 'there was no alarm; '}what is usual is learnt anew"
        self._tell({"state": "reset", "sentence": sentence})
        return _answer(response, True, sentence)

    def _since(self) -> int:
        """Return from when on data are of one machine: since it changed, if that is long enough ago."""
        changed = self.logic.alarm_stamp
        return changed if changed is not None and self.now() - changed > MIN_TIME_SINCE_CHANGE * NANO else 0

    async def _on_apply(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        if self._diagnoses.better is None:
            return _answer(response, False, "there is no better model: call ~/diagnose first")
        return _answer(response, *await self._exchange.apply(str(self._diagnoses.better)))

    async def _on_revert(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        return _answer(response, *await self._exchange.revert())


def _answer(response: Trigger.Response, success: bool, message: str) -> Trigger.Response:
    response.success, response.message = success, message
    return response


def main() -> int:
    """Run the node; return the exit code."""
    return run("monitor", MonitorNode)
