"""The motion witness: models simulated with an observer, fitted to known records, judged by windows of unseen ones."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any

from signlin_ros.diagnosis.criteria import Criteria
from signlin_ros.diagnosis.fit import Fit, candidate, tidied
from signlin_ros.diagnosis.motion.fitted import Fitted, at_bound, estimates, names_of, spreads, whole_model
from signlin_ros.diagnosis.motion.fitting import Found, climbed, settled, solved
from signlin_ros.diagnosis.motion.left import left
from signlin_ros.diagnosis.motion.prepare import prepared, stretched
from signlin_ros.diagnosis.motion.score import Gain, gain, level, windowed
from signlin_ros.diagnosis.motion.trials import Trial, completed, rescanned, trials
from signlin_ros.diagnosis.problem import Problem
from signlin_ros.effects import EFFECTS
from signlin_ros.errors import SignlinError, SimulationError
from signlin_ros.model import Model
from signlin_ros.records import ModelData

SERIOUS, FINISHED = 0.25, 8
"""Share of the best candidate's gain that makes another one worth a thorough fit; and how many get one at most."""
BEAM = 3
"""How many single effects are tried with every other one, where none is enough."""

Progress = Callable[[str], None]


class CancelledError(SignlinError):
    """Somebody asked to stop."""


class Motion:
    """Fits of a model, with effects added, to the known records, and their errors on the unseen ones.

    ``problem``, ``unseen``: the records, prepared; ``short``: what is fitted to, stretches where records are long.
    """

    def __init__(
        self,
        problem: Problem,
        unseen: Problem,
        criteria: Criteria,
        jobs: int | None = None,
        progress: Progress | None = None,
        cancelled: Callable[[], bool] | None = None,
    ) -> None:
        self.problem, self.unseen, self.criteria = problem, unseen, criteria
        self.short = stretched(problem)
        self.jobs = jobs or min(os.cpu_count() or 1, 2)
        self._tell, self._cancelled = progress or (lambda what: None), cancelled or (lambda: False)
        self._best: dict[tuple[str, ...], Fitted] = {}
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
    ) -> Motion:
        """Prepare records (the last third is held out where ``unseen`` is None) and fit the model as given."""
        return cls(*prepared(model, known, unseen), criteria, jobs, progress, cancelled)

    # ------------------------------------------------------------ fits

    @property
    def base(self) -> Fitted:
        """The best fit of the model as given."""
        return self._best[()]

    def _base(self) -> None:
        self.say("base model")
        found = settled(self.short, candidate(self.problem, self.problem.base, ()), [None])
        if found is None:
            raise SimulationError(f"{self.problem.base.source}: the model diverges on these records")
        self._keep(found)

    def _keep(self, found: Found) -> Fitted:
        """Return a fit with all that is told of it; remembered if it is the best of its class."""
        f = tidied(found.fit)
        errors = spreads(self.short, f)
        mine = Fitted(
            names_of(self.problem, f),
            whole_model(f),
            estimates(self.problem, f, errors),
            found.known if self.short is self.problem else windowed(self.problem, f.candidate, f.theta, f.gains),
            windowed(self.unseen, f.candidate, f.theta, f.gains),
            left(self.short, f, self.criteria),
            at_bound(f),
            self.unseen.noise,
            f,
            errors,
        )
        known = self._best.get(_class(mine))
        if known is None or level(mine.known_squares, self.problem.noise) < level(
            known.known_squares, self.problem.noise
        ):
            self._best[_class(mine)] = mine
        return self._best[_class(mine)]

    def fitted(self, effects: Sequence[str], start: Model | None = None) -> Fitted:
        """Return the best fit of these effects beside the base parameters.

        Started from the values that ``start`` has of them, else from those that a scan finds, one after the other.
        """
        now = self.base
        for name in effects:
            now = self._with(now, [self._given(t, start) for t in trials(self.problem, [name])])
        return now

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

    def _climbed(self, before: Fit, trial: Trial, few: int = 4) -> Fit | None:
        self.check()
        return climbed(self.short, before, rescanned(self.short, trial, before), few)

    def _finished(self, before: Fitted, f: Fit) -> Fitted | None:
        """Return a promising fit gone on with to the end, also from the base parameters of what it extends, and that
        one from where this one arrived: each is then the best of its class.
        """
        self.check()
        c, known = f.candidate, before.fit.parameters()
        mixed = c.start({**f.parameters(), **known})
        found = settled(self.short, c, [f.theta, mixed])
        if found is None:
            return None
        mine = self._keep(found)
        self._refit(before, found)
        return mine

    def _refit(self, before: Fitted, found: Found) -> None:
        """Fit the smaller model from where the larger one arrived, if that shows a way out of a local minimum."""
        c = before.fit.candidate
        if not c.coordinates:
            return
        theta = c.start({n: v for n, v in found.fit.parameters().items() if n in {k.name for k in c.coordinates}})
        middle = self.problem.levels[1]
        here, there = (solved(self.short, c, middle, x, n) for x, n in ((before.fit.theta, 0), (theta, 3)))
        if here and there and there.cost < here.cost - 1.0:
            again = settled(self.short, c, [there.theta])
            if again:
                self._keep(again)

    # ------------------------------------------------------------ one effect more

    def extensions(self, of: Fitted, names: Sequence[str] | None = None) -> list[Fitted]:
        """Return what can be added to a fit, the promising ones fitted out, least error on unseen data first."""
        options = [t for t in trials(self.problem, names) if t.effect not in of.effects]
        self.say(f"{len(options)} effects on top of {', '.join(of.effects) or 'the base model'}")
        fits = [f for f in self.each(lambda t: self._climbed(of.fit, t), options) if f]
        kept = self._promising(of, fits)
        self.say(f"fitting {len(kept)} of them to the end")
        found = [one for one in self.each(lambda f: self._finished(of, f), kept) if one]
        return sorted(found, key=lambda one: one.level)

    def _promising(self, of: Fitted, fits: Sequence[Fit]) -> list[Fit]:
        """Return the fits that gain a fair share of what the best gains, by likelihood on stretches."""
        base = solved(self.short.short, of.fit.candidate, self.problem.levels[1], of.fit.theta, 4)
        ordered = sorted(fits, key=lambda f: f.cost)
        if base is None or not ordered:
            return ordered[:FINISHED]
        most = base.cost - ordered[0].cost
        return [f for i, f in enumerate(ordered) if i < 3 or base.cost - f.cost > SERIOUS * most][:FINISHED]

    # ------------------------------------------------------------ search

    def gain(self, before: Fitted, after: Fitted) -> Gain:
        """Return what one model explains of unseen data beyond another."""
        return gain(before.unseen_squares, after.unseen_squares, self.unseen.noise)

    def refused(self, before: Fitted, after: Fitted) -> str:
        """Return why a model is no step beyond another, empty if it is one."""
        c, g = self.criteria, self.gain(before, after)
        freed = before.strain - after.strain
        signed = g.certainty * abs(g.certainty)
        if signed + max(freed, 0.0) < c.certainty**2:
            return f"the error on unseen data falls by {g.certainty:.1f} standard errors"
        if g.share < c.share and freed < c.certainty**2:
            return f"it takes away {100 * g.share:.1f} % of the error beyond the noise"
        if g.worsens(c.worse, c.alike):
            return "the error of a channel rises"
        return after.vague(c)

    def search(self, depth: int = 3) -> list[list[Fitted]]:
        """Return the path from the base to what is proposed, each with the options of that step: the first of each list
        is what was taken (the base in the first).
        """
        path, now = [[self.base]], self.base
        for _ in range(depth):
            options = self.extensions(now)
            step = self._step(now, options)
            if step is None and not now.white:
                options += self._pairs(now, options)
                step = self._step(now, options)
            if step is None:
                path[-1] += [one for one in options if one not in path[-1]]
                break
            path.append([step, *(one for one in options if one is not step)])
            now = step
            if now.white:
                break
        path[0][0] = self.base
        return path

    def _step(self, now: Fitted, options: Sequence[Fitted]) -> Fitted | None:
        """Return the simplest of the acceptable options that are as good as the best."""
        good = [one for one in options if not self.refused(self._best[_class(now)], one)]
        if not good:
            return None
        best = min(good, key=lambda one: one.level)
        near = [one for one in good if self._alike(best, one)]
        return min(near, key=lambda one: (one.size, one.level + one.strain / self.unseen.samples))

    def _alike(self, best: Fitted, other: Fitted) -> bool:
        """Tell whether a model is as good as the best: within a standard error, or what a table shows."""
        if other is best:
            return True
        g = self.gain(other, best)
        return g.certainty < self.criteria.tie or bool((g.ratios > 1.0 - self.criteria.alike).all())

    def _pairs(self, now: Fitted, options: Sequence[Fitted]) -> list[Fitted]:
        """Return the best pairs on top of the best single effects."""
        found: list[Fitted] = []
        for first in options[:BEAM]:
            found += self.extensions(first)[:BEAM]
        return found

    # ------------------------------------------------------------ running

    def say(self, what: str) -> None:
        """Tell what is being done; raise `CancelledError` if somebody asked to stop."""
        self.check()
        self._tell(what)

    def check(self) -> None:
        """Raise `CancelledError` if somebody asked to stop."""
        if self._cancelled():
            raise CancelledError("stopped")

    def each(self, do: Callable[[Any], Any], items: Sequence[Any]) -> list[Any]:
        """Do a thing to each, side by side."""
        if self.jobs == 1 or len(items) < 2:
            return [do(item) for item in items]
        with ThreadPoolExecutor(self.jobs) as pool:
            return list(pool.map(do, items))


def _class(f: Fitted) -> tuple[str, ...]:
    """Return what tells one set of effects from another: their keys, sensors with their channels."""
    return tuple(sorted(f.fit.candidate.label))


__all__ = ["CancelledError", "Motion"]
