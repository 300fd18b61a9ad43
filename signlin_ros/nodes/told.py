"""What the logic of nodes tells: levels, refusals, updates, how it is doing; without ROS."""

from __future__ import annotations

from dataclasses import dataclass

from signlin_ros.linearization import Linearization

NANO = 1_000_000_000
LEVEL_OK, WARN, ERROR = 0, 1, 2


@dataclass(frozen=True)
class Refusal:
    """Why a message is not used: a kind to count by, a detail for people, and of which of several joints."""

    kind: str
    detail: str
    joint: str = ""


@dataclass(frozen=True)
class Update:
    """One published model: the stamp of the state used (ns), the sequence from 0, and the matrices."""

    stamp: int
    sequence: int
    result: Linearization


@dataclass(frozen=True)
class Health:
    """How a node is doing: a level (OK, WARN, ERROR), a sentence, and values to show."""

    level: int
    message: str
    values: dict[str, str]


__all__ = ["ERROR", "LEVEL_OK", "NANO", "WARN", "Health", "Refusal", "Update"]
