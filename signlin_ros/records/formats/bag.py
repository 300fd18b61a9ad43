"""rosbag2 recordings (mcap and sqlite3, a folder or a single file) through the `rosbags` package; no ROS
needed.

Read without being asked: numbers and arrays of std_msgs, every joint of a JointState by its name, and of a
JointTrajectoryControllerState (ros2_control), whose reference is a goal position. Any other numeric field is read where
a mapping names it: ``/odom.twist.twist.linear.x``. A message with a header counts at its header's stamp, any other at
the time when it was received, as in the nodes.
"""

from __future__ import annotations

import re
import shlex
import sqlite3
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from signlin_ros.errors import MissingExtraError, RecordError
from signlin_ros.files import TABLES, TEXT
from signlin_ros.records import limits
from signlin_ros.records.align import align, looks_held, named
from signlin_ros.records.clean import renamed
from signlin_ros.records.formats.bag_clock import MIN_CLOCK_JUMP, clocks, restarts, seconds
from signlin_ros.records.formats.bag_topics import Arrays, Controllers, Fields, Joints, NumberFields, Topic, TopicPart
from signlin_ros.records.grammar import words
from signlin_ros.records.header import TIME_KEYS
from signlin_ros.records.notes import Note
from signlin_ros.records.table import Record, Series, at

Array = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

TIME_TOPIC = "/record_time"
"""std_msgs/Float64: a record's own time in seconds to the bit, where a stamp in whole nanoseconds cannot hold
it.
"""
STORAGE = (".mcap", ".db3")
_SCALARS = {f"std_msgs/msg/{kind}" for kind in ("Bool", "Float32", "Float64")} | {
    f"std_msgs/msg/{sign}Int{bits}" for sign in ("", "U") for bits in (8, 16, 32, 64)
}
_MULTI_ARRAYS = {f"{kind}MultiArray" for kind in _SCALARS}
_JOINTS = "sensor_msgs/msg/JointState"
_CONTROLLER = "control_msgs/msg/JointTrajectoryControllerState"
_UNIT = re.compile(r"\s+\[[^\[\]]*\]\Z")
_POINTS = ("reference", "feedback", "error", "output", "desired", "actual")


def read(path: Path, source: str, signals: Mapping[str, str], wanted: Iterable[str], base: str | None) -> list[Record]:
    """Read a bag; each signal keeps its own stamps in `Record.series` and is put on one time base in
    `Record.signals`. One record, or one for each run where a clock begins anew.

    Raises
    ------
    RecordError
        Not a bag, damaged, empty; a mapped topic, field or joint that is not there, the choices listed.
    """
    mapped = {key: spec for key, spec in signals.items() if key not in TIME_KEYS}
    specs = [*mapped.values(), *wanted]
    bag = _collect(path, source, specs)
    asked = {found[0] for spec in specs for word in (spec, *words(spec)) if (found := _split(word, bag.types))}
    cuts, notes = restarts(bag.stamps("received"), bag.stamps("header"), bag.stamps("order"))
    bag.notes += notes
    ends = [*cuts, bag.count]
    for key in signals.keys() & TIME_KEYS:
        bag.notes.append(Note(f"a bag has its own clock: t = {signals[key]} is not used", "clock", "t"))
    records = []
    for number, (first, last) in enumerate(zip([0, *cuts], ends, strict=True)):
        name = f"{source}, run {number + 1} of {len(ends)}" if cuts else source
        record = _record(bag, name, asked, (first, last), base)
        records.append(renamed(record, mapped))
    return records


