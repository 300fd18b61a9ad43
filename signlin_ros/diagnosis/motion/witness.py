"""The motion witness: models simulated with an observer, fitted to known records, judged by windows of unseen ones."""

from __future__ import annotations

import functools
import os
from collections.abc import Callable, Collection, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from signlin_ros.diagnosis.criteria import Criteria
from signlin_ros.diagnosis.motion.deciding import Decisions
from signlin_ros.diagnosis.motion.fitted import Fitted, at_bound, covariances, estimates, largest, names_of, whole_model
from signlin_ros.diagnosis.motion.fitting import FEW, NEXT, Found, bred, climbed, settled, without
from signlin_ros.diagnosis.motion.left import left
from signlin_ros.diagnosis.motion.running import Progress, Running
from signlin_ros.diagnosis.motion.score import level, windowed
from signlin_ros.diagnosis.motion.trials import Parts, Trial, completed, extended, rescanned, trials
from signlin_ros.effects import EFFECTS
from signlin_ros.errors import SimulationError
from signlin_ros.fitting.candidate import Candidate, candidate
from signlin_ros.fitting.fit import Fit, fit, tidied
from signlin_ros.fitting.gains import Gains
from signlin_ros.fitting.prepare import prepared, stretched
from signlin_ros.fitting.problem import Problem
from signlin_ros.follow.data import unit_asked
from signlin_ros.model import Model
from signlin_ros.records import ModelData

SERIOUS, FIRST, FINISHED = 0.25, 3, 8
"""Share of the best candidate's gain that makes another one worth a thorough fit; how many get one in any case, and at
most."""

Array = NDArray[np.float64]


