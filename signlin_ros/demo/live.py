"""The live demo: a model watched, improved and used while the machine runs, as processes over ROS 2.

    python -m signlin_ros.demo.live --output out

A motor with Coulomb friction and cogging; a linearizer with a model that has neither; a monitor that shows how wrong
A_k and B_k are. After some time the monitor's ``~/diagnose`` is called, then ``~/apply``: the linearizer takes what
was found without a restart, and the error falls. Where the node ``controller`` is installed, it drives the motor along
a slow reference and its tracking error is shown, too; else the simulator drives itself.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click
import numpy as np
from numpy.typing import NDArray

from signlin_ros import plotting
from signlin_ros.demo.processes import DemoError, prefix
from signlin_ros.errors import MissingExtraError, SignlinError
from signlin_ros.model import Model
from signlin_ros.warming import warm_up

Array = NDArray[np.float64]
LIVE_NAMESPACE = "/live"
BASE_OPTIONS = {"with_position": True, "update_period": 0.02, "operating_point": "midpoint"}
"""A linear model cannot follow the waves of the cogging for long."""
LIVE_FRICTION = 0.033
COGGING = (0.012, 14.0, 0.3)
"""Friction in N·m; amplitude, order and phase of the cogging."""
DRIVE_AMPLITUDE, DRIVE_PERIOD = 3.0, 7.0
STATE_RATE = 100.0
"""States per second: five processes share a small machine."""
LOOP_DELAY = 0.05
"""Seconds that the controller reckons with from a sample until its input acts, on a machine that has other work."""
STATE_NOISE = 1e-3
"""Of every state that the simulator shows, in its unit."""
REFERENCE_SPEED, REFERENCE_PERIOD, VOLTAGE_LIMIT = 2.0, 6.0, 8.0
"""Largest speed and period of the reference, and the largest voltage: waves of the cogging pass at 4.5 Hz at most."""
LEARNING_TIME, TIME_BEFORE, TIME_AFTER = 10.0, 40.0, 30.0
"""Seconds in which the monitor learns; until the diagnosis is asked for; after the model was applied."""
STARTING_TIME = 5.0
"""Seconds at the start in which the drive gets going."""
SMOOTHED = 2.0
"""Seconds over which the figure takes errors together."""
MAX_WAIT = 900.0
"""Seconds to wait for an answer; a diagnosis on a busy machine takes minutes."""


def machine() -> Model:
    """Return the machine: a motor with friction and cogging."""
    A, N, phi = COGGING
    return nominal().with_effect("coulomb_friction", mu=LIVE_FRICTION).with_effect("cogging_torque", A=A, N=N, phi=phi)


def nominal() -> Model:
    """Return the model that is thought to be right: without friction."""
    return Model.load("dc_motor").without_effect("coulomb_friction").with_options(**BASE_OPTIONS)


class LiveProcesses:
    """Executables from ``lib/signlin_ros`` in one namespace, each with its output in a file; all are ended."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.place = folder, prefix()
        self._running: dict[str, subprocess.Popen[bytes]] = {}

    def has(self, executable: str) -> bool:
        """Tell whether an executable is installed."""
        return (self.place / "lib" / "signlin_ros" / executable).is_file()

    def start(self, executable: str, model: Path, *parameters: str) -> None:
        """Start an executable as ``ros2 run`` would."""
        options = [part for parameter in parameters for part in ("-p", parameter)]
        command = [str(self.place / "lib" / "signlin_ros" / executable), "--ros-args", "--params-file", str(model)]
        with (self.folder / f"{executable}.log").open("wb") as out:
            self._running[executable] = subprocess.Popen(
                [*command, "-r", f"__ns:={LIVE_NAMESPACE}", *options], stdout=out, stderr=out
            )

    def check(self) -> None:
        """Raise `DemoError` with the last of its output if one has ended."""
        for name, process in self._running.items():
            if process.poll() is not None:
                last = (self.folder / f"{name}.log").read_text(errors="replace").splitlines()[-8:]
                raise DemoError(f"{name} has ended with exit code {process.returncode}:\n" + "\n".join(last))

    def pids(self) -> dict[str, int]:
        """Return the process numbers: nothing is restarted."""
        return {name: process.pid for name, process in self._running.items()}

    def stop(self) -> None:
        """Interrupt all, and wait for their ends."""
        for process in self._running.values():
            if process.poll() is None:
                process.send_signal(signal.SIGINT)
        for process in self._running.values():
            _end(process)


def _end(process: subprocess.Popen[bytes]) -> None:
    try:
        process.wait(15.0)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


