"""Where a record starts: what nobody measured of its first state is fitted to the first samples."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from math import ceil
from typing import Any

import numpy as np
from numpy.typing import NDArray

from signlin_ros.effects import EFFECTS
from signlin_ros.fitting.candidate import Candidate
from signlin_ros.fitting.problem import Problem
from signlin_ros.follow.loop import MOST, follow
from signlin_ros.follow.segments import Segment, twin

Array = NDArray[np.float64]
TURN, FASTER = 0.8, 1.5
"""Largest phase in rad by which a periodic force may turn in a substep, at that multiple of the RMS velocity."""
RESTING, MEMORY, REMEMBERED = 0.02, 400, 3.0
"""A record is at rest below this share of the RMS velocity; else what is remembered is fitted to so many samples, all
that is unknown together to so many time constants of the observer."""
SECANTS, SWEEPS, SETTLED, NEARBY = 8, 4, 1e-3, 0.1
"""Most secants of one unknown, and of all; share of the squares that is no gain; part of the reach for slopes."""
LOST = 1e100
"""Errors from which on a start leads nowhere: it is sought anew."""


@dataclass(frozen=True)
class Start:
    """Where a ``record`` was found to start: the state x (n,), the steps ``near`` (k, n) by which slopes were
    found, and by what these changed the errors: ``changes`` (k, size), None where not kept.
    """

    x: Array
    near: Array
    changes: Array | None = None
    record: Segment | None = None


def turns(problem: Problem, c: Candidate, p: Array) -> int:
    """Return the substeps that periodic forces ask for: the phase of each must not turn by more than `TURN` in one."""
    names = [f"{key}.{n}" for key, use in c.model.effects.items() for n in EFFECTS[use.type].periodic[:1]]
    order = max((abs(p[c.equations.parameters.index(name)]) for name in names), default=0.0)
    return ceil(min(order * FASTER * problem.scale.velocity * problem.scale.step / TURN, MOST))


def record_start(problem: Problem, c: Candidate, s: Segment, tau: float, rest: tuple[Any, ...]) -> Array:
    """Return the state (n,) that a record starts from.

    Where it starts in motion, what an effect remembers (a bristle's bend, by how much a load lags) is fitted to the
    first samples by secants: it is no parameter, since its derivative vanishes where it is best. Where nobody saw the
    position, all that is unknown is then fitted together, to as many samples as an observer of time constant ``tau`` in
    s remembers it; a wrong model would bend a seen one. The next time it is sought from where it was found.
    """
    twins = [n if n in s.start else twin(n, tuple(s.start)) for n in c.model.states]
    x0, (rows, *others) = np.array([s.start.get(n, 0.0) for n in twins]), rest
    unknown = {**_unknown(problem, c, s), **_late_states(problem, s, others[4])} if s.whole else {}
    if not unknown:
        return x0
    eq, ny = c.equations, s.y.shape[1]
    fixed: tuple[Any, ...] = eq.calls(False, c.filtered), eq.flags(False, turns(problem, c, others[0]))
    none = np.zeros((0, ny, eq.sizes[3]))

    def run(x: Array, size: int) -> tuple[Array, Array]:
        E, X = np.zeros((size, ny)), np.zeros((size, x.size))
        arguments: tuple[Any, ...] = (s.t[:size], s.u[:size], s.y[:size], rows, x, *others, E, none, X)
        if follow(*fixed, *arguments) < size:
            E[:] = np.inf
        return np.nan_to_num(E / problem.noise, posinf=1e150).ravel(), X

    size, longer, position = min(s.t.size, MEMORY), 0, problem.base.plant.position
    if position not in s.start and position in c.model.states:
        longer = min(s.t.size, max(size, ceil(REMEMBERED * tau / problem.scale.step)))

    def errors(x: Array) -> Array:
        return run(x, longer or size)[0]

    key = id(s), tau, *unknown
    found = c.starts.get(key)
    if found is not None:
        found = replace(found, x=np.where([i in unknown for i in range(x0.size)], found.x, x0))
        e = errors(found.x)
        found = _descended(errors, found, e, SWEEPS)[0] if np.abs(e).max() < LOST else None
    if found is None:
        found = _sought(lambda x: run(x, size), x0, unknown)
        found = _descended(errors, found, errors(found.x), SWEEPS)[0] if longer else found
    c.starts[key] = replace(found, record=s)  # which keeps the identity its own
    return found.x


def _unknown(problem: Problem, c: Candidate, s: Segment) -> dict[int, tuple[int, float]]:
    """Return the states whose start is fitted: (what each moves with or -1, by how much it may be off).

    0: as far as it ever gets from what it moves with. A velocity is among them where it was not measured, but other
    channels than the position tell of it, and what bends with it.
    """
    names, plant = c.model.states, problem.base.plant
    unknown: dict[int, tuple[int, float]] = {}
    if moving(problem, s):
        twins = {i: twin(n, names) for i, n in enumerate(names) if "." in n and not (c.filtered and n in c.floating)}
        others = set(problem.channels) - {plant.position}
        if others and plant.velocity in names and plant.velocity not in others and not all(twins.values()):
            unknown[names.index(plant.velocity)] = (-1, abs(s.start.get(plant.velocity, 0.0)))
        unknown |= {i: (names.index(twin) if twin else -1, 0.0) for i, twin in twins.items()}
        if plant.position in names and plant.position not in s.start:
            unknown[names.index(plant.position)] = (-1, 0.0)
    if c.angular and plant.position in s.start and plant.position in problem.channels:
        unknown[names.index(plant.position)] = (-1, float(problem.noise[problem.channels.index(plant.position)]))
    return unknown


def _late_states(problem: Problem, s: Segment, lags: Array) -> dict[int, tuple[int, float]]:
    """Return the states of which a record first shows what they were before it, and how far they get in that time."""
    found = {}
    for y, (lag, state, _, marked) in zip(s.y.T, lags.tolist(), strict=False):
        count = min(ceil(lag / problem.scale.step), s.t.size - 1)
        if marked and count > 0:
            found[int(state)] = (-1, float(np.sqrt(np.nanmean((y[count:] - y[:-count]) ** 2))))
    return found


def _sought(run: Callable[[Array], tuple[Array, Array]], x: Array, unknown: Mapping[int, tuple[int, float]]) -> Start:
    """Return where the errors of what is ``run`` from x (n,) are least, one unknown state after the other."""
    e, X = run(x)
    near = np.zeros((0, x.size))
    for i, (other, known) in unknown.items():
        apart = X[:, i] - (X[:, other] if other >= 0 else 0.0)
        reach = (known or float(np.abs(apart).max())) * np.eye(x.size)[i]
        tried = [(x + sign * reach, run(x + sign * reach)[0]) for sign in (-1.0, 1.0)]
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
        gained, enough = e @ e - new @ new, SETTLED * (e @ e)
        if gained > 0:
            x, e = moved, new
        if not (gained > enough or (old and gained < -enough)):
            break
        changes = None
    return Start(x, near, changes), e


def moving(problem: Problem, s: Segment) -> bool:
    """Tell whether a record starts in motion, for all that is known."""
    return bool(abs(s.start.get(problem.base.plant.velocity, np.inf)) > RESTING * problem.scale.velocity)


__all__ = ["moving", "record_start", "turns"]
