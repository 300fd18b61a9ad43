"""When a recorded input acts: from its sample on, as a command that is held, or earlier.

A command is held from its sample to the next. What a load cell or a current probe shows is a sample of a signal that
goes on in between: held, it comes half a step late, and a model has to lag, with a compliance or a delay of a sensor
that is not there. What is logged beside the state that it led to acts before its sample, and a loop that is faster than
its log anywhere in between. No effect of the catalogue can be early, so this is settled by the fits themselves.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from typing import NamedTuple

import numpy as np

from signlin_ros.diagnosis.fit import Filter, Fit, fit
from signlin_ros.diagnosis.narrow import Each
from signlin_ros.diagnosis.problem import Problem
from signlin_ros.diagnosis.rank import Ranked, evidence
from signlin_ros.model import HOLDS

CLEARLY = 30.0
"""Another timing must be better by so much evidence, as a further effect."""
CLOSEST = 4
"""So many timings, of one option or another, are fitted to the end."""
GRID = (0.0, 0.25, 0.5, 0.75, 1.0)
"""Steps by which an input may be early, that are looked at."""
ALIKE = 6.0
"""One that has a name is taken where it is no more than so much evidence behind."""
WAYS = {
    "forward": "from its sample to the next",
    "centred": "from half a step before its sample to half a step after it, as samples of what goes on in between",
    "backward": "over the step before its sample, as if logged beside the state that it led to",
}


class _Look(NamedTuple):
    """A set of effects with the input early by so many steps: its fits, and their evidence."""

    evidence: float
    steps: float
    option: Ranked
    filter: Filter
    fits: tuple[Fit, ...]


def better_hold(problem: Problem, options: Sequence[Ranked], filter: Filter, each: Each) -> tuple[str | float, float]:
    """Return the ``input_hold`` with which some option explains the records clearly better than any does as they were
    taken, empty if there is none, and by how much evidence. ``filter``: the colour in which that of theirs was found.
    """
    present, white = float(np.median(problem.segments[0].early)) / problem.scale.step, Filter(np.zeros_like(filter.rho))
    colours = [white, filter] if filter.rho.any() else [white]
    starts = [_Look(r.evidence, present, r, white, (r.low,) if r.fit is r.low else (r.low, r.fit)) for r in options]
    ways = [steps for steps in GRID if abs(steps - present) > 0.1]
    work = [(problem.short, look, steps, white, 3) for look in starts for steps in (present, *ways)]
    looks = list(each(lambda w: _refitted(*w), work))
    as_taken = {id(one.option): one.evidence for one in looks if one.steps == present}
    better = [one for one in looks if one.evidence < as_taken[id(one.option)] - CLEARLY / 2]
    likely = sorted(better, key=lambda one: one.evidence)[:CLOSEST]
    found = list(each(lambda w: _refitted(problem, w[0], w[0].steps, w[1], 12), list(product(likely, colours))))
    best = min(found, key=lambda one: one.evidence, default=None)
    gain = min(r.evidence for r in options) - best.evidence if best else 0.0
    return (_sharper(problem, best, each), gain) if best and gain > CLEARLY else ("", 0.0)


def _sharper(problem: Problem, best: _Look, each: Each) -> str | float:
    """Return by how many steps an input is early, halving the distance to its neighbours; by name, where that is as
    good.
    """
    known = {best.steps: best}
    for reach in (1 / 8, 1 / 16, 1 / 32):
        near = [(best, x) for x in (best.steps - reach, best.steps + reach) if 0.0 <= x <= 1.0]
        found = each(lambda w: _refitted(problem, w[0], w[1], w[0].filter, 12), near)
        best = min([best, *found], key=lambda one: one.evidence)
        known[best.steps] = best
    named = {h: known[early].evidence for h, early in HOLDS.items() if early in known}
    name = min(named, key=lambda h: named[h], default="")
    return name if name and named[name] < best.evidence + ALIKE else round(best.steps, 3)


def _refitted(problem: Problem, look: _Look, early: float, filter: Filter, steps: int) -> _Look:
    """Return a set of effects with another timing, fitted on from where it is at each of its gains."""
    r, shift = look.option, early * problem.scale.step
    usual = (s.early - np.median(s.early) for s in problem.segments)
    moved = replace(
        problem,
        segments=tuple(replace(s, early=shift + own) for s, own in zip(problem.segments, usual, strict=True)),
    )
    low = problem.levels[-1]
    tried = (fit(moved, f.candidate, f.gains, f.theta, steps, filter if f.gains is low else None) for f in look.fits)
    fits = tuple(f for f in tried if f)
    value = min((evidence(moved, f, len(r.effects)) for f in fits), default=np.inf)
    return _Look(value, early, r, filter, fits)


__all__ = ["CLEARLY", "WAYS", "better_hold"]
