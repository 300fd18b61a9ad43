"""The node ``plant_simulator``: a non-smooth plant, ``input`` in, ``state`` and ``joint_states`` out."""

from __future__ import annotations

from collections import deque
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rclpy.clock import JumpThreshold
from rclpy.duration import Duration
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from signlin_ros.nodes import convert
from signlin_ros.nodes.gather import Gathering
from signlin_ros.nodes.joint import joint_values
from signlin_ros.nodes.overrides import Overridable
from signlin_ros.nodes.parameters import ModelNode
from signlin_ros.nodes.qos import RELIABLE, SENSOR_QOS
from signlin_ros.nodes.runner import run
from signlin_ros.nodes.told import NANO, Refusal
from signlin_ros.simulation import Stepper
from sim_nodes.measuring import Measuring
from sim_nodes.signals import INPUT_SIGNALS, input_signal

Array = NDArray[np.float64]

OPTIONS = {
    "publish_rate": Overridable(200.0, "rate of state and joint_states [Hz]", 0.1, 10_000.0),
    "noise": Overridable(0.0, "standard deviation of white noise on each published state, in its unit", 0.0, 1e9),
    "seed": Overridable(0, "seed of the noise", 0, 2**31 - 1),
    "joint_name": Overridable("joint", "name of the joint in joint_states"),
    "input_signal": Overridable("external", "what drives the plant; external: topic input", choices=INPUT_SIGNALS),
    "amplitude": Overridable(1.0, "largest value of the input signal, in the input's unit", 0.0, 1e9),
    "input_period": Overridable(1.0, "period of the input signal [s]", 1e-3, 1e6),
}
MAX_CLOCK_JUMP = 10 * NANO
"""A clock that moves on by more ns at once was set, or the machine slept: the plant stood still."""
MAX_STEPS_AT_ONCE = 20
"""Steps that are published together where the node was late; of more, the last ones."""


class PlantSimulatorNode(ModelNode):
    """Steps the exact plant along the node's clock and publishes what its sensors show.

    The input is held between messages.
    """

    def __init__(self) -> None:
        super().__init__("plant_simulator", OPTIONS)
        option = self.options
        self.random = np.random.default_rng(option["seed"])
        self.u = self.model.u0
        self._signal = input_signal(option["input_signal"], option["amplitude"], option["input_period"])
        self._states = self.create_publisher(Float64MultiArray, "state", RELIABLE)
        self._joint_states = self.create_publisher(JointState, "joint_states", RELIABLE)
        if self._signal is None:
            self._arriving = Gathering(
                self, Float64MultiArray, "input", self._take_input, SENSOR_QOS, lambda: 0.0, sent=True
            )
        else:
            self._inputs = self.create_publisher(Float64MultiArray, "input", RELIABLE)
        self._period = round(NANO / option["publish_rate"])
        Stepper(self.model).advance(self._period / NANO, self.u)  # what is compiled is compiled before time counts
        self._start(None)
        self._timer = self.create_timer(1.0 / option["publish_rate"], self._on_period)
        backward = JumpThreshold(min_forward=None, min_backward=Duration(nanoseconds=-1), on_clock_change=True)
        self._jump = self.get_clock().create_jump_callback(backward, post_callback=self._start)

    def _start(self, _: Any) -> None:
        """Begin at the initial state, at the time that it is now."""
        self.plant = Stepper(self.model, self.model.x0)
        self.measuring = Measuring(self.model, self._period / NANO, self.plant.x)
        self.origin, self.steps = self.now(), 0
        self._coming: deque[tuple[int, Array]] = deque()

    def _take_input(self, message: Float64MultiArray, came: int) -> None:
        value = convert.read_input(message, self.model)
        if isinstance(value, Refusal):
            self.get_logger().warning(f"input refused: {value.detail}", throttle_duration_sec=5.0)
        else:
            self._coming.append((came, value))

    def _on_period(self) -> None:
        if self._signal is None:
            self._arriving.pump()
        due = (self.now() - self.origin) // self._period
        if (due - self.steps) * self._period > MAX_CLOCK_JUMP:
            self.origin += (due - self.steps - 1) * self._period
            due = self.steps + 1
        for step in range(self.steps, due):
            if self._signal is not None:
                self.u[0] = self._signal(step * self._period / NANO)
            self.measuring.take(self._advanced(self.origin + step * self._period))
            self.steps = step + 1
            if due - self.steps < MAX_STEPS_AT_ONCE:
                self._publish()

    def _advanced(self, start: int) -> Array:
        """Return the state after a step from ``start`` (ns); an input acts from when it was sent."""
        end = start + self._period
        while self._coming and self._coming[0][0] < end:
            came, value = self._coming.popleft()
            if came > start:
                self.plant.advance((came - start) / NANO, self.u)
                start = came
            self.u = value
        return self.plant.advance((end - start) / NANO, self.u)

    def _publish(self) -> None:
        x = self.measuring.shown() + self.options["noise"] * self.random.standard_normal(len(self.model.states))
        joint = joint_values(self.model, dict(zip(self.model.states, x.tolist(), strict=True)), self.u)
        if self._signal is not None:
            self._inputs.publish(convert.vector(self.u, "input"))
        self._states.publish(convert.vector(x, "state"))
        if self.model.plant.name == "arm":
            self._publish_joints(x)
            return
        self._joint_states.publish(
            convert.joint_state(self.options["joint_name"], joint, self.origin + self.steps * self._period)
        )

    def _publish_joints(self, x: Array) -> None:
        """Publish all joints of an arm: positions, velocities, and the efforts that drive them."""
        names = (*self.model.states, *self.model.inputs)
        values = dict(zip(names, [*x.tolist(), *self.u.tolist()], strict=True))
        joints = [name.removesuffix(".effort") for name in self.model.inputs]
        stamp = self.origin + self.steps * self._period
        self._joint_states.publish(convert.joints_state(values, joints, stamp))


def main() -> int:
    """Run the node; return the exit code."""
    return run("plant_simulator", PlantSimulatorNode)
