"""Records followed by a candidate that an observer corrects, from a start that is fitted where nobody saw it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import ceil
from typing import Any

import numpy as np
from numpy.typing import NDArray

from signlin_ros.effects import EFFECTS
from signlin_ros.fitting.candidate import Candidate
from signlin_ros.fitting.gains import ObserverGains
from signlin_ros.fitting.problem import Problem
from signlin_ros.follow.data import acting
from signlin_ros.follow.loop import MAX_SUBSTEPS, NONE_LATE, follow
from signlin_ros.follow.segments import PreparedSegment, twin
from signlin_ros.follow.tracking import mean_square
from signlin_ros.par import declared_name

Array = NDArray[np.float64]
Followed = tuple[list[Array], list[Array], list[Array]]
"""Innovations, their derivatives and states of every record."""

LOAD_START_SPREAD = 0.3
"""How uncertain the start of a floating load is: parts of excursion, velocity."""
MAX_PHASE_STEP, MAX_PHASE_RATIO = 0.8, 1.5
"""Largest phase in rad by which a periodic force may turn in a substep, at that multiple of the RMS velocity; and
within what a sensor cannot tell of a start."""
MAX_REST_SPEED, MAX_START_SAMPLES, START_TIME_CONSTANTS = 0.02, 400, 3.0
"""Share of the RMS velocity of a record at rest; samples, and time constants, to which what is unknown is fitted."""
MAX_START_DEVIATIONS, WAVES = 3.0, (-1.0, -2 / 3, -1 / 3, 1 / 3, 2 / 3, 1.0)
"""How far a start may be from what a sensor shows, in its standard deviations; parts of that where it is sought."""
MAX_START_CHANGE = 5.0
"""By how many standard deviations of its noise a channel changes that shows motion."""
SECANTS, MAX_START_SWEEPS, MIN_START_GAIN, NEARBY = 8, 4, 1e-3, 0.1
"""Most secants of one unknown, and of all; share of the squares that is no gain; part of the reach for slopes."""
DIVERGED_ERROR = 1e100
"""Errors from which on a start leads nowhere: it is sought anew."""


@np.errstate(over="ignore", invalid="ignore")
def follow_records(
    problem: Problem,
    c: Candidate,
    theta: Array,
    gains: ObserverGains,
    with_s: bool,
    segments: Sequence[PreparedSegment] | None = None,
) -> Followed | None:
    """Return innovations (T, ny), their derivatives to the free parameters (T, ny, np and more columns of 0) and states
    (T, n) for every record; None if it diverges. While a delayed input is still that from before the record, the
    observer stays wide awake, and what it leaves counts as much as the rest: a fit gains nothing of it.
    """
    p, eq, states, plant, imposed = c.p(theta), c.equations, c.model.states, c.model.plant, problem.scale.imposed
    ny, flags = eq.sizes[2], eq.flags(with_s, _turns(problem, c, p))
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
        late[:, 3] = s.inner or (s.whole and (_moving(problem, s) or _moved_unseen(problem, s, lags)))
        late[:, 3] *= not imposed  # else nobody saw what was before
        u, acts = acting(problem.base, s.t, s.u, delay - s.early)
        own_p = c.under(p, c.conditions(theta, s))
        rest = (own_p, scale, acts, ringing, late, belief, variances)
        x0 = _record_start(problem, c, s, gains.tau, (u, rows, *rest)).copy()
        if imposed and delay and plant.position in states:
            x0[states.index(plant.position)] -= delay * s.u[0, c.model.inputs.index(plant.velocity)]
        own = [i for i, name in enumerate(states) if "." in name and not twin(name, tuple(s.start))]
        if s.before and own:
            lead = follow_records(problem, c, theta, gains, False, (s.before,))
            if lead is None:
                return None
            x0[own] = lead[2][0][-1, own]
        arguments = (flags, s.t, u, s.y, held, x0, *rest)
        if follow(eq.calls(with_s, c.filtered), *arguments, E, D, X) < s.t.size or np.isinf(E).any():
            return None
        E[: len(weights)] *= weights[: len(E)]
        D[: len(weights)] *= weights[: len(D), :, None]
        if unknown or late[:, 3:].any():
            unseen = ((np.arange(len(E)) < unknown)[:, None] | (np.isnan(E) & late[:, 3:].any())) & np.isfinite(s.y)
            usual = np.sqrt(mean_square(np.where(unseen, np.nan, E)))
            E[unseen] = np.broadcast_to(np.where(np.isfinite(usual), usual, problem.noise), E.shape)[unseen]
        for kept, one in zip(found, (E, c.to_coordinates(D, s), X), strict=True):
            kept.append(one)
    return found


def _belief(problem: Problem, c: Candidate, gains: ObserverGains, shown: Mapping[str, float]) -> Array:
    """Return the arguments of `follow` for an extended Kalman filter where motion is sensitive; (3, 0) where it is not.
    What a sensor shows larger than it is (``shown``: its gain) moves less than it seems to: a gain must not fit the
    filter.
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
        size = LOAD_START_SPREAD * apart.get(own, 0.0) if name in floating else 0.0
        found[:, i] = (
            c.load_wander**2 * size**2 * scale.step / larger,
            size**2 / larger,
            2.0 if own == "position" else 1.0,
        )
    return found


