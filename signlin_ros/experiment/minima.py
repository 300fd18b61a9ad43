"""Minima of a rival on the first records: what simpler laws lead to, what else makes and breaks contact there, and the
ends of what they leave open.

A richer law that is left in a minimum in which it follows a record worse than the simpler law that it contains would
count as excluded; and one of several minima that the records leave may be the true one.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from signlin_ros.diagnosis.output_error.trials import completed
from signlin_ros.effects import EFFECTS
from signlin_ros.experiment.contenders import Contender
from signlin_ros.fitting.fit import Fit, evaluated, fit
from signlin_ros.fitting.gains import ObserverGains
from signlin_ros.fitting.problem import Problem
from signlin_ros.model import Model
from signlin_ros.model.numbers import numbers

EXCLUDED = 60.0
"""-2 log likelihood of the first records beyond the best rival's from which on one needs no experiment."""
AS_LIKELY_WITHIN, LEFT_OPEN = 1.0, 4.0
"""Within which a smaller size is as likely: one standard error; within which records leave the end of a range open: two
of them."""
REFIT_STEPS = 8
"""Steps of a refit to the first records."""
MINIMA_FITTED, MOST_MINIMA, MINIMA_APART = 8, 2, 0.5
"""Starts from which the other minima of a rival are sought, most that are kept, and how far from each other one of
their coordinates is at least.
"""


def overlap(one: str, other: str) -> bool:
    """Tell whether two laws are the same for some values of their parameters."""
    first, second = ({n, *EFFECTS[n].contains} for n in (one, other))
    return bool(first & second)


def led_by(richer: str, simpler: str, values: Mapping[str, float]) -> dict[str, float]:
    """Return parameters of a richer law for those of a simpler one; empty where it does not contain it."""
    return EFFECTS[richer].holding(simpler, values) if values else {}


def led(problem: Problem, c: Contender, gains: ObserverGains, others: Sequence[tuple[str, Model]]) -> Contender:
    """Return a rival at a better estimate, if it is found from that of a simpler law that it contains; ``others``: laws
    and their models.
    """
    if len(c.effects) != 1:
        return c
    key, best = c.candidate.label[-1], None
    free = replace(c.candidate, starts={})
    for simpler, model in others:
        values = led_by(c.effects[0], simpler, _own(simpler, model))
        if not values:
            continue
        start = {**numbers(model), **{f"{key}.{n}": v for n, v in values.items()}}
        theta = np.clip(free.start({**c.candidate.named(c.theta), **start}), *c.bounds)
        found = fit(problem, free, gains, theta, REFIT_STEPS)
        best = found if found and (best is None or found.objective < best.objective) else best
    own = evaluated(problem, free, c.theta, gains) if best else None
    if best is None or (own is not None and own.objective <= best.objective):
        return c
    return replace(c, theta=best.theta, information=best.hessian, told=c.model_at(best.theta))


def _own(effect: str, model: Model) -> dict[str, float]:
    """Return the values that a model has of a law."""
    uses = [use.parameters for use in model.effects.values() if use.type == effect]
    return dict(uses[-1]) if uses else {}


def with_minima(problem: Problem, c: Contender, gains: ObserverGains, check: Callable[[], None]) -> Contender:
    """Return a rival with the other minima that the first records leave it, of what makes and breaks contact."""
    effect = EFFECTS[c.effects[0]] if len(c.effects) == 1 else None
    if effect is None or not effect.rugged:
        return c
    key = c.candidate.label[-1]
    bounds = zip(c.candidate.coordinates, *(side.tolist() for side in c.bounds), strict=True)
    own = replace(c.candidate, coordinates=tuple(replace(k, low=a, high=b) for k, a, b in bounds), starts={})
    named, short = c.candidate.named(c.theta), problem.short
    tried = []
    for start in effect.starts(problem.scale):
        check()
        theta = own.start({**named, **{f"{key}.{n}": v for n, v in completed(problem, effect, start).items()}})
        tried.append(evaluated(short, own, np.clip(theta, *own.bounds), gains, False))
    near = sorted((f for f in tried if f), key=lambda f: f.objective)[:MINIMA_FITTED]
    fits = [f for f in (fit(problem, own, gains, f.theta, REFIT_STEPS) for f in near) if f]
    best = evaluated(problem, own, c.theta, gains)
    fits = sorted([*fits, *([best] if best else [])], key=lambda f: f.objective)
    found = list[Fit]()
    for f in fits:
        apart = all(np.abs(f.theta - other.theta).max() > MINIMA_APART for other in found)
        if f.objective < fits[0].objective + EXCLUDED and apart:
            found.append(f)
    if not found:
        return c
    others = tuple(f.theta for f in found[1 : 1 + MOST_MINIMA])
    behind = tuple(f.objective - found[0].objective for f in found[1 : 1 + MOST_MINIMA])
    c = replace(c, minima=others, behind=behind)
    return c if found[0].theta is c.theta else replace(c, theta=found[0].theta, information=found[0].hessian)


def with_ends(problem: Problem, c: Contender, gains: ObserverGains) -> Contender:
    """Return a rival with the ends between which a parameter is of interest, where the first records leave it open up
    to them: an estimate somewhere between says nothing of these, nor does what is a standard error beside it. The size
    stays as small as it is.
    """
    own = replace(c.candidate, starts={})
    best = evaluated(problem, own, c.theta, gains, False) if c.size else None
    if c.size is None or best is None:
        return c
    found, size = list[Fit](), c.index(c.size.name)
    for name, sides in c.size.bounds.items():
        i = c.index(name)
        for end in [own.coordinates[i].theta(value) for value in sides if i != size and np.isfinite(sides).all()]:
            if abs(end - c.theta[i]) < MINIMA_APART:
                continue
            start = np.where(np.arange(c.theta.size) == i, end, c.theta)
            low, high = (np.where(np.isin(np.arange(start.size), (i, size)), start, side) for side in c.bounds)
            bounds = zip(own.coordinates, low.tolist(), high.tolist(), strict=True)
            held = replace(own, coordinates=tuple(replace(k, low=a, high=b) for k, a, b in bounds))
            f = fit(problem, held, gains, start, REFIT_STEPS)
            found += [f] if f is not None and f.objective < best.objective + LEFT_OPEN else []
    behind = (max(f.objective - best.objective, 0.0) for f in found)
    return replace(c, minima=(*c.minima, *(f.theta for f in found)), behind=(*c.behind, *behind))


__all__ = ["AS_LIKELY_WITHIN", "EXCLUDED", "REFIT_STEPS", "led", "led_by", "overlap", "with_ends", "with_minima"]
