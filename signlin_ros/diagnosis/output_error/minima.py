"""From a fit to the lowest minimum that leads on from it: over the observer gains, to points nearby, and by way of the
smaller models that it contains.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from operator import attrgetter
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from signlin_ros.diagnosis.criteria import Criteria
from signlin_ros.diagnosis.output_error.cache import FitCache
from signlin_ros.diagnosis.output_error.decisions import Decisions
from signlin_ros.diagnosis.output_error.fitted import FittedModel, coordinates_of, covariances, estimates
from signlin_ros.diagnosis.output_error.fitting import (
    MIDDLE_STEPS,
    Minimum,
    cheapest,
    fit_over_gains,
    likelihood_t,
    window_squares,
)
from signlin_ros.diagnosis.output_error.residual import residual_tests
from signlin_ros.diagnosis.output_error.score import log_mse
from signlin_ros.diagnosis.output_error.trials import CandidateParts, completed
from signlin_ros.diagnosis.progress import Progress
from signlin_ros.effects import EFFECTS
from signlin_ros.fitting.candidate import Candidate
from signlin_ros.fitting.fit import Fit, fit, with_positive_amplitudes
from signlin_ros.fitting.problem import Problem
from signlin_ros.threads import side_by_side

Array = NDArray[np.float64]
T = TypeVar("T")
R = TypeVar("R")


@dataclass(frozen=True, eq=False)
class Minima(Decisions):
    """The best fit known of every set of effects, and how a new fit is carried on to the lowest minimum near it.

    ``training``, ``validation``: both data, prepared; ``short``: what is fitted to, segments where records are long;
    ``cache``: the memo of all fits; ``jobs``: threads.
    """

    training: Problem
    validation: Problem
    short: Problem
    criteria: Criteria
    cache: FitCache
    progress: Progress = field(default_factory=Progress)
    jobs: int = 1

    def in_parallel(self, do: Callable[[T], R], items: Sequence[T]) -> list[R]:
        """Return the results of a function for each item, computed by ``jobs`` threads."""
        return side_by_side(do, items, self.jobs)

    @property
    def base(self) -> FittedModel:
        """The best fit of the model as given."""
        return self.cache.best[()]

    def best(self, f: FittedModel) -> FittedModel:
        """Return the best fit known of a model's effects; it may change when other models are fitted."""
        return self.cache.best[f.kind]

    def _over_gains(self, c: Candidate, *starts: Array | None) -> Minimum | None:
        """Return `fit_over_gains` of a candidate on the training data."""
        return fit_over_gains(self.short, c, starts, self.progress.check)

    def _keep(self, found: Minimum) -> FittedModel:
        """Put a fit into the cache if it is the best of its effects, and return the best one."""
        mine = self._fitted_model(found.fit, found.low)
        known = self.cache.best.get(mine.kind)
        if known is None or self._preferred(mine, known):
            self.cache.best[mine.kind] = mine
            self.progress.seen(mine)
        return self.cache.best[mine.kind]

    def _fitted_model(self, f: Fit, low: Fit) -> FittedModel:
        """Return the fitted model of a fit: errors by `window_squares`, residual tests of the fit ``low``."""
        f = with_positive_amplitudes(f)
        whole, errors, uses = CandidateParts.of(f).whole, covariances(self.short, f), f.candidate.model.effects
        coordinates = coordinates_of(f, errors)
        return FittedModel(
            tuple(uses[k].type if k in uses else k.partition(".")[0] for k in f.candidate.label),
            whole,
            estimates(self.training, whole, coordinates),
            *window_squares(self.training, self.validation, f.candidate, f.theta),
            self.validation.noise,
            f,
            coordinates,
            errors,
            functools.partial(residual_tests, self.short, low, self.criteria),
            functools.cache(functools.partial(likelihood_t, self.short, f, errors)),
        )

    def _errs_less(self, one: FittedModel, other: FittedModel) -> bool:
        """Tell whether a fit errs less than another one on the training data."""
        return log_mse(one.training_squares, self.training.noise) < log_mse(other.training_squares, self.training.noise)

    def _preferred(self, mine: FittedModel, known: FittedModel) -> bool:
        """Tell whether a fit takes the place of another of its class: it errs less on what both were fitted to, or has
        the values of a real thing, unlike that one, and errs not surely more.
        """
        noise = self.training.noise
        falls = log_mse(known.training_squares, noise) - log_mse(mine.training_squares, noise)
        real = bool(known.implausible) - bool(mine.implausible)
        return falls + real * self.criteria.min_t**2 / self.training.samples > 0.0

    def objective_nearby(self, c: Candidate, theta: Array) -> float:
        """Return -2 log likelihood of the training data a few steps from some coordinates; inf where it diverges."""
        f = fit(self.short, c, self.training.observer_gains[1], theta, MIDDLE_STEPS)
        return f.objective if f else np.inf

    def _held(self, c: Candidate, theta: Array, found: Minimum | None) -> Minimum | None:
        """Return a candidate fitted from given values with the quickest observer: a slower one lets a motion slip from
        one wave to the next. None where what was ``found`` without it is as good.
        """
        tried = (fit(self.short, c, self.training.observer_gains[0], theta, steps) for steps in (0, MIDDLE_STEPS))
        held = min((Minimum.of(self.short, f, f) for f in tried if f), key=attrgetter("log_mse"), default=None)
        if held is None or (found and found.log_mse <= held.log_mse):
            return None
        low = fit(self.short, c, self.training.observer_gains[-1], held.fit.theta, MIDDLE_STEPS)
        return replace(held, low=cheapest([low, found.low if found else None]) or held.fit)

    def _all_finished(self, of: FittedModel, fits: Sequence[Fit]) -> list[FittedModel]:
        """Return promising fits gone on with to the end, also from the base parameters of what they extend, and that
        one from where they arrived: each is then the best of its class. What is kept of one bears on the next, so that
        is done in order: no answer depends on which of several was done first.
        """

        def finished(f: Fit) -> Minimum | None:
            found = self._over_gains(f.candidate, f.theta, f.candidate.start({**f.parameters(), **of.fit.parameters()}))
            return self._descended(found) if found else None

        return [self._with_submodels(found) for found in self.in_parallel(finished, fits) if found]

    def _descended(self, found: Minimum) -> Minimum:
        """Return a fit, or a better one that its last effect leads to from near where it arrived, and so on."""
        f = found.fit
        key = next(reversed(f.candidate.label), "")
        use = f.fitted().effects.get(key)
        near = EFFECTS[use.type].nearby(use.parameters) if use else []
        if not use or not near:
            return found
        points = [completed(self.training, EFFECTS[use.type], p) for p in near]
        parts = CandidateParts.of(f).without(key)
        candidates = [parts.extended(use.type, point).candidate(self.training) for point in points]
        plain = {n: v for n, v in f.parameters().items() if not n.startswith(f"{key}.")}
        starts = [(c, c.start(plain)) for c in candidates]
        if not EFFECTS[use.type].plausible(use.parameters):
            return self._physical(found, starts)
        for gain in (1, 0):  # an observer that is slower loses what a wide motion remembers
            again = self._lower_minimum(f, starts, gain)
            if again and again.log_mse < found.log_mse:
                return self._descended(again)
        return found

    def _physical(self, found: Minimum, starts: Sequence[tuple[Candidate, Array]]) -> Minimum:
        """Return the best of some starts gone on with to the end, where that errs less than a fit, or not surely more
        with the values of a real thing: one law may imitate another with values that it has not.
        """
        every = [one for one in self.in_parallel(lambda start: self._over_gains(*start), starts) if one]
        best = min(every, key=attrgetter("log_mse"), default=found)
        use = best.fit.fitted().effects[next(reversed(best.fit.candidate.label))]
        margin = self.criteria.min_t**2 / self.short.samples
        real = EFFECTS[use.type].plausible(use.parameters)
        return best if best.log_mse < found.log_mse + (margin if real else 0.0) else found

    def _with_submodels(self, found: Minimum) -> FittedModel:
        """Keep a fit, and fit those that lack one of its effects from where it arrived, if that leads further down; and
        it from one of these that is better without the effect: a larger model follows what it was fitted to as well.
        """
        mine, c = self._keep(found), found.fit.candidate
        for other in list(self.cache.best.values()):
            one = other.fit.candidate
            if not set(one.label) < set(c.label) or len(c.label) != len(one.label) + 1:
                continue
            again = self._lower_minimum(other.fit, self._smaller(found.fit, one))
            best = self._keep(self._descended(again)) if again else other
            if self._errs_less(best, mine):
                better = self._lower_minimum(found.fit, [(c, c.as_without(best.fit.parameters(), best.kind))])
                mine = self._keep(self._descended(better)) if better else mine
        return mine

    def _smaller(self, f: Fit, c: Candidate) -> list[tuple[Candidate, Array]]:
        """Return where a candidate that lacks one of a fit's effects starts from that fit: with its orders of waves,
        too, which are no coordinates.
        """
        points = [c]
        extra = [key for key in f.candidate.label if key not in c.label and key in f.candidate.model.effects]
        if any(EFFECTS[use.type].periodic for key, use in c.model.effects.items() if key in c.label):
            points += [CandidateParts.of(f).without(key).candidate(self.training) for key in extra]
        return [(one, one.start(f.parameters())) for one in points]

    def _lower_minimum(self, f: Fit, points: Sequence[tuple[Candidate, Array]], gain: int = 1) -> Minimum | None:
        """Return the best of some points gone on with to the end, if a few steps lead further down than from a fit;
        ``gain``: the number of the observer gain at which they are held against each other, 0 being the highest.
        """
        gains, starts = self.training.observer_gains[gain], [(f.candidate, f.theta), *points]
        here, *there = self.in_parallel(
            lambda one: fit(self.short, one[0].apart(), gains, one[1], MIDDLE_STEPS), starts
        )
        best = cheapest(there)
        if best is None or (here and best.objective > here.objective - 1.0):
            return None
        found = self._over_gains(best.candidate, best.theta)
        return found if gain else self._held(best.candidate, best.theta, found) or found


__all__ = ["Minima"]
