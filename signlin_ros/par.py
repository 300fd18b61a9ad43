"""`Par`: the one declaration of a parameter, from which checks, help, ROS descriptors and docs are derived."""

from __future__ import annotations

import keyword
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from signlin_ros.errors import ModelError, choices, suggest

_DECLARED: dict[type, dict[str, Par]] = {}
"""What was looked up of each class that has parameters."""
POWERS = "²³⁴⁵⁶⁷⁸⁹"
"""What a unit is raised to, from 2 on."""


@dataclass(frozen=True)
class Par:
    """A parameter: unit, a nominal value to start from, bounds, and a sentence.

    In ``unit``, ``F`` stands for the plant's unit of force or torque and ``Q`` for its unit of position.
    ``default`` is what a model file that leaves the parameter out gets; None: it must be given.
    ``positive`` excludes the lower bound itself; ``structural`` values change the equations, not only their numbers;
    ``free_standing`` marks a parameter that exists only where the plant does not supply it (a spring's k).
    """

    unit: str
    nominal: float
    low: float = 0.0
    high: float = 1e9
    doc: str = ""
    default: float | None = None
    positive: bool = False
    structural: bool = False
    free_standing: bool = False

    def range_text(self) -> str:
        """Return the allowed range, e.g. ``(0, 10]``."""
        if -self.low == self.high == math.inf:
            return "a finite number"
        return f"{'(' if self.positive else '['}{self.low:g}, {self.high:g}{')' if self.high == math.inf else ']'}"

    def nearest(self, value: float) -> float:
        """Return the allowed value that is nearest to a number."""
        low = math.nextafter(self.low, math.inf) if self.positive else self.low
        return min(max(float(value), low), self.high)

    def check(self, value: Any, where: str, unit: str | None = None) -> float:
        """Return ``value`` as a float; raise `ModelError` unless it is a finite number within the bounds."""
        unit = self.unit if unit is None else unit
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            allowed = self.range_text().replace("[", "a number in [").replace("(", "a number in (")
            raise ModelError(f"{where}: found {value!r}; allowed: {_joined(allowed, unit)}")
        number = float(value)
        inside = self.low <= number <= self.high and not (self.positive and number == self.low)
        if not (math.isfinite(number) and inside):
            raise ModelError(f"{where}: found {number:g}; allowed: {_joined(self.range_text(), unit, self.doc)}")
        return number


def _joined(allowed: str, unit: str, doc: str = "") -> str:
    """Return ``(0, 10] Ohm (armature resistance)``, without what is not known."""
    return " ".join(part for part in (allowed, unit, f"({doc})" if doc else "") if part)


class HasPars:
    """A class whose `Par` attributes are its parameters, in the order in which they are written.

    A trailing underscore (``lambda_``) frees a name from Python's keywords; it is not part of the name.
    """

    @classmethod
    def pars(cls) -> dict[str, Par]:
        """Return the declared parameters by their public names."""
        found = _DECLARED.get(cls)
        if found is None:
            members = {name: value for base in reversed(cls.__mro__) for name, value in vars(base).items()}
            found = {name.rstrip("_"): value for name, value in members.items() if isinstance(value, Par)}
            _DECLARED[cls] = found
        return dict(found)


def check_values(pars: Mapping[str, Par], given: Mapping[str, Any], where: str) -> dict[str, float]:
    """Return all parameters of ``pars`` from ``given`` and the defaults, checked; raise `ModelError` otherwise.

    A name may be given as the attribute that it is in Python (``lambda_``).
    """
    attributes = {Namespace.attribute(name): name for name in pars if name not in given}
    given = {attributes.get(name, name): value for name, value in given.items()}
    for name in given:
        if name not in pars:
            raise ModelError(f"{where}.{name}: unknown parameter; known: {choices(pars)}{suggest(str(name), pars)}")
    values = {}
    for name, par in pars.items():
        if name in given:
            values[name] = par.check(given[name], f"{where}.{name}")
        elif par.default is not None:
            values[name] = par.default
        elif not par.free_standing:
            raise ModelError(f"{where}.{name}: missing; allowed: {_joined(par.range_text(), par.unit, par.doc)}")
    return values


class Namespace:
    """Values by attribute: ``p.mu``, ``p.lambda_``; a missing name raises `AttributeError` as usual."""

    def __init__(self, values: Mapping[str, Any]) -> None:
        for name, value in values.items():
            setattr(self, self.attribute(name), value)

    @staticmethod
    def attribute(name: str) -> str:
        """Return the attribute under which a public name is found: Python's keywords get an underscore."""
        return f"{name}_" if keyword.iskeyword(name) else name

    def __getattr__(self, name: str) -> Any:
        raise AttributeError(name)
