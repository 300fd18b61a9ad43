"""`Par`: the one declaration of a parameter, from which checks, help, ROS descriptors and docs are derived."""

from __future__ import annotations

import keyword
import math
import re
from collections.abc import Iterable, Mapping, Sized
from dataclasses import dataclass, replace
from typing import Any

from signlin_ros.errors import ModelError, choices, suggest

_DECLARED: dict[type, Pars] = {}
"""What was looked up of each class that has parameters."""
_ELEMENT = re.compile(r"(.+)\[(\d+)\]")
"""An element of a list: ``A[0]``."""
POWER_DIGITS = "²³⁴⁵⁶⁷⁸⁹"
"""What a unit is raised to, from 2 on."""


@dataclass(frozen=True)
class Par:
    """A parameter: unit, a nominal value to start from, bounds, and a sentence.

    In ``unit``, ``F`` stands for the plant's unit of force or torque and ``Q`` for its unit of position.
    ``default`` is what a model file that leaves the parameter out gets; None: it must be given.
    ``positive`` excludes the lower bound itself; ``structural`` values change the equations, not only their numbers;
    ``free_standing`` marks a parameter that exists only where the plant does not supply it (a spring's k).

    ``elements`` makes it a list, nominally of these numbers: unit, bounds and default are those of every element, the
    law gets a tuple, and everything that deals in single numbers knows the elements as ``A[0]``, ``A[1]``, ... A list
    that is nominally empty may be left out. ``along`` names the list that it must be as long as.
    ``words`` makes it one of several words, or of lists of words (``"speed, load"``): a number to everything but the
    law, the model file and the catalogue, its place among them. Such a parameter is ``structural``.
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
    elements: tuple[float, ...] | None = None
    along: str = ""
    words: tuple[str, ...] = ()

    def element(self, index: int) -> Par:
        """Return the declaration of one element of a list."""
        own = self.elements or ()
        return replace(self, elements=None, along="", nominal=own[index] if index < len(own) else self.nominal)

    def written(self, value: float) -> float | str | list[str]:
        """Return a value as a model file has it."""
        if not self.words:
            return value
        word = self.words[int(value)]
        return word.split(", ") if "," in word else word

    def range_text(self) -> str:
        """Return the allowed range, e.g. ``(0, 10]``."""
        if self.words:
            return ", ".join(f"[{word}]" if "," in word else word for word in self.words)
        if -self.low == self.high == math.inf:
            return "a finite number"
        return f"{'(' if self.positive else '['}{self.low:g}, {self.high:g}{')' if self.high == math.inf else ']'}"

    def nearest(self, value: float) -> float:
        """Return the allowed value that is nearest to a number."""
        low = math.nextafter(self.low, math.inf) if self.positive else self.low
        return min(max(float(value), low), self.high)

    def check(self, value: Any, where: str, unit: str | None = None) -> float:
        """Return ``value`` as a float; raise `ModelError` unless it is a finite number within the bounds."""
        if self.words:
            return self._place(value, where)
        unit = self.unit if unit is None else unit
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            allowed = self.range_text().replace("[", "a number in [").replace("(", "a number in (")
            raise ModelError(f"{where}: found {value!r}; allowed: {_joined(allowed, unit)}")
        number = float(value)
        inside = self.low <= number <= self.high and not (self.positive and number == self.low)
        if not (math.isfinite(number) and inside):
            raise ModelError(f"{where}: found {number:g}; allowed: {_joined(self.range_text(), unit, self.doc)}")
        return number

    def _place(self, value: Any, where: str) -> float:
        """Return the place of a word, or of a list of words, among those that are allowed."""
        many = isinstance(value, (list, tuple))
        word = ", ".join(map(str, value)) if many else value
        if word not in self.words:
            hint = suggest(str(word), self.words)
            raise ModelError(f"{where}: found {value!r}; allowed: {self.range_text()} ({self.doc}){hint}")
        return float(self.words.index(word))

    def check_list(self, value: Any, where: str) -> list[float]:
        """Return a list of numbers, each as `check` returns it."""
        if hasattr(value, "tolist"):  # arrays, of ROS and of NumPy
            value = value.tolist()
        if not isinstance(value, (list, tuple)):
            raise ModelError(f"{where}: found {value!r}; allowed: a list of numbers, each in {self.range_text()}")
        return [self.check(item, f"{where}[{i}]") for i, item in enumerate(value)]


class Pars(dict[str, Par]):
    """Declarations by name; an element of a list has that of the list (``pars["A[3]"]``)."""

    def __missing__(self, name: str) -> Par:
        found = _ELEMENT.fullmatch(name)
        if found is None or found[1] not in self or self[found[1]].elements is None:
            raise KeyError(name)
        return self[found[1]].element(int(found[2]))

    def with_units(self, unit: Any) -> Pars:
        """Return the declarations with every unit as a function gives it."""
        return Pars({name: replace(par, unit=unit(par.unit)) for name, par in self.items()})


def declared_name(name: str) -> str:
    """Return the name under which a parameter is declared: that of the list of which it is an element, or its own."""
    found = _ELEMENT.fullmatch(name)
    return found[1] if found else name


def place_of(name: str) -> int | None:
    """Return which element of a list a name means, None where it means no element."""
    found = _ELEMENT.fullmatch(name)
    return int(found[2]) if found else None


def spread(name: str, values: Iterable[Any]) -> dict[str, Any]:
    """Return the elements of a list by their names."""
    return {f"{name}[{i}]": value for i, value in enumerate(values)}


def gathered(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return values with the elements of every list put together: ``{"A[0]": 1, "A[1]": 2}`` as ``{"A": [1, 2]}``."""
    found: dict[str, Any] = {}
    lists: dict[str, dict[int, Any]] = {}
    for name, value in values.items():
        index = place_of(name)
        if index is None:
            found[name] = value
        else:
            lists.setdefault(declared_name(name), found.setdefault(declared_name(name), {}))[index] = value
    for name, items in lists.items():
        if set(items) != set(range(len(items))):
            raise ModelError(f"{name}: found the elements {sorted(items)}; allowed: all from 0 on")
        found[name] = [items[i] for i in range(len(items))]
    return found


