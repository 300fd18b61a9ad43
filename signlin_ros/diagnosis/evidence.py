"""Both estimates of a data set: what they measure of a model on validation data. The tables of all verbs show a row of
each model; the first rows are the same in all for the same files.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from signlin_ros.comparison.equations import depends_on_place
from signlin_ros.comparison.force_segment import recorded, tells_force
from signlin_ros.diagnosis.criteria import DEFAULT_CRITERIA, Criteria
from signlin_ros.diagnosis.dataset import Dataset
from signlin_ros.diagnosis.equation_error.estimate import EquationErrorResult, estimate_equation_error
from signlin_ros.diagnosis.equation_error.regression import MIN_DIVISOR, RegressionFit, mean_t_ratio, scaling
from signlin_ros.diagnosis.input_hold import asks_hold, with_hold
from signlin_ros.diagnosis.output_error import FitCache, FittedModel, OutputErrorEstimator, estimator_of
from signlin_ros.diagnosis.output_error.score import of_windows
from signlin_ros.diagnosis.progress import Progress
from signlin_ros.diagnosis.results import FirstRows, LadderRow, Scores
from signlin_ros.diagnosis.wording import phrases
from signlin_ros.effects import EFFECTS, find_effect
from signlin_ros.effects.base import Effect, SensorEffect
from signlin_ros.threads import one_thread

Array = NDArray[np.float64]
WHOLE_EFFORT = 100.0
"""All of the effort, in per cent of it."""
HALF = 0.5
"""Part of a squared error from which on it is most of it, where estimates or laws are set against each other."""


def equation_error_of(dataset: Dataset, criteria: Criteria, progress: Progress) -> EquationErrorResult | None:
    """Return the equation-error estimate; None where what the model's forces depend on is not recorded."""
    progress.say(phrases.FORCE_RESIDUAL)
    if not tells_force(dataset.model, recorded(dataset.model, [*dataset.training.parts, *dataset.validation.parts])):
        return None
    found = estimate_equation_error(dataset.training, dataset.validation, criteria)
    progress.seen(found)
    return found


