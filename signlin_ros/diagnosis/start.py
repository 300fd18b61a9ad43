"""Where a record starts: what nobody measured of its first state is fitted to the first samples."""

from __future__ import annotations

from collections.abc import Callable
from math import ceil
from typing import Any

import numpy as np
from numpy.typing import NDArray

from signlin_ros.diagnosis.candidate import Candidate
from signlin_ros.diagnosis.follow import MOST, follow
from signlin_ros.diagnosis.problem import Problem
from signlin_ros.diagnosis.segments import Segment, twin
from signlin_ros.effects import find_effect

Array = NDArray[np.float64]
TURN, FASTER = 0.8, 1.5
"""Largest phase in rad by which a periodic force may turn in a substep, at that multiple of the RMS velocity."""
RESTING, MEMORY = 0.02, 400
"""A record is at rest below this share of the RMS velocity; else what is remembered is fitted to so many samples."""
SECANTS, SETTLED = 8, 1e-3
"""Most secants, and the share of the squared errors below which another one gains nothing."""
SWEEPS, NEARBY, REMEMBERED = 4, 0.1, 3.0
"""Most steps of all that is unknown of a start together, the part of its reach by which slopes are found, and so many
time constants of the observer as that is remembered."""


def _initial(c: Candidate, s: Segment) -> Array:
    x0 = []
    for name in c.model.states:
        source = name if name in s.start else twin(name, tuple(s.start))
        x0.append(s.start.get(source, 0.0))
    return np.array(x0)


def turns(problem: Problem, c: Candidate, p: Array) -> int:
    """Return the substeps that periodic forces ask for: the phase of each must not turn by more than `TURN` in one."""
    turned = 0.0
    for key, use in c.model.effects.items():
        for name in find_effect(use.type, "effects").periodic[:1]:
            order = p[c.equations.parameters.index(f"{key}.{name}")]
            turned = max(turned, abs(order) * FASTER * problem.scale.velocity * problem.scale.step)
    return ceil(min(turned / TURN, MOST))


def record_start(problem: Problem, c: Candidate, s: Segment, tau: float, rest: tuple[Any, ...]) -> Array:
    """Return the state (n,) that a record starts from.

    Where it starts in motion, what an effect remembers (a bristle's bend, a temperature, by how much a load lags) is
    fitted to the first samples by secants: it is no parameter, since its derivative vanishes where it is best. Where
    nobody saw the position, all that is unknown is then fitted together, to as many samples as an observer of time
    constant ``tau`` in s remembers it; a wrong model would bend to its ends a position that was seen.
    """
    x0 = _initial(c, s)
    rows, *others = rest
    unknown = {**_unknown(problem, c, s), **_late_states(problem, s, others[4])} if s.whole else {}
    if not unknown:
        return x0
    eq = c.equations

    def run(x: Array, size: int) -> tuple[Array, Array]:
        t, u, y = s.t[:size], s.u[:size], s.y[:size]
        E, X = np.zeros((size, y.shape[1])), np.zeros((size, x.size))
        arguments: tuple[Any, ...] = (eq.flags(False, turns(problem, c, others[0])), t, u, y, rows, x, *others)
        arguments = (eq.calls(False, c.filtered), *arguments, E, np.zeros((0, y.shape[1], eq.sizes[3])), X)
        if follow(*arguments) < size:
            E[:] = np.inf
        return np.nan_to_num(E / problem.noise, posinf=1e150).ravel(), X

    size, reaches = min(s.t.size, MEMORY), []
    e, X = run(x0, size)
    for i, (other, known) in unknown.items():
        apart = X[:, i] - (X[:, other] if other >= 0 else 0.0)
        reaches.append((known or float(np.abs(apart).max())) * np.eye(x0.size)[i])
        x0, e = _by_secants(lambda x: run(x, size)[0], x0, e, reaches[-1])
    position = problem.base.plant.position
    if position in s.start or position not in c.model.states:
        return x0
    longer = min(s.t.size, max(size, ceil(REMEMBERED * tau / problem.scale.step)))
    return _descended(lambda x: run(x, longer)[0], x0, run(x0, longer)[0], np.array(reaches), SWEEPS)[0]


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


def _by_secants(errors: Callable[[Array], Array], x: Array, e: Array, reach: Array) -> tuple[Array, Array]:
    """Return the point x (n,) moved along ``reach`` (n,) to where the errors are least, and these."""
    tried = [(x + sign * reach, errors(x + sign * reach)) for sign in (-1.0, 1.0)]
    x, e = min([(x, e), *tried], key=lambda pair: float(pair[1] @ pair[1]))
    return _descended(errors, x, e, reach[None], SECANTS)


def _descended(errors: Callable[[Array], Array], x: Array, e: Array, reaches: Array, most: int) -> tuple[Array, Array]:
    """Return the point x (n,) moved in the span of ``reaches`` (k, n) to where the errors are least, and these: steps
    of Gauss and Newton with secants for slopes.
    """
    near = NEARBY * reaches
    for _ in range(most):
        changes = np.stack([errors(x + r) - e for r in near])
        products = changes @ changes.T
        if not 0.0 < products.max() < np.inf:
            break
        moved = x - np.linalg.lstsq(products, changes @ e, rcond=1e-13)[0] @ near
        new = errors(moved)
        gained = e @ e - new @ new
        if gained > 0:
            x, e = moved, new
        if not gained > SETTLED * (e @ e):
            break
    return x, e


def moving(problem: Problem, s: Segment) -> bool:
    """Tell whether a record starts in motion, for all that is known."""
    return bool(abs(s.start.get(problem.base.plant.velocity, np.inf)) > RESTING * problem.scale.velocity)


__all__ = ["moving", "record_start", "turns"]
