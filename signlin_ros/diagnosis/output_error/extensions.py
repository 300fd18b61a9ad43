"""One effect more beside a fit: from all its starts, wave by wave, in place of a richer law, or bred where it has many
local minima.
"""

from __future__ import annotations

import contextlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from operator import attrgetter

import numpy as np

from signlin_ros.diagnosis.output_error.evolution import evolved_fit
from signlin_ros.diagnosis.output_error.fitted import FittedModel
from signlin_ros.diagnosis.output_error.fitting import (
    FOLLOW_STEPS,
    MAX_STARTS,
    MIDDLE_STEPS,
    cheapest,
    multi_start_fit,
    screened,
)
from signlin_ros.diagnosis.output_error.minima import Minima
from signlin_ros.diagnosis.output_error.trials import (
    CandidateParts,
    Trial,
    completed,
    rescanned,
    too_flat,
    trial_of_one_more_wave,
    trials,
)
from signlin_ros.diagnosis.wording import phrases
from signlin_ros.effects import EFFECTS
from signlin_ros.errors import ModelError, SimulationError
from signlin_ros.fitting.candidate import Candidate
from signlin_ros.fitting.fit import Fit, evaluated, fit
from signlin_ros.fitting.gains import ObserverGains

EVOLUTIONS = 2
"""How often an effect of many local minima is sought from other starts, at most."""