def _scale(problem: Problem, c: Candidate) -> Array:
    """Return the size of every state (n,): as the problem has it, or that of what it moves with."""
    known, units = problem.x_scale, c.model.trace.units
    sizes = {n: known.get(n) or known.get(twin(n, tuple(known)), 0.0) for n in c.model.states}
    own = {True: problem.scale.travel, False: 100.0}
    return np.array([size or own[units[name] == problem.base.plant.position_unit] for name, size in sizes.items()])


def _seen_late(problem: Problem, c: Candidate, p: Array) -> Array:
    """Return by how much every channel is seen late, for `follow`."""
    free, rows = list(c.equations.free), []
    for channel, lag in zip(problem.channels, c.sensors(p)[2], strict=True):
        name = f"sensor_delay.{channel}"
        state = c.model.states.index(channel) if channel in c.model.states else 0
        rows.append((lag, state, free.index(name) if name in free else -1, 0.0))
    return np.array(rows) if any(lag or at >= 0 for lag, _, at, _ in rows) else NONE_LATE


# -------------------------------------------------------------------- where a record starts


@dataclass(frozen=True)
class Start:
    """Where a ``record`` starts: x (n,), steps ``near`` (k, n) for slopes, ``changes`` (k, size) of the errors."""

    x: Array
    near: Array
    changes: Array | None = None
    record: PreparedSegment | None = None


def _turns(problem: Problem, c: Candidate, p: Array) -> int:
    """Return the substeps that periodic forces ask for: the phase of each must not turn by more than `MAX_PHASE_STEP`
    in one.
    """
    names = [f"{key}.{n}" for key, use in c.model.effects.items() for n in EFFECTS[use.type].periodic[:1]]
    order = max((abs(p[c.equations.parameters.index(name)]) for name in names), default=0.0)
    return ceil(
        min(order * MAX_PHASE_RATIO * problem.scale.velocity * problem.scale.step / MAX_PHASE_STEP, MAX_SUBSTEPS)
    )


