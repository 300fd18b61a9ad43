"""The node ``linearizer``: states in, A_k, B_k, c out, one model per update period.

Subscribes ``state`` or ``joint_states``, and ``input``; publishes ``~/A``, ``~/B``, ``~/c``, ``~/model`` and
``/diagnostics``.
"""

from __future__ import annotations

import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.clock import Clock, ClockType, JumpThreshold
from rclpy.duration import Duration
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, Header

from signlin_ros.estimate import StateEstimator
from signlin_ros.nodes import convert, overrides
from signlin_ros.nodes.joint import measured_states
from signlin_ros.nodes.linearizer_logic import NANO, LinearizerLogic, Refusal, Update, checked_linearizer
from signlin_ros.nodes.overrides import Entry
from signlin_ros.nodes.parameters import ModelNode, on_change
from signlin_ros.nodes.qos import LATCHED, SENSORS
from signlin_ros.nodes.runner import run

OPTIONS = {
    "state_source": Entry("array", "where states come from", choices=("array", "joint_state")),
    "joint_name": Entry("joint", "name of the joint in joint_states"),
    "state_timeout": Entry(
        0.0,
        "age of the state [s] above which nothing is published; 0: three update periods",
        0.0,
        1e6,
        read_only=False,
    ),
}
CLOCK_PATIENCE = 5.0
"""Seconds without /clock, with use_sim_time, after which that is said."""


class LinearizerNode(ModelNode):
    """Reads messages into `LinearizerLogic` and publishes what comes out."""

    def __init__(self) -> None:
        super().__init__("linearizer", OPTIONS, follows=True)
        self.logic = LinearizerLogic(self.model, self.now(), self.options["state_timeout"])
        self.joint = self.options["joint_name"]
        self._publish_to = {name: self.create_publisher(Float64MultiArray, f"~/{name}", LATCHED) for name in "ABc"}
        self._publish_to["model"] = self.create_publisher(Float64MultiArray, "~/model", LATCHED)
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self.create_subscription(Float64MultiArray, "input", self._on_input, SENSORS)
        if self.options["state_source"] == "array":
            self.create_subscription(Float64MultiArray, "state", self._on_state, SENSORS)
        else:
            if self.model.plant.position in self.model.states:
                StateEstimator(self.model, [self.model.plant.position]).warm_up()
            self.create_subscription(JointState, "joint_states", self._on_joint_state, SENSORS)
        self._timer = self.create_timer(self.model.update_period, self._on_period)
        steady = Clock(clock_type=ClockType.STEADY_TIME)  # goes on where a simulated clock stands still
        self._waited = 0.0
        self._slow_timer = self.create_timer(1.0, self._on_second, clock=steady)
        self._last_refused, self._latest, self._computing = 0, 0, 0.0
        backward = JumpThreshold(min_forward=None, min_backward=Duration(nanoseconds=-1), on_clock_change=True)
        self._jump = self.get_clock().create_jump_callback(backward, post_callback=self._on_jump)
        on_change(self, self._try_changes, self._apply_changes)
        self._say_hello()

    def _say_hello(self) -> None:
        names = f"states {', '.join(self.model.states)}; inputs {', '.join(self.model.inputs)}"
        self.get_logger().info(f"{self.model.plant.name}, {self.model.linearization}; {names}")

    # ---------------------------------------------------------------- messages

    def _on_input(self, message: Float64MultiArray) -> None:
        self.logic.take_input(convert.read_vector(message, len(self.model.inputs)))

    def _on_state(self, message: Float64MultiArray) -> None:
        self.logic.take_state(convert.read_vector(message, len(self.model.states)), self.now())

    def _on_joint_state(self, message: JointState) -> None:
        joint = convert.read_joint(message, self.joint)
        values = joint if isinstance(joint, Refusal) else measured_states(self.model, joint)
        self.logic.take_measured(values, convert.nanoseconds(message.header.stamp), self.now())

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
        self.get_logger().warning("the clock has jumped back or changed: starting anew")
        self.logic.reset(self.now())
        self._timer.reset()

    def _on_second(self) -> None:
        now = self.now()
        if now < self._latest:  # the system's clock was set back: no jump callback tells of that
            self._on_jump(None)
        self._latest = now
        health = self.logic.health(now)
        shown = {**health.values, "computing and publishing [s]": f"{self._computing:.6f}"}
        values = [KeyValue(key=key, value=value) for key, value in shown.items()]
        status = DiagnosticStatus(
            level=bytes([health.level]),
            name=f"{self.get_fully_qualified_name()}: linearization",
            message=health.message,
            hardware_id=self.model.plant.name,
            values=values,
        )
        self._diagnostics.publish(DiagnosticArray(header=Header(stamp=convert.stamp_of(now)), status=[status]))
        self._warn()

    def _warn(self) -> None:
        """Say what a user would wonder about: refused messages, a simulated clock that nobody publishes."""
        total = sum(self.logic.refused.values())
        if total > self._last_refused and self.logic.last_refusal is not None:
            last = self.logic.last_refusal
            self.get_logger().warning(
                f"{total - self._last_refused} messages refused, the last: {last.kind}: {last.detail}",
                throttle_duration_sec=10.0,
            )
        self._last_refused = total
        if self.get_parameter("use_sim_time").value and self.now() == 0:
            self._waited += 1.0
            if self._waited == CLOCK_PATIENCE:
                self.get_logger().warning("use_sim_time is set, but nobody publishes /clock: no model will come")

    # ---------------------------------------------------------------- parameters

    def _try_changes(self, changes: dict[str, Any]) -> None:
        checked_linearizer(overrides.changed(self.model, changes))

    def _apply_changes(self, changes: dict[str, Any]) -> None:
        before, self.model = self.model, overrides.changed(self.model, changes)
        self.logic.state_timeout = float(changes.get("state_timeout", self.logic.state_timeout))
        self.logic.configure(self.model)
        if self.model.update_period != before.update_period:
            self.logic.restart(self.now())
            self._timer.timer_period_ns = round(self.model.update_period * NANO)
            self._timer.reset()


def main() -> int:
    """Run the node; return the exit code."""
    return run("linearizer", LinearizerNode)
