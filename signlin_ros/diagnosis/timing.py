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
from signlin_ros.diagnosis.problem import Problem
from signlin_ros.diagnosis.rank import Ranked, evidence
from signlin_ros.model import HOLDS

CLEARLY = 30.0
"""Another timing must be better by so much evidence, as a further effect."""
WAYS = {
    "forward": "from its sample to the next",
    "centred": "from half a step before its sample to half a step after it, as samples of what goes on in between",
    "backward": "over the step before its sample, as if logged beside the state that it led to",
}


def better_hold(problem: Problem, options: Sequence[Ranked], filter: Filter) -> str:
    """Return the ``input_hold`` with which some option explains the records clearly better than any does as they were
    taken; empty if there is none.
    """
    present = problem.segments[0].early / problem.scale.step
    others = [hold for hold, steps in HOLDS.items() if abs(steps - present) > 0.1]
    limit = _best(problem.short, options, Filter(np.zeros_like(filter.rho)), 3)
    ways = {h: _earlier(problem, h) for h in others}
    likely = [h for h in others if _best(ways[h].short, options, Filter(np.zeros_like(filter.rho)), 3) < limit]
    if not likely:
        return ""
    found = {h: _best(ways[h], options, filter, 12) for h in likely}
    best = min(found, key=lambda h: found[h])
    return best if found[best] < _best(problem, options, filter, 12) - CLEARLY else ""


def _earlier(problem: Problem, hold: str) -> Problem:
    early = HOLDS[hold] * problem.scale.step
    return replace(problem, segments=tuple(replace(s, early=early) for s in problem.segments))


def _best(problem: Problem, options: Sequence[Ranked], filter: Filter, steps: int) -> float:
    """Return the least evidence of the options, fitted on from where they are, in white noise and in that colour."""
    colours = [Filter(np.zeros_like(filter.rho)), *([filter] if filter.rho.any() else [])]
    found = [
        (fit(problem, f.candidate, f.gains, f.theta, steps, colour), r)
        for r in options
        for f in ({id(f): f for f in (r.fit, r.low)}).values()
        for colour in colours
    ]
    return min((evidence(problem, f, len(r.effects)) for f, r in found if f), default=np.inf)


__all__ = ["CLEARLY", "WAYS", "better_hold"]
