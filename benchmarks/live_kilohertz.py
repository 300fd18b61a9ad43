"""States at 1 kHz under all nodes for minutes: are updates in time, does memory stay flat, what does each node take?

    python benchmarks/live_kilohertz.py --minutes 10

Simulator, linearizer, monitor and controller run as processes, beside a node that only has a timer of the update period
and one that only subscribes to the states. An update is as late as it is off the grid of update periods which the
middle of all of them lies on; times are those at which the middleware sent them.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from measure import Report
from ros_latency import BARE, MOST_SHARE, NANO, PERIOD, RATE, Tap, cpu, environment, pause

from signlin_ros.demo.live import LIVE_NAMESPACE, LiveProcesses
from signlin_ros.model import Model
from signlin_ros.warming import warm_up

TIMER = f"""
import rclpy
from rclpy.clock import Clock, ClockType
from rclpy.signals import SignalHandlerOptions
from std_msgs.msg import Float64MultiArray
rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
node = rclpy.create_node("bare_timer", namespace="{LIVE_NAMESPACE}")
publisher = node.create_publisher(Float64MultiArray, "bare_timer", 50)
steady = Clock(clock_type=ClockType.STEADY_TIME)
node.create_timer({PERIOD}, lambda: publisher.publish(Float64MultiArray()), clock=steady)
rclpy.spin(node)
"""
SETTLED, IN_TIME, SHARE = 180.0, 0.010, 0.999
"""Seconds until memory is looked at first, when all that nodes keep is full; seconds within which an update is in time,
and the part of them that has to be."""
REFERENCE, SPEED, WAVE, LIMIT = 0.02, 4.0, 6.0, 8.0
"""Period of the reference's messages in s, its largest speed in rad/s and its period in s; the largest voltage."""
LISTENED = 0.1
"""Seconds between two looks at what has come."""


def main() -> None:
    """Run all nodes for some minutes, and print what was measured."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=float, default=10.0)
    seconds = 60.0 * parser.parse_args().minutes
    from domain_coordinator import domain_id

    report, model = Report(), Model.load("dc_motor").with_options(update_period=PERIOD)
    report.section(f"All nodes, states at {RATE:g} Hz, a model every {PERIOD:g} s, for {seconds:g} s")
    with domain_id() as domain, tempfile.TemporaryDirectory() as folder:
        os.environ.update(environment(domain) | {"OPENBLAS_NUM_THREADS": "1"})
        warm_up(model)
        model.save(Path(folder) / "model.yaml")
        nodes = LiveProcesses(Path(folder))
        others = [subprocess.Popen([sys.executable, "-c", code]) for code in (TIMER, _in_namespace(BARE))]
        try:
            for name, *options in (
                ("plant_simulator", f"publish_rate:={RATE}", "noise:=1e-6"),
                ("linearizer",),
                ("monitor", f"folder:={folder}", "learn:=20.0"),
                ("controller", "track:=speed", f"largest_speed:={SPEED}", f"limit:={LIMIT}"),
            ):
                nodes.start(name, Path(folder) / "model.yaml", *options)
            show(report, *watch(nodes, dict(zip(("bare timer", "bare subscription"), others, strict=True)), seconds))
        finally:
            for process in others:
                process.terminate()
                process.wait(30)
            nodes.stop()


def _in_namespace(code: str) -> str:
    return code.replace('create_node("bare")', f'create_node("bare", namespace="{LIVE_NAMESPACE}")')


def watch(nodes: LiveProcesses, others: dict[str, Any], seconds: float) -> tuple[Any, ...]:
    """Drive the controller and listen; return shares of a core, memory in MiB early and late, and times of updates."""
    import rclpy
    from rclpy.signals import SignalHandlerOptions
    from std_msgs.msg import Float64MultiArray

    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    node = rclpy.create_node("bench", namespace=LIVE_NAMESPACE)
    try:
        models, ticks = Tap(node, "linearizer/model"), Tap(node, "bare_timer")
        publisher = node.create_publisher(Float64MultiArray, "reference", 10)
        pids = {name: Pid(pid) for name, pid in nodes.pids().items()} | others
        begun = time.monotonic()

        def go_on(until: float) -> None:
            looked = time.monotonic()
            while time.monotonic() < until:
                wanted = SPEED * float(np.sin(2 * np.pi * (time.monotonic() - begun) / WAVE))
                publisher.publish(Float64MultiArray(data=[wanted]))
                time.sleep(REFERENCE)
                if time.monotonic() - looked > LISTENED:
                    pause(0.0, models, ticks)
                    looked = time.monotonic()

        while len(models.messages) < 3:
            go_on(time.monotonic() + 1.0)
            nodes.check()
            if time.monotonic() - begun > 120.0:
                raise RuntimeError("the nodes have not published within 120 s")
        go_on(time.monotonic() + 5.0)
        models.messages.clear()
        ticks.messages.clear()
        used, start = cpu(pids), time.monotonic()
        go_on(start + min(SETTLED, seconds / 2))
        early = memory(pids)
        go_on(start + seconds)
        span, after = time.monotonic() - start, cpu(pids)
        nodes.check()
        shares = {name: (after[name] - used[name]) / span for name in pids}
        return shares, early, memory(pids), *(np.array([m[0] for m in tap.messages]) / NANO for tap in (models, ticks))
    finally:
        node.destroy_node()
        rclpy.shutdown()


class Pid:
    """What `cpu` asks of a process."""

    def __init__(self, pid: int) -> None:
        self.pid = pid


def memory(processes: dict[str, Any]) -> dict[str, float]:
    """Return the memory in MiB that each process has to itself, swapped or not."""
    found = {}
    for name, process in processes.items():
        status = Path(f"/proc/{process.pid}/status").read_text()
        found[name] = int(status.partition("VmRSS:")[2].split()[0]) / 1024
    return found


def late(times: np.ndarray) -> np.ndarray:
    """Return how far (N,) times in s are off the grid of periods that the middle of them lies on."""
    off = times - PERIOD * np.round((times - times[0]) / PERIOD)
    return np.abs(off - np.median(off))


def show(report: Report, shares: dict, early: dict, now: dict, models: np.ndarray, ticks: np.ndarray) -> None:
    """Print what was measured beside what is asked."""
    for name, share in shares.items():
        grown = now[name] - early[name]
        report.line(
            name, f"{100 * share:.1f} % of a core, {now[name]:.1f} MiB, {grown:+.2f} MiB since minute {SETTLED / 60:g}"
        )
    ratio = shares["linearizer"] / max(shares["bare subscription"], 1e-9)
    report.target("linearizer, in a bare subscription's share", ratio, high=MOST_SHARE)
    for name, times in (("updates", models), ("ticks of a bare timer", ticks)):
        off = late(times)
        share = float(np.mean(off < IN_TIME))
        missing = round((times[-1] - times[0]) / PERIOD) + 1 - times.size
        report.line(
            name, f"{times.size}, {missing} missing, latest {1e3 * off.max():.1f} ms, {100 * share:.2f} % in time"
        )
        if name == "updates":
            report.target("updates within 10 ms", share, low=SHARE)


if __name__ == "__main__":
    main()
