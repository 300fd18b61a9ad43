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
from signlin_ros.effects import EFFECTS, find_effect
from signlin_ros.model import Model


def forces_of(f: FittedModel, names: Collection[str]) -> dict[str, Columns]:
    """Return the force (T,) of some of a model's effects along a piece, by ``loop of`` and the name."""

    def force(piece: ForceSegment, without: Model) -> NDArray[np.float64]:
        return missing_force(without, piece) - missing_force(f.model, piece)

    keys = {k: use.type for k, use in f.added.items() if use.type in names}
    return {f"loop of {listed([n])}": partial(force, without=f.model.without_effect(k)) for k, n in keys.items()}


def family_of(effect: str, changing: str) -> str:
    """Return in words the laws a loop may follow, and whether its force is ``changing`` along the records."""
    family = find_effect(effect, "effects").family
    names = [n for n, other in EFFECTS.items() if other.family == family and other.states]
    laws = f" ({', '.join(listed([n]) for n in names)} are laws of it)"
    if changing.startswith("loop"):
        return f"{laws} whose force changes slowly along the record, as that of what degrades"
    return f"{laws}, and which loop it is cannot be told"


__all__ = ["family_of", "forces_of"]
