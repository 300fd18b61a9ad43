"""The scale that all forces of a machine have in common, as a rival: where no force is measured, no motion shows it.

J v' = sum of forces is the same equation with the inertia and every force so many times as large. Only what is known
beforehand then says how large they are [Gautier and Khalil, IEEE Trans. Robotics and Automation 6 (1990) 368,
doi:10.1109/70.56655: which parameters, or sums of them, move what is measured].
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from signlin_ros.errors import InputError
from signlin_ros.experiment.contenders import Contender
from signlin_ros.model import Model
from signlin_ros.model.numbers import declared
from signlin_ros.names import PROPER_NAMES
from signlin_ros.par import POWER_DIGITS
from signlin_ros.recording.trace import resolve_unit

NO_EFFECT = "nothing"
"""The name of the rival that adds no effect."""
ALL_FORCES = "all_forces"
"""What is joined to the name of a rival for the same one with all forces larger."""
LARGER = 1.1
"""By how many times they are."""
HELD = 1e8
"""Information about the logarithm of an inertia that is held: to within 1e-4."""
INERTIAS = ("J", "m")
"""Names of the inertia of a plant."""
MASSES = frozenset({"N", "kg"})
"""Units that are of the first power in mass."""


def is_scaled(name: str) -> bool:
    """Tell whether a name of a rival asks for larger forces."""
    return ALL_FORCES in _parts(name)


def unscaled(name: str) -> str:
    """Return the plain name of the same rival with its forces as they are."""
    return "+".join(part for part in _parts(name) if part != ALL_FORCES) or NO_EFFECT


def _parts(name: str) -> list[str]:
    for key, proper in PROPER_NAMES.items():
        name = name.replace(proper, key)
    return [part.strip().replace(" ", "_") for part in name.split("+")]


def force_power(unit: str) -> int:
    """Return the power of the force, or of the mass, in a unit: 1 of N·m/A, 0 of V·s/rad."""
    above, *below = unit.split("/")
    count = [sum(part.rstrip(POWER_DIGITS) in MASSES for part in re.split("·", side)) for side in (above, *below)]
    return count[0] - sum(count[1:])


def force_parameters(model: Model) -> dict[str, int]:
    """Return the powers of the force in a model's parameters, by name, those that are not 0."""
    units = {n: resolve_unit(par.unit, model.plant) for n, par in declared(model).items()}
    return {n: power for n, unit in units.items() if (power := force_power(unit))}


def with_larger_forces(contenders: Sequence[Contender], larger: Sequence[bool]) -> tuple[Contender, ...]:
    """Return rivals of which some have all forces `LARGER` times as large, each with its inertia held: it is what tells
    one scale from another. Raises `InputError` where the scale of forces is known.
    """
    return tuple(_held(_scaled(c) if times else c) for c, times in zip(contenders, larger, strict=True))


def _scaled(c: Contender) -> Contender:
    theta, scale = c.theta.copy(), np.ones(c.theta.size)
    model = c.model_at(c.theta)
    free = {k.name: i for i, k in enumerate(c.candidate.coordinates)}
    for name, power in force_parameters(model).items():
        if name not in free:
            if model.value(name):
                raise InputError(f"--between: {ALL_FORCES}: {name} is known exactly, and so is the scale of forces")
            continue
        i, k = free[name], c.candidate.coordinates[free[name]]
        theta[i] = k.theta(LARGER**power * k.value(float(theta[i])))
        scale[i] = 1.0 if k.log else LARGER**-power
    information = c.information * np.outer(scale, scale)
    return replace(c, theta=theta, information=information, scale=LARGER, minima=(), behind=(), told=None, models={})


def _held(c: Contender) -> Contender:
    names = [k.name for k in c.candidate.coordinates]
    inertia = next((names.index(n) for n in INERTIAS if n in names), None)
    if inertia is None:
        raise InputError(f"--between: {ALL_FORCES}: the model has no inertia that is free, or the scale would be known")
    information = c.information.copy()
    information[inertia, inertia] += HELD
    return replace(c, information=information)


__all__ = [
    "ALL_FORCES",
    "INERTIAS",
    "NO_EFFECT",
    "force_parameters",
    "force_power",
    "is_scaled",
    "unscaled",
    "with_larger_forces",
]
