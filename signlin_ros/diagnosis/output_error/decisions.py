"""Whether one fit of the output-error estimate improves on another: by the validation error, and by its parameters."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from itertools import compress
from operator import attrgetter

import numpy as np

from signlin_ros.comparison.equations import force_equations
from signlin_ros.diagnosis.criteria import HALF, Criteria
from signlin_ros.diagnosis.output_error.cache import FitCache
from signlin_ros.diagnosis.output_error.fitted import FittedModel
from signlin_ros.diagnosis.output_error.score import (
    Improvement,
    beyond_noise,
    generalizes_badly,
    improvement,
)
from signlin_ros.diagnosis.output_error.swinging import undriven_shares
from signlin_ros.diagnosis.wording import phrases
from signlin_ros.effects import EFFECTS, kin_of
from signlin_ros.fitting.problem import Problem

SLOWEST_SHARE = 0.1
"""Part of the samples, the slowest, in which a wave over the position must pass in no less than two samples."""


class Decisions:
    """Comparisons of fitted models on training and validation data, by some criteria."""

    training: Problem
    validation: Problem
    criteria: Criteria
    cache: FitCache

    def best(self, f: FittedModel) -> FittedModel:
        """Return the best fit known of a model's set of effects; it may be better than the one given, and change."""
        raise NotImplementedError

    def improvement(self, before: FittedModel, after: FittedModel) -> Improvement:
        """Return the improvement from one model to another on validation data."""
        return improvement(self.best(before).validation_squares, after.validation_squares, self.validation.noise)

    def t_ratio(self, before: FittedModel, after: FittedModel) -> float:
        """Return by how many standard errors a model lowers the error on validation data: those of a mean over blocks.
        Where the model leaves nothing but tested noise, they may be those of that noise (`beyond_noise`), with training
        data counted, too: what acts only once is in few blocks. Not so of a free run in a closed loop: where a servo
        stands still its encoder's error is one and the same, which is no noise.
        """
        c, known, unseen = self.criteria, self.training, self.validation
        blocks = improvement(before.validation_squares, after.validation_squares, unseen.noise).t_ratio
        if (
            blocks > c.min_t
            or known.base.plant.closed_loop
            or after.log_mse > before.log_mse
            or not after.residual_is_noise
            or self.generalizes_badly(after)
        ):
            return blocks
        together = np.array([one.correlated_samples for one in after.residual_tests])
        first = beyond_noise(before.training_squares, after.training_squares, known.counts, together)
        second = beyond_noise(before.validation_squares, after.validation_squares, unseen.counts, together)
        return max(blocks, float(np.hypot(first, second))) if min(first, second) > c.min_validation_t else blocks

    def refusal(self, before: FittedModel, after: FittedModel) -> str:
        """Return why a model does not improve on another, in words; empty where it does.

        It must lower the validation error by `Criteria.min_t` standard errors. Their square gains what ``before`` needs
        more than ``after`` of squared tolerances (`FittedModel.prior_distance`): base parameters that were bent to
        imitate an effect come back with it. That does not count where one ends further off than before and far from
        nominal, or where the error visibly rises. Then no channel may rise, and what was added must be known.
        """
        c, before = self.criteria, self.best(before)
        g, certainty = self.improvement(before, after), self.t_ratio(before, after)
        was = before.far_from_nominal(c)
        further = any(abs(x) > abs(was.get(n, 0.0)) for n, x in after.far_from_nominal(c).items())
        rises = float(np.mean(np.log(g.rmse_ratios))) > c.visible_change
        freed = 0.0 if further or rises else max(before.prior_distance - after.prior_distance, 0.0)
        if certainty * abs(certainty) + freed < c.min_t**2:
            return phrases.change(certainty, c.min_t)
        risen = list(compress(self.validation.channels, g.worsened(c)))
        if risen and not self.settles(before, after):
            return phrases.channel_rises(risen[0])
        return after.insignificant(c) or self.not_identifiable(after)

    def settles(self, before: FittedModel, after: FittedModel) -> bool:
        """Tell whether ``after`` is the better one although the error of a channel rises: it leaves nothing but tested
        noise of the training data, where ``before`` leaves structure, errs less in all, and follows validation data as
        well as those. What it errs more by in a channel is then chance, or what its parameters are uncertain by.
        """
        better = after.log_mse < before.log_mse and not self.generalizes_badly(after)
        return better and after.residual_is_noise and not before.white

    def generalizes_badly(self, f: FittedModel) -> bool:
        """Tell whether a model follows validation data far worse than those that it was fitted to."""
        noise, most = (self.training.noise, self.validation.noise), self.criteria.max_rmse_over_noise
        return generalizes_badly(f.training_squares, f.validation_squares, *noise, most)

    def not_identifiable(self, f: FittedModel) -> str:
        """Return which force the records cannot identify, in words; empty where none.

        A limit that was always passed; a delay below what the instant of a sample is known to; a wave too fast for the
        samples; a load that the axis hardly moves; several waves of which the longest has not one period in the record,
        since their sum is any curve then; and, unless the residual is tested noise, a zero beyond the travel of an
        unmeasured position, a wave of too few periods, or one of whose phase nobody knows where each of several records
        begins.
        """
        for key, use in f.added.items():
            if not EFFECTS[use.type].is_met(use.parameters, *self.training.position_range):
                return phrases.beyond_limit(key)
        if late := self.unresolved(f):
            return late
        if quick := self._undersampled_wave(f):
            return quick
        if shaken := self._undriven(f) or self._undriven_without_play(f):
            return phrases.undriven(shaken)
        few = self.few_waves(f)
        any_curve = {k: n for k, n in few.items() if EFFECTS[f.added[k].type].several and n < self.criteria.min_turns}
        if f.residual_is_noise and f.within_noise(self.criteria.max_rmse_over_noise) and not any_curve:
            return ""
        too_few = next((phrases.few_waves(key, n) for key, n in few.items()), "")
        return self._beyond_travel(f) or too_few or self._phase_unknown(f)

    def _phase_unknown(self, f: FittedModel) -> str:
        """Return a wave over a position that was not measured, in words, of several records: where in its period a
        record begins is then as good as fitted to that record, and holds the machine there like anything that is late.
        """
        place = self.training.plant.position
        sources = {s.source for side in (self.training, self.validation) for s in side.segments}
        if place in self.training.channels or len(sources) < 2:
            return ""
        waves = (key for key, use in f.added.items() if EFFECTS[use.type].periodic or EFFECTS[use.type].several)
        return next((phrases.phase_unknown(key, place) for key in waves), "")

    def _undriven(self, f: FittedModel) -> str:
        """Return the load of which most of what it does is not what the motion makes of it; empty where none is."""
        if not any(EFFECTS[n].resonant for n in f.effects):
            return ""
        known = self.cache.undriven_shares
        if f not in known:
            known[f] = undriven_shares(self.training, f.fit)
        return next((key for key, share in known[f].items() if share > HALF), "")

    def _undriven_without_play(self, f: FittedModel) -> str:
        """Return the load with play that does not surely err less than such a one without."""
        for name in (n for n in f.effects if EFFECTS[n].floating):
            for held in EFFECTS[name].contains:
                simple = self.cache.best.get(tuple(sorted(held if k == name else k for k in f.kind)))
                if simple and self._undriven(simple) and self.t_ratio(simple, f) < self.criteria.min_t:
                    return name
        return ""

    def unresolved(self, f: FittedModel) -> str:
        """Return which effect is quicker than the samples can show, in words; empty where none is."""
        step = self.training.scale.step
        keys = (k for k, use in f.added.items() if not EFFECTS[use.type].is_resolved(use.parameters, step))
        return next((phrases.unresolved(key) for key in keys), "")

    def _beyond_travel(self, f: FittedModel) -> str:
        """Return where the zero of a force over an unmeasured position would be, in words, if no record goes there:
        any load is such a force.
        """
        problem, place = self.training, self.training.plant.position
        steady = bool(f.wave_orders)
        before, after = (force_equations(model.structure).placed for model in (problem.base, f.model))
        if steady or before or not after:
            return ""
        starts = [one.x for one in f.fit.candidate.starts.values() if place not in one.record.start]
        most = max((abs(float(x[f.model.states.index(place)])) for x in starts), default=0.0)
        way = max(float(np.ptp(one.position_range)) for one in (problem, self.validation))
        unit = problem.units.get(place, "")
        return phrases.zero_beyond_travel(place, most, way, problem.shown(unit)) if most > way else ""

    @functools.cached_property
    def _slow(self) -> float:
        """The speed in rad/s or m/s below which the slowest tenth of the samples is; 0 where none was measured."""
        plant, found = self.training.base.plant, []
        for part in self.training.parts:
            v, q = part.measured.get(plant.velocity), part.measured.get(plant.position)
            if v is None and q is not None and q.size > 1:
                v = np.gradient(q, part.t)
            found.append(np.abs(v[np.isfinite(v)]) if v is not None else np.zeros(1))
        every = np.concatenate(found) if found else np.zeros(0)
        return float(np.quantile(every, SLOWEST_SHARE)) if every.size else 0.0

    def _undersampled_wave(self, f: FittedModel) -> str:
        """Return which wave over the position is undersampled, in words; empty where none is."""
        step = self.training.scale.step
        quick = [key for key, order in f.wave_orders if order * self._slow * step > np.pi]
        return phrases.wave_too_fast(quick[0]) if quick else ""

    def few_waves(self, f: FittedModel) -> dict[str, float]:
        """Return how many periods the records hold of each periodic force of a model, of those of too few."""
        way = float(np.ptp(self.training.position_range))
        held = {key: order * way / (2 * np.pi) for key, order in sorted(f.wave_orders, reverse=True)}  # the least last
        return {key: waves for key, waves in held.items() if waves < self.criteria.min_periods}

    def as_good_as_best(self, before: FittedModel, options: Sequence[FittedModel]) -> list[FittedModel]:
        """Return the options that improve on ``before`` and are as good as the best of them, the simplest first.

        With them goes a simpler law of a family on which the richer one among them does not improve. Options with a
        base far from nominal are left out, unless there are no others.
        """
        good = [one for one in options if not self.refusal(before, one)]
        best = min(good, key=attrgetter("log_mse"), default=None)
        near = [one for one in good if best and self.as_good(best, one)]
        rest = [one for one in good if one not in near]
        near += [
            one for one in rest if any(_has_simpler_law(one, other) and self.refusal(one, other) for other in near)
        ]
        near = [one for one in near if not one.far_from_nominal(self.criteria)] or near
        return sorted(near, key=lambda f: (f.size, f.log_mse + f.prior_distance / self.validation.samples))

    def as_good(self, best: FittedModel, other: FittedModel) -> bool:
        """Tell whether a model is as good as the best: within a standard error, or what a table shows."""
        g = self.improvement(other, best)
        return other is best or g.t_ratio < self.criteria.tie_t or g.falls_by_less(self.criteria.visible_change)


def _has_simpler_law(one: FittedModel, other: FittedModel) -> bool:
    """Tell whether a model has a simpler law of the same family in the place of one of another model's."""
    mine, its = set(one.effects) - set(other.effects), set(other.effects) - set(one.effects)
    if len(mine) != 1 or len(its) != 1:
        return False
    return mine.pop() in kin_of(its.pop()) and one.n_parameters < other.n_parameters


__all__ = ["Decisions"]
