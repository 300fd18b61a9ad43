"""The controller as a process: it tracks, takes a new model, and stops."""

from __future__ import annotations

import os
import signal
import sys
from pathlib import Path
from time import monotonic
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="ROS 2 is not installed: pip install 'signlin_ros[ros]'")

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.qos import DurabilityPolicy, QoSProfile
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String
from std_srvs.srv import Trigger

from signlin_ros.linearization import Linearizer
from signlin_ros.model import Model
from signlin_ros.nodes import convert
from signlin_ros.nodes.told import NANO, Update
from signlin_ros.simulation import Stepper

EXECUTABLE = Path(sys.prefix) / "lib" / "signlin_ros" / "controller"
pytestmark = pytest.mark.skipif(not EXECUTABLE.exists(), reason="the package is not installed with a controller")


PERIOD = 20_000_000
PATIENCE = 300.0
"""Seconds for a first start, which compiles."""
MODEL = Model.load("dc_motor")


class Rig:
    """A plant, a linearizer and a reference for one controller, in simulated time: one tick, one input, one step.

    Nothing goes by the wall clock, so that a busy machine changes nothing.
    """

    def __init__(self, graph: Any, *parameters: str, model: str | Path = "dc_motor.yaml") -> None:
        numbers = ("limit:=12.0", "largest_speed:=5.0", "bandwidth:=8.0")
        self.process = graph.start("controller", *numbers, *parameters, model=model, sim_time=True)
        graph.wait(lambda: graph.node.count_subscribers("/state"), "the controller", PATIENCE)
        self.graph, self.plant, self.now, self.u = graph, Stepper(MODEL), 10 * NANO, 0.0
        self.gain = 1.0
        self.inputs = graph.collect(Float64MultiArray, "/input")
        kinds = {"/reference": Float64MultiArray, "/state": Float64MultiArray, "/clock": Clock}
        self.publish = {topic: graph.publisher(kind, topic).publish for topic, kind in kinds.items()}
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.model = graph.node.create_publisher(Float64MultiArray, "/linearizer/model", latched)
        self.yaml = graph.node.create_publisher(String, "/linearizer/model_yaml", latched)
        self.linear = Linearizer(MODEL)(np.zeros(2))
        self._set_clock()

    def _set_clock(self) -> None:
        self.publish["/clock"](Clock(clock=convert.stamp_of(self.now)))
        self.graph.spin(0.2)

    def tick(self, reference: bool = True) -> float:
        """One control period; return the error of the speed before it."""
        t, w = self.now / NANO, 2 * np.pi / 2.0
        v, a = 3.0 * np.sin(w * t), 3.0 * w * np.cos(w * t)
        if reference:
            self.publish["/reference"](Float64MultiArray(data=[v, a]))
        self.publish["/state"](Float64MultiArray(data=self.plant.x.tolist()))
        self.model.publish(convert.model_message(Update(self.now, 0, self.linear)))
        self.graph.spin(0.01)
        self.now += PERIOD
        count = len(self.inputs)
        self.publish["/clock"](Clock(clock=convert.stamp_of(self.now)))
        end = monotonic() + 0.5
        while len(self.inputs) == count and monotonic() < end:  # before the first run nothing is sent
            self.graph.executor.spin_once(timeout_sec=0.01)
        error = v - float(self.plant.x[1])
        self.plant.advance(PERIOD / NANO, [self.gain * self.u])
        self.u = float(self.inputs[-1].data[0]) if self.inputs else 0.0
        return error

    def rms(self, ticks: int) -> float:
        return float(np.sqrt(np.mean(np.square([self.tick() for _ in range(ticks)]))))


def test_it_tracks_stops_without_a_reference_and_ends_cleanly(graph):
    rig = Rig(graph)
    rig.rms(100)
    assert rig.rms(200) < 0.3 * 3.0 / np.sqrt(2)
    assert all(abs(m.data[0]) <= 12.0 for m in rig.inputs)
    for _ in range(30):
        rig.tick(reference=False)
    assert [m.data[0] for m in rig.inputs[-3:]] == [0.0, 0.0, 0.0]
    diagnostics = graph.collect(DiagnosticArray, "/diagnostics")
    assert graph.diagnostics(diagnostics, "stopped: the reference", "/controller").level == b"\x02"
    assert rig.process.stop(signal.SIGINT) == 0


