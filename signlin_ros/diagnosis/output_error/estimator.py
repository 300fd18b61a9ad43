"""The output-error estimate: models simulated with an observer, fitted to training data, and their errors over windows
of validation data.
"""

from __future__ import annotations

import functools
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from operator import attrgetter

import numpy as np
from numpy.typing import NDArray

from signlin_ros.diagnosis.criteria import Criteria
from signlin_ros.diagnosis.output_error.cache import FitCache
from signlin_ros.diagnosis.output_error.extensions import Extensions, is_rugged
from signlin_ros.diagnosis.output_error.fitted import FittedModel
from signlin_ros.diagnosis.output_error.fitting import window_squares
from signlin_ros.diagnosis.output_error.trials import CandidateParts, trials, tryable
from signlin_ros.diagnosis.progress import Progress
from signlin_ros.diagnosis.wording import phrases
from signlin_ros.effects import EFFECTS
from signlin_ros.errors import SimulationError
from signlin_ros.fitting.candidate import Candidate, candidate
from signlin_ros.fitting.fit import fit
from signlin_ros.fitting.gains import linear_base
from signlin_ros.fitting.prepare import stretched
from signlin_ros.fitting.problem import Problem
from signlin_ros.follow.data import unit_asked
from signlin_ros.model import Model
from signlin_ros.model.numbers import numbers
from signlin_ros.scale import MAX_STEP_OVER_TIME_CONSTANT

BEAM = 2
"""How many single effects a search tries with every other one where none is enough by itself."""

Array = NDArray[np.float64]

MIN_RATE_SHARE, MAX_FOLLOWED_SHARE = 1e-6, 0.5
"""Share of the fastest rate that is none; error in shares of a channel's spread up to which the model follows it."""


