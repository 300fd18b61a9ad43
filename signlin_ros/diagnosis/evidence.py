"""Both estimates of a data set, and what they measure of a model on validation data."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from signlin_ros.comparison.equations import force_equations
from signlin_ros.comparison.force_segment import recorded, tells_force
from signlin_ros.diagnosis.blocks import MIN_DIVISOR, BlockChange
from signlin_ros.diagnosis.criteria import DEFAULT_CRITERIA, Criteria
from signlin_ros.diagnosis.dataset import Dataset
from signlin_ros.diagnosis.equation_error.estimate import (
    LATE_SENSOR,
    EquationErrorResult,
    estimate_equation_error,
)
from signlin_ros.diagnosis.equation_error.regression import RegressionFit
from signlin_ros.diagnosis.input_hold import asks_hold, with_hold
from signlin_ros.diagnosis.output_error import FitCache, FittedModel, OutputErrorEstimator, estimator_of
from signlin_ros.diagnosis.progress import Progress
from signlin_ros.diagnosis.wording import phrases
from signlin_ros.effects import EFFECTS, find_effect
from signlin_ros.effects.base import Effect, SensorEffect
from signlin_ros.threads import one_thread

Array = NDArray[np.float64]
WHOLE_EFFORT = 100.0
"""All of the effort, in per cent of it."""


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
        given, fitted = (self.force_mse_as_written(f) for f in (motion.unfitted, motion.base))
        if force is None or not force.effects or given is None or fitted is None:
            return self
        near_noise = force.leaves_noise or motion.base.within_noise(self.criteria.min_force_over_noise)
        surely_more = BlockChange(given, fitted).t_ratio <= -self.criteria.min_t
        if (self.percent_of_effort(fitted) or 0.0) <= WHOLE_EFFORT or near_noise or not surely_more:
            return self
        of_force = force.with_laws(force.fit)
        values = {n: of_force.value(n) for n in force.regression.names if n in of_force.parameters}
        found = Evidence(self.dataset, motion.holding(values, motion.progress), force, motion.base, motion)
        held = found.force_mse_as_written(found.base)
        if held is not None and np.mean(held) > np.mean(given):
            return replace(found, output_error=found.output_error.referring_to_given())
        return found

    @property
    def criteria(self) -> Criteria:
        """What decides."""
        return self.output_error.criteria

    @property
    def base(self) -> FittedModel:
        """The best fit of the model as given; of `grounded` evidence with parameters held at what the forces tell."""
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
        """Return the effects that act on the force: a late sensor whose signals were lined up does not, nor do those of
        the voltage where the current is measured.
        """
        current = self.equation_error is not None and self.equation_error.regression.current
        acting = frozenset(f.effects) - self.lined_up(f)
        if not current:
            return acting
        effects = {name: find_effect(name, "effects") for name in acting}
        return frozenset(
            name
            for name, effect in effects.items()
            if _has(effect, "force", "torque_constant") or not _has(effect, "input", "delay")
        )

    def lined_up(self, f: FittedModel) -> frozenset[str]:
        """Return the late sensor of a model, if forces were read from signals that were brought to one time."""
        if self.equation_error is None or LATE_SENSOR not in f.effects or not self.equation_error.late:
            return frozenset()
        uses = [use.parameters for use in f.model.effects.values() if use.type == LATE_SENSOR]
        own = {name for use in uses for name, value in use.items() if value}
        return frozenset({LATE_SENSOR}) if own <= self.equation_error.late.keys() else frozenset()

    def force_comparable(self, f: FittedModel, beside: Collection[str] = ()) -> bool:
        """Tell whether the force that a model leaves can be compared with the base model's, but for effects ``beside``
        which it is compared. It cannot where

        - one of its effects changes a sensor, a motor's constants or the time of the effort (`changes_effort`), unless
          it changes the input, or has a load that floats (`Effect.floating`);
        - the motion leaves a white residual, and that is owed to an effect that no force shows (but of the input), or
          the forces lack nothing (`force_finds_nothing`);
        - one of its waves is beyond the band in which forces are compared;
        - its forces depend on a position that was not measured.
        """
        if self.equation_error is None:
            return False
        acting = {name: find_effect(name, "effects") for name in self.effects_in_force(f) if name not in beside}
        effects = acting.values()
        if any((changes_effort(e) and not _has(e, "input")) or e.floating for e in effects):
            return False
        shown = {name for name, effect in acting.items() if _has(effect, "input")}
        hidden = self.unseen_by_force - shown - self.lined_up(f)
        if f.effects and f.white and (set(f.effects) & hidden or self.force_finds_nothing):
            return False
        of_waves = [effect for effect in effects if effect.periodic or effect.several]
        waves = [1.0 for effect in effects if effect.angular and effect not in of_waves]  # a weight is one of order one
        waves += _orders(f) if of_waves else []
        if max(waves, default=0.0) > self.equation_error.waves.finest:
            return False
        pieces = self.equation_error.training.pieces
        return pieces[0].position_measured or not force_equations(f.model.structure).placed

    def force_mse_as_written(self, f: FittedModel) -> Array | None:
        """Return the mean squared force residual (blocks,) of a model with its own values; None: not comparable."""
        if self.equation_error is None or not self.force_comparable(f):
            return None
        known = self.cache.force_mse
        if f not in known:
            known[f] = self.equation_error.mse_as_written(f.model)
        return known[f]

    def force_mse_delayed(self, f: FittedModel) -> Array | None:
        """Return the same (blocks,) of a model with delays of the input, which no force shows: with inputs that come so
        much later, without these; None where it has none, or is not comparable for something else.
        """
        delays = {n for n in self.effects_in_force(f) if _has(find_effect(n, "effects"), "delay")}
        known = not self.dataset.plant.motion_is_imposed() and self.force_comparable(f, delays)
        if self.equation_error is None or not delays or not known:
            return None
        model = f.model.without_effect(*(k for k, use in f.added.items() if use.type in delays))
        return self.equation_error.mse_with_later_inputs(model, f.model.delay - model.delay)

    def force_mse(self, f: FittedModel) -> Array | None:
        """Return the same (blocks,) with the parameters of the output or the equation error, whichever leave less; of a
        model with a late sensor as written: that must follow the motion late, and leave no more of a force that is not.
        """
        left = self.force_mse_as_written(f)
        if left is None or self.equation_error is None or self.lined_up(f):
            return left
        fit = self.equation_error.sets.get(self.effects_in_force(f))
        if fit is None or fit.validation_mse >= float(np.mean(left)):
            return left
        return self.equation_error.validation.mse_by_block(fit.validation_residual)

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
    def visible_force_mse(self) -> float:
        """Mean square from which on a force residual is seen above that noise; inf without equation error."""
        return np.inf if self.equation_error is None else self.equation_error.regression.visible_mse

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
        return left is not None and float(np.mean(left)) > self.visible_force_mse

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

    def force_change(self, before: FittedModel, after: FittedModel) -> BlockChange | None:
        """Return how the force residual changes between two models; None where it cannot be compared."""
        left_before, left_after = self.force_mse(before), self.force_mse(after)
        return None if left_before is None or left_after is None else BlockChange(left_before, left_after)

    def force_falls(self, before: FittedModel, after: FittedModel) -> bool:
        """Tell whether the force residual surely falls between two models; true where it cannot be compared."""
        change = self.force_change(before, after)
        return change is None or change.t_ratio >= self.criteria.min_t

    def force_rises(self, before: FittedModel, after: FittedModel) -> bool:
        """Tell whether the force residual surely rises between two models, so that it shows, above the noise."""
        change, c = self.force_change(before, after), self.criteria
        if change is None or not change.rise_shows(c.visible_change) or np.mean(change.after) <= self.force_noise_mse:
            return False
        return change.t_ratio < -c.tie_t

    def with_better_values(self, f: FittedModel) -> FittedModel:
        """Return the best model with the same effects: with the parameters of the output error, or of the equation
        error where these surely leave less force, less of both measures together, and no channel errs more. Near the
        sensors' noise the output error is right.
        """
        force, other = self.equation_error, self.output_error.best(f)
        if force is None or self.near_noise(other) or not (f.effects and self.force_comparable(f)):
            return other

        def both(f: FittedModel) -> float:
            return f.log_mse + float(np.log(np.mean(force.mse_as_written(f.model)) + MIN_DIVISOR))

        before = min(f, other, key=both)
        fit = force.sets.get(frozenset(before.effects) - self.lined_up(before))
        after = self.output_error.at_values_of(*force.stated(fit, before.model)) if fit else None
        if after is None:
            return before
        change = BlockChange(force.mse_as_written(before.model), force.mse_as_written(after.model))
        if change.t_ratio < self.criteria.min_t or self.rising_channel(before, after, self.criteria.tie_t):
            return before
        if any(after.together_t(key) < self.criteria.min_coefficient_t for key in after.added):
            return before
        return min(before, after, key=both)

    # ------------------------------------------------------------ the motion that a model leaves

    def rising_channel(self, before: FittedModel, after: FittedModel, times: float) -> str:
        """Return the channel whose printed error rises between models, by so many standard errors; empty if none."""
        changes = map(BlockChange, before.validation_squares.T, after.validation_squares.T)
        named, visible = zip(self.dataset.training.channels, changes, strict=True), self.criteria.visible_change
        return next((name for name, change in named if change.rise_shows(visible) and change.mean_rise_t > times), "")

    def residual_is_white(self, f: FittedModel) -> bool:
        """Tell whether no test finds structure in the residual, tested or not (`FittedModel.residual_is_noise` asks for
        enough samples, too); of a load that floats and is held by a filter, the windowed error must be near the noise.
        """
        return f.white and (not f.floats or self.near_noise(f))

    def near_noise(self, f: FittedModel) -> bool:
        """Tell whether a model predicts every channel to about its sensor's noise: completeness can be tested there."""
        return f.within_noise(self.criteria.max_rmse_over_noise)

    def near_any_noise(self, f: FittedModel) -> bool:
        """Tell whether a model is near the sensors' noise, or leaves noise and errs by about as much over the horizon,
        of known and of validation data: what is missing gathers, noise does not.
        """
        if self.near_noise(f):
            return True
        if not f.residual_is_noise or f.floats:
            return False
        times = self.criteria.max_rmse_over_noise * np.maximum([test.over_noise for test in f.residual_tests], 1.0)
        training, validation = self.dataset.training, self.dataset.validation
        near = f.training_rmse < times * training.noise
        return bool(np.all(near) and np.all(f.validation_rmse < times * validation.noise))

    def explains_to_noise(self, f: FittedModel) -> bool:
        """Tell whether a model's residual is noise over windows too, with no base parameter far from nominal."""
        return self.near_any_noise(f) and f.residual_is_noise and not f.far_from_nominal(self.criteria)

    def needs_no_search(self, f: FittedModel) -> bool:
        """Tell whether a model has one law at most and leaves only noise: then no other law is fitted."""
        return len(f.effects) < 2 and self.explains_to_noise(f)

    def unidentified(self, beside: FittedModel) -> dict[str, str]:
        """Return the single laws that leave only noise, and why the records do not identify them all the same; of those
        that another model surely beats on validation data none: noise that is allowed for hides what they leave.
        """
        least = self.criteria.min_t
        fits = [f for f in self.single_effect_fits if self.explains_to_noise(f)]
        fits = [f for f in fits if self.output_error.t_ratio(f, beside) < least]
        return {f.effects[0]: why for f in fits if (why := self.output_error.not_identifiable(f))}


def evidence_of(
    dataset: Dataset, criteria: Criteria, cache: FitCache, progress: Progress, jobs: int | None = None
) -> Evidence:
    """Return both estimates of a data set, its inputs acting as the records show where the model leaves that to them;
    fits go into the ``cache``, those with inputs that act otherwise into one of their own.
    """
    return evidence_beside(dataset, estimator_of(dataset.training, dataset.validation, criteria, cache, progress, jobs))


def evidence_beside(dataset: Dataset, motion: OutputErrorEstimator) -> Evidence:
    """Return the same of a data set whose base is fitted already, by the output-error estimate ``motion``."""
    criteria, progress = motion.criteria, motion.progress
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


def _orders(f: FittedModel) -> list[float]:
    """Return the orders of the waves of a model."""
    return [N for use in f.model.effects.values() for N, _, _ in find_effect(use.type, "effects").waves(use.parameters)]


__all__ = [
    "Evidence",
    "changes_effort",
    "equation_error_of",
    "evidence_beside",
    "evidence_of",
    "refitted_evidence",
]
