"""The command ``experiment``: the next record, that tells the rivals of a diagnosis apart."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from signlin_ros.cli.arms import refuse
from signlin_ros.cli.options import Examples, Report, cure_option, json_option, mapping_of, signal_option
from signlin_ros.cli.telling import command_line, progress
from signlin_ros.cli.values import numbers_of
from signlin_ros.errors import InputError

if TYPE_CHECKING:
    from signlin_ros.experiment.setting import KnownLimits
    from signlin_ros.model import Model
    from signlin_ros.records import ModelData

FILE_KINDS = (".csv",)
RIVALS = ".rivals.json"
"""How the file of the rivals ends, beside that of the command."""


@click.command(
    cls=Examples,
    epilog="""signlin experiment my_motor.yaml monday.csv --limit voltage=6 --limit speed=80 -o next.csv
signlin diagnose my_motor.yaml monday.csv --json > diagnosis.json
signlin experiment diagnosis.json --between coulomb_friction,stribeck_friction -o next.csv --report next.html
signlin diagnose my_motor.yaml monday.csv next.csv --validation next_again.csv --rivals next.rivals.json""",
)
@click.argument("source", metavar="MODEL|DIAGNOSIS.json")
@click.argument("data", nargs=-1, metavar="[DATA...]")
@click.option(
    "--between",
    metavar="A,B",
    help="The rivals: effects, joined by + where a rival has several; +all_forces: with all forces 10 % larger.",
)
@click.option(
    "--limit",
    "limits",
    multiple=True,
    metavar="NAME=VALUE,...",
    help="Largest |value| of the input and of states, of a position its distance from the start (also travel=...);"
    " slew: change of the input per s. Default: what the first records visited. Repeatable.",
)
@click.option(
    "--duration", type=float, metavar="SECONDS", help="Length of one run; default: that of the first records."
)
@click.option("--spare", type=float, default=0.2, show_default=True, help="Part of each limit that no rival may use.")
@click.option("--seed", type=click.IntRange(0), default=1, show_default=True, help="Of what is drawn at random.")
@click.option(
    "--jobs", type=click.IntRange(1, 256), help="Fits of the diagnosis side by side; default: one per processor."
)
@click.option("-o", "--output", required=True, metavar="OUT.csv", help="Where to write the command: t and the input.")
@click.option("--report", metavar="OUT.html", help="Write a report with a preview of what each rival would show.")
@cure_option
@signal_option
@json_option
def experiment(
    source: str,
    data: tuple[str, ...],
    between: str | None,
    limits: tuple[str, ...],
    duration: float | None,
    spare: float,
    seed: int,
    jobs: int | None,
    output: str,
    report: str | None,
    signals: tuple[str, ...],
    cures: tuple[str, ...],
) -> Report:
    """Design the next record: the command over time that tells rivals of a diagnosis apart, within limits.

    The rivals are those that the diagnosis of DATA with MODEL, or the JSON of `signlin diagnose --json`, does not
    exclude. OUT.csv is the quietest command that is enough, at rest at both ends; record it twice. OUT.rivals.json
    beside it is what `signlin diagnose --rivals` starts from. Where no command tells them apart, it says so, and what
    else would.
    """
    if not 0.0 <= spare < 1.0:
        raise InputError(f"--spare: found {spare:g}; allowed: 0 to below 1")
    numbers, names = numbers_of(limits, "--limit"), [n for n in (between or "").split(",") if n.strip()]
    told = _diagnosis(source) if not data else None
    files = [_found(path, source) for path in told["data"]] if told else list(data)
    mapping = mapping_of(signals, *files)
    from signlin_ros.experiment.text import experiment_text
    from signlin_ros.experiment.verbs import ExperimentWishes, designed
    from signlin_ros.files import write_text
    from signlin_ros.follow.data import load_sides
    from signlin_ros.guard import check_files, check_sides
    from signlin_ros.model import Model

    given = Model.from_yaml(told["given_model"], source) if told else Model.load(source)
    refuse(given, "experiment")
    refuse(given, "experiment")
    check_files(given, files, (), output, FILE_KINDS, report)
    loaded, first, _ = load_sides(given, files, (), mapping)
    first, _, _ = check_sides(loaded, first, None, cures)
    rivals = _rivals(told, loaded, first, names, jobs)
    dt = click.get_current_context().meta.get("signlin.dt")
    wishes = ExperimentWishes(tuple(names), numbers, duration, dt, spare, seed)
    model = "MODEL" if told else source
    known = Path(output).with_suffix(RIVALS)
    after = command_line(
        ("diagnose", model, *files, output),
        validation=_again(output),
        rivals=str(known),
        signal=signals,
        cure=cures,
        output=None,
    )
    plan = designed(loaded, first, rivals, wishes, _stage, after)
    if told:
        plan = replace(plan, after=after.replace("MODEL", "MODEL.yaml", 1))
    try:
        write_text(output, plan.to_csv())
        write_text(known, plan.to_rivals())
        if plan.reference:
            write_text(Path(output).with_suffix(".trajectory.yaml"), plan.to_trajectory("joint"))
    except OSError as error:
        raise InputError(f"-o: cannot write {output}: {error.strerror}") from error
    if report is not None:
        from signlin_ros.experiment.report import experiment_report

        options = {"between": between, "limit": limits, "duration": duration, "spare": spare, "seed": seed}
        options |= {"signal": signals, "cure": cures, "output": output}
        experiment_report(plan, report, command=command_line(("experiment", source, *data), **options))
    return plan.to_json(), experiment_text


def _again(output: str) -> str:
    path = Path(output)
    return str(path.with_name(f"{path.stem}_again{path.suffix}"))


def _stage(what: str, share: float) -> None:
    progress(f"  {100 * share:3.0f} %  {what}")


def _diagnosis(path: str) -> Mapping[str, Any]:
    """Return the JSON of a diagnosis; raise `InputError` for what is none, or is of an older version."""
    if not path.endswith(".json"):
        raise InputError(f"{path}: DATA is missing: give MODEL and its records, or the JSON of signlin diagnose --json")
    try:
        content = json.loads(Path(path).read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from error
    except ValueError as error:
        raise InputError(f"{path}: no JSON: {error}") from error
    if not isinstance(content, dict) or "ranking" not in content:
        raise InputError(f"{path}: not what signlin diagnose --json prints")
    if "joints" in content:
        raise InputError(f"{path}: of an arm; experiment does not take an arm")
    if not {"rivals", "given_model", "data"} <= content.keys():
        repeat = "signlin diagnose MODEL DATA... --json > " + path
        raise InputError(f"{path}: made by an older version, which did not tell the rivals; repeat: {repeat}")
    return content


def _found(path: str, beside: str) -> str:
    """Return a record's file, from here or beside the diagnosis; raise `InputError` where it is not there any more."""
    for place in (Path(path), Path(beside).parent / path):
        if place.exists():
            return str(place)
    raise InputError(f"{beside}: its record {path} is neither here nor beside it")


def _rivals(
    told: Mapping[str, Any] | None, model: Model, records: Sequence[ModelData], between: Sequence[str], jobs: int | None
) -> list[KnownLimits]:
    """Return the rivals of a diagnosis, made now where none is told; with what was named and is not among them."""
    from signlin_ros.experiment.naming import open_names, with_named
    from signlin_ros.experiment.setting import known_rivals

    if told is None and between:
        return with_named([], model, records, between)
    if told is None:
        from signlin_ros.diagnosis.verbs import diagnose

        progress("diagnosing first ...")
        told = diagnose(model, records, jobs=jobs or os.cpu_count() or 1, progress=_stage).to_json()
    rivals = known_rivals(told["rivals"])
    return with_named(rivals, model, records, between or open_names(told))


__all__ = ["experiment"]
