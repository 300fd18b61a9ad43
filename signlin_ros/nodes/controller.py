"""The node ``controller``: references and states in, the input of the drive out, friction fed forward.

Subscribes ``reference``, ``state`` or ``joint_states``, ``linearizer/model`` and ``linearizer/model_yaml``; publishes
``input`` and ``/diagnostics``; service ``~/resume``.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor, wait
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.clock import Clock, ClockType, JumpThreshold
from rclpy.duration import Duration
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, Header, String
from std_srvs.srv import Trigger

from signlin_ros.control import CONTROL_PERIOD
from signlin_ros.control.controller import Controller, ControllerSettings
from signlin_ros.control.designs import DEFAULT_DESIGN, DESIGNS
from signlin_ros.errors import InputError
from signlin_ros.model import Model
from signlin_ros.nodes import convert
from signlin_ros.nodes.apart import MadeApart
from signlin_ros.nodes.controller_logic import LONGEST_REFERENCE, ControllerLogic, Timeouts
from signlin_ros.nodes.gather import Gathering
from signlin_ros.nodes.joints import refuse_arm
from signlin_ros.nodes.overrides import Overridable
from signlin_ros.nodes.parameters import ModelNode, on_change
from signlin_ros.nodes.qos import LATCHED, NEWEST, RELIABLE, SENSOR_QOS
from signlin_ros.nodes.runner import run
from signlin_ros.nodes.sources import STATE_OPTIONS, StateReader
from signlin_ros.nodes.told import NANO
from signlin_ros.nodes.turns import Turns

OPTIONS = {
    "design": Overridable(DEFAULT_DESIGN, "how the input is made", choices=tuple(DESIGNS), read_only=False),
    "track": Overridable("speed", "what a reference is", choices=("speed", "position")),
    "control_period": Overridable(CONTROL_PERIOD, "time between two inputs [s]", 1e-3, 10.0),
    "limit": Overridable(0.0, "largest |input|, in its unit; must be given", 0.0, 1e9),
    "loop_delay": Overridable(
        0.0, "the longest from a sample until its input acts [s]; 0: one period, and the model's delay", 0.0, 10.0
    ),
    "largest_speed": Overridable(0.0, "of the references; 0: what the model is made for", 0.0, 1e9),
    "tolerance_at_rest": Overridable(
        0.0, "error that may stay where the reference stands still", 0.0, 1e9, read_only=False
    ),
    "bandwidth": Overridable(
        0.0, "of the feedback [rad/s]; 0: a calm one that period and delay leave room for", 0.0, 1e5, read_only=False
    ),
    "damping": Overridable(1.0, "weight of the speed in a position loop [-]", 0.0, 100.0, read_only=False),
    "integral": Overridable(1.0, "weight of the summed error [-]", 0.0, 100.0, read_only=False),
    "floor": Overridable(
        0.02, "share of the largest speed below which friction fades and A_k is not taken", 1e-6, 1.0, read_only=False
    ),
    "friction_share": Overridable(
        1.0, "share of the model's effects that is fed forward [-]", 0.0, 2.0, read_only=False
    ),
    "turning": Overridable(
        1.0, "share of the integral action that turns with the direction of motion [-]", 0.0, 100.0, read_only=False
    ),
    **STATE_OPTIONS,
    "state_timeout": Overridable(0.0, "age of the state [s] that stops the drive; 0: three control periods", 0.0, 1e6),
    "reference_timeout": Overridable(0.0, "age of the reference [s] that stops the drive; 0: 0.5 s", 0.0, 1e6),
    "model_timeout": Overridable(0.0, "age of the model [s] that stops the drive; 0: three update periods", 0.0, 1e6),
    "needs_model": Overridable(True, "whether a linearizer must be publishing"),
    "runaway": Overridable(
        0.5, "share of the largest reference by which the speed may exceed it [-]", 0.01, 100.0, read_only=False
    ),
    "after_loss": Overridable(
        "goes_on", "once data are back that were missing or stale", choices=("goes_on", "waits_for_resume")
    ),
}
LONGEST_WAIT = 5e-3
"""Seconds between two looks at whether other gains are ready."""
SWITCH_TIME = 5e-4
"""Seconds after which what makes other gains in a thread lets the loop have its turn."""
INSTEAD = "signlin gains prints each joint's feed-forward for the arm's own controller"
"""What there is for an arm."""
SETTINGS_OPTIONS = ("design", "limit", "bandwidth", "damping", "integral", "floor", "turning", "runaway")
"""Options that are settings of the same name."""
RENAMED_OPTIONS = {
    "friction_share": "friction",
    "control_period": "period",
    "loop_delay": "delay",
    "largest_speed": "speed",
    "tolerance_at_rest": "tolerance",
}
"""Options that are settings of another name."""


def settings_of(options: dict[str, Any]) -> ControllerSettings:
    """Return the controller's settings from the node's options; raise `InputError` where a limit is missing."""
    named = {setting: options[option] for option, setting in RENAMED_OPTIONS.items()}
    return ControllerSettings(
        position=options["track"] == "position", **named, **{name: options[name] for name in SETTINGS_OPTIONS}
    )


class ControllerNode(StateReader, ModelNode):
    """Reads messages into `ControllerLogic` and publishes what comes out."""

    def __init__(self) -> None:
        super().__init__("controller", OPTIONS)
        refuse_arm(self.model, "controller", INSTEAD)
        self._check_position()
        option = self.options
        timeouts = Timeouts(option["state_timeout"], option["reference_timeout"], option["model_timeout"])
        waits = option["after_loss"] == "waits_for_resume"
        self.logic = ControllerLogic(
            self.model, settings_of(option), timeouts, option["needs_model"], waits, option["ignore"]
        )
        self._input = self.create_publisher(Float64MultiArray, "input", RELIABLE)
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self._turns = Turns(self, option["control_period"], self._on_period)
        self._heard = [self._gathering(Float64MultiArray, "reference", self._take_reference, NEWEST)]
        self.create_subscription(Float64MultiArray, "linearizer/model", self._on_model, LATCHED)
        self.create_subscription(String, "linearizer/model_yaml", self._on_yaml, LATCHED)
        if option["state_source"] == "array":
            self._heard.append(self._gathering(Float64MultiArray, "state", self._take_state, NEWEST))
        else:  # a speed that is not told is derived from all positions
            self._heard.append(self._gathering(JointState, "joint_states", self._take_joint_state, SENSOR_QOS))
        self.create_service(Trigger, "~/resume", self._on_resume)
        self._slow_timer = self.create_timer(1.0, self._on_second, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self._latest = self._due = self._not_before = 0
        self._stopped = False
        self._period = round(option["control_period"] * NANO)
        self._aside = ThreadPoolExecutor(1)
        self._made: MadeApart | None = None
        self._coming: Future[Controller | InputError] | None = None
        backward = JumpThreshold(min_forward=None, min_backward=Duration(nanoseconds=-1), on_clock_change=True)
        self._jump = self.get_clock().create_jump_callback(backward, post_callback=self._on_jump)
        on_change(self, self._try_changes, self._apply_changes)
        self.get_logger().info(f"{option['design']}, tracks {option['track']}, |input| up to {option['limit']:g}")

    def _check_position(self) -> None:
        known = self.model.plant.position in self.model.states or self.options["state_source"] == "joint_state"
        if self.options["track"] == "position" and not known:
            raise InputError(
                "track: position needs with_position: true in the model file, or state_source: joint_state"
            )

    # ---------------------------------------------------------------- messages

    def _gathering(self, kind: type, topic: str, take: Callable[[Any, int], None], qos: QoSProfile) -> Gathering:
        """Subscribe to a topic that is looked at before every input, with the times at which messages were sent."""
        return Gathering(self, kind, topic, take, qos, lambda: 0.0, sent=True, waking=False)

    def _take_reference(self, message: Float64MultiArray, sent: int) -> None:
        length = min(max(len(message.data), 1), LONGEST_REFERENCE)
        self.logic.take_reference(convert.read_vector(message, length), sent)

    def _take_state(self, message: Float64MultiArray, sent: int) -> None:
        self.logic.take_state(convert.read_vector(message, len(self.logic.measured)), sent)

    def _take_joint_state(self, message: JointState, _: int) -> None:
        joint, now = convert.read_joint(message, self.options["joint_name"]), self.now()
        self.logic.take_measured(joint, self.stamp_of(message, now), now)

    def _on_model(self, message: Float64MultiArray) -> None:
        fault = convert.layout_fault(message.layout, len(message.data))
        if not fault:
            with self._turns.lock:
                self.logic.take_model(message.data)

    def _on_yaml(self, message: String) -> None:
        with self._turns.lock:
            model = self.logic.announce(message.data)
            if model is not None:
                self._coming = self._aside.submit(self._prepared, model)

    def _prepared(self, model: Model) -> Controller | InputError:
        """Return a controller for a model, or why there is none; what it takes to compile is compiled elsewhere."""
        self._made = MadeApart(model, self.logic.settings)
        self._made.wait()
        return self.logic.prepared(model)

    def _on_period(self) -> None:
        if self.now() >= self._not_before:
            self._step()

    def _step(self) -> None:
        """Take what is newest, and publish an input."""
        self._due = self.now() + self._period
        for heard in self._heard:  # what waits is newer than what was taken, and the executor's turn may have been late
            heard.pump()
        if self._coming is not None and self._coming.done():
            self.logic.take_prepared(self._coming.result())
            self._coming = None
        u = self.logic.output(self.now())
        if u is not None:
            self._input.publish(convert.vector(u, "input"))
        was_stopped, self._stopped = self._stopped, self.logic.stopped
        if self._stopped and not was_stopped:  # who watches must not wait for the second to end
            self._tell(self.now())

    def _on_resume(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        with self._turns.lock:
            was = self.logic.resume()
        response.success = bool(was)
        response.message = f"goes on after: {was}" if was else "there is no fault to go on after"
        self.get_logger().info(response.message)
        return response

    def destroy_node(self) -> None:
        """Leave the drive without input."""
        self._turns.stop()
        if self.logic.active:
            self._input.publish(convert.vector([0.0], "input"))
        self._aside.shutdown(wait=False, cancel_futures=True)
        if self._made is not None:
            self._made.stop()
        super().destroy_node()

    # ---------------------------------------------------------------- time

    def _on_jump(self, _: Any) -> None:
        self.get_logger().warning("the clock has jumped back or changed: stopping and starting anew")
        if self.logic.active:
            self._input.publish(convert.vector([0.0], "input"))
        with self._turns.lock:
            self.logic.reset()
        self._due = self._not_before = 0
        self._turns.restart()

    def _on_second(self) -> None:
        now = self.now()
        if now < self._latest:  # the system's clock was set back: no jump callback tells of that
            self._on_jump(None)
        self._latest = now
        with self._turns.lock:
            self._tell(now)

    def _tell(self, now: int) -> None:
        """Publish diagnostics."""
        health = self.logic.health(now)
        if self.logic.channels.sentence:
            self.warn_once("channels", self.logic.channels.sentence)
        status = DiagnosticStatus(
            level=bytes([health.level]),
            name=f"{self.get_fully_qualified_name()}: control",
            message=health.message,
            hardware_id=self.hardware_id,
            values=[KeyValue(key=key, value=value) for key, value in health.values.items()],
        )
        self._diagnostics.publish(DiagnosticArray(header=Header(stamp=convert.stamp_of(now)), status=[status]))

    # ---------------------------------------------------------------- parameters

    def _try_changes(self, changes: dict[str, Any]) -> None:
        for name, value in changes.items():
            if name in OPTIONS:
                OPTIONS[name].check(name, value)
        settings = settings_of({**self.options, **changes})
        self._changed = self._beside(lambda: Controller(self.logic.model, settings))

    def _beside(self, work: Callable[[], Controller]) -> Controller:
        """Do what takes its time beside the loop; where its turns are the executor's, they go on in this callback."""
        if self._turns.in_thread:
            return work()
        with ThreadPoolExecutor(1) as pool:
            future = pool.submit(work)
            while not future.done():
                wait([future], timeout=max(min((self._due - self.now()) / NANO, LONGEST_WAIT), 0.0))
                if self.now() >= self._due:
                    self._step()
            self._not_before = self._due - self._period // 2  # the timer's turn has been taken
            return future.result()

    def _apply_changes(self, changes: dict[str, Any]) -> None:
        with self._turns.lock:
            self.options |= {name: value for name, value in changes.items() if name in OPTIONS}
            self.logic.use(self._changed)


def main() -> int:
    """Run the node; return the exit code."""
    sys.setswitchinterval(SWITCH_TIME)
    return run("controller", ControllerNode)
