"""`read_record`: which reader takes a path."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from signlin_ros.errors import RecordError, suggest

from .clean import keeper, record_of
from .header import TIME_KEYS
from .mapping import ALIASES, ModelData
from .table import Record

if TYPE_CHECKING:
    from signlin_ros.model import Model

TEXT = (".csv", ".txt", ".tsv", ".dat")
BAGS = (".mcap", ".db3")


def read_record(
    path: str | os.PathLike[str],
    signals: Mapping[str, str] | None = None,
    *,
    wanted: Iterable[str] | None = None,
    sort: bool = False,
    base: str | None = None,
) -> Record:
    """Read a CSV or MAT file, or a rosbag2 recording (its folder, or a single .mcap or .db3 file).

    Parameters
    ----------
    path : the file or folder.
    signals : new name -> column, or ``/topic.field[index]``, ``/joint_states.velocity[joint]`` in a bag. Each
        must be there. The key ``t``
        names the time column.
    wanted : the columns that matter. Others are still read, but left out with a note, instead of the file
        being refused, if
        they hold text or infinite values. In a bag, ``/topic.field`` entries of messages that are not read by
        themselves.
    sort : sort the rows of a file whose stamps are out of order, instead of refusing it (a bag is always
        sorted). base : for a bag, the signal or topic whose stamps become the time base; None: the fastest
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
            from . import bag

            return bag.read(file, source, signals, wanted or (), base)
        return _read_file(file, source, signals, wanted, sort)
    except OSError as error:
        raise RecordError(f"{source}: cannot be read: {error.strerror or error}") from error


def read_for_model(
    path: str | os.PathLike[str],
    model: Model,
    signals: Mapping[str, str] | None = None,
    *,
    require: str = "inputs",
    sort: bool = False,
    base: str | None = None,
) -> ModelData:
    """Read a record and find the model's signals in it: `read_record` and `Record.for_model` in one.

    The mappings of the model and of `signals` (which wins) are known while reading, so that any numeric field
    of a bag can be mapped, and columns that the model does not use do no harm.
    """
    given = {**model.signals, **(signals or {})}
    time = _time(signals or {}) or _time(model.signals)
    wanted = [*given.values(), *model.inputs, *model.states, *model.outputs, *ALIASES]
    record = read_record(path, time, wanted=wanted, sort=sort, base=None)
    return record.for_model(model, signals, require=require, base=base)


def _time(signals: Mapping[str, str]) -> dict[str, str]:
    """Return what a mapping says of the time column; raise `RecordError` if it says two things."""
    found = {key: spec for key, spec in signals.items() if key in TIME_KEYS}
    if len(found) > 1:
        raise RecordError(f"signals map the time twice, to {' and to '.join(map(repr, found.values()))}")
    return found


def _read_file(file: Path, source: str, signals: Mapping[str, str], wanted: list[str] | None, sort: bool) -> Record:
    keep = keeper(signals, wanted)
    if file.suffix.lower() == ".mat":
        from . import mat

        return record_of(mat.read_table(file, source, signals), signals, keep, sort)
    from . import csv

    return record_of(csv.read_table(file, source, keep), signals, keep, sort)


def _check_there(file: Path, source: str) -> None:
    if not file.exists():
        folder = file.parent if file.parent.is_dir() else None
        hint = suggest(file.name, [entry.name for entry in folder.iterdir()]) if folder else ""
        raise RecordError(f"{source}: no such file or folder{hint}")
    known = (*TEXT, ".mat", *BAGS)
    if file.is_file() and file.suffix.lower() not in known:
        raise RecordError(f"{source}: unknown kind {file.suffix!r}; records are {', '.join(known)} or rosbag2 folders")
