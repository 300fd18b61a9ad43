"""Writing a report: each file whole or not at all, pictures first, so that the HTML is there when all of it is."""

from __future__ import annotations

from pathlib import Path

from signlin_ros.errors import InputError
from signlin_ros.files import replacing, write_text
from signlin_ros.report.page import Page, rendered


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
    except OSError as error:
        raise InputError(f"--report: cannot write {error.filename or target}: {error.strerror}") from error
    return target


__all__ = ["write_report"]
