"""A tie, the experiment that decides it, played over ROS 2, and the verdict.

    python -m signlin_ros.demo.experiment --output out

A motor was recorded while it turned one way, as a conveyor does: dry friction is a constant load there, and the
diagnosis cannot tell. `signlin experiment` plans the next record; the node ``play`` plays it twice to the node
``plant_simulator``, which stands for the machine; the diagnosis of all three records names the right one.
"""

from __future__ import annotations

import json
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import click
import numpy as np

from signlin_ros.demo.processes import DemoError, prefix
from signlin_ros.errors import MissingExtraError, SignlinError
from signlin_ros.model import Model
from signlin_ros.names import printed_name
from signlin_ros.simulation import simulate

RECORD_STEP, RECORD_LENGTH = 0.01, 8.0
"""Of the first record, in s."""
HIDDEN_FRICTION, RECORD_NOISE = 0.03, 0.05
"""Friction in N·m; white noise of current in A and speed in rad/s."""
VOLTAGE, SPEED = 6.0, 60.0
"""Limits in V and rad/s."""
EXPERIMENT_NAMESPACE = "/experiment"
MAX_RUN_WAIT = 120.0
"""Seconds to wait for the play, beyond its own length."""


def nominal() -> Model:
    """Return the nominal model of the machine: no friction."""
    model = Model.load("dc_motor").without_effect("coulomb_friction").with_parameters({"B": 2e-4})
    return model.with_options(tolerance={"R_a": 0.05, "L_a": 0.05, "K_t": 0.05, "K_m": 0.05, "J": 0.05, "B": 0.3})


def first_record(folder: Path) -> Path:
    """Write the record of a motor that turns one way."""
    t = RECORD_STEP * np.arange(round(RECORD_LENGTH / RECORD_STEP))
    wave = sum(np.sin(2 * np.pi * f * t + f) for f in (0.5, 1.3, 2.9))
    u = (3.5 + 0.5 * wave) * np.clip(t / 0.2, 0.0, 1.0)
    run = simulate(nominal().with_effect("coulomb_friction", mu=HIDDEN_FRICTION), t, u[:, None])
    g = np.random.default_rng(1)
    shown = [run[c] + RECORD_NOISE * g.standard_normal(t.size) for c in ("current", "speed")]
    moving = t > 0.3
    table = np.column_stack([t, u, *shown])[moving]
    path = folder / "first.csv"
    np.savetxt(path, table, delimiter=",", header="t,voltage,current,speed", comments="", fmt="%.7g")
    return path


def signlin(folder: Path, *arguments: str) -> dict[str, Any]:
    """Run the command line in a folder and return its JSON; raise `DemoError` where it fails."""
    command = [sys.executable, "-m", "signlin_ros.cli", *arguments, "--json"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode:
        raise DemoError(done.stderr.strip())
    return dict(json.loads(done.stdout))


def played(folder: Path, length: float) -> str:
    """Play ``next.csv`` twice to a simulated machine over ROS 2, and return how that ended."""
    place, logs = prefix() / "lib" / "signlin_ros", folder / "logs"
    logs.mkdir(exist_ok=True)
    nominal().with_effect("coulomb_friction", mu=HIDDEN_FRICTION).save(folder / "machine.yaml")
    simulator = [f"publish_rate:={1 / RECORD_STEP:g}", f"noise:={RECORD_NOISE}", "seed:=7"]
    player = ["command:=next.csv", "output:=played.csv", f"limit:={VOLTAGE}", f"limits:=speed={SPEED:g}"]
    player += ["state_timeout:=1.0", "first_record:=first.csv", "ramp:=0.0"]
    running = []
    try:
        for name, model, options in (("plant_simulator", "machine.yaml", simulator), ("play", "model.yaml", player)):
            parameters = [part for option in options for part in ("-p", option)]
            command = [
                str(place / name),
                "--ros-args",
                "--params-file",
                model,
                "-r",
                f"__ns:={EXPERIMENT_NAMESPACE}",
                *parameters,
            ]
            with (logs / f"{name}.log").open("wb") as out:
                running.append(subprocess.Popen(command, cwd=folder, stdout=out, stderr=out))
        end = time.monotonic() + 2 * length + MAX_RUN_WAIT
        while running[1].poll() is None and running[0].poll() is None and time.monotonic() < end:
            time.sleep(0.2)
    finally:
        for process in running:
            process.terminate()
        for process in running:
            process.wait(15.0)
    told = (logs / "play.log").read_text(errors="replace").strip().splitlines()
    if not (folder / "played_again.csv").exists():
        raise DemoError("the play did not end: " + (told[-1] if told else "nothing was said"))
    return next((line.partition("]: ")[2] for line in reversed(told) if "recorded" in line), "")


def tell(folder: Path) -> dict[str, Any]:
    """Run the demo in a folder, say what happens, and return the last diagnosis."""
    nominal().save(folder / "model.yaml")
    first_record(folder)
    click.echo("The motor turned one way. signlin diagnose model.yaml first.csv:")
    found = signlin(folder, "diagnose", "model.yaml", "first.csv")
    (folder / "diagnosis.json").write_text(json.dumps(found), encoding="utf-8")
    click.echo(f"  {found['sentence']}")
    ties = [printed_name(t) for e in found["ranking"][:1] for t in e["indistinguishable_from"]]
    click.echo(f"  as good: {', '.join(ties) or 'nothing'}")
    between = "coulomb_friction,constant_load"
    click.echo(f"\nsignlin experiment diagnosis.json --between {between} --limit voltage={VOLTAGE:g},speed={SPEED:g}:")
    options = ("--between", between, "--limit", f"voltage={VOLTAGE:g},speed={SPEED:g}", "-o", "next.csv")
    plan = signlin(folder, "experiment", "diagnosis.json", *options, "--report", "next.html")
    click.echo(f"  {plan['sentence']}\n  {plan['command']['words']}")
    click.echo("\nPlayed twice over ROS 2 by the node play:")
    click.echo(f"  {played(folder, plan['command']['duration'])}")
    words: tuple[str, ...] = ("diagnose", "model.yaml", "first.csv", "played.csv", "--validation", "played_again.csv")
    words += ("--rivals", "next.rivals.json")
    click.echo(f"\nsignlin {' '.join(words)}:")
    last = signlin(folder, *words)
    click.echo(f"  {last['verdict'].upper()}: {last['sentence']}")
    for entry in last["ranking"]:
        if entry["effect"] in between.split(","):
            click.echo(f"  {entry['effect']:20s} {entry['status']}: {entry['why']}")
    return last


@click.command()
@click.option("--output", default="out", help="Folder for the records, the plan and its report.")
def main(output: str) -> None:
    """Run the demo of the next experiment."""
    folder = Path(output) / "experiment"
    folder.mkdir(parents=True, exist_ok=True)
    last = tell(folder.resolve())
    named = last["ladder"][-1]["effects"]
    click.echo(
        f"\n{folder / 'next.html'}; the machine has Coulomb friction, and {', '.join(named) or 'nothing'} is named"
    )
    if named != ["coulomb_friction"]:
        raise DemoError("another one was named")


if __name__ == "__main__":
    try:
        main(standalone_mode=False)
    except ModuleNotFoundError as error:
        raise SystemExit(str(MissingExtraError("the demo of the next experiment", "ros"))) from error
    except (SignlinError, click.ClickException) as error:
        raise SystemExit(f"demo of the next experiment: {error}") from error
