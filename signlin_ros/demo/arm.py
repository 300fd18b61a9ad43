"""``python -m signlin_ros.demo.arm``: an arm with hidden friction in one joint, over ROS 2: named, added, error falls.

A simulated arm follows motions under a PD controller; what it publishes is recorded and diagnosed; then two
linearizers, one with the model as it was and one with what was found, linearize the same live states side by side.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from signlin_ros.arms.data import ArmRun
from signlin_ros.arms.proposal import placed
from signlin_ros.arms.told import effects_named, sentences
from signlin_ros.arms.verbs import ArmDiagnosis, diagnose
from signlin_ros.demo.processes import DemoError, prefix
from signlin_ros.errors import MissingExtraError
from signlin_ros.model import Model
from signlin_ros.model.arm import ArmModel
from signlin_ros.robots import inverse_dynamics

Array = NDArray[np.float64]
HIDDEN = "elbow.coulomb_friction"
"""What the true arm has and the model does not."""
RATE, PERIOD, MIN_STATES_SHARE = 50.0, 0.1, 0.5
"""Commands and states per second; seconds for which a linearizer's model is held; part of the states that must come."""
LOOP_STIFFNESS, LOOP_DAMPING = np.array([20.0, 30.0, 8.0]), np.array([3.0, 5.0, 1.2])
"""Of the controller, in N·m/rad and N·m·s/rad: soft, since commands may be late."""
BAND, MAX_ARM_WAIT, MAX_ARM_SPEED = 6.0, 120.0, 20.0
"""Hz of the diagnosis; seconds to wait for a node; rad/s that no motion here has."""


def reference(t: Array, seed: int, n: int) -> tuple[Array, Array, Array]:
    """Return positions, velocities and accelerations (T, n) of a slow motion of several sines."""
    rng = np.random.default_rng(seed)
    q, v, a = (np.zeros((t.size, n)) for _ in range(3))
    for k in range(1, 6):
        w = 2 * np.pi * k * 0.09 * rng.uniform(0.9, 1.1, n)
        size, phase = rng.uniform(0.3, 0.7, n) / k, rng.uniform(0, 2 * np.pi, n)
        q += size * np.sin(w * t[:, None] + phase)
        v += size * w * np.cos(w * t[:, None] + phase)
        a -= size * w * w * np.sin(w * t[:, None] + phase)
    return q + np.array([0.0, 0.4, -0.5])[:n], v, a


