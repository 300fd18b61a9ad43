"""A peer that listens to a plant and to linearizers and keeps what they say, with the time when it was published."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import rclpy
from numpy.typing import NDArray
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.signals import SignalHandlerOptions
from std_msgs.msg import Float64MultiArray

from signlin_ros.nodes.convert import read_model
from signlin_ros.nodes.told import NANO, Update

Array = NDArray[np.float64]
DEPTH = 1000


@dataclass(frozen=True)
class Heard:
    """What was heard: states x (T, n) and inputs u (S, m) with their times in s since the first state, and models.

    Times are those of the publishers. ``models`` holds for each linearizer (time in s of the state used, update).
    """

    t: Array
    x: Array
    u_t: Array
    u: Array
    models: Mapping[str, list[tuple[float, Update]]]


class Listener:
    """Listens in a namespace to ``state``, ``input`` and ``<linearizer>/model``; a context manager.

    Nothing happens but in `wait`, which spins until a condition holds.
    """

    def __init__(self, namespace: str, linearizers: Iterable[str]) -> None:
        self.context = Context()
        rclpy.init(context=self.context, args=[], signal_handler_options=SignalHandlerOptions.NO)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.node = rclpy.create_node("listener", namespace=namespace, context=self.context, use_global_arguments=False)
        self.executor.add_node(self.node)
        self._states: list[tuple[int, Any]] = []
        self._inputs: list[tuple[int, Any]] = []
        self._models: dict[str, list[Update]] = {name: [] for name in linearizers}
        self._subscribe("state", lambda message, info: self._states.append((info["source_timestamp"], message.data)))
        self._subscribe("input", lambda message, info: self._inputs.append((info["source_timestamp"], message.data)))
        for name, found in self._models.items():
            self._subscribe(f"{name}/model", _collector(found), DurabilityPolicy.TRANSIENT_LOCAL)

    def _subscribe(self, topic: str, callback: Any, durability: Any = DurabilityPolicy.VOLATILE) -> None:
        profile = QoSProfile(depth=DEPTH, durability=durability)
        self.node.create_subscription(Float64MultiArray, topic, callback, profile)

    def __enter__(self) -> Listener:
        return self

    def __exit__(self, *_: object) -> None:
        self.executor.shutdown()
        self.node.destroy_node()
        self.context.try_shutdown()

    # ---------------------------------------------------------------- waiting

    def wait(self, condition: Callable[[], bool], patience: float) -> bool:
        """Spin until the condition holds, at most ``patience`` s; return whether it does."""
        end = time.monotonic() + patience
        while not condition():
            if time.monotonic() > end:
                return False
            self.executor.spin_once(timeout_sec=0.05)
        return True

    @property
    def linearizers_ready(self) -> bool:
        """Whether every linearizer is there and listens to ``state`` and ``input``."""
        wanted = len(self._models) + 1  # this listener subscribes too
        subscribed = min(self.node.count_subscribers("state"), self.node.count_subscribers("input"))
        return subscribed >= wanted and all(self.node.count_publishers(f"{name}/model") for name in self._models)

    @property
    def span(self) -> float:
        """Time in s from the first to the last state heard; 0 before two of them."""
        return (self._states[-1][0] - self._states[0][0]) / NANO if self._states else 0.0

    @property
    def all_publish(self) -> bool:
        """Whether every linearizer has published a model."""
        return all(self._models.values())

    # ---------------------------------------------------------------- what was heard

    def forget(self) -> None:
        """Begin anew with what is heard from now on."""
        self._states.clear()
        self._inputs.clear()
        for found in self._models.values():
            found.clear()

    def heard(self) -> Heard:
        """Return all that was heard; there must be a state and an input."""
        origin = self._states[0][0]
        t, u_t = (np.array([stamp - origin for stamp, _ in s]) / NANO for s in (self._states, self._inputs))
        x, u = (np.array([list(data) for _, data in s]) for s in (self._states, self._inputs))
        models = {
            name: [((update.stamp - origin) / NANO, update) for update in found] for name, found in self._models.items()
        }
        return Heard(t, x, u_t, u, models)


def _collector(found: list[Update]) -> Callable[[Float64MultiArray], None]:
    return lambda message: found.append(read_model(message))
