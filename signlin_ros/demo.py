"""The main job for real: a plant and two linearizers as processes over ROS 2, and what their models are worth.

    python -m signlin_ros.demo --output out

Starts ``plant_simulator`` (the non-smooth DC motor under a square voltage) and two ``linearizer``s, one with the
operating point at the start of each period and one at its predicted midpoint; listens; and holds every published
A_k, B_k, c against what the plant did in the next update period.
"""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import sysconfig
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np
from numpy.typing import NDArray

from signlin_ros import plotting
from signlin_ros.errors import MissingExtraError, SignlinError
from signlin_ros.linearize import Linearizer
from signlin_ros.model import Model
from signlin_ros.predict import without_dry_friction
from signlin_ros.simulate import simulate

if TYPE_CHECKING:
    from signlin_ros.nodes.linearizer_logic import Update
    from signlin_ros.nodes.listen import Heard, Listener

Array = NDArray[np.float64]
MODEL = "dc_motor"
AMPLITUDE, INPUT_PERIOD, RATE = 2.0, 2.23, 200.0
"""Of the plant: voltage in V, period of the square in s, published states per second.

The seven reversals, 1.115 s apart, spread evenly over the update period of 0.2 s, so that the result hardly
depends on when a linearizer happened to start."""
POINTS = {"start": "linearizer", "midpoint": "linearizer_midpoint"}
"""Operating point and name of each linearizer."""
LONGEST_GAP = 0.03
"""Seconds between two states above which a prediction is not judged: a busy machine lost too much in between."""
START_PATIENCE, RUN_PATIENCE, STOP_PATIENCE = 180.0, 30.0, 15.0
"""Seconds to wait: for a node to be there (the first run on a machine compiles), beyond the run, for an end."""


class DemoError(SignlinError):
    """The demo cannot go on; the message says why."""


# -------------------------------------------------------------------- processes


def prefix() -> Path:
    """Return where the executables, the models and the discovery profile are installed."""
    places = [sys.prefix, sysconfig.get_path("data"), *os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)]
    for place in places:
        if place and (Path(place) / "lib" / "signlin_ros" / "linearizer").is_file():
            return Path(place)
    raise DemoError(f"no lib/signlin_ros/linearizer below {sys.prefix} or AMENT_PREFIX_PATH: install the package first")


class Processes:
    """Executables from ``lib/signlin_ros`` in one namespace, each with its output in a file; all are ended."""

    def __init__(self, place: Path, namespace: str, logs: Path) -> None:
        self._place, self._namespace, self._logs = place, namespace, logs
        self._running: dict[str, subprocess.Popen[bytes]] = {}

    def start(self, executable: str, name: str, *parameters: str) -> None:
        """Start an executable as ``ros2 run`` would, as node ``name``, with parameters ``key:=value``."""
        file = self._place / "share" / "signlin_ros" / "config" / f"{MODEL}.yaml"
        remap = ["-r", f"__ns:={self._namespace}", "-r", f"__node:={name}"]
        options = [part for parameter in parameters for part in ("-p", parameter)]
        program = str(self._place / "lib" / "signlin_ros" / executable)
        with (self._logs / name).open("wb") as out:
            self._running[name] = subprocess.Popen(
                [program, "--ros-args", "--params-file", str(file), *remap, *options], stdout=out, stderr=out
            )

    def check(self) -> None:
        """Raise `DemoError` with the last of its output if one has ended."""
        for name, process in self._running.items():
            if process.poll() is not None:
                raise DemoError(f"{name} has ended with exit code {process.returncode}:\n{self.tail(name)}")

    def tail(self, name: str) -> str:
        """Return the last lines of a process's output."""
        return "\n".join((self._logs / name).read_text(errors="replace").splitlines()[-15:])

    def stop(self) -> dict[str, int]:
        """Interrupt all, wait for their ends, return their exit codes; what does not end is killed."""
        for process in self._running.values():
            if process.poll() is None:
                process.send_signal(signal.SIGINT)
        return {name: _end(process) for name, process in self._running.items()}


def _end(process: subprocess.Popen[bytes]) -> int:
    try:
        return process.wait(STOP_PATIENCE)
    except subprocess.TimeoutExpired:
        process.kill()
        return process.wait()


