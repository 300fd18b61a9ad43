"""What a bag's topics hold: numbers, arrays, joints, and any numeric field by its path."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from operator import attrgetter
from typing import Any, ClassVar, Protocol

import numpy as np
import numpy.typing as npt

from signlin_ros.errors import RecordError

Array = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]


GOALS = ("goal_position", "goal_velocity")
"""What a controller's reference is called where it has one joint: what is measured goes by the aliases of a state."""


@dataclass(frozen=True)
class TopicPart:
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

    def parts(self) -> list[TopicPart]:
        """All quantities of the topic; raises RecordError where the messages do not fit together."""
        ...


@dataclass
class NumberFields:
    """A std_msgs number: ``/speed`` is the signal ``speed``."""

    topic: str
    values: list[float] = field(default_factory=list)

    def add(self, message: Any) -> None:
        """Take the next message."""
        self.values.append(float(message.data))

    def parts(self) -> list[TopicPart]:
        """All quantities of the topic."""
        return [TopicPart(f"{self.topic}.data", np.array(self.values), key=self.topic.strip("/"), names=(self.topic,))]


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

    def parts(self) -> list[TopicPart]:
        """All quantities of the topic."""
        sizes = np.array([len(values) for values in self.values])
        if np.any(sizes != sizes[0]):
            i = int(np.argmax(sizes != sizes[0]))
            raise RecordError(f"{self.topic}: message {i + 1} has {sizes[i]} values, the first has {sizes[0]}")
        table = np.array(self.values, dtype=np.float64)
        keys = self._keys(int(sizes[0]))
        whole = (f"{self.topic}.data", self.topic) if sizes[0] == 1 else ()
        return [TopicPart(f"{self.topic}.data[{i}]", table[:, i], key=key, names=whole) for i, key in enumerate(keys)]

    def _keys(self, size: int) -> list[str]:
        names = [name.strip() for name in self.label.split(",")]
        return names if len(names) == size == len(set(names)) and all(names) else [""] * size


@dataclass
class Joints:
    """A JointState: ``/joint_states.velocity[wheel]``. Messages may differ in their joints.

    ``fields``: what is read of a message, and how the one joint of a topic calls it; ``joints``: where their names are.
    """

    fields: ClassVar[dict[str, str]] = {name: name for name in ("position", "velocity", "effort")}
    joints: ClassVar[str] = "name"
    topic: str
    count: int = 0
    groups: dict[tuple[str, ...], tuple[list[int], list[list[Array]]]] = field(default_factory=dict)

    def add(self, message: Any) -> None:
        """Take the next message."""
        index, values = self.groups.setdefault(tuple(getattr(message, self.joints)), ([], []))
        index.append(self.count)
        values.append([attrgetter(name)(message) for name in self.fields])
        self.count += 1

    def parts(self) -> list[TopicPart]:
        """All quantities of the topic."""
        gathered: dict[tuple[str, str], list[tuple[Integers, Array]]] = {}
        for joints, (index, rows) in self.groups.items():
            for k, name in enumerate(self.fields):
                table = self._table(name, joints, index, [row[k] for row in rows])
                for j, joint in enumerate(joints):
                    gathered.setdefault((joint, name), []).append((np.array(index), table[:, j]))
        single = len({joint for joint, _ in gathered}) == 1
        parts = []
        for (joint, name), pieces in gathered.items():
            index_, values = (np.concatenate([piece[k] for piece in pieces]) for k in (0, 1))
            names = tuple(filter(None, (self.fields[name], f"{self.topic}.{name}"))) if single else ()
            if not np.isnan(values).all():
                order = np.argsort(index_, kind="stable")
                key = self.fields[name] if single and self.fields[name] in GOALS else ""
                label = f"{self.topic}.{name}[{joint}]"
                parts.append(TopicPart(label, values[order], index_[order], key=key, names=names))
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
class Controllers(Joints):
    """A JointTrajectoryControllerState: ``/arm_controller/controller_state.feedback.positions[elbow]``; its reference
    is the goal of the joint's own loop.
    """

    fields: ClassVar[dict[str, str]] = {
        "reference.positions": "goal_position",
        "feedback.positions": "position",
        "feedback.velocities": "velocity",
        "feedback.effort": "effort",
        "reference.velocities": "goal_velocity",
        "error.positions": "",
        "output.positions": "",
        "output.velocities": "",
        "output.effort": "",
    }
    joints: ClassVar[str] = "joint_names"


@dataclass
class Fields:
    """Any numeric field of any message, by its path."""

    topic: str
    paths: list[str]
    values: list[list[float]] = field(default_factory=list)

    def add(self, message: Any) -> None:
        """Take the next message."""
        self.values.append([self._value(message, path) for path in self.paths])

    def parts(self) -> list[TopicPart]:
        """All quantities of the topic."""
        table = np.array(self.values, dtype=np.float64)
        return [TopicPart(f"{self.topic}.{path}".rstrip("."), table[:, i]) for i, path in enumerate(self.paths)]

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


def _inside(value: Any) -> str:
    """``; it has header, twist``: the fields of a message."""
    fields = [name for name in getattr(value, "__dataclass_fields__", {}) if not name.startswith("__")]
    return f"; it has {', '.join(fields)}" if fields else ""