@dataclass(frozen=True, eq=False)
class OutputErrorEstimator(Extensions):
    """Fits of a model, with effects added, to the training data, and their errors on the validation data.

    Four layers: `Decisions` says whether one fit improves on another, `Minima` keeps the best fit of every set of
    effects and carries new ones on to a minimum, `Extensions` fits one effect more, this class chooses what is fitted:
    some effects, or a search. ``base_unfitted``: the model as given, where the base has held parameters. The ``cache``
    holds the fit of the base model from the beginning (`estimator_of`). Other fields: `Extensions`, `Minima`.
    """

    base_unfitted: FittedModel | None = None

    def holding(self, values: Mapping[str, float], progress: Progress | None = None) -> OutputErrorEstimator:
        """Return the same estimate, of the same model as given, with parameters held."""
        base = self.training.base.with_parameters(values)
        held = base.with_options(frozen=tuple(dict.fromkeys((*base.frozen, *values))))
        known, unseen = (replace(side, base=held) for side in (self.training, self.validation))
        return replace(self._with_problems(known, unseen, progress), base_unfitted=self.unfitted)

    def acting(self, hold: str | float) -> OutputErrorEstimator:
        """Return the same estimate with inputs that act as a model's ``input_hold`` may say."""
        return self._with_problems(self.training.acting(hold), self.validation.acting(hold))

    def _with_problems(self, known: Problem, unseen: Problem, progress: Progress | None = None) -> OutputErrorEstimator:
        watched = progress or self.progress.without_seen()
        return estimator_of(known, unseen, self.criteria, FitCache(), watched, self.jobs)

    def referring_to_given(self) -> OutputErrorEstimator:
        """Return the same estimate with the model as given in the place of the fitted base."""
        base = self.without_fit(self.unfitted.model)
        return replace(self, cache=replace(self.cache, best={**self.cache.best, (): base}))

    # ------------------------------------------------------------ fits

    @property
    def own_values(self) -> dict[str, dict[str, float]]:
        """What records have of their own in the best fit of the model as given, by their sources: known elsewhere."""
        found = dict[str, dict[str, float]]()
        for one in self.base.coordinates:
            if one.k.record:
                found.setdefault(one.k.record, {})[one.k.parameter] = one.k.value(one.x)
        return found

    @functools.cached_property
    def unfitted(self) -> FittedModel:
        """The model as given."""
        return self.base_unfitted or self.without_fit(self.training.base)

    @functools.cached_property
    def candidates(self) -> frozenset[str]:
        """The effects that can be tried by themselves on these records."""
        return frozenset(n for n in EFFECTS if tryable(self.training, n))

    def fitted(self, effects: Sequence[str], start: Model | None = None) -> FittedModel:
        """Return the best fit of these effects beside the base parameters: from the values of ``start``, if it has all
        of them; else from those that a scan finds, one effect after the other, each from what ``start`` has of it.
        """
        asked = (tuple(effects), start)
        known = next((f for one, f in self.cache.asked if one == asked), None)
        if known:
            return self.best(known)
        has = {use.type for use in start.effects.values()} if start else set()
        found = self._fitted_from_values(effects, start) if start and set(effects) <= has else None
        of_waves = any(EFFECTS[name].several for name in effects)
        if found is None or of_waves:  # which waves there are, forces below a band may not tell
            scanned = self._fitted_one_by_one(effects, None if of_waves else start)
            found = min([scanned, *([found] if found else [])], key=attrgetter("log_mse"))
        self.cache.asked.append((asked, found))
        return found

    def _fitted_one_by_one(self, effects: Sequence[str], start: Model | None) -> FittedModel:
        """Return the best fit of effects, one after the other, each from what ``start`` has of it, or from a scan."""
        found = self.base
        for name in effects:
            waves = self._fitted_wave_by_wave(found, name)
            options = [t.starting_from(self.training, start) for t in trials(self.training, [name])]
            found = min(waves, key=attrgetter("log_mse")) if waves else self._with(found, options)
        return found

    def _fitted_wave_by_wave(self, of: FittedModel, name: str) -> list[FittedModel]:
        """Return fits of several waves over the position, begun with the best single one; none of another effect."""
        effect = EFFECTS[name]
        single = [n for n, e in EFFECTS.items() if effect.several and e.periodic and e.family == effect.family]
        return self._with_more_waves(of, [self._with(of, trials(self.training, single))]) if single else []

    def at_values_of(self, effects: Sequence[str], model: Model) -> FittedModel | None:
        """Return effects with the values that a model has of them, and of its base parameters, as they are."""
        c, theta = self.candidate_at(effects, model)
        f = fit(self.short, c, self.training.observer_gains[0], theta, 0)
        return self._fitted_model(f, f) if f else None

    def without_fit(self, model: Model, effects: tuple[str, ...] = ()) -> FittedModel:
        """Return a model of the same states as the one given as it is: nothing is fitted; `window_squares`."""
        c = candidate(replace(self.training, base=model), model, ())
        squares, unseen = window_squares(self.training, self.validation, c, c.start(), as_it_is=True)
        return replace(self.base, effects=effects, model=model, training_squares=squares, validation_squares=unseen)

    def _fitted_from_values(self, effects: Sequence[str], start: Model) -> FittedModel | None:
        """Return the fit of effects from the values of a model that has them all, its base parameters too."""
        if not effects:
            return self.base
        c, theta = self.candidate_at(effects, start)
        found = self._over_gains(c, None, theta)
        best = self._held(c, theta, found) or found
        return self._with_submodels(self._descended(best)) if best else None

    def fitted_from(
        self, effects: Sequence[str], starts: Sequence[Model], within: Mapping[str, tuple[float, float]] | None = None
    ) -> FittedModel | None:
        """Return the best fit of effects from the values of models that have them all; None where it diverges.

        ``within``: the least and the largest value by parameter; such a fit is not the best of its class, nor kept.
        """
        c, _ = self.candidate_at(effects, starts[0])
        if within:
            sides = {k.name: within.get(k.name, (-np.inf, np.inf)) for k in c.coordinates}
            bounded = tuple(k.within(*sides[k.name]) for k in c.coordinates)
            c = replace(c.apart(), coordinates=bounded)
        thetas = [np.clip(c.start(numbers(m)), *c.bounds) for m in starts]
        found = self._over_gains(c, *thetas)
        if found is None or within:
            return self._fitted_model(found.fit, found.low) if found else None
        return self._with_submodels(self._descended(self._held(c, thetas[0], found) or found))

    def candidate_at(self, effects: Sequence[str], start: Model) -> tuple[Candidate, Array]:
        """Return the candidate with some effects, and its coordinates with the values of a model that has them all."""
        parts = CandidateParts.of(self.base.fit)
        for name in effects:
            options = trials(self.training, [name])
            trial = next((t for t in options if t.values(start)), options[0]).starting_from(self.training, start)
            parts = parts.extended(name, trial.starts[0])
        c = parts.candidate(self.training)
        return c, c.start(numbers(start))

    # ------------------------------------------------------------ one effect after the other

    def search(
        self,
        depth: int,
        names: Callable[[FittedModel], Sequence[str] | None] = lambda _: None,
        single: Callable[[FittedModel], FittedModel | None] = lambda _: None,
    ) -> list[list[FittedModel]]:
        """Return the steps from the base to what is proposed: of each what was taken, then the other options, least
        error first. The first is the base; the last holds what was tried in vain too. ``names``: what is tried beside a
        fit, None for all; ``single`` finds the one effect that is enough where the first step leaves more than noise.
        """
        now = self.base
        path = [[now]]
        while len(now.effects) < depth and (len(path) == 1 or not now.white):
            options = self.extensions(now, names(now))
            alike = self.as_good_as_best(now, options)
            if len(path) == 1 and not (alike and alike[0].white) and (whole := single(alike[0] if alike else now)):
                return [path[0], [whole, *options]]
            if not (now.white or (alike and alike[0].white)) or (alike and self._may_be_lower(alike[0])):
                options += self.evolved(now, names(now), [one for one in (now, *options) if not is_rugged(one)])
                alike = self.as_good_as_best(now, options)
            if not alike and depth > 1 and not (now.white or now.effects):
                options += [two for one in options[:BEAM] for two in self.extensions(one, names(one))]
                options = [*{one.kind: self.best(one) for one in options}.values()]  # a larger one may show the way
                alike = self.as_good_as_best(now, options)
            if not alike:
                path[-1] += [one for one in options if one not in path[-1]]
                break
            now = alike[0]
            path.append([now, *(one for one in options if one is not now)])
        path[0][0] = self.best(path[0][0])
        return path