@contextlib.contextmanager
def _processes(place: Path, namespace: str) -> Iterator[Processes]:
    with tempfile.TemporaryDirectory(prefix="signlin_demo_") as logs:
        processes = Processes(place, namespace, Path(logs))
        try:
            yield processes
        finally:
            codes = processes.stop()
        for name, code in codes.items():
            if code != 0:
                raise DemoError(f"{name} ended with exit code {code} when asked to stop:\n{processes.tail(name)}")


def _listener(namespace: str) -> Listener:
    try:
        from signlin_ros.nodes.listen import Listener
    except ModuleNotFoundError as error:
        if error.name is None or error.name.startswith("signlin_ros"):
            raise
        raise MissingExtraError("The demo", "ros") from error
    return Listener(namespace, POINTS.values())


def _stay_on_this_machine(place: Path) -> None:
    """Set discovery for this process and its children: quick, and local unless the user says otherwise."""
    profile = place / "share" / "signlin_ros" / "config" / "fastdds_profile.xml"
    os.environ.setdefault("FASTRTPS_DEFAULT_PROFILES_FILE", str(profile))
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")


def listen(seconds: float, say: Callable[[str], None]) -> Heard:
    """Run plant and linearizers for some seconds after the plant's first state; return what they published."""
    place = prefix()
    _stay_on_this_machine(place)
    namespace = f"/signlin_demo_{os.getpid()}"
    with _listener(namespace) as listener, _processes(place, namespace) as processes:

        def wait(condition: Callable[[], bool], patience: float, what: str) -> None:
            end = time.monotonic() + patience
            while not listener.wait(condition, 1.0):
                processes.check()
                if time.monotonic() > end:
                    raise DemoError(f"waited {patience:g} s in vain for {what}")

        say("starting two linearizers (the first run on a machine compiles: half a minute) ...")
        for point, name in POINTS.items():
            processes.start("linearizer", name, f"operating_point:={point}")
        wait(lambda: listener.linearizers_ready, START_PATIENCE, "the linearizers")
        say("starting the plant simulator ...")
        drive = ("input_signal:=square", f"amplitude:={AMPLITUDE}", f"input_period:={INPUT_PERIOD}")
        processes.start("plant_simulator", "plant_simulator", *drive, f"publish_rate:={RATE}")
        wait(
            lambda: listener.span > 0 and listener.all_publish, START_PATIENCE, "the plant's state and the first models"
        )
        listener.forget()
        say(f"listening for {seconds:g} s ...")
        wait(lambda: listener.span >= seconds, seconds + RUN_PATIENCE, "the plant's states")
        return listener.heard()


# -------------------------------------------------------------------- what the models are worth


@dataclass(frozen=True)
class Record:
    """States x (T, n) on the plant's own time grid t (T,) in s, and u (T, m) held from each sample to the next."""

    t: Array
    x: Array
    u: Array


@dataclass(frozen=True)
class Window:
    """One published model, the samples ``part`` it is held against, and the speeds (S,) predicted for them.

    ``errors`` (S - 1,) leave the first sample out, where all agree.
    """

    time: float
    update: Update
    part: slice
    speeds: Mapping[str, Array]
    errors: Mapping[str, Array]


def on_grid(heard: Heard) -> Record:
    """Return what the plant published, on its own time grid: the publishers' stamps jitter, the plant does not.

    The input that comes with a state is the one that led to it.
    """
    phase = np.angle(np.mean(np.exp(2j * np.pi * RATE * heard.t))) / (2 * np.pi)  # where in a step most are published
    late = (RATE * heard.t - phase + 0.5) % 1.0 - 0.5
    early = phase + float(np.quantile(late, 0.05)) - 0.1  # a state belongs to the step before it, however late it is
    steps, first = np.unique(np.floor(RATE * heard.t - early).astype(int), return_index=True)
    steps -= steps[0]
    led = heard.u[np.maximum(np.searchsorted(heard.u_t, heard.t[first], side="right") - 1, 0)]
    return Record(steps / RATE, heard.x[first], np.vstack([led[1:], led[-1:]]))


def predict_linear(A: Array, B: Array, c: Array, record: Record, part: slice) -> Array:
    """Return the states (S, n) that x' = A x + B u + c predicts for the samples of ``part`` from its first one."""
    from scipy.linalg import expm

    n, m = B.shape
    block = np.zeros((n + m + 1, n + m + 1))
    block[:n] = np.hstack([A, B, c[:, None]])
    steps = np.diff(record.t[part])
    flows = {dt: expm(block * dt)[:n] for dt in set(steps.tolist())}
    states = [record.x[part.start]]
    for dt, u in zip(steps.tolist(), record.u[part], strict=False):
        states.append(flows[dt] @ np.concatenate([states[-1], u, [1.0]]))
    return np.array(states)


