"""Options that several commands share, what these report, and how that is printed."""

from __future__ import annotations

import errno
import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import click

from signlin_ros.apart import check_given
from signlin_ros.cli.values import numbers_of, pairs_of
from signlin_ros.errors import InputError

if TYPE_CHECKING:
    from signlin_ros.records import ModelData

Report = tuple[Mapping[str, Any], Callable[[Any], str]]


class Examples(click.Command):
    """A command whose help ends with examples, lines kept as they are written."""

    def format_epilog(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the examples."""
        with formatter.section("Examples"):
            formatter.write_text("\b\n" + (self.epilog or ""))


class SystemFaultError(Exception):
    """Holds, as its cause, what the system refused a command; what is not held was refused to standard output."""


_OF_THE_PATH = (errno.EACCES, errno.ENAMETOOLONG, errno.ELOOP)
"""What the system refuses for the path that it was given."""


@contextmanager
def faults_apart() -> Iterator[None]:
    """Tell what goes wrong in a command from what goes wrong when its answer is written."""
    try:
        yield
    except BrokenPipeError:
        raise
    except OSError as error:
        if error.filename is not None and error.errno in _OF_THE_PATH:
            raise InputError(f"{error.filename}: {error.strerror}") from error
        raise SystemFaultError from error


def json_option(function: Callable[..., Report]) -> Callable[..., None]:
    """Add ``--json`` and print what the command reports, as one JSON object or as text."""

    def run(as_json: bool, **arguments: Any) -> None:
        with faults_apart():
            content, text = function(**arguments)
            printed = json.dumps(content, indent=2, allow_nan=False) if as_json else text(content)
        click.echo(printed)

    run.__doc__, run.__name__ = function.__doc__, function.__name__
    run.__click_params__ = getattr(function, "__click_params__", [])  # type: ignore[attr-defined]
    return click.option("--json", "as_json", is_flag=True, help="Print one JSON object and nothing else.")(run)


_one_signal = click.option(
    "--signal",
    "signals",
    multiple=True,
    metavar="NAME=COLUMN",
    help="The column of DATA (or /topic.field[...]) that holds a signal of the model, or a formula of columns:"
    " 'speed = meas [rpm]', 'speed = -0.105 * meas', 'voltage = sign(dir) * pwm', 't = time [ms]';"
    " an input may be a number throughout: 'force = 0'."
    " FILE:NAME=COLUMN says it of one record. Repeatable.",
)
_dt_option = click.option(
    "--dt",
    type=float,
    metavar="SECONDS",
    callback=lambda ctx, parameter, value: _step(ctx, value),
    expose_value=False,
    help="DATA has no time: its rows are so many s apart.",
)


_set_option = click.option(
    "--set",
    "settings",
    multiple=True,
    metavar="[FILE:]NAME=VALUE",
    callback=lambda ctx, parameter, value: ctx.meta.__setitem__("signlin.set", value),
    expose_value=False,
    help="A parameter of the model that is known of DATA, or of one FILE of it: a number, or a column that holds it."
    " Repeatable.",
)


def _step(ctx: click.Context, value: float | None) -> None:
    """Keep --dt with the signals, as what the time is."""
    if value is None:
        return
    if not (math.isfinite(value) and value > 0.0):
        raise click.BadParameter(f"{value!r} is not a time in s", param_hint="--dt")
    ctx.meta["signlin.dt"] = value


def signal_option(function: Callable[..., Any]) -> Callable[..., Any]:
    """Add --signal, --dt and --set, which every verb that reads DATA takes."""
    return _one_signal(_dt_option(_set_option(function)))


def settings_given() -> tuple[str, ...]:
    """Return the options --set, as they were given."""
    found: tuple[str, ...] = click.get_current_context().meta.get("signlin.set", ())
    return found


def mapping_of(signals: Sequence[str], *files: str) -> dict[str, str]:
    """What --signal and --dt say of DATA: name, or FILE:NAME, -> column or formula; ``t`` -> the s from row to row."""
    found = pairs_of(signals, "--signal", "NAME=COLUMN")
    check_given(found, files)
    settings = pairs_of(settings_given(), "--set", "NAME=VALUE, or FILE:NAME=VALUE")
    check_given(settings, files, "--set")
    found |= settings
    step = click.get_current_context().meta.get("signlin.dt")
    if step is None:
        return found
    if "t" in found:
        raise InputError(f"--dt {step:g} and --signal t={found['t']} both say what the time is; give one")
    return {**found, "t": repr(step)}


def conditions_held_out() -> tuple[str, ...]:
    """Return the options --hold-out, as they were given."""
    found: tuple[str, ...] = click.get_current_context().meta.get("signlin.hold_out", ())
    return found


def said_of_records() -> dict[str, tuple[str, ...]]:
    """Return --set and --hold-out by their names, as they were given."""
    return {"set": settings_given(), "hold-out": conditions_held_out()}


def sides(known: list[ModelData], unseen: list[ModelData] | None) -> tuple[list[ModelData], list[ModelData] | None]:
    """Return the records of a fit and those for validation, of which --hold-out says which conditions they have."""
    from signlin_ros.records.conditions import held_apart

    said = numbers_of(conditions_held_out(), "--hold-out")
    return held_apart(known, unseen, said) if said else (known, unseen)


_validation = click.option(
    "--validation",
    multiple=True,
    metavar="DATA2",
    help="A record that no fit sees. Repeatable; without it the last third of every DATA is held out; of a servo's"
    " whole records in turn.",
)
_hold_out = click.option(
    "--hold-out",
    "held",
    multiple=True,
    metavar="NAME=VALUE",
    callback=lambda ctx, parameter, value: ctx.meta.__setitem__("signlin.hold_out", value),
    expose_value=False,
    help="The records of DATA with this known condition (as kp=200) are seen by no fit. Repeatable.",
)


def validation_option(function: Callable[..., Any]) -> Callable[..., Any]:
    """Add --validation and --hold-out, which say what no fit sees."""
    return _validation(_hold_out(function))


cure_option = click.option(
    "--cure",
    "cures",
    multiple=True,
    metavar="NAME",
    help="Apply what `signlin check` offers under this name; `none` takes the records as they are. Repeatable.",
)
output_option = click.option(
    "-o", "--output", required=True, metavar="NEW.yaml", help="The model file to write; not over MODEL."
)


__all__ = [
    "Examples",
    "Report",
    "SystemFaultError",
    "conditions_held_out",
    "cure_option",
    "faults_apart",
    "json_option",
    "mapping_of",
    "output_option",
    "said_of_records",
    "settings_given",
    "sides",
    "signal_option",
    "validation_option",
]
