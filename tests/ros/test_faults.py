"""Faults on the way and in the nodes: what is published stays right, and all come back.

A relay between plant and linearizer loses, delays, repeats, reorders and corrupts messages; nodes are killed and
started again; a diagnosis is killed midway; the clock jumps. ``make soak`` lets the first go on
for an hour (SIGNLIN_SOAK, in s).
"""

from __future__ import annotations

import copy
import heapq
import json
import math
import os
import random
import signal
from pathlib import Path
from time import monotonic
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="ROS 2 is not installed: pip install 'signlin_ros[ros]'")

from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String
from std_srvs.srv import Trigger

from signlin_ros.linearization import Linearizer
from signlin_ros.model import Model
from signlin_ros.nodes import convert

SOAK = float(os.environ.get("SIGNLIN_SOAK", "12"))
MODEL = Model.load("dc_motor").with_options(with_position=True, update_period=0.05)
FASTEST = 60.0
"""rad/s; the machine reaches 35."""


class Relay:
    """Hands messages on, with faults."""

    def __init__(self, graph: Any, namespace: str, seed: int = 1) -> None:
        self.random, self.graph = random.Random(seed), graph
        self.waiting: list[tuple[float, int, Any, Any]] = []
        self.count = 0
        self.out = graph.publisher(JointState, f"{namespace}/joint_states")
        self.out_u = graph.publisher(Float64MultiArray, f"{namespace}/input")
        graph.node.create_subscription(JointState, "/joint_states", lambda m: self.take(self.out, blind(m)), 50)
        graph.node.create_subscription(Float64MultiArray, "/input", lambda m: self.take(self.out_u, m), 50)

    def take(self, out: Any, message: Any) -> None:
        fate = self.random.random()
        if fate < 0.1:
            return
        if fate < 0.15:
            message = self.corrupted(copy.deepcopy(message))
        for _ in range(2 if fate > 0.95 else 1):
            late = self.random.uniform(0, 0.03) if fate > 0.7 else 0.0
            self.count += 1
            heapq.heappush(self.waiting, (monotonic() + late, self.count, out, message))

    def corrupted(self, message: Any) -> Any:
        bad = self.random.choice([math.nan, math.inf, 1e300, -1e9])
        if isinstance(message, Float64MultiArray):
            message.data = self.random.choice([[bad], [], [1.0, 2.0]]) if bad not in (1e300, -1e9) else []
            return message
        kind = self.random.randrange(4)
        if kind == 0:
            message.name = ["another"]
        elif kind == 1:
            message.position = []
        elif kind == 2:
            message.header.stamp.sec = max(0, message.header.stamp.sec + self.random.choice([-1000, 1000]))
        else:
            message.position = [bad]
        return message

    def pump(self) -> None:
        while self.waiting and self.waiting[0][0] <= monotonic():
            _, _, out, message = heapq.heappop(self.waiting)
            out.publish(message)


def blind(message: Any) -> Any:
    message.velocity, message.effort = [], []
    return message


def assert_right(messages: list[Any]) -> None:
    """Each model is finite, is the core's at the state beside it, and that state is one that the machine can have."""
    core = Linearizer(MODEL)
    for update in map(convert.read_model, messages):
        expected = core(update.result.x, update.result.u)
        np.testing.assert_array_equal(update.result.A, expected.A)
        assert np.isfinite(update.result.A).all()
        assert abs(update.result.x[1]) < FASTEST


def test_faults_on_the_way(graph: Any, tmp_path: Path) -> None:
    file = tmp_path / "motor.yaml"
    MODEL.save(file)
    graph.start("plant_simulator", "input_signal:=sine", "amplitude:=3", "input_period:=2.0", model=file)
    graph.start("linearizer", "state_source:=joint_state", "state_timeout:=1.0", model=file, namespace="/bad")
    models, relay = graph.models("/bad/linearizer"), Relay(graph, "/bad")

    def on(until: float, least: int) -> None:
        graph.wait(lambda: relay.pump() or (monotonic() > until and len(models) >= least), "models", SOAK + 120)

    on(monotonic() + SOAK / 2, 10)
    assert_right(models)
    graph.processes[-1].stop(signal.SIGKILL)
    models.clear()
    graph.start("linearizer", "state_source:=joint_state", "state_timeout:=1.0", model=file, namespace="/bad")
    on(monotonic() + SOAK / 2, 10)
    assert_right(models)
    assert graph.processes[-1].running
    assert "Traceback" not in graph.processes[-1].output


def test_a_slow_subscriber_stops_nobody(graph: Any) -> None:
    graph.start("plant_simulator", "input_signal:=sine")
    graph.start("linearizer", "update_period:=0.02")
    models = graph.models()
    graph.wait(lambda: len(models) > 3, "models")
    from time import sleep

    sleep(2.0)  # this peer takes nothing meanwhile: 100 models
    before = len(models)
    graph.wait(lambda: len(models) >= before + 20, "models")
    sequences = [convert.read_model(message).sequence for message in models]
    assert sequences == sorted(sequences)


def test_a_diagnosis_that_is_killed_is_told_of_and_the_clock_may_jump(graph: Any, tmp_path: Path) -> None:
    file = tmp_path / "motor.yaml"
    MODEL.save(file)
    graph.start("plant_simulator", "input_signal:=multisine", "amplitude:=3", "input_period:=5.0", model=file)
    graph.start("linearizer", model=file)
    monitor = graph.start("monitor", f"folder:={tmp_path}", model=file)
    verdicts, errors = (
        graph.collect(String, "/monitor/verdict", latched=True),
        graph.collect(Float64MultiArray, "/monitor/error"),
    )
    graph.wait(lambda: len(errors) > 5, "errors")
    n = int(errors[-1].data[2])
    assert len(errors[-1].data) == 3 + 5 * n
    refused = graph.call(Trigger, "/monitor/apply", Trigger.Request())
    assert not refused.success
    assert "diagnose" in refused.message
    recorded = graph.call(Trigger, "/monitor/record", Trigger.Request())
    assert recorded.success, recorded.message
    assert Path(recorded.message).is_file()
    assert graph.call(Trigger, "/monitor/diagnose", Trigger.Request()).success
    _kill_children(monitor.popen.pid)
    graph.wait(lambda: verdicts and json.loads(verdicts[-1].data)["state"] == "failed", "the failure told")
    count = len(errors)
    graph.wait(lambda: len(errors) > count + 5, "errors go on")
    assert monitor.running


def _kill_children(pid: int) -> None:
    import psutil

    for child in psutil.Process(pid).children():
        child.kill()


def test_the_clock_jumps_back(graph: Any) -> None:
    graph.start("plant_simulator", "input_signal:=sine", sim_time=True)
    graph.start("linearizer", sim_time=True)
    models, clock = graph.models(), graph.publisher(Clock, "/clock", depth=1)
    graph.wait(lambda: clock.get_subscription_count() == 2, "followers of the clock")
    now = 100_000_000_000

    def tick() -> bool:
        nonlocal now
        now += 20_000_000
        clock.publish(Clock(clock=convert.stamp_of(now)))
        return len(models) > count

    count = 3
    graph.wait(tick, "models")
    now, count = 5_000_000_000, len(models) + 3
    graph.wait(tick, "models after the jump")
    sequences = [convert.read_model(message).sequence for message in models]
    assert sequences == sorted(sequences)
