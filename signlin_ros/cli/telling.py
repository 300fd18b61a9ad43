"""What goes to standard error, and the command line that does the same."""

from __future__ import annotations

import os
import shlex
import sys
from collections.abc import Sequence
from typing import Any

import click

from signlin_ros.names import PROGRESS_ASKED


def tell(text: str) -> None:
    """Say it on standard error."""
    click.echo(text, err=True)


def progress(text: str) -> None:
    """Say on standard error what takes its time, if somebody is looking."""
    if sys.stderr.isatty() or os.environ.get(PROGRESS_ASKED):
        tell(text)


def command_line(words: Sequence[str], **options: Any) -> str:
    """Return a command line; ``options``: by their names, one value or several, those that are empty left out."""
    parts = ["signlin", *words]
    for name, given in options.items():
        values = given if isinstance(given, tuple) else () if given is None else (str(given),)
        for value in values:
            parts += ["-o" if name == "output" else f"--{name}", value]
    return shlex.join(parts)


__all__ = ["command_line", "progress", "tell"]
