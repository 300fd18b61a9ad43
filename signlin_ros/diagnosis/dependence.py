"""Does what a model leaves follow from its own motion? Then it is no noise, however white it looks.

A force that the model lacks is a function of position, velocity, input and time. It may come out of a resonance, or of
an observer, as something that autocorrelations take for noise: under a noisy input the square of a displacement is
noise too. So the residual is regressed on some dozens of such functions, each as the observer would have left it, and
judged by how well it predicts samples that the regression did not see [cross-validation: Stone, J. R. Stat. Soc. B 36
(1974) 111; correlation of residuals with functions of what is known: Billings and Voon, Int. J. Control 44 (1986) 235].
"""

from __future__ import annotations

from math import ceil

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len, rfft
from scipy.stats import norm
from scipy.stats import t as student

from signlin_ros.diagnosis.data import travelled
from signlin_ros.diagnosis.fit import Fit, follow_records
from signlin_ros.diagnosis.problem import Gains, Problem, Segment
from signlin_ros.diagnosis.scan import halfway, response

Array = NDArray[np.float64]

FOLDS, BLOCK, LEAST = 8, 0.25, 50
"""Parts of the record that are left out in turn, each made of blocks of so many s, and samples, at least."""
REMEMBERED, SEPARATE = 0.99, 2.0
"""Share of the squares of a response that counts as its length, and how many such lengths a block must have: or else
what a wandering state leaves would be predicted by what it left just before."""
RIDGE = 1e-5
MOST = 30_000
"""Samples that are looked at, from the start of every record on."""
ENOUGH = 10
"""Samples for each function, below which nothing is said."""
BLOCKS = 12
"""Blocks that a spread is told from, at least."""
SLOW, SLOWER = 0.1, 0.03
"""Velocities, as shares of the largest, within which friction may fade."""


def dependence(problem: Problem, f: Fit, of_input: bool = True) -> Array:
    """Return which share (ny,) of the squared residual of a fit follows from its own motion, on samples left out.

    ``of_input``: functions of the input count too; of a square wave that was recorded with noise they tell that noise.
    0 or less: none. Nothing is said (0) of a model that an extended Kalman filter follows, whose gain changes.
    """
    c, none = f.candidate, np.zeros(len(problem.channels))
    if c.filtered:
        return none
    moving = problem.base.plant.velocity in c.model.states
    seen, gains, block = None, f.gains, max(int(BLOCK / problem.scale.step), LEAST)
    if moving:
        fitted = f.fitted()
        looks = ((response(problem, fitted, one), one) for one in problem.levels[::-1])
        sizes = ((max(block, ceil(SEPARATE * _length(r))), r, one) for r, one in looks)
        block, seen, gains = next((s for s in sizes if 2 * FOLDS * s[0] <= problem.samples), (0, None, gains))
    found = _regressors(problem, f, gains, seen, block, of_input) if block else None
    if found is None:
        return none
    Z, y, block_of = found
    return none if y.size < ENOUGH * Z.shape[2] else _predicted(Z, y, block_of % FOLDS)


def strongest(problem: Problem, f: Fit) -> float:
    """Return by how many standard errors a fit's residual goes with that function of its motion that it goes best with.

    At the gain of the fit, where its residual is nearly white: one function at a time tells what is lost among dozens.
    The standard error is that of sums over blocks in which the observer forgets (as a normal one, however many they
    are); 0 where they are too few.
    """
    gains, block = f.gains, max(int(BLOCK / problem.scale.step), LEAST)
    if f.candidate.filtered or problem.base.plant.velocity not in f.candidate.model.states:
        return 0.0
    seen = response(problem, f.fitted(), gains)
    block = max(block, ceil(SEPARATE * _length(seen)))
    found = _regressors(problem, f, gains, seen, block, False) if problem.samples >= BLOCKS * block else None
    if found is None:
        return 0.0
    Z, y, block_of = found
    products = np.array([(Z[block_of == i] * y[block_of == i, :, None]).sum(axis=0) for i in range(block_of[-1] + 1)])
    spread = np.std(products, axis=0, ddof=1) * np.sqrt(len(products))
    t = float(np.max(np.abs(products.sum(axis=0)) / np.maximum(spread, 1e-300)))
    return float(norm.isf(student.sf(t, len(products) - 1)))


