"""A channel whose unit or sign does not fit the model as it is given."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from signlin_ros.checks.base import Check, values_of, with_channel
from signlin_ros.checks.factors import TOGETHER, other_units, word
from signlin_ros.checks.finding import Finding
from signlin_ros.checks.look import Look
from signlin_ros.checks.observer import ONE, Prediction
from signlin_ros.checks.travel import EQUAL
from signlin_ros.records import ModelData

BETTER = 0.4
"""What is left with another unit or sign, as a share of what is left without (geometric mean over the channels)."""
GOOD = 0.35
"""What is left, as a share of what the channels do, where the model follows the record."""
EACH = 0.7
"""And what is left of each channel at most."""
AS_GOOD = 1.25
"""Explanations that leave no more than so many times the least are told beside it."""
NEAR = 1.35
"""A unit is meant where the factor that suits best is no more than this away from it."""
GEAR = 3.0
"""Smaller factors are a matter of the model's parameters."""


@dataclass(frozen=True)
class Reading:
    """One way to read a record: what some of its signals are divided by; in words; and the name of the cure."""

    divided: Mapping[str, float]
    words: str
    cure: str

    @property
    def scales(self) -> dict[str, float]:
        """What the signals are multiplied by."""
        return {name: 1.0 / factor for name, factor in self.divided.items()}

    @property
    def only_sign(self) -> bool:
        """Whether nothing but signs differ."""
        return all(factor == -1.0 for factor in self.divided.values())


class UnitOrSign(Check):
    """The model follows the record much better if a channel is in another unit, or reversed.

    Test: a constant observer of the linear base leaves at most `BETTER` of what it leaves otherwise, and at most
    `GOOD` of what the channels do; the factor that suits best lies within `NEAR` of the unit's. What a model lacks, or
    has wrong by tens of per cent, does not move its prediction that far: none of 200 clean records and none of those
    with hidden effects of the benchmark (benchmarks/checks.py) reads better so. Cure: the conversion
    (``speed_in_rpm``), the other sign (``reverse_voltage``), or a factor where no unit is known (``scale_speed``).
    """

    name = "unit_or_sign"
    needs_time = True

    def find(self, look: Look) -> Iterator[Finding]:
        """Yield the best reading of the record, and others that are as good."""
        p = look.predicted
        if p is None:
            return
        before = p.left()
        limit = min(BETTER * before, GOOD)
        fits = _fitting(look, p, limit, (*_signs(look, p), *_units(look, p))) or _fitting(
            look, p, limit, _gears(look, p)
        )
        if not fits:
            return
        best = min(left for left, _ in fits)
        likely = sorted((item for item in fits if item[0] <= AS_GOOD * best), key=lambda item: _rank(look, item[1]))
        for number, (_, reading) in enumerate(likely[:3]):
            yield self._finding(look, reading, likely[0][1] if number else None)

    def _finding(self, look: Look, r: Reading, first: Reading | None) -> Finding:
        names = tuple(r.divided)
        gear, sign = r.cure.startswith("scale_"), r.only_sign
        doubt = f" (as well as: {first.words})" if first else ""
        severity = "offer" if gear or sign or first else "refuse"
        return Finding(
            self.name,
            ", ".join(names),
            severity,
            f"{r.words}{doubt}" + ("" if sign else "; as it is, it fits no model"),
            cure=r.cure,
            remedy="it is taken so",
            action=divided(r.divided),
        )


def divided(factors: Mapping[str, float]) -> Callable[[ModelData], ModelData]:
    """Return the cure that divides inputs and channels by factors."""

    def cure(record: ModelData) -> ModelData:
        for name, factor in factors.items():
            record = with_channel(record, name, values_of(record, name) / factor)
        return record

    return cure


def _fitting(look: Look, p: Prediction, limit: float, readings: Iterable[Reading]) -> list[tuple[float, Reading]]:
    """Return the readings with which less than the limit is left, and what is; such as position and velocity allow."""
    possible = [r for r in readings if _consistent(look, r.divided)]
    left = p.lefts([r.scales for r in possible]) if possible else ()
    good = [(float(value), r) for value, r in zip(left, possible, strict=True) if value < limit]
    return [(value, r) for value, r in good if p.shares(r.scales).max() < EACH]


