"""Does friction vary along the way? A search for waves over the position in what goes with the velocity.

A rail that is tighter in places, a seal or a bearing with a high spot: friction that varies with the position averages
out where the motion is fast, and a constant friction then leaves what looks like noise. No listed effect is one, so it
gets no name, but it can be told. What an observer leaves is filtered with its own response to a force (a matched
filter) and multiplied by the velocity, or its sign; peaks of the spectrum of that over the position show the waves.
Each is then regressed on, beside the same wave of a plain force and all that the fit's parameters could still change,
and tested by sums over blocks, whatever correlation what is left has within them [Hotelling, Ann. Math. Stat. 2 (1931)
360; Liang and Zeger, Biometrika 73 (1986) 13].
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar
from scipy.signal import fftconvolve
from scipy.stats import f as fisher
from scipy.stats import norm

from signlin_ros.diagnosis.dependence import BLOCK, LEAST, MOST
from signlin_ros.diagnosis.fit import Fit, follow_records
from signlin_ros.diagnosis.problem import Problem
from signlin_ros.diagnosis.scan import FASTEST, finest, halfway, peaks, response

Array = NDArray[np.float64]

PEAKS = 3
"""Waves that are tried for each law of friction."""
BLOCKS = 12
"""Blocks that a spread is told from, at least."""
PERIODS = 2.0
"""Periods that a travel must have to tell a wave from a slope."""
FINER = 0.02
"""What an order is known to, as a share of the distance of two that a travel tells apart."""
DIFFERENT, RELATIVE = 1e-3, 1e-8
"""Size, as a share, that must be left of a wave of friction beside the same wave of a plain force (none is, where the
motion has one direction); and what counts as singular."""


@dataclass(frozen=True)
class Varying:
    """Friction that varies with the position: the force is -a ``law`` sin(N q + phi).

    ``law``: "viscous" (a v) or "dry" (a sign v). ``order``: N, per unit of the position. ``amplitude``: a, in the units
    of force and velocity. ``force``: root mean square of that force. ``certainty``: in standard errors of a normal one.
    """

    law: str
    order: float
    amplitude: float
    force: float
    certainty: float


def varying(problem: Problem, f: Fit) -> Varying | None:
    """Return the wave of friction that takes most of what a fitted model leaves; None where there is none to look for:
    no inertia, or a model that an extended Kalman filter follows, or too few samples.
    """
    states = f.candidate.model.states
    gains, block = problem.levels[0], max(int(BLOCK / problem.scale.step), LEAST)
    if problem.scale.imposed or f.candidate.filtered or problem.base.plant.velocity not in states:
        return None
    runs = [follow_records(problem, f.candidate, f.theta, gains, with_s) for with_s in (False, True)]
    if runs[0] is None or runs[1] is None:
        return None
    used = min(1.0, MOST / max(problem.samples, 1))
    seen = f.filter.apply(response(problem, f.fitted(), gains))
    places, speeds, left, known, slopes, blocks, done = [], [], [], [], [], [], 0
    for s, e, X, D in zip(problem.segments, runs[0][0], runs[0][2], runs[1][1], strict=True):
        count = ceil(used * len(e))
        v = X[:count, states.index(problem.base.plant.velocity)]
        places.append(halfway(f.candidate.model, s.t[:count], X[:count]))
        speeds.append((v[1:] + v[:-1]) / 2)
        whitened = f.filter.apply(e[:count] / problem.noise)[1:]
        known.append(np.isfinite(whitened))
        left.append(np.nan_to_num(whitened))
        slopes.append(np.nan_to_num(f.filter.apply(D[:count] / problem.noise[:, None])[1:]))
        blocks.append(np.arange(count - 1) // block + done)
        done = int(blocks[-1][-1]) + 1
    if done < BLOCKS:
        return None
    rest, there = np.concatenate(left), np.concatenate(known)
    starting = np.repeat(np.diff(np.concatenate(blocks), prepend=-1) > 0, rest.shape[1])
    starting[1:] &= ~starting[:-1]
    base = np.concatenate(slopes).reshape(rest.size, -1)
    base = base[:, np.any(base != 0.0, axis=0)]

    def trace(forces: list[Array]) -> Array:
        """Return what an observer leaves (T ny, k) of forces (T, k)."""
        columns = [fftconvolve(one[:, None, :], seen[:, :, None], axes=0)[: len(one)] for one in forces]
        return np.asarray(np.where(there[:, :, None], np.concatenate(columns), 0.0).reshape(rest.size, -1))

    def tried(law: str, order: float) -> tuple[float, Varying] | None:
        """Return by how much a wave lowers the squares of what is left, and the wave."""
        size = [np.sign(v) if law == "dry" else v / problem.scale.velocity for v in speeds]
        waves = [np.column_stack([np.sin(order * q), np.cos(order * q)]) for q in places]
        beside = np.column_stack([base, trace(waves)])
        beside /= np.linalg.norm(beside, axis=0)
        columns = trace([w * a[:, None] for w, a in zip(waves, size, strict=True)])
        both = np.column_stack([columns, rest.ravel()])
        both -= beside @ np.linalg.lstsq(beside, both, rcond=RELATIVE)[0]
        alone, e = both[:, :2], both[:, 2]
        fitted = np.linalg.lstsq(alone, e, rcond=None)[0]
        sums = np.add.reduceat(alone * (e - alone @ fitted)[:, None], np.flatnonzero(starting))
        spread = np.cov(sums.T) * done
        if not (
            np.linalg.norm(alone) > DIFFERENT * np.linalg.norm(columns) and np.linalg.cond(spread) < 1.0 / RELATIVE
        ):
            return None
        squared = float(e @ alone @ np.linalg.solve(spread, alone.T @ e))
        chance = fisher.sf(squared * (done - 2) / (2 * (done - 1)), 2, done - 2)
        of_wave = problem.scale.inertia * fitted
        whole = np.concatenate([(w @ of_wave) * a for w, a in zip(waves, size, strict=True)])
        amplitude = float(np.hypot(*of_wave)) / (1.0 if law == "dry" else problem.scale.velocity)
        found = Varying(law, order, amplitude, float(np.sqrt(np.mean(whole**2))), float(norm.isf(chance)))
        return float(e @ alone @ fitted), found

    q = np.concatenate(places)
    lowest, highest = PERIODS * 2 * np.pi / max(float(np.ptp(q)), 1e-300), FASTEST / problem.scale.velocity
    highest = min(highest / problem.scale.step, finest(problem))
    matched = [fftconvolve(e, seen[::-1], axes=0).sum(axis=1)[len(seen) - 1 :][: len(e)] for e in left]
    found = []
    for law in ("viscous", "dry"):
        w = [g * (np.sign(v) if law == "dry" else v) for g, v in zip(matched, speeds, strict=True)]
        found += [tried(law, order) for order in peaks(q, np.concatenate(w), highest, PEAKS, lowest)]
    best = max((one for one in found if one), key=lambda one: one[0], default=None)
    if best is None:
        return None
    law, order, near = best[1].law, best[1].order, np.pi / float(np.ptp(q))
    finer = minimize_scalar(
        lambda N: -(tried(law, N) or (0.0, None))[0],
        bounds=(order - near, order + near),
        method="bounded",
        options={"xatol": FINER * near},
    )
    return max(best, tried(law, float(finer.x)) or best, key=lambda one: one[0])[1]


__all__ = ["Varying", "varying"]
