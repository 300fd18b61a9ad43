"""The one measure: errors over non-overlapping windows of the horizon, in blocks that two models share.

The state at the start of a window is estimated from the samples before it, then the model runs by itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from signlin_ros.comparison.scores import Score, rated
from signlin_ros.diagnosis.blocks import MAX_LOG_FALL, MIN_DIVISOR
from signlin_ros.diagnosis.criteria import Criteria
from signlin_ros.fitting.candidate import Candidate
from signlin_ros.fitting.following import follow_records
from signlin_ros.fitting.gains import ObserverGains
from signlin_ros.fitting.problem import Problem
from signlin_ros.follow.tracking import Tracker
from signlin_ros.predict import windows

Array = NDArray[np.float64]

MIN_WINDOW_BLOCKS, MAX_WINDOW_BLOCKS = 3, 100
"""Blocks of whole windows that a standard error is taken from, at least and at most."""
FORGOTTEN, FEWEST_PARTS = 1.0, 8
"""Length in s of a block of a free run in a closed loop, some times what the loop takes to forget; blocks at least."""
DIVERGED_VARIANCE = 1e6
"""Error of a model that diverges, in variances of the noise."""


@dataclass(frozen=True)
class Improvement:
    """What one model explains beyond another: ``t_ratio`` of all channels together, ``mse_reduction``: the largest
    share by which a channel's MSE beyond the noise falls, ``joint_reduction``: that of all channels together, each in
    units of its noise, and by channel (channels,) the t ratios and the ratios of RMSE.
    """

    t_ratio: float
    mse_reduction: float
    joint_reduction: float
    t_ratios: Array
    rmse_ratios: Array

    def worsened(self, c: Criteria) -> NDArray[np.bool_]:
        """Return which channels' errors (channels,) surely rise, and so that it shows."""
        return np.asarray((self.t_ratios < -c.max_rise_t) & (self.rmse_ratios > 1.0 + c.visible_change))

    def worsens(self, c: Criteria) -> bool:
        """Tell whether any channel's error surely rises, and so that it shows."""
        return bool(self.worsened(c).any())

    def falls_by_less(self, alike: float) -> bool:
        """Tell whether no channel's RMS falls by a part ``alike``."""
        return bool((self.rmse_ratios > 1.0 - alike).all())


def improvement(before: Array, after: Array, noise: Array) -> Improvement:
    """Compare two models by their mean squared errors (blocks, channels); ``noise`` (channels) of the sensors.

    Certainties are means over blocks of the logarithm by which the error falls, over their standard errors: where a
    motion dies down, the first blocks would else decide alone. Below the noise no error matters; to half the error
    counts as much as to a tenth [Huber, Robust Statistics, 1981, ch. 3], else a fall that varies would be in doubt.
    """
    there = np.isfinite(before) & np.isfinite(after)
    a, b = np.where(there, before, 0.0), np.where(there, after, 0.0)
    count = np.maximum(there.sum(axis=0), 1)
    first, second = a.sum(axis=0) / count, b.sum(axis=0) / count
    falls = np.clip(np.log((a + noise**2) / (b + noise**2)), -MAX_LOG_FALL, MAX_LOG_FALL)
    beyond = np.maximum(first - noise**2, 0.01 * first)
    share = float(np.max((first - second) / np.maximum(beyond, MIN_DIVISOR)))
    unit = np.maximum(noise**2, 1e-12 * first) + MIN_DIVISOR
    joint = float(np.sum((first - second) / unit) / max(float(np.sum(beyond / unit)), MIN_DIVISOR))
    each = np.array([_certainty(falls[there[:, c], c]) for c in range(falls.shape[1])])
    return Improvement(
        _certainty(falls.sum(axis=1)), share, joint, each, np.sqrt(second / np.maximum(first, MIN_DIVISOR))
    )


def _certainty(falls: Array) -> float:
    """Return the mean of falls (blocks) over its standard error, which is larger where neighbours go together; one more
    block, which tells nothing, is a doubt where all say the same.
    """
    if falls.size < MIN_WINDOW_BLOCKS:
        return 0.0
    falls = np.append(falls, 0.0)
    apart = falls - falls.mean()
    square = float(apart @ apart)
    r = min(max(float(apart[1:] @ apart[:-1]) / max(square, MIN_DIVISOR), 0.0), 0.9)
    error = np.sqrt(square / (falls.size - 1) / falls.size * (1 + r) / (1 - r))
    return float(falls.mean() / error) if error > 0 else 0.0


def beyond_noise(before: Array, after: Array, samples: Array, together: Array) -> float:
    """Return by how many standard errors of noise a model that leaves nothing else explains more than another.

    Its errors e are noise, those of the other e + d: squares differ by d (2 e + d), of standard deviation 2 |e| |d|, of
    ``samples`` (channels) of which, in coloured noise, ``together`` (channels) count as one.
    """
    first, second = np.nanmean(before, axis=0), np.maximum(np.nanmean(after, axis=0), MIN_DIVISOR)
    return float(np.sqrt(max(np.sum(samples / together * (first - second) / second) / 4, 0.0)))


def generalizes_badly(known: Array, unseen: Array, here: Array, there: Array, times: float) -> bool:
    """Tell whether mean squared errors (blocks, channels) of validation data are so many times those of known ones,
    both beside the noise of their sensors, ``there`` and ``here`` (channels): it follows only what it was fitted to.
    """
    first, second = (np.sqrt(np.nanmean(squares, axis=0)) for squares in (known, unseen))
    least = np.max([first * np.maximum(there / here, 1.0), here, there], axis=0)
    return bool(np.any(second > times * least))


