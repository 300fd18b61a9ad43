"""What the verbs do where MODEL is an arm, and the options that only arms have."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from signlin_ros.cli.options import Report, conditions_held_out, said_of_records
from signlin_ros.cli.telling import command_line, progress
from signlin_ros.errors import InputError

if TYPE_CHECKING:
    from signlin_ros.arms.data import ArmRun
    from signlin_ros.checks.finding import Finding
    from signlin_ros.model import Model

Command = TypeVar("Command", bound=Callable[..., Any])
VERBS = "check, compare, diagnose, add, refine, simulate, linearize, gains, export"
"""What takes arms."""


def arm_options(function: Command) -> Command:
    """Add the options of arms: the band of the efforts, and how much of DATA is fitted to."""
    band = click.option(
        "--band", type=float, metavar="HZ", help="Of an arm: low-pass of motion and efforts; default: chosen."
    )
    share = click.option(
        "--fit-share",
        "fit_share",
        type=click.FloatRange(0.1, 0.9),
        help="Of an arm: part of DATA to fit to; default 2/3.",
    )
    return band(share(function))


def is_arm(model: Model) -> bool:
    """Tell whether a model is that of an arm."""
    return model.plant.name == "arm"


def refuse(model: Model, what: str) -> None:
    """Refuse a verb or an option that does not take arms."""
    if is_arm(model):
        raise InputError(f"{what}: does not take an arm ({model.source}); arms: {VERBS}")


def refuse_elsewhere(model: Model, band: float | None, fit_share: float | None) -> None:
    """Refuse the options of arms where MODEL is none."""
    for name, value in (("--band", band), ("--fit-share", fit_share)):
        if value is not None:
            raise InputError(f"{name}: is for arms; the plant of {model.source} is {model.plant.name}")


@dataclass(frozen=True)
class ArmRequest:
    """What a verb is asked about an arm: its model, records, and options; ``report`` a path to write to, or None."""

    model: Any
    data: Sequence[str]
    validation: Sequence[str] = ()
    signals: Mapping[str, str] | None = None
    band: float | None = None
    share: float | None = None
    cures: Sequence[str] = ()
    report: str | None = None
    said: tuple[str, ...] = ()
    """--signal as it was given."""

    def sides(self) -> tuple[list[ArmRun], list[ArmRun], list[Finding]]:
        """Return the runs to fit, those that no fit sees, and what was found in the records.

        Raises `RecordError` where nothing may be concluded from them as they are.
        """
        from signlin_ros.arms.check import check
        from signlin_ros.arms.data import HELD_OUT, read_data, sides
        from signlin_ros.checks.run import require_sound

        if conditions_held_out():
            raise InputError("--hold-out: does not take an arm; give the records as --validation")
        progress("reading ...")
        signals = self.signals or {}
        records = read_data(self.model, self.data, signals)
        others = read_data(self.model, self.validation, signals) if self.validation else []
        sound, findings = check(self.model, [*records, *others], self.cures)
        require_sound(findings, self.cures)
        count = len(records)
        return (*sides(self.model, sound[:count], sound[count:], self.share or HELD_OUT), findings)

    def command(self, *words: str, output: str | None = None) -> str:
        """Return the command line that does the same."""
        given = {"validation": tuple(self.validation), "band": self.band, "fit-share": self.share}
        more = {"signal": self.said, **said_of_records(), "cure": tuple(self.cures), "output": output}
        return command_line((*words, self.model.source, *self.data), **given, **more)

    def reported(self, result: Any, content: Mapping[str, Any], command: str) -> None:
        """Write the report where one is asked for."""
        if self.report is not None:
            from signlin_ros.arms.report import arm_report

            progress("drawing ...")
            arm_report(result, content, self.report, command)


def checked(request: ArmRequest) -> Report:
    """Return the JSON of `check` for an arm's records."""
    from signlin_ros import console
    from signlin_ros.arms.check import check
    from signlin_ros.arms.data import read_data
    from signlin_ros.checks.finding import to_json

    _, findings = check(request.model, read_data(request.model, request.data, request.signals or {}), request.cures)
    return to_json(findings), console.check_text


def compared(request: ArmRequest) -> Report:
    """Return the JSON of `compare` for an arm."""
    from signlin_ros.arms.text import compare_text
    from signlin_ros.arms.told import compared_json
    from signlin_ros.arms.verbs import compare
    from signlin_ros.checks.finding import to_json

    known, unseen, findings = request.sides()
    result = compare(request.model, known, unseen, request.band, lambda what: progress(f"  {what}"))
    content = {**compared_json(result, request.model.source, list(request.data)), "record": to_json(findings)}
    request.reported(result, content, request.command("compare"))
    return content, compare_text


def diagnosed(verb: str, request: ArmRequest, output: str | None, effect: str | None) -> Report:
    """Return the JSON of `diagnose`, `add` or `refine` for an arm; write the model and its URDF where asked for."""
    from signlin_ros.arms.proposal import placed
    from signlin_ros.arms.text import diagnose_text
    from signlin_ros.arms.told import diagnosed_json, sentences
    from signlin_ros.arms.verbs import add, diagnose
    from signlin_ros.checks.finding import to_json
    from signlin_ros.files import write_text

    model = request.model
    known, unseen, findings = request.sides()
    arguments = (model, known, unseen, request.band, lambda what: progress(f"  {what}"))
    result = diagnose(*arguments) if effect is None else add(effect, *arguments)
    text, urdf, path = placed(result.proposal, output or Path(model.source).name)
    if output is not None:
        try:
            write_text(path, urdf)
            write_text(output, text)
        except OSError as error:
            raise InputError(f"-o: cannot write {output}: {error.strerror}") from error
    content = diagnosed_json(result, text, model.source, list(request.data))
    content |= {"sentences": sentences(result), "record": to_json(findings)}
    content |= {"files": [str(output), str(path)]} if output is not None else {}
    words = (verb, *([effect] if effect else []))
    request.reported(result, content, request.command(*words, output=output))
    return content, diagnose_text


def gains_of(model: Any, at: Mapping[str, float], numbers: Mapping[str, float | None]) -> Report:
    """Return the JSON of `gains` for an arm."""
    from signlin_ros.arms.feedforward import gains_content, gains_text

    if numbers["limit"] is not None:
        raise InputError("--limit: is not taken for an arm; taken: --at, --period, --delay, --speed, --bandwidth")
    period = numbers["period"] or 0.0
    wishes = {name: numbers[name] for name in ("delay", "speed", "bandwidth")}
    return gains_content(model, at, period, **wishes), gains_text


__all__ = [
    "ArmRequest",
    "arm_options",
    "checked",
    "compared",
    "diagnosed",
    "gains_of",
    "is_arm",
    "refuse",
    "refuse_elsewhere",
]