class Story:
    """A peer that listens to the monitor, calls its services, and gives the controller its reference."""

    def __init__(self, processes: LiveProcesses, tracked: bool) -> None:
        import rclpy
        from rclpy.context import Context
        from rclpy.executors import SingleThreadedExecutor
        from rclpy.qos import DurabilityPolicy, QoSProfile
        from rclpy.signals import SignalHandlerOptions
        from std_msgs.msg import Float64MultiArray, String

        self.processes, self.tracked = processes, tracked
        self.context = Context()
        rclpy.init(context=self.context, args=[], signal_handler_options=SignalHandlerOptions.NO)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.node = rclpy.create_node(
            "story", namespace=LIVE_NAMESPACE, context=self.context, use_global_arguments=False
        )
        self.executor.add_node(self.node)
        self.begun = time.monotonic()
        self.errors: list[tuple[float, Array]] = []
        self.tracking: list[tuple[float, float]] = []
        self.verdicts: list[dict[str, Any]] = []
        self.moments: dict[str, float] = {}
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.node.create_subscription(Float64MultiArray, "monitor/error", self._on_error, 50)
        self.node.create_subscription(String, "monitor/verdict", self._on_verdict, latched)
        self.node.create_subscription(Float64MultiArray, "state", self._on_state, 50)
        self._reference = self.node.create_publisher(Float64MultiArray, "reference", 10)
        if tracked:
            self.node.create_timer(0.02, self._on_reference)

    def close(self) -> None:
        """Leave the graph."""
        self.executor.shutdown()
        self.node.destroy_node()
        self.context.try_shutdown()

    @property
    def now(self) -> float:
        """Seconds since the beginning."""
        return time.monotonic() - self.begun

    def _on_error(self, message: Any) -> None:
        n = int(message.data[2])
        self.errors.append((self.now, np.array(message.data[3:]).reshape(5, n)))

    def _on_verdict(self, message: Any) -> None:
        self.verdicts.append(json.loads(message.data))

    def _wanted(self, t: float) -> float:
        return REFERENCE_SPEED * float(np.sin(2 * np.pi * t / REFERENCE_PERIOD))

    def _on_state(self, message: Any) -> None:
        if self.tracked:
            self.tracking.append((self.now, float(message.data[1]) - self._wanted(self.now)))

    def _on_reference(self) -> None:
        from std_msgs.msg import Float64MultiArray

        self._reference.publish(Float64MultiArray(data=[self._wanted(self.now)]))

    def wait(self, condition: Callable[[], Any], what: str, patience: float = MAX_WAIT) -> Any:
        """Spin until the condition holds; return its value."""
        end = time.monotonic() + patience
        while not (value := condition()):
            self.processes.check()
            if time.monotonic() > end:
                raise DemoError(f"waited {patience:g} s in vain for {what}")
            self.executor.spin_once(timeout_sec=0.02)
        return value

    def spend(self, seconds: float) -> None:
        """Let time pass."""
        end = self.now + seconds
        self.wait(lambda: self.now > end, "time to pass", seconds + 60)

    def call(self, service: str) -> str:
        """Call one of the monitor's services; return its message, raise `DemoError` where it declines."""
        from std_srvs.srv import Trigger

        client = self.node.create_client(Trigger, f"monitor/{service}")
        self.wait(client.service_is_ready, service, 60.0)
        future = client.call_async(Trigger.Request())
        answer = self.wait(lambda: future.done() and future.result(), f"an answer of {service}")
        if not answer.success:
            raise DemoError(f"{service}: {answer.message}")
        return str(answer.message)

    def mark(self, what: str) -> None:
        """Note a moment."""
        self.moments[what] = self.now


def tell(folder: Path, say: Callable[[str], None]) -> Story:
    """Run the whole story; all processes have ended when it returns."""
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # matrices of 3 x 3: threads only wait for one another
    say(f"compiled ahead in {warm_up(nominal()) + warm_up(machine()):.0f} s")
    processes = LiveProcesses(folder)
    truth, thought = folder / "machine.yaml", folder / "nominal.yaml"
    machine().save(truth)
    nominal().save(thought)
    tracked = processes.has("controller")
    driven = (
        [] if tracked else [f"amplitude:={DRIVE_AMPLITUDE}", f"input_period:={DRIVE_PERIOD}", "input_signal:=multisine"]
    )
    joint = "state_source:=joint_state"
    story = None
    try:
        processes.start("plant_simulator", truth, f"noise:={STATE_NOISE}", f"publish_rate:={STATE_RATE}", *driven)
        processes.start("linearizer", thought, joint)
        processes.start("monitor", thought, joint, f"learn:={LEARNING_TIME}", f"folder:={folder}")
        if tracked:
            limits = (f"limit:={VOLTAGE_LIMIT}", f"largest_speed:={REFERENCE_SPEED}", f"loop_delay:={LOOP_DELAY}")
            processes.start("controller", thought, "track:=speed", *limits)
        story = Story(processes, tracked)
        before = processes.pids()
        story.wait(lambda: story.errors, "the first error", 300.0)
        say("the model without friction is watched ...")
        story.spend(TIME_BEFORE)
        _improve(story, say)
        story.spend(TIME_AFTER)
        story.mark("end")
        if processes.pids() != before:
            raise DemoError("a process was restarted")
        return story
    finally:
        if story is not None:
            story.close()
        processes.stop()


