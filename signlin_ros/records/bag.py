"""rosbag2 recordings (mcap and sqlite3, a folder or a single file) through the `rosbags` package; no ROS
needed.

Read without being asked: numbers and arrays of std_msgs, and every joint of a JointState, by its name. Any
other numeric field is read where a mapping names it: ``/odom.twist.twist.linear.x``. A message with a header
counts at its header's stamp, any other at the time when it was received, as in the nodes.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from signlin_ros.errors import RecordError

from .align import align, looks_held, named
from .clean import renamed
from .header import TIME_KEYS
from .table import Record, Series

Array = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

TIME_TOPIC = "/record_time"
"""std_msgs/Float64: a record's own time in seconds to the bit, where a stamp in whole nanoseconds cannot hold
it.
"""
STORAGE = (".mcap", ".db3")
FIELDS = ("position", "velocity", "effort")
_ABSOLUTE = 100_000_000_000_000_000
"""A bag that starts later than this (ns, 3 years) counts from its first stamp: its clock is the calendar's.
"""
_CLOCKS_AGREE = 10_000_000_000
"""Header stamps further than this (ns) from the time of reception come from another clock."""
_SCALARS = {f"std_msgs/msg/{kind}" for kind in ("Bool", "Float32", "Float64")} | {
    f"std_msgs/msg/{sign}Int{bits}" for sign in ("", "U") for bits in (8, 16, 32, 64)
}
_ARRAYS = {f"{kind}MultiArray" for kind in _SCALARS}
_JOINTS = "sensor_msgs/msg/JointState"


@dataclass(frozen=True)
class Part:
    """One quantity of a topic: its whole path, its values, the messages that hold it (None: all), and other
    spellings.

    `key` is the name that it has in the record if no other signal wants the same.
    """

    label: str
    values: Array
    index: Integers | None = None
    key: str = ""
    names: tuple[str, ...] = ()


class Topic(Protocol):
    """Collects the messages of one topic."""

    def add(self, message: Any) -> None:
        """Take the next message."""

    def parts(self) -> list[Part]:
        """All quantities of the topic; raises RecordError where the messages do not fit together."""
        ...


@dataclass
class Numbers:
    """A std_msgs number: ``/speed`` is the signal ``speed``."""

    topic: str
    values: list[float] = field(default_factory=list)

    def add(self, message: Any) -> None:
        """Take the next message."""
        self.values.append(float(message.data))

    def parts(self) -> list[Part]:
        """All quantities of the topic."""
        return [Part(f"{self.topic}.data", np.array(self.values), key=self.topic.strip("/"), names=(self.topic,))]


@dataclass
class Arrays:
    """A std_msgs array: ``/state.data[0]``, and by name where its first dimension's label lists names:
    ``current,speed``.
    """

    topic: str
    values: list[Array] = field(default_factory=list)
    label: str = ""

    def add(self, message: Any) -> None:
        """Take the next message."""
        if not self.values and message.layout.dim:
            self.label = message.layout.dim[0].label
        self.values.append(message.data)

    def parts(self) -> list[Part]:
        """All quantities of the topic."""
        sizes = np.array([len(values) for values in self.values])
        if np.any(sizes != sizes[0]):
            i = int(np.argmax(sizes != sizes[0]))
            raise RecordError(f"{self.topic}: message {i + 1} has {sizes[i]} values, the first has {sizes[0]}")
        table = np.array(self.values, dtype=np.float64)
        keys = self._keys(int(sizes[0]))
        whole = (f"{self.topic}.data", self.topic) if sizes[0] == 1 else ()
        return [Part(f"{self.topic}.data[{i}]", table[:, i], key=key, names=whole) for i, key in enumerate(keys)]

    def _keys(self, size: int) -> list[str]:
        names = [name.strip() for name in self.label.split(",")]
        return names if len(names) == size == len(set(names)) and all(names) else [""] * size


@dataclass
class Joints:
    """A JointState: ``/joint_states.velocity[wheel]``. Messages may differ in their joints."""

    topic: str
    count: int = 0
    groups: dict[tuple[str, ...], tuple[list[int], list[list[Array]]]] = field(default_factory=dict)

    def add(self, message: Any) -> None:
        """Take the next message."""
        index, values = self.groups.setdefault(tuple(message.name), ([], []))
        index.append(self.count)
        values.append([getattr(message, name) for name in FIELDS])
        self.count += 1

    def parts(self) -> list[Part]:
        """All quantities of the topic."""
        gathered: dict[tuple[str, str], list[tuple[Integers, Array]]] = {}
        for joints, (index, rows) in self.groups.items():
            for k, name in enumerate(FIELDS):
                table = self._table(name, joints, index, [row[k] for row in rows])
                for j, joint in enumerate(joints):
                    gathered.setdefault((joint, name), []).append((np.array(index), table[:, j]))
        single = len({joint for joint, _ in gathered}) == 1
        parts = []
        for (joint, name), pieces in gathered.items():
            index_, values = (np.concatenate([piece[k] for piece in pieces]) for k in (0, 1))
            names = (name, f"{self.topic}.{name}") if single else ()
            if not np.isnan(values).all():
                order = np.argsort(index_, kind="stable")
                parts.append(Part(f"{self.topic}.{name}[{joint}]", values[order], index_[order], names=names))
        return parts

    def _table(self, name: str, joints: tuple[str, ...], index: list[int], rows: list[Array]) -> Array:
        """Values (N, joints); NaN where a message leaves the field empty."""
        empty = np.full(len(joints), np.nan)
        for i, row in zip(index, rows, strict=True):
            if len(row) not in (0, len(joints)):
                raise RecordError(
                    f"{self.topic}: message {i + 1} has {len(joints)} joints but {len(row)} values of {name}"
                )
        return np.array([row if len(row) else empty for row in rows], dtype=np.float64).reshape(len(rows), len(joints))


@dataclass
class Fields:
    """Any numeric field of any message, by its path."""

    topic: str
    paths: list[str]
    values: list[list[float]] = field(default_factory=list)

    def add(self, message: Any) -> None:
        """Take the next message."""
        self.values.append([self._value(message, path) for path in self.paths])

    def parts(self) -> list[Part]:
        """All quantities of the topic."""
        table = np.array(self.values, dtype=np.float64)
        return [Part(f"{self.topic}.{path}".rstrip("."), table[:, i]) for i, path in enumerate(self.paths)]

    def _value(self, message: Any, path: str) -> float:
        value = message
        for name, index in re.findall(r"([^.\[\]]+)|\[(\d+)\]", path):
            below = _below(value, name, index)
            if below is None:
                place = f"message {len(self.values) + 1} has no {name or f'[{index}]'!r}"
                raise RecordError(f"{self.topic}.{path}: {place}{_inside(value)}")
            value = below
        if not isinstance(value, (bool, int, float, np.number)):
            whole = f"{self.topic}.{path}".rstrip(".")
            raise RecordError(f"{whole} is no number{_inside(value)}")
        return float(value)


def _below(value: Any, name: str, index: str) -> Any:
    """The field `name` or the element `index` of a message's part, None if it has none."""
    if name:
        return getattr(value, name, None)
    return value[int(index)] if isinstance(value, (list, np.ndarray)) and int(index) < len(value) else None


