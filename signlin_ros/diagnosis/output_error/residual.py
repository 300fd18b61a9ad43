"""What a model leaves: is it more than the sensors' noise?

A force that the model lacks is a function of position, velocity, input and time. So the residual is regressed on
dozens of such functions and on the strongest patterns over the position (`patterns`), each as the observer would have
left it, and judged by how well that predicts unseen samples
[Stone, J. R. Stat. Soc. B 36 (1974) 111; residuals and functions of what is known: Billings and Voon, Int. J. Control
44 (1986) 235].
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len, rfft

from signlin_ros.comparison.residuals import colours
from signlin_ros.diagnosis.blocks import MIN_DIVISOR
from signlin_ros.diagnosis.criteria import Criteria
from signlin_ros.diagnosis.output_error import patterns
from signlin_ros.fitting.fit import Fit, fit
from signlin_ros.fitting.following import follow_records
from signlin_ros.fitting.gains import ObserverGains
from signlin_ros.fitting.problem import Problem
from signlin_ros.fitting.scan import halfway, response
from signlin_ros.follow.data import travelled
from signlin_ros.follow.segments import PreparedSegment

Array = NDArray[np.float64]

CROSS_VALIDATION_FOLDS, MIN_FOLDS = 8, 5
"""Parts that are left out in turn, at most and at least."""
FOLD_BLOCK, MIN_FOLD_SAMPLES, RESPONSE_LENGTHS = 0.25, 50, 2.0
"""Blocks of which these parts are made have at least so many s, so many samples and so many lengths of the observer's
response: else what a wandering state leaves would be predicted by what it left just before."""
MAX_TESTED_SAMPLES, MIN_SAMPLES_PER_FUNCTION, TEST_RIDGE = 30_000, 10, 1e-5
"""Samples that are looked at; samples for each function, below which nothing is said; ridge of the regression."""
FADING_SPEEDS = (0.1, 0.03)
"""Velocities, as shares of the largest, within which friction may fade."""
ABOUT, NEAR_ALL = 0.9, 0.99
"""Part of the sensor's variance from which on a residual is about as large: far less, and that noise is overrated; part
of a response that counts as nearly all of it."""


@dataclass(frozen=True)
class ResidualRegression:
    """A residual (T, ny) in units of the noise, and functions (T, ny, k) of the motion that may predict it; ``fold``
    (T,): which part a sample is left out with, ``used`` (folds, k): which functions predict that part, the first
    ``plain`` of them always, the others are patterns over the position.
    """

    functions: Array
    residual: Array
    fold: NDArray[np.int_]
    used: NDArray[np.bool_]
    plain: int

    def predicted(self) -> tuple[Array, Array]:
        """Return which share (ny) of the squared residual is predicted in parts that are left out: by the plain
        functions, and by all.
        """
        Z, y, fold = self.functions, self.residual, self.fold
        parts = [(Z[fold == i], y[fold == i]) for i in range(len(self.used))]
        grams = np.array([z.T @ z for z in (z.reshape(-1, z.shape[2]) for z, _ in parts)])
        sides = np.array([z.reshape(-1, z.shape[2]).T @ e.ravel() for z, e in parts])
        gram, side = grams.sum(axis=0), sides.sum(axis=0)
        scale, found = np.sqrt(np.maximum(np.diag(gram), MIN_DIVISOR)), []
        for most in (self.plain, Z.shape[2]):
            left = np.zeros(y.shape[1])
            for i, (z, e) in enumerate(parts):
                at = np.flatnonzero(self.used[i, :most])
                rest = (gram - grams[i])[np.ix_(at, at)] / np.outer(scale[at], scale[at])
                beta = np.linalg.solve(rest + TEST_RIDGE * np.eye(at.size), (side - sides[i])[at] / scale[at])
                left += np.sum((e - z[:, :, at] @ (beta / scale[at])) ** 2, axis=0)
            found.append(np.asarray(1.0 - left / np.maximum(np.sum(y**2, axis=0), MIN_DIVISOR)))
        return found[0], found[1]


@dataclass(frozen=True)
class ResidualStructure:
    """Tests of a channel's residual: RMS in multiples of the sensor's noise, the share of its square that follows from
    the model's motion (NaN: too few samples to tell), whether it has structure, and how many samples are correlated.

    The sensor's noise is white. Inputs that are recorded with noise, or in steps, add one that the motion gathers: an
    observer that allows for it leaves white noise of a right model, larger than the sensor's.
    """

    channel: str
    over_noise: float
    dependent: float
    structured: bool
    correlated_samples: float


def residual_tests(problem: Problem, f: Fit, criteria: Criteria) -> tuple[ResidualStructure, ...]:
    """Return tests of a fit's residual by channel under the slowest observer, a quick one hides what is missing; where
    inputs are not better known, under the slowest that allows for that.
    """
    lowest = problem.observer_gains[-1]
    slow = f if f.gains is lowest else fit(problem, f.candidate, lowest, f.theta, 0)
    f, lost = slow or f, slow is None
    result: list[ResidualStructure] = []
    found, shares = colours(f.innovations, problem.noise), dependence(problem, f, criteria).tolist()
    for channel, one, share, noise in zip(problem.channels, found, shares, problem.noise.tolist(), strict=True):
        over = float(np.sqrt(one.variance) / noise)
        noisy = ABOUT < over**2 < 1.0 + criteria.max_dependent_share
        dependent = share > criteria.max_dependent_share
        structured = lost or (not noisy and (one.structured or dependent))
        result.append(ResidualStructure(channel, over, share, bool(structured), one.together))
    return tuple(result)


def dependence(problem: Problem, f: Fit, criteria: Criteria) -> Array:
    """Return which share (ny) of the squared residual of a fit follows from its own motion, on samples left out; NaN
    where these are too few to tell, 0 of a model that an extended Kalman filter follows, whose gain changes. Where an
    inertia is moved, with the slowest observer whose response is short beside the parts that are left out. Patterns
    over the position count if they predict a share of it that counts by itself.
    """
    none, samples, c = np.zeros(len(problem.channels)), problem.samples, f.candidate
    if c.filtered:
        return none
    least = max(int(FOLD_BLOCK / problem.scale.step), MIN_FOLD_SAMPLES)
    looks: list[tuple[int, Array | None, ObserverGains]] = [(least, None, f.gains)]
    if problem.base.plant.velocity in c.model.states:
        model = f.fitted()
        seen = ((response(problem, model, gains), gains) for gains in problem.observer_gains[::-1])
        sizes = [(max(least, ceil(RESPONSE_LENGTHS * _length(r))), r, gains) for r, gains in seen]
        looks = [one for one in sizes if 2 * CROSS_VALIDATION_FOLDS * one[0] <= samples]
        looks += [one for one in sizes[-1:] if MIN_FOLDS * one[0] <= samples]
    found = _regression(problem, f, *looks[0]) if looks else None
    if found is None or found.residual.size < MIN_SAMPLES_PER_FUNCTION * int(found.used.sum(axis=1).max()):
        return none + np.nan
    plain, whole = found.predicted()
    return np.where(whole - plain > criteria.max_dependent_share, whole, plain)


def _regression(
    problem: Problem, f: Fit, block: int, seen: Array | None, gains: ObserverGains
) -> ResidualRegression | None:
    """Return functions of a fit's motion as an observer leaves them, and its residual; ``block``: samples that are left
    out together. None where the motion is lost.
    """
    run = follow_records(problem, f.candidate.started_for(f.gains.tau), f.theta, gains, False)
    if run is None:
        return None
    used = min(1.0, MAX_TESTED_SAMPLES / max(problem.samples, 1))
    known = [whole[: ceil(used * len(whole))] for whole in run[0]]
    motions = [_motion(problem, f, s, X) for s, X in zip(problem.segments, run[2], strict=True)]
    largest = np.maximum([np.max([np.abs(m[i]).max() for m in motions]) for i in range(3)], MIN_DIVISOR)
    tested = [tuple(m[: len(e)] for m in motion) for motion, e in zip(motions, known, strict=True)]
    residuals = [np.where(np.isfinite(e), e / problem.noise, 0.0) for e in known]
    fold = _folds([len(e) for e in known], block)
    chosen = _patterns(problem, f, [(q, v / largest[1]) for q, v, _ in tested], residuals, seen, fold)
    every = sorted({one for own in chosen for one in own})
    features = []
    for e, (q, v, u) in zip(known, tested, strict=True):
        plain = _functions(q / largest[0], v / largest[1], u / largest[2])
        left = _as_left(np.hstack([plain, patterns.functions(every, q, v / largest[1])]), seen, *e.shape)
        features.append(np.where(np.isfinite(e)[:, :, None], left, 0.0))
    count = features[0].shape[2] - 2 * len(every)
    of_fold = [[True] * count + [one in own for one in every for _ in range(2)] for own in chosen]
    return ResidualRegression(np.concatenate(features), np.concatenate(residuals), fold, np.array(of_fold), count)


def _folds(samples: Sequence[int], block: int) -> NDArray[np.int_]:
    """Return for every sample (T,) of stretches of so many ``samples`` the number of the part it is left out with."""
    numbers, done = [], 0
    for count in samples:
        numbers.append(np.arange(count) // block + done)
        done += count // block + 1
    every = np.concatenate(numbers)
    return np.asarray(every % min(CROSS_VALIDATION_FOLDS, int(every.max()) + 1))


def _patterns(
    problem: Problem,
    f: Fit,
    motions: Sequence[tuple[Array, Array]],
    residuals: Sequence[Array],
    seen: Array | None,
    fold: NDArray[np.int_],
) -> list[list[patterns.Pattern]]:
    """Return which patterns over the position predict each fold; none of a model that has waves itself, or without an
    inertia.
    """
    if seen is None or patterns.has_waves(f.candidate.model):
        return [[] for _ in range(int(fold.max()) + 1)]
    ends = np.cumsum([len(e) for e in residuals])
    places = np.concatenate([one[: len(e) - 1] for one, e in zip(np.split(fold, ends[:-1]), residuals, strict=True)])
    q, v = (np.concatenate([m[i][: len(e) - 1] for m, e in zip(motions, residuals, strict=True)]) for i in range(2))
    force = np.concatenate([patterns.force_left(e, seen) for e in residuals])
    return patterns.strongest(problem, q, v, force, places)


def _length(response: Array) -> int:
    """Return in how many samples (of M, ny) nearly all of a response happens, in the slowest channel."""
    share = np.cumsum(response**2, axis=0) / np.maximum(np.sum(response**2, axis=0), MIN_DIVISOR)
    return int(np.max(np.sum(share < NEAR_ALL, axis=0))) + 1


def _motion(problem: Problem, f: Fit, s: PreparedSegment, X: Array) -> tuple[Array, Array, Array]:
    """Return position, velocity and input (T,), between two samples where an inertia is moved."""
    names, plant, inputs = f.candidate.model.states, problem.base.plant, f.candidate.model.inputs
    if plant.velocity not in names:
        v = s.u[:, inputs.index(plant.velocity)]
        q = X[:, names.index(plant.position)] if plant.position in names else travelled(s.t, v)
        return q, v, np.zeros_like(v)
    v = X[:, names.index(plant.velocity)]
    return halfway(f.candidate.model, s.t, X), (v[1:] + v[:-1]) / 2, s.u[:-1, 0]


def _functions(q: Array, v: Array, u: Array) -> Array:
    """Return functions (T, k) of position, velocity, input and time, none larger than 2."""
    s, a, t = np.sign(v), np.abs(v), np.linspace(-1.0, 1.0, v.size)
    of_velocity = [s, s * np.sqrt(a), a, v * a, v**2, v**3, *(s * np.exp(-a / slow) for slow in FADING_SPEEDS)]
    of_position = [q**2, np.abs(q), q * np.abs(q), q**3, np.sin(3 * q), np.cos(3 * q)]
    of_both = [q * v, np.abs(q) * v, q**2 * v, q * a, s * q, s * np.abs(q), s * q**2]
    driven = [u, s * np.abs(u), u**2, np.abs(u), u * np.abs(u), u * v, u * q, np.abs(u - np.median(u))]
    slow = [np.ones_like(v), t, t**2, t * v, t * s]
    return np.column_stack([q, v, *of_velocity, *of_position, *of_both, *driven, *slow])


def _as_left(functions: Array, seen: Array | None, samples: int, channels: int) -> Array:
    """Return the innovations (T, ny, k) that forces make, (T - 1, k) between samples, or (T, k) at them if there is
    no inertia (``seen``: None).
    """
    if seen is None:
        return np.repeat(functions[:, None, :], channels, axis=1)
    size = next_fast_len(samples + len(seen), real=True)
    spectra = rfft(functions, size, axis=0)[:, None, :] * rfft(seen, size, axis=0)[:, :, None]
    found = np.zeros((samples, channels, functions.shape[1]))
    found[1:] = irfft(spectra, size, axis=0)[: samples - 1]
    return found


__all__ = ["ResidualStructure", "dependence", "residual_tests"]
