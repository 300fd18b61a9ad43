"""What the equation-error estimate says of a model and its records."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import compress

import numpy as np
from numpy.typing import NDArray

from signlin_ros.comparison.equations import inertia, with_measured
from signlin_ros.comparison.force_segment import ForceSegment, best_cutoff, effort_gain, force_segment, stamped
from signlin_ros.diagnosis.blocks import MIN_DIVISOR
from signlin_ros.diagnosis.criteria import DEFAULT_CRITERIA, Criteria
from signlin_ros.diagnosis.equation_error.flexible import Curve, structured
from signlin_ros.diagnosis.equation_error.laws import LawRegressor, grid, laws, linear_parameters
from signlin_ros.diagnosis.equation_error.regression import (
    Regression,
    RegressionData,
    RegressionFit,
    base_of,
    scaling,
)
from signlin_ros.diagnosis.equation_error.search import SubsetSearch
from signlin_ros.diagnosis.equation_error.waves import Waves
from signlin_ros.diagnosis.output_error.trials import free_key
from signlin_ros.fitting.problem import Problem
from signlin_ros.model import Model
from signlin_ros.scale import Scale

Array = NDArray[np.float64]

MAX_EFFORT_DELAY = 0.5
"""Samples by which the effort may be late; of an imposed motion lateness is what presliding looks like."""
WIDEST = 0.12
"""Part of the rate at which laws are driven above which no band is tried."""
LATE_SENSOR = "sensor_delay"
"""Effect that a channel which lags behind another shows by itself."""
BROADER = 1.2
"""Times the quiet band that a wider one must be to be tried."""


@dataclass(frozen=True, eq=False)
class EquationErrorResult:
    """What the equation-error estimate found of a model: values, by sets of laws.

    ``given``: the model; ``regression``: both data, base parameters and laws; ``sets``: the best fit of every set of
    laws that was fitted, by their names; ``base``: of none; ``fit``: the chosen set; ``sound``: the sets of which every
    law is needed;
    ``helpful``: laws that take away some of the force residual, alone or beside others; ``waves``: orders that the
    records can tell; ``flexible``: what a flexible curve takes away beside the chosen set; by its effects,
    ``replacements``: sets with another law in the place of one, and ``ties``: those that are as good.
    """

    given: Model
    regression: Regression
    sets: Mapping[frozenset[str], RegressionFit]
    base: RegressionFit
    fit: RegressionFit
    sound: frozenset[frozenset[str]]
    helpful: frozenset[str]
    waves: Waves
    flexible: Curve
    replacements: Mapping[str, tuple[RegressionFit, ...]]
    ties: Mapping[str, tuple[str, ...]]

    @classmethod
    def of(cls, given: Model, search: SubsetSearch) -> EquationErrorResult:
        """Return the result of a search that has been run, for a model."""
        fit, base = search.chosen, search.base
        flexible = structured(search.regression, search.waves, base, fit)
        sets = dict(search.models)  # before what follows is asked: it does not depend on that
        beside = {name: search.beside(fit, name) for name, _ in fit.members}
        return cls(
            given,
            search.regression,
            sets,
            base,
            fit,
            frozenset(names for names, f in sets.items() if search.sound(f)),
            search.helpful(),
            search.waves,
            flexible,
            beside,
            {name: search.ties(fit, others) for name, others in beside.items()},
        )

    @property
    def training(self) -> RegressionData:
        """Forces of the training data."""
        return self.regression.training

    @property
    def validation(self) -> RegressionData:
        """Forces of the validation data."""
        return self.regression.validation

    @property
    def laws(self) -> Mapping[str, LawRegressor]:
        """The laws that forces show, by their names."""
        return self.regression.laws

    @property
    def effects(self) -> tuple[str, ...]:
        """The names of the chosen set, in the order in which they were found."""
        return tuple(n for n, _ in self.fit.members)

    @property
    def leaves_noise(self) -> bool:
        """Whether the chosen set leaves no force residual of validation data that is seen above the sensors' noise."""
        return self.fit.validation_mse <= self.regression.visible_mse

    def without(self, names: Iterable[str]) -> EquationErrorResult:
        """Return the result with the least of the best sound sets that have none of some laws as the chosen one."""
        gone = set(names)
        options = [f for one, f in self.sets.items() if one in self.sound and not one & gone]
        return replace(self, fit=self.regression.least_that_suffices([self.base, *options]), replacements={}, ties={})

    def structure_left(self, fit: RegressionFit) -> Curve:
        """Return the residual of a fit after a flexible curve, in per cent of the effort."""
        return structured(self.regression, self.waves, self.base, fit)

    def percent(self, fit: RegressionFit | None = None) -> float:
        """Return the force left of validation data in per cent of the effort."""
        return self.regression.percent(fit or self.fit)

    def mse_as_written(self, model: Model, known: bool = False) -> Array:
        """Return the squared force (blocks,) that a model as written leaves of validation data, or of ``known`` ones,
        at the effort as given.
        """
        r = self.regression
        side = r.training if known else r.validation
        return self._mse(side, model, side.X[:, -1])

    def mse_with_later_inputs(self, model: Model, seconds: float) -> Array:
        """Return the same (blocks,) of validation data whose inputs come later by seconds; the model delays none."""
        side = self.validation.later(seconds)
        return self._mse(side, model, side.late)

    def _mse(self, side: RegressionData, model: Model, late: Array) -> Array:
        r = self.regression
        left = side.force_residual(model) * effort_gain(r.model, r.current) / effort_gain(model, r.current)
        return side.mse_by_block(stamped(left, late))

    def changed(self) -> dict[str, tuple[float, float]]:
        """Return the sizes of chosen laws of one coefficient that surely differ between training and validation data,
        each fitted by itself: (of training data, of validation data) in the law's unit, by its name.
        """
        r, found = self.regression, dict[str, tuple[float, float]]()
        other = replace(r, training=r.validation, validation=r.training).fitted(self.fit.members)
        for name in self.effects:
            at = self.fit.spans[name]
            first, second = self.fit.theta[at], other.theta[at]
            error = np.hypot(self.fit.std[at], other.std[at])
            if first.size == 1 and np.all(np.abs(first - second) > r.criteria.min_coefficient_t * error):
                found[name] = float(first[0]), float(second[0])
        return found

    def values(self, fit: RegressionFit, name: str) -> dict[str, float]:
        """Return the parameters of a law as a fit has them."""
        return self.laws[name].parameters(dict(fit.members)[name], fit.theta[fit.spans[name]])

    @property
    def late(self) -> dict[str, float]:
        """The channel of position and velocity that lags behind the other in all data, by how many s (median)."""
        pieces = [*self.training.pieces, *self.validation.pieces]
        shared = set.intersection(*(set(p.lags) for p in pieces))
        return {name: float(np.median([p.lags[name] for p in pieces])) for name in shared}

    def late_beside(self, fit: RegressionFit, channels: Sequence[str]) -> dict[str, float]:
        """Return the late one of some channels, where beside the laws of a fit one effect more may be named."""
        full = len(fit.members) >= self.regression.criteria.max_effects or LATE_SENSOR in self.given.effects
        return {} if full else {name: lag for name, lag in self.late.items() if name in channels}

    def with_laws(self, fit: RegressionFit) -> Model:
        """Return the model with the laws of a fit, all values as found there; of laws that the model has, those values
        of which forces are a linear function: a relative change of a shape holds near its value only.
        """
        r, model = self.regression, self.given
        linear = {n for n in linear_parameters(model.structure) if n not in model.parameters}
        for name, _ in fit.members:
            model = model.with_effect(name, free_key(model, name), **self.values(fit, name))
        moved = list(zip(r.names[:-1], fit.theta, strict=False))
        moved = [(n, theta) for n, theta in moved if n in model.parameters or (n in linear and theta > -1.0)]
        return model.with_parameters({n: model.value(n) * (1 + theta) for n, theta in moved})

    def stated(self, fit: RegressionFit, beside: Model) -> tuple[list[str], Model]:
        """Return the laws of a fit, and the model with their values; what forces do not tell, a late sensor too, as in
        ``beside``.
        """
        estimated = {*self.regression.names, *scaling(self.regression.current)}
        others = set(beside.plant.pars()) - estimated
        values = {name: value for name, value in beside.parameters.items() if name in others}
        names, model = [name for name, _ in fit.members], self.with_laws(fit).with_parameters(values)
        late = beside.effects.get(LATE_SENSOR) if LATE_SENSOR not in self.given.effects else None
        if late is None:
            return names, model
        return [LATE_SENSOR, *names], model.with_effect(LATE_SENSOR, None, **late.parameters)


