"""The node ``controller``: references and states in, the input of the drive out, friction fed forward.

Subscribes ``reference``, ``state`` or ``joint_states``, ``linearizer/model`` and ``linearizer/model_yaml``; publishes
``input`` and ``/diagnostics``.
"""

from __future__ import annotations

from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.clock import Clock, ClockType, JumpThreshold
from rclpy.duration import Duration
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, Header, String

from signlin_ros.control.controller import Controller, ControllerSettings
from signlin_ros.control.designs import DEFAULT_DESIGN, DESIGNS
from signlin_ros.errors import InputError
from signlin_ros.nodes import convert
from signlin_ros.nodes.controller_logic import LONGEST_REFERENCE, ControllerLogic, Timeouts
from signlin_ros.nodes.joints import refuse_arm
from signlin_ros.nodes.overrides import Overridable
from signlin_ros.nodes.parameters import ModelNode, on_change
from signlin_ros.nodes.qos import LATCHED, NEWEST, RELIABLE
from signlin_ros.nodes.runner import run

OPTIONS = {
    "design": Overridable(DEFAULT_DESIGN, "how the input is made", choices=tuple(DESIGNS), read_only=False),
    "track": Overridable("speed", "what a reference is", choices=("speed", "position")),
    "control_period": Overridable(0.02, "time between two inputs [s]", 1e-3, 10.0),
    "limit": Overridable(0.0, "largest |input|, in its unit; must be given", 0.0, 1e9),
    "loop_delay": Overridable(
        0.0, "from a sample until its input acts [s]; 0: one period, and the model's delay", 0.0, 10.0
    ),
    "largest_speed": Overridable(0.0, "of the references; 0: what the model is made for", 0.0, 1e9),
    "tolerance_at_rest": Overridable(
        0.0, "error that may stay where the reference stands still", 0.0, 1e9, read_only=False
    ),
    "bandwidth": Overridable(
        0.0, "of the feedback [rad/s]; 0: what the delay leaves room for", 0.0, 1e5, read_only=False
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
    "state_source": Overridable("array", "where states come from", choices=("array", "joint_state")),
    "joint_name": Overridable("joint", "name of the joint in joint_states"),
    "state_timeout": Overridable(0.0, "age of the state [s] that stops the drive; 0: three control periods", 0.0, 1e6),
    "reference_timeout": Overridable(0.0, "age of the reference [s] that stops the drive; 0: 0.5 s", 0.0, 1e6),
    "model_timeout": Overridable(0.0, "age of the model [s] that stops the drive; 0: three update periods", 0.0, 1e6),
    "needs_model": Overridable(True, "whether a linearizer must be publishing"),
}
INSTEAD = "signlin gains prints each joint's feed-forward for the arm's own controller"
"""What there is for an arm."""
SETTINGS_OPTIONS = ("design", "limit", "bandwidth", "damping", "integral", "floor", "turning")
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
    """Return what the options of the node say of the controller; raise `InputError` where a limit is missing."""
    named = {setting: options[option] for option, setting in RENAMED_OPTIONS.items()}
    return ControllerSettings(
        position=options["track"] == "position", **named, **{name: options[name] for name in SETTINGS_OPTIONS}
    )


class ControllerNode(ModelNode):
    """Reads messages into `ControllerLogic` and publishes what comes out."""

    def __init__(self) -> None:
        super().__init__("controller", OPTIONS)
        refuse_arm(self.model, "controller", INSTEAD)
        self._check_position()
        option = self.options
        timeouts = Timeouts(option["state_timeout"], option["reference_timeout"], option["model_timeout"])
        self.logic = ControllerLogic(self.model, settings_of(option), timeouts, option["needs_model"])
        self._input = self.create_publisher(Float64MultiArray, "input", RELIABLE)
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self.create_subscription(Float64MultiArray, "reference", self._on_reference, NEWEST)
        self.create_subscription(Float64MultiArray, "linearizer/model", self._on_model, LATCHED)
        self.create_subscription(String, "linearizer/model_yaml", self._on_yaml, LATCHED)
        if option["state_source"] == "array":
            self.create_subscription(Float64MultiArray, "state", self._on_state, NEWEST)
        else:
            self.create_subscription(JointState, "joint_states", self._on_joint_state, NEWEST)
        self._timer = self.create_timer(option["control_period"], self._on_period)
        self._slow_timer = self.create_timer(1.0, self._on_second, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self._latest = 0
        self._aside = ThreadPoolExecutor(1)
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

    def _on_reference(self, message: Float64MultiArray) -> None:
        length = min(max(len(message.data), 1), LONGEST_REFERENCE)
        self.logic.take_reference(convert.read_vector(message, length), self.now())

    def _on_state(self, message: Float64MultiArray) -> None:
        self.logic.take_state(convert.read_vector(message, len(self.logic.measured)), self.now())

    def _on_joint_state(self, message: JointState) -> None:
        joint = convert.read_joint(message, self.options["joint_name"])
        self.logic.take_measured(joint, convert.nanoseconds(message.header.stamp), self.now())

    def _on_model(self, message: Float64MultiArray) -> None:
        fault = convert.layout_fault(message.layout, len(message.data))
        if not fault:
            self.logic.take_model(message.data)

    def _on_yaml(self, message: String) -> None:
        model = self.logic.announce(message.data)
        if model is not None:
            self._coming = self._aside.submit(self.logic.prepared, model)

    def _on_period(self) -> None:
        if self._coming is not None and self._coming.done():
            self.logic.take_prepared(self._coming.result())
            self._coming = None
        u = self.logic.output(self.now())
        if u is not None:
            self._input.publish(convert.vector(u, "input"))

    def destroy_node(self) -> None:
        """Leave the drive without input."""
        if self.logic.active:
            self._input.publish(convert.vector([0.0], "input"))
        self._aside.shutdown(wait=False, cancel_futures=True)
        super().destroy_node()

    # ---------------------------------------------------------------- time

    def _on_jump(self, _: Any) -> None:
        self.get_logger().warning("the clock has jumped back or changed: stopping and starting anew")
        if self.logic.active:
            self._input.publish(convert.vector([0.0], "input"))
        self.logic.reset()
        self._timer.reset()

    def _on_second(self) -> None:
        now = self.now()
        if now < self._latest:  # the system's clock was set back: no jump callback tells of that
            self._on_jump(None)
        self._latest = now
        health = self.logic.health(now)
        status = DiagnosticStatus(
            level=bytes([health.level]),
            name=f"{self.get_fully_qualified_name()}: control",
            message=health.message,
            hardware_id=self.model.plant.name,
            values=[KeyValue(key=key, value=value) for key, value in health.values.items()],
        )
        self._diagnostics.publish(DiagnosticArray(header=Header(stamp=convert.stamp_of(now)), status=[status]))

    # ---------------------------------------------------------------- parameters

    def _try_changes(self, changes: dict[str, Any]) -> None:
        for name, value in changes.items():
            if name in OPTIONS:
                OPTIONS[name].check(name, value)
        ControllerLogic(self.logic.model, settings_of({**self.options, **changes}))

    def _apply_changes(self, changes: dict[str, Any]) -> None:
        self.options |= {name: value for name, value in changes.items() if name in OPTIONS}
        self.logic.configure(self.logic.model, settings_of(self.options))


def main() -> int:
    """Run the node; return the exit code."""
    return run("controller", ControllerNode)
