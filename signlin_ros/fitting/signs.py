"""Signals that were recorded with the wrong sign.

A plug the wrong way round is the commonest fault of a rig, and no effect: what is fitted to it (a delay of half a
period, parameters far from their values) only imitates it. The model as it is given tells: with one signal reversed it
follows the record much better.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from signlin_ros.fitting.fit import Fit
from signlin_ros.fitting.following import follow_records
from signlin_ros.fitting.problem import Problem

Array = NDArray[np.float64]

BETTER = 0.5
"""What is left with a signal reversed, as a share of what is left without (RMS, geometric mean over the channels), that
puts its sign in doubt."""


def reversed_signal(problem: Problem, base: Fit) -> str:
    """Return the input or channel with whose sign reversed the model as given, not fitted, leaves at most half as much;
    empty if there is none. An input goes before a channel: of one input and one channel nothing tells which it is.
    """
    theta = np.array([k.prior for k in base.candidate.coordinates])
    left = _left(problem, problem, base, theta)
    tried = ((_left(problem, other, base, theta), name) for name, other in _with_one_reversed(problem))
    least, name = min(tried, default=(np.inf, ""))
    return name if least < BETTER * left else ""


def _with_one_reversed(problem: Problem) -> Iterator[tuple[str, Problem]]:
    for i, name in enumerate(problem.base.inputs):
        signs = np.where(np.arange(len(problem.base.inputs)) == i, -1.0, 1.0)
        yield name, replace(problem, segments=tuple(replace(s, u=s.u * signs) for s in problem.segments))
    for i, name in enumerate(problem.channels if len(problem.channels) > 1 else ()):
        signs = np.where(np.arange(len(problem.channels)) == i, -1.0, 1.0)
        segments = (
            replace(s, y=s.y * signs, start={n: -v if n == name else v for n, v in s.start.items()})
            for s in problem.segments
        )
        yield name, replace(problem, segments=tuple(segments))


def _left(problem: Problem, other: Problem, base: Fit, theta: Array) -> float:
    """Return the RMS of what a model leaves of records at the middle gain, in multiples of the noise."""
    found = follow_records(other, base.candidate, theta, problem.levels[1], False)
    if found is None:
        return np.inf
    mean = np.nanmean(np.concatenate(found[0]) ** 2, axis=0) / problem.noise**2
    return float(np.exp(0.5 * np.mean(np.log(mean + 1e-300))))


__all__ = ["reversed_signal"]
