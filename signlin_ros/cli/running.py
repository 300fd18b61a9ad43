"""The group of all commands, and how one of them is run and ends."""

from __future__ import annotations

import os
import sys
import warnings
from collections.abc import Sequence
from typing import cast

import click

from signlin_ros import __version__
from signlin_ros.cli.diagnosing import add, diagnose, refine
from signlin_ros.cli.experimenting import experiment
from signlin_ros.cli.exporting import export
from signlin_ros.cli.listing import effects, plants
from signlin_ros.cli.live import ros, warm
from signlin_ros.cli.models import gains, linearize, simulate
from signlin_ros.cli.options import SystemFaultError
from signlin_ros.cli.records import check, compare
from signlin_ros.cli.showing import figures, workbench
from signlin_ros.cli.telling import tell
from signlin_ros.errors import InputError, MissingExtraError


@click.group(
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110},
    epilog="Start with: signlin linearize dc_motor --at current=0.4,speed=20",
)
@click.version_option(__version__, prog_name="signlin")
def signlin() -> None:
    """Linear models x' = A x + B u + c of drives with dry friction, backlash and hysteresis.

    MODEL is a ROS 2 parameter file (the one that the linearizer node takes) or the name of a shipped model:
    dc_motor, mass_spring_damper, bouc_wen, force_element, emps, xl330, xl330_servo, mx64_servo,
    mx106_servo, sts3215_servo. DATA is a table in a text or
    binary file (CSV, MAT, Parquet ...) or a rosbag2 recording. Everything is in SI units.

    Exit code 0: done; 2: bad input, with one line that names it; 1: a fault of signlin.
    """


def _one_line(error: BaseException) -> str:
    return " ".join(str(error).split())


def _usage(error: click.UsageError) -> str:
    where = f" (see: {error.ctx.command_path} --help)" if error.ctx else ""
    return " ".join(error.format_message().split()) + where


def _fault(error: Exception) -> int:
    """Report a fault of ours; the traceback only where it was asked for."""
    if os.environ.get("SIGNLIN_DEBUG", "") not in ("", "0"):
        raise error
    tell(
        f"signlin: {type(error).__name__}: {_one_line(error)}; this is a fault of signlin: please report it"
        " with the command and its files (SIGNLIN_DEBUG=1 shows where)"
    )
    return 1


def _drop_output() -> None:
    """Let what is still to be written to standard output go nowhere, if it can be written nowhere else."""
    try:
        sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _run(arguments: Sequence[str] | None) -> int:
    """Run a command; what overflows on the way is no news: where it matters, the result or the error says so."""
    with warnings.catch_warnings():
        if not sys.warnoptions:
            warnings.simplefilter("ignore", RuntimeWarning)
        given = None if arguments is None else list(arguments)
        code = signlin.main(args=given, prog_name="signlin", standalone_mode=False)
    return code if isinstance(code, int) else 0


for _command in (
    *(linearize, simulate, gains, check, compare, diagnose, add, refine, experiment, export),
    *(effects, plants, figures, workbench, ros, warm),
):
    signlin.add_command(_command)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; return the exit code: 0 done, 2 bad input, 1 a fault of ours."""
    try:
        return _run(arguments)
    except click.exceptions.NoArgsIsHelpError as error:
        tell(error.format_message())
        return 2
    except click.UsageError as error:
        tell(f"signlin: {_usage(error)}")
        return 2
    except (InputError, MissingExtraError) as error:
        tell(f"signlin: {_one_line(error)}")
        return 2
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] == __name__.partition(".")[0]:
            return _fault(error)
        tell(f"signlin: the Python module {error.name} is not there: pip install {error.name}")
        return 2
    except (click.Abort, KeyboardInterrupt):
        tell("signlin: interrupted")
        return 130
    except BrokenPipeError:
        _drop_output()  # nobody reads on: `signlin effects | head`
        return 0
    except OSError as error:
        _drop_output()  # what did not fit on a full disk is not tried again at the end
        tell(f"signlin: writing the output: {error.strerror or error}")
        return 2
    except SystemFaultError as error:
        return _fault(cast("Exception", error.__cause__))
    except Exception as error:  # noqa: BLE001 - the last resort, so that nobody meets a traceback
        return _fault(error)


__all__ = ["main", "signlin"]
