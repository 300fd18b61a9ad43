"""Signals that were recorded with the wrong sign.

A plug the wrong way round is the commonest fault of a rig, and no effect: what is fitted to it (a delay of half a
period, parameters far from their values) only imitates it. The model as it is given tells: with one signal reversed it
follows the record much better.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from signlin_ros.fitting.candidate import Candidate
from signlin_ros.fitting.following import follow_records
from signlin_ros.fitting.problem import Problem
from signlin_ros.follow.segments import Segment

Array = NDArray[np.float64]

BETTER = 0.5
"""What is left with a signal reversed, as a share of what is left without (RMS, geometric mean over the channels), that
puts its sign in doubt."""


def reversed_signal(problem: Problem, base: Candidate) -> str:
    """Return the input or channel with whose sign reversed the model as given, not fitted, leaves at most half as much;
    empty if there is none. An input goes before a channel: of one input and one channel nothing tells which it is.
    """
    tried = ((_left(problem, base, segments), name) for name, segments in _with_one_reversed(problem))
    least, name = min(tried, default=(np.inf, ""))
    return name if least < BETTER * _left(problem, base, problem.segments) else ""


def _with_one_reversed(problem: Problem) -> Iterator[tuple[str, list[Segment]]]:
    for i, name in enumerate(problem.base.inputs):
        yield name, [replace(s, u=_reversed(s.u, i)) for s in problem.segments]
    for i, name in enumerate(problem.channels if len(problem.channels) > 1 else ()):
        starts = [{n: -v if n == name else v for n, v in s.start.items()} for s in problem.segments]
        pairs = zip(problem.segments, starts, strict=True)
        yield name, [replace(s, y=_reversed(s.y, i), start=start) for s, start in pairs]


def _reversed(values: Array, column: int) -> Array:
    return np.where(np.arange(values.shape[1]) == column, -values, values)


def _left(problem: Problem, base: Candidate, segments: Sequence[Segment]) -> float:
    """Return the RMS of what a model leaves of records at the middle gain, in multiples of the noise."""
    found = follow_records(problem, base, base.start(), problem.levels[1], False, segments)
    if found is None:
        return np.inf
    mean = np.nanmean(np.concatenate(found[0]) ** 2, axis=0) / problem.noise**2
    return float(np.exp(0.5 * np.mean(np.log(mean + 1e-300))))


__all__ = ["reversed_signal"]
