"""The node ``replay``: publishes a measured record as ``state``, ``input`` and ``joint_states``."""

from __future__ import annotations

from rclpy.clock import Clock, ClockType
from rclpy.duration import Duration
from rosgraph_msgs.msg import Clock as ClockMessage
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from signlin_ros.errors import InputError
from signlin_ros.nodes import convert
from signlin_ros.nodes.overrides import Overridable
from signlin_ros.nodes.parameters import ModelNode
from signlin_ros.nodes.qos import RELIABLE
from signlin_ros.nodes.runner import run
from signlin_ros.nodes.told import NANO
from sim_nodes.playback import Playback, Sample

OPTIONS = {
    "record": Overridable("", "record to play: CSV, MAT or rosbag2"),
    "rate": Overridable(1.0, "speed; 1: as it was measured", 1e-3, 1e3),
    "loop": Overridable(False, "start again at the end"),
    "publish_clock": Overridable(False, "publish /clock with the record's time"),
    "joint_name": Overridable("joint", "name of the joint in joint_states"),
}
MAX_SUBSCRIBER_WAIT = 5 * NANO
"""Nanoseconds to wait for a subscriber before playing to nobody."""
SETTLE = NANO // 2
"""Nanoseconds from the first subscriber to the first sample, so that the others are found too."""
MAX_SAMPLES_AT_ONCE = 100
"""Samples published before the executor gets its turn."""
LATE_NANOSECONDS = NANO // 2
"""Nanoseconds behind the record's time at which that is said."""


class ReplayNode(ModelNode):
    """Publishes samples when their time has come; ends after the last one unless ``loop`` is set."""

    def __init__(self) -> None:
        super().__init__("replay", OPTIONS)
        option = self.options
        if option["publish_clock"] and self.get_parameter("use_sim_time").value:
            raise InputError("publish_clock: the node that publishes /clock cannot follow it; leave use_sim_time out")
        self.finished = False
        self.playback = Playback(self.model, option["record"])
        self._samples = self.playback.rounds(option["loop"])
        self._next: Sample | None = next(self._samples)
        self._states = self.create_publisher(Float64MultiArray, "state", RELIABLE)
        self._inputs = self.create_publisher(Float64MultiArray, "input", RELIABLE)
        self._joint_states = self.create_publisher(JointState, "joint_states", RELIABLE)
        self._clock_out = self.create_publisher(ClockMessage, "/clock", 10) if option["publish_clock"] else None
        self._born, self._start = self.now(), 0
        tick = min(max(self.playback.step / option["rate"], 1e-3), 0.02)
        self._timer = self.create_timer(tick, self._on_tick, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self._say_hello()

    def _say_hello(self) -> None:
        play = self.playback
        for note in (*play.data.notes, *play.notes()):
            self.get_logger().info(note)
        if self._clock_out is not None and play.not_in_ros is not None:
            self.get_logger().warning(f"ROS has no time {play.not_in_ros:.10g} s: /clock begins at 0")
        size = f"{len(play.t)} samples, {play.t[-1]:.6g} s"
        self.get_logger().info(f"{play.data.source}: {size}; measured: {', '.join(play.measured)}")

    def _on_tick(self) -> None:
        now = self.now()
        if not self._start:
            heard = self._states.get_subscription_count() + self._joint_states.get_subscription_count()
            if not heard and now - self._born < MAX_SUBSCRIBER_WAIT:
                return
            self._start = now + (SETTLE if heard else 0)
        for _ in range(MAX_SAMPLES_AT_ONCE):
            if self._next is None:
                self._end()
                return
            if self._due(self._next) > now:
                return
            late = now - self._due(self._next) > LATE_NANOSECONDS
            self._publish(self._next)
            self._next = next(self._samples, None)
        if late:
            self.get_logger().warning("cannot keep up with the rate", throttle_duration_sec=10.0)

    def _due(self, sample: Sample) -> int:
        return self._start + round(sample.t / float(self.options["rate"]) * NANO)

    def _publish(self, sample: Sample) -> None:
        stamp = self._due(sample)
        if self._clock_out is not None:
            stamp = round((self.playback.clock_start + sample.t) * NANO)
            self._clock_out.publish(ClockMessage(clock=convert.stamp_of(stamp)))
        self._inputs.publish(convert.vector(sample.u, "input"))
        if sample.switch:
            return
        self._states.publish(convert.vector(sample.x, "state"))
        self._joint_states.publish(self._joints(sample, stamp))

    def _joints(self, sample: Sample, stamp: int) -> JointState:
        """Return a sample as joint states: of all joints of an arm, by their names."""
        if self.model.plant.name != "arm":
            return convert.joint_state(self.options["joint_name"], sample.joint, stamp)
        names = [name.removesuffix(".effort") for name in self.model.inputs]
        values = dict(zip((*self.model.states, *self.model.inputs), (*sample.x, *sample.u), strict=True))
        return convert.joints_state(values, names, stamp)

    def _end(self) -> None:
        self.get_logger().info("the record has ended")
        for publisher in (self._inputs, self._states, self._joint_states):
            publisher.wait_for_all_acked(Duration(seconds=1))
        self.finished = True


def main() -> int:
    """Run the node; return the exit code."""
    return run("replay", ReplayNode)