def _record_start(problem: Problem, c: Candidate, s: PreparedSegment, tau: float, rest: tuple[Any, ...]) -> Array:
    """Return the state (n,) that a record starts from. Where it starts in motion, what an effect remembers is fitted to
    the first samples by secants: its derivative vanishes where it is best. Where nobody saw the position, all that is
    unknown is fitted together, to as many samples as an observer of time constant ``tau`` in s remembers it.
    """
    twins = [n if n in s.start else twin(n, tuple(s.start)) for n in c.model.states]
    x0, (u, rows, *others) = np.array([s.start.get(n, 0.0) for n in twins]), rest
    unknown = {**_unknown(problem, c, s, others[0]), **_late_states(problem, s, others[4])} if s.whole else {}
    if not unknown:
        return x0
    eq, ny = c.equations, s.y.shape[1]
    fixed: tuple[Any, ...] = eq.calls(False, c.filtered), eq.flags(False, _turns(problem, c, others[0]))
    none = np.zeros((0, ny, eq.sizes[3]))

    def run(x: Array, size: int) -> tuple[Array, Array]:
        E, X = np.zeros((size, ny)), np.zeros((size, x.size))
        arguments: tuple[Any, ...] = (s.t[:size], u, s.y[:size], rows, x, *others, E, none, X)
        if follow(*fixed, *arguments) < size:
            E[:] = np.inf
        e = (E / problem.noise).ravel()
        return e if np.isfinite(e).all() else np.nan_to_num(e, posinf=1e150), X

    size, longer, position = min(s.t.size, MAX_START_SAMPLES), 0, problem.base.plant.position
    if position not in s.start and position in c.model.states:
        longer = min(s.t.size, max(size, ceil(START_TIME_CONSTANTS * tau / problem.scale.step)))

    def errors(x: Array) -> Array:
        return run(x, longer or size)[0]

    key = id(s), tau, *unknown
    found = c.starts.get(key)
    if found is not None:
        found = replace(found, x=np.where([i in unknown for i in range(x0.size)], found.x, x0))
        e = errors(found.x)
        found = _descended(errors, found, e, MAX_START_SWEEPS)[0] if np.abs(e).max() < DIVERGED_ERROR else None
    if found is None:
        shown = c.angular and position in s.start and position in problem.channels
        found = _sought(lambda x: run(x, size), x0, unknown, c.model.states.index(position) if shown else -1)
        found = _descended(errors, found, errors(found.x), MAX_START_SWEEPS)[0] if longer else found
        if elsewhere := _elsewhere(c, key):
            found = min((found, *elsewhere), key=lambda one: mean_square(run(one.x, s.t.size)[0][:, None])[0])
    c.starts[key] = replace(found, record=s)  # which keeps the identity its own
    return found.x


def _elsewhere(c: Candidate, key: tuple[Any, ...]) -> list[Start]:
    """Return where a record starts for observers other than that of a ``key``: it is no matter of what observes it, and
    the first samples of what never forgets may say little of it.
    """
    others = [one for k, one in c.starts.items() if k != key and (k[0], *k[2:]) == (key[0], *key[2:])]
    return [replace(one, changes=None) for one in others]


def _unknown(problem: Problem, c: Candidate, s: PreparedSegment, p: Array) -> dict[int, tuple[int, float]]:
    """Return the states whose start is fitted: what each moves with or -1, by how much it may be off (0: as far as it
    gets from what it moves with). A velocity only where other channels than the position tell of it; a position that is
    shown only where forces turn within what its sensor cannot tell: else an observer knows as much of it.
    """
    names, plant = c.model.states, problem.base.plant
    unknown: dict[int, tuple[int, float]] = {}
    if plant.closed_loop:
        return {names.index(name): (-1, reach) for name, reach in s.doubt.items()}
    if _moving(problem, s):
        twins = {i: twin(n, names) for i, n in enumerate(names) if "." in n and not (c.filtered and n in c.floating)}
        others = set(problem.channels) - {plant.position}
        if others and plant.velocity in names and plant.velocity not in others and not all(twins.values()):
            unknown[names.index(plant.velocity)] = (-1, abs(s.start.get(plant.velocity, 0.0)))
        unknown |= {i: (names.index(twin) if twin else -1, 0.0) for i, twin in twins.items()}
        if plant.position in names and plant.position not in s.start:
            unknown[names.index(plant.position)] = (-1, 0.0)
    if c.angular and plant.position in s.start and plant.position in problem.channels:
        reach = MAX_START_DEVIATIONS * float(problem.noise[problem.channels.index(plant.position)])
        if _finest_order(c, p) * reach > MAX_PHASE_STEP:
            unknown[names.index(plant.position)] = (-1, reach)
    return unknown


