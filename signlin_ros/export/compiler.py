"""A C compiler of this machine: cc, gcc or clang, else the one in the package `ziglang`."""

from __future__ import annotations

import importlib.util
import os
import shlex
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from signlin_ros.export.base import NotRunError

STRICT_FLAGS = ("-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror")
"""What exported C is clean under."""


def compiler() -> list[str]:
    """Return the command of a C compiler; raise `NotRunError` where there is none."""
    given = os.environ.get("CC")
    if given:
        return shlex.split(given)
    for name in ("cc", "gcc", "clang"):
        found = shutil.which(name)
        if found:
            return [found]
    return zig()


def zig() -> list[str]:
    """Return the command of zig's C compiler, which builds for other machines too; raise `NotRunError`."""
    if importlib.util.find_spec("ziglang") is None:
        raise NotRunError("no C compiler (cc, gcc, clang or the package ziglang)")
    return [sys.executable, "-m", "ziglang", "cc"]


def build(sources: Sequence[Path], library: Path, options: Sequence[str] = ()) -> None:
    """Compile C sources into a shared library; raise `NotRunError` with the compiler's words if that fails."""
    command = [
        *compiler(),
        *STRICT_FLAGS,
        "-O2",
        "-fPIC",
        "-shared",
        *options,
        *map(str, sources),
        "-o",
        str(library),
        "-lm",
    ]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise NotRunError(f"the C compiler says: {done.stderr.strip()[:300]}")


__all__ = ["STRICT_FLAGS", "build", "compiler", "zig"]