class Operator:
    """Drives the arm from its joint states, and keeps what it and the linearizers publish."""

    def __init__(self, model: ArmModel, namespace: str) -> None:
        import rclpy
        from sensor_msgs.msg import JointState
        from std_msgs.msg import Float64MultiArray

        from signlin_ros.nodes.qos import LATCHED, RELIABLE, SENSOR_QOS

        rclpy.init()
        self._rclpy, self._message = rclpy, Float64MultiArray
        self.node = rclpy.create_node("operator", namespace=namespace)
        self.model, self.names = model, model.robot.names
        self.rows: list[list[float]] = []
        self.models: dict[str, list[list[float]]] = {"given": [], "found": []}
        self.last: dict[str, float] = {}
        self._inputs = self.node.create_publisher(Float64MultiArray, "input", RELIABLE)
        self.node.create_subscription(JointState, "joint_states", self._on_state, SENSOR_QOS)
        for name, kept in self.models.items():
            topic = f"{name}/model"
            self.node.create_subscription(Float64MultiArray, topic, lambda m, k=kept: k.append(list(m.data)), LATCHED)

    def _on_state(self, message: Any) -> None:
        from signlin_ros.nodes.convert import nanoseconds, read_joints

        values = read_joints(message, self.names)
        if isinstance(values, dict):
            self.last = values
            row = [values[f"{name}.{what}"] for what in ("position", "velocity", "effort") for name in self.names]
            self.rows.append([nanoseconds(message.header.stamp) / 1e9, *row])

    def wait(self, condition: Callable[[], bool], what: str, check: Callable[[], None], every: float = 0.1) -> None:
        """Spin until something is so, which is looked at every so many s."""
        end = time.monotonic() + MAX_ARM_WAIT
        while not condition():
            self._rclpy.spin_once(self.node, timeout_sec=every)
            check()
            if time.monotonic() > end:
                raise DemoError(f"waited {MAX_ARM_WAIT:g} s in vain for {what}")

    def drive(self, seconds: float, seed: int, check: Callable[[], None]) -> ArmRun:
        """Follow a motion for some seconds; return what the arm published meanwhile."""
        n = len(self.names)
        t = np.arange(0.0, seconds, 1.0 / RATE)
        q, v, a = reference(t, seed, n)
        feed = inverse_dynamics(self.model.robot, q, v, a)
        self._approach(q[0], check)
        self.rows.clear()
        begun = time.monotonic()
        while (at := time.monotonic() - begun) < seconds:
            k = min(int(at * RATE), t.size - 1)
            self._command(q[k], v[k], feed[k])
            self._rclpy.spin_once(self.node, timeout_sec=max(0.0, (k + 1) / RATE - (time.monotonic() - begun)))
            check()
        return self._run(seconds)

    def hold(self, until: Callable[[], bool], what: str, check: Callable[[], None]) -> None:
        """Keep the arm where it is until something is so: what is not commanded falls."""
        goal = np.array([self.last[f"{name}.position"] for name in self.names])
        still = np.zeros((1, goal.size))
        feed = inverse_dynamics(self.model.robot, goal[None], still, still)[0]

        def held() -> bool:
            self._command(goal, still[0], feed)
            return until()

        self.wait(held, what, check, 1.0 / RATE)

    def _approach(self, goal: Array, check: Callable[[], None], seconds: float = 2.0) -> None:
        start = np.array([self.last[f"{name}.position"] for name in self.names])
        still = np.zeros((1, goal.size))
        begun = time.monotonic()
        while (part := (time.monotonic() - begun) / seconds) < 1.0:
            target = start + (goal - start) * part
            feed = inverse_dynamics(self.model.robot, target[None], still, still)[0]
            self._command(target, (goal - start) / seconds, feed)
            self._rclpy.spin_once(self.node, timeout_sec=1.0 / RATE)
            check()

    def _command(self, q: Array, v: Array, feed: Array) -> None:
        here = np.array([self.last[f"{name}.position"] for name in self.names])
        speed = np.array([self.last[f"{name}.velocity"] for name in self.names])
        effort = feed + LOOP_STIFFNESS * (q - here) + LOOP_DAMPING * (v - speed)
        self._inputs.publish(self._message(data=effort.tolist()))

    def _run(self, seconds: float) -> ArmRun:
        if len(self.rows) < MIN_STATES_SHARE * RATE * seconds:
            many = f"{len(self.rows)} of {RATE * seconds:.0f} states came"
            raise DemoError(f"{many}: this machine is too busy for an arm in real time")
        table, n = np.array(self.rows), len(self.names)
        if np.abs(table[:, 1 + n : 1 + 2 * n]).max() > MAX_ARM_SPEED:
            raise DemoError("the arm ran away: this machine is too busy, and commands came too late")
        even = np.arange(table[0, 0], table[-1, 0], 1.0 / RATE)
        columns = [np.interp(even, table[:, 0], column) for column in table[:, 1:].T]
        q, v, u = (np.stack(columns[k * n : (k + 1) * n], axis=1) for k in range(3))
        return ArmRun(even, q, v, u, "over ROS 2", np.zeros(n))

    def close(self) -> None:
        """End the node."""
        self.node.destroy_node()
        self._rclpy.shutdown()


def held_errors(models: list[list[float]], run: ArmRun) -> Array:
    """Return how far the velocities (W, n) are off that each published model predicts for the time it is held."""
    found, n = [], run.q.shape[1]
    x_all = np.concatenate([run.q, run.v if run.v is not None else np.gradient(run.q, run.step, axis=0)], axis=1)
    for flat in models:
        t0 = flat[0] + flat[1] / 1e9
        k = int(np.searchsorted(run.t, t0))
        last = k + round(PERIOD / run.step)
        if k < 1 or last >= len(run):
            continue
        size, m = int(flat[4]), int(flat[5])
        A = np.array(flat[6 : 6 + size * size]).reshape(size, size)
        B = np.array(flat[6 + size * size : 6 + size * size + size * m]).reshape(size, m)
        c = np.array(flat[6 + size * (size + m) : 6 + size * (size + m) + size])
        x = x_all[k].copy()
        for j in range(k, last):
            step = np.eye(size) - 0.5 * run.step * A  # the trapezoidal rule: friction near standstill is stiff
            x = np.linalg.solve(step, x + 0.5 * run.step * (A @ x) + run.step * (B @ run.tau[j] + c))
        found.append(x[n:] - x_all[last, n:])
    return np.array(found)


