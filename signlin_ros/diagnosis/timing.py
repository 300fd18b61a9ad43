"""When a recorded input acts: from its sample on, as a command that is held, or earlier.

A command is held from its sample to the next. What a load cell or a current probe shows is a sample of a signal that
goes on in between: held, it comes half a step late, and a model has to lag, with a compliance or a delay of a sensor
that is not there. What is logged beside the state that it led to acts before its sample. No effect of the catalogue
can be early, so this is settled by the fits themselves.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from signlin_ros.diagnosis.fit import Filter, fit
from signlin_ros.diagnosis.narrow import Each
from signlin_ros.diagnosis.problem import Problem
from signlin_ros.diagnosis.rank import Ranked, evidence
from signlin_ros.model import HOLDS

CLEARLY = 30.0
"""Another timing must be better by so much evidence, as a further effect."""
CLOSEST = 2
"""So many options are fitted to the end with another timing."""
WAYS = {
    "forward": "from its sample to the next",
    "centred": "from half a step before its sample to half a step after it, as samples of what goes on in between",
    "backward": "over the step before its sample, as if logged beside the state that it led to",
}


def better_hold(problem: Problem, options: Sequence[Ranked], filter: Filter, each: Each) -> str:
    """Return the ``input_hold`` with which some option explains the records clearly better than any does as they were
    taken; empty if there is none. ``filter``: the colour in which their evidence was found.
    """
    present, white = problem.segments[0].early / problem.scale.step, Filter(np.zeros_like(filter.rho))
    ways = {h: _earlier(problem, h) for h, steps in HOLDS.items() if abs(steps - present) > 0.1}
    work = [(p.short, r, white, 3) for p in (problem, *ways.values()) for r in options]
    looks = np.array(list(each(lambda w: _refitted(*w), work))).reshape(-1, len(options))
    limit = looks[0] - CLEARLY / 2  # of each option itself: one that imitates the timing is as good without
    likely = {h: np.argsort(row)[:CLOSEST] for h, row in zip(ways, looks[1:], strict=True) if (row < limit).any()}
    colours = [white, filter] if filter.rho.any() else [white]
    work = [(ways[h], options[i], colour, 12) for h, first in likely.items() for i in first for colour in colours]
    found = list(each(lambda w: _refitted(*w), work))
    if not found or min(found) > min(r.evidence for r in options) - CLEARLY:
        return ""
    return next(h for h, way in ways.items() if way is work[int(np.argmin(found))][0])


def _earlier(problem: Problem, hold: str) -> Problem:
    early = HOLDS[hold] * problem.scale.step
    return replace(problem, segments=tuple(replace(s, early=early) for s in problem.segments))


def _refitted(problem: Problem, r: Ranked, filter: Filter, steps: int) -> float:
    """Return the evidence of a set of effects, fitted on from where it is at each of its gains."""
    starts = [r.low] if r.fit is r.low else [r.low, r.fit]
    found = [fit(problem, f.candidate, f.gains, f.theta, steps, filter if f is r.low else None) for f in starts]
    return min((evidence(problem, f, len(r.effects)) for f in found if f), default=np.inf)


__all__ = ["CLEARLY", "WAYS", "better_hold"]
