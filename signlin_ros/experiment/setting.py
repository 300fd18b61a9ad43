"""A diagnosis made ready for a plan: its rivals, what they leave of the first records, where the machine rests."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from signlin_ros.effects import EFFECTS
from signlin_ros.errors import InputError, choices, suggest
from signlin_ros.experiment.common_scale import NO_EFFECT, unscaled
from signlin_ros.experiment.contenders import Contender, contender, information_of
from signlin_ros.experiment.distance import RivalBench
from signlin_ros.experiment.limits import Limits
from signlin_ros.experiment.minima import AS_LIKELY_WITHIN, EXCLUDED, REFIT_STEPS, led, with_ends, with_minima
from signlin_ros.experiment.parts import Part, rendered
from signlin_ros.fitting.candidate import Candidate
from signlin_ros.fitting.fit import Fit, evaluated, fit
from signlin_ros.fitting.following import follow_records
from signlin_ros.fitting.gains import ObserverGains
from signlin_ros.fitting.prepare import prepared
from signlin_ros.fitting.problem import Problem
from signlin_ros.model import Model
from signlin_ros.records import ModelData

Array = NDArray[np.float64]

MAX_PLANNED_RIVALS = 5
"""Most rivals that are planned for: each pair costs refits."""
UNLIKELY = 20.0
"""And the same from which on a rival is to lose, but is not thought to be true."""
OBSERVER_LEVEL = 2
"""Which of the observers a command is judged through: that of the last but one gain, as fits end with."""
SETTLES, REST_SPEED_SHARE = 0.3, 0.02
"""s after which a machine at rest must still be there, within that part of its speed in the first records."""
MAX_BISECTIONS = 30
"""Most bisections for the input that holds a machine."""
STEP_LASTS = 2.0
"""s of the step to and fro by which a rival is asked whether it moves at all."""


@dataclass(frozen=True, eq=False)
class KnownLimits:
    """A rival as a diagnosis tells it: effects beyond the model as given, model, parameters, covariance of values."""

    effects: tuple[str, ...]
    model: Model
    parameters: tuple[str, ...]
    covariance: Array


def known_rivals(told: Sequence[Mapping[str, object]]) -> list[KnownLimits]:
    """Return the rivals of a diagnosis from its JSON."""
    found = []
    for one in told:
        model = Model.from_yaml(str(one["model"]), "rivals")
        names = tuple(map(str, one["parameters"]))  # type: ignore[call-overload]
        covariance = np.array(one["covariance"], dtype=float).reshape(len(names), len(names))
        found.append(KnownLimits(tuple(one["effects"]), model, names, covariance))  # type: ignore[arg-type]
    return found


def named(rivals: Sequence[KnownLimits], between: Sequence[str]) -> list[KnownLimits]:
    """Return the rivals of some names (effects joined by +); raise `InputError` for one that is none of them."""
    every, found = {"+".join(r.effects) or NO_EFFECT: r for r in rivals}, []
    for name in between:
        plain = unscaled(name)
        if plain not in every:
            raise InputError(f"--between: unknown rival {name!r}; there are: {choices(every)}{suggest(name, every)}")
        found.append(every[plain])
    return found


def chosen(rivals: Sequence[KnownLimits]) -> tuple[list[KnownLimits], list[KnownLimits]]:
    """Return the rivals that are planned for, `MAX_PLANNED_RIVALS` at most, and those left out: the proposal, the
    simplest of each family, then the next simplest of each.
    """
    order = sorted(rivals, key=lambda r: (r is not rivals[0], len(r.parameters)))
    ranks, count = {}, dict[str, int]()
    for r in order:
        family = _family(r) or repr(r.effects)
        ranks[r.effects] = count.get(family, 0)
        count[family] = ranks[r.effects] + 1
    kept = sorted(rivals, key=lambda r: (r is not rivals[0], ranks[r.effects]))[:MAX_PLANNED_RIVALS]
    kept.sort(key=list(rivals).index)
    return kept, [r for r in rivals if r not in kept]


def _family(r: KnownLimits) -> str:
    return EFFECTS[r.effects[0]].family if len(r.effects) == 1 else ""


def bench_of(
    given: Model,
    records: Sequence[ModelData],
    rivals: Sequence[KnownLimits],
    check: Callable[[], None] = lambda: None,
) -> RivalBench:
    """Return the rivals as contenders, and what they leave of the first records; one whose estimate is smaller than is
    of interest is fitted anew at that size. ``check``: see `RivalBench`.
    """
    problem, _ = prepared(given, records, records)
    gains = gains_of(problem)
    contenders, left = [], []
    others = [(r.effects[0], r.model) for r in rivals if len(r.effects) == 1]
    for r in rivals:
        check()
        c = contender(problem, r.model, r.effects, None)
        c = replace(c, information=information_of(c.candidate, c.theta, r.parameters, r.covariance))
        c = _sized(problem, led(problem, c, gains, others))
        c = with_ends(problem, with_minima(problem, c, gains, check), gains)
        contenders.append(c)
        found = follow_records(problem, c.candidate, c.theta, gains, False)
        if found is not None:
            left.append(np.sqrt(np.nanmean(np.concatenate(found[0]) ** 2, axis=0)))
    spread = np.maximum(np.min(left, axis=0), problem.noise) if left else problem.noise
    x0 = dict(zip(problem.base.states, problem.base.x0.tolist(), strict=True))
    behind = so_far(problem, contenders)
    bench = RivalBench(problem, tuple(contenders), gains, spread, x0, behind=behind, check=check)
    return replace(bench, bias=_resting(bench))


def gains_of(problem: Problem) -> ObserverGains:
    """Return the observer through which a command is judged."""
    return problem.observer_gains[min(OBSERVER_LEVEL, len(problem.observer_gains) - 1)]


def _sized(problem: Problem, c: Contender) -> Contender:
    """Return a rival of which a size is of interest at its estimate of that size or beyond; at that size, which is the
    hardest to tell, where the first records leave it open: its estimate may be anywhere then.
    """
    if c.size is None:
        return c
    own, start = _of_interest(c), np.clip(c.theta, *c.bounds)
    found, small = fit(problem, own, gains_of(problem), start, REFIT_STEPS), _smallest(problem, c)
    if small is not None and (found is None or small.objective < found.objective + AS_LIKELY_WITHIN):
        found = small
    return c if found is None else replace(c, theta=found.theta)


def _of_interest(c: Contender) -> Candidate:
    """Return what a fit of a rival moves, within the bounds of its size of interest."""
    bounds = zip(c.candidate.coordinates, *(side.tolist() for side in c.bounds), strict=True)
    return replace(c.candidate, coordinates=tuple(replace(k, low=a, high=b) for k, a, b in bounds), starts={})


def _smallest(problem: Problem, c: Contender) -> Fit | None:
    """Return the fit of a rival held at its smallest size of interest; None where it has none, or diverges."""
    if c.size is None:
        return None
    own, i = _of_interest(c), c.index(c.size.name)
    at = own.coordinates[i].high if c.size.stiff else own.coordinates[i].low
    held = replace(own.coordinates[i], low=at, high=at)
    least = replace(own, coordinates=(*own.coordinates[:i], held, *own.coordinates[i + 1 :]))
    return fit(problem, least, gains_of(problem), np.clip(c.theta, *least.bounds), REFIT_STEPS)


def movable(bench: RivalBench, limits: Limits) -> tuple[RivalBench, frozenset[int]]:
    """Return the rivals, at their smallest size of interest those that the largest input would not move as estimated,
    and the places of those that it does not move then either: the machine moves, so it is none of these. First records
    of a machine that turns all the time leave open how much friction holds it at rest.
    """
    problem, held = bench.problem, [i for i in range(len(bench.contenders)) if not _moves(bench, i, limits)]
    if not held:
        return bench, frozenset()
    contenders = list(bench.contenders)
    for i in held:
        small = _smallest(problem, contenders[i])
        if small is not None:
            c = replace(contenders[i], theta=small.theta, information=small.hessian, minima=(), behind=())
            contenders[i] = with_ends(problem, c, gains_of(problem))
    bench = replace(bench, contenders=tuple(contenders), behind=so_far(problem, contenders))
    return bench, frozenset(i for i in held if not _moves(bench, i, limits))


def _moves(bench: RivalBench, i: int, limits: Limits) -> bool:
    """Tell whether a rival moves beyond the noise under a step to and fro of the largest input."""
    t = np.arange(0.0, STEP_LASTS, bench.problem.scale.step)
    steps = (Part("steps", limits.input - abs(bench.bias), 1.0 / STEP_LASTS),)
    run = bench.run(i, t, bench.bias + rendered(steps, t, limits.slew))
    return run is None or bench.moves(bench.segment(i, run))


def open_ones(bench: RivalBench, rivals: Sequence[KnownLimits]) -> list[KnownLimits]:
    """Return the rivals that the first records do not exclude yet, the proposal always."""
    first = bench.behind
    return [r for k, r in enumerate(rivals) if k == 0 or not first[k] > EXCLUDED]


def likely_ones(bench: RivalBench) -> frozenset[int]:
    """Return the places of the rivals that may be true by the first records: the proposal, and what is near the best,
    two at least; the others are to lose, but a record that they would show is not planned for.
    """
    first = bench.behind
    order = np.argsort(np.where(np.isfinite(first), first, np.inf), kind="stable")
    near = [k for k in range(len(first)) if first[k] <= UNLIKELY]
    return frozenset(map(int, (0, *order[:2], *near)))


def so_far(problem: Problem, contenders: Sequence[Contender]) -> Array:
    """Return -2 log likelihood of the first records by each rival (rivals,), beside the best one; NaN where one cannot
    follow them.
    """
    gains, costs = gains_of(problem), []
    for c in contenders:
        f = evaluated(problem, replace(c.candidate, starts={}), c.theta, gains)
        costs.append(np.nan if f is None else f.objective)
    return np.asarray(np.array(costs) - np.nanmin(costs))


def _resting(bench: RivalBench) -> float:
    """Return the input that holds the machine where it starts, by bisection: 0 where any rival says that it stays
    there by itself.
    """
    problem, velocity = bench.problem, bench.problem.plant.velocity
    t = np.arange(0.0, SETTLES, problem.scale.step)
    if problem.base.plant.closed_loop:
        return bench.x0.get(problem.base.plant.position, 0.0)
    if velocity not in problem.base.states or t.size < 2:
        return 0.0

    def ends(u: float) -> float:
        runs = [bench.run(i, t, np.full(t.size, u)) for i in range(len(bench.contenders))]
        return min((float(run[velocity][-1]) for run in runs if run is not None), key=abs, default=0.0)

    slow, most = REST_SPEED_SHARE * problem.scale.velocity, max(map(abs, problem.ranges[problem.base.inputs[0]]))
    moved = ends(0.0)
    if abs(moved) <= slow:
        return 0.0
    low, high = (0.0, -np.sign(moved) * most)
    for _ in range(MAX_BISECTIONS):
        middle = 0.5 * (low + high)
        found = ends(float(middle))
        if abs(found) <= slow:
            return float(f"{middle:.3g}")
        low, high = (middle, high) if found * moved > 0 else (low, middle)
    return 0.0


__all__ = [
    "KnownLimits",
    "bench_of",
    "chosen",
    "gains_of",
    "known_rivals",
    "likely_ones",
    "movable",
    "named",
    "open_ones",
    "so_far",
]
