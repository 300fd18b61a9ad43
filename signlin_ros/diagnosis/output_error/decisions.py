"""Is one fit of the output-error estimate a step beyond another? By errors of validation data, and by its own
parameters.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from operator import attrgetter

import numpy as np

from signlin_ros.comparison.equations import depends_on_place
from signlin_ros.diagnosis.criteria import Criteria
from signlin_ros.diagnosis.output_error.fitted import FittedModel
from signlin_ros.diagnosis.output_error.score import Gain, beyond_noise, elsewhere, gain, told_change
from signlin_ros.effects import EFFECTS
from signlin_ros.fitting.problem import Problem

SLOWEST_SHARE = 0.1
"""Part of the samples, the slowest, in which a wave over the position must pass in no less than two samples."""


class Decisions:
    """What decides between fits of an estimate with `problem` (training data), `unseen` ones and `criteria`."""

    problem: Problem
    unseen: Problem
    criteria: Criteria

    def best(self, f: FittedModel) -> FittedModel:
        """Return the best fit of a model that is known by now."""
        raise NotImplementedError

    def gain(self, before: FittedModel, after: FittedModel) -> Gain:
        """Return the gain of one model beyond another on validation data."""
        return gain(self.best(before).validation_squares, after.validation_squares, self.unseen.noise)

    def certainty(self, before: FittedModel, after: FittedModel) -> float:
        """Return by how many standard errors a model lowers the error on validation data. Where it leaves but noise
        they are of noise, and training data count too: what acts for once is in few blocks. Not of a free run in a
        closed loop: where a servo stands still its encoder's error is one and the same, which is no noise.
        """
        c, known, unseen = self.criteria, self.problem, self.unseen
        blocks = gain(before.validation_squares, after.validation_squares, unseen.noise).certainty
        if blocks > c.min_t or known.base.plant.closed_loop or after.level > before.level or not after.clean:
            return blocks
        if elsewhere(
            after.training_squares, after.validation_squares, known.noise, unseen.noise, c.max_rmse_over_noise
        ):
            return blocks
        together = np.array([one.together for one in after.left])
        first = beyond_noise(before.training_squares, after.training_squares, known.counts, together)
        second = beyond_noise(before.validation_squares, after.validation_squares, unseen.counts, together)
        return max(blocks, float(np.hypot(first, second))) if min(first, second) > c.min_validation_t else blocks

    def refused(self, before: FittedModel, after: FittedModel) -> str:
        """Return why a model is no step beyond another, empty if it is one.

        Base parameters that were bent to imitate an effect, and are free with it, count as much as the error: both are
        squares of standard errors. Not where the error rises for it so that it shows.
        """
        c, before = self.criteria, self.best(before)
        g, certainty = self.gain(before, after), self.certainty(before, after)
        was = before.far(c)
        further = any(abs(x) > abs(was.get(n, 0.0)) for n, x in after.far(c).items())
        rises = float(np.mean(np.log(g.ratios))) > c.visible_change
        freed = 0.0 if further or rises else max(before.prior_distance - after.prior_distance, 0.0)
        if certainty * abs(certainty) + freed < c.min_t**2:
            return told_change(certainty, c.min_t)
        if g.worsens(c.max_rise_t, c.visible_change) and not self.settles(before, after):
            return "the error of a channel rises"
        return after.insignificant(c) or self._elsewhere(after)

    def settles(self, before: FittedModel, after: FittedModel) -> bool:
        """Tell whether a model leaves nothing but tested noise of the training data, where another does not, and
        follows validation data as well: by how much it errs more in a channel is then what its parameters are uncertain
        by, or chance, and speaks for neither.
        """
        noise = self.problem.noise, self.unseen.noise
        there = elsewhere(after.training_squares, after.validation_squares, *noise, self.criteria.max_rmse_over_noise)
        return after.clean and not before.white and not there and after.level < before.level

    def _elsewhere(self, f: FittedModel) -> str:
        """Return which force has no shape of its own where the records were: a limit that was always passed; unless all
        that is left was tested, and is its sensors' noise, also a zero beyond all that a motion of unknown place went
        through, or a wave of too few periods.
        """
        for key, use in f.added.items():
            if not EFFECTS[use.type].is_met(use.parameters, *self.problem.stretch):
                return f"the records lie all beyond {key}"
        if quick := self._quick(f):
            return quick
        if f.clean and f.near(self.criteria.max_rmse_over_noise):
            return ""
        few = self.few_waves(f)
        return self._away(f) or next((f"{key} has {n:.1f} waves in the record" for key, n in few.items()), "")

    def _away(self, f: FittedModel) -> str:
        """Return how far from its zero a force over a position that nobody measured starts, if records never go as
        far: any load is one then.
        """
        problem, place = self.problem, self.problem.plant.position
        steady = any(EFFECTS[use.type].periodic for use in f.added.values())
        if steady or depends_on_place(problem.base.structure) or not depends_on_place(f.model.structure):
            return ""
        starts = [one.x for one in f.fit.candidate.starts.values() if place not in one.record.start]
        most = max((abs(float(x[f.model.states.index(place)])) for x in starts), default=0.0)
        way, unit = max(float(np.ptp(one.stretch)) for one in (problem, self.unseen)), problem.units.get(place, "")
        told = (
            f"{place} was not measured: its zero would be {most:.3g} {problem.shown(unit)} from where a record starts"
        )
        return f"{told}, which goes {way:.3g}" if most > way else ""

    @functools.cached_property
    def _slow(self) -> float:
        """The speed in rad/s or m/s below which the slowest tenth of the samples is; 0 where none was measured."""
        plant, found = self.problem.base.plant, []
        for part in self.problem.parts:
            v, q = part.measured.get(plant.velocity), part.measured.get(plant.position)
            if v is None and q is not None and q.size > 1:
                v = np.gradient(q, part.t)
            found.append(np.abs(v[np.isfinite(v)]) if v is not None else np.zeros(1))
        every = np.concatenate(found) if found else np.zeros(0)
        return float(np.quantile(every, SLOWEST_SHARE)) if every.size else 0.0

    def _quick(self, f: FittedModel) -> str:
        """Return which wave over the position passes too fast for the samples: they show another one of it."""
        step = self.problem.scale.step
        orders = {k: use.parameters[n] for k, use in f.added.items() for n in EFFECTS[use.type].periodic[:1]}
        quick = [key for key, order in orders.items() if np.max(order) * self._slow * step > np.pi]
        return f"{quick[0]} passes a wave in less than two samples" if quick else ""

    def few_waves(self, f: FittedModel) -> dict[str, float]:
        """Return how many periods the records hold of each periodic force of a model, of those of too few."""
        way = float(np.ptp(self.problem.stretch))
        orders = {k: use.parameters[n] for k, use in f.added.items() for n in EFFECTS[use.type].periodic[:1]}
        held = {key: order * way / (2 * np.pi) for key, order in orders.items()}
        return {key: waves for key, waves in held.items() if waves < self.criteria.min_periods}

    def alike(self, before: FittedModel, options: Sequence[FittedModel]) -> list[FittedModel]:
        """Return the options that are a step beyond a model and as good as the best, the simplest first; with simpler
        laws beyond which a richer one of their family is no step; with a base far from nominal only if nothing else is.
        """
        good = [one for one in options if not self.refused(before, one)]
        best = min(good, key=attrgetter("level"), default=None)
        near = [one for one in good if best and self.as_good(best, one)]
        rest = [one for one in good if one not in near]
        near += [one for one in rest if any(_simpler(one, other) and self.refused(one, other) for other in near)]
        near = [one for one in near if not one.far(self.criteria)] or near
        return sorted(
            near, key=lambda one: (len(one.effects), one.size, one.level + one.prior_distance / self.unseen.samples)
        )

    def as_good(self, best: FittedModel, other: FittedModel) -> bool:
        """Tell whether a model is as good as the best: within a standard error, or what a table shows."""
        g = self.gain(other, best)
        alike = bool((g.ratios > 1.0 - self.criteria.visible_change).all())
        return other is best or g.certainty < self.criteria.tie_t or alike


def _simpler(one: FittedModel, other: FittedModel) -> bool:
    """Tell whether a model has a simpler law of the same family in the place of one of another model's."""
    mine, its = set(one.effects) - set(other.effects), set(other.effects) - set(one.effects)
    if len(mine) != 1 or len(its) != 1:
        return False
    family = EFFECTS[mine.pop()].family
    return bool(family) and family == EFFECTS[its.pop()].family and one.size < other.size


__all__ = ["Decisions"]
