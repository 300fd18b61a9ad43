"""The commands ``diagnose``, ``add`` and ``refine``: what a model lacks."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import click

from signlin_ros.cli.arms import ArmRequest, arm_options, diagnosed, is_arm, refuse, refuse_elsewhere
from signlin_ros.cli.options import (
    Examples,
    Report,
    cure_option,
    json_option,
    mapping_of,
    output_option,
    said_of_records,
    sides,
    signal_option,
    validation_option,
)
from signlin_ros.cli.telling import command_line, progress
from signlin_ros.errors import InputError

if TYPE_CHECKING:
    from signlin_ros.diagnosis.discrimination import PlannedRival


def _diagnosis_options(function: Callable[..., Report]) -> Callable[..., None]:
    """Add what `diagnose`, `add` and `refine` share: MODEL, DATA and the options on them."""
    found: Any = function
    for add_one in (
        arm_options,
        json_option,
        cure_option,
        signal_option,
        click.option("--jobs", type=click.IntRange(1, 256), help="Fits side by side; default: one per processor."),
        click.option("--report", metavar="OUT.html", help="Write a report with pictures."),
        validation_option,
        click.argument("data", nargs=-1, required=True, metavar="DATA..."),
        click.argument("model"),
    ):
        found = add_one(found)
    return cast("Callable[..., None]", found)


@click.command(
    cls=Examples,
    epilog="""signlin diagnose my_motor.yaml monday.csv --validation tuesday.csv
signlin diagnose my_motor.yaml run_1.csv run_2.csv --report diagnosis.html
signlin diagnose my_motor.yaml run.mcap --json > diagnosis.json""",
)
@click.option(
    "--rivals",
    metavar="FILE.json",
    help="Rivals of signlin experiment (or of diagnose --json): each is refitted from its own values, and must lose"
    " before another law is confirmed.",
)
@_diagnosis_options
def diagnose(**options: Any) -> Report:
    """Name the physical effect that MODEL lacks, going by the measurements in DATA, or say that none fits.

    All effects of the catalogue compete, faults of sensors among them; what wins must lower the error on data that
    the fit did not see. The verdict is adequate, missing or unexplained.
    """
    return _diagnosed("diagnose", **options)


@click.command(
    cls=Examples,
    epilog="""signlin add coulomb_friction my_motor.yaml run.csv -o my_motor_2.yaml
signlin add dahl_presliding damper.yaml a.csv --validation b.csv -o damper_2.yaml
signlin add learned_force drive.yaml a.csv --over speed -o drive_2.yaml""",
)
@click.argument("effect")
@click.option("--over", metavar="WHAT", help="For learned_force: speed, position, load, or two of them: speed,load.")
@output_option
@_diagnosis_options
def add(over: str | None, **options: Any) -> Report:
    """Add EFFECT to MODEL, fit it to DATA and write NEW.yaml: before and after, on data that the fit did not see.

    The effect learned_force is a curve that is learned from what inverse dynamics leaves, where nothing listed fits.
    """
    if options["effect"] == "learned_force":
        return _learned(over or "speed", **options)
    if over is not None:
        raise InputError("--over: only learned_force is learned over a coordinate")
    return _diagnosed("add", **options)


def _learned(
    over: str,
    effect: str,
    model: str,
    data: tuple[str, ...],
    validation: tuple[str, ...],
    report: str | None,
    output: str,
    signals: tuple[str, ...],
    jobs: int | None = None,
    cures: tuple[str, ...] = (),
    band: float | None = None,
    fit_share: float | None = None,
) -> Report:
    if report is not None:
        raise InputError("--report: add learned_force draws none; use signlin compare NEW.yaml DATA --report OUT.html")
    mapping = mapping_of(signals, *data, *validation)
    from signlin_ros import console
    from signlin_ros.checks.finding import to_json
    from signlin_ros.follow.data import load_sides
    from signlin_ros.guard import check_files, check_sides
    from signlin_ros.learning.missing import add_learned
    from signlin_ros.model import MODEL_SUFFIXES, Model

    original = Model.load(model)
    if is_arm(original):
        raise InputError("learned_force: is not learned for an arm")
    refuse_elsewhere(original, band, fit_share)
    check_files(original, data, validation, output, MODEL_SUFFIXES)
    loaded, first, second = load_sides(original, data, validation, mapping)
    first, second = sides(first, second)
    first, second, findings = check_sides(loaded, first, second, cures)
    progress(f"{effect}: {sum(map(len, [*first, *(second or ())]))} samples ...")
    new, content = add_learned(loaded, first, second, over)
    new = new.with_options(with_position=original.with_position)
    new.save(output)
    text = new.placed_in(Path(output).parent).to_yaml()
    return {**content, "model": text, "record": to_json(findings)}, console.diagnosis_text


@click.command(
    cls=Examples,
    epilog="""signlin refine my_motor.yaml run.csv -o my_motor_2.yaml
