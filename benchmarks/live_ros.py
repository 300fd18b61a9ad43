"""A machine in this process, watched over ROS 2 by a linearizer and a monitor in processes of their own.

In real time: over ROS an input carries no stamp, so the monitor takes the time at which it was sent, and simulated time
would have it wrong by what gathers in a waking of the node. This process runs the machine for as long as has passed,
publishes what the encoder shows and the input, and waits for the monitor's word. The input acts from when the
middleware says that it was sent, however busy this computer is. ``ROS_DOMAIN_ID`` keeps several apart.
"""

from __future__ import annotations

import json
import os
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from signlin_ros.demo.live import LIVE_NAMESPACE, LiveProcesses
from signlin_ros.model import Model

NANO = 1_000_000_000
SHORTEST = 1e-6
"""Seconds that a machine is run for at least."""
PATIENCE, SETTLED = 60.0, 3.0
"""Seconds to wait for the nodes at most, and until they know the model."""


def watched(
    rig: Any, model: Model, change: str, onset: float, length: float, learn: float, rate: float, naming: bool
) -> tuple[float | None, float | None, list[str]]:
    """Return when the monitor has called a change, and when it says that it began, in s, None where it has not; names.

    ``rig`` has ``look(t)``, ``go_on(span)`` and ``change(what)``.
    """
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    with tempfile.TemporaryDirectory(prefix="signlin_changes_") as work:
        folder = Path(work)
        model.save(folder / "model.yaml")
        processes = LiveProcesses(folder)
        peer = None
        try:
            joint = "state_source:=joint_state"
            processes.start("linearizer", folder / "model.yaml", joint)
            processes.start("monitor", folder / "model.yaml", joint, f"learn:={learn}", f"folder:={folder}")
            peer = Peer(processes.check)
            return peer.run(rig, change, onset, length, 1.0 / rate, naming)
        finally:
            if peer is not None:
                peer.close()
            processes.stop()


class Peer:
    """The machine's side: publishes what it shows and its input, and hears what the monitor says."""

    def __init__(self, check: Callable[[], None]) -> None:
        import rclpy
        from rclpy.context import Context
        from rclpy.executors import SingleThreadedExecutor
        from rclpy.signals import SignalHandlerOptions
        from sensor_msgs.msg import JointState
        from std_msgs.msg import Float64MultiArray, String

        self.check, self.said = check, list[tuple[float, dict[str, Any]]]()
        self.context = Context()
        rclpy.init(context=self.context, args=[], signal_handler_options=SignalHandlerOptions.NO)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.node = rclpy.create_node(
            "machine", namespace=LIVE_NAMESPACE, context=self.context, use_global_arguments=False
        )
        self.executor.add_node(self.node)
        self.node.create_subscription(String, "monitor/verdict", self._on_verdict, 10)
        self._joint = self.node.create_publisher(JointState, "joint_states", 50)
        self._input = self.node.create_publisher(Float64MultiArray, "input", 50)
        self._aside = rclpy.create_node(
            "aside", namespace=LIVE_NAMESPACE, context=self.context, use_global_arguments=False
        )
        self._own = self._aside.create_subscription(Float64MultiArray, "input", lambda message: None, 50)
        self._held: float | None = None
        self._shown, self._u = JointState(name=["joint"], position=[0.0]), Float64MultiArray(data=[0.0])

    def close(self) -> None:
        """Leave the graph."""
        self.executor.shutdown()
        self.node.destroy_node()
        self._aside.destroy_node()
        self.context.try_shutdown()

    def _on_verdict(self, message: Any) -> None:
        self.said.append((time.time(), json.loads(message.data)))

    def run(
        self, rig: Any, change: str, onset: float, length: float, step: float, naming: bool
    ) -> tuple[float | None, float | None, list[str]]:
        """Run the machine until the monitor calls or names a change, or for ``length`` s: when, since when, names."""
        self._wait()
        begun = last = time.time()
        rig.look(0.0)
        changed = False
        while not self._heard("named" if naming else "changed") and last - begun < length:
            self._spend(begun + step * (int((last - begun) / step) + 1))
            if change and not changed and last - begun >= onset:
                rig.change(change)
                changed = True
            last = self._sample(rig, begun, last)
        self.check()
        called, named = self._heard("changed"), self._heard("named")
        names = [name["name"] for name in named[0][1]["names"]] if named else []
        return (called[0][0] - begun, called[0][1]["since"] - begun, names) if called else (None, None, [])

    def _heard(self, state: str) -> list[tuple[float, dict[str, Any]]]:
        return [(when, said) for when, said in self.said if said["state"] == state]

    def _wait(self) -> None:
        end = time.monotonic() + PATIENCE
        while min(self._joint.get_subscription_count(), self._input.get_subscription_count() - 1) < 2:
            self.check()
            if time.monotonic() > end:
                raise TimeoutError("linearizer and monitor do not listen")
            self.executor.spin_once(timeout_sec=0.1)
        self._spend(time.time() + SETTLED)

    def _spend(self, until: float) -> None:
        """Hear what comes up to a time."""
        while (left := until - time.time()) > 0.0:
            self.executor.spin_once(timeout_sec=left)

    def _sample(self, rig: Any, begun: float, last: float) -> float:
        """Bring the machine to now, and publish what it shows and its input; returns the time."""
        now = max(time.time(), last + SHORTEST)
        if self._held is not None:  # the input before the last one, until that was sent
            sent = min(max(self._sent(), last + SHORTEST / 4), now - SHORTEST / 4)
            rig.plant.advance(sent - last, [rig.gain * self._held])
            last = sent
        rig.go_on(now - last)
        self._held = rig.u
        shown, self._u.data[0] = rig.look(now - begun)
        self._shown.position[0] = shown
        self._shown.header.stamp.sec, self._shown.header.stamp.nanosec = divmod(round(now * NANO), NANO)
        self._joint.publish(self._shown)
        self._input.publish(self._u)
        return now

    def _sent(self) -> float:
        """Return when the last input was sent."""
        with self._own.handle:
            while (found := self._own.handle.take_message(self._own.msg_type, False)) is None:
                time.sleep(1e-4)
        return float(found[1]["source_timestamp"]) / NANO


__all__ = ["watched"]
