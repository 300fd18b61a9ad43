"""What validation data show of a named effect: the force that is missing without it, over the coordinate that
matters.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from signlin_ros.comparison.bands import MIN_BIN_SAMPLES, Band, band, memory
from signlin_ros.comparison.waves import FULL_TURN, Spectrum, Wave, folded, spectrum, waves_of
from signlin_ros.diagnosis.blocks import MIN_DIVISOR
from signlin_ros.diagnosis.equation_error.estimate import EquationErrorResult
from signlin_ros.diagnosis.evidence import Evidence, changes_effort
from signlin_ros.diagnosis.output_error import FittedModel
from signlin_ros.diagnosis.results import ParameterEstimate
from signlin_ros.diagnosis.wording.verdicts import own_parameters
from signlin_ros.effects import find_effect
from signlin_ros.recording.trace import resolve_unit

Array = NDArray[np.float64]

MIN_SHOWN_SAMPLES = 20
"""Samples below which nothing is shown of a direction of motion."""
MIN_WAVE_SAMPLES = 3 * MIN_SHOWN_SAMPLES
"""Fewest samples below the cut-off frequency that show a wave by themselves."""
MAX_WAVE_CUTOFF = 0.8
"""A wave passes the low-pass of the forces up to this part of its cut-off."""
ALIKE_VARIANCE = 0.02
"""Parts of a variance that differ by less are alike: then a force is shown over velocity."""
COORDINATE_BINS = 30
"""Bins by which is told over which coordinate a force is a curve."""


@dataclass(frozen=True, eq=False)
class Place:
    """A coordinate: x (N,), and the direction of motion ``side`` (N,); ``single``: shown over time, as it is.

    ``kept`` (M,): which of M samples these are; None: all.
    """

    name: str
    unit: str
    x: Array
    side: Array
    single: bool
    dense: bool
    kept: NDArray[np.bool_] | None = None

    @property
    def label(self) -> str:
        """Name and unit."""
        return f"{self.name} [{self.unit}]"


@dataclass(frozen=True, eq=False)
class Explanation:
    """What is missing without an effect, ``measured`` (N,), and what the effect makes of it, ``computed`` (N,).

    All other parameters are those of the fit with ``effects``; an empty ``effect`` is none at all. ``found`` and
    ``curve`` are the means of both over the coordinate, one for each direction of motion that is told apart.
    ``parameters`` of the effect in that fit.
    """

    effect: str
    effects: tuple[str, ...]
    measured: Array
    computed: Array
    found: tuple[Band, ...]
    curve: tuple[Band, ...]
    parameters: Mapping[str, ParameterEstimate]


@dataclass(frozen=True, eq=False)
class EffectEvidence:
    """The evidence for one effect, beside its nearest rival on the same data.

    ``quantity`` and ``unit`` of what is lacking; ``place``: the coordinate; ``cutoff`` of the low-pass in Hz;
    ``sources`` of the data; of a force that repeats its ``waves``, the strongest first, and its ``spectrum``.
    """

    quantity: str
    unit: str
    place: Place
    cutoff: float
    sources: tuple[str, ...]
    named: Explanation
    rival: Explanation | None
    waves: tuple[Wave, ...] = ()
    spectrum: Spectrum | None = None


def effect_evidence(evidence: Evidence, fitted: FittedModel, effect: str) -> EffectEvidence | None:
    """Return the evidence for an effect of a fitted model; None where no force shows it."""
    force = evidence.equation_error
    if force is None or changes_effort(find_effect(effect, "effects")):
        return None
    measured, computed = _lacking(force, fitted, effect)
    waves = waves_of(fitted.model, effect)
    place = _place(evidence, force, computed, waves)
    named = _explanation(fitted, effect, place, measured, computed)
    if named is None:
        return None
    plant = evidence.dataset.plant
    unit = evidence.dataset.training.shown(resolve_unit("F", plant))
    sources = tuple(dict.fromkeys(s.source for s in evidence.dataset.validation.segments))
    cutoff = force.validation.pieces[0].cutoff
    quantity = "missing torque" if unit == "N·m" else "missing force"
    rows = None
    if place.kept is not None and _turns(evidence):
        rows = spectrum(_at(force, plant.position)[place.kept], named.measured, named.measured - named.computed, waves)
    return EffectEvidence(
        quantity,
        unit,
        place,
        cutoff,
        sources,
        named,
        _rival(evidence, force, fitted, effect, place),
        tuple(waves),
        rows,
    )


def _lacking(force: EquationErrorResult, fitted: FittedModel, effect: str) -> tuple[Array, Array]:
    """Return the force (N,) that is missing without an effect, and what the effect makes of it, on validation data."""
    model = fitted.model
    less = model.without_effect(*(key for key in model.keys_of(effect) if key not in force.given.effects))
    without, with_it = (force.validation.force_residual(m) for m in (less, fitted.model))
    return without, without - with_it


def _at(force: EquationErrorResult, name: str) -> Array:
    """Return a coordinate (N,) where forces are told, on validation data."""
    return np.concatenate([p.values[name][p.kept] for p in force.validation.pieces])


def _passing(velocity: Array, wave: Wave, cutoff: float) -> NDArray[np.bool_]:
    """Return at which velocities (N,) a wave passes the low-pass of the forces; all where it hardly does anywhere."""
    slow = np.abs(velocity) * wave.order < MAX_WAVE_CUTOFF * FULL_TURN * cutoff
    return slow if np.count_nonzero(slow) >= MIN_WAVE_SAMPLES else np.ones(velocity.size, dtype=np.bool_)


def _turns(evidence: Evidence) -> bool:
    """Tell whether the axis turns: then waves have whole orders."""
    return evidence.dataset.training.shown(resolve_unit("Q", evidence.dataset.plant)) == "rad"


def _place(evidence: Evidence, force: EquationErrorResult, computed: Array, waves: Sequence[Wave]) -> Place:
    """Return the coordinate over which a force is most nearly a curve, for each direction of motion; of one that
    repeats the position within a period of its strongest wave, if the records hold one, or within a turn.
    """
    plant, parts = evidence.dataset.plant, force.validation.pieces
    velocity, position = _at(force, plant.velocity), _at(force, plant.position)
    if waves and waves[0].order * np.ptp(position) >= FULL_TURN:
        kept = _passing(velocity, waves[0], parts[0].cutoff)
        x, turns = folded(position[kept], waves[0].order), _turns(evidence)
        name = (
            f"{plant.position} within 1/{waves[0].order:.4g} of a turn"
            if turns
            else f"{plant.position} within a period"
        )
        return Place(name, "rad" if turns else "m", x, np.zeros(x.size), False, False, kept)
    side = np.sign(velocity)
    shares = {n: _unexplained(x, side, computed) for n, x in ((plant.velocity, velocity), (plant.position, position))}
    best = plant.velocity if shares[plant.velocity] <= shares[plant.position] + ALIKE_VARIANCE else plant.position
    within = folded(position, 1.0)
    if shares[best] > 0.5 and _turns(evidence) and _unexplained(within, side, computed) <= 0.5:
        return Place(f"{plant.position} within a turn", "rad", within, side, False, False)
    if shares[best] > 0.5:
        ends = np.cumsum([0.0, *(float(p.t[-1]) for p in parts)])
        t = np.concatenate([p.t[p.kept] + end for p, end in zip(parts, ends, strict=False)])
        return Place("time", "s", t, np.zeros(t.size), True, False)
    x = velocity if best == plant.velocity else position
    quantity, problem = "Q/s" if best == plant.velocity else "Q", evidence.dataset.training
    unit = problem.shown(problem.units.get(best) or resolve_unit(quantity, plant))
    return Place(best, unit, x, side, False, best == plant.velocity)


def _unexplained(x: Array, side: Array, values: Array) -> float:
    """Return the part of the variance of values (N,) that is no curve over x (N,), for each direction of motion."""
    edges = np.quantile(x, np.linspace(0, 1, COORDINATE_BINS + 1)[1:-1])
    index = np.searchsorted(edges, x) + COORDINATE_BINS * (side > 0)
    count = np.bincount(index, minlength=2 * COORDINATE_BINS)
    mean = np.bincount(index, values, 2 * COORDINATE_BINS) / np.maximum(count, 1)
    return float(np.var(values - mean[index]) / max(float(np.var(values)), MIN_DIVISOR))


def _rival(
    evidence: Evidence, force: EquationErrorResult, fitted: FittedModel, effect: str, place: Place
) -> Explanation | None:
    """Return the explanation of the best other effect in place of one; where there is none, what is left without it."""
    rest = set(fitted.effects) - {effect}
    options = [
        one
        for one in evidence.cache.weighed
        if rest < set(one.effects) and len({*one.effects} - rest) == 1 and effect not in one.effects
    ]
    best = min(options, key=lambda one: one.log_mse, default=None) or _by_force(evidence, force, rest, effect)
    if best is None:
        return None
    (other,) = set(best.effects) - rest
    if changes_effort(find_effect(other, "effects")):
        return None
    return _explanation(best, other, place, *_lacking(force, best, other))


def _by_force(evidence: Evidence, force: EquationErrorResult, rest: set[str], effect: str) -> FittedModel | None:
    """Return the best other effect in place of one as the equation-error estimate fitted it, if none was worth a
    simulation.
    """
    known = (*force.sets.values(), *force.replacements.get(effect, ()))
    sets = [m for m in known if rest < m.names and len(m.names) == len(rest) + 1]
    for m in sorted((m for m in sets if effect not in m.names), key=lambda m: m.validation_mse):
        found = evidence.output_error.at_values_of([n for n, _ in m.members], force.with_laws(m))
        if found is not None and np.mean(force.mse_as_written(found.model)) < force.base.validation_mse:
            return found  # as it is written: a stiff law may be no more than its column
    return None


def _explanation(
    fitted: FittedModel, effect: str, place: Place, measured: Array, computed: Array
) -> Explanation | None:
    """Return the force residual without an effect (N,) and the effect's own force (N,); None for too few samples."""
    if place.kept is not None:
        measured, computed = measured[place.kept], computed[place.kept]
    sides = [place.side == s for s in np.unique(place.side) if np.count_nonzero(place.side == s) >= MIN_SHOWN_SAMPLES]
    if not sides:
        return None
    block = max(memory(measured - computed), 2)
    found, curve = (_bands(place, values, sides, block) for values in (measured, computed))
    own = own_parameters(fitted, effect)
    return Explanation(effect, fitted.effects, measured, computed, found, curve, own)


def _bands(place: Place, values: Array, sides: Sequence[NDArray[np.bool_]], block: int) -> tuple[Band, ...]:
    few = [min(COORDINATE_BINS, max(2, int(np.count_nonzero(s)) // (2 * MIN_BIN_SAMPLES))) for s in sides]
    rows = zip(sides, few, strict=True)
    return tuple(band(place.x[s], values[s], block, bins, place.dense) for s, bins in rows)


__all__ = ["EffectEvidence", "Explanation", "Place", "effect_evidence"]