def read(path: Path, source: str, signals: Mapping[str, str], wanted: Iterable[str], base: str | None) -> Record:
    """Read a bag; each signal keeps its own stamps in `Record.series` and is put on one time base in
    `Record.signals`.

    Raises
    ------
    RecordError
        Not a bag, damaged, empty; a mapped topic, field or joint that is not there, the choices listed.
    """
    mapped = {key: spec for key, spec in signals.items() if key not in TIME_KEYS}
    specs = [*mapped.values(), *wanted]
    bag = _collect(path, source, specs)
    asked = {found[0] for spec in specs if (found := _split(spec, bag.types)) is not None}
    series, notes = _series(bag, asked)
    if not series:
        raise RecordError(f"{source}: no topic holds numbers (std_msgs, JointState); {_listing(bag.types)}")
    held = {name for name, one in series.items() if looks_held(one)}
    try:
        t, aligned, more = align(series, held, base and named(series, base))
    except RecordError as error:
        raise RecordError(f"{source}: {error}") from None
    record = Record(t, aligned, source, (*bag.notes, *notes, *more), series=series, alignment=tuple(more))
    return renamed(record, mapped)


@dataclass
class _Bag:
    """What was collected: the type of every topic; messages and stamps (ns) of those that were read."""

    source: str
    types: dict[str, str]
    topics: dict[str, Topic] = field(default_factory=dict)
    received: dict[str, list[int]] = field(default_factory=dict)
    header: dict[str, list[int]] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)