def estimate_equation_error(
    known: Problem, unseen: Problem, criteria: Criteria = DEFAULT_CRITERIA
) -> EquationErrorResult:
    """Ask the equation-error estimate. The quiet band first, a wider one where nothing is found in it, or where what is
    found leaves more than noise: that one counts where it shows a law beside the same, and these leave noise, for a
    wave may lie beyond the first.
    """
    model = known.base

    def below(cutoff: float) -> EquationErrorResult:
        return EquationErrorResult.of(model, subset_search(known, unseen, cutoff, criteria))

    cutoff = best_cutoff(model, known.parts, criteria.max_inertial_noise)
    first = below(cutoff)
    wide = min(criteria.band_widening * cutoff, WIDEST / first.training.pieces[0].step)
    found = bool(first.effects) and not first.flexible.visible
    if (found and first.leaves_noise) or wide < BROADER * cutoff:
        return first
    second = below(wide)
    if found:
        return second if set(first.effects) < set(second.effects) and second.leaves_noise else first
    more = second.flexible.visible and (first.effects or first.flexible.visible)
    return second if second.effects and not more else first


def subset_search(
    known: Problem, unseen: Problem, cutoff: float, criteria: Criteria = DEFAULT_CRITERIA
) -> SubsetSearch:
    """Return the search among sets of laws below a cut-off in Hz, when it has been run."""
    model = with_measured(known.base, set.intersection(*({*part.measured} for part in known.parts)))
    first, second = ([force_segment(model, part, cutoff) for part in side.parts] for side in (known, unseen))
    r = _regression(model, first, second, known.turns, criteria)
    scale = _scale_of(model, first)
    search = SubsetSearch(r, known.turns, {n: grid(law, scale) for n, law in r.laws.items()})
    search.run()
    return search