def _record(bag: _Bag, source: str, asked: Collection[str], part: tuple[int, int], base: str | None) -> Record:
    """The record of the messages from `part[0]` to before `part[1]`, counted over all topics."""
    series, notes = _series(bag, asked, part)
    if not series:
        known = "std_msgs, JointState, JointTrajectoryControllerState"
        topic = next(iter(bag.types), "/topic")
        way = f"fields of other messages are taken by their path, --signal NAME={topic}.FIELD"
        raise RecordError(f"{source}: no topic holds numbers ({known}); {_listing(bag.types)}; {way}")
    held = {name for name, one in series.items() if looks_held(one)}
    try:
        one = align(series, held, base and named(series, base))
    except RecordError as error:
        raise RecordError(f"{source}: {error}") from None
    said = (*bag.notes, *notes, *one.notes)
    return Record(one.t, one.signals, source, said, series=series, alignment=one.notes, acts=one.acts)


@dataclass
class _Bag:
    """What was collected: the type of every topic; messages and stamps (ns) of those that were read, and their places
    among all that were.
    """

    source: str
    types: dict[str, str]
    topics: dict[str, Topic] = field(default_factory=dict)
    received: dict[str, list[int]] = field(default_factory=dict)
    header: dict[str, list[int]] = field(default_factory=dict)
    order: dict[str, list[int]] = field(default_factory=dict)
    notes: list[Note] = field(default_factory=list)
    count: int = 0

    def stamps(self, which: str) -> dict[str, Integers]:
        """``received``, ``header`` or ``order`` of every topic's messages (N,)."""
        return {topic: np.array(ns, dtype=np.int64) for topic, ns in getattr(self, which).items()}


def _collect(path: Path, source: str, specs: list[str]) -> _Bag:
    """All messages of the topics that hold numbers or that `specs` name."""
    paths = _storage(path, source)
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    except ImportError:
        raise MissingExtraError(f"{source}: reading rosbag2 recordings", "formats") from None

    try:
        store = get_typestore(Stores.ROS2_JAZZY)
        store.register(_of_humble())
        with AnyReader(paths, default_typestore=store) as reader:
            bag = _Bag(source, {connection.topic: connection.msgtype for connection in reader.connections})
            bag.topics = _topics(bag.types, specs)
            _read_messages(bag, reader, paths)
    except RecordError as error:
        raise RecordError(f"{source}: {error}") from None
    except Exception as error:  # a damaged file fails in many ways
        reason = str(error) or type(error).__name__
        raise RecordError(f"{source}: not a readable rosbag2 recording ({reason})") from error
    if paths != [path]:
        bag.notes.append(Note(f"no metadata.yaml: read from {', '.join(part.name for part in paths)}", "format"))
    return bag


def _of_humble() -> Any:
    """Return the type of a controller's state as ROS 2 Humble has it: bags of its time do not hold their types."""
    from rosbags.typesys import get_types_from_msg

    dofs = (f"trajectory_msgs/MultiDOFJointTrajectoryPoint multi_dof_{name}" for name in _POINTS)
    points = (f"trajectory_msgs/JointTrajectoryPoint {name}" for name in _POINTS)
    lines = ["std_msgs/Header header", "string[] joint_names", *points, "string[] multi_dof_joint_names", *dofs]
    return get_types_from_msg("\n".join(lines), _CONTROLLER)


def _storage(path: Path, source: str) -> list[Path]:
    """What to open: the path itself, or the storage files of a folder that lacks its metadata.yaml."""
    if not path.is_dir() or (path / "metadata.yaml").exists():
        return [path]
    files = sorted(part for part in path.iterdir() if part.suffix in STORAGE)
    if not files:
        tables = sorted(part.name for part in path.iterdir() if part.suffix.lower() in (*TEXT, *TABLES))
        way = f"; its tables are given one by one: {shlex.quote(f'{source}/{tables[0]}')} ..." if tables else ""
        raise RecordError(
            f"{source}: this folder is no rosbag2 recording: no metadata.yaml, no .mcap, no .db3 file in it{way}"
        )
    return files