@dataclass(frozen=True, eq=False)
class Evidence:
    """What both estimates measure of a model.

    ``equation_error``: None where the signals that the forces depend on are not recorded; ``contradicted``: the base
    model as the output error alone has it, where the forces contradict that (`grounded`), and ``unheld`` the estimate
    that holds none of its parameters. Squared forces are in N² or (N·m)², means over blocks of validation data.
    """

    dataset: Dataset
    output_error: OutputErrorEstimator
    equation_error: EquationErrorResult | None
    contradicted: FittedModel | None = None
    unheld: OutputErrorEstimator | None = None

    @property
    def cache(self) -> FitCache:
        """The memo of all fits."""
        return self.output_error.cache

    def grounded(self) -> Evidence:
        """Return the same with base parameters held at what the force tells of them, where the motion alone bends them:
        what moves slowly in a loop is followed best where forces hardly act (300 times its inertia), and such a base is
        no reference for what effects gain.

        That is done where all of this holds: forces show a law (else they tell no more of a base that lacks one than
        the motion does); the fitted base leaves more force than all of the effort, and surely more than the model as
        given; neither what the laws leave of the force nor what the base leaves of the motion is near the noise. If the
        held base, without the laws beside which its values were found, leaves more force than the model as given, that
        one is the reference.
        """
        force, motion = self.equation_error, self.output_error
        given, own = self.force_mse_as_written(motion.unfitted), self.force_mse_as_written(motion.base)
        if (
            force is None
            or not force.effects
            or given is None
            or own is None
            or (self.percent_of_effort(own) or 0.0) <= WHOLE_EFFORT
        ):
            return self
        complete = (
            force.fit.validation_mse <= self.criteria.min_force_over_noise** 2 * self.force_noise_mse
            or motion.base.within_noise(self.criteria.min_force_over_noise)
        )
        if complete or mean_t_ratio(given, own) > -self.criteria.min_t:
            return self
        told = force.with_laws(force.fit)
        held = {n: told.value(n) for n in force.regression.names if n in told.parameters}
        found = Evidence(self.dataset, motion.holding(held, motion.progress), force, motion.base, motion)
        if (own := found.force_mse_as_written(found.base)) is not None and np.mean(own) > np.mean(given):
            return replace(found, output_error=found.output_error.referring_to_given())
        return found

    @property
    def criteria(self) -> Criteria:
        """What decides."""
        return self.output_error.criteria

    @property
    def base(self) -> FittedModel:
        """The best fit of the model as given."""
        return self.output_error.base

    @property
    def unseen_by_force(self) -> set[str]:
        """The effects that act on no force, or on none that was recorded."""
        return {n for n in EFFECTS if self.equation_error is None or n not in self.equation_error.laws}

    @property
    def single_effect_fits(self) -> list[FittedModel]:
        """The fits of one effect that were weighed."""
        return [f for f in self.cache.weighed if len(f.effects) == 1]

    @property
    def laws(self) -> dict[str, RegressionFit]:
        """What the equation-error estimate found of every law by itself."""
        models = self.equation_error.sets if self.equation_error else {}
        return {next(iter(names)): fit for names, fit in models.items() if len(names) == 1}

    # ------------------------------------------------------------ the force that a model leaves

    def effects_in_force(self, f: FittedModel) -> frozenset[str]:
        """Return the effects that act on the force: where the current is measured, those of the voltage do not."""
        current = self.equation_error is not None and self.equation_error.regression.current
        own = {n: find_effect(n, "effects") for n in f.effects}
        only = {n for n, e in own.items() if _has(e, "input", "delay") and not _has(e, "force", "torque_constant")}
        return frozenset(own.keys() - only if current else own)

    def force_comparable(self, f: FittedModel) -> bool:
        """Tell whether the force that a model leaves can be compared with the base model's. It cannot where

        - one of its effects changes a sensor, a motor's constants or the time of the effort (`changes_effort`), unless
          it changes the input, or has a load that floats (`Effect.floating`);
        - the motion leaves a white residual, and that is owed to an effect that no force shows (but of the input), or
          the forces lack nothing (`force_finds_nothing`);
        - one of its waves is beyond the band in which forces are compared;
        - its forces depend on a position that was not measured.
        """
        if self.equation_error is None:
            return False
        acting = {name: find_effect(name, "effects") for name in self.effects_in_force(f)}
        effects = acting.values()
        if any((changes_effort(e) and not _has(e, "input")) or e.floating for e in effects):
            return False
        shown = {name for name, effect in acting.items() if _has(effect, "input")}
        if f.effects and f.white and (set(f.effects) & self.unseen_by_force - shown or self.force_finds_nothing):
            return False
        of_waves = [effect for effect in effects if effect.periodic or effect.several]
        waves = [1.0 for effect in effects if effect.angular and effect not in of_waves]  # a weight is one of order one
        waves += _orders(f) if of_waves else []
        if max(waves, default=0.0) > self.equation_error.waves.finest:
            return False
        pieces = self.equation_error.training.pieces
        return pieces[0].position_measured or not depends_on_place(f.model.structure)

    def force_mse_as_written(self, f: FittedModel) -> Array | None:
        """Return the mean squared force residual (blocks,) of a model with its own values; None: not comparable."""
        if self.equation_error is None or not self.force_comparable(f):
            return None
        known = self.cache.force_mse
        if f not in known:
            known[f] = self.equation_error.mse_as_written(f.model)
        return known[f]

    def force_mse(self, f: FittedModel) -> Array | None:
        """Return the same (blocks,) with the parameters of the output or the equation error, whichever leave less."""
        left = self.force_mse_as_written(f)
        if left is None or self.equation_error is None:
            return None
        own = self.equation_error.sets.get(self.effects_in_force(f))
        better = own is not None and own.validation_mse < float(np.mean(left))
        return self.equation_error.validation.mse_by_block(own.validation_residual) if own and better else left

    def percent_of_effort(self, left: Array | float | None) -> float | None:
        """Return a mean squared force (blocks,) as RMS in per cent of the RMS effort."""
        if left is None or self.equation_error is None:
            return None
        return 100.0 * float(np.sqrt(np.mean(left))) / max(self.equation_error.validation.effort, MIN_DIVISOR)

    @cached_property
    def force_finds_nothing(self) -> bool:
        """Whether the equation error names no law and its residual is within the noise."""
        return self.equation_error is not None and not self.equation_error.effects and not self.force_shows(self.base)

    @property
    def force_noise_mse(self) -> float:
        """Mean square of the force residual that the sensors' noise alone leaves; inf without equation error."""
        return np.inf if self.equation_error is None else self.equation_error.validation.noise_mse

    @property
    def force_noise_percent(self) -> float:
        """The same in per cent of the effort."""
        told = self.percent_of_effort(self.force_noise_mse)
        return np.inf if told is None else told

    @property
    def of_effort(self) -> str:
        """What forces are told in per cent of, in words."""
        free = self.equation_error is not None and self.equation_error.validation.free
        return "of the inertial force" if free else "of the effort"

    def force_shows(self, f: FittedModel) -> bool:
        """Tell whether the force residual of a model is well above its noise floor (`min_force_over_noise`)."""
        left = self.force_mse(f)
        return left is not None and float(np.mean(left)) > self.criteria.min_force_over_noise**2 * self.force_noise_mse

    def share_left(self, left: Array | None) -> float | None:
        """Return a mean squared force (blocks,) as a share of the base model's, both beyond the noise floor."""
        before = self.force_mse(self.base)
        if left is None or before is None:
            return None
        return (float(np.mean(left)) - self.force_noise_mse) / max(
            float(np.mean(before)) - self.force_noise_mse, MIN_DIVISOR
        )

    def explains_force(self, f: FittedModel) -> bool:
        """Tell whether a model takes away most of a force residual that is above the noise."""
        part = self.share_left(self.force_mse(f))
        return part is not None and self.force_shows(f) and part <= self.criteria.max_force_mse_left

    def force_falls(self, before: FittedModel, after: FittedModel) -> bool:
        """Tell whether the force residual surely falls between two models; true where it cannot be compared."""
        a, b = self.force_mse(before), self.force_mse(after)
        return a is None or b is None or mean_t_ratio(a, b) >= self.criteria.min_t

    def force_rises(self, before: FittedModel, after: FittedModel) -> bool:
        """Tell whether the force residual surely rises between two models, so that it shows, above the noise."""
        a, b = self.force_mse(before), self.force_mse(after)
        if a is None or b is None:
            return False
        alike = (1 + self.criteria.visible_change) ** 2 * float(np.mean(a))
        return float(np.mean(b)) > max(alike, self.force_noise_mse) and mean_t_ratio(a, b) < -self.criteria.tie_t

    def with_better_values(self, f: FittedModel) -> FittedModel:
        """Return the best model with the same effects: with the parameters of the output error, or of the equation
        error where these surely leave less force, less of both measures together, and no channel errs more. Near the
        sensors' noise the output error is right.
        """
        motion, force, best = self.output_error, self.equation_error, self.output_error.best(f)
        if force is None or self.near_noise(best) or not (f.effects and self.force_comparable(f)):
            return best

        def both(one: FittedModel) -> float:
            return one.log_mse + float(np.log(np.mean(force.mse_as_written(one.model)) + MIN_DIVISOR))

        f = min(f, best, key=both)
        fit = force.sets.get(frozenset(f.effects))
        if fit is None:
            return f
        model = force.with_laws(fit)
        untold = set(f.model.plant.pars()) - {*force.regression.names, *scaling(force.regression.current)}
        model = model.with_parameters({n: v for n, v in f.model.parameters.items() if n in untold})
        stated = motion.at_values_of([n for n, _ in fit.members], model)
        less = stated is not None and mean_t_ratio(force.mse_as_written(f.model), force.mse_as_written(stated.model))
        if stated is None or less < self.criteria.min_t or self.rising_channel(f, stated, self.criteria.tie_t):
            return f
        return min(f, stated, key=both)

    # ------------------------------------------------------------ rows of the tables

    def shown_percent(self, f: FittedModel, left: Array | None) -> float | None:
        """Return `percent` of what a fit leaves (blocks,); not of effects where the base leaves less than the noise."""
        base = self.force_mse(self.base) if f.effects else None
        return (
            None if base is not None and float(np.mean(base)) < self.force_noise_mse else self.percent_of_effort(left)
        )

    def row(self, f: FittedModel, left: Array | None) -> LadderRow:
        """Return the row of a fit; ``left``: the mean squared force (blocks,) that it leaves of validation data."""
        dataset, noise = self.dataset, np.array(list(self.dataset.noise.values()))
        sides = ((dataset.training, f.training_squares), (dataset.validation, f.validation_squares))
        first, second = (Scores(of_windows(problem, squares, noise)) for problem, squares in sides)
        return LadderRow(
            f.effects,
            first,
            second,
            self.shown_percent(f, left),
            self.force_noise_percent if self.equation_error else None,
        )

    def first_rows(self) -> FirstRows:
        """Return the first rows."""
        given = self.row(self.output_error.unfitted, self.force_mse_as_written(self.output_error.unfitted))
        return FirstRows(given, self.row(self.base, self.force_mse(self.base)), self.dataset.horizon)

    def rising_channel(self, before: FittedModel, after: FittedModel, times: float) -> str:
        """Return the channel whose printed error rises between models, by so many standard errors; empty if none."""
        pairs = zip(
            self.dataset.training.channels, before.validation_squares.T, after.validation_squares.T, strict=True
        )
        return next((name for name, a, b in pairs if self.mse_rises(a, b, times)), "")

    def mse_rises(self, before: Array, after: Array, times: float) -> bool:
        """Tell whether mean squares (blocks,) rise so that it shows, and by so many standard errors."""
        rise = after - before
        error = float(np.nanstd(rise) / np.sqrt(max(int(np.count_nonzero(np.isfinite(rise))), 1)))
        shows = np.nanmean(after) > (1.0 + self.criteria.visible_change) ** 2 * np.nanmean(before)
        return bool(shows and np.nanmean(rise) > times * error)

    # ------------------------------------------------------------ what counts as noise of the motion

    def residual_is_white(self, f: FittedModel) -> bool:
        """Tell whether no test finds structure in the residual, tested or not (`FittedModel.residual_is_noise` asks for
        enough samples, too); of a load that floats and is held by a filter, the windowed error must be near the noise.
        """
        return f.white and (not _floats(f) or self.near_noise(f))

    def near_noise(self, f: FittedModel) -> bool:
        """Tell whether a model predicts every channel to about its sensor's noise: completeness can be tested there."""
        return f.within_noise(self.criteria.max_rmse_over_noise)

    def near_any_noise(self, f: FittedModel) -> bool:
        """Tell whether a model is near the sensors' noise, or leaves noise and errs by about as much over the horizon,
        of known and of validation data: what is missing gathers, noise does not.
        """
        if self.near_noise(f):
            return True
        if not f.residual_is_noise or _floats(f):
            return False
        own = self.criteria.max_rmse_over_noise * np.maximum([one.over_noise for one in f.residual_tests], 1.0)
        pairs = (
            (f.training_squares, self.dataset.training.noise),
            (f.validation_squares, self.dataset.validation.noise),
        )
        return all(bool(np.all(np.sqrt(np.nanmean(squares, axis=0)) < own * noise)) for squares, noise in pairs)


