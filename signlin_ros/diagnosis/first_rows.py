"""What the tables of `compare`, `diagnose`, `add` and `refine` show of a model, a row each: errors of the motion over
the horizon, missing force in per cent of the effort, over noise that is the sensors' alone. The first rows are the same
in all four for the same files: the model as given, and its base parameters moved within their tolerances.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from signlin_ros.diagnosis.case import Case, case
from signlin_ros.diagnosis.criteria import DEFAULT, Criteria
from signlin_ros.diagnosis.force.equations import depends_on_place
from signlin_ros.diagnosis.force.witness import Testimony, hear
from signlin_ros.diagnosis.measures import comparable, noise_percent, percent, written_left
from signlin_ros.diagnosis.motion import Fitted, Motion
from signlin_ros.diagnosis.motion.score import of_windows
from signlin_ros.diagnosis.results import Rung, Scores
from signlin_ros.diagnosis.witnesses import Witnesses
from signlin_ros.effects import load_entry_points
from signlin_ros.fitting.prepare import prepared
from signlin_ros.fitting.problem import Problem
from signlin_ros.model import Model
from signlin_ros.noise import sensor_noise
from signlin_ros.records import ModelData
from signlin_ros.threads import one_thread

Array = NDArray[np.float64]
Records = ModelData | Sequence[ModelData]
Tell = Callable[[str], None]
Cancelled = Callable[[], bool]
Seen = Callable[[Fitted | Testimony], None]


@dataclass(frozen=True)
class FirstRows:
    """``given``: the model as it is in its file; ``refitted``: its base parameters moved within their tolerances;
    ``horizon``: s over which motion is predicted.
    """

    given: Rung
    refitted: Rung
    horizon: float

    def to_json(self) -> dict[str, Any]:
        """Return what `signlin compare --json` prints of them."""
        return {"given": self.given.to_json(), "refitted": self.refitted.to_json(), "horizon": self.horizon}


@dataclass(frozen=True, eq=False)
class Ready:
    """Records made ready: the ``case``, what is fitted to (``problem``) and what is not (``unseen``)."""

    case: Case
    problem: Problem
    unseen: Problem

    @property
    def noise(self) -> dict[str, float]:
        """Standard deviation of every channel's noise."""
        return noise_of(self.problem, self.unseen)

    @one_thread
    def rows(self, tell: Tell | None = None, cancelled: Cancelled | None = None) -> Rows:
        """Refit the base and return what makes rows; ``tell`` of what is done, ``cancelled`` asks whether to stop."""
        tell = tell or (lambda what: None)
        motion = Motion(self.problem, self.unseen, DEFAULT, 1, tell, cancelled)
        return Rows(motion, force_witness(self.case, motion, tell, DEFAULT, None))


def ready(model: Model, data: Records, validation: Records | None = None) -> Ready:
    """Make records ready as `diagnose` does; raises `RecordError` where they are too short or nothing moves."""
    load_entry_points()
    found = case(model, data, validation)
    return Ready(found, *prepared(found.model, list(found.known), list(found.unseen)))


# -------------------------------------------------------------------- the witnesses


def motion_witness(
    c: Case, jobs: int | None, tell: Tell, cancelled: Cancelled | None, criteria: Criteria, seen: Seen | None
) -> Motion:
    """Return the motion witness, the base model fitted."""
    load_entry_points()
    sides = prepared(c.model, list(c.known), list(c.unseen))
    return Motion(*sides, criteria, jobs, tell, cancelled, seen)


def force_witness(c: Case, motion: Motion, tell: Tell, criteria: Criteria, seen: Seen | None) -> Testimony | None:
    """Return the force witness; None where effort or motion are not known."""
    tell("missing force")
    if not _recorded(c):
        return None
    found = hear(c.model, motion.problem.parts, motion.unseen.parts, c.rotary, criteria)
    if seen is not None:
        seen(found)
    return found


def _recorded(c: Case) -> bool:
    """Tell whether what the model's forces depend on is recorded."""
    model, plant, first = c.model, c.model.plant, c.known[0]
    recorded = {*first.measured, *model.inputs}
    if plant.position not in recorded and depends_on_place(model.structure):
        return False
    return bool({plant.position, plant.velocity} & recorded)


# -------------------------------------------------------------------- rows


@dataclass(frozen=True, eq=False)
class Rows:
    """Makes the rows of models that were fitted to the same records."""

    motion: Motion
    force: Testimony | None

    @cached_property
    def noise(self) -> dict[str, float]:
        """Standard deviation of every channel's noise."""
        return noise_of(self.motion.problem, self.motion.unseen)

    def first(self) -> FirstRows:
        """Return the first rows."""
        motion = self.motion
        share = Witnesses(motion, self.force, motion.criteria).percent(motion.base)
        horizon = float(max(motion.problem.base.update_period, 2 * motion.problem.scale.step))
        return FirstRows(self.as_it_is(motion.given), self.of(motion.base, share), horizon)

    def as_it_is(self, found: Fitted) -> Rung:
        """Return the row of a model with the values that it has."""
        force = self.force
        if force is None or not comparable(force, found):
            return self.of(found, None)
        return self.of(found, percent(force, written_left(force, found)))

    def of(self, f: Fitted, share: float | None) -> Rung:
        """Return the row of a fit; ``share``: the force that it leaves of unseen data, in per cent of the effort."""
        floor, motion = None if self.force is None else noise_percent(self.force), self.motion
        noise, sides = list(self.noise.values()), ((motion.problem, f.known_squares), (motion.unseen, f.unseen_squares))
        first, second = (Scores("windowed", of_windows(p, squares, np.array(noise))) for p, squares in sides)
        return Rung(f.effects, first, second, share, floor)


def noise_of(problem: Problem, unseen: Problem) -> dict[str, float]:
    """Return the standard deviation of every channel's noise, from all records: of the sensors alone."""
    parts = [(s.t, s.y) for s in (*problem.segments, *unseen.segments)]
    return dict(zip(problem.channels, sensor_noise(parts).tolist(), strict=True))


__all__ = ["FirstRows", "Ready", "Rows", "force_witness", "motion_witness", "ready"]
