"""A channel whose unit or sign does not fit the model as it is given."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from signlin_ros.checks.base import OfColumns, values_of, with_channel
from signlin_ros.checks.effort_scale import effort_scale
from signlin_ros.checks.finding import Finding
from signlin_ros.checks.look import Look
from signlin_ros.checks.observer import LinearPrediction, Together
from signlin_ros.checks.readings import MAX_FACTOR_RATIO, Reading, by_parameters, gear, gears, pairs, signs, units
from signlin_ros.checks.travel import EQUAL, FACTOR_TOLERANCE
from signlin_ros.checks.work import reversed_by_work
from signlin_ros.errors import joined
from signlin_ros.model import Model
from signlin_ros.records import ModelData
from signlin_ros.records.notes import as_notes

MAX_ERROR_RATIO = 0.4
"""What is left with another unit or sign, as a share of what is left without (geometric mean over the channels)."""
MAX_GOOD_RESIDUAL = 0.35
"""What is left, as a share of what the channels do, where the model follows the record."""
EACH = 0.7
"""And what is left of each channel at most."""
MAX_EQUAL_RATIO = 1.25
"""Explanations that leave no more than so many times the least are told beside it."""
STRICTER = 0.5
"""What may be left, as a share of the limit, where two signals are read otherwise, or one by any factor: among so many
readings one is better by chance, or for what the model lacks."""
MAX_NEEDED_RATIO = 0.7
"""What is left, as a share of what is left without any input: what no input moves tells of no unit."""
GUESS = 0.5
"""A tolerance of the model's parameters from which on they are guesses: then a factor, or two units, are no reason to
refuse."""
MAX_GUESS = math.log(10.0)
"""Logarithm of the factor by which nobody guesses wrong."""
MAX_FRICTION_RATIO = 50.0
"""Times all that the model knows of that dry friction may be: of a drive that needs more, nobody would model the rest.
"""
FACTOR_TOLD = 0.05
"""Part by which a unit misses the factor that forces tell, from which on both are told."""
TOLERANCE_PARTS = (-1.0, -0.5, 0.5, 1.0)
"""Of its tolerance, by which a guess may be off."""


class UnitOrSign(OfColumns):
    """The model follows the record much better if a channel is in another unit, or reversed.

    Test: a constant observer of the linear base, beside dry friction, a load and gravity of any size, and from any
    start, leaves at most `MAX_ERROR_RATIO` of what it leaves otherwise, and at most `MAX_GOOD_RESIDUAL` of what the
    channels do, or `STRICTER` of either with a factor that is no unit's; the factor that suits best lies within
    `MAX_FACTOR_RATIO` of the unit's. What a model lacks, or has wrong by tens of per cent, does not move its
    prediction that far: none of 200 clean records and none of those with hidden effects of the benchmark
    (benchmarks/checks.py) reads better so. Cure: the conversion (``speed_in_rpm``; offered only where the motion
    hardly needs its input, as it may be noise that leaves more than none does), the other sign (``reverse_voltage``),
    or a factor where no unit is known (``scale_speed``).
    """

    name = "unit_or_sign"
    needs_time = True
    needs_input = True
    exclusive = True

    def find(self, look: Look) -> Iterator[Finding]:
        """Yield the best reading of the record, and others that are as good."""
        yield from self._read([look])

    def find_each(self, looks: Sequence[Look]) -> list[list[Finding]]:
        """Return the best reading of all records with the same columns; where there is none, that of each."""
        known = [look for look in looks if look.resisted is not None]
        whole = list(self._read(known)) if len(known) > 1 else []
        return [list(whole) for _ in looks] if whole else super().find_each(looks)

    def contradicts(self, look: Look, f: Finding) -> bool:
        """Tell whether a record fits as it is, and far worse as another one asks for."""
        own, other = look.resisted, Look(look.model, f.action(look.record)).resisted if f.action else None
        if own is None or other is None:
            return False
        return own.left() < min(MAX_ERROR_RATIO * other.left(), MAX_GOOD_RESIDUAL)

    def _read(self, looks: Sequence[Look]) -> Iterator[Finding]:
        parts = [p for p in (look.resisted for look in looks) if p is not None]
        if not parts:
            return
        p = parts[0] if len(parts) == 1 else Together.of(parts)
        look = looks[0]
        before = p.left()
        limit = min(MAX_ERROR_RATIO * before, MAX_GOOD_RESIDUAL)
        fits = _fitting(looks, p, limit, (*signs(look, p), *units(look, p)))
        strict = STRICTER * limit
        two = [reading for reading in pairs(look, p) if not _stated(look) & reading.divided.keys()]
        if not fits:  # two units that fit, and one factor that does as well: only a ratio is known
            fits = [*_fitting(looks, p, strict, two), *_fitting(looks, p, strict, gears(look, p))]
            least = min((left for left, _ in fits), default=np.inf)
            fits = (
                fits if by_parameters(look, p) > MAX_EQUAL_RATIO * least else []
            )  # as if the model's were off a little
        fits = _by_force(looks, p, fits)
        best = min((left for left, _ in fits), default=np.inf)
        if not fits or best >= MAX_ERROR_RATIO * _guesses_moved(looks, before):
            yield from self._by_work(looks)
            return
        likely = sorted(
            (item for item in fits if item[0] <= MAX_EQUAL_RATIO * best), key=lambda item: _rank(look, item[1])
        )
        likely = [item for item in likely if not _stated(look) & item[1].divided.keys()] or likely
        needed = best < MAX_ERROR_RATIO * p.left(
            dict.fromkeys(look.record.inputs, 0.0)
        )  # a noisy input leaves more than none
        for number, (_, reading) in enumerate(likely[:3]):
            yield self._finding(look, reading, likely[0][1] if number else None, needed)

    def _by_work(self, looks: Sequence[Look]) -> Iterator[Finding]:
        """Yield what is reversed by its work, whatever the parameters of the model are."""
        name = reversed_by_work(looks)
        if name is None:
            return
        words = (
            f"from standstill to standstill, and about where it began, the drive gives back what the {name} puts in: "
            f"with the sign of the {name} reversed it takes it, as friction does"
        )
        yield Finding(
            self.name,
            name,
            "offer",
            words,
            cure=f"reverse_{name}",
            remedy="it is taken so",
            columns=True,
            action=divided({name: -1.0}),
        )

    def _finding(self, look: Look, r: Reading, first: Reading | None, needed: bool) -> Finding:
        names = tuple(r.divided)
        sign = r.only_sign
        doubt = f" (as well as: {first.words})" if first else ""
        said = _stated(look) & {*names}
        motions = [name for name in look.channels if name in (look.position, look.velocity)]
        force = names == tuple(look.record.inputs[:1]) and bool(look.model.plant.scaled_by_effort)
        if force and not sign and motions and {*motions} <= _stated(look):
            other = joined([f"the {name} ({look.record.labels.get(name, name)!r})" for name in motions])
            doubt += f", or if {other} is not in the unit that its column states: a factor of both is the same"
        doubtful = not needed or said or _may_be_guess(look, r)  # whoever names a unit knows it
        severity = "offer" if sign or doubtful else "refuse"
        return Finding(
            self.name,
            ", ".join(names),
            severity,
            f"{r.words}{doubt}" + ("" if severity == "offer" else "; as it is, it fits no model"),
            cure=r.cure,
            remedy="it is taken so",
            columns=True,
            action=divided(r.divided),
        )


def _stated(look: Look) -> set[str]:
    """Return the signals whose unit the record states."""
    return {note.channel for note in as_notes(look.record.notes) if note.kind == "converted"}


def _may_be_guess(look: Look, r: Reading) -> bool:
    """Tell whether a reading may as well be parameters that are guesses: one signal not by more than `MAX_GUESS`; of
    two only the ratio may count.
    """
    logs = [math.log(abs(factor)) for factor in r.divided.values() if factor != -1.0]
    return r.far_fetched and _guessed(look.model) and (len(logs) > 1 or abs(logs[0]) < MAX_GUESS)


def _guessed(model: Model) -> bool:
    """Tell whether the parameters of a model are guesses, by its own tolerance."""
    tolerance = model.tolerance
    return max(tolerance.values(), default=0.0) >= GUESS if isinstance(tolerance, dict) else tolerance >= GUESS


def _by_force(
    looks: Sequence[Look], p: LinearPrediction | Together, fits: list[tuple[float, Reading]]
) -> list[tuple[float, Reading]]:
    """Return readings without units of an effort that its forces contradict: with the factor that these tell. Where
    dry friction and a load explain the effort as well as another unit would, their unknown size tells nothing of its
    own, nor of a factor of the motion, which says the same: without either. Those nearest to that factor stand first.
    """
    name = next(iter(looks[0].record.inputs), "")
    found = effort_scale(looks) if any(not r.only_sign for _, r in fits) else None
    if found is None:
        return fits
    scale = found.factor
    if scale is None:
        unknown = found.resisted < MAX_ERROR_RATIO
        return [(left, r) for left, r in fits if r.only_sign or not (unknown and _may_be_friction(_times(r, looks[0])))]
    of_effort = [one for one in fits if tuple(one[1].divided) == (name,) and not one[1].only_sign]
    alone = len({looks[0].position, looks[0].velocity} & {*p.channels}) == 1  # its factor is one over the effort's
    other = [one for one in fits if one[1].far_fetched and (alone or len(one[1].divided) > 1)]
    kept = [one for one in fits if one not in (*of_effort, *other) or _near(_times(one[1], looks[0]), scale)]
    kept.sort(key=lambda one: abs(math.log(abs(_times(one[1], looks[0]) / scale))))
    if not of_effort or (kept and not all(r.far_fetched for _, r in kept)):
        return [(left, _beside(r, name, scale) if (left, r) in of_effort else r) for left, r in kept]
    return [*(one for one in kept if one not in of_effort), (p.left({name: 1.0 / scale}), gear(looks[0], name, scale))]


def _beside(r: Reading, effort: str, scale: float) -> Reading:
    """Return a reading of an effort in another unit, with what its forces say where that is not quite the same."""
    unit = r.divided[effort]
    if abs(scale / unit - 1.0) < FACTOR_TOLD:
        return r
    told = f"{r.words} (multiplied by {1.0 / unit:.3g}; by what moves the inertia, by {1.0 / scale:.3g})"
    return replace(r, words=told)


def _times(r: Reading, look: Look) -> float:
    """Return by what a reading makes the effort smaller beside the motion, of which it may make two signals larger."""
    motions = [r.divided[name] for name in dict.fromkeys((look.position, look.velocity)) if name in r.divided]
    size = math.prod(map(abs, motions)) ** (1.0 / max(len(motions), 1))
    effort = r.divided.get(look.record.inputs[0], 1.0)
    return effort / math.copysign(size, motions[0] if motions else 1.0)


def _may_be_friction(times: float) -> bool:
    """Tell whether dry friction may be so many times the model's own forces."""
    return 1.0 / MAX_FRICTION_RATIO < abs(times) < MAX_FRICTION_RATIO


