"""Parquet, Arrow (pyarrow), MDF4 (asammdf), TDMS (nptdms): columns with names and units, through their own readers."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from signlin_ros.errors import MissingExtraError, RecordError
from signlin_ros.records import limits
from signlin_ros.records.clean import RawTable
from signlin_ros.records.header import Heading, heading
from signlin_ros.records.notes import Note
from signlin_ros.records.table import Rows

Array = npt.NDArray[np.float64]
Column = tuple[str, str, npt.NDArray[np.generic]]
"""Name, unit ("" where the file states none), and values (R,)."""
EPISODES = ("episode_index", "episode")
"""What a column is called that counts the runs in a table."""


def read_table(path: Path, source: str) -> RawTable:
    """Read all columns of numbers; raise `RecordError` where the file is damaged, `MissingExtraError` where its reader
    is not installed.
    """
    try:
        columns = list(READERS[path.suffix.lower()](path))
    except ImportError:
        raise MissingExtraError(f"{source}: reading {path.suffix} files", "formats") from None
    except (OSError, RecordError):
        raise
    except Exception as error:  # readers raise nearly anything on a damaged file
        raise RecordError(f"{source}: not a readable {path.suffix} file ({error})") from error
    return _table(source, columns)


def _table(source: str, columns: Iterable[Column]) -> RawTable:
    headings: list[Heading] = []
    values: list[Array] = []
    notes: list[Note] = []
    exact = {}
    for number, (name, unit, column) in enumerate(columns, 1):
        head = heading(f"{name} [{unit}]" if unit and not heading(name).unit else name, number)
        if column.dtype.kind == "M":
            head = Heading(head.label, head.name, "ns", number=number)
        found = column.astype("datetime64[ns]").astype(np.int64) if column.dtype.kind == "M" else column
        if found.dtype.kind not in "fiub":
            notes.append(Note(f"column {name!r} holds no numbers and is left out", "left_out", name))
            continue
        if found.dtype.kind in "iu" and found.size and np.abs(found.astype(np.float64)).max() >= 2.0**53:
            exact[head.label] = found.astype(np.int64)
        headings.append(head)
        values.append(found.astype(np.float64))
    sizes = {column.size for column in values}
    if len(sizes) != 1 or not values:
        listed = ", ".join(f"{head.label} ({column.size})" for head, column in zip(headings, values, strict=True))
        raise RecordError(f"{source}: the columns of numbers must be equally long; it has {listed or 'none'}")
    runs = _episodes(headings, values)
    return RawTable(source, headings, values, Rows(np.arange(1, sizes.pop() + 1)), tuple(notes), runs=runs, exact=exact)


def _episodes(headings: Sequence[Heading], values: Sequence[Array]) -> tuple[int, ...]:
    """Return the rows at which another episode begins, where a column counts them."""
    for head, column in zip(headings, values, strict=True):
        if head.name in EPISODES:
            return tuple((np.flatnonzero(np.diff(column) != 0) + 1).tolist())
    return ()


def _parquet(path: Path) -> Iterable[Column]:
    import pyarrow.parquet

    meta = pyarrow.parquet.read_metadata(path)
    limits.check_size(8 * meta.num_rows * meta.num_columns, path.name)
    yield from _arrow_columns(pyarrow.parquet.read_table(path))


def _arrow(path: Path) -> Iterable[Column]:
    """Feather files too, which are Arrow's; no streams."""
    import pyarrow.ipc

    batches, size = [], 0
    with pyarrow.OSFile(str(path)) as file:
        reader = pyarrow.ipc.open_file(file)
        for k in range(reader.num_record_batches):
            batches.append(reader.get_batch(k))
            size += batches[-1].nbytes
            limits.check_size(size, path.name)
        yield from _arrow_columns(pyarrow.Table.from_batches(batches, reader.schema))


def _arrow_columns(table: Any) -> Iterable[Column]:
    for name, column in zip(table.column_names, table.columns, strict=True):
        unit = (table.schema.field(name).metadata or {}).get(b"unit", b"").decode(errors="replace")
        parts = _lists(column)
        if parts is None:
            yield name, unit, column.to_numpy()
        else:
            yield from ((f"{name}[{i}]", unit, part) for i, part in enumerate(parts))


def _lists(column: Any) -> list[npt.NDArray[np.generic]] | None:
    """Return the elements (R,) of a column whose cells hold lists of equally many numbers, as LeRobot writes them; None
    where they do not.
    """
    import pyarrow as pa
    import pyarrow.compute as pc

    kind = column.type
    if not (pa.types.is_list(kind) or pa.types.is_large_list(kind) or pa.types.is_fixed_size_list(kind)):
        return None
    numbers = pa.types.is_floating(kind.value_type) or pa.types.is_integer(kind.value_type)
    sizes = pc.unique(pc.list_value_length(column).drop_null()).to_pylist()
    if not numbers or len(sizes) != 1 or column.null_count or sizes[0] == 0:
        return None
    values = pc.list_flatten(column).to_numpy(zero_copy_only=False).reshape(-1, sizes[0])
    return [np.ascontiguousarray(values[:, i]) for i in range(sizes[0])]


def _mdf(path: Path) -> Iterable[Column]:
    """All channels, at the stamps of the one with most samples: others are missing in between."""
    import asammdf

    with asammdf.MDF(path) as file:
        groups = [group.channel_group for group in file.groups]
        limits.check_size(sum(g.cycles_nr * getattr(g, "samples_byte_nr", 0) for g in groups), path.name)
        signals = list(file.iter_channels(skip_master=True))
    signals = [signal for signal in signals if signal.samples.ndim == 1 and signal.samples.dtype.kind in "fiub"]
    if not signals:
        return
    t = np.unique(np.concatenate([signal.timestamps for signal in signals]))
    limits.check_size(t.nbytes * (1 + len(signals)), path.name)
    yield "t", "s", t
    yield from (_placed(s.name, s.unit or "", s.timestamps, s.samples, t) for s in signals)


def _placed(name: str, unit: str, stamps: Array, samples: npt.NDArray[np.generic], t: Array) -> Column:
    values = np.full(t.shape, np.nan)
    values[np.searchsorted(t, stamps)] = samples
    return name, unit, values


def _tdms(path: Path) -> Iterable[Column]:
    """All channels; the time of one whose properties hold a waveform's step is a column too."""
    import nptdms

    channels = [channel for group in nptdms.TdmsFile.read(path).groups() for channel in group.channels()]
    channels = [channel for channel in channels if len(channel)]
    names = [channel.name for channel in channels]
    timed = next((channel for channel in channels if "wf_increment" in channel.properties), None)
    if timed is not None and not any(heading(name).time for name in names):
        yield "t", "s", timed.time_track()
    for channel in channels:
        whole = channel.name if names.count(channel.name) == 1 else f"{channel.group_name}.{channel.name}"
        yield whole, str(channel.properties.get("unit_string", "")), np.asarray(channel[:])


READERS: dict[str, Callable[[Path], Iterable[Column]]] = {
    ".parquet": _parquet,
    ".feather": _arrow,
    ".arrow": _arrow,
    ".tdms": _tdms,
    ".mf4": _mdf,
    ".mdf": _mdf,
}
"""Reader of each suffix: those of `signlin_ros.files.TABLES` that are not in ``ARRAYS``."""