class Rivals:
    """What the published models are held against, all from the same state and input."""

    def __init__(self, model: Model) -> None:
        self.model = model
        bare = without_dry_friction(model)
        self._linear = {
            "no friction": Linearizer(bare.with_options(operating_point="start")),
            "jacobian": Linearizer(model.with_options(operating_point="start"), "jacobian"),
        }

    def speeds(self, record: Record, part: slice, update: Update) -> dict[str, Array]:
        """Return the speed (S,) predicted by the published model, by its rivals, and by the exact model."""
        column, result = self.model.states.index(self.model.plant.velocity), update.result
        found = {"published": predict_linear(result.A, result.B, result.c, record, part)}
        for name, linearizer in self._linear.items():
            rival = linearizer(record.x[part.start], result.u)
            found[name] = predict_linear(rival.A, rival.B, rival.c, record, part)
        exact = simulate(self.model, record.t[part], record.u[part], record.x[part.start])
        return {name: states[:, column] for name, states in (found | {"exact": exact.x}).items()}


def windows(rivals: Rivals, record: Record, models: Sequence[tuple[float, Update]]) -> list[Window]:
    """Return a window of one update period for each published model that has one in the record without a gap."""
    period, column = rivals.model.update_period, rivals.model.states.index(rivals.model.plant.velocity)
    found = []
    for stamp, update in models:
        first = int(np.searchsorted(record.t, stamp + 1e-9, side="right")) - 1
        last = int(np.searchsorted(record.t, record.t[max(first, 0)] + period - 1e-9))
        if first < 0 or last >= record.t.size:
            continue
        part = slice(first, last + 1)
        if np.diff(record.t[part]).max() > LONGEST_GAP:
            continue
        speeds = rivals.speeds(record, part, update)
        errors = {name: (speed - record.x[part, column])[1:] for name, speed in speeds.items()}
        found.append(Window(stamp, update, part, speeds, errors))
    return found


def rms(found: Sequence[Window], name: str) -> float:
    """Return the RMS of an error over all samples of all windows."""
    return float(np.sqrt(np.mean(np.concatenate([window.errors[name] for window in found]) ** 2)))


def typical(found: Sequence[Window], name: str) -> float:
    """Return the median over the windows of their RMS errors."""
    return float(np.median([rms([window], name) for window in found]))


def largest_difference(model: Model, found: Sequence[Window]) -> float:
    """Return how far a published A_k, B_k or c is at most from the library's at the stated x_k, u_k."""
    core = Linearizer(model.with_options(operating_point="start"))
    largest = 0.0
    for window in found:
        ours, theirs = core(window.update.result.x, window.update.result.u), window.update.result
        pairs = ((ours.A, theirs.A), (ours.B, theirs.B), (ours.c, theirs.c))
        largest = max(largest, *(float(np.abs(a - b).max()) for a, b in pairs))
    return largest


# -------------------------------------------------------------------- what is shown

COLUMNS = {"published": "published", "no friction": "no friction", "jacobian": "Jacobian", "exact": "exact model"}


def table(model: Model, record: Record, found: Mapping[str, Sequence[Window]]) -> str:
    """Return the table: RMS error of the predicted speed, and how many operating points lie in the valid range."""
    every = [window for each in found.values() for window in each]
    row = "  {:<18}{:>11}{:>13}{:>11}{:>13}{:>17}".format
    lines = [row("A_k from", *COLUMNS.values(), "in valid range")]
    for point, each in found.items():
        valid = sum(window.update.result.in_valid_range for window in each)
        errors, middle = ([f"{f(each, name):.3f}" for name in COLUMNS] for f in (rms, typical))
        lines.append(row(f"{point}, all", *errors, f"{valid} of {len(each)}"))
        lines.append(row(f"{point}, median", *middle, "").rstrip())
    limit = f"|speed| <= {model.sign_order * model.sign_scale / 3:.2f} rad/s"
    heard = f"{record.t.size} states in {record.t[-1]:.2f} s"
    return NOTES.format(
        period=model.update_period,
        rows="\n".join(lines),
        limit=limit,
        order=model.sign_order,
        heard=heard,
        difference=largest_difference(model, every),
    )


