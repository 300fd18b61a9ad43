"""The node ``play``: sends a planned command to a machine, watches its limits, and records what was sent and shown.

Subscribes ``state``; publishes ``input``. Ends after the last run, or with zero as soon as a limit comes near.
"""

from __future__ import annotations

from pathlib import Path

from rclpy.clock import Clock, ClockType
from std_msgs.msg import Float64MultiArray, String

from signlin_ros.errors import InputError
from signlin_ros.files import refusal
from signlin_ros.nodes import convert
from signlin_ros.nodes.joints import refuse_arm
from signlin_ros.nodes.managed import ManagedNode
from signlin_ros.nodes.overrides import Overridable
from signlin_ros.nodes.qos import LATCHED, RELIABLE, SENSOR_QOS
from signlin_ros.nodes.runner import run
from signlin_ros.nodes.told import NANO, Refusal
from sim_nodes.playing import ABORTED, Player, read_command, read_limits

OPTIONS = {
    "command": Overridable("", "command to play: a table with t and the input, as signlin experiment writes it"),
    "limit": Overridable(0.0, "largest |input|, in its unit; must be given", 0.0, 1e9),
    "limits": Overridable(
        "", "largest |value| of states, of a position its distance from the start: speed=80,position=1.5"
    ),
    "margin": Overridable(0.05, "part of a limit before it at which the play is given up [-]", 0.0, 0.9),
    "runs": Overridable(2, "how often the command is played", 1, 100),
    "pause": Overridable(1.0, "rest before each run [s]", 0.0, 3600.0),
    "ramp": Overridable(0.1, "time in which the command fades in [s]", 0.0, 60.0),
    "state_timeout": Overridable(0.1, "age of the state [s] that ends the play", 1e-3, 60.0),
    "output": Overridable("", "record of the first run (.csv or .mcap); the second is NAME_again beside it"),
    "first_record": Overridable("", "the record that the command was planned from, for the command line that is told"),
}
AGE_PERIOD = 0.02
"""Time in s between two looks at the age of the state."""


class PlayNode(ManagedNode):
    """Reads states into a `Player` and publishes what comes out. ``~/result`` (latched) says how it ended."""

    def __init__(self) -> None:
        super().__init__("play", OPTIONS)
        refuse_arm(self.model, "play", "play the motion by the arm's own trajectory controller, and record the topics")
        self.finished = False
        self.start()

    def set_up(self) -> None:
        """Read the command and its limits."""
        option = self.options
        command = read_command(self.model, option["command"], option["limit"], option["ramp"])
        limits = read_limits(self.model, option["limits"])
        why = refusal(Path(option["output"])) if option["output"] else "missing; give a file, e.g. -p output:=run.csv"
        if why:
            raise InputError(f"output: {why}")
        timing = (option["runs"], option["pause"], option["state_timeout"], option["margin"])
        self.player = Player(self.model, command, limits, *timing)
        self._input = self.create_publisher(Float64MultiArray, "input", RELIABLE)
        self._result = self.create_publisher(String, "~/result", LATCHED)
        watched = ", ".join(f"{n} up to {v:g}" for n, v in limits.items()) or "no state"
        self.get_logger().info(f"{option['command']}: {option['runs']} runs of {command.duration:.6g} s; {watched}")

    def begin(self) -> None:
        """Wait for the first state, then play."""
        self._states = self.create_subscription(Float64MultiArray, "state", self._on_state, SENSOR_QOS)
        self._timer = self.create_timer(AGE_PERIOD, self._on_tick, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def end(self) -> None:
        """Give up, and leave the machine without input."""
        self.player.stop("it was deactivated")
        self._send(0.0)
        self.destroy_timer(self._timer)
        self.destroy_subscription(self._states)

    def take_down(self) -> None:
        """Forget the command."""
        for name in ("_input", "_result"):
            publisher = self.__dict__.pop(name, None)
            if publisher is not None:
                self.destroy_publisher(publisher)

    def _on_state(self, message: Float64MultiArray) -> None:
        if self.player.over:
            return
        x = convert.read_vector(message, len(self.model.states))
        if isinstance(x, Refusal):
            self.get_logger().warning(f"state refused: {x.detail}", throttle_duration_sec=5.0)
            return
        self._send(self.player.take(x, self.now() / NANO))
        self._end_if_over()

    def _on_tick(self) -> None:
        if self.player.over:
            return
        before = self.player.u
        u = self.player.tick(self.now() / NANO)
        if u != before:
            self._send(u)
        self._end_if_over()

    def _send(self, u: float) -> None:
        values = [u, *[0.0] * (len(self.model.inputs) - 1)]
        if "_input" in self.__dict__:
            self._input.publish(convert.vector(values, "input"))

    def _end_if_over(self) -> None:
        if not self.player.over or self.finished:
            return
        self._send(0.0)
        files = self.player.written(self.options["output"])
        told = f"aborted: {self.player.why}" if self.player.place == ABORTED else "done"
        told += f"; recorded: {', '.join(files)}" if files else "; no run is complete"
        if len(files) > 1:
            first = self.options["first_record"] or "FIRST.csv"
            told += f"; then: signlin diagnose MODEL {first} {files[0]} --validation {files[1]}"
            rivals = Path(self.options["command"]).with_suffix(".rivals.json")
            told += f" --rivals {rivals}" if rivals.exists() else ""
        (self.get_logger().error if self.player.place == ABORTED else self.get_logger().info)(told)
        self._result.publish(String(data=told))
        self.finished = True

    def destroy_node(self) -> None:
        """Leave the machine without input."""
        if self.active and not self.player.over:
            self._send(0.0)
        super().destroy_node()


def main() -> int:
    """Run the node; return the exit code."""
    return run("play", PlayNode)
