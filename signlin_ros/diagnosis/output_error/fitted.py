"""A fitted model: parameters with standard errors, and its errors on training and validation data."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from signlin_ros.diagnosis.blocks import MIN_DIVISOR
from signlin_ros.diagnosis.criteria import Criteria
from signlin_ros.diagnosis.output_error.residual import ResidualStructure
from signlin_ros.diagnosis.output_error.score import log_mse
from signlin_ros.diagnosis.results import ParameterEstimate
from signlin_ros.diagnosis.wording import phrases
from signlin_ros.effects import EFFECTS
from signlin_ros.effects.base import Effect
from signlin_ros.fitting.candidate import Coordinate
from signlin_ros.fitting.fit import Fit
from signlin_ros.fitting.following import follow_records
from signlin_ros.fitting.inverses import covariance_of, squared_distance
from signlin_ros.fitting.problem import Problem
from signlin_ros.model import Model
from signlin_ros.model.numbers import declared
from signlin_ros.model.uses import EffectUse
from signlin_ros.par import declared_name
from signlin_ros.recording.trace import resolve_unit

Array = NDArray[np.float64]

MAX_SCORE_BLOCKS, MIN_SCORE_BLOCK = 40, 0.25
"""Blocks that a standard error is taken from, and how long each is at least in s."""
BOUND_TOLERANCE = 1e-6
"""How near a coordinate is to a bound that it is at, in standard units."""
ODD, UNIDENTIFIED = 3.0, 0.95
"""Tolerances from nominal that a note tells; part of its tolerance above which an error says that nothing shows."""


class FittedCoordinate(NamedTuple):
    """A coordinate of a fit, where it ended, its standard error, and where it is judged by what is known beforehand: an
    inertia perhaps with that of its load, see `Candidate.nearest_to_prior`.
    """

    k: Coordinate
    x: float
    std: float
    judged: float

    @property
    def key(self) -> str:
        """The effect that it is of: its key, or what a sensor does on a channel; empty for one of the plant."""
        return self.k.name if self.k.name.startswith("sensor_") else self.k.name.rpartition(".")[0]

    @property
    def name(self) -> str:
        """The name of the parameter in its effect, or of a sensor's channel."""
        return self.k.name.rpartition(".")[2]

    @property
    def prior_deviation(self) -> float:
        """How far it is from nominal, in tolerances: below it (x - x0) / x0, above it ln(x / x0), over the tolerance;
        what is known to within all of itself may be nothing.
        """
        apart = self.deviation
        return (float(np.expm1(apart)) if self.k.log and apart < 0.0 else apart) / self.k.spread

    @property
    def deviation(self) -> float:
        """How far it is from what is known beforehand, as a coordinate."""
        return self.judged - self.k.prior

    @property
    def at_bound(self) -> bool:
        """Whether it ended at a bound."""
        near = BOUND_TOLERANCE * max(min(abs(self.k.low), abs(self.k.high)), 1.0)
        return not self.k.low + near < self.x < self.k.high - near

    @property
    def note(self) -> str:
        """What is told beside its value."""
        if self.at_bound:
            return phrases.AT_BOUND
        if self.k.record:
            return phrases.own_record(self.k.record)
        if self.k.spread < 1.0 and abs(self.prior_deviation) > ODD:
            ratio = float(np.exp(self.deviation)) if self.k.log else None
            return phrases.off_nominal(self.prior_deviation, ratio)
        unidentified = self.k.spread < 1.0 and self.std > UNIDENTIFIED * self.k.spread
        return phrases.NOT_EXCITED if unidentified else ""


