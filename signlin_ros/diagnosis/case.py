"""Records made ready for both witnesses: what is fitted to, what is held out, and what they are told apart by."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from signlin_ros.fitting.prepare import held_out
from signlin_ros.follow.data import as_list
from signlin_ros.follow.segments import with_measured_position
from signlin_ros.model import Model
from signlin_ros.records import ModelData


@dataclass(frozen=True, eq=False)
class Case:
    """A model and its records: ``known`` and ``unseen`` as given or held out."""

    model: Model
    known: tuple[ModelData, ...]
    unseen: tuple[ModelData, ...]

    @property
    def rotary(self) -> bool:
        """Whether the axis turns: as the model, its plant or the records' units say."""
        return self.model.turns(self.known[0].units)


def case(
    model: Model, data: ModelData | Sequence[ModelData], validation: ModelData | Sequence[ModelData] | None
) -> Case:
    """Return a case; without validation the last third of every record is held out. Raises `RecordError`."""
    records, given = as_list(data), None if validation is None else as_list(validation)
    known, unseen = (records, given) if given else held_out(records)
    return Case(with_measured_position(model, [*known, *unseen]), tuple(known), tuple(unseen))


__all__ = ["Case", "case"]
