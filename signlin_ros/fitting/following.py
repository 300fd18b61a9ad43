"""Records followed by a candidate that an observer corrects: innovations, their derivatives, states."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import ceil

import numpy as np
from numpy.typing import NDArray

from signlin_ros.fitting.candidate import Candidate
from signlin_ros.fitting.gains import Gains
from signlin_ros.fitting.problem import Problem
from signlin_ros.fitting.start import moving, record_start, turns
from signlin_ros.follow.loop import NONE_LATE, follow
from signlin_ros.follow.segments import Segment, twin
from signlin_ros.follow.tracking import mean_square

Array = NDArray[np.float64]
Followed = tuple[list[Array], list[Array], list[Array]]
"""Innovations, their derivatives and states of every record."""

APART, WANDER = 0.3, 0.05
"""How uncertain the start of a floating load is, and how far it wanders in a second: parts of excursion, velocity."""


@np.errstate(over="ignore", invalid="ignore")
def follow_records(
    problem: Problem, c: Candidate, theta: Array, gains: Gains, with_s: bool, segments: Sequence[Segment] | None = None
) -> Followed | None:
    """Return innovations (T, ny), their derivatives to the free parameters (T, ny, np and more columns of 0) and states
    (T, n) for every record; None if it diverges.

    While a delayed input is still that from before the record, which nobody knows, the observer stays wide awake, and
    what it leaves counts as much as the rest, of which a fit gains nothing.
    """
    p, eq, states, plant, imposed = c.p(theta), c.equations, c.model.states, c.model.plant, problem.scale.imposed
    ny, flags = eq.sizes[2], eq.flags(with_s, turns(problem, c, p))
    scale, lags, delay = _scale(problem, c), _seen_late(problem, c, p), max(float(eq.delay @ p), 0.0)
    belief = _belief(problem, c, gains, dict(zip(problem.channels, c.sensors(p)[0], strict=True)))
    variances, ringing = problem.noise**2, eq.ringing(p, scale)
    rows = gains.rows(states, c.floating) / c.sensors(p)[0]  # what floats: by the filter, or not at all
    unknown = ceil(delay / problem.scale.step) + 1 if delay > 0.0 else 0
    held = np.concatenate([np.repeat(rows[:1], unknown, axis=0), rows])
    weights = np.concatenate([np.zeros((unknown, ny)), gains.weights])
    found: Followed = ([], [], [])
    for s in segments or problem.segments:
        E, D = np.zeros((s.t.size, ny)), np.empty((s.t.size if with_s else 0, ny, flags[-1]))
        X = np.zeros((0, 0)) if with_s else np.zeros((s.t.size, len(states)))
        late = lags.copy()
        late[:, 3:] = (s.inner or (s.whole and moving(problem, s))) and not imposed  # nobody saw what was before
        rest = (p, scale, delay - s.early, ringing, late, belief, variances)
        x0 = record_start(problem, c, s, gains.tau, (rows, *rest)).copy()
        if imposed and delay and plant.position in states:
            x0[states.index(plant.position)] -= delay * s.u[0, c.model.inputs.index(plant.velocity)]
        own = [i for i, name in enumerate(states) if "." in name and not twin(name, tuple(s.start))]
        if s.before and own:
            lead = follow_records(problem, c, theta, gains, False, (s.before,))
            if lead is None:
                return None
            x0[own] = lead[2][0][-1, own]
        arguments = (flags, s.t, s.u, s.y, held, x0, *rest)
        if follow(eq.calls(with_s, c.filtered), *arguments, E, D, X) < s.t.size or np.isinf(E).any():
            return None
        E[: len(weights)] *= weights[: len(E)]
        D[: len(weights)] *= weights[: len(D), :, None]
        unseen = ((np.arange(len(E)) < unknown)[:, None] | (np.isnan(E) & late[:, 3:].any())) & np.isfinite(s.y)
        if unseen.any():
            _fill(E, unseen, problem.noise)
        for kept, one in zip(found, (E, D, X), strict=True):
            kept.append(one)
    return found


def _fill(E: Array, what: NDArray[np.bool_], noise: Array) -> None:
    """Put the root mean square of the others in place of some innovations (T, ny); the noise where there are none."""
    usual = np.sqrt(mean_square(np.where(what, np.nan, E)))
    E[what] = np.broadcast_to(np.where(np.isfinite(usual), usual, noise), E.shape)[what]


def _belief(problem: Problem, c: Candidate, gains: Gains, shown: Mapping[str, float]) -> Array:
    """Return what `follow` takes for an extended Kalman filter where motion is sensitive; (3, 0) where it is not. What
    a sensor shows larger than it is (``shown``: its gain) moves less than it seems to: a gain must not fit the filter.
    """
    names, floating, scale = c.model.states, c.floating, problem.scale
    if not c.filtered:
        return np.zeros((3, 0))
    apart = {"position": scale.excursion, "velocity": scale.velocity}
    found, moved = np.ones((3, len(names))), (problem.base.plant.position, problem.base.plant.velocity)
    motion = next((shown[n] for n in moved if n in shown), 1.0)
    for i, name in enumerate(names):
        larger = shown.get(name, motion if name in moved or name in floating else 1.0) ** 2
        if name in gains.names:
            found[:2, i] = gains.spread[:, gains.names.index(name)] / larger
            continue
        own = name.rpartition(".")[2]
        size = APART * apart.get(own, 0.0) if name in floating else 0.0
        found[:, i] = WANDER**2 * size**2 * scale.step / larger, size**2 / larger, 2.0 if own == "position" else 1.0
    return found


def _scale(problem: Problem, c: Candidate) -> Array:
    """Return the size of every state (n,): as the problem has it, or that of what it moves with."""
    known, units = problem.x_scale, c.model.trace.units
    sizes = {n: known.get(n) or known.get(twin(n, tuple(known)), 0.0) for n in c.model.states}
    own = {True: problem.scale.travel, False: 100.0}
    return np.array([size or own[units[name] == problem.base.plant.position_unit] for name, size in sizes.items()])


def _seen_late(problem: Problem, c: Candidate, p: Array) -> Array:
    """Return by how much every channel is seen late, for `follow`."""
    free, rows = [k.name for k in c.coordinates], []
    for channel, lag in zip(problem.channels, c.sensors(p)[2], strict=True):
        name = f"sensor_delay.{channel}"
        state = c.model.states.index(channel) if channel in c.model.states else 0
        rows.append((lag, state, free.index(name) if name in free else -1, 0.0))
    return np.array(rows) if any(lag or at >= 0 for lag, _, at, _ in rows) else NONE_LATE


__all__ = ["follow_records"]
