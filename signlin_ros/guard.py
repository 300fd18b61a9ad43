"""What a command checks before any work: that its records are several, that nothing is wrong with them, and that no
output replaces an input.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from signlin_ros.checks.finding import Finding
from signlin_ros.checks.run import check, require_sound
from signlin_ros.errors import InputError
from signlin_ros.files import check_output
from signlin_ros.model import Model
from signlin_ros.records import ModelData
from signlin_ros.report.files import check_report


def check_files(
    model: Model,
    data: Sequence[str],
    validation: Sequence[str] = (),
    output: str | None = None,
    kinds: Sequence[str] = (),
    report: str | None = None,
) -> None:
    """Refuse, before any work, a record that is given twice, and an output that cannot be or would replace an input.

    ``kinds``: suffixes that the output may have. Raises `InputError`.
    """
    inputs = {**_distinct(data, validation), **model.files}
    if output is not None:
        check_output("-o", output, kinds, inputs)
    if report is not None:
        check_report(report, inputs)


def check_records(
    model: Model, records: Sequence[ModelData], cures: Sequence[str] = (), *, validated: bool = False
) -> tuple[list[ModelData], list[Finding]]:
    """Return records with cures applied, and what was found in them; raise `RecordError` where nothing may be concluded
    from them as they are. See `signlin_ros.checks`.
    """
    sound, findings = check(model, records, cures, validated=validated)
    require_sound(findings, cures)
    return sound, findings


def check_sides(
    model: Model, known: Sequence[ModelData], unseen: Sequence[ModelData] | None, cures: Sequence[str] = ()
) -> tuple[list[ModelData], list[ModelData] | None, list[Finding]]:
    """Return the records of a fit and those for validation (None: there are none), see `check_records`."""
    records, findings = check_records(model, [*known, *(unseen or ())], cures, validated=bool(unseen))
    return records[: len(known)], records[len(known) :] or None, findings


def _distinct(data: Sequence[str], validation: Sequence[str]) -> dict[Path, str]:
    """Return the records that are there, and what each is; raise `InputError` on one that is given twice."""
    found: dict[Path, str] = {}
    given = [*((path, f"DATA {path}") for path in data), *((path, f"--validation {path}") for path in validation)]
    for path, what in ((Path(path), what) for path, what in given if Path(path).exists()):
        for other, before in found.items():
            if path.samefile(other) or _bag_file(path, other) or _bag_file(other, path):
                raise InputError(f"{what}: is the same record as {before}")
        found[path] = what
    return found


def _bag_file(folder: Path, file: Path) -> bool:
    """Tell whether a file is that of the recording whose folder is given."""
    return folder.is_dir() and file.suffix in (".mcap", ".db3") and file.parent.samefile(folder)


__all__ = ["check_files", "check_records"]