def _improve(story: Story, say: Callable[[str], None]) -> None:
    story.mark("diagnosis asked")
    say(f"diagnosis: {story.call('diagnose')}")
    done = story.wait(lambda: [v for v in story.verdicts if v.get("state") in ("done", "failed")], "a verdict")[-1]
    if done["state"] == "failed":
        raise DemoError(f"the diagnosis failed: {done['why']}")
    story.mark("verdict")
    found = [effect for step in done.get("ladder", [])[-1:] for effect in step["effects"]]
    say(f"verdict: {done['verdict']}; {', '.join(found) or 'nothing'}")
    say(f"applied: {story.call('apply')}")
    story.mark("applied")


def summary(story: Story) -> dict[str, float]:
    """Return RMS errors of the predicted speed before the diagnosis and after the better model, and of tracking.

    And the medians: where a busy machine stands still for a moment, that moment makes the RMS.
    """
    first, second = story.moments["diagnosis asked"], story.moments["applied"] + 3.0
    speed = nominal().states.index("speed")
    t, e = np.array([when for when, _ in story.errors]), np.array([error[:2, speed] for _, error in story.errors])
    parts = {"before": e[t < first, 0], "after": e[t > second, 0], "friction-free": e[t > second, 1]}
    if story.tracking:
        s, error = np.array(story.tracking).T
        parts |= {"tracking before": error[(s < first) & (s > STARTING_TIME)], "tracking after": error[s > second]}
    rms = {name: _rms(values) for name, values in parts.items()}
    return rms | {f"{name}, median": float(np.median(np.abs(values))) for name, values in parts.items() if values.size}


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2))) if values.size else float("nan")


def draw(story: Story, path: Path) -> None:
    """Draw the errors over time, the moments marked."""
    rows = 2 if story.tracking else 1
    with plotting.styled(9.0, 3.2 * rows) as figure:
        axes = figure.subplots(rows, 1, sharex=True, squeeze=False)[:, 0]
        _draw_errors(story, axes[0])
        if story.tracking:
            s, error = np.array(story.tracking).T
            axes[1].plot(s, error, lw=0.6, color="C1")
            axes[1].set_ylim(*(float(np.max(np.abs(error[s > STARTING_TIME]), initial=1e-3)) * np.array([-1.1, 1.1])))
            axes[1].set_ylabel("tracking error [rad/s]")
        for ax in axes:
            _draw_moments(story, ax)
        axes[-1].set_xlabel("time [s]")
        plotting.save(figure, path)


def _draw_errors(story: Story, ax: Any) -> None:
    speed = nominal().states.index("speed")
    t = np.array([when for when, _ in story.errors])
    e = np.abs([error[:2, speed] for _, error in story.errors])
    for column, color, label in ((1, "0.6", "a model without friction"), (0, "C0", "the published A_k, B_k")):
        ax.semilogy(t, e[:, column], ".", ms=2, alpha=0.3, color=color)
        mean = [_rms(e[(t > when - SMOOTHED) & (t <= when), column]) for when in t]
        ax.semilogy(t, mean, color=color, label=f"{label} (RMS over {SMOOTHED:g} s)")
    ax.axhline(STATE_NOISE, color="k", lw=0.8, ls=":", label="noise of the measured speed")
    ax.set_ylim(STATE_NOISE / 10, 10 * float(np.max(e)))
    ax.set_ylabel("error of the speed predicted\nover one period [rad/s]")
    ax.legend(loc="upper left", ncols=2, fontsize="small")


def _draw_moments(story: Story, ax: Any) -> None:
    near = 0.02 * story.moments["end"]
    text, last = "", -np.inf
    for what, when in story.moments.items():
        if what == "end":
            continue
        ax.axvline(when, color="k", lw=0.8, ls="--")
        text = f"{text}, {what}" if when - last < near and text else what
        if not any(last < when < then < when + near for then in story.moments.values()):
            place = {"rotation": 90, "va": "bottom", "ha": "right", "fontsize": "small"}
            ax.annotate(text, (when, 0.02), xycoords=("data", "axes fraction"), **place)
            text = ""
        last = when


@click.command()
@click.option("--output", default="out", help="Folder for the figure, the report and the models.")
def main(output: str) -> None:
    """Run the live demo."""
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))  # as an interruption does: the nodes are ended
    folder = Path(output)
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="signlin_live_") as work:
        story = tell(Path(work), click.echo)
        for report in Path(work).glob("diagnosis_*/*.html"):
            (folder / "live_report.html").write_bytes(report.read_bytes())
    draw(story, folder / "live.png")
    found = summary(story)
    (folder / "live.json").write_text(json.dumps({"moments": story.moments, **found}, indent=2), encoding="utf-8")
    for name, value in found.items():
        click.echo(f"{name:24s} {value:.4g} rad/s{'' if name.endswith('median') else ' RMS'}")
    click.echo(f"{folder / 'live.png'}")


if __name__ == "__main__":
    try:
        main(standalone_mode=False)
    except ModuleNotFoundError as error:
        raise SystemExit(str(MissingExtraError("the live demo", "ros"))) from error
    except (SignlinError, click.ClickException) as error:
        raise SystemExit(f"live demo: {error}") from error
