"""What a motion lacks without an effect: each sample predicted from the one before, by the model without it.

What comes beyond the prediction, over what a unit of force would have done in that time, is the missing force. It is
taken twice: from the measurements, and from the motion of the model *with* the effect, to which sticking, delays and
own states belong. What acts in the winding comes out as a voltage, what acts in an output or a sensor in the unit of
that channel.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from signlin_ros.diagnosis.data import arriving
from signlin_ros.diagnosis.equations import equations, neutral_sensors
from signlin_ros.diagnosis.fit import follow_records
from signlin_ros.diagnosis.missing import per_force
from signlin_ros.diagnosis.problem import Problem, Segment, added_keys, bare, first_look, linear_base
from signlin_ros.diagnosis.rank import Ranked
from signlin_ros.model import Model
from signlin_ros.sensors import Sensor

Array = NDArray[np.float64]
Sensors = dict[str, Sensor]

SUBSTEP, MOST, STABLE, BOUND = 0.5, 30, 2.0, 2000
"""Largest product of a substep and the fastest rate, in up to so many substeps between two samples; beyond, that for
which a step is stable, in up to so many: what is so fast is over within a sample.
"""
LEAST = 3
HOLE = 3.0
"""Over steps of more than this many median steps nothing is said."""


@dataclass(frozen=True)
class Target:
    """Where an effect shows: ``kind`` is state, output or sensor; ``quantity`` and ``unit`` of what is lacking there.

    ``per_unit``: what a unit of it does to the rate of the state.
    """

    kind: str
    name: str
    quantity: str
    unit: str
    per_unit: float = 1.0


@dataclass(frozen=True, eq=False)
class Motion:
    """The records of a problem as a fitted model sees them.

    ``model`` and ``sensors`` with the effect, ``without`` and ``blind`` without it; ``before`` and ``after`` (T, n) for
    each record: states of the model with the effect, before and after the correction at each sample; ``innovations``
    (T, ny).
    """

    problem: Problem
    model: Model
    without: Model
    effect: str
    sensors: Sensors
    blind: Sensors
    before: tuple[Array, ...]
    after: tuple[Array, ...]
    innovations: tuple[Array, ...]

    @property
    def step(self) -> float:
        """The time between samples in s."""
        return self.problem.scale.step

    @property
    def of_sensor(self) -> bool:
        """Whether the effect is a fault of a sensor."""
        return self.sensors != self.blind


def motion_of(problem: Problem, ranked: Ranked, effect: str) -> Motion | None:
    """Follow the records with a fitted set of effects, one of which is to be looked at; None if it diverges.

    An ``effect`` that is not in the set leaves the model as it is.
    """
    c, theta = ranked.fit.candidate, ranked.fit.theta
    found = follow_records(problem, c, theta, ranked.fit.gains, False)
    if found is None:
        return None
    E, _, X = found
    rows = ranked.fit.gains.rows(c.model.states)
    after = [x + np.einsum("kij,kj->ki", _held(rows, len(x)), np.nan_to_num(e)) for x, e in zip(X, E, strict=True)]
    model = without = ranked.fit.fitted()
    for key in added_keys(problem, model, effect):
        without = without.without_effect(key)
    values = dict(zip(c.equations.parameters, c.p(theta).tolist(), strict=True))
    sensors = _sensors(problem, values)
    named = {n for n in ranked.sensors if n.partition(".")[0] == effect}
    blind = _sensors(problem, {n: v for n, v in values.items() if n not in named})
    return Motion(problem, model, without, effect, sensors, blind, tuple(X), tuple(after), tuple(E))


def _held(gains: Array, count: int) -> Array:
    """Return a gain for each of ``count`` samples, the last one held."""
    return np.asarray(gains[np.minimum(np.arange(count), len(gains) - 1)])


def _sensors(problem: Problem, values: dict[str, float]) -> Sensors:
    found = {}
    for channel in problem.channels:
        base = problem.base.sensors.get(channel, Sensor())
        own = {n: values.get(f"sensor_{n}.{channel}", getattr(base, n)) for n in ("gain", "offset", "delay")}
        found[channel] = Sensor(**own)
    return found


# -------------------------------------------------------------------- where it shows


def target(motion: Motion) -> Target | None:
    """Return where the effect of a motion shows most, among what the records let one see; None if nowhere."""
    problem, plant = motion.problem, motion.model.plant
    if motion.of_sensor:
        channel = next(c for c in problem.channels if motion.sensors[c] != motion.blind[c])
        return Target("sensor", channel, f"{channel} shown too much", motion.problem.shown(motion.model.units[channel]))
    changes = _changes(motion)
    seen = [n for n in problem.channels if n in changes]
    if plant.velocity in changes and plant.velocity not in seen:
        seen.append(plant.velocity)
    best = max(seen, key=lambda n: changes[n], default=None)
    if best is None or (changes[best] == 0.0 and plant.velocity not in changes):
        return None
    if changes[best] == 0.0:
        best = plant.velocity
    return target_at(motion, best)


def target_at(motion: Motion, name: str) -> Target:
    """Return the state or the output of that name as a target."""
    model, plant = motion.without, motion.model.plant
    if name not in model.states:
        return Target("output", name, f"missing {name}", motion.problem.shown(model.units[name]))
    if name == plant.velocity:
        unit = motion.problem.shown(plant.force_unit)
        quantity = "missing force" if unit == "N" else "missing torque"
        plain = bare(model)
        return Target("state", name, quantity, unit, float(per_force(plain)[plain.states.index(name)]))
    states, _, B, _ = linear_base(model, motion.problem.channels)
    return Target("state", name, f"missing {model.inputs[0]}", plant.input_unit, float(B[states.index(name), 0]))


def _changes(motion: Motion) -> dict[str, float]:
    """Return by how much the effect changes the rate of every state of the plant, and every output: RMS over RMS."""
    problem, without = motion.problem, motion.without
    X, late, u = _along(motion)
    a, b = _rates(problem, motion.model, X, late), _rates(problem, without, X[:, _shared(motion)], u)
    plant = set(bare(without).states) - {without.plant.position}
    found = {}
    for name in [*without.states, *(c for c in problem.channels if c not in without.states)]:
        if name in plant or name not in without.states:
            i, j = _column(problem, motion.model, name), _column(problem, without, name)
            size = _rms(a[:, i])
            found[name] = _rms(a[:, i] - b[:, j]) / size if size > 0 else 0.0
    return found


def dependence(motion: Motion, goal: Target) -> dict[str, float]:
    """Return how much of what the effect does at the target goes with each state and input: the RMS change when its
    values are dealt out to the samples anew, over the largest of these; nothing where it does not act there at once.
    """
    X, late, u = _along(motion)
    order = np.random.default_rng(0).permutation(len(X))
    does = _does(motion, goal, X, late, u)
    found = {}
    for j, name in enumerate(motion.model.states):
        moved = X.copy()
        moved[:, j] = X[order, j]
        found[name] = _rms(_does(motion, goal, moved, late, u) - does)
    for j, name in enumerate(motion.model.inputs):
        parts = [v.copy() for v in (late, u)]
        for v in parts:
            v[:, j] = v[order, j]
        found[name] = _rms(_does(motion, goal, X, parts[0], parts[1]) - does)
    most = max(found.values())
    return {name: size / most for name, size in found.items()} if most > 1e-9 * _rms(does) > 0 else {}


def _does(motion: Motion, goal: Target, X: Array, late: Array, u: Array) -> Array:
    """Return what the effect changes at the target (T,) at states X (T, n) and inputs with and without its delay."""
    a = _rates(motion.problem, motion.model, X, late)[:, _column(motion.problem, motion.model, goal.name)]
    b = _rates(motion.problem, motion.without, X[:, _shared(motion)], u)
    return np.asarray(a - b[:, _column(motion.problem, motion.without, goal.name)])


def _along(motion: Motion) -> tuple[Array, Array, Array]:
    """Return states (T, n), and inputs (T, m) as late as with and as without the effect, all records end to end."""
    segments = motion.problem.segments
    X = np.concatenate([x[:-1] for x in motion.after])
    late, u = (np.concatenate([_acting(motion, s, m.delay) for s in segments]) for m in (motion.model, motion.without))
    return X, late, u


def _acting(motion: Motion, s: Segment, delay: float) -> Array:
    """Return the means of the input over the steps (T - 1, m); where motion is imposed, what it is at their starts."""
    return arriving(s.t, s.u, delay if motion.problem.scale.imposed else delay - s.early)


def _shared(motion: Motion) -> list[int]:
    return [motion.model.states.index(n) for n in motion.without.states]


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _column(problem: Problem, model: Model, name: str) -> int:
    """Return where `_rates` has the rate of a state or the value of an output."""
    return model.states.index(name) if name in model.states else len(model.states) + problem.channels.index(name)


def _rates(problem: Problem, model: Model, X: Array, u: Array) -> Array:
    """Return rates of the states and values of the channels (T, n + ny) at X (T, n) and inputs u (T, m)."""
    eq = equations(model.structure, problem.channels, ())
    n, ny = len(model.states), len(problem.channels)
    velocity = _velocity(model, X, u)
    columns = [*X.T, *u.T, *model.p, *neutral_sensors(ny), np.sign(velocity)]
    out = eq.keep.batch([np.broadcast_to(c, (len(X),)) for c in columns])
    return np.asarray(np.concatenate([out[:n], out[eq.places.h :][:ny]]).T)


def _velocity(model: Model, X: Array, u: Array) -> Array:
    name = model.plant.velocity
    return np.asarray(X[:, model.states.index(name)] if name in model.states else u[:, model.inputs.index(name)])


# -------------------------------------------------------------------- what is lacking


def lacking(motion: Motion, goal: Target) -> tuple[list[Array], list[Array]]:
    """Return what every record (T - 1,) lacks at the target without the effect: as measured, as with the effect."""
    held = _unmeasured(motion)
    measured, computed = [], []
    for i, s in enumerate(motion.problem.segments):
        if goal.kind == "state":
            seen, own = _seen(motion, i, held[i]), _own(motion, i, held[i], goal)
            pair = _beyond(motion, goal, s, seen, seen[1:]), _beyond(motion, goal, s, own[0], own[1])
        else:
            pair = _in_channel(motion, goal, i)
        gap = np.diff(s.t) > HOLE * motion.step
        measured.append(np.where(gap, np.nan, pair[0]))
        computed.append(np.where(gap, np.nan, pair[1]))
    return measured, computed


def _unmeasured(motion: Motion) -> list[Array]:
    """Return the states (T, n) of the model without the effect, held to every record by a high gain.

    States of the effects that it has are those of the model with the effect: they follow the motion anyway.
    """
    problem, without = motion.problem, motion.without
    segments = [replace(s, y=_true(motion.blind, problem, s)) for s in problem.segments]
    looks = first_look(without, segments, problem.channels, problem.levels[0])
    plant = bare(without).states
    for X, known in zip(looks, motion.after, strict=True):
        for j, name in enumerate(without.states):
            if name not in plant and name in motion.model.states:
                X[:, j] = known[:, motion.model.states.index(name)]
    return looks


def _true(sensors: Sensors, problem: Problem, s: Segment) -> Array:
    """Return what is measured (T, ny), freed of what the sensors add."""
    columns = []
    for name, y in zip(problem.channels, s.y.T, strict=True):
        x = np.asarray(sensors[name].true(y))
        columns.append(np.interp(s.t + sensors[name].delay, s.t, x) if sensors[name].delay else x)
    return np.column_stack(columns)


def _shown(sensors: Sensors, name: str, t: Array, x: Array) -> Array:
    """Return what a sensor shows of true values x (T,)."""
    late = np.interp(t - sensors[name].delay, t, x) if sensors[name].delay else x
    return np.asarray(sensors[name].show(late))


def measured_columns(motion: Motion, i: int) -> dict[str, Array]:
    """Return position and velocity, and every other channel, of record i (T,) as measured; velocities are derived."""
    problem, plant, s = motion.problem, motion.model.plant, motion.problem.segments[i]
    found: dict[str, Array] = dict(zip(problem.channels, _true(motion.blind, problem, s).T, strict=True))
    if plant.position in found and plant.velocity not in found and plant.velocity in motion.without.states:
        found[plant.velocity] = np.gradient(found[plant.position], s.t)
    return found


def _seen(motion: Motion, i: int, held: Array) -> Array:
    """Return the states (T, n) of the model without the effect: measured where they are, else as held."""
    X, known = held.copy(), measured_columns(motion, i)
    for j, name in enumerate(motion.without.states):
        if name in known:
            X[:, j] = known[name]
    return np.asarray(X)


def _own(motion: Motion, i: int, held: Array, goal: Target) -> tuple[Array, Array]:
    """Return the same of the motion of the model with the effect, as the sensors would show it: the states (T, n) that
    its steps start from, and those (T - 1, n) that they end at.
    """
    known, t = measured_columns(motion, i), motion.problem.segments[i].t
    start, end = held.copy(), held[1:].copy()
    for j, name in enumerate(motion.without.states):
        if name in known or name == goal.name:
            column = motion.model.states.index(name)
            for source, to, part in ((motion.after, start, slice(None)), (motion.before, end, slice(1, None))):
                to[:, j] = _as_shown(motion, name, t, source[i][:, column])[part]
    return start, end


def _as_shown(motion: Motion, name: str, t: Array, x: Array) -> Array:
    """Return a true state (T,) as the sensors show it, freed of what the known ones among them add."""
    if name not in motion.sensors or motion.sensors[name] == motion.blind[name]:
        return np.asarray(x)
    shown = _shown(motion.sensors, name, t, x)
    return np.asarray(motion.blind[name].true(shown))


def _beyond(motion: Motion, goal: Target, s: Segment, start: Array, end: Array) -> Array:
    """Return what the steps from ``start`` (T, n) to ``end`` (T - 1, n) do beyond the model, per unit (T - 1,)."""
    model, steps = motion.without, np.diff(s.t)
    row = model.states.index(goal.name)
    states, A, _, _ = linear_base(model, motion.problem.channels)
    decay = float(A[states.index(goal.name), states.index(goal.name)]) * steps
    effective = steps * np.where(np.abs(decay) > 1e-6, np.expm1(decay) / np.where(decay == 0, 1.0, decay), 1.0)
    rates = np.abs(np.linalg.eigvals(A))
    predicted = _stepped(motion.problem, model, start[:-1], _acting(motion, s, model.delay), steps, rates)
    return np.asarray((end[:, row] - predicted[:, row]) / (effective * goal.per_unit))


def _stepped(problem: Problem, model: Model, X: Array, u: Array, steps: Array, rates: Array) -> Array:
    """Return the states (T, n) a step later, with Runge and Kutta's method in substeps."""
    fastest = float(np.max(rates, initial=0.0)) * float(np.median(steps))
    fine, stable = np.clip(np.ceil(fastest / SUBSTEP), LEAST, MOST), np.ceil(min(fastest / STABLE, BOUND))
    count = int(max(fine, stable))
    h, n, x = (steps / count)[:, None], X.shape[1], X
    for _ in range(count):
        k1 = _rates(problem, model, x, u)[:, :n]
        k2 = _rates(problem, model, x + h / 2 * k1, u)[:, :n]
        k3 = _rates(problem, model, x + h / 2 * k2, u)[:, :n]
        k4 = _rates(problem, model, x + h * k3, u)[:, :n]
        x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return np.asarray(x)


