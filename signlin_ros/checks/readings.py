"""Ways to read a record: its signals in other units, reversed, or by a factor."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from signlin_ros.checks.factors import LOGGED_TOGETHER, other_units, word
from signlin_ros.checks.look import Look
from signlin_ros.checks.observer import CONSTANT_SOURCE, LinearPrediction, Together

MAX_FACTOR_RATIO = 1.35
"""A unit is meant where the factor that suits best is no more than this away from it."""
GEAR = 3.0
"""Smaller factors are a matter of the model's parameters."""
MAX_GEAR = 2e5
"""Larger ones are none of a gear or of a unit: of a bar there are 1e5 Pa."""


@dataclass(frozen=True)
class Reading:
    """One way to read a record: what some of its signals are divided by; in words; and the name of the cure.

    ``far_fetched``: one of so many that one is better by chance, or for what the model lacks.
    """

    divided: Mapping[str, float]
    words: str
    cure: str
    far_fetched: bool = False

    @property
    def scales(self) -> dict[str, float]:
        """What the signals are multiplied by."""
        return {name: 1.0 / factor for name, factor in self.divided.items()}

    @property
    def only_sign(self) -> bool:
        """Whether nothing but signs differ."""
        return all(factor == -1.0 for factor in self.divided.values())


def signs(look: Look, p: LinearPrediction | Together) -> Iterator[Reading]:
    """Yield the signals, and position and velocity together, that may be reversed."""
    for name in p.sources:
        if _recorded(name, p):
            words = f"with the sign of the {name} reversed the model follows the record"
            yield Reading({name: -1.0}, words, f"reverse_{name}")
    q, v = look.position, look.velocity
    if {q, v} <= set(p.sources):
        words = f"with the signs of {q} and {v} reversed the model follows the record"
        yield Reading({q: -1.0, v: -1.0}, words, f"reverse_{q}_and_{v}")


def units(look: Look, p: LinearPrediction | Together) -> Iterator[Reading]:
    """Yield the units that one signal, or position and velocity together, may be in."""
    for name in p.sources:
        if not _recorded(name, p):
            continue
        for unit, factor in look.others(name).items():
            for sign in (1.0, -1.0):
                if _suits(p, {name: sign * factor}):
                    turned = " and reversed" if sign < 0 else ""
                    cure = f"{name}_in_{word(unit)}" + ("_reversed" if sign < 0 else "")
                    yield Reading({name: sign * factor}, f"the {name} fits if it is in {unit}{turned}", cure)
    q, v = look.position, look.velocity
    for of_model, one, other in LOGGED_TOGETHER if {q, v} <= set(p.sources) else ():
        if of_model in (look.unit(q), {"m": "rad"}.get(look.unit(q))):
            factors = {q: other_units(look.unit(q))[one], v: other_units(look.unit(v))[other]}
            words = f"{q} and {v} fit if they are in {one} and {other}"
            yield Reading(factors, words, f"{q}_in_{word(one)}_{v}_in_{word(other)}")


def pairs(look: Look, p: LinearPrediction | Together) -> Iterator[Reading]:
    """Yield the units that two signals may be in, which are not position and velocity of one kind; and the unit of one
    beside the sign of another.
    """
    one = [
        (name, unit, factor) for name in p.sources if _recorded(name, p) for unit, factor in look.others(name).items()
    ]
    for (a, first, of_a), (b, second, of_b) in itertools.combinations(one, 2):
        if a != b:
            words = f"{a} and {b} fit if they are in {first} and {second}"
            yield Reading({a: of_a, b: of_b}, words, f"{a}_in_{word(first)}_{b}_in_{word(second)}", far_fetched=True)
    for (a, unit, of_a), b in itertools.product(one, [name for name in p.sources if _recorded(name, p)]):
        if a != b:
            words = f"the {a} fits if it is in {unit} and the {b} is reversed"
            yield Reading({a: of_a, b: -1.0}, words, f"{a}_in_{word(unit)}_reverse_{b}", far_fetched=True)


def gears(look: Look, p: LinearPrediction | Together) -> Iterator[Reading]:
    """Yield single signals that fit by a factor that is no unit's."""
    for name in p.sources:
        if not _recorded(name, p):
            continue
        factor = _best(p, name)
        if GEAR < abs(factor) < MAX_GEAR or GEAR < 1.0 / max(abs(factor), 1e-12) < MAX_GEAR:
            yield gear(look, name, factor)


def by_parameters(look: Look, p: LinearPrediction | Together) -> float:
    """Return the least that is left where the first input is up to `GEAR` times as large, or as small: as if all
    parameters of the model were wrong by that.
    """
    name = look.record.inputs[0]
    factors = np.geomspace(1.0 / GEAR, GEAR, 21)
    return float(np.min(p.lefts([{name: factor} for factor in factors.tolist()])))


def gear(look: Look, name: str, factor: float) -> Reading:
    """Return a signal divided by a factor that is no unit's."""
    by = f"divided by {factor:.3g}" if abs(factor) > 1.0 else f"multiplied by {1.0 / factor:.3g}"
    words = f"the {name} fits if it is {by}: a gear, a unit, or a wrong scale"
    if name in look.record.inputs and look.model.plant.scaled_by_effort:
        words += f" (or {', '.join(look.model.plant.scaled_by_effort)} of the model are all wrong by that)"
    return Reading({name: factor}, words, f"scale_{name}", far_fetched=True)


def _recorded(name: str, p: LinearPrediction | Together) -> bool:
    """Tell whether a source is an input or a channel of the record."""
    return name != CONSTANT_SOURCE and name not in p.free


def _best(p: LinearPrediction | Together, name: str) -> float:
    """Return by what a signal is to be divided so that the least is left of all channels."""
    grid = [sign * 10.0**k for sign in (1.0, -1.0) for k in [i / 20 for i in range(-110, 111)]]
    best = int(np.argmin(p.lefts([{name: 1.0 / factor} for factor in grid])))
    return float(grid[best])


def _suits(p: LinearPrediction | Together, factors: Mapping[str, float]) -> bool:
    """Tell whether other factors near those of a unit suit no better, by much, than the unit's."""
    ((name, factor),) = factors.items()
    around = (1.0, 1.0 / MAX_FACTOR_RATIO**2, 1.0 / MAX_FACTOR_RATIO, MAX_FACTOR_RATIO, MAX_FACTOR_RATIO**2)
    left = p.lefts([{name: times / factor} for times in around])
    return bool(left[0] <= 1.5 * left[1:].min())


__all__ = ["MAX_FACTOR_RATIO", "Reading", "by_parameters", "gear", "gears", "pairs", "signs", "units"]