NOTES = """\
RMS error of the speed predicted over the next {period:g} s, in rad/s:
{rows}
published    A_k, B_k, c as received; here c = 0: x' = A_k x + B_k u
no friction  the same motor without its dry friction
Jacobian     affine, at the same state: its friction stands in c, not in A
exact model  the non-smooth motor itself, which no linear model can beat; above 0 only by lost timing
all: over every sample; median: of the predictions, one for each published model
In valid range: {limit} (sign_j, j = {order}). {heard}.
Largest difference between a published A_k, B_k, c and the library's own: {difference:g}."""
LABELS = {
    "start": ("A$_k$ from the start (paper)", plotting.START),
    "midpoint": ("A$_k$ from the predicted midpoint", plotting.MIDPOINT),
}


def draw(path: Path, model: Model, record: Record, found: Mapping[str, Sequence[Window]]) -> None:
    """Draw the speed with every prediction on it, the error of each, and the damping that A_k holds."""
    column = model.states.index(model.plant.velocity)
    with plotting.canvas(path, 8.6, 6.6) as figure:
        speed, error, damping = figure.subplots(3, 1, sharex=True, height_ratios=(3, 2, 1.6))
        speed.plot(record.t, record.x[:, column], color=plotting.EXACT, lw=2.4, label="plant (received)")
        bare = [(window.time, window.part, window.speeds["no friction"]) for window in found["start"]]
        _segments(speed, record, bare, plotting.BARE, "friction-free model")
        _dots(error, found["start"], "no friction", plotting.BARE)
        for point, (label, colour) in LABELS.items():
            each = [(window.time, window.part, window.speeds["published"]) for window in found[point]]
            _segments(speed, record, each, colour, f"{label}: next {model.update_period:g} s")
            _dots(error, found[point], "published", colour)
            at = [window.time for window in found[point]]
            values = [-window.update.result.A[column, column] for window in found[point]]
            damping.semilogy(at, values, ".-", color=colour, lw=0.8, ms=5)
        for axes in (speed, error, damping):
            limit = model.sign_order * model.sign_scale / 3
            plotting.shade(axes, record.t, np.abs(record.x[:, column]) > limit, "outside the valid range of sign$_j$")
        speed.set(ylabel="speed  [rad/s]", title="Live over ROS 2: what each published model predicts")
        error.set(ylabel="RMS error of each\nprediction  [rad/s]", yscale="log")
        damping.set(ylabel="-A$_k$[speed, speed]\n[1/s]", xlabel="time  [s]", xlim=(0, record.t[-1]))
        figure.align_ylabels()
        plotting.legend_above(figure, speed, 3)


def _segments(axes: Any, record: Record, each: Sequence[tuple[float, slice, Array]], colour: str, label: str) -> None:
    for number, (_, part, values) in enumerate(each):
        axes.plot(record.t[part], values, color=colour, lw=1.3, label=label if number == 0 else None)


def _dots(axes: Any, each: Sequence[Window], name: str, colour: str) -> None:
    axes.plot([w.time for w in each], [rms([w], name) for w in each], ".-", color=colour, lw=0.8, ms=5)


# -------------------------------------------------------------------- running


def run(output: Path, seconds: float, say: Callable[[str], None]) -> str:
    """Do it all; return the text to print. Raises `SignlinError` when something fails."""
    output.mkdir(parents=True, exist_ok=True)
    model = Model.load(MODEL)
    heard = listen(seconds, say)
    say("comparing ...")
    record, rivals = on_grid(heard), Rivals(model)
    found = {point: windows(rivals, record, heard.models[name]) for point, name in POINTS.items()}
    for point, name in POINTS.items():
        if not found[point]:
            raise DemoError(f"{name} has published no model while the plant ran")
    draw(output / "demo.png", model, record, found)
    return f"{table(model, record, found)}\nFigure: {output / 'demo.png'}"


@click.command(context_settings={"help_option_names": ["-h", "--help"]})
@click.option("-o", "--output", default="out", show_default=True, metavar="DIR", help="The folder for demo.png.")
@click.option(
    "--seconds", default=8.0, show_default=True, type=click.FloatRange(1.0, 600.0), help="How long to listen."
)
def main(output: str, seconds: float) -> None:
    """Run a simulated motor and two linearizers over ROS 2, and show what their models are worth."""
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))  # so that no process is left behind
    try:
        text = run(Path(output), seconds, lambda line: click.echo(f"demo: {line}", err=True))
    except (SignlinError, OSError) as error:
        click.echo(f"demo: {error}", err=True)
        sys.exit(1)
    click.echo(text)


if __name__ == "__main__":
    main()
