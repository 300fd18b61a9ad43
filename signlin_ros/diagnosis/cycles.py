"""What a cycle of an imposed motion can tell: where it is always the same, speed and memory look alike; where it turns
back once, memory and time do.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from signlin_ros.follow.data import travelled
from signlin_ros.model import Model
from signlin_ros.records import ModelData

Array = NDArray[np.float64]

TURN = 0.1
"""A swing turns back where the speed is beyond this part of its largest on the other side."""
ALIKE = 1.15
"""Largest ratio of strokes, and of paces, of swings that are alike."""
SWINGS = 2
"""Fewest swings, from one turning point to the next, that tell of one cycle."""
NOTE = (
    "every swing of these records has the same stroke and pace: a force that goes with the speed and one that "
    "remembers the way look alike here; a record of another amplitude or frequency would tell them apart"
)


def one_cycle(model: Model, records: Sequence[ModelData]) -> str:
    """Return a note where the records hold one cycle again and again, empty otherwise, and where the motion is not
    imposed: what follows of it there depends on the force.
    """
    if not model.plant.motion_is_imposed():
        return ""
    swings = np.concatenate([_swings(model, record) for record in records])
    if len(swings) < SWINGS:
        return ""
    return NOTE if np.all(swings.max(axis=0) < ALIKE * swings.min(axis=0)) else ""


def seldom(model: Model, records: Sequence[ModelData]) -> bool:
    """Tell whether an imposed motion turns back once in each record at most: a force that remembers the way cannot be
    told from one that changes with time there.
    """
    return model.plant.motion_is_imposed() and not any(len(_swings(model, record)) for record in records)


def _swings(model: Model, record: ModelData) -> Array:
    """Return stroke and largest speed (n, 2) of every whole swing from one turning point to the next."""
    v = record.u[:, model.inputs.index(model.plant.velocity)]
    x, size = travelled(record.t, v), np.abs(v)
    moving = np.flatnonzero(size > TURN * size.max())
    turns = np.flatnonzero(np.diff(np.sign(v[moving]))) + 1
    bounds = moving[turns].tolist()
    found = [(np.ptp(x[a:b]), size[a:b].max()) for a, b in pairwise(bounds)]
    return np.array(found).reshape(-1, 2)


__all__ = ["one_cycle", "seldom"]