@dataclass(frozen=True, eq=False)
class FittedModel:
    """A model fitted to the training data.

    ``effects``: names added to the model as given; ``model``: the whole of it; ``parameters`` by name (``c``,
    ``coulomb_friction.mu``, ``sensor_offset.speed``). ``training_squares``, ``validation_squares`` (blocks, channels):
    mean squared errors of windows in the channels' units squared, in blocks that are the same for all models, NaN where
    nothing is measured; ``noise`` (channels,): standard deviations of validation data. ``coordinates`` (n,) of the
    ``fit``; ``covariances`` (n, n): as of white noise, and robust. ``test_residual`` simulates once for
    `residual_tests`; ``likelihood_t`` gives the standard errors by which coordinates differ from zero.
    """

    effects: tuple[str, ...]
    model: Model
    parameters: dict[str, ParameterEstimate]
    training_squares: Array
    validation_squares: Array
    noise: Array
    fit: Fit = field(repr=False)
    coordinates: tuple[FittedCoordinate, ...] = field(repr=False)
    covariances: tuple[Array, ...] = field(repr=False)
    test_residual: Callable[[], tuple[ResidualStructure, ...]] = field(repr=False)
    likelihood_t: Callable[[tuple[int, ...]], float] = field(repr=False)

    @cached_property
    def residual_tests(self) -> tuple[ResidualStructure, ...]:
        """Tests of the residual, by channel; simulates once."""
        return self.test_residual()

    @property
    def validation_rmse(self) -> Array:
        """RMS errors (channels,) of validation data over the horizon: those of the tables."""
        return np.asarray(np.sqrt(np.nanmean(self.validation_squares, axis=0)))

    @property
    def training_rmse(self) -> Array:
        """The same of training data."""
        return np.asarray(np.sqrt(np.nanmean(self.training_squares, axis=0)))

    @property
    def size(self) -> tuple[int, int]:
        """Number of effects, and of parameters: the smaller is the simpler model."""
        return len(self.effects), self.n_parameters

    @property
    def remembers(self) -> tuple[str, ...]:
        """The effects that have a state of their own."""
        return tuple(n for n in self.effects if EFFECTS[n].states)

    @property
    def floats(self) -> bool:
        """Whether one of the effects has a load that moves freely for a time, where nothing shows its place."""
        return any(EFFECTS[n].floating for n in self.effects)

    @property
    def kind(self) -> tuple[str, ...]:
        """What tells one set of effects from another: their keys, sensors with their channels."""
        return tuple(sorted(self.fit.candidate.label))

    @property
    def white(self) -> bool:
        """Whether no test finds structure in the residual; also where none could be made."""
        return not any(one.structured for one in self.residual_tests)

    def within_noise(self, times: float) -> bool:
        """Tell whether the validation RMSE of every channel is less than so many times its noise."""
        return bool(np.all(self.validation_rmse < times * self.noise))

    @property
    def residual_is_noise(self) -> bool:
        """Whether the residual is white, and samples were enough to test it."""
        return self.white and not any(np.isnan(one.dependent) for one in self.residual_tests)

    @property
    def log_mse(self) -> float:
        """Sum over channels of ln(MSE) of validation data, MSE in the channel's unit squared: less is better."""
        return log_mse(self.validation_squares, self.noise)

    @property
    def added(self) -> dict[str, EffectUse]:
        """The effects that were added, but for those of sensors, by their keys."""
        return {k: self.model.effects[k] for k in self.fit.candidate.label if k in self.model.effects}

    @property
    def n_parameters(self) -> int:
        """Number of parameters beyond those of the model as given, with the whole orders that were chosen for waves."""
        added = [one for one in self.coordinates if one.key in self.kind]
        orders = {n for use in self.added.values() for n in EFFECTS[use.type].order_names()}
        return len({one.k.name for one in added if declared_name(one.name) not in orders}) + len(self.wave_orders)

    @property
    def wave_orders(self) -> list[tuple[str, float]]:
        """The orders of all waves over the position that were added, with the keys of their effects."""
        uses = self.added.items()
        return [(key, order) for key, use in uses for order, _, _ in EFFECTS[use.type].waves(use.parameters)]

    @cached_property
    def prior_distance(self) -> float:
        """Squared distance of the parameters of the model as given from their values there, in tolerances."""
        base = (one for one in self.coordinates if one.key not in self.kind)
        return float(sum((one.deviation / one.k.spread) ** 2 for one in base))

    @property
    def prior_deviations(self) -> dict[str, float]:
        """Deviation of every base parameter from its nominal value, in tolerances."""
        shared = (one for one in self.coordinates if not one.k.record)
        return {one.k.name: one.prior_deviation for one in shared if one.k.spread < np.inf and not one.key}

    def far_from_nominal(self, criteria: Criteria) -> dict[str, float]:
        """Return the base parameters that are far from nominal, and by how many tolerances."""
        return {n: x for n, x in self.prior_deviations.items() if abs(x) > criteria.max_tolerances_off}

    @property
    def implausible(self) -> list[str]:
        """The effects that were added whose values are those of something that their equation imitates."""
        return [k for k, use in self.added.items() if not EFFECTS[use.type].plausible(use.parameters)]

    def insignificant(self, criteria: Criteria) -> str:
        """Return why what was added cannot be named: a coefficient that is nothing, at a bound or hardly known."""
        return next((why for key in self.fit.candidate.label if (why := self._insignificant(key, criteria))), "")

    def insignificant_key(self, criteria: Criteria) -> str:
        """Return the key of the first effect that was added and cannot be named, since a coefficient is nothing, at a
        bound or hardly known; empty if none, or if its values are implausible.
        """
        key = next((key for key in self.fit.candidate.label if self._insignificant(key, criteria)), "")
        return "" if key in self.implausible else key

    def _insignificant(self, key: str, criteria: Criteria) -> str:
        effect = EFFECTS[self.added[key].type if key in self.added else key.partition(".")[0]]
        if key in self.implausible:
            return phrases.not_real(key)
        decisive, where = (*effect.telling, *effect.essential), _orders_and_phases(effect)
        of_key = ((i, one) for i, one in enumerate(self.coordinates) if one.key == key)
        own = {i: one for i, one in of_key if declared_name(one.name) not in where}
        moving = {i: one for i, one in own.items() if np.isfinite(one.std) or declared_name(one.name) in decisive}
        if own and not moving:
            return phrases.unknown(key)
        at: dict[str, int] = {}
        for i, one in moving.items():
            k, name = one.k, declared_name(one.name)
            if one.at_bound and (name in decisive or k.log):
                return phrases.at_bound(k.name)
            if not k.log or name in effect.neutral or k.name.startswith("sensor_gain"):
                at[one.name] = i
            elif one.std > criteria.max_relative_std and (not decisive or name in decisive):
                return phrases.vague(k.name)
            elif one.std > 1.0 / criteria.min_coefficient_t and name in effect.telling:
                return phrases.insignificant(k.name, 1.0 / one.std)
        tests: list[tuple[int, ...]] = [(i,) for n, i in at.items() if declared_name(n) in effect.telling]
        if (size := self.together_t(key)) < criteria.min_coefficient_t:
            return phrases.insignificant(key, size)
        for index in tests or ([tuple(at.values())] if at else []):
            size = self._joint_t(effect, index)
            surely = max(size, self.likelihood_t(index)) if 1.0 <= size < criteria.min_coefficient_t else size
            if surely < criteria.min_coefficient_t:  # nor is the likelihood asked of what its own error swallows
                return phrases.insignificant(key, surely)
        return ""

    def t_ratio(self, effect: str) -> float:
        """Return by how many standard errors an added effect differs from nothing, as its printed errors say: these
        allow for any residual, where a likelihood takes what is left for noise. Infinite where no level tells.
        """
        cls, sizes = EFFECTS[effect], [np.inf]
        keys = {k for k, use in self.added.items() if use.type == effect} or set(self.kind)
        where = _orders_and_phases(cls)
        own = {
            one.name: (i, one)
            for i, one in enumerate(self.coordinates)
            if one.key in keys and declared_name(one.name) not in where and one.k.name.startswith(effect)
        }
        levels = [i for i, one in own.values() if not one.k.log or one.name in cls.neutral]
        telling = [(n, i) for n, (i, _) in own.items() if declared_name(n) in cls.telling]
        alone: list[tuple[int, ...]] = [(i,) for _, i in telling if i in levels]
        sizes += [self._joint_t(cls, index) for index in alone or ([tuple(levels)] if levels else [])]
        sizes += [1.0 / one.std for n, (_, one) in own.items() if n in cls.telling and one.k.log and one.std > 0.0]
        return float(min(sizes))

    def together_t(self, key: str) -> float:
        """Return by how many standard errors an added effect differs from the simpler one that it is without those
        parameters that count together; infinite where it has none.
        """
        effect = EFFECTS[self.added[key].type] if key in self.added else Effect
        index = [i for i, one in enumerate(self.coordinates) if one.key == key]
        index = [i for i in index if declared_name(self.coordinates[i].name) in effect.together]
        return self._joint_t(effect, tuple(index)) if index else np.inf

    def _joint_t(self, effect: type[Effect], index: tuple[int, ...]) -> float:
        """Return by how many standard errors coefficients of an effect differ from nothing, all of them together: each
        may be unknown where only their difference is known.
        """
        apart = np.array([self.coordinates[i].x - self.coordinates[i].k.nothing(effect) for i in index])
        return float(np.sqrt(min(squared_distance(apart, c[np.ix_(index, index)]) for c in self.covariances)))


