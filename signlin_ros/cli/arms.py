"""What `compare`, `diagnose`, `add` and `refine` do where MODEL is an arm, and the options that only these have."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from signlin_ros.cli.options import Report
from signlin_ros.cli.telling import progress
from signlin_ros.errors import InputError

if TYPE_CHECKING:
    from signlin_ros.model import Model

Command = TypeVar("Command", bound=Callable[..., Any])


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
        raise InputError(f"{what}: does not take an arm; arms: compare, diagnose, add, refine, simulate, linearize")


def refuse_elsewhere(model: Model, band: float | None, fit_share: float | None) -> None:
    """Refuse the options of arms where MODEL is none."""
    for name, value in (("--band", band), ("--fit-share", fit_share)):
        if value is not None:
            raise InputError(f"{name}: is for arms; the plant of {model.source} is {model.plant.name}")


def _sides(
    model: Any, data: Sequence[str], validation: Sequence[str], signals: Mapping[str, str], share: float | None
) -> tuple[Any, Any]:
    from signlin_ros.arms.data import HELD_OUT, read_data, sides

    progress("reading ...")
    records = read_data(model, data, signals)
    return sides(model, records, read_data(model, validation, signals) if validation else [], share or HELD_OUT)


def compared(
    model: Any,
    data: Sequence[str],
    validation: Sequence[str],
    signals: Mapping[str, str],
    band: float | None,
    share: float | None,
) -> Report:
    """Return what `compare` says of an arm."""
    from signlin_ros.arms.text import compare_text
    from signlin_ros.arms.told import compared_json
    from signlin_ros.arms.verbs import compare

    known, unseen = _sides(model, data, validation, signals, share)
    result = compare(model, known, unseen, band, lambda what: progress(f"  {what}"))
    return compared_json(result, model.source, list(data)), compare_text


def diagnosed(
    verb: str,
    model: Any,
    data: Sequence[str],
    validation: Sequence[str],
    signals: Mapping[str, str],
    band: float | None,
    share: float | None,
    output: str | None,
    effect: str | None,
) -> Report:
    """Return what `diagnose`, `add` and `refine` say of an arm; write the model and its URDF where asked for."""
    from signlin_ros.arms.proposal import placed
    from signlin_ros.arms.text import diagnose_text
    from signlin_ros.arms.told import diagnosed_json, sentences
    from signlin_ros.arms.verbs import add, diagnose
    from signlin_ros.files import write_text

    known, unseen = _sides(model, data, validation, signals, share)
    arguments = (model, known, unseen, band, lambda what: progress(f"  {what}"))
    result = diagnose(*arguments) if effect is None else add(effect, *arguments)
    text, urdf, path = placed(result.proposal, output or Path(model.source).name)
    if output is not None:
        try:
            write_text(path, urdf)
            write_text(output, text)
        except OSError as error:
            raise InputError(f"-o: cannot write {output}: {error.strerror}") from error
    content = diagnosed_json(result, text, model.source, list(data))
    written = {"files": [str(output), str(path)]} if output is not None else {}
    return {**content, "sentences": sentences(result), **written}, diagnose_text


__all__ = ["arm_options", "compared", "diagnosed", "is_arm", "refuse", "refuse_elsewhere"]
