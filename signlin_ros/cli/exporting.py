"""The command ``export``: a model as a file for another tool, run there."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click

from signlin_ros.cli.options import Examples, Report, cure_option, json_option, mapping_of, signal_option
from signlin_ros.cli.telling import progress, tell

TARGETS = (
    "mjcf",
    "c",
    "fmu",
    "python-control",
    "casadi",
    "do-mpc",
    "sympy",
    "urdf",
    "sdf",
    "bam",
    "isaaclab",
)


@click.command(
    cls=Examples,
    epilog="""signlin export dc_motor --to mjcf -o motor.xml
signlin export my_motor.yaml --to c -o motor.c
signlin export my_servo.yaml --to mjcf -o servo.xml --data run3.json --json""",
)
@click.argument("model")
@click.option("--to", "target", required=True, metavar="TARGET", help=f"One of: {', '.join(TARGETS)}.")
@click.option("-o", "--output", required=True, metavar="OUT", help="The file to write.")
@click.option("--data", metavar="DATA", help="The record to run the file on; else a stated standard excitation.")
@cure_option
@signal_option
@json_option
def export(
    model: str, target: str, output: str, data: str | None, signals: tuple[str, ...], cures: tuple[str, ...]
) -> Report:
    """Write MODEL as a file for another tool, and say what is lost.

    The file is run in that tool (MuJoCo, a C compiler, FMPy ...) with the inputs in DATA and compared with our
    exact model and with the measurement. Where the tool is not installed the file is written all the same, and
    the answer says that it was not run.
    """
    from signlin_ros.export import export as write
    from signlin_ros.export import find_target
    from signlin_ros.guard import check_files
    from signlin_ros.model import Model

    suffix = find_target(target).suffix
    mapping = mapping_of(signals, *([data] if data else []))
    loaded = Model.load(model)
    check_files(loaded, (data,) if data else (), output=output, kinds=(suffix,))
    record = None
    if data:
        from signlin_ros.checks.run import check as cured
        from signlin_ros.records import read_for_model

        record = read_for_model(data, loaded, mapping)
        if cures:
            (record,), _ = cured(loaded, [record], cures)
        for note in record.notes:
            tell(f"note: {note}")
    progress(f"writing {Path(output).name} and running it (some seconds) ...")
    return write(loaded, target, output, record).content(), export_text


def export_text(content: Mapping[str, Any]) -> str:
    """Return the text that the command prints."""
    lines = [f"wrote {', '.join(content['files'])}"]
    lines += [f"held: {line}" for line in content["holds"]]
    lines += [f"lost: {line}" for line in content["lost"]]
    lines += [f"{name}: {value}" for name, value in content["settings"].items()]
    if content["not_run"]:
        return "\n".join([*lines, f"not run: {content['not_run']}"])
    lines.append(f"driven by {content['driven_by']}; RMS errors against {content['against']}:")
    for name, c in content["loss"].items():
        lines.append(
            f"  {name}: {c['ours']:.4g} -> {c['target']:.4g} {c['unit']}"
            f" (our exact model -> {content['target']}; {c['percent']:.2g} % of its RMS apart)"
        )
    return "\n".join(lines)


__all__ = ["TARGETS", "export"]