def _in_channel(motion: Motion, goal: Target, i: int) -> tuple[Array, Array]:
    """Return what an output or a sensor shows beyond the model without the effect (T - 1,): measured, computed."""
    problem, s = motion.problem, motion.problem.segments[i]
    c = problem.channels.index(goal.name)
    shown = s.y[:, c] - motion.innovations[i][:, c]
    X = motion.before[i]
    if goal.name in motion.model.states:
        true = X[:, motion.model.states.index(goal.name)]
    else:
        u = np.concatenate([_acting(motion, s, motion.without.delay), s.u[-1:]])
        true = _rates(problem, motion.without, X[:, _shared(motion)], u)[:, _column(problem, motion.without, goal.name)]
    expected = _shown(motion.blind, goal.name, s.t, true)
    return s.y[1:, c] - expected[1:], shown[1:] - expected[1:]


def smoothed(parts: Sequence[Array], width: int) -> Array:
    """Return all parts (T,) one after the other, each passed through a Hann window of ``width`` samples.

    Missing samples (NaN) stay missing, and count nothing in their neighbours.
    """
    window = np.hanning(width + 2)[1:-1]
    found = []
    for part in parts:
        there = np.isfinite(part)
        sums = np.convolve(np.where(there, part, 0.0), window, mode="same")
        weight = np.convolve(there.astype(float), window, mode="same")
        found.append(np.where(there, sums / np.where(weight > 0, weight, 1.0), np.nan)[: part.size])
    return np.concatenate(found)


__all__ = [
    "Motion",
    "Target",
    "dependence",
    "lacking",
    "measured_columns",
    "motion_of",
    "smoothed",
    "target",
    "target_at",
]
