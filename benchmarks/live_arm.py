"""Joint states of an arm at 1 kHz: does the linearizer, a process, take every one, and is any update lost?

usage: python benchmarks/live_arm.py UR10E.urdf --seconds 60 --rates 5 50

This process publishes the states, each as much later as it has to be for the rate, and only then takes what has come.
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
from ros_latency import BIN, RATE, Tap, cpu, environment

from signlin_ros.model import Model
from signlin_ros.robots import read_urdf

AFTER = 3.0
"""Seconds after the last state in which diagnostics and models may still come."""


def main() -> None:
    """Publish states for some time at each rate of updates, and print what came of them."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("urdf")
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--rates", type=float, nargs="+", default=[5.0, 50.0], help="updates per second")
    options = parser.parse_args()
    from domain_coordinator import domain_id

    report, urdf = Report(), Path(options.urdf).resolve()
    for rate in options.rates:
        report.section(f"States of {urdf.name} at {RATE:g} Hz for {options.seconds:g} s, updates at {rate:g} Hz")
        report.line("load of the machine before", f"{os.getloadavg()[0]:.2f}")
        with domain_id() as domain, tempfile.TemporaryDirectory() as folder:
            os.environ.update(environment(domain) | {"OPENBLAS_NUM_THREADS": "1"})
            model = model_file(urdf, Path(folder))
            with (Path(folder) / "log").open("wb") as log:
                arguments = ["-p", "state_source:=joint_state", "-p", f"update_period:={1.0 / rate}"]
                command = [str(BIN / "linearizer"), "--ros-args", "--params-file", str(model), *arguments]
                process = subprocess.Popen(command, stdout=log, stderr=subprocess.STDOUT)
            try:
                show(report, rate, *publish(process, read_urdf(str(urdf)).names, options.seconds))
            finally:
                process.terminate()
                process.wait(30)
        report.line("load of the machine after", f"{os.getloadavg()[0]:.2f}")


def model_file(urdf: Path, folder: Path) -> Path:
    """Write the model of an arm with friction in every joint; return its path."""
    friction = {"viscous_friction": {"b": 3.0}, "coulomb_friction": {"mu": 3.0}}
    content: dict[str, Any] = {"plant": "arm", "robot": str(urdf)}
    joint = {"parameters": {"motor_inertia": 0.5}, "effects": friction}
    content |= dict.fromkeys(read_urdf(str(urdf)).names, joint)
    Model.from_dict(content).save(folder / "arm.yaml")
    return folder / "arm.yaml"


def publish(process: Any, names: tuple[str, ...], seconds: float) -> tuple[Any, ...]:
    """Publish states; return how many, how late they were at most in s, share of a core, models, and diagnostics."""
    import rclpy
    from diagnostic_msgs.msg import DiagnosticArray
    from rclpy.signals import SignalHandlerOptions
    from sensor_msgs.msg import JointState

    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    node, listener = rclpy.create_node("bench"), rclpy.create_node("listener")
    try:
        models, told = Tap(listener, "linearizer/model"), list[Any]()  # emptied by hand: nothing spins it
        node.create_subscription(DiagnosticArray, "/diagnostics", told.append, 50)
        publisher = node.create_publisher(JointState, "/joint_states", 50)
        while not publisher.get_subscription_count():
            time.sleep(0.05)
        phase, sent, worst = np.arange(len(names)), 0, 0.0
        message = JointState(name=list(names))
        used, begun = cpu({"": process})[""], time.monotonic()
        count = round(seconds * RATE)
        while sent < count:
            due = begun + sent / RATE
            wait = due - time.monotonic()
            if wait > 0.0:
                time.sleep(wait)
            else:
                worst = max(worst, -wait)
            t = sent / RATE
            message.header.stamp = node.get_clock().now().to_msg()
            message.position = (0.5 * np.sin(t + phase)).tolist()
            message.velocity = (0.5 * np.cos(t + phase)).tolist()
            message.effort = (5.0 * np.cos(t + phase)).tolist()
            publisher.publish(message)
            sent += 1
            if sent % 20 == 0:
                models.empty()
                rclpy.spin_once(node, timeout_sec=0.0)
        share = (cpu({"": process})[""] - used) / (time.monotonic() - begun)
        end = time.monotonic() + AFTER
        while time.monotonic() < end:
            rclpy.spin_once(node, timeout_sec=0.1)
            models.empty()
        return sent, worst, share, models.messages, told
    finally:
        node.destroy_node()
        listener.destroy_node()
        rclpy.shutdown()


def show(report: Report, rate: float, sent: int, worst: float, share: float, models: list[Any], told: Any) -> None:
    """Print states taken and refused, and updates that are missing."""
    values = {v.key: v.value for message in told for status in message.status for v in status.values}
    report.line("states published", f"{sent}, at most {1e3 * worst:.1f} ms late by this process")
    report.line("states accepted, messages refused", f"{values['states accepted']}, {values['messages refused']}")
    if "last refused" in values:
        report.line("last refused", values["last refused"])
    report.target("states lost", sent - int(values["states accepted"]), high=0)
    numbers = np.array([data[2] for _, _, data in models])
    report.line("updates", f"{numbers.size}, numbers {numbers[0]:g} to {numbers[-1]:g}")
    report.target("updates lost", int(numbers[-1] - numbers[0] + 1 - numbers.size), high=0)
    gaps = np.diff([at for at, _, _ in models]) / 1e9
    report.line("gaps", f"{1e3 * gaps.min():.1f} to {1e3 * gaps.max():.1f} ms, {1e3 / rate:g} asked")
    report.line("linearizer, share of one core", f"{100 * share:.1f} %")


if __name__ == "__main__":
    sys.exit(main())
