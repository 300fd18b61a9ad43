"""Run the story of docs/diagnosis.md and paste what the tool said into the page, the README and docs/images.

    python docs/make_story.py [--keep DIR]

A simulated motor has dry friction and a load that its model file does not know. The page's commands are run on its
records, as typed; between the markers ``<!-- story NAME -->`` and ``<!-- end -->`` stands what they printed.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from signlin_ros.diagnosis import load_records
from signlin_ros.model import Model
from signlin_ros.predict import causal_states, predict
from signlin_ros.simulation import simulate

Array = NDArray[np.float64]
DOCS = Path(__file__).resolve().parent
BIN = Path(sys.prefix) / "bin"
LIB = Path(sys.prefix) / "lib" / "signlin_ros"
PROFILE = Path(sys.prefix) / "share" / "signlin_ros" / "config" / "fastdds_profile.xml"

STEP, NOISE = 0.005, (0.03, 0.2)
"""Sampling time in s, and standard deviations of the noise on current (A) and speed (rad/s)."""
TRUE = {"R_a": 0.80, "L_a": 0.0026, "K_t": 0.079, "K_m": 0.079, "B": 2.1e-4, "J": 0.0023}
HIDDEN = {"coulomb_friction": {"mu": 0.033}, "constant_load": {"F0": -0.012}}
MY_MOTOR = """\
/**:
  ros__parameters:
    plant: dc_motor
    parameters: {R_a: 0.764, L_a: 0.0026, K_t: 0.0805, K_m: 0.0805, B: 0.0002, J: 0.0022}
    sign_scale: 0.0
    operating_range: {current: 6.0, speed: 60.0}
    operating_point: midpoint
    update_period: 0.1
"""
RECORDS = {"monday": (1, 16.0), "tuesday": (2, 8.0)}
"""Seed and seconds."""
COMMANDS = {
    "compare": "signlin compare my_motor.yaml monday.csv --validation tuesday.csv --report compare.html",
    "diagnose": "signlin diagnose my_motor.yaml monday.csv --validation tuesday.csv --report diagnosis.html",
    "add": "signlin add coulomb_friction my_motor.yaml monday.csv --validation tuesday.csv -o one_effect.yaml",
    "refine": "signlin refine my_motor.yaml monday.csv --validation tuesday.csv -o my_motor_2.yaml",
}
PICTURES = {
    "compare_files/missing_force.png": "story_missing.png",
    "diagnosis_files/before_and_after.png": "story_before_and_after.png",
    "diagnosis_files/evidence_coulomb_friction.png": "story_evidence.png",
    "diagnosis_files/ladder.png": "story_ladder.png",
}
SHORT = {
    "compare": r"training +/|  model as given|  refitted|  speed > 0",
    "diagnose": r"MISSING|coulomb_friction: |constant_load: ",
    "add": r"training +/|  refitted|  coulomb_friction +current",
    "refine": r"training +/|  refitted|  coulomb_friction \+|note: stopped",
}
"""The lines that the README shows of each command."""
WITHOUT_ROWS = {
    "add": r"UNEXPLAINED|coulomb_friction: |mu ",
    "refine": r"note: stopped",
}
"""The lines that the page shows of a command whose other rows stand above, or say the same again."""
BASE_ROWS = re.compile(
    r"^  model as given .*?(?=^  coulomb_friction )|^  noise of the sensors .*?^\(missing force.*?\n",
    re.DOTALL | re.MULTILINE,
)
"""Rows of `diagnose` that `compare` has shown."""


# --------------------------------------------------------------------------- the motor


def voltage(t: Array, rng: np.random.Generator) -> Array:
    """Return six sines (T,) between 0.15 and 1.2 Hz, at most 4 V."""
    f, phase = rng.uniform(0.15, 1.2, 6), rng.uniform(0, 2 * np.pi, 6)
    v = np.sin(2 * np.pi * np.outer(t, f) + phase).sum(axis=1)
    return np.asarray(np.round(4 * v / np.abs(v).max(), 3))


def record(folder: Path, name: str) -> Array:
    """Write a record of the true motor; return its speed (T,) without noise."""
    seed, seconds = RECORDS[name]
    rng = np.random.default_rng(seed)
    t = np.arange(0, seconds, STEP)
    v = voltage(t, rng)
    truth = Model.from_dict({"plant": "dc_motor", "parameters": TRUE, "effects": HIDDEN})
    run = simulate(truth, t, v[:, None], np.zeros(2))
    shown = run.x + rng.normal(0, NOISE, run.x.shape)
    header = "t [s],voltage [V],current [A],speed [rad/s]"
    np.savetxt(folder / f"{name}.csv", np.c_[t, v, shown], "%.6g", ",", header=header, comments="")
    return np.asarray(run.x[:, 1])


# --------------------------------------------------------------------------- what is run


def run(folder: Path, command: str) -> str:
    """Run a command of the page in the folder; return what it printed."""
    words = command.split()
    done = subprocess.run([str(BIN / words[0]), *words[1:]], cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(f"{command}: {done.stderr}")
    return done.stdout.rstrip()


def predictions(folder: Path, truth: Array, h: float = 0.1) -> str:
    """Return a table: RMS error of the speed of the next ``h`` s, by the linear models of each file."""
    rows = []
    for name in ("my_motor.yaml", "one_effect.yaml", "my_motor_2.yaml"):
        model, (data,) = load_records(Model.load(str(folder / name)), [str(folder / "tuesday.csv")])
        states = causal_states(model, data.t, data.measured, data.u)
        errors = [
            predict(model.with_options(operating_point=point), data.t, data.u, states, truth, "speed", h, kind).rms
            for point, kind in (("start", "piecewise"), ("midpoint", "piecewise"), ("midpoint", "exact"))
        ]
        rows.append(f"{name:17s}" + "".join(f"{e:10.3f}" for e in errors))
    return "\n".join([f"{'rad/s':17s}{'A_k start':>10s}{'midpoint':>10s}{'nonlinear':>10s}", *rows])


def on_ros(folder: Path) -> str:
    """Run the linearizer node with the new file while `replay` publishes the record; return the last model heard."""
    os.environ["FASTRTPS_DEFAULT_PROFILES_FILE"] = str(PROFILE)
    os.environ["ROS_DOMAIN_ID"] = "87"
    from signlin_ros.nodes.listen import Listener

    with contextlib.ExitStack() as stack:
        log = stack.enter_context(tempfile.TemporaryFile())

        def start(executable: str, *options: str) -> None:
            command = [str(LIB / executable), "--ros-args", "--params-file", "my_motor_2.yaml", *options]
            stack.callback(_stop, subprocess.Popen(command, cwd=folder, stdout=log, stderr=log))

        listener = stack.enter_context(Listener("", ["linearizer"]))
        start("linearizer")
        if not listener.wait(lambda: listener.linearizers_ready, patience=120.0):
            raise SystemExit("the linearizer did not start")
        start("replay", "-p", "record:=tuesday.csv")
        listener.wait(lambda: listener.span > 6.0, patience=60.0)
        heard = listener.heard()
    _, update = heard.models["linearizer"][-1]
    matrices = ((n, np.array2string(np.asarray(a), precision=4)) for n, a in _linear(update.result).items())
    lines = [f"{n} = " + text.replace("\n", "\n" + " " * 4) for n, text in matrices]
    return "\n".join([f"{len(heard.models['linearizer'])} models, {heard.t.size} states; the last one:", *lines])


def _linear(result: object) -> Mapping[str, Array]:
    return {name: getattr(result, name) for name in ("A", "B", "c", "x")}


def _stop(process: subprocess.Popen[bytes]) -> None:
    if process.poll() is None:
        process.send_signal(signal.SIGINT)
    try:
        process.wait(15.0)
    except subprocess.TimeoutExpired:
        process.kill()


# --------------------------------------------------------------------------- the page


def paste(page: Path, blocks: Mapping[str, str]) -> None:
    """Put each block between its markers."""
    text = page.read_text(encoding="utf-8")
    for name, block in blocks.items():
        found = re.compile(rf"(<!-- story {name} -->\n).*?(<!-- end -->)", re.DOTALL)
        text = found.sub(lambda m, b=block: f"{m[1]}```\n{b}\n```\n{m[2]}", text)  # type: ignore[misc]
    page.write_text(text, encoding="utf-8")


def short(said: Mapping[str, str]) -> str:
    """Return the four commands with the lines that matter most."""
    lines = []
    for name, pattern in SHORT.items():
        lines.append("$ " + COMMANDS[name].partition(" --report")[0])
        lines.append(lines_of(said[name], pattern))
    return "\n".join(lines)


def lines_of(text: str, pattern: str) -> str:
    """Return the lines that hold a pattern."""
    return "\n".join(line for line in text.splitlines() if re.search(pattern, line))


def small(source: Path, target: Path) -> None:
    """Copy a picture with 64 colours, which is a third of the size."""
    from PIL import Image

    Image.open(source).convert("RGB").quantize(64).save(target, optimize=True)


def main() -> None:
    """Run everything and write the page."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--keep", metavar="DIR", help="where records, models and reports are left")
    keep = parser.parse_args().keep
    folder = Path(keep or tempfile.mkdtemp(prefix="signlin_story_"))
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "my_motor.yaml").write_text(MY_MOTOR, encoding="utf-8")
    truth = {name: record(folder, name) for name in RECORDS}["tuesday"]
    said = {name: run(folder, command) for name, command in COMMANDS.items()}
    shown = said | {name: lines_of(said[name], pattern) for name, pattern in WITHOUT_ROWS.items()}
    shown["diagnose"] = BASE_ROWS.sub("", said["diagnose"])
    blocks = {name: f"$ {COMMANDS[name]}\n{text}" for name, text in shown.items()}
    model = {"base": MY_MOTOR.rstrip(), "model": (folder / "my_motor_2.yaml").read_text(encoding="utf-8").rstrip()}
    blocks |= {**model, "short": short(said), "predictions": predictions(folder, truth), "ros": on_ros(folder)}
    for page in (DOCS / "diagnosis.md", DOCS.parent / "README.md"):
        paste(page, blocks)
    for source, target in PICTURES.items():
        small(folder / source, DOCS / "images" / target)
    if not keep:
        shutil.rmtree(folder)


if __name__ == "__main__":
    main()
