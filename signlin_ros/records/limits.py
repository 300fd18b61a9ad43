"""What a record may hold at most, so that a small file of bad luck or bad will does not fill the memory."""

from __future__ import annotations

from typing import IO

from signlin_ros.errors import RecordError

UNPACKED = 2 << 30
"""Bytes that a packed file may hold."""
RATIO = 100
"""So many times its own size a packed file may hold; measured data pack to a third or a tenth."""
MAX_SMALL_FILE = 1 << 20
"""Bytes that a packed file of any size may hold."""
MAX_ARCHIVE_NAMES = 1000
"""Files in an archive."""
CELL = 1 << 20
"""Characters of a cell."""
CELL_SEPARATORS = "\t;,| "
_READ_CHUNK = 1 << 20


def most_unpacked(packed: int) -> int:
    """Return how many bytes a file of ``packed`` bytes may hold."""
    return min(UNPACKED, max(RATIO * packed, MAX_SMALL_FILE))


def check_unpacked(size: int, packed: int, source: str) -> None:
    """Refuse a file of ``packed`` bytes that holds more than it may; raises `RecordError`."""
    if size > most_unpacked(packed):
        allowed = f"at most {UNPACKED >> 30} GB or {RATIO} times the file"
        raise RecordError(f"{source}: holds more than {most_unpacked(packed):,} bytes unpacked; allowed: {allowed}")


def check_size(size: int, source: str) -> None:
    """Refuse arrays of so many bytes; raises `RecordError`."""
    if size > UNPACKED:
        raise RecordError(f"{source}: holds {size:,} bytes of arrays; allowed: at most {UNPACKED >> 30} GB")


def unpacked(stream: IO[bytes], packed: int, source: str) -> bytes:
    """Return all that a stream of unpacked bytes holds; raises `RecordError` as soon as it is too much."""
    parts, size = [], 0
    while part := stream.read(_READ_CHUNK):
        size += len(part)
        check_unpacked(size, packed, source)
        parts.append(part)
    return b"".join(parts)


def check_names(names: list[str], source: str) -> None:
    """Refuse an archive of too many files; raises `RecordError`."""
    if len(names) > MAX_ARCHIVE_NAMES:
        raise RecordError(f"{source}: the archive has {len(names):,} files; allowed: at most {MAX_ARCHIVE_NAMES:,}")


def check_cells(text: str, source: str) -> None:
    """Refuse a cell that is too long; raises `RecordError` naming its line."""
    at = 0
    while at + CELL < len(text):
        end = text.rfind("\n", at, at + CELL + 1)
        if end < 0:
            end = text.find("\n", at)
            end = len(text) if end < 0 else end
            if _has_long_cell(text[at:end]):
                line = text.count("\n", 0, at) + 1
                raise RecordError(f"{source}: line {line:,} has a cell of more than {CELL:,} characters")
        at = end + 1


def _has_long_cell(line: str) -> bool:
    """Tell whether a line has a cell that is too long, whatever separates its cells."""
    at = 0
    while at + CELL < len(line):
        end = max(line.rfind(mark, at, at + CELL + 1) for mark in CELL_SEPARATORS)
        if end < 0:
            return True
        at = end + 1
    return False


__all__ = [
    "CELL",
    "MAX_ARCHIVE_NAMES",
    "RATIO",
    "UNPACKED",
    "check_cells",
    "check_names",
    "check_size",
    "check_unpacked",
    "unpacked",
]