def evidence_of(
    dataset: Dataset, criteria: Criteria, cache: FitCache, progress: Progress, jobs: int | None = None
) -> Evidence:
    """Return both estimates of a data set, its inputs acting as the records show where the model leaves that to them;
    fits go into the ``cache``, those with inputs that act otherwise into one of their own.
    """
    motion = estimator_of(dataset.training, dataset.validation, criteria, cache, progress, jobs)
    force = equation_error_of(dataset.knowing(motion.own_values), criteria, progress)
    if asks_hold(dataset):
        progress.say(phrases.INPUT_HOLD)
        found = with_hold(dataset, motion, force, criteria)
        if found is not None:
            dataset, motion = found
            force = equation_error_of(dataset.knowing(motion.own_values), criteria, progress)
    return Evidence(dataset, motion, force)


@one_thread
def refitted_evidence(dataset: Dataset, progress: Progress | None = None) -> Evidence:
    """Refit the base of a data set and return what makes rows."""
    return evidence_of(dataset, DEFAULT_CRITERIA, FitCache(), progress or Progress(), 1).grounded()


def changes_effort(effect: type[Effect]) -> bool:
    """Tell whether an effect changes the input, torque constant or a sensor: no picture of a force shows it."""
    return issubclass(effect, SensorEffect) or _has(effect, "input", "delay", "torque_constant", "resistance")


def _has(effect: type[Effect], *parts: str) -> bool:
    """Tell whether an effect has one of some parts of an equation as its own."""
    return any(getattr(effect, part) is not getattr(Effect, part) for part in parts)


def _floats(f: FittedModel) -> bool:
    return any(find_effect(name, "effects").floating for name in f.effects)


def _orders(f: FittedModel) -> list[float]:
    """Return the orders of the waves of a model."""
    uses = f.model.effects.values()
    return [N for use in uses for N, _, _ in find_effect(use.type, "effects").waves(use.parameters)]


__all__ = [
    "HALF",
    "Evidence",
    "changes_effort",
    "equation_error_of",
    "evidence_of",
    "refitted_evidence",
]
