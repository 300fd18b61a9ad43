"""`read_record` and its kin: which reader takes a path."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from signlin_ros.apart import of_record
from signlin_ros.errors import RecordError, suggest
from signlin_ros.files import ARRAYS, BAGS, ECHOES, LOGS, PACKED, TABLES, TEXT
from signlin_ros.records.clean import keeper, records_of
from signlin_ros.records.formats import octave
from signlin_ros.records.header import TIME_KEYS
from signlin_ros.records.mapping import ALIASES, ModelData
from signlin_ros.records.notes import Note
from signlin_ros.records.table import Record

if TYPE_CHECKING:
    from signlin_ros.model import Model

_SHEET = "a workbook; save the sheet with the record as CSV (UTF-8), and give that"
ADVICE_BY_KIND = {
    **dict.fromkeys((".xlsx", ".xls", ".xlsm", ".ods", ".numbers"), _SHEET),
    ".bag": "a recording of ROS 1; `rosbags-convert --src FILE --dst FOLDER` makes one of ROS 2 of it",
    ".ulg": "a log of PX4; `ulog2csv FILE` (pip install pyulog) makes CSV files of it, one for each topic",
    ".bin": "a binary log; the program that wrote it exports text (of ArduPilot: `mavlogdump.py --format csv`)",
    ".npy": "an array without names; save the signals by name: np.savez(FILE, t=..., voltage=...)",
    **dict.fromkeys(
        (".pkl", ".pickle"), "objects of Python, which are not loaded; of a data frame: df.to_parquet(FILE)"
    ),
    **dict.fromkeys(
        (".db", ".sqlite", ".sqlite3"), "a database; export the table as CSV: sqlite3 -header -csv FILE QUERY"
    ),
    **dict.fromkeys((".blf", ".pcap", ".pcapng"), "frames, not decoded; decode them first into a table with names"),
    **dict.fromkeys(
        (".dxd", ".d7d", ".svdx", ".tdm", ".wfm", ".isf"), "a recorder's own file; export it as CSV or MAT"
    ),
    **dict.fromkeys((".html", ".htm", ".md", ".pdf", ".doc", ".docx"), "a document; save its table as CSV"),
    **dict.fromkeys((".png", ".jpg", ".jpeg", ".svg"), "a picture; a record is the numbers behind it"),
}
"""What is to be done with files of other kinds."""
NO_FILES = {
    "://": "; a record is a file or a folder of this machine: download it first",
    "*": "; the shell puts the names of files for a * that is not in quotes",
    "=-": "; what comes through a pipe is read as /dev/stdin",
}
"""What is to be said of names that are none of files, by what is in them, or is all of them."""
SNIFFED = 4096
"""So many bytes tell whether a file is text."""
MIN_RUN_ROWS = 20
"""Runs of fewer rows are left out beside longer ones."""


def read_records(
    path: str | os.PathLike[str],
    signals: Mapping[str, str] | None = None,
    *,
    wanted: Iterable[str] | None = None,
    base: str | None = None,
) -> list[Record]:
    """Read a text file (also packed), a table in a binary file (`signlin_ros.files.TABLES`), or a rosbag2 recording
    (its folder, or a single .mcap or .db3 file): one record, or one for each run where the time begins anew.

    Parameters
    ----------
    path : the file or folder.
    signals : new name -> column, or ``/topic.field[index]``, ``/joint_states.velocity[joint]`` in a bag, or a formula
        over them (`signlin_ros.records.grammar`). Each must be there. The key ``t``
        names the time column, or says what the time is: a formula, or the s from row to row.
    wanted : the columns that matter. Others are still read, but left out with a note, instead of the file
        being refused, if
        they hold text or infinite values. In a bag, ``/topic.field`` entries of messages that are not read by
        themselves.
    base : for a bag, the signal or topic whose stamps become the time base; None: the fastest
        that is not a command.

    Raises
    ------
    RecordError
        Anything wrong with the file: the file, row and column are named. See `signlin_ros.records.clean`.
    """
    file, source, signals = Path(path), os.fspath(path), dict(signals or {})
    wanted = None if wanted is None else list(wanted)
    _check_there(file, source)
    try:
        if file.is_dir() or file.suffix.lower() in BAGS:
            from signlin_ros.records.formats import bag

            return bag.read(file, source, signals, wanted or (), base)
        return _read_file(file, source, signals, wanted)
    except OSError as error:
        raise RecordError(f"{source}: cannot be read: {error.strerror or error}") from error


def read_record(
    path: str | os.PathLike[str],
    signals: Mapping[str, str] | None = None,
    *,
    wanted: Iterable[str] | None = None,
    base: str | None = None,
) -> Record:
    """Read one record: of a file that holds several runs the longest, with a note on the others.

    Parameters
    ----------
    path : str or path
        A table (CSV, MAT, Parquet, ...) or a rosbag2 recording.
    signals : mapping, optional
        New name to column, bag path or formula, see `read_records`.
    wanted : iterable of str, optional
        The columns that matter, see `read_records`.
    base : str, optional
        For a bag, the signal or topic whose stamps become the time base.

    Returns
    -------
    Record
        Times in s and signals with units; ``notes`` say what was done to the data.

    Raises
    ------
    RecordError
        Anything wrong with the file: file, row and column are named.
    """
    return _longest(read_records(path, signals, wanted=wanted, base=base), os.fspath(path))


def read_runs(
    path: str | os.PathLike[str],
    model: Model,
    signals: Mapping[str, str] | None = None,
    *,
    require: str = "inputs",
    base: str | None = None,
) -> list[ModelData]:
    """Read a record and find the model's signals in it: `read_records` and `Record.for_model` in one.

    The mappings of the model and of `signals` (which wins; ``FILE:NAME`` says it of one file, see
    `signlin_ros.apart`) are known while reading, so that any numeric field of a bag can be mapped, and columns
    that the model does not use do no harm. Runs of fewer than `MIN_RUN_ROWS` rows are
    left out beside longer ones.
    """
    records = read_unmapped(path, model, signals, base=base)
    return [record.for_model(model, of_record(signals, path), require=require, base=base) for record in records]


def read_unmapped(
    path: str | os.PathLike[str], model: Model, signals: Mapping[str, str] | None = None, *, base: str | None = None
) -> list[Record]:
    """Read the runs in which `read_runs` finds the signals of a model, all columns as they are called there."""
    return _without_short(_for_model(path, model, of_record(signals, path), base))


def read_for_model(
    path: str | os.PathLike[str],
    model: Model,
    signals: Mapping[str, str] | None = None,
    *,
    require: str = "inputs",
    base: str | None = None,
) -> ModelData:
    """As `read_runs`, where one record is wanted: the longest run, with a note on the others."""
    signals = of_record(signals, path)
    record = _longest(_for_model(path, model, signals, base), os.fspath(path))
    return record.for_model(model, signals, require=require, base=base)


def _for_model(
    path: str | os.PathLike[str], model: Model, signals: Mapping[str, str] | None, base: str | None
) -> list[Record]:
    given = {**model.signals, **(signals or {})}
    time = _time(signals or {}) or _time(model.signals)
    wanted = [*given.values(), *model.inputs, *model.states, *model.outputs, *ALIASES, *([base] if base else [])]
    return read_records(path, time, wanted=wanted, base=None)


def _longest(records: list[Record], source: str) -> Record:
    """The longest run of a file."""
    best = max(records, key=len)
    if len(records) == 1:
        return best
    at = f"run {records.index(best) + 1} of {len(records)}"
    said = f"{at}, the longest, is taken here; compare, diagnose, add and refine take them all"
    return replace(best, source=source, notes=(*best.notes, Note(said, "cut")))


def _without_short(records: list[Record]) -> list[Record]:
    kept = [record for record in records if len(record) >= MIN_RUN_ROWS]
    lost = [record for record in records if len(record) < MIN_RUN_ROWS]
    if not kept or not lost:
        return records
    said = f"{len(lost)} of {len(records)} runs have fewer than {MIN_RUN_ROWS} rows and are left out"
    return [replace(kept[0], notes=(*kept[0].notes, Note(said, "left_out"))), *kept[1:]]


def _time(signals: Mapping[str, str]) -> dict[str, str]:
    """Return the entry of the time column in a mapping; raise `RecordError` if there are two."""
    found = {key: spec for key, spec in signals.items() if key in TIME_KEYS}
    if len(found) > 1:
        raise RecordError(f"signals map the time twice, to {' and to '.join(map(repr, found.values()))}")
    return found


def _read_file(file: Path, source: str, signals: Mapping[str, str], wanted: list[str] | None) -> list[Record]:
    keep = keeper(signals, wanted)
    suffix = file.suffix.lower()
    if octave.begins(file):
        from signlin_ros.records.formats import mat

        found = octave.arrays(file.read_text(encoding="utf-8", errors="replace"), source)
        return records_of(mat.table_of(found, source, signals), signals, keep)
    if suffix in ARRAYS:
        from signlin_ros.records.formats import mat

        return records_of(mat.read_table(file, source, signals), signals, keep)
    if suffix in LOGS:
        from signlin_ros.records.formats import bam, mat, objects

        content = bam.read(file, source)
        log = bam.is_log(content)
        rows = None if log else objects.rows_without_names(content, source)
        table = bam.table_of(content, source) if log else rows or mat.table_of(objects.arrays(content), source, signals)
        return records_of(table, signals, keep)
    if suffix in TABLES:
        from signlin_ros.records.formats.tables import read_table

        return records_of(read_table(file, source), signals, keep)
    from signlin_ros.records.formats import csv

    asked = [*signals.values(), *(wanted or ())]
    if suffix in (*TEXT, *PACKED, *ECHOES):
        return records_of(csv.read_table(file, source, keep, asked), signals, keep)
    try:
        table = csv.read_table(file, source, keep, asked)
    except RecordError as error:
        raise RecordError(f"{error} ({_unknown(file)}, so it was read as text)") from None
    said = f"files of the kind {file.suffix!r} are not known: it is read as text"
    return records_of(replace(table, notes=(Note(said, "format"), *table.notes)), signals, keep)


def _unknown(file: Path) -> str:
    known = (*TEXT, *PACKED, *ECHOES, *TABLES, *LOGS, *BAGS)
    return f"unknown kind {file.suffix!r}; records are {', '.join(known)} or rosbag2 folders"


def _is_text(file: Path) -> bool:
    """Tell whether a file begins with letters, of whatever encoding, and no other bytes."""
    with file.open("rb") as stream:
        start = stream.read(SNIFFED)
    marked = start.startswith((b"\xff\xfe", b"\xfe\xff"))
    return bool(start) and (marked or not re.search(rb"[\x00-\x08\x0e-\x1a\x1c-\x1f]", start))


def _check_there(file: Path, source: str) -> None:
    if not file.exists():
        folder = file.parent if file.parent.is_dir() else None
        hint = suggest(file.name, [entry.name for entry in folder.iterdir()]) if folder else ""
        hint = next((way for mark, way in NO_FILES.items() if mark in source or mark == f"={source}"), hint)
        raise RecordError(f"{source}: no such file or folder{hint}")
    known = (*TEXT, *PACKED, *ECHOES, *TABLES, *LOGS, *BAGS)
    if file.is_file() and file.suffix.lower() in ADVICE_BY_KIND:
        raise RecordError(f"{source}: {ADVICE_BY_KIND[file.suffix.lower()]}")
    if file.is_file() and file.suffix.lower() not in known and not _is_text(file):
        raise RecordError(f"{source}: {_unknown(file)}")
