"""One effect more on top of what was fitted: every trial for a few steps, the promising ones for more, the best fitted
out.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np

from signlin_ros.diagnosis.findings import Beside, structured
from signlin_ros.diagnosis.fit import Filter, Fit, fit, further, likelihood
from signlin_ros.diagnosis.problem import Gains, Problem
from signlin_ros.diagnosis.rank import (
    STRAINED,
    Ranked,
    Trial,
    base_names,
    cost_of,
    descend,
    evidence,
    evidence_of,
    extended,
    ranked,
    remainder,
    rescanned,
    strain,
    trusted,
)
from signlin_ros.effects import EFFECTS

WIDE = 6
"""How many of those that can be added to a set are looked at more closely; with states of their own all are."""
SLOW = 10
"""Steps that those with states get for that, whose shape takes longer to be found; others two."""
MOST_FINISHED = 4
"""How many of these are fitted out."""
MOST_IMPOSED = 12
"""The same where motion is imposed: no observer helps there to find the shape of a hysteresis in a few steps."""
EXCHANGES = 4
"""How often at most the best pairs are sought where an observer is wide awake, each time from the parts of the best."""
CLOSE = 30.0
"""Difference in what they promise to the best one, if that is enough, within which others are fitted out."""


@dataclass(frozen=True)
class _Promise:
    """A trial on top of what was fitted before, with its fit so far and the evidence of that, less being better."""

    evidence: float
    before: Ranked
    trial: Trial
    fit: Fit

    @property
    def ranked(self) -> Ranked:
        """The set of effects, as if it were fitted out."""
        effects, sensors = (*self.before.effects, self.trial.effect), (*self.before.sensors, *self.trial.sensors)
        return Ranked(effects, sensors, self.fit, self.fit, self.evidence)


class Adding:
    """Adds one effect to what was fitted. ``beside``: what those tried took away beside others, by their names."""

    def __init__(self, problem: Problem, run: Executor) -> None:
        self.problem, self.executor = problem, run
        self.beside: dict[str, list[Beside]] = {}

    def best(self, starts: Sequence[Ranked], trials: Sequence[Trial], filter: Filter) -> list[Ranked]:
        """Return the best of all trials on top of the starts, fitted out in noise of a colour, best first.

        Faults of sensors are tried on the first start only.
        """
        enough = bool(starts) and not structured(self.problem, starts[0], filter)
        tried, promising = self._screened(starts, trials, enough)
        self._remember(starts, [*tried, *promising])
        most = MOST_IMPOSED if self.problem.scale.imposed else MOST_FINISHED
        front, rest = promising[:2], promising[2:most]
        finished = self._finished(front, filter)
        if finished and not structured(self.problem, finished[0], filter):
            rest = [p for p in rest if p.evidence < front[0].evidence + CLOSE]
        return sorted(finished + self._finished(rest, filter), key=evidence_of)

    def awake(self, starts: Sequence[Ranked], trials: Sequence[Trial], filter: Filter) -> list[Ranked]:
        """Return the best pairs that an observer finds that is wide awake, fitted out, best first: all trials on top of
        the starts, then either part of the best pair exchanged for all others, the rest as it was.

        At the highest gain hardly a minimum is left but the right one, and little of weak effects.
        """
        high, pairs, done = self.problem.levels[0], dict[frozenset[str], _Promise](), set[str]()
        for _ in range(EXCHANGES):
            _, promising = self._screened(starts, trials, False, high)
            for p in promising:
                key = frozenset(p.ranked.effects)
                if key not in pairs or p.evidence < pairs[key].evidence:
                    pairs[key] = p
            best = min(pairs.values(), key=evidence_of).ranked if pairs else None
            if best is None or set(best.effects) == done:
                break
            done = set(best.effects)
            starts = [r for r in (remainder(self.problem.led, best, n) for n in best.effects) if r]
        return self._finished(sorted(pairs.values(), key=evidence_of)[:MOST_FINISHED], filter)

    def _screened(
        self, starts: Sequence[Ranked], trials: Sequence[Trial], enough: bool, gains: Gains | None = None
    ) -> tuple[list[_Promise], list[_Promise]]:
        """Return all trials on top of the starts, and the more promising of them gone on with, best first; at a gain or
        at those that suit the starts.
        """
        jobs = [
            (before, t)
            for i, before in enumerate(starts)
            for t in trials
            if t.effect not in before.effects and (i == 0 or not t.sensors)
        ]
        tried = [r for r in self.executor.map(lambda j: self._tried(j[0], j[1], enough, gains), jobs) if r]
        tried.sort(key=evidence_of)
        going_on = [p for before in starts for p in _going_on([p for p in tried if p.before is before])]
        return tried, sorted((p for p in self.executor.map(self._further, going_on) if p), key=evidence_of)

    def _tried(self, before: Ranked, trial: Trial, enough: bool, gains: Gains | None) -> _Promise | None:
        """Return a trial on top of what was fitted, after two steps, at a gain or that which suits it.

        Where known parameters were moved far to imitate what is missing, it is also tried with these as they were.
        """
        trial = trial if enough else rescanned(self.problem, trial, before)
        gains = gains or (before.fit.gains if before.fit is not before.low else self.problem.levels[1])
        known, found = before.fit.parameters(), []
        few = None if self.problem.scale.imposed else 1 if enough else 3  # of an imposed motion none leads to another
        effect, ways = EFFECTS[trial.effect], [known]
        if (effect.resonant or effect.periodic) and not enough:
            few = None
        if strain(before.fit) > STRAINED:
            ways.append({n: v for n, v in known.items() if n not in base_names(self.problem)})
        for start, way in itertools.product(trial.starts[:few], ways):
            c = extended(self.problem, before, trial, start)
            found.append(fit(self.problem.led, c, gains, c.start(way), 2))
        best = min((f for f in found if f), key=cost_of, default=None)
        return self._promise(before, trial, best)

    def _further(self, p: _Promise) -> _Promise | None:
        """Return a trial after some further steps; None if it diverges where it is not followed by a filter."""
        steps = SLOW if EFFECTS[p.trial.effect].states else 2
        return self._promise(p.before, p.trial, further(self.problem.led, p.fit, steps))

    def _promise(self, before: Ranked, trial: Trial, f: Fit | None) -> _Promise | None:
        """Return a trial with what it promises, followed as far as that is to be trusted."""
        best = next(iter(trusted(self.problem.led, [f])), None) if f else None
        if best is None:
            return None
        return _Promise(evidence(self.problem.led, best, len(before.effects) + 1), before, trial, best)

    def _finished(self, promising: Sequence[_Promise], filter: Filter) -> list[Ranked]:
        """Return trials fitted out, best first."""

        def finished(p: _Promise) -> Ranked | None:
            fits = descend(self.problem, p.fit.candidate, p.fit.theta, self.problem.levels, 10, filter)
            return ranked(self.problem, p.ranked.effects, p.ranked.sensors, fits)

        return sorted((r for r in self.executor.map(finished, promising) if r is not None), key=evidence_of)

    def _remember(self, starts: Sequence[Ranked], promising: Sequence[_Promise]) -> None:
        """Note what every effect takes away beside others."""
        for before in starts:
            mine = [p for p in promising if p.before is before]
            if not mine:
                continue
            left = likelihood(self.problem.led, before.fit.candidate, before.fit.theta, mine[0].fit.gains)
            for p in mine:
                share = 1.0 - float(np.exp(min(p.fit.cost - left, 0.0) / p.fit.count.sum()))
                self.beside.setdefault(p.trial.effect, []).append(Beside(before.effects, share))


def _going_on(tried: Sequence[_Promise]) -> list[_Promise]:
    """Return which of the trials on top of one set, best first, are looked at more closely."""
    return [p for i, p in enumerate(tried) if i < WIDE or EFFECTS[p.trial.effect].states]


__all__ = ["Adding"]
