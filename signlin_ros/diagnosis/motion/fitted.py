"""A fitted model as the judge sees it: parameters with honest standard errors, errors on seen and unseen data."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from signlin_ros.diagnosis.criteria import Criteria
from signlin_ros.diagnosis.motion.left import Left
from signlin_ros.diagnosis.motion.score import level
from signlin_ros.diagnosis.motion.trials import sensors_of
from signlin_ros.diagnosis.results import Estimate
from signlin_ros.effects import EFFECTS
from signlin_ros.effects.base import Effect
from signlin_ros.fitting.candidate import Coordinate
from signlin_ros.fitting.fit import Fit, tidied
from signlin_ros.fitting.following import follow_records
from signlin_ros.fitting.problem import Problem
from signlin_ros.model import Model
from signlin_ros.recording.trace import resolve_unit

Array = NDArray[np.float64]

BLOCKS, BLOCK = 40, 0.25
"""Blocks that a standard error is taken from, and how long each is at least in s."""
EDGE = 1e-6
"""How near a coordinate is to a bound that it is at, in standard units."""
ODD, UNTOLD = 3.0, 0.95
"""Tolerances from nominal that are told beside a parameter; part of its tolerance above which its standard error says
that the record did not show it."""


@dataclass(frozen=True, eq=False)
class Fitted:
    """A model fitted to the known records.

    ``effects``: names added to the model as given; ``model``: the whole of it; ``parameters`` by name (``c``,
    ``coulomb_friction.mu``, ``sensor_offset.speed``). ``known_squares``, ``unseen_squares`` (blocks, channels): mean
    squared errors of windows of the horizon, in blocks that are the same for all models, NaN where nothing is measured.
    ``look`` finds what the residual still shows (`left`). ``at_bound``: parameters that ended there.
    ``covariances`` of the coordinates of ``fit`` (n, n): robust, and as of white noise; ``spreads``: their standard
    errors, the larger of both. ``apart`` finds by how many standard errors some coordinates differ from nothing by the
    likelihood.
    """

    effects: tuple[str, ...]
    model: Model
    parameters: dict[str, Estimate]
    known_squares: Array
    unseen_squares: Array
    look: Callable[[], tuple[Left, ...]] = field(repr=False)
    at_bound: tuple[str, ...]
    noise: Array
    fit: Fit = field(repr=False)
    covariances: tuple[Array, ...] = field(repr=False)
    apart: Callable[[tuple[int, ...]], float] = field(default=lambda index: 0.0, repr=False)

    @property
    def spreads(self) -> Array:
        """Standard errors (n,) of the coordinates of the fit."""
        return largest(self.covariances)

    @cached_property
    def left(self) -> tuple[Left, ...]:
        """What the residual still shows, by channel."""
        return self.look()

    @property
    def kind(self) -> tuple[str, ...]:
        """What tells one set of effects from another: their keys, sensors with their channels."""
        return tuple(sorted(self.fit.candidate.label))

    @property
    def white(self) -> bool:
        """Whether nothing is left but the noise of the sensors."""
        return not any(one.structured for one in self.left)

    @property
    def clean(self) -> bool:
        """Whether nothing is left but noise, and samples are enough to tell: what cannot be tested is no proof."""
        return self.white and not any(np.isnan(one.dependent) for one in self.left)

    @property
    def level(self) -> float:
        """Sum over channels of the logarithms of the mean squared error on unseen data, less being better."""
        return level(self.unseen_squares, self.noise)

    def _coordinates(self, added: bool) -> list[tuple[Coordinate, float, float]]:
        """Return the coordinates of what was added, or of the model as given, with values and standard errors."""
        keys, f = self.fit.candidate.label, self.fit
        every = zip(f.candidate.coordinates, f.theta.tolist(), self.spreads.tolist(), strict=True)
        return [one for one in every if (one[0].name in keys or one[0].name.partition(".")[0] in keys) == added]

    @property
    def size(self) -> int:
        """Number of parameters beyond those of the model as given, with the whole orders that were chosen for waves."""
        own = [k.name for k, _, _ in self._coordinates(True)]
        added = [k for k in self.fit.candidate.label if k in self.model.effects]
        orders = [f"{k}.{n}" for k in added for n in self._effect(k).periodic[:1]]
        return len({*own, *orders})

    @cached_property
    def strain(self) -> float:
        """Squared distance of the parameters of the model as given from their values there, in tolerances."""
        return float(sum(((x - k.prior) / k.spread) ** 2 for k, x, _ in self._coordinates(False)))

    @property
    def off(self) -> dict[str, float]:
        """By how many tolerances every base parameter is off its nominal value."""
        pairs = zip(self.fit.candidate.coordinates, self.fit.theta.tolist(), strict=True)
        return {k.name: _off(k, x) / k.spread for k, x in pairs if k.spread < np.inf and "." not in k.name}

    def far(self, criteria: Criteria) -> dict[str, float]:
        """Return the base parameters that are far from nominal, and by how many tolerances."""
        return {n: x for n, x in self.off.items() if abs(x) > criteria.far}

    @property
    def unreal(self) -> list[str]:
        """The effects that were added whose values are those of something that their equation imitates."""
        uses = {k: self.model.effects[k] for k in self.fit.candidate.label if k in self.model.effects}
        return [k for k, use in uses.items() if not EFFECTS[use.type].plausible(use.parameters)]

    def vague(self, criteria: Criteria) -> str:
        """Return why what was added cannot be named: a coefficient that is nothing, at a bound or hardly known."""
        return next((why for key in self.fit.candidate.label if (why := self._vague(key, criteria))), "")

    def _vague(self, key: str, criteria: Criteria) -> str:
        effect = self._effect(key)
        if key in self.unreal:
            return f"the values of {key} are not those of a real one"
        told = (*effect.telling, *effect.essential)
        sizes: dict[str, float] = {}
        own = self._of(key, effect)
        moving = {i: one for i, one in own.items() if np.isfinite(one[2]) or one[0].name.rpartition(".")[2] in told}
        if own and not moving:
            return f"nothing is known of {key}"
        at: dict[str, int] = {}
        for i, (k, x, std) in moving.items():
            name = k.name.rpartition(".")[2]
            if k.name in self.at_bound and name in told:
                return f"{k.name} is at its bound"
            if not k.log or name in effect.neutral or k.name.startswith("sensor_gain"):
                sizes[name], at[name] = abs(x - k.nothing(effect)) / max(std, 1e-300), i
            elif std > criteria.known and (not told or name in told):
                return f"{k.name} is not known to better than half"
            elif std > 1.0 / criteria.coefficient and name in effect.telling:
                return f"{k.name} is {1.0 / std:.1f} of its own standard errors from nothing"
        tests: list[tuple[tuple[int, ...], float]] = [((at[n],), sizes[n]) for n in effect.telling if n in sizes]
        tests = tests or [(tuple(at.values()), self._together(key, effect, list(sizes)))]
        for index, size in tests:
            needed = size if size >= criteria.coefficient or not index else max(size, self.apart(index))
            if needed < criteria.coefficient:
                return f"{key} is {needed:.1f} of its own standard errors from nothing"
        return ""

    def _effect(self, key: str) -> type[Effect]:
        return EFFECTS[key.partition(".")[0] if "." in key else self.model.effects[key].type]

    def _of(self, key: str, effect: type[Effect]) -> dict[int, tuple[Coordinate, float, float]]:
        """Return the coordinates of an effect, with values and standard errors, but those that say where, by number."""
        where = {*effect.turning[1:], *effect.periodic[:1]}
        every = zip(self.fit.candidate.coordinates, self.fit.theta.tolist(), self.spreads.tolist(), strict=True)
        mine = {i: one for i, one in enumerate(every) if key in (one[0].name.rpartition(".")[0], one[0].name)}
        return {i: one for i, one in mine.items() if one[0].name.rpartition(".")[2] not in where}

    def _together(self, key: str, effect: type[Effect], names: Sequence[str]) -> float:
        """Return by how many standard errors coefficients of an effect differ from nothing, all of them together
        [Wald 1943, doi:10.1090/S0002-9947-1943-0012401-3]: each may be unknown where only their difference is known.
        """
        every = self.fit.candidate.coordinates
        index = [i for i, k in enumerate(every) if k.name in {f"{key}.{name}" for name in names} | {key}]
        if not index:
            return float(np.inf)
        theta = self.fit.theta[index] - [every[i].nothing(effect) for i in index]
        inverses = (np.linalg.pinv(c[np.ix_(index, index)], hermitian=True) for c in self.covariances)
        return float(np.sqrt(min(max(float(theta @ i @ theta), 0.0) for i in inverses)))


def largest(covariances: Sequence[Array]) -> Array:
    """Return standard errors (n,), the largest of some covariances (n, n); inf of what moves nothing."""
    variances = np.max([np.diag(c) for c in covariances], axis=0)
    return np.asarray(np.sqrt(np.where(variances > 0.0, variances, np.inf)))


def covariances(problem: Problem, f: Fit) -> tuple[Array, ...]:
    """Return covariances of the coordinates: as of white noise, and one that allows for whatever correlation and change
    of size the residual has: the sandwich of White with sums over blocks [Econometrica 48 (1980) 817; Newey and West
    1987].
    """
    if not f.theta.size:
        return (np.zeros((0, 0)),)
    bread = np.asarray(np.linalg.pinv(f.hessian, hermitian=True), dtype=np.float64)
    found = follow_records(problem, f.candidate, f.theta, f.gains, True)
    if found is None:
        return (bread,)
    block = max(int(BLOCK / problem.scale.step), problem.samples // BLOCKS)
    slopes = np.array([k.slope(float(x)) for k, x in zip(f.candidate.coordinates, f.theta, strict=True)])
    errors = np.concatenate(found[0])
    weight = np.isfinite(errors).sum(axis=0) / np.maximum(np.nansum(errors**2, axis=0), 1e-300)
    sums = []
    for e, d in zip(found[0], found[1], strict=True):
        products = np.einsum("tc,tcj->tj", np.nan_to_num(e) * weight, np.nan_to_num(d[:, :, : f.theta.size])) * slopes
        sums += [products[i : i + block].sum(axis=0) for i in range(0, len(products), block)]
    g = np.array(sums)
    g -= g.mean(axis=0)
    whole = bread @ (g.T @ g) @ bread
    return bread, np.asarray(whole, dtype=np.float64)


def at_bound(f: Fit) -> tuple[str, ...]:
    """Return the parameters that ended at a bound."""
    return tuple(k.name for k, x in zip(f.candidate.coordinates, f.theta.tolist(), strict=True) if _edge(k, x))


def _edge(k: Coordinate, x: float) -> bool:
    near = EDGE * max(min(abs(k.low), abs(k.high)), 1.0)
    return x <= k.low + near or x >= k.high - near


def estimates(problem: Problem, f: Fit, errors: Array) -> dict[str, Estimate]:
    """Return all free parameters with standard errors and units."""
    units, bounds, result = _units(problem, f.candidate.model), at_bound(f), {}
    for k, x, own in zip(f.candidate.coordinates, f.theta.tolist(), errors.tolist(), strict=True):
        unit = units[k.name] if k.name in units else _of_sensor(problem, k.name)
        note = "at its bound" if k.name in bounds else _note(k, x, own)
        result[k.name] = Estimate(k.value(x), own * abs(k.slope(x)), unit, note)
    return result


def held(problem: Problem, model: Model, free: Collection[str]) -> dict[str, Estimate]:
    """Return the parameters of the plant that are not free, with units."""
    units = _units(problem, model)
    return {n: Estimate(x, None, units[n], "held") for n, x in model.parameters.items() if n not in free}


def _units(problem: Problem, model: Model) -> dict[str, str]:
    """Return the units of all parameters by name: ``key.name`` for those of effects."""
    declared = model.par_declarations()
    return {n.split(".", 1)[1]: resolve_unit(p.unit, model.plant, problem.rotary) for n, p in declared.items()}


def _off(k: Coordinate, x: float) -> float:
    """Return how far a coordinate is from nominal: what is known to within all of itself may be nothing."""
    return float(np.expm1(x - k.prior)) if k.log and x < k.prior else x - k.prior


def _note(k: Coordinate, x: float, own: float) -> str:
    if k.spread < 1.0 and abs(_off(k, x)) > ODD * k.spread:
        return f"{abs(_off(k, x)) / k.spread:.1f} tolerances from its nominal value"
    untold = k.spread < 1.0 and own > UNTOLD * k.spread
    return "not excited: the record says nothing beyond the tolerance" if untold else ""


def _of_sensor(problem: Problem, name: str) -> str:
    kind, _, channel = name.partition(".")
    return {"sensor_gain": "-", "sensor_delay": "s"}.get(kind, problem.units.get(channel, ""))


def whole_model(f: Fit) -> Model:
    """Return the model of a fit with its sensors."""
    model, kinds = f.fitted(), dict[str, dict[str, float]]()
    for name, value in sensors_of(f).items():
        kind, _, channel = name.partition(".")
        kinds.setdefault(kind, {})[channel] = value
    for kind, values in kinds.items():
        model = model.with_effect(kind, None, **values)
    return model


def names_of(problem: Problem, f: Fit) -> tuple[str, ...]:
    """Return the names of the effects that were added, in order."""
    uses = f.candidate.model.effects
    return tuple(uses[k].type if k in uses else k.partition(".")[0] for k in f.candidate.label)


__all__ = ["Fitted", "at_bound", "covariances", "estimates", "held", "largest", "names_of", "tidied", "whole_model"]
