"""The base equations: one plant a file, one line each in the list below."""

from __future__ import annotations

from signlin_ros.errors import ModelError, choices, suggest
from signlin_ros.plants.base import Plant
from signlin_ros.plants.bouc_wen import BoucWen
from signlin_ros.plants.dc_motor import DcMotor
from signlin_ros.plants.force_element import ForceElement
from signlin_ros.plants.mass_spring_damper import MassSpringDamper
from signlin_ros.plants.servo import Servo

PLANTS: dict[str, type[Plant]] = {
    plant.name: plant
    for plant in (
        DcMotor,
        MassSpringDamper,
        BoucWen,
        ForceElement,
        Servo,
    )
}
"""Every plant by its name in model files."""


def find_plant(name: object, where: str) -> type[Plant]:
    """Return the plant called ``name``; raise `ModelError` naming the nearest."""
    if not isinstance(name, str) or name not in PLANTS:
        raise ModelError(f"{where}: unknown plant {name!r}; known: {choices(PLANTS)}{suggest(str(name), PLANTS)}")
    return PLANTS[name]


__all__ = ["PLANTS", "Plant", "find_plant"]