def _topics(types: Mapping[str, str], specs: Iterable[str]) -> dict[str, Topic]:
    topics: dict[str, Topic] = {}
    for topic, kind in types.items():
        if kind in _SCALARS:
            topics[topic] = NumberFields(topic)
        elif kind in _MULTI_ARRAYS:
            topics[topic] = Arrays(topic)
        elif kind == _JOINTS:
            topics[topic] = Joints(topic)
        elif kind == _CONTROLLER:
            topics[topic] = Controllers(topic)
    every = [word for spec in specs for word in (spec, *words(spec))]
    for topic, path in filter(None, (_split(spec, types) for spec in every)):
        other = topics.setdefault(topic, Fields(topic, []))
        if isinstance(other, Fields) and path not in other.paths:
            other.paths.append(path)
    return topics


def _split(spec: str, topics: Iterable[str]) -> tuple[str, str] | None:
    """Topic and field of ``/topic.field``, the leading slash optional; None if the bag has no such topic. A unit behind
    it, ``/topic.field [rpm]``, is none of it.
    """
    text = _UNIT.sub("", spec.strip())
    for whole in (text, f"/{text}"):
        found = [topic for topic in topics if whole == topic or whole.startswith(f"{topic}.")]
        if found:
            topic = max(found, key=len)
            return topic, whole[len(topic) + 1 :]
    return None


def _read_messages(bag: _Bag, reader: Any, paths: list[Path]) -> None:
    connections = [connection for connection in reader.connections if connection.topic in bag.topics]
    for name in bag.topics:
        bag.received[name], bag.header[name], bag.order[name] = [], [], []
    packed, held = sum(file.stat().st_size for path in paths for file in (path, *path.glob("**/*"))), 0
    for topic, kind, stamp, raw in _messages(reader, connections, paths):
        held += len(raw)
        limits.check_unpacked(held, packed, bag.source)
        message = reader.deserialize(raw, kind)
        bag.topics[topic].add(message)
        bag.received[topic].append(stamp)
        bag.order[topic].append(bag.count)
        bag.count += 1
        header = getattr(message, "header", None)
        if header is not None:
            bag.header[topic].append(header.stamp.sec * 1_000_000_000 + header.stamp.nanosec)


def _messages(reader: Any, connections: list[Any], paths: list[Path]) -> Iterator[tuple[str, str, int, bytes]]:
    """Topic, type, stamp and content of all messages; in the order in which they were written, where their stamps go
    back in it: a reader would sort the runs into each other.
    """
    kinds = {connection.topic: connection.msgtype for connection in connections}
    written = _as_written(paths) if kinds else None
    if written is not None:
        yield from ((topic, kinds[topic], stamp, raw) for topic, stamp, raw in written if topic in kinds)
        return
    for connection, stamp, raw in reader.messages(connections) if connections else ():
        yield connection.topic, connection.msgtype, stamp, raw


def _as_written(paths: list[Path]) -> Iterator[tuple[str, int, bytes]] | None:
    """Topic, stamp and content in the order of writing, from a bag of one SQLite file in which stamps go back; else
    None.
    """
    files = [file for path in paths for file in ([path] if path.is_file() else sorted(path.glob("*")))]
    stores = [file for file in files if file.suffix in STORAGE]
    if len(stores) != 1 or stores[0].suffix != ".db3":
        return None
    connection = sqlite3.connect(f"{stores[0].resolve().as_uri()}?mode=ro&immutable=1", uri=True)
    stamps = np.array(connection.execute("SELECT timestamp FROM messages ORDER BY id").fetchall(), dtype=np.int64)
    if not np.any(np.diff(stamps[:, 0] if stamps.size else stamps) < -MIN_CLOCK_JUMP):
        connection.close()
        return None
    what = "SELECT topics.name, timestamp, data FROM messages JOIN topics ON topics.id = topic_id ORDER BY messages.id"
    return iter(connection.execute(what))


