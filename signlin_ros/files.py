"""Files that are written whole or not at all."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


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


__all__ = ["replacing", "write_text"]
