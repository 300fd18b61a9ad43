"""A robot of several joints, motors with friction in each: the plant is made from a robot, one class for each."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from signlin_ros.par import Par, Pars
from signlin_ros.plants.base import Acting, Plant
from signlin_ros.robots import Robot

Array = NDArray[np.float64]
MOTOR_INERTIA, GAIN_PARAMETER = "motor_inertia", "gain"
"""Parameters of every joint: inertia of its motor seen from the joint; force or torque per unit of its input."""


class ArmPlant(Plant):
    """A robot of several joints, the rigid body out of a URDF.

    M(q) q'' + P^T Im P q'' + h(q, q') = K u + P^T F: h gravity, centrifugal and Coriolis forces, Im the motors'
    inertias, K gains, F the effects of each joint, in the coordinates P q of the motors (P = 1 without couplings).
    """

    name = "arm"
    equation = "(M(q) + P^T Im P) q'' + h(q, q') = K u + P^T F"
    force_unit, position_unit, input_unit = "N·m", "rad", "N·m"
    position, velocity, effort = "", "", ""
    inputs: ClassVar[dict[str, str]] = {}
    linearization = "per_joint"
    robot: ClassVar[Robot]
    motors: ClassVar[Array]
    """Coordinates of the motors from those of the joints, P (n, n), 1 on its diagonal."""
    places: ClassVar[Array]
    """Coordinates in which effects act (K, n): of the motors, then of the joints that a coupling parts from theirs."""
    at_joint: ClassVar[frozenset[str]] = frozenset()
    """Effects that act on such a joint and not on its motor, by their keys."""
    at_motor: ClassVar[tuple[bool, ...]]
    """Whether the input of each joint is that of its motor, P^T of which acts on the joints."""

    @classmethod
    def pars(cls) -> Pars:
        """Return the declared parameters: two for every joint."""
        found = Pars()
        for joint in cls.robot.joints:
            unit = "kg" if joint.prismatic else "kg·m²"
            inertia = Par(unit, nominal=0.0, default=0.0, doc="inertia of the motor, seen from the joint")
            gain = Par(
                f"{joint.effort_unit} per input", nominal=1.0, low=-1e9, default=1.0, doc="per unit of the input"
            )
            found |= {f"{joint.name}.{MOTOR_INERTIA}": inertia, f"{joint.name}.{GAIN_PARAMETER}": gain}
        return found

    @classmethod
    def states(cls, values: Mapping[str, float]) -> dict[str, str]:
        """Return the positions of all joints, then their velocities, and units."""
        joints = cls.robot.joints
        positions = {f"{j.name}.position": j.position_unit for j in joints}
        return {**positions, **{f"{j.name}.velocity": f"{j.position_unit}/s" for j in joints}}

    @classmethod
    def channels(cls, values: Mapping[str, float]) -> dict[str, str]:
        """Return the quantities that a sensor can be on, with units."""
        return cls.states(values)

    @classmethod
    def aliases(cls) -> dict[str, str]:
        """Return nothing: position, velocity and effort are those of a joint."""
        return {}

    @classmethod
    def place_of(cls, key: str) -> int:
        """Return in which of `places` an effect acts, by its key."""
        i = cls.robot.names.index(key.rpartition(".")[0])
        return cls.robot.n + parted(cls.motors).index(i) if key in cls.at_joint and i in parted(cls.motors) else i

    def rates(self, m: Any, x: Any, u: Any, p: Any, act: Acting) -> dict[str, Any]:
        """Raise: the equations of an arm are recorded in parts (`signlin_ros.recording.arm`)."""
        raise NotImplementedError("an arm is recorded by signlin_ros.recording.arm")


def parted(motors: Array) -> list[int]:
    """Return the joints that a coupling parts from their motors (n, n)."""
    return [i for i, row in enumerate(motors) if np.count_nonzero(row) > 1]


def places(motors: Array) -> Array:
    """Return the coordinates in which effects act (K, n), see `ArmPlant.places`."""
    return np.concatenate([motors, np.eye(len(motors))[parted(motors)]])


def arm_plant(
    robot: Robot, motors: Array, units: Mapping[str, str], at_motor: tuple[bool, ...], at_joint: Iterable[str] = ()
) -> type[ArmPlant]:
    """Return the plant of a robot; ``units`` of the inputs by joint."""
    inputs = {f"{name}.effort": units[name] for name in robot.names}
    own = {"robot": robot, "motors": motors, "places": places(motors), "inputs": inputs}
    more = {"at_motor": at_motor, "at_joint": frozenset(at_joint), "__doc__": ArmPlant.__doc__}
    return type("ArmPlant", (ArmPlant,), own | more)


__all__ = ["GAIN_PARAMETER", "MOTOR_INERTIA", "ArmPlant", "arm_plant", "parted", "places"]