def of_windows(problem: Problem, squares: Array, noise: Array) -> dict[str, Score]:
    """Return mean squared errors (blocks, channels) as scores by channel; ``noise`` (channels) of the sensors."""
    rmse = np.sqrt(np.nanmean(squares, axis=0))
    spread = np.nanstd(np.concatenate([s.y for s in problem.segments]), axis=0)
    rows = zip(problem.channels, rmse.tolist(), spread.tolist(), np.asarray(noise).tolist(), strict=True)
    return {name: rated(*row) for name, *row in rows}


def log_mse(squares: Array, noise: Array) -> float:
    """Return one number for errors (blocks, channels), less being better: the sum of the logarithms over channels."""
    return float(np.sum(np.log(np.nanmean(squares, axis=0) + (0.1 * noise) ** 2)))


def blocks_per_record(problem: Problem) -> int:
    """Return how many blocks each record of a plant in a closed loop makes."""
    shortest = min(float(s.t[-1] - s.t[0]) for s in problem.segments)
    return max(int(shortest / FORGOTTEN), -(-FEWEST_PARTS // len(problem.segments)), 1)


def windowed(problem: Problem, c: Candidate, theta: Array, gains: ObserverGains, parts: int | None = None) -> Array:
    """Return the mean squared errors (blocks, channels) of a candidate over windows of the horizon; of a plant in a
    closed loop over each record, run freely, in so many ``parts`` (by default `blocks_per_record`).
    """
    cuts = _cuts(problem, parts or blocks_per_record(problem))
    errors = _errors(problem, c, theta, gains, cuts)
    if errors is None:
        errors = [np.sqrt(DIVERGED_VARIANCE) * problem.noise + np.zeros(s.y.shape) for s in problem.segments]
    closed = problem.base.plant.closed_loop
    group = 1 if closed else max(1, -(-sum(len(at) - 1 for at in cuts) // MAX_WINDOW_BLOCKS))
    result = []
    for e, at in zip(errors, cuts, strict=True):
        first = 0 if closed else 1
        begin, there = np.array(at[first:-1:group], dtype=int) + first, np.isfinite(e[: at[-1] + 1])
        count = np.add.reduceat(there, begin, axis=0, dtype=float)
        squares = np.add.reduceat(np.where(there, e[: at[-1] + 1], 0.0) ** 2, begin, axis=0)
        result.append(np.where(count > 0, squares / np.maximum(count, 1), np.nan))
    return np.concatenate(result)


def _cuts(problem: Problem, parts: int) -> list[list[int]]:
    """Return where the windows of every record begin, and where the last one ends; nothing is scored in the first.

    Of a plant in a closed loop a whole record is one free run: these are but its parts.
    """
    if problem.base.plant.closed_loop:
        return [np.linspace(0, s.t.size - 1, parts + 1).round().astype(int).tolist() for s in problem.segments]
    return [[0, *(last for _, last in windows(s.t, problem.horizon))] for s in problem.segments]


def _errors(
    problem: Problem, c: Candidate, theta: Array, gains: ObserverGains, cuts: Sequence[Sequence[int]]
) -> list[Array] | None:
    """Return the errors (T, ny) of every record; None where the model diverges."""
    run = follow_records(problem, c, theta, gains, False)
    if run is None:
        return None
    if problem.base.plant.closed_loop:
        return run[0]
    model, found = c.model_at(theta), []
    for s, e, X, at in zip(problem.segments, run[0], run[2], cuts, strict=True):
        known = X if c.filtered else _corrected(gains, c, X, e)
        least = [max(problem.x_scale.get(name, 0.0), 1e-9) for name in model.states]
        size = np.maximum(least, np.abs(known).max(axis=0))
        tracker = Tracker(model.under(c.conditions(theta, s)), s.t, s.u, s.y, problem.channels, size, s.early)
        free = tracker.restarted(known, at[:-1])
        if free.stopped is not None:
            return None
        found.append(s.y - _shown(c.sensors(c.p(theta)), tracker, known, free.state, at))
    return found


def _corrected(gains: ObserverGains, c: Candidate, X: Array, e: Array) -> Array:
    """Return the states (T, n) with what the sample itself tells of them."""
    rows = gains.rows(c.model.states, c.floating)
    held = rows[np.minimum(np.arange(len(X)), len(rows) - 1)]
    return np.asarray(X + np.einsum("kij,kj->ki", held, np.nan_to_num(e)))


def _shown(sensors: tuple[Array, ...], run: Tracker, known: Array, free: Array, at: Sequence[int]) -> Array:
    """Return the channels (T, ny) of free runs (T, n), ``sensors`` and their delays included."""
    t, (gain, offset, lags) = run.t, sensors
    acting = np.searchsorted(t, t - (run.model.delay - run.early) + 1e-9, side="right") - 1
    u = run.u[np.clip(acting, 0, t.size - 1)]
    outputs = Tracker(run.model, t, u, run.y, run.channels, np.ones(len(run.model.states))).outputs
    shown = outputs(free)
    for j in np.flatnonzero(lags > 0.0).tolist():
        then, begun = np.maximum(t - lags[j], t[0]), t[np.asarray(at)[np.searchsorted(at[1:], np.arange(t.size))]]
        states = (run.between(known, starts, then) for starts in (np.arange(t.size), np.asarray(at[:-1] or at)))
        shown[:, j] = outputs(np.where((then < begun)[:, None], *states))[:, j]
    return np.asarray(gain * shown + offset)


__all__ = ["Improvement", "beyond_noise", "generalizes_badly", "improvement", "log_mse", "of_windows", "windowed"]