def _collect(path: Path, source: str, specs: list[str]) -> _Bag:
    """All messages of the topics that hold numbers or that `specs` name."""
    paths = _storage(path, source)
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    try:
        with AnyReader(paths, default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
            bag = _Bag(source, {connection.topic: connection.msgtype for connection in reader.connections})
            bag.topics = _topics(bag.types, specs)
            _read_messages(bag, reader)
    except RecordError as error:
        raise RecordError(f"{source}: {error}") from None
    except Exception as error:  # a damaged file fails in many ways
        reason = str(error) or type(error).__name__
        raise RecordError(f"{source}: not a readable rosbag2 recording ({reason})") from error
    if paths != [path]:
        bag.notes.append(f"no metadata.yaml: read from {', '.join(part.name for part in paths)}")
    return bag


def _storage(path: Path, source: str) -> list[Path]:
    """What to open: the path itself, or the storage files of a folder that lacks its metadata.yaml."""
    if not path.is_dir() or (path / "metadata.yaml").exists():
        return [path]
    files = sorted(part for part in path.iterdir() if part.suffix in STORAGE)
    if not files:
        raise RecordError(
            f"{source}: this folder is no rosbag2 recording: no metadata.yaml, no .mcap, no .db3 file in it"
        )
    return files


def _topics(types: Mapping[str, str], specs: Iterable[str]) -> dict[str, Topic]:
    topics: dict[str, Topic] = {}
    for topic, kind in types.items():
        if kind in _SCALARS:
            topics[topic] = Numbers(topic)
        elif kind in _ARRAYS:
            topics[topic] = Arrays(topic)
        elif kind == _JOINTS:
            topics[topic] = Joints(topic)
    for topic, path in filter(None, (_split(spec, types) for spec in specs)):
        other = topics.setdefault(topic, Fields(topic, []))
        if isinstance(other, Fields) and path not in other.paths:
            other.paths.append(path)
    return topics


def _split(spec: str, topics: Iterable[str]) -> tuple[str, str] | None:
    """Topic and field of ``/topic.field``, the leading slash optional; None if the bag has no such topic."""
    text = spec.strip()
    for whole in (text, f"/{text}"):
        found = [topic for topic in topics if whole == topic or whole.startswith(f"{topic}.")]
        if found:
            topic = max(found, key=len)
            return topic, whole[len(topic) + 1 :]
    return None


def _read_messages(bag: _Bag, reader: Any) -> None:
    connections = [connection for connection in reader.connections if connection.topic in bag.topics]
    for name in bag.topics:
        bag.received[name], bag.header[name] = [], []
    for connection, stamp, raw in reader.messages(connections) if connections else ():
        message = reader.deserialize(raw, connection.msgtype)
        bag.topics[connection.topic].add(message)
        bag.received[connection.topic].append(stamp)
        header = getattr(message, "header", None)
        if header is not None:
            bag.header[connection.topic].append(header.stamp.sec * 1_000_000_000 + header.stamp.nanosec)


def _series(bag: _Bag, asked: Iterable[str]) -> tuple[dict[str, Series], list[str]]:
    """All signals by name. A topic with a fault is left out with a note unless it was asked for."""
    stamps, notes = _clocks(bag)
    stamps = {topic: ns for topic, ns in stamps.items() if ns.size}
    exact = _exact(bag, stamps.pop(TIME_TOPIC, None))
    seconds = _seconds(stamps, exact, notes)
    found = [pair for topic, t in seconds.items() for pair in _parts(bag, topic, t, notes, must=topic in asked)]
    count = Counter(key for key, _ in found)
    series = {key if key and count[key] == 1 else one.label: one for key, one in found}
    notes += [f"{topic}: no message" for topic in bag.topics if topic not in stamps and topic != TIME_TOPIC]
    return series, notes


def _parts(bag: _Bag, topic: str, t: Array, notes: list[str], must: bool) -> list[tuple[str, Series]]:
    """The series of one topic with the names that they would like."""
    try:
        return [_one(part, t, notes) for part in bag.topics[topic].parts()]
    except RecordError as error:
        if must:
            raise RecordError(f"{bag.source}: {error}") from None
        notes.append(f"{error}; the topic is left out")
        return []


def _one(part: Part, t: Array, notes: list[str]) -> tuple[str, Series]:
    """The series of one quantity, sorted by time, repeated messages dropped."""
    values = part.values
    if part.index is not None:
        t = t[part.index]
    if np.isinf(values).any():
        i = int(np.argmax(np.isinf(values)))
        raise RecordError(f"{part.label}: message {i + 1}, t = {t[i]:.9g} s: {values[i]!r} is not a finite number")
    if np.any(np.diff(t) < 0):
        order = np.argsort(t, kind="stable")
        notes.append(f"{part.label}: sorted by time, {int(np.sum(np.diff(t) < 0))} messages had come late")
        t, values = t[order], values[order]
    t, values = _without_repeats(part.label, t, values, notes)
    names = (*part.names, part.label.lstrip("/"), *((part.key,) if part.key else ()))
    return part.key, Series(t, values, label=part.label, names=names)


def _without_repeats(label: str, t: Array, values: Array, notes: list[str]) -> tuple[Array, Array]:
    again = np.flatnonzero(np.diff(t) == 0) + 1
    if not again.size:
        return t, values
    differ = (values[again] != values[again - 1]) & ~(np.isnan(values[again]) & np.isnan(values[again - 1]))
    if differ.any():
        i = int(again[np.argmax(differ)])
        pair = f"{values[i - 1]:.9g} and {values[i]:.9g}"
        raise RecordError(
            f"{label}: messages {i} and {i + 1} have the same stamp, t = {t[i]:.9g} s, but differ: {pair}"
        )
    notes.append(f"{label}: {again.size} repeated messages dropped (same stamp, same value)")
    return np.delete(t, again), np.delete(values, again)


def _clocks(bag: _Bag) -> tuple[dict[str, Integers], list[str]]:
    """Stamps (N,) in ns of each topic that was read: of its headers where they can be used, else of
    reception.
    """
    received = {topic: np.array(stamps, dtype=np.int64) for topic, stamps in bag.received.items()}
    headers = {topic: np.array(ns, dtype=np.int64) for topic, ns in bag.header.items() if ns}
    empty = [topic for topic, ns in headers.items() if _unfilled(ns, received[topic])]
    notes = [f"{topic}: header stamps of 0; times of reception are used" for topic in empty]
    headers = {topic: ns for topic, ns in headers.items() if topic not in empty}
    if len(headers) < sum(1 for ns in received.values() if ns.size):
        for topic in list(headers):
            if abs(float(np.median(headers[topic] - received[topic]))) > _CLOCKS_AGREE:
                del headers[topic]
                notes.append(f"{topic}: header stamps of another clock than the bag's; times of reception are used")
    return {**received, **headers}, notes


def _unfilled(header: Integers, received: Integers) -> bool:
    """Tell whether header stamps (N,) in ns were left empty: 0 at another time than 0, where a simulation begins."""
    return bool(np.any((header < 0) | ((header == 0) & (received != 0))))


def _exact(bag: _Bag, stamps: Integers | None) -> tuple[Integers, Array] | None:
    """The record's own times in seconds by stamp, as `write_record` left them."""
    collector = bag.topics.get(TIME_TOPIC)
    if stamps is None or not isinstance(collector, Numbers):
        return None
    return stamps, np.array(collector.values)


def _seconds(
    stamps: Mapping[str, Integers], exact: tuple[Integers, Array] | None, notes: list[str]
) -> dict[str, Array]:
    """Stamps in seconds: as written, or since the first message where the clock is the calendar's."""
    if exact is not None and all(np.isin(ns, exact[0]).all() for ns in stamps.values()):
        return {topic: exact[1][np.searchsorted(exact[0], ns)] for topic, ns in stamps.items()}
    start = min((int(ns.min()) for ns in stamps.values()), default=0)
    if start < _ABSOLUTE:
        start = 0
    else:
        notes.append(f"time counts from the first message, {start / 1e9:.3f} s after 1970")
    return {topic: (ns - start) / 1e9 for topic, ns in stamps.items()}


def _listing(types: Mapping[str, str]) -> str:
    return "it has " + (", ".join(f"{topic} ({kind})" for topic, kind in types.items()) or "no topics")


def _inside(value: Any) -> str:
    """``; it has header, twist``: the fields of a message."""
    fields = [name for name in getattr(value, "__dataclass_fields__", {}) if not name.startswith("__")]
    return f"; it has {', '.join(fields)}" if fields else ""
