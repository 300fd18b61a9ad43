"""Scores of fitted models: of free runs, and of runs over windows from the observer's states."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from signlin_ros.diagnosis.data import arriving, cut
from signlin_ros.diagnosis.fit import Candidate, Fit, follow_records, seen_late
from signlin_ros.diagnosis.problem import Gains, Problem, Segment, linear_base
from signlin_ros.diagnosis.results import Scores
from signlin_ros.diagnosis.scores import Score, score
from signlin_ros.predict import windows

Array = NDArray[np.float64]


def kind_of_score(problem: Problem) -> str:
    """Return ``free_run`` where the plant forgets its start, ``windowed`` where errors pile up (an integrator)."""
    _, A, _, _ = linear_base(problem.base, problem.channels)
    forgets = bool(A.size) and float(np.max(np.linalg.eigvals(A).real)) < -1.0 / problem.scale.duration
    return "free_run" if forgets else "windowed"


def scores(problem: Problem, f: Fit, kind: str, noise: Array, levels: Sequence[int] = ()) -> Scores:
    """Score a fitted model on the records of a problem.

    The state at the start of a run is that of the observer: causal, from measurements before it. Windows start from
    that of the ``levels`` (all by default) whose states predict best, as in `compare`.
    """
    measured = [s.y for s in problem.segments]
    errors = [np.full_like(y, np.nan) for y in measured]
    low = problem.levels[-1]
    if kind == "free_run":
        values = np.concatenate([low.values[:200], np.zeros((1, *low.values.shape[1:]))])
        settle = Gains(low.tau, low.names, values, np.ones((0, len(problem.channels))))
        found = follow_records(problem, f.candidate, f.theta, settle, False)
        errors = found[0] if found else errors
        errors = [np.where(np.arange(e.shape[0])[:, None] >= min(200, e.shape[0] // 4), e, np.nan) for e in errors]
    else:
        tried = [_in_windows(problem, f, k) for k in levels or range(len(problem.levels))]
        errors = min(tried, key=_size, default=errors)
    y, e = np.concatenate(measured), np.concatenate(errors)
    result = {}
    for c, name in enumerate(problem.channels):
        found_score = score(y[:, c], y[:, c] - e[:, c], float(noise[c]))
        result[name] = found_score or Score(float("inf"), None, None)
    return Scores(kind, result)


def _in_windows(problem: Problem, f: Fit, level: int) -> list[Array]:
    """Return the errors (T, ny) of runs over windows of every record, started from the states at one of the gains; NaN
    where the model diverges.
    """
    found = follow_records(problem, f.candidate, f.theta, problem.levels[level], False)
    if found is None:
        return [np.full_like(s.y, np.nan) for s in problem.segments]
    return [_windowed(problem, f, s, E, X) for s, E, X in zip(problem.segments, found[0], found[2], strict=True)]


def _size(errors: Sequence[Array]) -> float:
    """Return the sum of the logarithms of the mean squares of errors (T, ny) over the channels; inf if unknown."""
    e = np.concatenate(errors)
    known = np.isfinite(e)
    if not known.any(axis=0).all():
        return np.inf
    return float(np.sum(np.log(np.nanmean(e**2, axis=0) + 1e-300)))


def best_level(problem: Problem, f: Fit) -> int:
    """Return the gain whose states a model predicts best from, over windows."""
    return int(np.argmin([_size(_in_windows(problem, f, k)) for k in range(len(problem.levels))]))


def _windowed(problem: Problem, f: Fit, s: Segment, E: Array, X: Array) -> Array:
    """Return the errors (T, ny) of runs over windows of the update period, each started from X (T, n).

    As long as a late sensor shows what was before a window, that is known: innovations E (T, ny) count there.
    """
    errors = np.full_like(s.y, np.nan)
    lags = seen_late(problem, f.candidate, f.candidate.p(f.theta))[:, 0]
    steady, names = problem.levels[1].values[-1:], problem.levels[1].names
    candidate, theta, delay = _in_time(f)
    u, early = s.u, s.early
    if delay:
        u, early = _delayed(problem, s, delay), s.early if problem.scale.imposed else 0.0
    free = Gains(np.inf, names, np.zeros_like(steady), np.ones((0, steady.shape[2])))
    for first, last in windows(s.t, problem.base.update_period)[1:]:
        if s.t[first] - s.t[0] < delay:
            continue
        part = slice(first, last + 1)
        start = dict(zip(candidate.model.states, X[first], strict=True))
        # from nothing but what was before
        window = Segment(s.t[part], u[part], s.y[part], start, "", False, cut(early, part))
        run = follow_records(problem, candidate, theta, free, False, (window,))
        if run:
            errors[first + 1 : last + 1] = run[0][0][1:]
        for c, lag in enumerate(lags):
            known = slice(first + 1, min(last + 1, np.searchsorted(s.t, s.t[first] + lag)))
            errors[known, c] = E[known, c]
    return errors


def _in_time(f: Fit) -> tuple[Candidate, Array, float]:
    """Return a fitted candidate without its delay of the input, its coordinates, and the delay in s."""
    c, eq = f.candidate, f.candidate.equations
    kept = [k.name not in eq.delaying for k in c.coordinates]
    coordinates = tuple(k for k, keep in zip(c.coordinates, kept, strict=True) if keep)
    values = c.values | dict.fromkeys(eq.delaying, 0.0)
    return replace(c, coordinates=coordinates, values=values), f.theta[kept], max(float(eq.delay @ c.p(f.theta)), 0.0)


def _delayed(problem: Problem, s: Segment, delay: float) -> Array:
    """Return the input (T, m) of a record as it arrives: what it is at every sample where motion is imposed, else its
    means over the steps, the last sample held for one step more.
    """
    t, late = s.t, delay - s.early
    if problem.scale.imposed:
        return s.u[np.maximum(np.searchsorted(t + late, t, side="right") - 1, 0)]
    if isinstance(late, np.ndarray):
        late = np.append(late, late[-1])
    return arriving(np.append(t, 2 * t[-1] - t[-2]), np.vstack([s.u, s.u[-1:]]), late)


__all__ = ["best_level", "kind_of_score", "scores"]
