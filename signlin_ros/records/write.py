"""Records to files: CSV with every digit, or a single mcap file that `ros2 bag play` takes. A file appears
whole or not at all.
"""

from __future__ import annotations

import csv
import os
import tempfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

import numpy as np
import numpy.typing as npt

from signlin_ros import units
from signlin_ros.errors import MissingExtraError, RecordError
from signlin_ros.files import refusal, replacing
from signlin_ros.records.formats.bag import TIME_TOPIC
from signlin_ros.records.header import heading
from signlin_ros.records.table import Record

if TYPE_CHECKING:
    from signlin_ros.model import Model

Array = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]
Put = Callable[[str, int, "bytes | memoryview"], None]

RECORD_SUFFIXES = (".csv", ".mcap")
"""Suffixes of the files that `write_record` writes."""
_WRITE_CHUNK = 50_000
_INPUT_NAMES = ("voltage", "load_torque", "force")
_JOINT_FIELDS = (
    ("position", ("position", "displacement")),
    ("velocity", ("velocity", "speed")),
    ("effort", ("effort",)),
)
_EPOCH = 1e8


def write_record(
    record: Record,
    path: str | os.PathLike[str],
    *,
    model: Model | None = None,
    joint_name: str | None = None,
    with_units: bool = False,
) -> None:
    """Write a record; reading it back gives the same numbers to the bit.

    ``.csv``: a header ``t,voltage,current,...`` of plain names and the shortest digits that give the same
    number again. Columns that are not in SI units keep their unit in the header; `with_units` states all of
    them.

    ``.mcap``: topics ``/input`` and ``/state`` (Float64MultiArray; the label of the first dimension lists the
    names), ``/output`` for what is neither, and with `joint_name` ``/joint_states``. `model` says which
    signals are inputs and states, and their order; without it ``voltage``, ``load_torque`` and ``force`` are
    inputs and all others states. Units are not stored.

    The file is written under a temporary name in the same folder and renamed at the end.

    Parameters
    ----------
    record : Record
        What is written.
    path : str or path
        The file, ``.csv`` or ``.mcap``.
    model : Model, optional
        Which signals are inputs and states, for ``.mcap``.
    joint_name : str, optional
        The joint of ``/joint_states``, for ``.mcap``.
    with_units : bool
        Whether the header states every unit, for ``.csv``.

    Raises
    ------
    RecordError
        Another suffix, a folder that does not exist, names that cannot be told apart when read back.
    """
    target = _target(path)
    try:
        if target.suffix.lower() == ".csv":
            with replacing(target) as temporary, temporary.open("w", encoding="utf-8", newline="") as stream:
                _write_csv(record, stream, with_units)
        else:
            with replacing(target) as temporary:
                _write_mcap(record, temporary, model, joint_name)
    except OSError as error:
        raise RecordError(f"{target}: cannot be written: {error.strerror or error}") from error


def _target(path: str | os.PathLike[str]) -> Path:
    """Return where a record may be written to; raise `RecordError` for another suffix, or where that cannot be."""
    target = Path(path)
    if target.suffix.lower() not in RECORD_SUFFIXES:
        raise RecordError(f"{target}: records are written as .csv or .mcap files, not {target.suffix!r}")
    why = refusal(target)
    if why:
        raise RecordError(f"{target}: {why}")
    return target


def _write_csv(record: Record, stream: TextIO, with_units: bool) -> None:
    columns = [record.t, *(signal.values for signal in record.signals.values())]
    csv.writer(stream, lineterminator="\n").writerow(["t", *_header(record, with_units)])
    for start in range(0, record.t.size, _WRITE_CHUNK):
        cells = [map(repr, column[start : start + _WRITE_CHUNK].tolist()) for column in columns]
        stream.write("\n".join(map(",".join, zip(*cells, strict=True))) + "\n")


def _header(record: Record, with_units: bool) -> list[str]:
    header = []
    for name, signal in record.signals.items():
        head = heading(name)
        stated = signal.unit and (with_units or not units.is_si(signal.unit)) and head.name == name
        header.append(f"{name} [{signal.unit}]" if stated else name)
        if not name.strip() or "\n" in name or "#" in name or heading(header[-1]).time is not None:
            raise RecordError(f"the signal name {name!r} cannot stand in the header of a CSV file")
    return header