def _near(factor: float, scale: float) -> bool:
    return 1.0 / MAX_FACTOR_RATIO < factor / scale < MAX_FACTOR_RATIO


def _guesses_moved(looks: Sequence[Look], left: float) -> float:
    """Return the least that is left where parameters that are guesses are off by their tolerance or a part of it, each
    in turn for the best of the others.
    """
    nominal = looks[0].model
    guesses = [n for n, value in nominal.parameters.items() if value and nominal.tolerance_of(n) >= GUESS]
    best = {n: nominal.parameters[n] for n in guesses}
    for name in guesses * min(len(guesses), 2):
        for part in TOLERANCE_PARTS:
            moved = {**best, name: nominal.parameters[name] * math.exp(part * nominal.tolerance_of(name))}
            model = nominal.with_parameters(moved)
            found = [p for p in (Look(model, look.record).resisted for look in looks) if p is not None]
            other = Together.of(found).left() if found else left
            best, left = (moved, other) if other < left else (best, left)
    return left


def divided(factors: Mapping[str, float]) -> Callable[[ModelData], ModelData]:
    """Return the cure that divides inputs and channels by factors."""

    def cure(record: ModelData) -> ModelData:
        for name, factor in factors.items():
            record = with_channel(record, name, values_of(record, name) / factor)
        return record

    return cure


