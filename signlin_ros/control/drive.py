"""A model as a drive: which state is its position, its speed, its current, and what the rest is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from signlin_ros.errors import InputError
from signlin_ros.model import Model
from signlin_ros.simulation import exact_plan_of

Array = NDArray[np.float64]
NO_SLOT = -1
"""Slot of what a drive has not."""


@dataclass(frozen=True)
class Drive:
    """A model with a force or voltage as its first input, and where its states stand.

    ``position`` and ``current`` are `NO_SLOT` where they are no states; ``own`` are the states of effects.
    """

    model: Model
    position: int
    velocity: int
    current: int
    own: tuple[int, ...]

    @classmethod
    def of(cls, model: Model, with_position: bool = False) -> Drive:
        """Read a model; ``with_position`` makes the position of a motor a state. Raise `InputError` on no drive."""
        plant = model.plant
        if plant.motion_is_imposed():
            raise InputError(f"{model.source}: the motion of a {plant.name} is imposed: there is nothing to control")
        if with_position and plant.position not in model.states:
            model = model.with_options(with_position=True)
        names = (plant.position, plant.velocity, "current")
        slots = [model.states.index(name) if name in model.states else NO_SLOT for name in names]
        own = tuple(i for i in range(len(model.states)) if i not in slots)
        return cls(model, slots[0], slots[1], slots[2], own)

    @property
    def slots(self) -> NDArray[np.int64]:
        """Position, velocity and current (3,) among the states."""
        return np.array([self.position, self.velocity, self.current], dtype=np.int64)

    @property
    def plan(self) -> tuple[np.void, NDArray[np.int64]]:
        """What kernels need to know of the model's equations."""
        return exact_plan_of(self.model)

    @property
    def input_unit(self) -> str:
        """Unit of the input that drives."""
        return self.model.units[self.model.inputs[0]]

    @property
    def speed_unit(self) -> str:
        """Unit of the speed."""
        return self.model.units[self.model.plant.velocity]

    @property
    def position_unit(self) -> str:
        """Unit of the position."""
        return "rad" if self.speed_unit.startswith("rad") else "m"


NO_FORCES = ("input_delay", "sensor_offset", "sensor_gain", "sensor_delay")
"""Effects that are no forces."""


def friction_free(model: Model) -> Model:
    """Return a model without its effects, but for delays and sensors: what a data sheet tells of a drive."""
    return model.without_effect(*(key for key, use in model.effects.items() if use.type not in NO_FORCES))


def resting(plant: Drive, position: float) -> Array:
    """Return the state (n,) of a drive that stands at a position, with what hangs on it."""
    names = (plant.model.plant.position,)
    there = [name in names or name.endswith(".position") for name in plant.model.states]
    return np.where(there, position, 0.0)
