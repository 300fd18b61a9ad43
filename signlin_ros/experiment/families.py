"""Families of commands: each is one kind of motion at several sizes in one record, since the size decides as much as
the kind. What the effects' own texts ask for is among them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from signlin_ros.experiment.parts import Part

PEAK_PARTS = (0.45, 0.7, 1.0)
"""Parts of the peak at which a family's motion is repeated in one record."""
LADDER = tuple(float(x) for x in np.geomspace(0.03, 1.0, 11))
"""Peaks that are tried, as parts of the largest input, the quietest first."""


@dataclass(frozen=True)
class Family:
    """A kind of command: its name, its parts with a peak of 1, and the effects whose texts ask for it."""

    name: str
    parts: tuple[Part, ...]
    texts: tuple[str, ...] = ()

    def at(self, peak: float) -> tuple[Part, ...]:
        """Return its parts at a peak."""
        return tuple(replace(p, peak=p.peak * peak) for p in self.parts)


def _repeated(kind: str, frequency: float, sizes: Sequence[float] = PEAK_PARTS, **more: float) -> tuple[Part, ...]:
    return tuple(Part(kind, size, frequency, **more) for size in sizes)


COMMAND_FAMILIES = (
    Family("slow triangles", _repeated("triangle", 0.8), ("coulomb_friction", "input_deadzone", "backlash")),
    Family(
        "slow ramps through standstill",
        _repeated("triangle", 0.4, (0.5, 1.0)),
        ("stribeck_friction", "dahl_presliding", "lugre_friction", "load_dependent_stribeck", "play_friction"),
    ),
    Family(
        "staircase",
        (Part("staircase", 0.5, 0.3), Part("staircase", 1.0, 0.3, 1.5)),
        (
            *("viscous_friction", "cubic_viscous_friction", "quadratic_drag", "gravity_load", "linear_stiffness"),
            *("asymmetric_viscous_friction", "hard_stop", "cubic_stiffness", "load_dependent_friction"),
        ),
    ),
    Family(
        "steps with rests",
        _repeated("steps", 0.8),
        (
            *("input_delay", "sensor_delay", "constant_load", "input_saturation", "torque_constant_saturation"),
            "maxwell_element",
        ),
    ),
    Family("fast steps", _repeated("steps", 3.0)),
    Family("creep to and fro", _repeated("creep", 0.5), ("cogging_torque", "torque_ripple", "sensor_gain")),
    Family("sines that grow", _repeated("sine", 1.0), ("bouc_wen_hysteresis", "pinching_hysteresis")),
    Family("fast sines that grow", _repeated("sine", 4.0)),
    Family("chirps", _repeated("chirp", 8.0), ("compliant_load",)),
    Family("slow chirps", _repeated("chirp", 2.5)),
    Family("multisines", _repeated("multisine", 6.0)),
    Family("releases", (Part("release", 0.6), Part("release", -0.6), Part("release", 1.0), Part("release", -1.0))),
    Family(
        "long holds",
        (Part("hold", 1.0), Part("hold", -1.0), Part("hold", 0.5), Part("hold", -0.5)),
        ("thermal_resistance", "sensor_offset", "temperature_dependent_friction"),
    ),
)


def mixed(first: Family, second: Family) -> Family:
    """Return a family with the larger motions of two, one after the other."""
    parts = (*first.parts[-2:], *second.parts[-2:])
    return Family(f"{first.name}, then {second.name}", parts, (*first.texts, *second.texts))


def asked_by(effects: Sequence[str]) -> tuple[str, ...]:
    """Return the names of the families that the texts of some effects ask for."""
    return tuple(f.name for f in COMMAND_FAMILIES if set(f.texts) & set(effects))


__all__ = ["COMMAND_FAMILIES", "LADDER", "Family", "asked_by", "mixed"]
