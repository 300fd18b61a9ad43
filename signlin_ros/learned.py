"""The curve that a model's records would teach it: inverse dynamics, then `signlin_ros.learning`, then the effect."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from signlin_ros.diagnosis.comparison import compare_efforts
from signlin_ros.diagnosis.inverse import Efforts
from signlin_ros.effects.learned_force import OVER
from signlin_ros.errors import InputError
from signlin_ros.learning import Learned, learn
from signlin_ros.model import Model
from signlin_ros.records import ModelData

Array = NDArray[np.float64]
DIGITS = 6
"""Significant digits of what is written into a model."""


def learn_missing(
    model: Model,
    data: ModelData | Sequence[ModelData],
    over: str,
    shape: str = "free",
    cutoff: float | None = None,
) -> Learned:
    """Learn the force that a model lacks on records, as a curve over one coordinate or two.

    The missing force is the effort that the measured motion takes by the model, less the measured one, both behind the
    same zero-phase low-pass (`signlin_ros.diagnosis.inverse`); where the machine stands it is not known.

    Parameters
    ----------
    over : ``speed``, ``position``, ``load``, or two of them: ``speed, load``.
    shape : one of `signlin_ros.learning.SHAPES`.
    cutoff : of the low-pass in Hz; by default a tenth of the sampling rate, or less.

    Raises
    ------
    InputError
        The effort or a coordinate is not known from these records.
    """
    over = ", ".join(word.strip() for word in over.split(","))
    if over not in OVER:
        raise InputError(f"over: found {over!r}; allowed: {'; '.join(OVER)}")
    efforts = compare_efforts(model, data, cutoff)
    if efforts is None:
        raise InputError("the effort and the motion are not both known from these records, or they are too short")
    coordinates = {word: _along(efforts, model, word) for word in over.split(", ")}
    force = efforts.computed(model) - efforts.measured
    return learn(coordinates, force, efforts.moving(model).astype(float), shape=shape)


def with_learned(model: Model, learned: Learned, key: str | None = None) -> Model:
    """Return a model with what was learned as its effect `learned_force`."""
    parameters = {name: _rounded(value) for name, value in learned.parameters().items()}
    return model.with_effect("learned_force", key, **parameters)


def _rounded(value: object) -> object:
    if isinstance(value, list):
        return [_rounded(one) for one in value]
    return float(f"{value:.{DIGITS}g}") if isinstance(value, float) else value


def _along(efforts: Efforts, model: Model, word: str) -> Array:
    """Return a coordinate (K,) at the samples of the efforts."""
    if word == "load":
        if model.plant.motion_is_imposed():
            raise InputError(f"over: load: the plant {model.plant.name} is moved, nothing drives it")
        return efforts.measured
    name = {"speed": model.plant.velocity, "position": model.plant.position}[word]
    found = efforts.along(model, name)
    if found is None:
        raise InputError(f"over: {word}: the {name} is neither measured nor a state of the model")
    return found


__all__ = ["learn_missing", "with_learned"]
