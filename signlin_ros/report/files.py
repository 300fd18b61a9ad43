"""Writing a report: each file whole or not at all, pictures first, so that the HTML is there when all of it is."""

from __future__ import annotations

from pathlib import Path

from signlin_ros.errors import InputError
from signlin_ros.files import replacing, write_text
from signlin_ros.report.page import Page, rendered

VARIABLE = "evidence_*.png"
"""Pictures that not every report has: those of an earlier one at the same place would be taken for this one's."""


def write_report(page: Page, path: str | Path) -> Path:
    """Write a report to ``path`` and its pictures into a folder of the same stem; return the path of the HTML.

    Everything is drawn before anything is written. Raises `InputError` where it cannot be written.
    """
    target = Path(path)
    text, pictures = rendered(page)
    folder = target.with_name(f"{target.stem}_files")
    try:
        if pictures:
            folder.mkdir(exist_ok=True)
        for name, data in pictures.items():
            with replacing(folder / name) as part:
                part.write_bytes(data)
        write_text(target, text)
        for old in folder.glob(VARIABLE):
            if old.name not in pictures:
                old.unlink()
    except OSError as error:
        raise InputError(f"--report: cannot write {error.filename or target}: {error.strerror}") from error
    return target


__all__ = ["write_report"]
