"""From a base model and records to what is missing: fits, competition, validation, verdict."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from signlin_ros.diagnosis.fit import Filter, Fit, fit, follow_records
from signlin_ros.diagnosis.judge import Residue, Whiteness, gain_on, residues, whiteness
from signlin_ros.diagnosis.problem import Problem, prepare, segment, with_measured_position
from signlin_ros.diagnosis.rank import Ranked, Trial, applicable, assess, compete, evidence, extended
from signlin_ros.model import Model
from signlin_ros.records import ModelData

Array = NDArray[np.float64]

TIE = 6.0
"""Difference in evidence below which two explanations are as good as each other."""
SURE = 2.5
"""Standard errors by which an effect must lower the error on data that the fit did not see."""
BEAM = 4
"""How many singles are tried with a second effect where no single is enough."""
DEPTH = 3
"""Most effects that one diagnosis adds."""
EXPLAINED = 0.85
"""Least share of the missing part of the motion that the named effects must explain on unseen data."""
BLOCK = 0.25
"""Length of the blocks in s by which errors on unseen data are compared."""

Progress = Callable[[str, float], None]


@dataclass(frozen=True)
class Step:
    """A model on the way from the base to the proposal: what it is, and its innovations on unseen data."""

    ranked: Ranked
    unseen: tuple[Array, ...]
    gain: float = 0.0
    certainty: float = 0.0


@dataclass(frozen=True)
class Findings:
    """Everything that a search found.

    ``steps``: base, then one more effect each. ``singles``: every effect alone, best first, with its innovations on
    unseen data. ``pairs``: what was tried on top of each single. ``residues``, ``white``: what is left in the end.
    """

    problem: Problem
    unseen: Problem
    filter: Filter
    sigma: Array
    steps: tuple[Step, ...]
    singles: tuple[Step, ...]
    pairs: tuple[Ranked, ...]
    outside: tuple[str, ...]
    left: tuple[Residue, ...]
    tests: tuple[Whiteness, ...]
    tests_unseen: tuple[Whiteness, ...]

    @property
    def final(self) -> Step:
        """The proposed model."""
        return self.steps[-1]


def held_out(data: Sequence[ModelData]) -> tuple[list[ModelData], list[ModelData]]:
    """Return the first two thirds of every record, and the last third."""
    cut = [len(d) * 2 // 3 for d in data]
    return [d.part(0, c) for d, c in zip(data, cut, strict=True)], [d.part(c) for d, c in zip(data, cut, strict=True)]


def prepared(
    model: Model, data: Sequence[ModelData], validation: Sequence[ModelData] | None
) -> tuple[Problem, Problem]:
    """Return the estimation and the validation problem, which share channels, noise and gains."""
    first, second = (list(data), list(validation)) if validation else held_out(data)
    model = with_measured_position(model, [*first, *second])
    problem = prepare(model, first)
    segments = tuple(segment(problem.base, problem.channels, d) for d in second)
    return problem, replace(problem, segments=segments)


def search(
    model: Model,
    data: Sequence[ModelData],
    validation: Sequence[ModelData] | None = None,
    run: Executor | None = None,
    progress: Progress | None = None,
    depth: int = DEPTH,
) -> Findings:
    """Find what a model lacks; see `Findings`. ``run``: where candidates are fitted, threads by default."""
    own = ThreadPoolExecutor(os.cpu_count() or 1) if run is None else None
    try:
        return _Search(*prepared(model, data, validation), run or own, progress or _silent, depth).run()  # type: ignore[arg-type]
    finally:
        if own:
            own.shutdown(wait=True, cancel_futures=True)


def _silent(what: str, done: float) -> None:
    return


def _evidence(r: Ranked) -> float:
    return r.evidence


def _simple(singles: Sequence[Ranked]) -> list[Ranked]:
    """Return the effects that explain a good part of what the best explains, those of few parameters first."""
    best = singles[0].evidence if singles else 0.0
    worst = max((r.evidence for r in singles), default=0.0)
    good = [r for r in singles if worst - r.evidence > 0.4 * (worst - best) and not r.sensors]
    return sorted(good, key=lambda r: (len(r.fit.theta), r.evidence))


class _Search:
    def __init__(self, problem: Problem, unseen: Problem, run: Executor, progress: Progress, depth: int) -> None:
        self.problem, self.unseen, self.executor, self.progress, self.depth = problem, unseen, run, progress, depth
        self.filter = Filter(np.zeros(len(problem.channels)))
        self.sigma = problem.noise
        self.pairs: list[Ranked] = []

    def run(self) -> Findings:
        self.progress("preparing", 0.0)
        trials, outside = applicable(self.problem)
        base = assess(self.problem, None)
        if base is None:
            raise RuntimeError("the base model diverges on this record")
        self.progress("single effects", 0.1)
        singles = compete(self.problem, base, trials, self.executor)
        base, singles = self._whiten(base, singles)
        path = self._path(base, singles, trials)
        self.progress("validation", 0.9)
        shown = self._shown(base, singles)
        final = path[-1]
        whitened = [self.filter.apply(e) for e in final.ranked.fit.innovations]
        unseen = [self.filter.apply(e) for e in final.unseen]
        return Findings(
            self.problem,
            self.unseen,
            self.filter,
            self.sigma,
            tuple(path),
            tuple(shown),
            tuple(self.pairs),
            tuple(outside),
            tuple(residues(final.ranked.fit.innovations)),
            tuple(whiteness([e[:, c] for e in whitened]) for c in range(self.sigma.size)),
            tuple(whiteness([e[:, c] for e in unseen]) for c in range(self.sigma.size)),
        )

    # ------------------------------------------------------------ noise

    def _whiten(self, base: Ranked, singles: list[Ranked]) -> tuple[Ranked, list[Ranked]]:
        """Take the noise's colour from the best model so far; where it matters, fit all again with it."""
        best = min([base, *singles], key=lambda r: r.evidence)
        left = residues(best.fit.innovations)
        self._note_noise(left)
        if not self.filter.rho.any():
            return base, singles
        refitted = list(self.executor.map(self._again, [base, *singles]))
        return refitted[0], sorted(refitted[1:], key=lambda r: r.evidence)

    def _note_noise(self, left: Sequence[Residue]) -> None:
        self.filter = Filter(np.array([r.filter for r in left]))
        variance = np.array([(1 - r.structure) * r.variance for r in left])
        self.sigma = np.sqrt(np.maximum(variance * (1 - self.filter.rho**2), 1e-300))

    def _again(self, r: Ranked) -> Ranked:
        found = fit(self.problem, r.fit.candidate, self.problem.levels[-1], r.fit.theta, 4, self.filter)
        return r if found is None else replace(r, fit=found, evidence=evidence(self.problem, found, len(r.effects)))

    # ------------------------------------------------------------ what is added

    def _path(self, base: Ranked, singles: list[Ranked], trials: list[Trial]) -> list[Step]:
        """Return the steps from the base to the proposal, each beyond doubt on unseen data."""
        path = [Step(base, self._unseen(base))]
        options = singles
        for depth in range(self.depth):
            step = self._best_step(path, options)
            if step is not None:
                path = [*(p for p in path if set(p.ranked.effects) < set(step.ranked.effects)), step]
            elif depth > 0 or self._enough(path[0]):
                return path
            self.progress("more effects", 0.3 + 0.15 * depth)
            if depth + 1 < self.depth or step is None:
                options = self._more(path[-1].ranked, singles, trials)
        return path

    def _best_step(self, path: list[Step], options: list[Ranked]) -> Step | None:
        """Return the best option that lowers the error on unseen data beyond doubt, or None."""
        last = path[-1]
        for r in sorted(options, key=lambda r: r.evidence)[:3]:
            if r.evidence >= last.ranked.evidence:
                return None
            unseen = self._unseen(r)
            gain, certainty = self._gain(last.unseen, unseen)
            if gain > 0 and certainty > SURE:
                return Step(r, unseen, gain, certainty)
        return None

    def _enough(self, step: Step) -> bool:
        left = residues(step.ranked.fit.innovations)
        whitened = [self.filter.apply(e) for e in step.ranked.fit.innovations]
        return not any(r.structured for r in left) and all(
            whiteness([e[:, c] for e in whitened]).white for c in range(self.sigma.size)
        )

    def _more(self, now: Ranked, singles: list[Ranked], trials: list[Trial]) -> list[Ranked]:
        """Return sets with one effect more than ``now``; where one is not enough, on top of other singles too, and
        then with either effect of the best pair exchanged for every other.
        """
        starts = [now] if now.effects else []
        if len(now.effects) <= 1 and not self._enough(Step(now, ())):
            starts += [r for r in _simple(singles) if r.effects != now.effects][: BEAM - len(starts)]
        found = self._extend(starts, trials)
        if found and len(starts) > 1 and len(found[0].effects) == 2:
            done = {r.effects for r in starts}
            halves = [s for s in singles if len(s.effects) == 1 and s.effects[0] in found[0].effects]
            found = sorted(found + self._extend([h for h in halves if h.effects not in done], trials), key=_evidence)
        self.pairs += found
        return found

    def _extend(self, starts: Sequence[Ranked], trials: list[Trial]) -> list[Ranked]:
        """Return the best of all trials on top of the starts, fitted out, best first."""
        jobs = [
            (before, t)
            for i, before in enumerate(starts)
            for t in trials
            if t.effect not in before.effects and (i == 0 or not t.sensors)
        ]
        screened = [r for r in self.executor.map(lambda j: self._screened(*j), jobs) if r is not None]
        screened.sort(key=lambda s: s[0])
        finished = list(self.executor.map(lambda s: self._finished(*s[1:]), screened[:6]))
        return sorted((r for r in finished if r is not None), key=_evidence)

    def _screened(self, before: Ranked, trial: Trial) -> tuple[float, Ranked, Trial, Fit] | None:
        """Return a trial on top of what was fitted, after two steps at the middle gain."""
        middle, best = self.problem.levels[1], None
        for start in trial.starts[:2]:
            c = extended(self.problem, before, trial, start)
            theta = c.start()
            known = before.fit.parameters()
            for i, k in enumerate(c.coordinates):
                if k.name in known:
                    theta[i] = k.theta(known[k.name])
            found = fit(self.problem, c, middle, theta, 2)
            if found and (best is None or found.cost < best.cost):
                best = found
        if best is None:
            return None
        return evidence(self.problem, best, len(before.effects) + 1), before, trial, best

    def _finished(self, before: Ranked, trial: Trial, start: Fit) -> Ranked | None:
        middle, low = self.problem.levels[1:]
        second = fit(self.problem, start.candidate, middle, start.theta, 8)
        found = fit(self.problem, start.candidate, low, second.theta, 12, self.filter) if second else None
        if found is None:
            return None
        effects = (*before.effects, trial.effect)
        sensors = (*before.sensors, *trial.sensors)
        return Ranked(effects, sensors, found, evidence(self.problem, found, len(effects)))

    # ------------------------------------------------------------ unseen data

    def _unseen(self, r: Ranked) -> tuple[Array, ...]:
        """Return the innovations on unseen data at the lowest gain; infinite where the model diverges."""
        found = follow_records(self.unseen, r.fit.candidate, r.fit.theta, self.unseen.levels[-1], False)
        if found is None:
            return tuple(np.full(s.y.shape, 1e3) * self.problem.noise for s in self.unseen.segments)
        return tuple(found[0])

    def _gain(self, before: tuple[Array, ...], after: tuple[Array, ...]) -> tuple[float, float]:
        block = max(int(BLOCK / self.problem.scale.step), 8)
        sigma = self.sigma
        return gain_on(before, after, self.filter, sigma, block)

    def _shown(self, base: Ranked, singles: list[Ranked]) -> list[Step]:
        reference = self._unseen(base)
        result = []
        for r in singles:
            unseen = self._unseen(r)
            result.append(Step(r, unseen, *self._gain(reference, unseen)))
        return result


__all__ = ["Findings", "Step", "search"]
