"""Records made ready for both witnesses: what is fitted to, what is held out, and what they are told apart by."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

from signlin_ros.effects import load_entry_points
from signlin_ros.fitting.prepare import held_out, prepared
from signlin_ros.fitting.problem import Problem
from signlin_ros.follow.data import as_list
from signlin_ros.model import Model
from signlin_ros.noise import sensor_noise
from signlin_ros.records import ModelData

Records = ModelData | Sequence[ModelData]


@dataclass(frozen=True, eq=False)
class Case:
    """The records as given or held out, what is fitted to (``problem``) and what is not (``unseen``)."""

    records: tuple[ModelData, ...]
    problem: Problem
    unseen: Problem

    @property
    def model(self) -> Model:
        """The model as given, with its position as a state where that is measured."""
        return self.problem.base

    @property
    def rotary(self) -> bool:
        """Whether the axis turns: as the model, its plant or the records' units say."""
        return self.model.turns(self.records[0].units)

    @property
    def horizon(self) -> float:
        """Seconds over which the motion is predicted."""
        return float(max(self.model.update_period, 2 * self.problem.scale.step))

    @cached_property
    def noise(self) -> dict[str, float]:
        """Standard deviation of every channel's noise, from all records: of the sensors alone."""
        parts = [(s.t, s.y) for s in (*self.problem.segments, *self.unseen.segments)]
        return dict(zip(self.problem.channels, sensor_noise(parts).tolist(), strict=True))


def case(model: Model, data: Records, validation: Records | None = None) -> Case:
    """Return a case; without validation the last third of every record is held out.

    Raises `RecordError` where records are too short, nothing is measured or nothing moves.
    """
    load_entry_points()
    known = as_list(data)
    known, unseen = held_out(known) if validation is None else (known, as_list(validation))
    return Case((*known, *unseen), *prepared(model, known, unseen))


__all__ = ["Case", "Records", "case"]