def estimator_of(
    problem: Problem,
    unseen: Problem,
    criteria: Criteria,
    cache: FitCache,
    progress: Progress | None = None,
    jobs: int | None = None,
) -> OutputErrorEstimator:
    """Fit the base model into a cache, and return the estimator of what may be added to it.

    ``problem``, ``unseen``: training and validation data, prepared; ``jobs``: threads, 2 by default.
    Raises `SimulationError` where the base model diverges on the training data.
    """
    watched = progress or Progress()
    threads = jobs or min(os.cpu_count() or 1, 2)
    found = OutputErrorEstimator(problem, unseen, stretched(problem), criteria, cache, watched, threads)
    watched.say(phrases.BASE_MODEL)
    base = found._over_gains(candidate(problem, problem.base, ()), None)
    if base is None:
        raise _useless(problem, "diverges on")
    found._keep(base)
    if _over_between_samples(problem, found.base):
        raise _useless(problem, "does not follow")
    return found


def _useless(problem: Problem, what: str) -> SimulationError:
    """Return what is told where the base model says nothing of its records."""
    step = problem.scale.step
    apart = f"the model {what} these records: the samples are {step:.3g} s apart{unit_asked(step)}"
    return SimulationError(f"{problem.base.source}: {apart}")


def _over_between_samples(problem: Problem, base: FittedModel) -> bool:
    """Tell whether even the model's slowest motion is over between two samples, and the model, which then goes from
    rest to rest, follows no channel.
    """
    rates = -np.linalg.eigvals(linear_base(problem.base, problem.channels)[1]).real
    decays = rates[rates > MIN_RATE_SHARE * np.abs(rates).max(initial=0.0)]
    step = problem.scale.step
    if not (unit_asked(step) and decays.size and step * decays.min() >= MAX_STEP_OVER_TIME_CONSTANT):
        return False
    spread = np.nanstd(np.concatenate([s.y for s in problem.segments]), axis=0)
    return bool(np.all(base.training_rmse > MAX_FOLLOWED_SHARE * spread))


__all__ = ["OutputErrorEstimator", "estimator_of"]
