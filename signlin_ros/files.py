"""Files that are written whole or not at all, and never over what the run reads."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

from signlin_ros.errors import InputError

TEXT = (".csv", ".txt", ".tsv", ".dat", ".log", ".lvm", ".trace", ".asc", ".prn", ".jsonl", ".ndjson")
PACKED = (".gz", ".zip", ".bz2", ".xz")
ECHOES = (".yaml", ".yml")
BAGS = (".mcap", ".db3")
ARRAYS = (".mat", ".npz", ".h5", ".hdf5")
LOGS = (".json",)
TABLES = (*ARRAYS, ".parquet", ".feather", ".arrow", ".mf4", ".mdf", ".tdms")
"""Suffixes of records: text, packed text, messages that were echoed, bags' files, named arrays, logs of servos, all
tables in binary files.
"""


@contextmanager
def replacing(target: Path) -> Iterator[Path]:
    """A path to write to, renamed to ``target`` at the end and removed on any failure, an interrupt included.

    Pipes and devices are written to directly; what a symbolic link points to is replaced, not the link.
    """
    target = target.resolve()
    if target.exists() and not target.is_file():
        yield target
        return
    temporary = target.with_name(f".{target.name}.{os.getpid()}.tmp")
    try:
        yield temporary
        temporary.replace(target)
    finally:
        temporary.unlink(missing_ok=True)


def write_text(path: str | Path, text: str) -> None:
    """Write text to a file; raises `OSError`."""
    with replacing(Path(path)) as part:
        part.write_text(text, encoding="utf-8")


def refusal(target: Path) -> str:
    """Return why a file cannot be written, or an empty text; a file beside it is made and removed to find out."""
    if target.is_dir():
        return "this is a folder"
    if not target.parent.is_dir():
        return f"the folder {str(target.parent)!r} does not exist"
    if target.exists() and not target.is_file():
        return "" if os.access(target, os.W_OK) else "it cannot be written to"
    whole = target.resolve()
    try:
        with tempfile.NamedTemporaryFile(dir=whole.parent, prefix=f".{whole.name}."):
            return ""
    except OSError as error:
        return f"cannot be written: {error.strerror or error}"


def check_output(option: str, path: str | Path, kinds: Sequence[str], inputs: Mapping[Path, str]) -> None:
    """Refuse, before any work, a file of the wrong kind, one that cannot be written, and one that is an input.

    ``kinds``: suffixes; ``inputs``: what the run reads (a folder stands for what is in it) and its name for messages.
    Raises `InputError`.
    """
    target = Path(path)
    if target.suffix.lower() not in kinds:
        raise InputError(f"{option} {path}: found the suffix {target.suffix!r}; allowed: {' or '.join(kinds)}")
    why = refusal(target)
    if why:
        raise InputError(f"{option} {path}: {why}")
    for file, name in inputs.items():
        if _holds(file, target):
            raise InputError(f"{option} {path}: would replace {name}; choose another file")


def _holds(file: Path, target: Path) -> bool:
    """Tell whether a file or folder is, or holds, an existing target."""
    if not (file.exists() and target.exists()):
        return False
    inside = file.is_dir() and target.resolve().is_relative_to(file.resolve())
    return inside or target.samefile(file)


__all__ = ["check_output", "refusal", "replacing", "write_text"]
