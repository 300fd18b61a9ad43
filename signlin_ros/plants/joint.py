"""One joint of an arm, as what the effects of a model file are checked against: its units."""

from __future__ import annotations

from collections.abc import Mapping

from signlin_ros.plants.base import Plant


class TurningJoint(Plant):
    """A revolute joint."""

    name = "arm"
    force_unit, position_unit, input_unit = "N·m", "rad", "N·m"
    position, velocity = "position", "velocity"
    inputs = {"effort": "N·m"}

    @classmethod
    def states(cls, values: Mapping[str, float]) -> dict[str, str]:
        """Return position and velocity, and their units."""
        return {"position": cls.position_unit, "velocity": f"{cls.position_unit}/s"}

    @classmethod
    def channels(cls, values: Mapping[str, float]) -> dict[str, str]:
        """Return nothing: an arm has no effects of sensors."""
        return {}


class SlidingJoint(TurningJoint):
    """A prismatic joint."""

    force_unit, position_unit, input_unit = "N", "m", "N"
    inputs = {"effort": "N"}


def joint_plant(prismatic: bool) -> type[Plant]:
    """Return the plant of a joint."""
    return SlidingJoint if prismatic else TurningJoint


__all__ = ["joint_plant"]
