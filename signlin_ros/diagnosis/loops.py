"""Hysteresis is told by its loops: which law of its family they follow is not known where much of the force is left."""

from __future__ import annotations

from collections.abc import Collection
from functools import partial

import numpy as np
from numpy.typing import NDArray

from signlin_ros.comparison.force_segment import ForceSegment, missing_force
from signlin_ros.diagnosis.equation_error.flexible import Columns
from signlin_ros.diagnosis.output_error import FittedModel
from signlin_ros.diagnosis.results import listed
from signlin_ros.model import Model


def forces_of(f: FittedModel, names: Collection[str]) -> dict[str, Columns]:
    """Return the force (T,) of some of a model's effects along a piece, by ``loop of`` and the name."""

    def force(piece: ForceSegment, without: Model) -> NDArray[np.float64]:
        return missing_force(without, piece) - missing_force(f.model, piece)

    keys = {k: use.type for k, use in f.added.items() if use.type in names}
    return {f"loop of {listed([n])}": partial(force, without=f.model.without_effect(k)) for k, n in keys.items()}


__all__ = ["forces_of"]
