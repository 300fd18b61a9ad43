"""What a planned experiment is: plain, frozen, and as the JSON that the command line prints."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from signlin_ros.diagnosis.discrimination import PlannedRival

Array = NDArray[np.float64]


@dataclass(frozen=True)
class PlanText:
    """How well two rivals are told apart by the next record: ``expected``, the smaller of both ways and of sigma
    points, of -2 log likelihood; ``certainty``: standard errors over the windows of a second run; ``so_far``: by
    the first records; ``most``: by any command that was tried; ``alike``: no command that was tried tells them apart;
    ``nested``: so, since one is a richer law of the other's family, and nearly that one as the first records leave it.
    """

    rivals: tuple[str, str]
    expected: float
    certainty: float
    so_far: float
    most: float
    alike: bool = False
    nested: bool = False

    def to_json(self) -> dict[str, Any]:
        """Return one entry of ``pairs``."""
        numbers = {n: _finite(getattr(self, n)) for n in ("expected", "certainty", "so_far", "most")}
        return {"rivals": list(self.rivals), **numbers, "alike": self.alike, "nested": self.nested}


@dataclass(frozen=True)
class PlanRow:
    """The best command of a family: its words, its peak, what it would show, and the effects whose texts ask for it.

    ``real``: whether ``distance`` is by real refits: a linear one, which tells too much, is not shown as a number.
    """

    family: str
    words: str
    peak: float
    share: float
    distance: float
    real: bool
    texts: tuple[str, ...] = ()
    u: Array = field(default_factory=lambda: np.zeros(0), repr=False, compare=False)

    def to_json(self) -> dict[str, Any]:
        """Return one entry of ``families``."""
        return {
            "family": self.family,
            "words": self.words,
            "peak": self.peak,
            "part_of_limits": self.share,
            "distance": _finite(self.distance) if self.real else None,
            "asked_by": list(self.texts),
        }


@dataclass(frozen=True)
class Remedy:
    """What would tell rivals apart that no command does: in words, with the distance that it would give."""

    what: str
    distance: float
    rivals: tuple[str, str]

    def to_json(self) -> dict[str, Any]:
        """Return one entry of ``remedies``."""
        return {"what": self.what, "distance": _finite(self.distance), "rivals": list(self.rivals)}


@dataclass(frozen=True)
class ExperimentPlan:
    """The next experiment. ``verdict``: enough, little (less than is asked for) or none; ``t``, ``u`` (T,): the command
    of the input ``input`` in ``unit``; ``limits`` by name, ``assumed`` those that nobody gave; ``smallest``: by rival,
    the smallest size of what it adds that would show, in words; ``preview``: what rivals would show; ``reference``:
    whether the command is the reference of a loop that is closed; ``known``: the rivals as `diagnose` takes them.
    """

    verdict: str
    sentence: str
    words: str
    t: Array
    u: Array
    input: str
    unit: str
    rivals: tuple[str, ...]
    pairs: tuple[PlanText, ...]
    families: tuple[PlanRow, ...]
    limits: Mapping[str, float]
    assumed: tuple[str, ...]
    spare: float
    visits: Mapping[str, float]
    units: Mapping[str, str]
    smallest: Mapping[str, str]
    remedies: tuple[Remedy, ...] = ()
    notes: tuple[str, ...] = ()
    after: str = ""
    preview: Any = field(default=None, repr=False, compare=False)
    tried: int = 0
    reference: bool = False
    known: tuple[PlannedRival, ...] = field(default=(), repr=False, compare=False)

    @property
    def step(self) -> float:
        """Time between samples in s."""
        return float(self.t[1] - self.t[0])

    @property
    def duration(self) -> float:
        """Length of one run in s."""
        return float(self.t[-1] - self.t[0] + self.step)

    def to_json(self) -> dict[str, Any]:
        """Return the object of ``signlin experiment --json``."""
        command = {"input": self.input, "unit": self.unit, "words": self.words, "peak": float(np.abs(self.u).max())}
        command |= {"duration": self.duration, "dt": self.step, "runs": 2}
        limits = {n: {"most": v, "assumed": n in self.assumed} for n, v in self.limits.items()}
        return {
            "verdict": self.verdict,
            "sentence": self.sentence,
            "rivals": list(self.rivals),
            "command": command,
            "pairs": [p.to_json() for p in self.pairs],
            "families": [r.to_json() for r in self.families],
            "limits": limits,
            "spare": self.spare,
            "visits": {n: {"most": v, "unit": self.units.get(n, "")} for n, v in self.visits.items()},
            "smallest": dict(self.smallest),
            "remedies": [r.to_json() for r in self.remedies],
            "notes": list(self.notes),
            "after": self.after,
            "tried": self.tried,
        }

    def to_csv(self) -> str:
        """Return the command as a table: t and the input, as `signlin simulate` and a logger take it."""
        rows = (f"{t:.9g},{u:.9g}" for t, u in zip(self.t.tolist(), self.u.tolist(), strict=True))
        return "\n".join([f"t,{self.input}", *rows]) + "\n"

    def to_rivals(self) -> str:
        """Return the rivals as JSON: what `signlin diagnose --rivals` starts its fits from."""
        return json.dumps({"rivals": [one.to_json() for one in self.known]}, indent=1) + "\n"

    def to_trajectory(self, joint: str) -> str:
        """Return a reference as a trajectory_msgs/JointTrajectory in YAML, positions and velocities of a joint."""
        velocities = np.gradient(self.u, self.t)
        lines = [f"joint_names: [{joint}]", "points:"]
        for t, q, v in zip(self.t.tolist(), self.u.tolist(), velocities.tolist(), strict=True):
            seconds, nanoseconds = divmod(round(1e9 * t), 10**9)
            when = f"{{sec: {seconds}, nanosec: {nanoseconds}}}"
            lines.append(f"- {{positions: [{q:.9g}], velocities: [{v:.9g}], time_from_start: {when}}}")
        return "\n".join(lines) + "\n"


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


__all__ = ["ExperimentPlan", "PlanRow", "PlanText", "Remedy"]