ros2 run signlin_ros linearizer --ros-args --params-file my_motor_2.yaml""",
)
@output_option
@_diagnosis_options
def refine(**options: Any) -> Report:
    """Diagnose MODEL and add what is missing until nothing confirmed is; writes NEW.yaml and says why it stopped."""
    return _diagnosed("refine", **options)


def _diagnosed(
    verb: str,
    model: str,
    data: tuple[str, ...],
    validation: tuple[str, ...],
    report: str | None,
    jobs: int | None,
    signals: tuple[str, ...],
    cures: tuple[str, ...],
    output: str | None = None,
    effect: str | None = None,
    band: float | None = None,
    fit_share: float | None = None,
    rivals: str | None = None,
) -> Report:
    mapping = mapping_of(signals, *data, *validation)
    from signlin_ros import console
    from signlin_ros.checks.finding import to_json
    from signlin_ros.diagnosis import verbs as page
    from signlin_ros.diagnosis.proposal import printed
    from signlin_ros.files import write_text
    from signlin_ros.follow.data import load_sides
    from signlin_ros.guard import check_files, check_sides
    from signlin_ros.model import MODEL_SUFFIXES, Model

    original = Model.load(model)
    check_files(original, data, validation, output, MODEL_SUFFIXES, report)
    if is_arm(original):
        if rivals is not None:
            refuse(original, "--rivals")
        asked = ArmRequest(original, data, validation, mapping, band, fit_share, cures, report, tuple(signals))
        return diagnosed(verb, asked, output, effect)
    refuse_elsewhere(original, band, fit_share)
    loaded, first, second = load_sides(original, data, validation, mapping)
    first, second = sides(first, second)
    first, second, findings = check_sides(loaded, first, second, cures)
    records = [*first, *(second or ())]
    progress(f"{verb}: {sum(map(len, records))} samples (the first run on a machine compiles for some seconds) ...")
    arguments = (*([effect] if effect else []), loaded, first, second)
    more = {"rivals": _rivals(rivals)} if rivals is not None else {}
    result = getattr(page, verb)(*arguments, jobs=jobs or os.cpu_count() or 1, progress=_stage, **more)
    result = printed(result, original, output, records)
    if output is not None:
        try:
            write_text(output, result.yaml)
        except OSError as error:
            raise InputError(f"-o: cannot write {output}: {error.strerror}") from error
    if len(result.ladder) > 1:  # standard errors of what was found tell more of it
        findings = [f for f in findings if f.check != "excitation"]
    if report is not None:
        from signlin_ros.report import diagnosis_report

        words = (verb, *([effect] if effect else []), model, *data)
        command = command_line(
            words, validation=validation, signal=signals, **said_of_records(), cure=cures, output=output
        )
        diagnosis_report(result, report, command=command, data=(first, second), model=loaded, record=findings)
    return {**result.to_json(), "data": [*data, *validation], "record": to_json(findings)}, console.diagnosis_text


def _rivals(path: str) -> Sequence[PlannedRival]:
    """Return the rivals of a plan's file or of the JSON of a diagnosis; raise `InputError` for what is none."""
    from signlin_ros.diagnosis.discrimination import PlannedRival

    try:
        content = json.loads(Path(path).read_text(encoding="utf-8"))
        told = content["rivals"]
    except OSError as error:
        raise InputError(f"--rivals: cannot read {path}: {error.strerror}") from error
    except (ValueError, TypeError, KeyError) as error:
        raise InputError(f"--rivals: {path} is no file of rivals: signlin experiment writes one") from error
    if not isinstance(told, list) or not all(isinstance(one, dict) for one in told):
        raise InputError(f"--rivals: {path} is no file of rivals: signlin experiment writes one beside its command")
    return [PlannedRival.of_json(one) for one in told]


def _stage(what: str, share: float) -> None:
    progress(f"  {100 * share:3.0f} %  {what}")


__all__ = ["add", "diagnose", "refine"]