def nominal_values(pars: Mapping[str, Par]) -> dict[str, float]:
    """Return the nominal value of every parameter, of lists that of every element."""
    found: dict[str, float] = {}
    for name, par in pars.items():
        found |= {name: par.nominal} if par.elements is None else spread(name, par.elements)
    return found


def as_law_sees(pars: Mapping[str, Par], values: Mapping[str, Any]) -> Namespace:
    """Return values as a law gets them: lists as tuples, words as words."""
    found: dict[str, Any] = {name: () for name, par in pars.items() if par.elements is not None}
    for name, value in gathered(values).items():
        words = pars[name].words if name in pars else ()  # a sensor's are named by its channels
        found[name] = tuple(value) if isinstance(value, list) else words[int(value)] if words else value
    return Namespace(found)


def _joined(allowed: str, unit: str, doc: str = "") -> str:
    """Return ``(0, 10] Ohm (armature resistance)``, without what is not known."""
    return " ".join(part for part in (allowed, unit, f"({doc})" if doc else "") if part)


class HasPars:
    """A class whose `Par` attributes are its parameters, in the order in which they are written.

    A trailing underscore (``lambda_``) frees a name from Python's keywords; it is not part of the name.
    """

    @classmethod
    def pars(cls) -> Pars:
        """Return the declared parameters by their public names."""
        found = _DECLARED.get(cls)
        if found is None:
            members = {name: value for base in reversed(cls.__mro__) for name, value in vars(base).items()}
            found = Pars({name.rstrip("_"): value for name, value in members.items() if isinstance(value, Par)})
            _DECLARED[cls] = found
        return Pars(found)


def check_values(pars: Mapping[str, Par], given: Mapping[str, Any], where: str) -> dict[str, float]:
    """Return all parameters of ``pars`` from ``given`` and the defaults, checked; raise `ModelError` otherwise.

    A name may be given as the attribute that it is in Python (``lambda_``). Lists are returned by their elements.
    """
    attributes = {Namespace.attribute(name): name for name in pars if name not in given}
    given = {attributes.get(name, name): value for name, value in given.items()}
    for name in given:
        if name not in pars:
            raise ModelError(f"{where}.{name}: unknown parameter; known: {choices(pars)}{suggest(str(name), pars)}")
    values: dict[str, float] = {}
    for name, par in pars.items():
        if par.elements is not None:
            values |= spread(name, _checked_list(pars, given, name, where))
        elif name in given:
            values[name] = par.check(given[name], f"{where}.{name}")
        elif par.default is not None:
            values[name] = par.default
        elif not par.free_standing:
            raise ModelError(f"{where}.{name}: missing; allowed: {_joined(par.range_text(), par.unit, par.doc)}")
    return values


def _checked_list(pars: Mapping[str, Par], given: Mapping[str, Any], name: str, where: str) -> list[float]:
    """Return a list of parameters, as long as the one that it goes along with."""
    par = pars[name]
    other = given.get(par.along)
    count = len(other) if isinstance(other, Sized) else None
    if name not in given:
        if par.elements and (par.default is None or count is None):
            raise ModelError(f"{where}.{name}: missing; allowed: a list of numbers {_joined('', par.unit, par.doc)}")
        return [] if par.default is None else [par.default] * (count or 0)
    values = par.check_list(given[name], f"{where}.{name}")
    if par.elements and not values:
        raise ModelError(f"{where}.{name}: found an empty list; allowed: at least one number")
    if count is not None and len(values) != count:
        raise ModelError(
            f"{where}.{name}: found {len(values)} numbers; allowed: {count}, one for each of {where}.{par.along}"
        )
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
