"""The demo from beginning to end."""

from __future__ import annotations

import signal
import sys
from collections.abc import Callable
from pathlib import Path

import click

from signlin_ros.demo.processes import LINEARIZERS, MODEL, DemoError, listen
from signlin_ros.demo.showing import draw, table
from signlin_ros.demo.worth import Rivals, on_grid, windows
from signlin_ros.errors import SignlinError
from signlin_ros.model import Model


def run(output: Path, seconds: float, say: Callable[[str], None]) -> str:
    """Do it all; return the text to print. Raises `SignlinError` when something fails."""
    output.mkdir(parents=True, exist_ok=True)
    model = Model.load(MODEL)
    heard = listen(seconds, say)
    say("comparing ...")
    record, rivals = on_grid(heard), Rivals(model)
    found = {point: windows(rivals, record, heard.models[name]) for point, name in LINEARIZERS.items()}
    for point, name in LINEARIZERS.items():
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


__all__ = ["main", "run"]