class Motion(Decisions, Running):
    """Fits of a model, with effects added, to the known records, and their errors on the unseen ones.

    ``problem``, ``unseen``: the records, prepared; ``short``: what is fitted to, stretches where records are long.
    ``heard``: values of effects that the force witness found, one by one. ``searched``: the effects that were tried on
    top of some others.
    """

    def __init__(
        self,
        problem: Problem,
        unseen: Problem,
        criteria: Criteria,
        jobs: int | None = None,
        progress: Progress | None = None,
        cancelled: Callable[[], bool] | None = None,
        seen: Callable[[Fitted], None] | None = None,
    ) -> None:
        self.problem, self.unseen, self.criteria = problem, unseen, criteria
        self.short = stretched(problem)
        super().__init__(jobs or min(os.cpu_count() or 1, 2), progress, cancelled)
        self._seen = seen or (lambda f: None)
        self._best: dict[tuple[str, ...], Fitted] = {}
        self._asked: list[tuple[tuple[tuple[str, ...], Model | None], Fitted]] = []
        self.heard: dict[str, dict[str, float]] = {}
        self.searched: dict[tuple[str, ...], set[str]] = {}
        self._base()

    @classmethod
    def of(
        cls,
        model: Model,
        known: list[ModelData],
        unseen: list[ModelData] | None,
        criteria: Criteria,
        jobs: int | None = None,
        progress: Progress | None = None,
        cancelled: Callable[[], bool] | None = None,
        seen: Callable[[Fitted], None] | None = None,
    ) -> Motion:
        """Prepare records (the last third is held out where ``unseen`` is None) and fit the model as given."""
        return cls(*prepared(model, known, unseen), criteria, jobs, progress, cancelled, seen)

    def holding(self, names: Collection[str]) -> Motion:
        """Return the same witness of the model with some of its parameters held at their values."""
        base = self.problem.base
        held = base.with_options(frozen=tuple(dict.fromkeys((*base.frozen, *names))))
        known, unseen = (replace(side, base=held) for side in (self.problem, self.unseen))
        return Motion(known, unseen, self.criteria, self.jobs, self._tell, self._cancelled)

    # ------------------------------------------------------------ fits

    @property
    def base(self) -> Fitted:
        """The best fit of the model as given."""
        return self._best[()]

    @functools.cached_property
    def given(self) -> Fitted:
        """The model as given."""
        return self.as_it_is(self.problem.base)

    def _base(self) -> None:
        self.say("base model")
        found = settled(self.short, candidate(self.problem, self.problem.base, ()), [None], self.check)
        if found is None:
            step = self.problem.scale.step
            apart = f"the model diverges on these records: the samples are {step:.3g} s apart{unit_asked(step)}"
            raise SimulationError(f"{self.problem.base.source}: {apart}")
        self._keep(found)

    def _keep(self, found: Found) -> Fitted:
        """Return a fit with all that is told of it, or the best of its class, if that is another one."""
        mine = self._told(found)
        known = self._best.get(mine.kind)
        if known is None or self._known_level(mine) < self._known_level(known):
            self._best[mine.kind] = mine
            self._seen(mine)
        return self._best[mine.kind]

    def _told(self, found: Found) -> Fitted:
        """Return a fit with all that is told of it."""
        f = tidied(found.fit)
        errors = covariances(self.short, f)
        observer, seen = self._observed(f, found)
        return Fitted(
            names_of(self.problem, f),
            whole_model(f),
            estimates(self.problem, f, largest(errors)),
            seen,
            windowed(self.unseen, f.candidate, f.theta, observer),
            functools.partial(left, self.short, found.low, self.criteria),
            at_bound(f),
            self.unseen.noise,
            f,
            errors,
            functools.cache(functools.partial(without, self.short, f, errors)),
        )

    def _observed(self, f: Fit, found: Found) -> tuple[Gains, Array]:
        """Return the observer from whose states a model predicts the known records best, and the squared errors there:
        that of the fit, or the quickest, where a slow one loses its track.
        """
        whole = self.short is self.problem
        own = found.known if whole else windowed(self.problem, f.candidate, f.theta, f.gains)
        quick = windowed(self.problem, f.candidate, f.theta, self.problem.levels[0])
        better = self._level(quick) < self._level(own)
        return (self.problem.levels[0], quick) if better else (f.gains, own)

    def _level(self, squares: Array) -> float:
        return level(squares, self.problem.noise)

    def _known_level(self, f: Fitted) -> float:
        return self._level(f.known_squares)

    def best(self, f: Fitted) -> Fitted:
        """Return the best fit of a model that is known by now: a larger one may have shown the way out of a minimum."""
        return self._best[f.kind]

    def fitted(self, effects: Sequence[str], start: Model | None = None) -> Fitted:
        """Return the best fit of these effects beside the base parameters.

        Started from the values that ``start`` has, if it has all of them; else from those that a scan finds, one effect
        after the other, each from the values that ``start`` has of it.
        """
        uses, asked = start.effects.values() if start else (), (tuple(effects), start)
        known = next((f for one, f in self._asked if one == asked), None)
        if known:
            return self.best(known)
        found = self._as_given(effects, start) if start and set(effects) <= {u.type for u in uses} else None
        if found is None:
            found = self.base
            for name in effects:
                found = self._with(found, [self._given(t, start) for t in trials(self.problem, [name])])
        self._asked.append((asked, found))
        return found

    def stated(self, effects: Sequence[str], model: Model) -> Fitted | None:
        """Return effects with the values that a model has of them, and of its base parameters, as they are."""
        c, theta = self.valued(effects, model)
        f = fit(self.short, c, self.problem.levels[0], theta, 0)
        return self._told(Found(f, windowed(self.short, c, theta, f.gains), f)) if f else None

    def as_it_is(self, model: Model, effects: tuple[str, ...] = ()) -> Fitted:
        """Return a model with the values that it has, and with the same states as the one given; nothing is fitted but
        the observer, which is the one that predicts the known records best.
        """
        known, unseen = (replace(side, base=model) for side in (self.problem, self.unseen))
        c = candidate(known, model, ())
        theta = np.array([k.prior for k in c.coordinates])
        tried = [(windowed(known, c, theta, gains), gains) for gains in known.levels]
        squares, gains = min(tried, key=lambda one: self._level(one[0]))
        found = windowed(unseen, c, theta, gains)
        return replace(self.base, effects=effects, model=model, known_squares=squares, unseen_squares=found)

    def soon(self, c: Candidate, theta: Array) -> float:
        """Return -2 log likelihood of the known records a few steps from some coordinates; inf where it diverges."""
        f = fit(self.short, c, self.problem.levels[1], theta, NEXT)
        return f.cost if f else np.inf

    def _as_given(self, effects: Sequence[str], start: Model) -> Fitted | None:
        """Return the fit of effects from the values of a model that has them all, its base parameters too."""
        if not effects:
            return self.base
        c, theta = self.valued(effects, start)
        found = settled(self.short, c, [None, theta], self.check)
        held = self._held(c, theta, found)
        best = min((one for one in (found, held) if one), key=lambda one: self._level(one.known), default=None)
        return self._around(best) if best else None

    def valued(self, effects: Sequence[str], start: Model) -> tuple[Candidate, Array]:
        """Return the candidate with some effects, and its coordinates with the values of a model that has them all."""
        c = self.base.fit.candidate
        parts = Parts.of(self.base.fit)
        for name in effects:
            given = [self._given(t, start) for t in trials(self.problem, [name])]
            trial = next((t for t in given if not t.of_sensor or t.on(start)), given[0])
            c = extended(self.problem, parts, trial, trial.starts[0])
            parts = Parts(c.model, tuple(k for k in c.label if k in c.model.effects), Parts.sensed(c))
        known = {
            **start.parameters,
            **{f"{k}.{n}": v for k, use in start.effects.items() for n, v in use.parameters.items()},
        }
        return c, c.start({n: known[n] for n in (k.name for k in c.coordinates) if n in known})

    def _held(self, c: Candidate, theta: Array, found: Found | None) -> Found | None:
        """Return a candidate fitted from given values with the quickest observer, which keeps a motion to what was
        measured: a slower one lets it slip from one wave to the next, and the fit walks away.
        """
        tried = (fit(self.short, c, self.problem.levels[0], theta, steps) for steps in (0, NEXT))
        fits = [(windowed(self.short, c, f.theta, f.gains), f) for f in tried if f]
        known, f = min(fits, key=lambda one: self._level(one[0]), default=(None, None))
        if known is None or f is None or (found and self._level(found.known) <= self._level(known)):
            return None
        low = fit(self.short, c, self.problem.levels[-1], f.theta, NEXT)
        return Found(f, known, min((one for one in (low, found and found.low) if one), key=lambda g: g.cost, default=f))

    def _with(self, now: Fitted, options: Sequence[Trial]) -> Fitted:
        """Return a fit with one effect more, the best of some trials (of a sensor there is one for each channel)."""
        fits = [f for f in self.each(lambda t: self._climbed(now.fit, t), options) if f]
        best = min(fits, key=lambda f: f.cost, default=None)
        found = self._finished(now, best) if best else None
        if found is None:
            name = options[0].effect
            raise SimulationError(f"{self.problem.base.source}: with {name} the model diverges on these records")
        return found

    def _given(self, trial: Trial, start: Model | None) -> Trial:
        """Return a trial that starts from the values that a model has of its effect, if it has it."""
        uses = [u for u in start.effects.values() if u.type == trial.effect] if start else []
        if not uses:
            return trial
        if trial.of_sensor:
            (name,) = trial.starts[0]
            value = uses[-1].parameters.get(name.partition(".")[2])
            return trial if value is None else replace(trial, starts=({name: value},))
        return replace(trial, starts=(completed(self.problem, EFFECTS[trial.effect], uses[-1].parameters),))

    def _heard(self, trial: Trial) -> Trial:
        """Return a trial that starts from what the force witness found of its effect, too."""
        values = self.heard.get(trial.effect)
        if not values:
            return trial
        return replace(trial, starts=(completed(self.problem, EFFECTS[trial.effect], values), *trial.starts))

    def _climbed(self, before: Fit, trial: Trial, few: int = FEW) -> Fit | None:
        self.check()
        return climbed(self.short, before, rescanned(self.short, trial, before), few)

    def _finished(self, before: Fitted, f: Fit) -> Fitted | None:
        """Return a promising fit gone on with to the end, also from the base parameters of what it extends, and that
        one from where this one arrived: each is then the best of its class.
        """
        self.check()
        c, known = f.candidate, before.fit.parameters()
        mixed = c.start({**f.parameters(), **known})
        found = settled(self.short, c, [f.theta, mixed], self.check)
        return self._around(self._nearby(found)) if found else None

    def _nearby(self, found: Found) -> Found:
        """Return a fit, or a better one that its last effect leads to from near where it arrived."""
        f, middle = found.fit, self.problem.levels[1]
        key = f.candidate.label[-1]
        use = f.fitted().effects.get(key)
        near = EFFECTS[use.type].nearby(use.parameters) if use else []
        if not use or not near:
            return found
        parts, trial = Parts.of(f).without(key), Trial(use.type, ())
        candidates = [extended(self.problem, parts, trial, completed(self.problem, EFFECTS[use.type], p)) for p in near]
        plain = {n: v for n, v in f.parameters().items() if not n.startswith(f"{key}.")}
        fits = self.each(lambda c: fit(self.short, c, middle, c.start(plain), NEXT), candidates)
        here = fit(self.short, f.candidate, middle, f.theta, NEXT)
        best = min((one for one in fits if one), key=lambda one: one.cost, default=None)
        if best is None or (here and best.cost > here.cost - 1.0):
            return found
        again = settled(self.short, best.candidate, [best.theta], self.check)
        return min([found, *([again] if again else [])], key=lambda one: self._level(one.known))

    def _around(self, found: Found) -> Fitted:
        """Keep a fit, and fit those that lack one of its effects from where it arrived."""
        mine, label = self._keep(found), set(found.fit.candidate.label)
        for known in list(self._best.values()):
            other = set(known.fit.candidate.label)
            if other < label and len(label) == len(other) + 1:
                self._refit(known, found)
        return mine

    def _refit(self, before: Fitted, found: Found) -> None:
        """Fit the smaller model from where the larger one arrived, if that shows a way out of a local minimum."""
        c = before.fit.candidate
        if not c.coordinates:
            return
        theta = c.start({n: v for n, v in found.fit.parameters().items() if n in {k.name for k in c.coordinates}})
        middle = self.problem.levels[1]
        here, there = (fit(self.short, c, middle, x, n) for x, n in ((before.fit.theta, 3), (theta, 3)))
        if here and there and there.cost < here.cost - 1.0:
            again = settled(self.short, c, [there.theta], self.check)
            if again:
                self._keep(again)

    # ------------------------------------------------------------ one effect more

    def extensions(self, of: Fitted, names: Sequence[str] | None = None, rival: Fitted | None = None) -> list[Fitted]:
        """Return what can be added to a fit, the promising ones fitted out, least error on unseen data first.

        ``rival``: a model that is as good already; only what comes near it is fitted out.
        """
        options = [self._heard(t) for t in trials(self.problem, names) if t.effect not in of.effects]
        self.searched.setdefault(of.effects, set()).update(t.effect for t in options)
        self.say(f"{len(options)} effects on top of {', '.join(of.effects) or 'the base model'}")
        fits = [f for f in self.each(lambda t: self._climbed(of.fit, t), options) if f]
        kept = self._promising(of, fits, rival)
        self.say(f"fitting {len(kept)} of them to the end")
        found = self._all_finished(of, kept)
        if not names and found and not min(found, key=lambda one: one.level).white:
            found += self._all_finished(of, self._richer(of, found, options))
        found += [plain for one in found for plain in self.plainer(one)]
        return sorted({one.kind: one for one in found}.values(), key=lambda one: one.level)

    def _all_finished(self, of: Fitted, fits: Sequence[Fit]) -> list[Fitted]:
        return [one for one in self.each(lambda f: self._finished(of, f), fits) if one]

    def _richer(self, of: Fitted, found: Sequence[Fitted], options: Sequence[Trial]) -> list[Fit]:
        """Return fits of effects that extend others, from where these arrived."""
        jobs = []
        for one in (f for f in found if f.fit.candidate.label[-1] in f.model.effects):
            use = one.model.effects[one.fit.candidate.label[-1]]
            for trial in options:
                after = EFFECTS[trial.effect].after(use.type, use.parameters)
                whole = [
                    completed(self.problem, EFFECTS[trial.effect], {**trial.starts[0], **start}) for start in after
                ]
                jobs += [replace(trial, starts=tuple(whole))] if whole else []
        return [f for f in self.each(lambda t: self._climbed(of.fit, t, len(t.starts)), jobs) if f]

    def plainer(self, f: Fitted) -> list[Fitted]:
        """Return a fit with the simpler law in place of one that cannot be told from it, or that is one for the values
        found; without it beside others where nothing tells it from nothing.
        """
        parts, found = Parts.of(f.fit), list[Fitted | None]()
        for key in parts.keys:
            effect, values = EFFECTS[f.model.effects[key].type], f.model.effects[key].parameters
            vague = f.vague(self.criteria).startswith(key)
            nothing = {n: 0.0 for n in effect.telling if vague and not effect.pars()[n].positive}
            simpler = effect.simpler(values | nothing)
            fewer = [extended(self.problem, parts.without(key), Trial(n, ()), start) for n, start in simpler.items()]
            if vague and not fewer and len(f.effects) > 1:
                fewer = [parts.without(key).candidate(self.problem)]
            found += [self._from(f, c) for c in fewer]
        return [one for one in found if one]

    def _from(self, f: Fitted, c: Candidate) -> Fitted | None:
        """Return a candidate fitted from where another fit arrived."""
        self.check()
        found = settled(self.short, c, [c.start(f.fit.parameters())], self.check)
        return self._around(found) if found else None

    def _promising(self, of: Fitted, fits: Sequence[Fit], rival: Fitted | None = None) -> list[Fit]:
        """Return the fits that gain a fair share of what the best gains, by likelihood on stretches; some in any case,
        but where a ``rival`` is as good as these have to be.
        """
        base, other = (
            fit(self.short.short, one.fit.candidate, self.problem.levels[1], one.fit.theta, 4) if one else None
            for one in (of, rival)
        )
        ordered = sorted(fits, key=lambda f: f.cost)
        if base is None or not ordered:
            return ordered[:FINISHED]
        most = base.cost - min([ordered[0].cost, *([other.cost] if other else [])])
        first = 0 if other else FIRST
        return [f for i, f in enumerate(ordered) if i < first or base.cost - f.cost > SERIOUS * most][:FINISHED]

    def bred(self, of: Fitted, names: Sequence[str] | None = None) -> list[Fitted]:
        """Return what can be added of the effects that have many local minima, from the best of all their starts."""
        options = [t for t in trials(self.problem, names) if EFFECTS[t.effect].rugged and t.effect not in of.effects]
        self.say("effects with many local minima")
        fits = [bred(self.short, self.best(of).fit, t, self.each) for t in options]
        return self._all_finished(of, [f for f in fits if f])


__all__ = ["Motion"]
