"""Code of a user's own (effect files) is run by the page only after it was shown and agreed to.

What was agreed to is remembered on this machine by the SHA-256 of the file, in ``$XDG_STATE_HOME/signlin``: never in a
project, which may come from somebody else.
"""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Iterable
from pathlib import Path

LIST = "signlin/trusted_effect_files"
_DIGEST_PATTERN = re.compile(r"[0-9a-f]{64}\Z")


def place() -> Path:
    """Return the file in which the digests of what was agreed to stand, one a line."""
    state = os.environ.get("XDG_STATE_HOME") or ""
    return (Path(state) if Path(state).is_absolute() else Path.home() / ".local" / "state") / LIST


def digest(content: bytes) -> str:
    """Return the SHA-256 of a file's content, in hexadecimal."""
    return hashlib.sha256(content).hexdigest()


def agreed() -> frozenset[str]:
    """Return the digests of all files that were agreed to."""
    try:
        return frozenset(place().read_text(encoding="ascii").split())
    except (OSError, ValueError):
        return frozenset()


def agree(digests: Iterable[str]) -> None:
    """Remember that files with these digests may be run; raises `OSError` where that cannot be written."""
    new = [one for one in digests if _DIGEST_PATTERN.match(one)]
    place().parent.mkdir(parents=True, exist_ok=True, mode=0o700)
    with place().open("a", encoding="ascii") as stream:
        stream.writelines(f"{one}\n" for one in new)


__all__ = ["agree", "agreed", "digest", "place"]
