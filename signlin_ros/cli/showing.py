"""The commands ``figures`` and ``workbench``: pictures of the paper, and the local page."""

from __future__ import annotations

from pathlib import Path

import click

from signlin_ros.cli.options import Examples, Report, json_option
from signlin_ros.cli.telling import progress
from signlin_ros.errors import InputError, MissingExtraError


@click.command(cls=Examples, epilog="signlin figures -o out")
@click.option("-o", "--output", required=True, metavar="DIR", help="The folder to write to; it is made if need be.")
@json_option
def figures(output: str) -> Report:
    """Redraw figures 1 to 6 of the paper, and what goes beyond them; numbers beside 4 and 5."""
    from signlin_ros.figures import make_figures
    from signlin_ros.files import refusal

    folder = Path(output)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"-o: {output}: {error.strerror}") from error
    why = refusal(folder / "figure_1.png")
    if why:
        raise InputError(f"-o: {output}: {why}")
    progress("drawing ...")
    return {"directory": str(folder), "files": make_figures(folder)["files"]}, lambda content: "\n".join(
        content["files"]
    )


@click.command(
    cls=Examples,
    epilog="""signlin workbench
signlin workbench my_motor.yaml monday.csv tuesday.csv
signlin workbench my_motor.yaml --namespace /arm --joint elbow
signlin workbench --host 0.0.0.0 --port 8080""",
)
@click.argument("model", required=False)
@click.argument("data", nargs=-1, metavar="[DATA...]")
@click.option(
    "--host", help="Listen on another address than 127.0.0.1; whoever opens the page needs the token printed."
)
@click.option("--port", default=0, type=click.IntRange(0, 65535), help="Default: any that is free.")
@click.option("--no-browser", is_flag=True, help="Only print the address.")
@click.option("--sample", is_flag=True, help="Begin with the sample record.")
@click.option("--namespace", default="", help="ROS namespace of the nodes that the tab Live follows.")
@click.option("--joint", default="joint", show_default=True, help="Which joint of joint_states it follows.")
def workbench(
    model: str | None,
    data: tuple[str, ...],
    host: str | None,
    port: int,
    no_browser: bool,
    sample: bool,
    namespace: str,
    joint: str,
) -> None:
    """Open a page on this machine on which records are compared, diagnosed and explained by clicking.

    What is done there is kept in the folder .signlin; every click shows the command that does the same.
    """
    try:
        from signlin_ros.workbench.server import serve
    except ModuleNotFoundError as error:
        if (error.name or "signlin_ros").startswith("signlin_ros"):
            raise
        raise MissingExtraError("The workbench", "web") from error
    live = (f"--namespace={namespace}", f"--joint={joint}")
    serve((model, *data) if model else (), host, port, show=not no_browser, sample=sample, live=live)


__all__ = ["figures", "workbench"]