@dataclass(frozen=True, eq=False)
class Extensions(Minima):
    """Fits with one effect more than another one; ``starts``: values by effect that the equation-error estimate found,
    one by one. Other fields: `Minima`.
    """

    starts: Mapping[str, Mapping[str, float]] = field(default_factory=dict)

    def _with(self, now: FittedModel, options: Sequence[Trial]) -> FittedModel:
        """Return a fit with one effect more, the best of some trials (of a sensor there is one for each channel)."""
        best = cheapest(self.in_parallel(lambda t: self._multi_start(now.fit, t), options))
        found = next(iter(self._all_finished(now, [best] if best else [])), None)
        if found is None:
            name = options[0].name
            raise SimulationError(phrases.diverges(self.training.base.source, name))
        return found

    def _multi_start(self, before: Fit, trial: Trial, few: int = MAX_STARTS, follow_steps: int = 0) -> Fit | None:
        self.progress.check()
        options = rescanned(self.short, trial, before)
        known = None if before.candidate.label else self.cache.started
        return multi_start_fit(self.short, before, options, few, follow_steps, known)

    def _from_all_starts(self, before: Fit, trial: Trial) -> Fit | None:
        """Return the best fit of one more effect from all its starts (some, where it has many minima), gone on with."""
        key = (*before.candidate.label, trial.name, trial.channel)
        if key not in self.cache.multi_start:
            self.cache.multi_start[key] = self._multi_start(
                before, trial, MAX_STARTS if trial.effect.rugged else len(trial.starts), FOLLOW_STEPS
            )
        return self.cache.multi_start[key]

    def extensions(
        self,
        of: FittedModel,
        names: Sequence[str] | None = None,
        rival: FittedModel | None = None,
        share: float | None = None,
    ) -> list[FittedModel]:
        """Return fits with one effect more, the promising ones fitted out, least error on validation data first; those
        that come near a ``rival`` that is as good. ``share``: from all starts, those of this share of the best's gain.
        """
        options = [self._from_equation_error(t) for t in trials(self.training, names) if t.name not in of.effects]
        self.cache.searched.setdefault(of.effects, set()).update(t.name for t in options)
        self.progress.say(phrases.extending(len(options), of.effects))
        climb = self._multi_start if share is None else self._from_all_starts
        fits = [f for f in self.in_parallel(lambda t: climb(of.fit, t), options) if f]
        kept = screened(self.short, of.fit, fits, rival.fit if rival else None, share)
        self.progress.say(phrases.finishing(len(kept)))
        found = self._all_finished(of, kept)
        if not names and found and not min(found, key=attrgetter("log_mse")).white:
            found += self._all_finished(of, self._richer(of, found, options))
        found += self._with_more_waves(of, found)
        found += self.simplified(*found)
        return sorted({one.kind: one for one in found}.values(), key=attrgetter("log_mse"))

    def _with_more_waves(self, of: FittedModel, found: Sequence[FittedModel]) -> list[FittedModel]:
        """Return fits of more waves over the position where one was found, wave by wave as long as that improves."""
        more, now = list[FittedModel](), [f for f in found if f.wave_orders]
        while now and not min((*found, *more), key=attrgetter("log_mse")).white:
            grown = [(f, trial) for f in now if (trial := trial_of_one_more_wave(self.training, f.fit))]
            fits = self.in_parallel(lambda pair: self._fit_of_one_more_wave(of, *pair), grown)
            ends = [self._all_finished(of, [fit] if fit else []) for fit in fits]
            pairs = [(f, one) for (f, _), end in zip(grown, ends, strict=True) for one in end]
            more += [one for _, one in pairs]
            now = [one for f, one in pairs if not self.refusal(f, one)]
        return more

    def _fit_of_one_more_wave(self, of: FittedModel, f: FittedModel, trial: Trial) -> Fit | None:
        """Return the best fit from the starts of a wave more, with the base parameters that there are without it; None
        where the waves of a turning axis are not whole numbers in a turn.
        """
        candidates = list[Candidate]()
        with contextlib.suppress(ModelError):
            parts = CandidateParts.of(of.fit)
            candidates += [parts.extended(trial.name, x).candidate(self.training) for x in trial.starts]
        known, middle = f.fit.parameters(), self.training.observer_gains[1]
        return cheapest(fit(self.short, c, middle, c.start(known), MIDDLE_STEPS) for c in candidates)

    def _from_equation_error(self, trial: Trial) -> Trial:
        """Return a trial that starts from what the equation-error estimate found of its effect, too."""
        values = self.starts.get(trial.name)
        if not values:
            return trial
        return replace(trial, starts=(completed(self.training, trial.effect, values), *trial.starts))

    def _richer(self, of: FittedModel, found: Sequence[FittedModel], options: Sequence[Trial]) -> list[Fit]:
        """Return fits of effects that extend others, from where these arrived."""
        jobs = []
        for use in (f.added[key] for f in found for key in f.fit.candidate.label[-1:] if key in f.added):
            for trial in options:
                after = [{**trial.starts[0], **p} for p in trial.effect.after(use.type, use.parameters)]
                starts = tuple(completed(self.training, trial.effect, p) for p in after)
                jobs += [replace(trial, starts=starts)] if starts else []
        return [f for f in self.in_parallel(lambda t: self._multi_start(of.fit, t, len(t.starts)), jobs) if f]

    def simplified(self, *fits: FittedModel) -> list[FittedModel]:
        """Return fits with the simpler law in place of one that cannot be told from it, or that is one for the values
        found; without it beside others where nothing tells it from nothing, or where the simpler law is there already.
        """
        fewer = [(c, c.start(f.fit.parameters())) for f in fits for c in self._simpler(f)]
        return [
            self._with_submodels(one) for one in self.in_parallel(lambda pair: self._over_gains(*pair), fewer) if one
        ]

    def _simpler(self, f: FittedModel) -> list[Candidate]:
        """Return the candidates that are simpler than a fit in one of its effects."""
        parts, found = CandidateParts.of(f.fit), list[CandidateParts]()
        for key, use in f.added.items():
            effect, insignificant = EFFECTS[use.type], f.insignificant_key(self.criteria) == key
            nothing = {n: 0.0 for n in effect.telling if insignificant and not effect.pars()[n].positive}
            rest, simpler = parts.without(key), effect.simpler(use.parameters | nothing)
            there = {one.type for other, one in f.added.items() if other != key}
            known = {n for n in simpler.keys() - there if not too_flat(self.training, EFFECTS[n])}
            fewer = [rest.extended(n, start) for n, start in simpler.items() if n in known]
            idle = insignificant or not there.isdisjoint(simpler)
            found += fewer or ([rest] if idle and len(f.effects) > 1 else [])
        return [one.candidate(self.training) for one in found]

    def evolved(
        self, of: FittedModel, names: Sequence[str] | None = None, rivals: Sequence[FittedModel] = ()
    ) -> list[FittedModel]:
        """Return fits with one effect more of many local minima, each from the best that its starts lead to; from
        others as well, while that leaves more than about the noise, and its innovations are less likely beside none of
        the ``rivals``. Beside what it contains it is not sought.
        """
        rugged = [t for t in trials(self.training, names) if t.effect.rugged]
        options = [t for t in rugged if not {t.name, *t.effect.contains} & set(of.effects)]
        self.progress.say(phrases.MANY_MINIMA)
        most, at_once = (self._least_objective(rivals, gains) for gains in self.training.observer_gains[1::-1])
        found = list[FittedModel]()
        for trial in options:
            for seed in range(1 if of.effects else EVOLUTIONS):
                f = evolved_fit(self.short, self.best(of).fit, trial, self.in_parallel, at_once, seed)
                found += (new := self._all_finished(of, [f] if f else []))
                if f is None or f.objective > most or not all(self._may_be_lower(one) for one in new):
                    break
        return list({one.kind: self.best(one) for one in found}.values())

    def _least_objective(self, fits: Sequence[FittedModel], gains: ObserverGains) -> float:
        """Return the least -2 log likelihood of some fits, as they are, with one observer."""
        seen = [evaluated(self.short, f.fit.candidate.apart(), f.fit.theta, gains, False) for f in fits]
        return min((f.objective for f in seen if f), default=np.inf)

    def _may_be_lower(self, f: FittedModel) -> bool:
        """Tell whether a fit with an effect of many minima errs by more than about the noise: others may be lower."""
        errors, times = f.training_rmse, self.criteria.max_rmse_over_noise
        near = f.within_noise(times) and bool(np.all(errors < times * self.training.noise))
        return is_rugged(f) and not near


def is_rugged(f: FittedModel) -> bool:
    """Tell whether a fit has an effect of many local minima."""
    return any(EFFECTS[n].rugged for n in f.effects)


__all__ = ["Extensions", "is_rugged"]