def _write_mcap(record: Record, path: Path, model: Model | None, joint_name: str | None) -> None:
    try:
        from rosbags.rosbag2 import StoragePlugin, Writer
        from rosbags.typesys import Stores, get_typestore
    except ImportError:
        raise MissingExtraError("Writing rosbag2 recordings", "formats") from None

    store: Any = get_typestore(Stores.ROS2_JAZZY)
    stamps, exact = _stamps(record)
    messages = [*_arrays(record, model, store)]
    messages += [(TIME_TOPIC, "std_msgs/msg/Float64", _numbers(record.t, store))] if exact else []
    messages += (
        [("/joint_states", "sensor_msgs/msg/JointState", _joints(record, stamps, joint_name, store))]
        if joint_name
        else []
    )
    with tempfile.TemporaryDirectory(dir=path.parent, prefix=f"{path.name}.") as folder:
        inner = Path(folder) / "bag"
        with Writer(inner, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
            connections = [writer.add_connection(topic, kind, typestore=store) for topic, kind, _ in messages]
            for i, stamp in enumerate(stamps.tolist()):
                for connection, (_, _, payload) in zip(connections, messages, strict=True):
                    writer.write(connection, stamp, payload(i))
        (inner / "bag.mcap").replace(path)


def _stamps(record: Record) -> tuple[Integers, bool]:
    """Stamps in ns (T,), and whether the record's own time must be stored beside them to keep every bit."""
    plain = not np.signbit(record.t[0]) and record.t[-1] < _EPOCH
    stamps = np.round((record.t if plain else record.t - record.t[0]) * 1e9).astype(np.int64)
    if np.any(np.diff(stamps) <= 0):
        i = int(np.argmax(np.diff(stamps) <= 0))
        raise RecordError(
            f"{record.source}: samples {i + 1} and {i + 2} are closer than the nanosecond that a bag resolves"
        )
    return stamps, not plain or bool(np.any(stamps / 1e9 != record.t))


def _arrays(record: Record, model: Model | None, store: Any) -> Iterator[tuple[str, str, Callable[[int], bytes]]]:
    """Topic, type and serializer of the array topics."""
    known = tuple(model.inputs) if model is not None else _INPUT_NAMES
    inputs = [name for name in known if name in record.signals]
    others = [name for name in record.signals if name not in inputs]
    states = [name for name in model.states if name in others] if model is not None else others
    outputs = [name for name in others if name not in states]
    for topic, names in (("/input", inputs), ("/state", states), ("/output", outputs)):
        if any("," in name for name in names):
            raise RecordError(f"{record.source}: a signal name with a comma cannot be written to a bag")
        if names:
            values = np.stack([record.signals[name].values for name in names], axis=1)
            yield topic, "std_msgs/msg/Float64MultiArray", _rows(values, names, store)


def _rows(values: Array, names: Sequence[str], store: Any) -> Callable[[int], bytes]:
    """Serializer of the rows of `values` (T, k): only the last 8 k bytes of a message differ between rows."""
    types, kind = store.types, "std_msgs/msg/Float64MultiArray"
    dim = types["std_msgs/msg/MultiArrayDimension"](label=",".join(names), size=len(names), stride=len(names))
    layout = types["std_msgs/msg/MultiArrayLayout"](dim=[dim], data_offset=0)
    first = bytes(store.serialize_cdr(types[kind](layout=layout, data=values[0]), kind))
    head = first[: len(first) - 8 * len(names)]
    little = np.ascontiguousarray(values, dtype="<f8")
    return lambda i: head + little[i].tobytes()


def _numbers(values: Array, store: Any) -> Callable[[int], bytes]:
    message = store.types["std_msgs/msg/Float64"]
    return lambda i: bytes(store.serialize_cdr(message(data=float(values[i])), "std_msgs/msg/Float64"))


def _joints(record: Record, stamps: Integers, joint_name: str, store: Any) -> Callable[[int], bytes]:
    kind = "sensor_msgs/msg/JointState"
    joint, header, time = (store.types[name] for name in (kind, "std_msgs/msg/Header", "builtin_interfaces/msg/Time"))
    fields = {}
    for field, names in _JOINT_FIELDS:
        key = next((name for name in names if name in record.signals), None)
        fields[field] = record.signals[key].values[:, None] if key else np.empty((record.t.size, 0))

    def payload(i: int) -> bytes:
        sec, nanosec = divmod(int(stamps[i]), 1_000_000_000)
        head = header(stamp=time(sec=sec, nanosec=nanosec), frame_id="")
        message = joint(header=head, name=[joint_name], **{name: values[i] for name, values in fields.items()})
        return bytes(store.serialize_cdr(message, kind))

    return payload