def test_it_takes_the_model_of_the_linearizer_while_it_runs(graph, tmp_path):
    bare = tmp_path / "bare.yaml"
    MODEL.without_effect("coulomb_friction").save(bare)
    rig = Rig(graph, "design:=along_reference", model=bare)  # one that does not learn what the model lacks
    rig.rms(100)
    before = rig.rms(200)
    rig.yaml.publish(String(data=MODEL.to_yaml()))
    graph.wait(lambda: rig.rms(200) < 0.6 * before, "the feed-forward of the new model", PATIENCE)


def test_a_drive_that_runs_away_is_stopped_told_and_goes_on_when_it_is_asked_to(graph):
    rig = Rig(graph)
    rig.rms(100)
    rig.gain = -1.0
    diagnostics = graph.collect(DiagnosticArray, "/diagnostics")
    graph.wait(lambda: rig.tick() is not None and rig.inputs[-1].data[0] == 0.0, "a stop")
    stop = rig.now
    for _ in range(50):
        rig.tick()
    assert {m.data[0] for m in rig.inputs[-50:]} == {0.0}
    told = [convert.nanoseconds(m.header.stamp) for m in diagnostics if b"\x02" in [s.level for s in m.status]]
    assert told
    assert min(told) <= stop + 2 * PERIOD
    assert abs(rig.plant.x[1]) < 3.0 * 3.0
    status = graph.diagnostics(diagnostics, "stopped: the drive", "/controller")
    assert status.level == b"\x02"
    assert "~/resume" in status.message
    rig.gain = 1.0
    rig.rms(100)
    assert {m.data[0] for m in rig.inputs[-20:]} == {0.0}
    answer = graph.call(Trigger, "/controller/resume", Trigger.Request())
    assert answer.success
    assert "goes on after: the drive" in answer.message
    rig.rms(50)
    assert rig.rms(200) < 0.3 * 3.0 / np.sqrt(2)
    assert not graph.call(Trigger, "/controller/resume", Trigger.Request()).success


def test_a_bandwidth_that_does_not_hold_ends_the_node_with_the_largest_that_does(graph):
    process = graph.start("controller", "limit:=12.0", "bandwidth:=30.0")
    graph.wait(lambda: not process.running, "the end", PATIENCE)
    assert process.popen.returncode == 2
    assert "the largest that holds is 21.6 rad/s" in process.output


def test_without_a_limit_it_does_not_start(graph):
    process = graph.start("controller")
    graph.wait(lambda: not process.running, "the end", PATIENCE)
    assert process.popen.returncode == 2
    assert "limit: found 0; say the largest |input|" in process.output


def test_design_and_bandwidth_change_at_run_time_and_nonsense_is_refused(graph):
    graph.start("controller", "limit:=12.0", "largest_speed:=5.0")
    graph.wait(lambda: graph.node.count_subscribers("/state"), "the controller", PATIENCE)
    assert graph.set_parameter("design", "friction_free", "/controller").successful
    assert graph.set_parameter("bandwidth", 10.0, "/controller").successful
    result = graph.set_parameter("design", "lqg", "/controller")
    assert not result.successful
    assert "along_reference" in result.reason
    assert not graph.set_parameter("limit", 5.0, "/controller").successful


def test_after_a_pause_it_takes_the_newest_state_and_not_those_that_have_queued_up(graph):
    joint = ("limit:=12.0", "largest_speed:=5.0", "state_source:=joint_state", "state_timeout:=1.0")
    process = graph.start("controller", *joint, model="dc_motor.yaml")
    graph.wait(lambda: graph.node.count_subscribers("/joint_states"), "the controller", PATIENCE)
    states, health = graph.publisher(JointState, "/joint_states"), graph.collect(DiagnosticArray, "/diagnostics")

    def shown() -> None:
        now = graph.node.get_clock().now().nanoseconds
        states.publish(convert.joint_state("joint", {"position": 0.0, "velocity": 1.0}, now))
        graph.spin(0.02)

    def values() -> dict[str, str]:
        return {v.key: v.value for v in health[-1].status[0].values} if health else {}

    def taken() -> bool:
        shown()
        return float(values().get("age of the state [s]", "inf")) < 1.0

    graph.wait(taken, "a state to be taken", PATIENCE)
    before = int(values()["messages refused"])
    os.kill(process.popen.pid, signal.SIGSTOP)
    end = monotonic() + 3.0  # more than the state may be old
    while monotonic() < end:
        shown()
    os.kill(process.popen.pid, signal.SIGCONT)
    health.clear()
    graph.wait(taken, "the newest state to be taken", PATIENCE)
    assert int(values()["messages refused"]) - before < 10  # of a hundred