def _finest_order(c: Candidate, p: Array) -> float:
    """Return the largest order of the forces over the position; a weight is one of order one."""
    names = [
        f"{key}.{name}"
        for key, use in c.model.effects.items()
        for name in use.parameters
        if declared_name(name) in EFFECTS[use.type].order_names()
    ]
    return max((abs(p[c.equations.parameters.index(name)]) for name in names), default=1.0)


def _late_states(problem: Problem, s: PreparedSegment, lags: Array) -> dict[int, tuple[int, float]]:
    """Return the states of which a record first shows what they were before it, and how far they get in that time."""
    found = {}
    for y, (lag, state, _, marked) in zip(s.y.T, lags.tolist(), strict=False):
        count = min(ceil(lag / problem.scale.step), s.t.size - 1)
        if marked and count > 0:
            found[int(state)] = (-1, _usual_change(y, count))
    return found


def _usual_change(y: Array, count: int) -> float:
    """Return the RMS change of a channel y (T,) over so many samples."""
    return float(np.sqrt(np.nanmean((y[count:] - y[:-count]) ** 2)))


def _sought(
    run: Callable[[Array], tuple[Array, Array]], x: Array, unknown: Mapping[int, tuple[int, float]], angular: int
) -> Start:
    """Return where errors of a ``run`` from x (n,) are least, state by state; ``angular``: one sought among `WAVES`."""
    e, X = run(x)
    near = np.zeros((0, x.size))
    for i, (other, known) in unknown.items():
        apart = X[:, i] - (X[:, other] if other >= 0 else 0.0)
        reach = (known or float(np.abs(apart).max())) * np.eye(x.size)[i]
        tried = [(x + part * reach, run(x + part * reach)[0]) for part in (WAVES if i == angular else (-1.0, 1.0))]
        x, e = min([(x, e), *tried], key=lambda pair: float(pair[1] @ pair[1]))
        found, e = _descended(lambda x: run(x)[0], Start(x, NEARBY * reach[None]), e, SECANTS)
        x, near = found.x, np.concatenate([near, found.near])
    return Start(x, near)


def _descended(errors: Callable[[Array], Array], start: Start, e: Array, most: int) -> tuple[Start, Array]:
    """Return a start, of errors e, moved to the least ones by Gauss and Newton's steps with secants, and these."""
    x, near, changes = start.x, start.near, start.changes
    for _ in range(most):
        old = changes is not None
        if changes is None:
            changes = np.stack([errors(x + r) - e for r in near])
        products = changes @ changes.T
        if not 0.0 < products.max() < np.inf:
            break
        moved = x - np.linalg.lstsq(products, changes @ e, rcond=1e-13)[0] @ near
        new = errors(moved)
        gained, enough = e @ e - new @ new, MIN_START_GAIN * (e @ e)
        if gained > 0:
            x, e = moved, new
        if not (gained > enough or (old and gained < -enough)):
            break
        changes = None
    return Start(x, near, changes), e


def _moved_unseen(problem: Problem, s: PreparedSegment, lags: Array) -> bool:
    """Tell whether a late channel shows that a record which seems to start at rest does not: it changes while it still
    shows what was before.
    """
    for y, noise, (lag, *_) in zip(s.y.T, problem.noise.tolist(), lags.tolist(), strict=False):
        count = min(ceil(lag / problem.scale.step), s.t.size - 1)
        changes = np.abs(y[1 : count + 1] - y[0])
        if count > 0 and np.any(changes > MAX_REST_SPEED * _usual_change(y, count) + MAX_START_CHANGE * noise):
            return True
    return False


def _moving(problem: Problem, s: PreparedSegment) -> bool:
    """Tell whether a record starts in motion, for all that is known."""
    return bool(abs(s.start.get(problem.base.plant.velocity, np.inf)) > MAX_REST_SPEED * problem.scale.velocity)


__all__ = ["follow_records"]
