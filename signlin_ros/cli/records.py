"""The commands ``check`` and ``compare``: records, and a model against them."""

from __future__ import annotations

import click

from signlin_ros.cli.arms import ArmRequest, arm_options, checked, compared, is_arm, refuse_elsewhere
from signlin_ros.cli.options import (
    Examples,
    Report,
    cure_option,
    json_option,
    mapping_of,
    said_of_records,
    sides,
    signal_option,
    validation_option,
)
from signlin_ros.cli.telling import command_line, progress
from signlin_ros.errors import InputError


@click.command(
    cls=Examples,
    epilog="""signlin compare my_motor.yaml run.csv
signlin compare emps DATA_EMPS.csv --horizon 0.1 --report emps.html
signlin compare my_servo.yaml monday.csv tuesday.csv --signal displacement=q_meas""",
)
@click.argument("model")
@click.argument("data", nargs=-1, required=True, metavar="DATA...")
@validation_option
@click.option("--horizon", type=float, help="How far ahead to predict, in s; default: MODEL's update_period.")
@click.option("--cutoff", type=float, help="Low-pass of the effort computed from the motion, in Hz.")
@click.option("--report", metavar="OUT.html", help="Write a report with pictures.")
@arm_options
@cure_option
@signal_option
@json_option
def compare(
    model: str,
    data: tuple[str, ...],
    validation: tuple[str, ...],
    horizon: float | None,
    cutoff: float | None,
    report: str | None,
    signals: tuple[str, ...],
    cures: tuple[str, ...],
    band: float | None,
    fit_share: float | None,
) -> Report:
    """Compare MODEL with the measurements in DATA: how good it is, and where it fails.

    First what diagnose, add and refine show of the same files too: the prediction over windows of update_period,
    each from what was measured before it, and the force that is missing, of MODEL as given and with its base
    parameters refitted. Then, of DATA, the free run (simulated from an estimated start), the effort computed from
    the measured motion, what is missing from the equations, and the situations that hold more of the error than
    of the time. --horizon adds the prediction over other windows.
    """
    mapping = mapping_of(signals, *data, *validation)
    from signlin_ros import console
    from signlin_ros.checks.finding import to_json
    from signlin_ros.diagnosis.comparison import compare as run
    from signlin_ros.follow.data import load_sides
    from signlin_ros.guard import check_files, check_sides
    from signlin_ros.model import Model

    original = Model.load(model)
    check_files(original, data, validation, report=report)
    if is_arm(original):
        for name, value in (("--horizon", horizon), ("--cutoff", cutoff)):
            if value is not None:
                raise InputError(f"{name}: is not for arms; --band says below which frequency efforts are compared")
        return compared(ArmRequest(original, data, validation, mapping, band, fit_share, cures, report, tuple(signals)))
    refuse_elsewhere(original, band, fit_share)
    loaded, first, second = load_sides(original, data, validation, mapping)
    first, second = sides(first, second)
    first, second, findings = check_sides(loaded, first, second, cures)
    records = [*first, *(second or ())]
    progress(f"comparing {sum(map(len, records))} samples (the first run compiles for some seconds) ...")
    result = run(loaded, first, horizon, cutoff, second, progress=lambda what: progress(f"  {what}"))
    if report is not None:
        from signlin_ros.report import compare_report

        given = ("compare", model, *data)
        command = command_line(
            given,
            horizon=horizon,
            cutoff=cutoff,
            validation=validation,
            signal=signals,
            **said_of_records(),
            cure=cures,
        )
        compare_report(result, report, command, findings)
    return {**result.to_json(), "record": to_json(findings)}, console.compare_text


@click.command(
    cls=Examples,
    epilog="""signlin check my_motor.yaml run.csv
signlin check my_motor.yaml bag/ --signal voltage=/cmd.data --json
signlin diagnose my_motor.yaml run.csv --cure speed_in_rpm""",
)
@click.argument("model")
@click.argument("data", nargs=-1, required=True, metavar="DATA...")
@cure_option
@signal_option
@json_option
def check(model: str, data: tuple[str, ...], signals: tuple[str, ...], cures: tuple[str, ...]) -> Report:
    """Look for what is wrong with DATA before anything is concluded from it.

    What cannot do harm is put right and noted; other cures are offered by name, for --cure of this and every other
    verb. What is marked `refuse` stops compare, diagnose, add and refine until it is decided (`--cure none` takes the
    records as they are).
    """
    mapping = mapping_of(signals, *data)
    from signlin_ros import console
    from signlin_ros.checks.finding import to_json
    from signlin_ros.checks.run import check as run
    from signlin_ros.follow.data import load_records
    from signlin_ros.guard import check_files
    from signlin_ros.model import Model

    original = Model.load(model)
    check_files(original, data)
    if is_arm(original):
        return checked(ArmRequest(original, data, signals=mapping, cures=cures))
    loaded, records = load_records(original, data, mapping)
    _, findings = run(loaded, records, cures)
    return to_json(findings), console.check_text


__all__ = ["check", "compare"]