@contextmanager
def _nodes(namespace: str, logs: Path) -> Iterator[tuple[Callable[..., None], Callable[[], None]]]:
    """Start executables as ``ros2 run`` would; all are ended."""
    running: dict[str, subprocess.Popen[bytes]] = {}

    def start(executable: str, name: str, file: Path, *parameters: str) -> None:
        options = [part for parameter in parameters for part in ("-p", parameter)]
        remap = ["-r", f"__ns:={namespace}", "-r", f"__node:={name}", "--params-file", str(file)]
        program = str(prefix() / "lib" / "signlin_ros" / executable)
        with (logs / name).open("wb") as out:
            running[name] = subprocess.Popen([program, "--ros-args", *remap, *options], stdout=out, stderr=out)

    def check() -> None:
        for name, process in running.items():
            if process.poll() is not None:
                said = (logs / name).read_text(errors="replace")[-1500:]
                raise DemoError(f"{name} has ended with exit code {process.returncode}:\n{said}")

    try:
        yield start, check
    finally:
        for process in running.values():
            process.send_signal(signal.SIGINT)
        for process in running.values():
            _end(process)


def _end(process: subprocess.Popen[bytes]) -> None:
    try:
        process.wait(15.0)
    except subprocess.TimeoutExpired:
        process.kill()


def run(seconds: float, output: Path, say: Callable[[str], None]) -> tuple[ArmDiagnosis, dict[str, Array]]:
    """Run the demo; return the diagnosis, and the errors of what each linearizer published."""
    place = prefix() / "share" / "signlin_ros" / "config" / "arm"
    truth = cast("ArmModel", Model.load(place / "small_arm.yaml"))
    model = truth.without_effect(HIDDEN)
    output.mkdir(parents=True, exist_ok=True)
    os.environ.setdefault("FASTRTPS_DEFAULT_PROFILES_FILE", str(place.parent / "fastdds_profile.xml"))
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    namespace = f"/arm_demo_{os.getpid()}"
    with tempfile.TemporaryDirectory(prefix="signlin_arm_") as logs, _nodes(namespace, Path(logs)) as (start, check):
        truth.save(output / "true_arm.yaml")
        model.save(output / "given_arm.yaml")
        operator = Operator(model, namespace)
        try:
            say("starting the simulated arm (the first run on a machine compiles: some seconds) ...")
            start(
                "plant_simulator", "plant_simulator", output / "true_arm.yaml", f"publish_rate:={RATE}", "noise:=1e-4"
            )
            operator.wait(lambda: bool(operator.last), "the arm's joint states", check)
            say(f"two motions of {seconds:g} s, recorded from joint_states ...")
            records = [operator.drive(seconds, seed, check) for seed in (1, 2)]
            with ThreadPoolExecutor(1) as aside:
                diagnosis = aside.submit(diagnose, model, records[:1], records[1:], BAND)
                operator.hold(diagnosis.done, "the diagnosis", check)
            found = diagnosis.result()
            for line in sentences(found):
                say(f"  {line}")
            text, urdf, path = placed(found.proposal, output / "found_arm.yaml")
            path.write_text(urdf, encoding="utf-8")
            (output / "found_arm.yaml").write_text(text, encoding="utf-8")
            say("two linearizers on the same live states ...")
            for name in ("given", "found"):
                parameters = ("state_source:=joint_state", f"update_period:={PERIOD}")
                start("linearizer", name, output / f"{name}_arm.yaml", *parameters)
            operator.hold(lambda: all(operator.models.values()), "the linearizers' first models", check)
            for kept in operator.models.values():
                kept.clear()
            live = operator.drive(min(seconds, 15.0), 3, check)
            errors = {name: held_errors(kept, live) for name, kept in operator.models.items()}
        finally:
            operator.close()
    return found, errors


def main() -> None:
    """Run the demo and print what it shows."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--output", type=Path, default=Path("out/arm"))
    parser.add_argument("--seconds", type=float, default=24.0, help="of each recorded motion")
    options = parser.parse_args()

    def say(text: str) -> None:
        sys.stdout.write(f"{text}\n")
        sys.stdout.flush()

    try:
        found, errors = run(options.seconds, options.output, say)
    except (DemoError, MissingExtraError) as error:
        sys.stderr.write(f"{error}\n")
        sys.exit(2)
    rms = {name: np.sqrt(np.mean(values**2, axis=0)) for name, values in errors.items()}
    say(f"velocities predicted by the published A, B, c, held for {PERIOD:g} s: RMS error in rad/s")
    for i, joint in enumerate(found.comparison.study.names):
        say(f"  {joint:10s} as given {rms['given'][i]:.4f}, with what was found {rms['found'][i]:.4f}")
    names = found.comparison.study.names
    named = {names[i]: effects for i, effects in effects_named(found).items()}
    content = {"named": named, "rms": {k: v.tolist() for k, v in rms.items()}}
    (options.output / "arm.json").write_text(json.dumps(content, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
