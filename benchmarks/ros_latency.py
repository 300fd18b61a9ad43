"""(c) The nodes as processes: state-to-model latency, CPU share at 1 kHz states, and the rate over a minute.

A plant simulator and a linearizer run from <prefix>/lib/signlin_ros. This process only listens, and takes what has
come a few times a second without an executor, so that it takes little of the machine. All times are those that the
middleware has put on the messages: the state when it was published, the model when it reached this process.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from measure import Report

PREFIX = Path(sys.prefix)
BIN, CONFIG = PREFIX / "lib" / "signlin_ros", PREFIX / "share" / "signlin_ros" / "config"
RATE, PERIOD = 1000.0, 0.2
DRIVE = ("input_signal:=square", "noise:=1e-6")  # the noise tells equal states apart
NANO = 1e9
DEPTH = 2000
TICKS = os.sysconf("SC_CLK_TCK")
MOST_SHARE = 1.4
"""The linearizer's share of a core, in that of a node which only subscribes to the states."""
BARE = """
import rclpy
from rclpy.signals import SignalHandlerOptions
from std_msgs.msg import Float64MultiArray
rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
node = rclpy.create_node("bare")
node.create_subscription(Float64MultiArray, "state", lambda message: None, 50)
rclpy.spin(node)
"""


def run(report: Report, seconds: float = 60.0) -> None:
    report.section(f"Nodes: two processes, states at {RATE:g} Hz, a model every {PERIOD:g} s, for {seconds:g} s")
    try:
        import rclpy  # noqa: F401
        from domain_coordinator import domain_id
    except ImportError as error:
        report.line("skipped", f'{error.name} is missing: pip install "signlin_ros[ros,dev]"')
        return
    if not (BIN / "linearizer").exists():
        report.line("skipped", f"{BIN} is empty: install the package first")
        return
    with domain_id() as domain, tempfile.TemporaryDirectory() as folder:
        os.environ.update(environment(domain))
        processes = {
            "plant_simulator": start("plant_simulator", folder, f"publish_rate:={RATE}", *DRIVE),
            "linearizer": start("linearizer", folder, f"update_period:={PERIOD}"),
            "bare subscription": subprocess.Popen([sys.executable, "-c", BARE]),
        }
        try:
            show(report, *watch(processes, seconds))
        finally:
            for process in processes.values():
                process.terminate()
                process.wait(30)


def environment(domain: int) -> dict[str, str]:
    """Return what keeps the processes among themselves, and quick to find each other."""
    return {
        "ROS_DOMAIN_ID": str(domain),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        "FASTRTPS_DEFAULT_PROFILES_FILE": str(CONFIG / "fastdds_profile.xml"),
    }


def start(name: str, folder: str, *parameters: str) -> subprocess.Popen[bytes]:
    """Start an executable as ``ros2 run`` would."""
    options = [part for p in parameters for part in ("-p", p)]
    command = [str(BIN / name), "--ros-args", "--params-file", str(CONFIG / "dc_motor.yaml"), *options]
    with (Path(folder) / f"{name}.log").open("wb") as log:
        return subprocess.Popen(command, stdout=log, stderr=subprocess.STDOUT)


def watch(processes: dict[str, Any], seconds: float) -> tuple[dict[str, float], list[Any], list[Any]]:
    """Listen for some time; return each process's share of a core, and the states and models with their times."""
    import rclpy
    from rclpy.signals import SignalHandlerOptions

    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    node = rclpy.create_node("bench")
    try:
        states, models = (Tap(node, topic) for topic in ("state", "linearizer/model"))
        deadline = time.monotonic() + 60.0
        while not (len(models.messages) >= 3 and states.messages):
            pause(0.1, states, models)
            if time.monotonic() > deadline:
                raise RuntimeError("the nodes have not published within 60 s")
        for tap in (states, models):
            tap.messages.clear()
        before, begin = cpu(processes), time.monotonic()
        while time.monotonic() - begin < seconds:
            pause(0.25, states, models)
        span, after = time.monotonic() - begin, cpu(processes)
        shares = {name: (after[name] - before[name]) / span for name in processes}
        return shares, states.messages, models.messages
    finally:
        node.destroy_node()
        rclpy.shutdown()


class Tap:
    """A subscription that is emptied by hand: (published at, came at, data), in ns of the system's clock."""

    def __init__(self, node: Any, topic: str) -> None:
        from std_msgs.msg import Float64MultiArray

        self.messages: list[tuple[int, int, Any]] = []
        self._subscription = node.create_subscription(Float64MultiArray, topic, self.messages.append, DEPTH)

    def empty(self) -> None:
        """Take all that has come."""
        s = self._subscription
        while True:
            with s.handle:
                found = s.handle.take_message(s.msg_type, s.raw)
            if found is None:
                return
            message, info = found
            self.messages.append((info["source_timestamp"], info["received_timestamp"], message.data))


def pause(seconds: float, *taps: Tap) -> None:
    """Sleep, then take what has come."""
    time.sleep(seconds)
    for tap in taps:
        tap.empty()


def cpu(processes: dict[str, Any]) -> dict[str, float]:
    """Return the processor time in s that each process has used."""
    found = {}
    for name, process in processes.items():
        fields = Path(f"/proc/{process.pid}/stat").read_text().rpartition(")")[2].split()
        found[name] = (int(fields[11]) + int(fields[12])) / TICKS
    return found


def latencies(states: list[Any], models: list[Any]) -> np.ndarray:
    """Return the time in s from the state published to the model received, for the models whose state was heard.

    The state of a model is known by its x_k, which has every bit of it: [sec, nanosec, sequence, valid, n, m, A, B, c,
    x_k, u_k].
    """
    sent: dict[tuple[float, ...], int] = {tuple(data): at for at, _, data in states}
    found = []
    for _, came, data in models:
        n, m = int(data[4]), int(data[5])
        first = 6 + n * n + n * m + n
        at = sent.get(tuple(data[first : first + n]))
        if at is not None:
            found.append((came - at) / NANO)
    return np.array(found)


def show(report: Report, shares: dict[str, float], states: list[Any], models: list[Any]) -> None:
    from_equation_error = (len(states) - 1) / ((states[-1][0] - states[0][0]) / NANO)
    report.line("states heard", f"{len(states)}, {from_equation_error:.1f} Hz")
    found = latencies(states, models) * 1e3
    for q in (50, 99, 100):
        report.figures[f"state to model p{q} [ms]"] = float(np.percentile(found, q))
    p50, p99, worst = np.percentile(found, [50, 99, 100])
    counts = f"{found.size} of {len(models)} models"
    text = f"p50 {p50:.2f} ms, p99 {p99:.2f} ms, max {worst:.2f} ms ({counts})"
    report.line("state published to model received", text)
    report.line("", f"of which up to {1e3 / RATE:g} ms waits for the timer of the update period")
    for name, share in shares.items():
        report.figures[f"CPU share {name}"] = share
        report.line(f"{name}, share of one core", f"{100 * share:.1f} %")
    ratio = shares["linearizer"] / max(shares["bare subscription"], 1e-9)
    report.target("linearizer, in a bare subscription's share", ratio, high=MOST_SHARE)
    rate = (len(models) - 1) / ((models[-1][0] - models[0][0]) / NANO)
    report.figures["rate [Hz]"] = rate
    gaps = np.diff([m[0] for m in models]) / NANO
    report.line("models", f"{len(models)}, gaps {gaps.min():.4f} ... {gaps.max():.4f} s")
    report.target("rate", rate, low=0.99 / PERIOD, high=1.01 / PERIOD, unit="Hz")