def _regression(
    model: Model, known: Sequence[ForceSegment], unseen: Sequence[ForceSegment], rotary: bool, criteria: Criteria
) -> Regression:
    """Return both sides, the base parameters that change the missing force at all, and the laws that may be missing."""
    current = "current" in model.states and "current" in known[0].values
    base = {**base_of(model, current), "timing": MIN_DIVISOR if model.plant.motion_is_imposed() else MAX_EFFORT_DELAY}
    first, second = (RegressionData.of(model, pieces, list(base)[:-1]) for pieces in (known, unseen))
    found = laws(model, rotary or first.travel >= criteria.min_turns * 2 * np.pi, known[0].position_measured)
    tells = np.any(first.X != 0.0, axis=0)
    tells &= [not (first.free and _moves_inertia(model, name)) for name in base]  # else all forces shrink to nothing
    tells[-1] = True
    first, second = (replace(side, X=side.X.compress(tells, axis=1)) for side in (first, second))
    names, spread = tuple(compress(base, tells)), np.array([*base.values()])[tells]
    return Regression(model, found, first, second, names, spread, criteria, current)


def _moves_inertia(model: Model, name: str) -> bool:
    """Tell whether a parameter changes the moving mass or inertia, beside which a machine that nothing drives tells of
    all other forces.
    """
    value = model.parameters.get(name, 0.0)
    return bool(value) and inertia(model.with_parameters({name: 2.0 * value})) != inertia(model)


def _scale_of(model: Model, pieces: Sequence[ForceSegment]) -> Scale:
    """Return how large things are in the band of the equation-error estimate: its laws start from there."""

    def rms(values: Iterable[Array]) -> float:
        return float(np.sqrt(np.mean(np.concatenate([*values]) ** 2))) or 1.0

    def most(values: Iterable[Array]) -> float:
        return max(float(np.max(np.abs(one))) for one in values) or 1.0

    moved = rms(p.v for p in pieces), rms(p.acceleration for p in pieces)
    current = rms(p.values.get("current", np.ones(1)) for p in pieces)
    sizes = (rms(p.effort for p in pieces), most(p.q for p in pieces), *moved, current, most(p.u[:, 0] for p in pieces))
    return Scale(*sizes, pieces[0].step, max(float(p.t[-1]) for p in pieces), inertia(model))


__all__ = ["LATE_SENSOR", "EquationErrorResult", "estimate_equation_error", "subset_search"]
