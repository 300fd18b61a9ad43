"""A subscriber that tells a page what a running system does: one line of JSON some twenty times a second.

A process of its own, so that the page's server imports no rclpy:

    python -m signlin_ros.nodes.feed --namespace / --joint joint

Reads one line of JSON at a time on standard input: ``{"take": 30, "file": "...", "names": [...]}`` writes the last 30 s
as a record. Ends with its standard input.
"""

from __future__ import annotations

import argparse
import json
import struct
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import rclpy
from numpy.typing import NDArray
from rclpy.executors import SingleThreadedExecutor
from rclpy.serialization import deserialize_message
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String

from signlin_ros.nodes import convert
from signlin_ros.nodes.feed_logic import Feed
from signlin_ros.nodes.qos import LATCHED, SENSOR_QOS
from signlin_ros.nodes.told import Refusal
from signlin_ros.records import Record, Signal, write_record

Array = NDArray[np.float64]

FRAME_RATE = 20.0
"""Frames a second."""


class FeedNumbers:
    """Reads the numbers of serialized Float64MultiArray messages.

    The first of every length is read in full, to know where its numbers begin; in those that follow they stand there.
    """

    def __init__(self) -> None:
        self._begin: dict[int, tuple[int, bytes]] = {}

    def __call__(self, raw: bytes) -> Array | None:
        """Return the values (n,), None where the message does not read."""
        known = self._begin.get(len(raw))
        if known is not None and raw[: known[0]] == known[1]:
            return np.frombuffer(raw, dtype="<f8", offset=known[0])
        try:
            data = np.array(deserialize_message(raw, Float64MultiArray).data, dtype=float)
        except (RuntimeError, ValueError):
            return None
        begin = len(raw) - 8 * data.size
        if begin > 0 and raw[begin:] == struct.pack(f"<{data.size}d", *data):
            self._begin[len(raw)] = (begin, raw[:begin])
        return data


class Subscriber:
    """The node: everything that a linearizer (and a monitor) subscribes or publishes, put into a `Feed`."""

    def __init__(self, namespace: str, linearizer: str, joint: str) -> None:
        self.feed, self.texts = Feed(), dict[str, str]()
        self.joint, self._read = joint, {"state": FeedNumbers(), "input": FeedNumbers()}
        self.node = rclpy.create_node("workbench_feed", namespace=namespace or None, use_global_arguments=False)
        subscribe = self.node.create_subscription
        for name, channel in (("state", self.feed.state), ("input", self.feed.input)):
            subscribe(Float64MultiArray, name, self._taker(name, channel), SENSOR_QOS, raw=True)
        subscribe(JointState, "joint_states", self._on_joint, SENSOR_QOS)
        subscribe(Float64MultiArray, f"{linearizer}/model", self._on_model, LATCHED)
        for topic in (f"{linearizer}/model_yaml", "monitor/verdict"):
            subscribe(String, topic, self._on_text(topic), LATCHED)

    def _taker(self, name: str, channel: Any) -> Callable[[bytes], None]:
        read = self._read[name]

        def take(raw: bytes) -> None:
            values = read(raw)
            if values is not None:
                channel.put(time.time(), values)

        return take

    def _on_joint(self, message: JointState) -> None:
        if self.feed.state.count:  # an array tells more than a joint does
            return
        found = convert.read_joint(message, self.joint)
        if not isinstance(found, Refusal):
            self.feed.state.put(time.time(), np.array([found[k] for k in ("position", "velocity") if k in found]))

    def _on_model(self, message: Float64MultiArray) -> None:
        found = convert.read_model(message)
        result = getattr(found, "result", None)
        if result is not None:
            n, m = result.B.shape
            self.feed.take_model(time.time(), n, m, bool(result.in_valid_range), (result.A, result.B, result.c))

    def _on_text(self, topic: str) -> Callable[[String], None]:
        def keep(message: String) -> None:
            self.texts[topic.rsplit("/", 1)[-1]] = message.data

        return keep

    def frame(self) -> dict[str, Any]:
        """Return the next frame; texts go out once."""
        texts, self.texts = self.texts, {}
        return {**self.feed.frame(time.time()), **({"texts": texts} if texts else {})}

    def take(self, asked: dict[str, Any]) -> dict[str, Any]:
        """Write the last seconds as a record."""
        t, x, u = self.feed.recorded(float(asked["take"]))
        if t.size < 2:
            return {"taken": None, "why": "no state has come yet"}
        names = _names(asked.get("names"), x.shape[1], "x") + _names(asked.get("inputs"), u.shape[1], "u")
        columns = np.hstack([x, u]).T
        good = np.concatenate([[True], np.diff(t) > 0])
        signals = {name: Signal(column[good]) for name, column in zip(names, columns, strict=True)}
        write_record(Record(t[good], signals, "live"), Path(asked["file"]))
        return {"taken": asked["file"], "samples": int(good.sum())}


def _names(given: Any, count: int, letter: str) -> list[str]:
    if isinstance(given, list) and len(given) == count:
        return [str(name) for name in given]
    return [f"{letter}{i + 1}" for i in range(count)]


def _say(content: dict[str, Any]) -> None:
    sys.stdout.write(json.dumps(content) + "\n")
    sys.stdout.flush()


def _listen(asked: list[dict[str, Any]], ended: threading.Event) -> None:
    while line := sys.stdin.readline():
        asked.append(json.loads(line))
    ended.set()


def main() -> int:
    """Tell of a system until standard input ends."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--namespace", default="")
    parser.add_argument("--linearizer", default="linearizer")
    parser.add_argument("--joint", default="joint")
    options = parser.parse_args()
    asked: list[dict[str, Any]] = []
    ended = threading.Event()
    threading.Thread(target=_listen, args=(asked, ended), daemon=True).start()
    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    subscriber, executor = Subscriber(options.namespace, options.linearizer, options.joint), SingleThreadedExecutor()
    executor.add_node(subscriber.node)
    following = time.monotonic()
    while not ended.is_set():
        executor.spin_once(timeout_sec=max(following - time.monotonic(), 0.0))
        if time.monotonic() >= following:
            following = max(following + 1 / FRAME_RATE, time.monotonic())
            _say(subscriber.frame())
            while asked:
                _say(subscriber.take(asked.pop(0)))
    executor.shutdown()
    subscriber.node.destroy_node()
    rclpy.try_shutdown()
    return 0


if __name__ == "__main__":
    sys.exit(main())
