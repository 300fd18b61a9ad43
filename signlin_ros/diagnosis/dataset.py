"""Records made ready for both estimates: training data, validation data, and the noise of their sensors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from signlin_ros.effects import load_entry_points
from signlin_ros.fitting.prepare import held_in_turn, held_out, prepared
from signlin_ros.fitting.problem import Problem
from signlin_ros.follow.data import as_list, travelled
from signlin_ros.model import Model
from signlin_ros.noise import sensor_noise
from signlin_ros.plants import Plant
from signlin_ros.records import ModelData

Array = NDArray[np.float64]
Records = ModelData | Sequence[ModelData]

MIN_SWING_SPEED = 0.1
"""A swing turns back where the speed is beyond this part of its largest on the other side."""
MAX_SWING_RATIO = 1.15
"""Largest ratio of strokes, and of paces, of swings that are alike."""


@dataclass(frozen=True, eq=False)
class Dataset:
    """The model ``given``, its records as given or held out, prepared as ``training`` and ``validation`` data;
    ``hold_note``: how their inputs act, if that was found (`signlin_ros.diagnosis.input_hold`).
    """

    given: Model
    records: tuple[ModelData, ...]
    training: Problem
    validation: Problem
    hold_note: str = ""

    @property
    def model(self) -> Model:
        """The model as given, with its position as a state where that is measured, without what settles at once."""
        return self.training.base

    @property
    def plant(self) -> type[Plant]:
        """Its plant."""
        return self.training.base.plant

    @property
    def horizon(self) -> float:
        """Seconds over which the motion is predicted, see `Problem.horizon`."""
        return self.training.horizon

    def knowing(self, own: Mapping[str, Mapping[str, float]]) -> Dataset:
        """Return the same with parameters held that each record has a value ``own`` of, by the record's source."""
        if not own:
            return self
        frozen = dict.fromkeys((*self.model.frozen, *(n for values in own.values() for n in values)))
        base = self.model.with_options(frozen=tuple(n for n in frozen if n in self.model.parameters))

        def side(problem: Problem) -> Problem:
            parts = (replace(p, conditions={**own.get(p.source, {}), **p.conditions}) for p in problem.parts)
            return replace(problem, base=base, parts=tuple(parts))

        return replace(self, training=side(self.training), validation=side(self.validation))

    @cached_property
    def noise(self) -> dict[str, float]:
        """Standard deviation of every channel's noise, from all records: of the sensors alone."""
        parts = [(s.t, s.y) for s in (*self.training.segments, *self.validation.segments)]
        return dict(zip(self.training.channels, sensor_noise(parts).tolist(), strict=True))

    @cached_property
    def _swings(self) -> list[Array]:
        """Stroke and largest speed (n, 2) of every swing between turning points, by record, of an imposed motion."""
        plant, found = self.model.plant, list[Array]()
        for record in self.records if plant.motion_is_imposed() else ():
            v = record.u[:, self.model.inputs.index(plant.velocity)]
            x, size = travelled(record.t, v), np.abs(v)
            moving = np.flatnonzero(size > MIN_SWING_SPEED * size.max())
            turns = moving[np.flatnonzero(np.diff(np.sign(v[moving]))) + 1].tolist()
            found.append(np.reshape([(np.ptp(x[a:b]), size[a:b].max()) for a, b in pairwise(turns)], (-1, 2)))
        return found

    @property
    def repeats_one_cycle(self) -> bool:
        """Whether an imposed motion holds one cycle again and again: speed and memory look alike there."""
        swings = np.concatenate([np.zeros((0, 2)), *self._swings])
        return len(swings) > 1 and bool(np.all(swings.max(axis=0) < MAX_SWING_RATIO * swings.min(axis=0)))

    @property
    def turns_once(self) -> bool:
        """Whether an imposed motion turns back once in each record at most: memory and time look alike there."""
        return bool(self._swings) and not any(map(len, self._swings))


def dataset_of(model: Model, data: Records, validation: Records | None = None) -> Dataset:
    """Return both data, with parts held out where none are given for validation; raises `RecordError`."""
    load_entry_points()
    known = as_list(data)
    if model.plant.closed_loop and validation is None:
        return Dataset(model, tuple(known), *held_in_turn(model, known))
    known, unseen = held_out(known) if validation is None else (known, as_list(validation))
    return Dataset(model, (*known, *unseen), *prepared(model, known, unseen))


__all__ = ["Dataset", "Records", "dataset_of"]