def _consistent(look: Look, factors: Mapping[str, float]) -> bool:
    """Tell whether position and velocity, where they tell of each other, agree when divided by factors."""
    travel = look.travel
    if travel is None or not travel.known:
        return True
    return abs(travel.factor * factors.get(look.position, 1.0) / factors.get(look.velocity, 1.0) - 1.0) < EQUAL


def _rank(look: Look, r: Reading) -> tuple[int, int, bool]:
    """Signs go before units, one signal before two, an input's sign before a channel's."""
    first = next(iter(r.divided))
    return (0 if r.only_sign else 1, len(r.divided), first not in look.record.inputs)


def _signs(look: Look, p: Prediction) -> Iterator[Reading]:
    for name in p.sources:
        if name != ONE:
            words = f"with the sign of the {name} reversed the model follows the record"
            yield Reading({name: -1.0}, words, f"reverse_{name}")
    q, v = look.position, look.velocity
    if {q, v} <= set(p.sources):
        words = f"with the signs of {q} and {v} reversed the model follows the record"
        yield Reading({q: -1.0, v: -1.0}, words, f"reverse_{q}_and_{v}")


def _units(look: Look, p: Prediction) -> Iterator[Reading]:
    """Yield the units that one signal, or position and velocity together, may be in."""
    for name in p.sources:
        if name == ONE:
            continue
        for unit, factor in other_units(look.unit(name)).items():
            for sign in (1.0, -1.0):
                if _suits(p, {name: sign * factor}):
                    turned = " and reversed" if sign < 0 else ""
                    cure = f"{name}_in_{word(unit)}" + ("_reversed" if sign < 0 else "")
                    yield Reading({name: sign * factor}, f"the {name} fits if it is in {unit}{turned}", cure)
    q, v = look.position, look.velocity
    for of_model, one, other in TOGETHER if {q, v} <= set(p.sources) else ():
        if of_model in (look.unit(q), {"m": "rad"}.get(look.unit(q))):
            factors = {q: other_units(look.unit(q))[one], v: other_units(look.unit(v))[other]}
            words = f"{q} and {v} fit if they are in {one} and {other}"
            yield Reading(factors, words, f"{q}_in_{word(one)}_{v}_in_{word(other)}")


def _gears(look: Look, p: Prediction) -> Iterator[Reading]:
    """Yield single signals that fit by a factor that is no unit's."""
    for name in p.sources:
        if name == ONE:
            continue
        factor = _best(p, name)
        if GEAR < abs(factor) < 1e5 or GEAR < 1.0 / max(abs(factor), 1e-12) < 1e5:
            by = f"divided by {factor:.3g}" if abs(factor) > 1.0 else f"multiplied by {1.0 / factor:.3g}"
            words = f"the {name} fits if it is {by}: a gear, a unit, or a wrong scale"
            if name in look.record.inputs and look.model.plant.scaled_by_effort:
                words += f" (or {', '.join(look.model.plant.scaled_by_effort)} of the model are all wrong by that)"
            yield Reading({name: factor}, words, f"scale_{name}")


def _best(p: Prediction, name: str) -> float:
    """Return by what a signal is to be divided so that the least is left of all channels."""
    grid = [sign * 10.0**k for sign in (1.0, -1.0) for k in [i / 20 for i in range(-90, 91)]]
    best = int(np.argmin(p.lefts([{name: 1.0 / factor} for factor in grid])))
    return float(grid[best])


def _suits(p: Prediction, factors: Mapping[str, float]) -> bool:
    """Tell whether other factors near those of a unit suit no better, by much, than the unit's."""
    ((name, factor),) = factors.items()
    around = (1.0, 1.0 / NEAR**2, 1.0 / NEAR, NEAR, NEAR**2)
    left = p.lefts([{name: times / factor} for times in around])
    return bool(left[0] <= 1.5 * left[1:].min())