def _regressors(
    problem: Problem, f: Fit, gains: Gains, seen: Array | None, block: int, of_input: bool
) -> tuple[Array, Array, NDArray[np.int_]] | None:
    """Return functions (T, ny, k) of a fit's motion as an observer leaves them and its residual (T, ny) at some gains,
    both whitened, and the number (T,) of the block that a sample is in; None where the motion is lost.
    """
    run = follow_records(problem, f.candidate, f.theta, gains, False)
    if run is None:
        return None
    used = min(1.0, MOST / max(problem.samples, 1))
    motions = [_motion(problem, f, s, X) for s, X in zip(problem.segments, run[2], strict=True)]
    largest = np.maximum([np.max([np.abs(m[i]).max() for m in motions]) for i in range(3)], 1e-300)
    features, residuals, blocks, done = [], [], [], 0
    for whole, motion in zip(run[0], motions, strict=True):
        e = whole[: ceil(used * len(whole))]
        known = np.isfinite(e)
        whitened = f.filter.apply(np.nan_to_num(e / problem.noise))
        q, v, u = (m[: len(e)] / size for m, size in zip(motion, largest, strict=True))
        left = left_of(_functions(q, v, u, of_input), seen, len(e), e.shape[1])
        features.append(np.where(known[:, :, None], f.filter.apply(left), 0.0))
        residuals.append(np.where(known, whitened, 0.0))
        blocks.append(np.arange(len(e)) // block + done)
        done += len(e) // block + 1
    return np.concatenate(features), np.concatenate(residuals), np.concatenate(blocks)


def _length(response: Array) -> int:
    """Return in how many samples (of M, ny) nearly all of a response happens, in the slowest channel."""
    share = np.cumsum(response**2, axis=0) / np.maximum(np.sum(response**2, axis=0), 1e-300)
    return int(np.max(np.sum(share < REMEMBERED, axis=0))) + 1


def _motion(problem: Problem, f: Fit, s: Segment, X: Array) -> tuple[Array, Array, Array]:
    """Return position, velocity and input (T,), between two samples where an inertia is moved."""
    names, plant, inputs = f.candidate.model.states, problem.base.plant, f.candidate.model.inputs
    if plant.velocity not in names:
        v = s.u[:, inputs.index(plant.velocity)]
        q = X[:, names.index(plant.position)] if plant.position in names else travelled(s.t, v)
        return q, v, np.zeros_like(v)
    v = X[:, names.index(plant.velocity)]
    return halfway(f.candidate.model, s.t, X), (v[1:] + v[:-1]) / 2, s.u[:-1, 0]


def _functions(q: Array, v: Array, u: Array, of_input: bool) -> Array:
    """Return functions (T, k) of position, velocity and perhaps input, none larger than 2, and of time.

    Of the input one is told always, that noise in it does not go with [on average by how much f(u) changes with u:
    Stein, Ann. Statist. 9 (1981) 1135]: what its two halves do differently.
    """
    s, a, t = np.sign(v), np.abs(v), np.linspace(-1.0, 1.0, v.size)
    of_velocity = [s, s * np.sqrt(a), a, v * a, v**2, v**3, s * np.exp(-a / SLOW), s * np.exp(-a / SLOWER)]
    of_position = [q**2, np.abs(q), q * np.abs(q), q**3, np.sin(3 * q), np.cos(3 * q)]
    of_both = [q * v, np.abs(q) * v, q**2 * v, q * a, s * q, s * np.abs(q), s * q**2]
    driven = [u, s * np.abs(u), u**2, np.abs(u), u * np.abs(u), u * v, u * q] if of_input else []
    driven.append(np.abs(u - np.median(u)))
    slow = [np.ones_like(v), t, t**2, t * v, t * s]
    return np.column_stack([q, v, *of_velocity, *of_position, *of_both, *driven, *slow])


def left_of(functions: Array, seen: Array | None, samples: int, channels: int) -> Array:
    """Return what an observer leaves (T, ny, k) of forces (T - 1, k) between samples, or (T, k) at them if there is
    no inertia (``seen``: None).
    """
    if seen is None:
        return np.repeat(functions[:, None, :], channels, axis=1)
    size = next_fast_len(samples + len(seen), real=True)
    spectra = rfft(functions, size, axis=0)[:, None, :] * rfft(seen, size, axis=0)[:, :, None]
    found = np.zeros((samples, channels, functions.shape[1]))
    found[1:] = irfft(spectra, size, axis=0)[: samples - 1]
    return found


def _predicted(Z: Array, y: Array, fold: NDArray[np.int_]) -> Array:
    """Return which share (ny,) of the squares of y (T, ny) a regression on Z (T, ny, k) predicts in folds left out."""
    parts = [(Z[fold == i].reshape(-1, Z.shape[2]), y[fold == i].ravel()) for i in range(FOLDS)]
    grams, sides = np.array([z.T @ z for z, _ in parts]), np.array([z.T @ e for z, e in parts])
    scale = np.sqrt(np.maximum(np.diag(grams.sum(axis=0)), 1e-300))
    left = np.zeros(y.shape[1])
    for i in range(FOLDS):
        rest = (grams.sum(axis=0) - grams[i]) / np.outer(scale, scale) + RIDGE * np.eye(scale.size)
        beta = np.linalg.solve(rest, (sides.sum(axis=0) - sides[i]) / scale) / scale
        left += np.sum((y[fold == i] - Z[fold == i] @ beta) ** 2, axis=0)
    return np.asarray(1.0 - left / np.maximum(np.sum(y**2, axis=0), 1e-300))


__all__ = ["dependence", "left_of", "strongest"]