def _fitting(
    looks: Sequence[Look], p: LinearPrediction | Together, limit: float, readings: Iterable[Reading]
) -> list[tuple[float, Reading]]:
    """Return the readings with which less than the limit is left, and what is; such as position and velocity allow."""
    look = looks[0]
    possible = [r for r in readings if all(_consistent(one, r.divided) for one in looks)]
    left = p.lefts([r.scales for r in possible]) if possible else ()
    good = [(float(value), r) for value, r in zip(left, possible, strict=True) if value < limit]
    return [(value, r) for value, r in good if p.shares(r.scales).max() < EACH and driven(look, p, value, r.scales)]


def driven(look: Look, p: LinearPrediction | Together, left: float, scales: Mapping[str, float] | None = None) -> bool:
    """Tell whether what is left (of signals times scales) needs the inputs at all: without them more would be left."""
    return left < MAX_NEEDED_RATIO * p.left({**(scales or {}), **dict.fromkeys(look.record.inputs, 0.0)})


def _consistent(look: Look, factors: Mapping[str, float]) -> bool:
    """Tell whether position and velocity, where they tell of each other, agree when divided by factors, as well as the
    factor between them is known if that is changed; and whether the position in a loop comes no further away from its
    goal, whose size it has.
    """
    if look.model.plant.closed_loop and not _nearer(look, factors):
        return False
    travel = look.travel
    if travel is None or not travel.known:
        return True
    between = factors.get(look.position, 1.0) / factors.get(look.velocity, 1.0)
    off = abs(travel.factor * between - 1.0)
    if abs(between) == 1.0:
        return off < EQUAL
    return off < max(FACTOR_TOLERANCE, 1.0 - travel.correlation)  # what two regressions tell apart at most


def _nearer(look: Look, factors: Mapping[str, float]) -> bool:
    """Tell whether a position divided by factors is about as large as its goal is then, or comes nearer to that."""
    goal, position = look.model.inputs[0], look.position
    sizes = [float(np.nanstd(values_of(look.record, name))) for name in (position, goal)]
    if min(sizes) <= 0.0:
        return True
    apart = math.log(sizes[0] / sizes[1])
    read = apart - math.log(abs(factors.get(position, 1.0) / factors.get(goal, 1.0)))
    return abs(read) <= abs(apart)


def _rank(look: Look, r: Reading) -> tuple[int, int, bool]:
    """Signs go before units, one signal before two, an input's sign before a channel's."""
    first = next(iter(r.divided))
    return (0 if r.only_sign else 1, len(r.divided), first not in look.record.inputs)