def _orders_and_phases(effect: type[Effect]) -> tuple[str, ...]:
    """Return the names of an effect's orders and phases, which tell nothing of its size."""
    return (*effect.order_names(), *effect.turning[1:], *effect.several[2:])


def coordinates_of(f: Fit, covariances: Sequence[Array]) -> tuple[FittedCoordinate, ...]:
    """Return a fit's coordinates with standard errors, the largest of some covariances; inf of what moves nothing."""
    variances = np.max([np.diag(c) for c in covariances], axis=0)
    errors = np.sqrt(np.where(variances > 0.0, variances, np.inf))
    judged = f.candidate.nearest_to_prior(f.theta)
    values = zip(f.candidate.coordinates, f.theta.tolist(), errors.tolist(), judged.tolist(), strict=True)
    return tuple(FittedCoordinate(*one) for one in values)


def covariances(problem: Problem, f: Fit) -> tuple[Array, ...]:
    """Return covariances of the coordinates: as of white noise, and one for any correlation and change of size that the
    residual has: the sandwich of White with sums over blocks [Econometrica 48 (1980) 817; Newey and West 1987]. What is
    known beforehand counts in both: of a direction of which the records say nothing it is all that there is.
    """
    bread = covariance_of(f.hessian)
    found = follow_records(problem, f.candidate, f.theta, f.gains, True)
    if found is None:
        return (bread,)
    block = max(int(MIN_SCORE_BLOCK / problem.scale.step), problem.samples // MAX_SCORE_BLOCKS)
    slopes = f.candidate.slopes(f.theta)
    errors = np.concatenate(found[0])
    weight = np.isfinite(errors).sum(axis=0) / np.maximum(np.nansum(errors**2, axis=0), MIN_DIVISOR)
    sums = []
    for e, d in zip(found[0], found[1], strict=True):
        products = np.einsum("tc,tcj->tj", np.nan_to_num(e) * weight, np.nan_to_num(d[:, :, : f.theta.size])) * slopes
        sums += [products[i : i + block].sum(axis=0) for i in range(0, len(products), block)]
    g = np.array(sums) - np.mean(sums, axis=0)
    _, prior = f.candidate.prior(f.theta)
    root = np.concatenate([g, prior]) @ bread
    return bread, np.asarray(root.T @ root, dtype=np.float64)


def estimates(problem: Problem, model: Model, coordinates: Sequence[FittedCoordinate]) -> dict[str, ParameterEstimate]:
    """Return all free parameters with standard errors and units."""
    units = _units(problem, model)
    known = ((one, one.std * abs(one.k.slope(one.x))) for one in coordinates)
    return {k.k.name: ParameterEstimate(k.k.value(k.x), error, units[k.k.parameter], k.note) for k, error in known}


def held(problem: Problem, model: Model, free: Collection[str]) -> dict[str, ParameterEstimate]:
    """Return the parameters of the plant that are not free, with units."""
    units = _units(problem, model)
    return {n: ParameterEstimate(x, None, units[n], "held") for n, x in model.parameters.items() if n not in free}


def _units(problem: Problem, model: Model) -> dict[str, str]:
    """Return the units of all parameters by name: ``key.name`` for those of effects."""
    return {n: resolve_unit(par.unit, model.plant, problem.rotary) for n, par in declared(model).items()}


__all__ = ["FittedCoordinate", "FittedModel", "coordinates_of", "covariances", "estimates", "held"]