def _series(bag: _Bag, asked: Collection[str], part: tuple[int, int]) -> tuple[dict[str, Series], list[Note]]:
    """All signals by name. A topic with a fault is left out with a note unless it was asked for."""
    stamps, notes = clocks(bag.stamps("received"), bag.stamps("header"))
    places = {topic: tuple(np.searchsorted(order, part).tolist()) for topic, order in bag.stamps("order").items()}
    stamps = {topic: ns[slice(*places[topic])] for topic, ns in stamps.items()}
    stamps = {topic: ns for topic, ns in stamps.items() if ns.size}
    collector, times = bag.topics.get(TIME_TOPIC), stamps.pop(TIME_TOPIC, None)
    exact = None
    if times is not None and isinstance(collector, NumberFields):
        exact = times, np.array(collector.values)[slice(*places[TIME_TOPIC])]
    found = [
        pair
        for topic, t in seconds(stamps, exact, notes).items()
        for pair in _parts(bag, topic, t, places[topic], notes, must=topic in asked)
    ]
    count = Counter(key for key, _ in found)
    series = {key if key and count[key] == 1 else one.label: one for key, one in found}
    silent = [topic for topic in bag.topics if topic not in stamps and topic != TIME_TOPIC]
    notes += [Note(f"{topic}: no message", "missing", topic) for topic in silent]
    return series, notes


def _parts(
    bag: _Bag, topic: str, t: Array, place: tuple[int, ...], notes: list[Note], must: bool
) -> list[tuple[str, Series]]:
    """The series of one topic with the names that they would like."""
    try:
        return [_one(part, t, place, notes) for part in bag.topics[topic].parts() if _within(part, place)]
    except RecordError as error:
        if must:
            raise RecordError(f"{bag.source}: {error}") from None
        notes.append(Note(f"{error}; the topic is left out", "left_out", topic))
        return []


def _within(part: TopicPart, place: tuple[int, ...]) -> bool:
    """Whether any message from `place[0]` to before `place[1]` has the quantity."""
    return part.index is None or bool(np.any((part.index >= place[0]) & (part.index < place[1])))


def _one(part: TopicPart, t: Array, place: tuple[int, ...], notes: list[Note]) -> tuple[str, Series]:
    """The series of one quantity in some messages, stamped t, sorted by time, repeated messages dropped."""
    index = np.arange(part.values.size) if part.index is None else part.index
    there = (index >= place[0]) & (index < place[1])
    values, t = part.values[there], t[index[there] - place[0]]
    if np.isinf(values).any():
        i = int(np.argmax(np.isinf(values)))
        raise RecordError(f"{part.label}: message {i + 1}, {at(t[i])}: {values[i]!r} is not a finite number")
    if np.any(np.diff(t) < 0):
        order = np.argsort(t, kind="stable")
        late = int(np.sum(np.diff(t) < 0))
        notes.append(Note(f"{part.label}: sorted by time, {late} messages had come late", "sorted", part.label))
        t, values = t[order], values[order]
    t, values = _without_repeats(part.label, t, values, notes)
    names = (*part.names, part.label.lstrip("/"), *((part.key,) if part.key else ()))
    return part.key, Series(t, values, label=part.label, names=names)


def _without_repeats(label: str, t: Array, values: Array, notes: list[Note]) -> tuple[Array, Array]:
    again = np.flatnonzero(np.diff(t) == 0) + 1
    if not again.size:
        return t, values
    differ = (values[again] != values[again - 1]) & ~(np.isnan(values[again]) & np.isnan(values[again - 1]))
    if differ.any():
        i = int(again[np.argmax(differ)])
        pair = f"{values[i - 1]:.9g} and {values[i]:.9g}"
        raise RecordError(f"{label}: messages {i} and {i + 1} have the same stamp, {at(t[i])}, but differ: {pair}")
    notes.append(Note(f"{label}: {again.size} repeated messages dropped (same stamp, same value)", "repeated", label))
    return np.delete(t, again), np.delete(values, again)


def _listing(types: Mapping[str, str]) -> str:
    return "it has " + (", ".join(f"{topic} ({kind})" for topic, kind in types.items()) or "no topics")
