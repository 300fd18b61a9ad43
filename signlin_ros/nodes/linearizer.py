"""The node ``linearizer``: states in, A_k, B_k, c out, one model per update period.

Subscribes ``state`` or ``joint_states``, and ``input``; publishes ``~/A``, ``~/B``, ``~/c``, ``~/model``,
``~/model_yaml`` and ``/diagnostics``. A managed node.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, wait
from dataclasses import replace
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.clock import Clock, ClockType, JumpThreshold
from rclpy.duration import Duration
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, Header, String

from signlin_ros.errors import InputError
from signlin_ros.model import Model
from signlin_ros.nodes import convert, overrides
from signlin_ros.nodes.gather import Gathering, pump_in_turn
from signlin_ros.nodes.joint import measured_states
from signlin_ros.nodes.linearizer_logic import OBSERVERS, LinearizerLogic
from signlin_ros.nodes.managed import ManagedNode
from signlin_ros.nodes.overrides import Overridable
from signlin_ros.nodes.parameters import on_change
from signlin_ros.nodes.prepared import Prepared
from signlin_ros.nodes.qos import LATCHED, RECORD_QOS, SENSOR_QOS
from signlin_ros.nodes.runner import run
from signlin_ros.nodes.sources import STATE_OPTIONS, StateReader
from signlin_ros.nodes.told import NANO, Refusal, Update

OPTIONS = {
    **STATE_OPTIONS,
    "state_timeout": Overridable(
        0.0,
        "age of the state [s] above which nothing is published; 0: three update periods",
        0.0,
        1e6,
        read_only=False,
    ),
    "input_timeout": Overridable(
        0.0,
        "age of the input [s] above which none is known; 0: three update periods; large: it is held until the next one",
        0.0,
        1e6,
        read_only=False,
    ),
    "observer": Overridable(
        "kalman", "where states of joint_states come from that are not measured, or noisy", choices=OBSERVERS
    ),
    "model_file": Overridable(
        "", "another model, taken at once; empty: the one that the node began with", read_only=False
    ),
}
LONGEST_REST = 4e-3
"""Seconds for which messages gather, so that many come with one waking."""
LONGEST_GATHERING = 0.1
"""Seconds between two looks at what has come, where an update is longer in coming."""
ASIDE = 2e-3
"""Seconds between two looks at what has come, while another model is prepared."""
CLOCK_PATIENCE = 5.0
"""Seconds without /clock, with use_sim_time, after which that is said."""


class LinearizerNode(StateReader, ManagedNode):
    """Reads messages into `LinearizerLogic` and publishes what comes out."""

    def __init__(self) -> None:
        super().__init__("linearizer", OPTIONS, follows=True)
        self.joint = self.options["joint_name"]
        self.logic: Any = None
        self._first = self.model
        steady = Clock(clock_type=ClockType.STEADY_TIME)  # goes on where a simulated clock stands still
        self._waited = 0.0
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self._slow_timer = self.create_timer(1.0, self._on_second, clock=steady)
        self._latest, self._computing = 0, 0.0
        backward = JumpThreshold(min_forward=None, min_backward=Duration(nanoseconds=-1), on_clock_change=True)
        self._jump = self.get_clock().create_jump_callback(backward, post_callback=self._on_jump)
        self._renewing = False
        if self.options["model_file"]:
            self.renew(Model.load(self.options["model_file"]))
        on_change(self, self._try_changes, self._apply_changes)
        self.start()

    def set_up(self) -> None:
        """Make the logic and the publishers."""
        option = self.options
        self.logic = LinearizerLogic(
            self.model,
            self.now(),
            option["state_timeout"],
            option["observer"],
            option["input_timeout"],
            option["ignore"],
        )
        if option["state_source"] == "joint_state" and self.model.plant.name != "arm":
            self.logic.warm_up(self.model)
        self._publish_to = {
            name: self.create_publisher(Float64MultiArray, f"~/{name}", LATCHED) for name in ("A", "B", "c", "model")
        }
        self._yaml = self.create_publisher(String, "~/model_yaml", LATCHED)
        self._yaml.publish(String(data=_text(self.model)))
        self._names = self.create_publisher(String, "~/names", LATCHED) if self.model.plant.name == "arm" else None
        if self._names is not None:
            self._names.publish(String(data=names_text(self.model)))
        self._say_hello()

    def begin(self) -> None:
        """Listen, and publish every period."""
        self.logic.reset(self.now())
        source = self.options["state_source"]
        kind, topic, take = {
            "array": (Float64MultiArray, "state", self._take_state),
            "joint_state": (JointState, "joint_states", self._take_joint_state),
        }[source]
        waking = bool(self.get_parameter("use_sim_time").value)  # then a message counts from when it is taken
        qos = SENSOR_QOS if waking else RECORD_QOS
        self._inputs = [
            Gathering(self, *of, qos, self._rest, waking=waking)
            for of in ((kind, topic, take), (Float64MultiArray, "input", self._take_input))
        ]
        self._timer = self.create_timer(self.model.update_period, self._pump)
        self._look = self.create_timer(LONGEST_GATHERING, self._take, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def end(self) -> None:
        """Listen no more."""
        self.destroy_timer(self._timer)
        self.destroy_timer(self._look)
        for gathering in self._inputs:
            gathering.destroy()

    def take_down(self) -> None:
        """Undo `set_up`."""
        others = getattr(self, "_yaml", None), getattr(self, "_names", None)
        for publisher in (*getattr(self, "_publish_to", {}).values(), *others):
            if publisher is not None:
                self.destroy_publisher(publisher)
        self.logic, self._publish_to, self._yaml, self._names = None, {}, None, None

    def _say_hello(self) -> None:
        names = f"states {', '.join(self.model.states)}; inputs {', '.join(self.model.inputs)}"
        self.get_logger().info(f"{self.model.plant.name}, {self.model.linearization}; {names}")

    # ---------------------------------------------------------------- messages

    def _rest(self) -> float:
        """Return how long messages may gather, in s: not beyond the next update."""
        due = self._timer.time_until_next_call() or 0
        return float(max(0.0, min(LONGEST_REST, self.model.update_period / 20, due / NANO)))

    def _take_input(self, message: Float64MultiArray, now: int) -> None:
        self._has_input = True
        self.logic.take_input(convert.read_input(message, self.model), now)

    def _take_state(self, message: Float64MultiArray, now: int) -> None:
        self.logic.take_state(convert.read_vector(message, len(self.model.states)), now)

    def _take_joint_state(self, message: JointState, now: int) -> None:
        if self.model.plant.name == "arm":
            self._take_joints(message, now)
            return
        joint, stamp = convert.read_joint(message, self.joint), self.stamp_of(message, now)
        values = joint if isinstance(joint, Refusal) else measured_states(self.model, joint)
        effort = None if isinstance(joint, Refusal) else self.effort_as_input(joint, self.logic.channels)
        if effort is not None:
            self.logic.take_input(np.array([effort]), stamp)
        self.logic.take_measured(values, stamp, now)

    def _take_joints(self, message: JointState, now: int) -> None:
        """Take all joints of an arm by name; efforts are its input where nobody publishes one."""
        joints = [name.removesuffix(".effort") for name in self.model.inputs]
        values = convert.read_joints(message, joints)
        if not isinstance(values, Refusal) and not self._has_input and all(n in values for n in self.model.inputs):
            efforts = np.array([values[name] for name in self.model.inputs])
            self._has_effort = self._has_effort or bool(efforts.any())
            if self._has_effort:  # efforts that are 0 throughout are not measured
                self.logic.take_input(efforts, now)
        shown = values if isinstance(values, Refusal) else measured_states(self.model, values)
        self.logic.take_measured(shown, self.stamp_of(message, now), now)

    def _on_period(self) -> None:
        start = time.perf_counter()
        for update in self.logic.updates(self.now()):
            self._publish(update)
            self._computing = time.perf_counter() - start

    def _publish(self, update: Update) -> None:
        result = update.result
        self._publish_to["A"].publish(convert.matrix(result.A, "rows", "columns"))
        self._publish_to["B"].publish(convert.matrix(result.B, "rows", "columns"))
        self._publish_to["c"].publish(convert.matrix(result.c.reshape(-1, 1), "rows", "columns"))
        self._publish_to["model"].publish(convert.model_message(update))

    # ---------------------------------------------------------------- time

    def _on_jump(self, _: Any) -> None:
        if self.logic is None:
            return
        self.get_logger().warning("the clock has jumped back or changed: starting anew")
        self.logic.reset(self.now())
        if self.active:
            self._timer.reset()

    def _on_second(self) -> None:
        now = self.now()
        if now < self._latest:  # the system's clock was set back: no jump callback tells of that
            self._on_jump(None)
        self._latest = now
        if not self.active or self.logic is None:
            return
        health = self.logic.health(now)
        shown = {**health.values, "computing and publishing [s]": f"{self._computing:.6f}"}
        values = [KeyValue(key=key, value=value) for key, value in shown.items()]
        status = DiagnosticStatus(
            level=bytes([health.level]),
            name=f"{self.get_fully_qualified_name()}: linearization",
            message=health.message,
            hardware_id=self.hardware_id,
            values=values,
        )
        self._diagnostics.publish(DiagnosticArray(header=Header(stamp=convert.stamp_of(now)), status=[status]))
        self._warn()

    def _warn(self) -> None:
        """Say once what a user would wonder about: each kind of refused messages, channels that are left out, a
        simulated clock that nobody publishes.
        """
        last = self.logic.last_refusal
        if last is not None:
            self.warn_once(
                last.kind, f"a message was refused, {last.kind}: {last.detail}; diagnostics count more of them"
            )
        if self.logic.channels.sentence:
            self.warn_once("channels", self.logic.channels.sentence)
        if self.get_parameter("use_sim_time").value and self.now() == 0:
            self._waited += 1.0
            if self._waited == CLOCK_PATIENCE:
                self.get_logger().warning("use_sim_time is set, but nobody publishes /clock: no model will come")

    # ---------------------------------------------------------------- parameters

    def _try_changes(self, changes: dict[str, Any]) -> None:
        if not self._renewing:
            self._prepared = self._aside(lambda: self._prepare(changes))

    def _prepare(self, changes: dict[str, Any]) -> Prepared:
        if "model_file" not in changes:
            model = overrides.changed(self.model, changes)
        elif len(changes) > 1:
            raise InputError("model_file: found other parameters beside it; a whole model is set alone")
        else:
            model = Model.load(changes["model_file"]) if changes["model_file"] else self._first
        model.to_yaml()
        return self.logic.prepare(model) if self.logic else Prepared.of(model)

    def _aside(self, work: Callable[[], Prepared]) -> Prepared:
        """Do what takes its time in a thread, and meanwhile what the executor would do; it waits for this callback."""
        with ThreadPoolExecutor(1) as pool:
            future = pool.submit(work)
            while not future.done():
                wait([future], timeout=ASIDE)
                self._pump()
            return future.result()

    def _pump(self) -> None:
        """Take what has come, and publish what has fallen due."""
        if self.logic is not None and self.active:
            self._take()
            self._on_period()

    def _take(self) -> None:
        """Take what has come: with few wakings, for these cost several times what the messages do."""
        pump_in_turn(*self._inputs)

    def _apply_changes(self, changes: dict[str, Any]) -> None:
        if self._renewing:
            return
        before, new = self.model, self._prepared
        if "model_file" in changes:
            self._renew(new.model)
        self.model = new.model
        for name in ("state_timeout", "input_timeout"):
            self.options[name] = float(changes.get(name, self.options[name]))
        if self.logic is None:
            return
        self.logic.state_timeout, self.logic.input_timeout = (
            self.options[n] for n in ("state_timeout", "input_timeout")
        )
        self.logic.configure(new)
        self._yaml.publish(String(data=_text(self.model)))
        if "model_file" in changes:
            self._say_hello()
        if self.model.update_period != before.update_period:
            self._restart()

    def _restart(self) -> None:
        """Count periods anew, of another length."""
        self.logic.restart(self.now())
        if self.active:
            self._timer.timer_period_ns = round(self.model.update_period * NANO)
            self._timer.reset()

    def _renew(self, model: Model) -> None:
        """Declare another model's parameters in place of the old one's."""
        self._renewing = True
        try:
            self.renew(model)
        finally:
            self._renewing = False


def names_text(model: Model) -> str:
    """Return the names of states and inputs, in the order of A and B, as JSON."""
    return json.dumps({"states": list(model.states), "inputs": list(model.inputs)})


def _text(model: Model) -> str:
    """Return a model as a file whose effect files are named in full, for whoever reads it elsewhere."""
    files = tuple(str((model.folder / name).resolve()) for name in model.effect_files)
    return replace(model, effect_files=files).to_yaml()


def main() -> int:
    """Run the node; return the exit code."""
    return run("linearizer", LinearizerNode)
