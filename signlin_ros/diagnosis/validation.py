"""What validation data say of a model that both estimates arrived at: one test a method."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray

from signlin_ros.comparison.force_segment import ForceSegment, missing_force
from signlin_ros.comparison.scores import unfollowed
from signlin_ros.diagnosis.blocks import BlockChange
from signlin_ros.diagnosis.criteria import HALF, Criteria
from signlin_ros.diagnosis.dataset import Dataset
from signlin_ros.diagnosis.equation_error.flexible import Columns, Curve, changing
from signlin_ros.diagnosis.equation_error.regression import RegressionFit
from signlin_ros.diagnosis.evidence import Evidence
from signlin_ros.diagnosis.output_error import FittedModel, OutputErrorEstimator
from signlin_ros.diagnosis.output_error.score import improvement, of_windows
from signlin_ros.diagnosis.results import listed
from signlin_ros.diagnosis.rows import force_left, force_percent, row
from signlin_ros.diagnosis.wording import phrases
from signlin_ros.effects import find_effect
from signlin_ros.errors import InputError
from signlin_ros.fitting.prepare import reversed_signal
from signlin_ros.model import Model

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ValidationTests:
    """Tests of a model that both estimates arrived at: what validation data say of it, beside the base model.

    ``evidence``: what both estimates measure; ``final``: that model. A property measures, a method may fit.
    """

    evidence: Evidence
    final: FittedModel

    @property
    def dataset(self) -> Dataset:
        """The records."""
        return self.evidence.dataset

    @property
    def output_error(self) -> OutputErrorEstimator:
        """The output-error estimate."""
        return self.evidence.output_error

    @property
    def base(self) -> FittedModel:
        """The best fit of the model as given."""
        return self.evidence.base

    @property
    def criteria(self) -> Criteria:
        """What decides."""
        return self.evidence.criteria

    @property
    def names(self) -> tuple[str, ...]:
        """The effects that the model lacks."""
        return self.final.effects

    @cached_property
    def reversed(self) -> str:
        """The signal with whose sign reversed the model as given follows much better, if there is one."""
        return reversed_signal(self.output_error.training, self.base.fit, self.final.fit)

    @cached_property
    def far(self) -> dict[str, float]:
        """Base parameters that end far from nominal, and by how many tolerances."""
        return self.final.far_from_nominal(self.criteria)

    @property
    def overcompensates(self) -> bool:
        """Whether a base parameter is far from nominal on either side: on one with the effects, on the other without
        them. Then no value that it may have goes with them: a base term of the other sign is part of what they imitate.
        """
        before = self.base.far_from_nominal(self.criteria)
        return any(x * before.get(n, 0.0) < 0.0 for n, x in self.far.items())

    @property
    def holds_a_part(self) -> bool:
        """Whether nominal values hold a part of what is missing, as those do that were fitted without it: parameters
        that are far with the effects are not without them, and the motion shows about the sensors' noise beside the
        effects, which tests find to be noise, or the force too.
        """
        if self.far.keys() & self.base.far_from_nominal(self.criteria).keys():
            return False
        shows = not self.force_told or self.evidence.force_shows(self.final)
        return self.evidence.near_any_noise(self.final) and (self.final.residual_is_noise or not shows)

    def same_at_nominal(self) -> bool:
        """Tell whether it is confirmed with what is far held at nominal, beside the base held so, and at its best; of a
        model that leaves noise that fit begins with its values.
        """
        try:
            held = self.output_error.holding({name: self.output_error.training.base.value(name) for name in self.far})
            found = held.fitted(self.names, self.final.model if self.final.residual_is_noise else None)
        except InputError:
            return False
        return not held.refusal(held.base, found) and not self.output_error.refusal(self.base, found)

    @cached_property
    def percent(self) -> float | None:
        """Force that is left, in per cent of the effort."""
        return force_percent(self.evidence, self.final, self.final)

    @property
    def force_told(self) -> bool:
        """Whether forces tell of it without a shift of its input."""
        return self.percent is not None and self.evidence.force_mse(self.final) is not None

    @property
    def force_shows(self) -> bool:
        """Whether the force that it leaves is seen above the noise, of a delayed input with the input delayed."""
        return self.evidence.force_shows(self.final) or (self.percent is not None and not self.force_told)

    @cached_property
    def flexible(self) -> Curve:
        """What a flexible curve makes of the force that is left."""
        force = self.evidence.equation_error
        if force is None or not self.force_told:
            return Curve(False, np.inf)
        if self.evidence.effects_in_force(self.final) == set(force.effects):
            return force.flexible
        if not self.names:
            return force.structure_left(force.base)
        left, unseen = (side.force_residual(self.final.model) for side in (force.training, force.validation))
        return force.structure_left(RegressionFit((("final", ()),), np.zeros(0), left, lambda: unseen))

    @cached_property
    def changing(self) -> str:
        """Which force changes slowly along the records, if that is most of what is left; empty if none does."""
        force = self.evidence.equation_error
        if force is None or not self.force_told or self.final.white:
            return ""
        fit = force.sets.get(self.evidence.effects_in_force(self.final))
        left = fit.validation_residual if fit else force.validation.force_residual(self.final.model)
        return changing(force.regression, left, self._forces_of_loops())

    def _forces_of_loops(self) -> dict[str, Columns]:
        """Return the force (T,) along a piece of every effect that remembers the way, by ``loop of`` and its name."""

        def force(piece: ForceSegment, without: Model) -> Array:
            return missing_force(without, piece) - missing_force(self.final.model, piece)

        keys = {k: use.type for k, use in self.final.added.items() if use.type in self.final.remembers}
        without = {n: self.final.model.without_effect(k) for k, n in keys.items()}
        return {f"loop of {listed([n])}": partial(force, without=model) for n, model in without.items()}

    @cached_property
    def loop(self) -> str:
        """The hysteresis of a proposal that leaves more than a quarter of the force (RMS): one loop of its family."""
        least = max(
            100.0 * self.criteria.max_rmse_left, self.criteria.min_force_over_noise * self.evidence.force_noise_percent
        )
        own = [n for n in self.final.remembers if find_effect(n, "effects").family]
        return own[0] if own and max(self.percent or 0, self.imposed or 0) > least else ""

    def worse(self) -> str:
        """Return the channel whose printed error rises beyond its standard error beside the base, or the missing force;
        where the proposal's own is not told, that of a step on the way.
        """
        before, after, c = self.force_mse(self.base), self.force_mse(self.final), self.criteria
        if self.output_error.settles(self.base, self.final):
            return ""
        steps = self.steps()[1:-1] if after is None else ()
        after = next((left for f in reversed(steps) if (left := self.force_mse(f)) is not None), after)
        force = None if before is None or after is None else BlockChange(before, after)
        risen = force is not None and force.rise_shows(c.visible_change) and force.mean_rise_t > c.max_rise_t
        return self.evidence.rising_channel(self.base, self.final, c.max_rise_t) or (
            "the missing force" if risen else ""
        )

    @cached_property
    def beside_given(self) -> float:
        """By how many standard errors the proposal lowers the error on validation data beside the model as given."""
        return self.output_error.t_ratio(self.output_error.unfitted, self.final)

    @cached_property
    def no_better(self) -> bool:
        """Whether validation data do not surely show a gain beside the model as given: a refit may not carry over."""
        if self.beside_given > self.criteria.min_validation_t:
            return False
        given, final = (self.evidence.force_mse_as_written(f) for f in (self.output_error.unfitted, self.final))
        return given is None or final is None or BlockChange(given, final).t_ratio <= self.criteria.min_validation_t

    @cached_property
    def unfollowed(self) -> list[str]:
        """The channels that none of the models that were fitted follows, neither where it was fitted nor elsewhere."""
        known = self.output_error.training
        unseen = self.output_error.validation
        missed = set(self.output_error.training.channels)
        for f in (self.final, *self.evidence.cache.weighed):
            for side, squares in ((known, f.training_squares), (unseen, f.validation_squares)):
                missed &= set(unfollowed(of_windows(side, squares, side.noise)))
        return [name for name in known.channels if name in missed]

    @cached_property
    def generalizes_badly(self) -> bool:
        """Whether the model follows validation data far worse than those that it was fitted to: of its force, too."""
        force = self.evidence.equation_error
        if not self.output_error.generalizes_badly(self.final):
            return False
        if force is None or self.percent is None or not self.force_told:
            return True
        known = float(np.sqrt(np.mean(force.mse_as_written(self.final.model, known=True)))) / force.training.effort
        return 100.0 * known < HALF * self.percent

    @property
    def of_steps(self) -> bool:
        """Whether all that a proposal leaves are the steps that a sensor shows: within half of one, and found to follow
        from no function of the motion. While a motion creeps from step to step, that error goes on, and is no force.
        """
        if not self.names or not self.evidence.near_noise(self.final):
            return False
        sides = zip(self.final.residual_tests, self.dataset.training.noise, self.dataset.training.quanta, strict=True)
        odd = [(one, one.over_noise * noise, step) for one, noise, step in sides if one.structured]
        return all(rms <= step / 2.0 and one.dependent <= self.criteria.max_dependent_share for one, rms, step in odd)

    @property
    def follows(self) -> bool:
        """Whether every channel is predicted near its noise, or but for a small part of what it does: else no test of
        what is left shows that it is noise.
        """
        part = 100.0 * self.criteria.max_rmse_left
        return self.evidence.near_any_noise(self.final) or self.unpredicted <= part

    @property
    def leaves_little(self) -> bool:
        """Whether a proposal leaves no more, beside what the base model does, than a table shows: of the force, or of
        a channel and every one whose error is beyond about its noise.
        """
        if not self.names:
            return False
        c, small = self.criteria, self.criteria.visible_change
        beyond = self.final.validation_rmse > c.max_rmse_over_noise * self.output_error.validation.noise
        less = self.final.validation_rmse <= small * self.base.validation_rmse
        left, before = (self.force_mse(f) for f in (self.final, self.base))
        little = left is not None and before is not None and bool(np.mean(left) <= small**2 * np.mean(before))
        return little or bool(less.any() and np.all(less[beyond]))

    @property
    def explains_all_force(self) -> bool:
        """Whether a force that the base model lacks is above the noise, and what a proposal leaves of it is not."""
        return self.percent is not None and self.evidence.force_shows(self.base) and not self.force_shows

    def sampled(self) -> FittedModel | None:
        """Return the same model with inputs sampled from what goes on in between, where that is surely better."""
        model = self.final.model
        if not model.asks_hold or model.plant.motion_is_imposed() or self.evidence.near_noise(self.final):
            return None
        try:
            found = self.output_error.acting("centred").fitted(self.names, model.with_options(input_hold="centred"))
        except InputError:
            return None
        shows = np.any(found.validation_rmse < (1.0 - self.criteria.visible_change) * self.final.validation_rmse)
        return found if shows and self.output_error.t_ratio(self.final, found) >= self.criteria.min_t else None

    @property
    def of_noise(self) -> bool:
        """Whether the base errs by no more than the noise, and nothing falls visibly, nor is a parameter freed."""
        before, after = self.base.validation_rmse**2, self.final.validation_rmse**2
        visible = self.criteria.min_share_per_parameter * (self.final.n_parameters - self.base.n_parameters)
        within = np.all(before <= self.output_error.validation.noise**2)
        return bool(within and np.all(before - after < visible * before) and not freed(self.base, self.final))

    @property
    def within_noise(self) -> bool:
        """Whether no effect is named, and force and motion are within about the noise, or half a sensor's step; what
        follows from the motion is no noise, however small, unless that is imposed: then it is known with noise.
        """
        follows = self.depends_on_motion and not self.dataset.plant.motion_is_imposed()
        if self.names or self.percent is None or follows:
            return False
        evidence = self.evidence
        little = self.percent <= evidence.force_noise_percent and evidence.near_noise(self.final)
        return bool(little or (not evidence.force_shows(self.final) and self._errs_within_noise))

    @property
    def near_white_noise(self) -> bool:
        """Whether every channel errs by about its noise, and what is left is white. Where samples are too few to test
        that and nothing is named, twice the noise may be anything: then by no more than it, or half a sensor's step.
        """
        tested = bool(self.names) or self.final.residual_is_noise or self._errs_within_noise
        return self.evidence.near_noise(self.final) and self.final.white and tested

    @property
    def _errs_within_noise(self) -> bool:
        within = np.maximum(self.output_error.validation.noise, self.dataset.training.quanta / 2)
        return bool(np.all(self.final.validation_rmse <= within))

    @property
    def leaves_much_force(self) -> bool:
        """Whether a proposal leaves more than a quarter of the mean square of the missing force, half of its RMS."""
        part = self.evidence.share_left(self.force_mse(self.final))
        return bool(self.names) and part is not None and part > self.criteria.max_force_mse_left

    @property
    def depends_on_motion(self) -> bool:
        """Whether the residual of a channel follows from the model's own motion."""
        most = self.criteria.max_dependent_share
        return any(one.structured and one.dependent > most for one in self.final.residual_tests)

    @property
    def leaves_more_of_motion(self) -> bool:
        """Whether the force residual is a part of the effort that counts as missing, and the residual of a channel
        follows from the model's own motion: then some other law of the motion is missing.
        """
        return (self.percent or 0.0) > self.criteria.missing_percent and self.depends_on_motion

    @property
    def leaves_structured_channel(self) -> bool:
        """Whether the error of a channel, of which the residual has structure, is a part of its spread that counts as
        missing where no force is seen. Of a load that floats the place is not seen while the play is crossed, and what
        is left has the structure of that.
        """
        if self.percent is not None or self.final.floats:
            return False
        channels = zip(self._unpredicted_by_channel, self.final.residual_tests, strict=True)
        return any(part > self.criteria.missing_percent and one.structured for part, one in channels)

    @property
    def _unpredicted_by_channel(self) -> list[float]:
        """What is left of each channel in per cent of its spread; 0 where that is no more than about its noise."""
        scores = row(self.evidence, self.final, None).validation.channels.values()
        near = self.criteria.max_rmse_over_noise
        beyond = (s.rmse_over_noise is None or s.rmse_over_noise > near for s in scores)
        return [
            100.0 - s.fit_percent if far and s.fit_percent is not None else 0.0
            for far, s in zip(beyond, scores, strict=True)
        ]

    @property
    def unpredicted(self) -> float:
        """The largest part of a channel's spread that is left, in per cent, of channels that err by more than about
        their noise.
        """
        return max(self._unpredicted_by_channel, default=0.0)

    @cached_property
    def imposed(self) -> float | None:
        """What is left of the force of an imposed motion, where only its row tells, in per cent of its spread."""
        told = self.percent is not None and self.percent > self.evidence.force_noise_percent
        if told or not self.dataset.plant.motion_is_imposed():
            return None
        return self.unpredicted or None

    @property
    def leaves_most(self) -> bool:
        """Whether a model leaves more than half of the effort (RMS) beyond noise, or a proposal of an imposed force."""
        effort = 0.0 if self.percent is None else self.percent**2 - self.evidence.force_noise_percent**2
        imposed = (self.imposed or 0.0) ** 2 if self.names else 0.0
        return max(effort, imposed) > 100.0**2 * self.criteria.max_force_mse_left

    def has_idle_law(self) -> bool:
        """Tell whether one of several laws does not surely take away force, where forces tell of it."""
        evidence, several = self.evidence, self.names if len(self.names) > 1 else ()
        return not all(
            evidence.force_falls(self.without(n), self.final) for n in several if n not in evidence.unseen_by_force
        )

    @property
    def carries_over(self) -> bool:
        """Whether under no condition that was held out of a closed loop a proposal's error rises, beyond doubt and so
        that it shows, and no other law lowers it: one that imitates another fails under a gain or a load that no fit
        saw.
        """
        evidence, c, unseen = self.evidence, self.criteria, self.evidence.output_error.validation
        if not self.dataset.plant.closed_loop or not evidence.cache.searched.get(self.names):
            return False
        count, channels = len(unseen.segments), self.final.validation_squares.shape[1]
        before, after = (f.validation_squares.reshape(count, -1, channels) for f in (evidence.base, self.final))
        folds = unseen.folds or tuple((i,) for i in range(count))
        pairs = (tuple(one[list(fold)].reshape(-1, channels) for one in (before, after)) for fold in folds)
        return len(folds) > 1 and not any(improvement(a, b, unseen.noise).worsens(c) for a, b in pairs)

    @property
    def leaves_much_motion(self) -> bool:
        """Whether a proposal leaves more than a quarter of what every channel lacks; or takes away less than a quarter
        of what all of them lack together, where one errs by a part of its spread that counts as missing. Of validation
        data, or of known ones.
        """
        known = improvement(self.base.training_squares, self.final.training_squares, self.output_error.training.noise)
        gains, c = (known, self.output_error.improvement(self.base, self.final)), self.criteria
        large = self.unpredicted > c.missing_percent
        little = large and min(g.joint_reduction for g in gains) < c.max_force_mse_left
        return little or min(g.mse_reduction for g in gains) < 1.0 - c.max_force_mse_left

    def steps(self) -> tuple[FittedModel, ...]:
        """Return the models from the base to the proposal, one effect after the other."""
        steps, c = [self.base], self.criteria
        for k in range(1, len(self.names)):
            part = self._part(self.names[:k])
            if part.effects and not self.output_error.improvement(steps[-1], part).worsens(c):
                steps.append(part)
        return (*steps, *([self.final] if self.names else []))

    def without(self, effect: str) -> FittedModel:
        """Return the best fit without one effect of the proposal: what removing it costs."""
        return self._part([n for n in self.names if n != effect])

    def _part(self, names: Sequence[str]) -> FittedModel:
        """Return the best fit of some of the effects of the proposal; the base where it diverges without the others."""
        try:
            return self.output_error.fitted(names, self.final.model) if names else self.base
        except InputError:
            return self.base

    def force_mse(self, f: FittedModel) -> Array | None:
        """Return the mean squared force (blocks,) that a model leaves of validation data, see `force_left`."""
        return force_left(self.evidence, f, self.final)


def freed(before: FittedModel, after: FittedModel) -> str:
    """Return in words which base parameter is bent most without what was added, by a tolerance more; empty if none."""
    first, last = before.prior_deviations, after.prior_deviations
    most = max(first, key=lambda n: abs(first[n]) - abs(last.get(n, 0.0)), default="")
    if not most or abs(first[most]) <= abs(last.get(most, 0.0)) + 1.0:
        return ""
    return phrases.freed(most, first[most])


__all__ = ["ValidationTests", "freed"]
