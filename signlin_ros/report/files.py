"""Writing a report: each file whole or not at all, pictures first, so that the HTML is there when all of it is."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from signlin_ros.errors import InputError
from signlin_ros.files import check_output, refusal, replacing, write_text
from signlin_ros.report.page import Page, rendered

REPORT_SUFFIXES = (".html", ".htm")
"""Suffixes of reports."""
VARIABLE = "evidence_*.png"
"""Pictures that not every report has: those of an earlier one at the same place would be taken for this one's."""


def check_report(path: str | Path, inputs: Mapping[Path, str]) -> None:
    """Refuse, before any work, a report that cannot be written or would replace one of the inputs (`check_output`)."""
    check_output("--report", path, REPORT_SUFFIXES, inputs)
    folder = _pictures(Path(path))
    why = refusal(folder / "picture.png") if folder.is_dir() else "this is a file" if folder.exists() else ""
    if why:
        raise InputError(f"--report {path}: its pictures go into {folder}: {why}")


def _pictures(target: Path) -> Path:
    return target.with_name(f"{target.stem}_files")


def write_report(page: Page, path: str | Path) -> Path:
    """Write a report to ``path`` and its pictures into a folder of the same stem; return the path of the HTML.

    Everything is drawn before anything is written. Raises `InputError` where it cannot be written.
    """
    target = Path(path)
    text, pictures = rendered(page)
    folder = _pictures(target)
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


__all__ = ["check_report", "write_report"]
