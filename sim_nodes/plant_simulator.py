"""The node ``plant_simulator``: a non-smooth plant, ``input`` in, ``state`` and ``joint_states`` out."""

from __future__ import annotations

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
from signlin_ros.nodes.turns import Turns
from signlin_ros.simulation import Stepper
from sim_nodes.driven import DrivenPlant
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
    "watchdog": Overridable(
        0.0, "time without an input after which the drive's is 0 [s], as a real one's; 0: it is held", 0.0, 1e6
    ),
}
LONG_GAP = 5.0
"""Seconds between two warnings of the same kind."""


class PlantSimulatorNode(ModelNode):
    """Steps the exact plant along the node's clock and publishes what its sensors show.

    The input is held between messages, up to ``watchdog`` s.
    """

    def __init__(self) -> None:
        super().__init__("plant_simulator", OPTIONS)
        option = self.options
        self.random = np.random.default_rng(option["seed"])
        self._signal = input_signal(option["input_signal"], option["amplitude"], option["input_period"])
        self._states = self.create_publisher(Float64MultiArray, "state", RELIABLE)
        self._joint_states = self.create_publisher(JointState, "joint_states", RELIABLE)
        if self._signal is None:  # what comes is looked for before every step: it need wake nobody
            self._arriving = Gathering(
                self, Float64MultiArray, "input", self._take_input, SENSOR_QOS, lambda: 0.0, sent=True, waking=False
            )
        else:
            self._inputs = self.create_publisher(Float64MultiArray, "input", RELIABLE)
        self._simulated = bool(self.get_parameter("use_sim_time").value)
        self._period = round(NANO / option["publish_rate"])
        Stepper(self.model).advance(self._period / NANO, self.model.u0)  # what is compiled is, before time counts
        self._start(None)
        self._turns = Turns(self, 1.0 / option["publish_rate"], self._on_period)
        backward = JumpThreshold(min_forward=None, min_backward=Duration(nanoseconds=-1), on_clock_change=True)
        self._jump = self.get_clock().create_jump_callback(backward, post_callback=self._start)

    def _start(self, _: Any) -> None:
        """Begin at the initial state, at the time that it is now."""
        watchdog = round(self.options["watchdog"] * NANO)
        self.driven = DrivenPlant(self.model, self._period, self.now(), watchdog, self._signal)

    def destroy_node(self) -> None:
        """End the turns first."""
        self._turns.stop()
        super().destroy_node()

    def _take_input(self, message: Float64MultiArray, sent: int) -> None:
        value = convert.read_input(message, self.model)
        if isinstance(value, Refusal):
            self.get_logger().warning(f"input refused: {value.detail}", throttle_duration_sec=LONG_GAP)
        else:
            self.driven.take(sent, value)

    def _on_period(self) -> None:
        if self._signal is None:
            self._arriving.pump()
        driven, trips = self.driven, self.driven.trips
        for _ in driven.catch_up(self.now):
            self._publish()
        if driven.trips > trips:
            sentence = f"no input for {self.options['watchdog']:g} s: the drive's is 0 until one comes (watchdog)"
            self.get_logger().warning(sentence, throttle_duration_sec=LONG_GAP)

    def _publish(self) -> None:
        """Publish the present state: in joint_states with its time; in ``state``, which has no stamp, only if new."""
        driven = self.driven
        x = driven.shown() + self.options["noise"] * self.random.standard_normal(len(self.model.states))
        if self._signal is not None:
            self._inputs.publish(convert.vector(driven.u, "input"))
        if self._simulated or driven.is_fresh(self.now()):
            self._states.publish(convert.vector(x, "state"))
        self._joint_states.publish(self._joints(x))

    def _joints(self, x: Array) -> JointState:
        """Return what joint_states show of a state (n,): of an arm all joints, and the efforts that drive them."""
        u, stamp = self.driven.u, self.driven.time
        if self.model.plant.name != "arm":
            joint = joint_values(self.model, dict(zip(self.model.states, x.tolist(), strict=True)), u)
            return convert.joint_state(self.options["joint_name"], joint, stamp)
        names = (*self.model.states, *self.model.inputs)
        values = dict(zip(names, [*x.tolist(), *u.tolist()], strict=True))
        return convert.joints_state(values, [name.removesuffix(".effort") for name in self.model.inputs], stamp)


def main() -> int:
    """Run the node; return the exit code."""
    return run("plant_simulator", PlantSimulatorNode)
