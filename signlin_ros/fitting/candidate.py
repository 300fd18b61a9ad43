"""A model as it is fitted: its free parameters as coordinates, with what is known of them beforehand."""

from __future__ import annotations

import functools
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from signlin_ros.effects import EFFECTS
from signlin_ros.effects.base import Effect
from signlin_ros.fitting.problem import Problem
from signlin_ros.follow.equations import Equations, equations
from signlin_ros.follow.segments import PreparedSegment
from signlin_ros.model import Model
from signlin_ros.model.numbers import declared, numbers
from signlin_ros.par import declared_name

Array = NDArray[np.float64]
KNOWN_EFFECT = 0.2
"""Relative standard deviation of the prior on the parameters of effects that the model already has."""
MAX_LOG_SENSOR_GAIN = 0.7
"""Largest logarithm of a sensor's gain: about twice or half; more would stand in for an inertia that is known."""
MAX_LOG_LOAD_CHANGE = 3.0
"""Largest change of the logarithm of a floating load's inertia: one much larger stands still, and is a spring."""
LOAD_WANDER = 0.05
"""How far a floating load wanders in a second beside what a model says of it: parts of excursion, velocity."""
SHAPE = 3.0
"""Standard deviation of the prior on the logarithm of a new effect's positive parameters."""


@dataclass(frozen=True)
class Coordinate:
    """A free parameter as the search sees it: its logarithm, or itself divided by ``unit``; ``record``: the source of
    the one record whose own value it is, empty where all share it.
    """

    name: str
    log: bool
    unit: float
    low: float
    high: float
    prior: float
    spread: float
    record: str = ""

    @property
    def parameter(self) -> str:
        """The model's parameter that it is a value of: ``q0`` for ``q0@2``, that of the second record."""
        return self.name.partition("@")[0]

    def value(self, theta: float) -> float:
        """Return the parameter for a coordinate."""
        return float(np.exp(theta) * self.unit) if self.log else theta * self.unit

    def theta(self, value: float) -> float:
        """Return the coordinate for a parameter."""
        return float(np.log(max(value, 1e-300) / self.unit)) if self.log else value / self.unit

    def slope(self, theta: float) -> float:
        """Return d parameter / d coordinate."""
        return self.value(theta) if self.log else self.unit

    def within(self, least: float, most: float) -> Coordinate:
        """Return the same between two values of the parameter, infinite where there is no bound."""
        low = max(self.low, self.theta(least)) if np.isfinite(least) else self.low
        high = min(self.high, self.theta(most)) if np.isfinite(most) else self.high
        return replace(self, low=min(low, high), high=high)

    def nothing(self, effect: type[Effect]) -> float:
        """Return the coordinate at which an effect that has this parameter does nothing."""
        name = self.name.rpartition(".")[2]
        return self.theta(effect.neutral[name]) if name in effect.neutral else 0.0


@dataclass(frozen=True)
class Candidate:
    """A model to be fitted: its free parameters as coordinates, its values elsewhere. ``label``: what was added to it;
    ``alert``: whether an extended Kalman filter follows sensitive motion, and ``load_wander``: how far this lets a
    floating load wander in a second, in parts of excursion and velocity; ``starts``: where its records start.
    """

    model: Model
    equations: Equations
    coordinates: tuple[Coordinate, ...]
    values: dict[str, float]
    label: tuple[str, ...] = ()
    alert: bool = True
    load_wander: float = LOAD_WANDER
    starts: dict[tuple[Any, ...], Any] = field(default_factory=dict, compare=False, repr=False)

    @functools.cached_property
    def angular(self) -> bool:
        """Whether a force depends on the angle from turn to turn, and so on where exactly a record starts."""
        return any(EFFECTS[use.type].angular for use in self.model.effects.values())

    @property
    def filtered(self) -> bool:
        """Whether an extended Kalman filter follows it."""
        return self.alert and (self.angular or bool(self.floating))

    @functools.cached_property
    def floating(self) -> frozenset[str]:
        """The own states that an observer must correct."""
        keys = [k for k, use in self.model.effects.items() if EFFECTS[use.type].floating]
        return frozenset(n for n in self.model.states if n.partition(".")[0] in keys)

    def apart(self) -> Candidate:
        """Return the same with starts of its own: what is fitted beside it is not to bear on it."""
        return replace(self, starts=dict(self.starts))

    def started_for(self, tau: float) -> Candidate:
        """Return the same with the starts alone that were found for an observer of time constant ``tau`` in s."""
        return replace(self, starts={key: start for key, start in self.starts.items() if key[1] == tau})

    @functools.cached_property
    def load_inertias(self) -> tuple[int, tuple[int, ...]] | None:
        """The coordinates of the plant's inertia, and of those that were added behind a coupling; None without both.

        The nominal inertia may be that of the driven side or of all that moves: what is known beforehand holds of the
        nearer of both.
        """
        at = {k.name: i for i, k in enumerate(self.coordinates)}
        added = ((key, self.model.effects[key]) for key in self.label if key in self.model.effects)
        behind = tuple(at[n] for key, use in added if (n := f"{key}.{EFFECTS[use.type].load_inertia}") in at)
        driven = at.get(self.model.plant.inertia_parameter)
        return (driven, behind) if behind and driven is not None and self.coordinates[driven].log else None

    def nearest_to_prior(self, theta: Array) -> Array:
        """Return the coordinates with the inertia of all that moves in place of the driven side's, if that is nearer to
        what is known beforehand.
        """
        if self.load_inertias is None:
            return theta
        (i, behind), found = self.load_inertias, theta.copy()
        k = self.coordinates[i]
        found[i] = k.theta(k.value(theta[i]) + sum(self.coordinates[j].value(theta[j]) for j in behind))
        return found if abs(found[i] - k.prior) < abs(theta[i] - k.prior) else theta

    def prior(self, theta: Array) -> tuple[Array, Array]:
        """Return deviations (n,) of the coordinates from what is known beforehand, in standard deviations, and their
        derivatives (n, n).
        """
        known, spread = self._known
        judged, slope = self.nearest_to_prior(theta), np.diag(1.0 / spread)
        if self.load_inertias is not None and judged is not theta:
            i, behind = self.load_inertias
            total = self.coordinates[i].value(judged[i])
            for j in (i, *behind):
                slope[i, j] = self.coordinates[j].value(theta[j]) / (total * spread[i])
        return (judged - known) / spread, slope

    @functools.cached_property
    def _known(self) -> tuple[Array, Array]:
        """Means and standard deviations (n,) of the priors."""
        return np.array([k.prior for k in self.coordinates]), np.array([k.spread for k in self.coordinates])

    def as_without(self, values: Mapping[str, float], kept: Collection[str]) -> Array:
        """Return the coordinates of some values with the effects at nothing that are not among the keys ``kept``."""
        theta = self.start(values)
        for i, k in enumerate(self.coordinates):
            key, _, name = k.name.partition(".")
            effect = EFFECTS.get(self.model.effects[key].type if key in self.model.effects else key)
            if effect is None or key in kept or k.name in kept:
                continue
            if name in effect.neutral or (not k.log and declared_name(name) in (effect.telling or (name,))):
                theta[i] = k.nothing(effect)
        return theta

    def named(self, theta: Array) -> dict[str, float]:
        """Return the free parameters by name."""
        return {k.name: k.value(x) for k, x in zip(self.coordinates, theta.tolist(), strict=True)}

    def p(self, theta: Array) -> Array:
        """Return all parameters in the order of the equations."""
        values = {**self.values, **self.named(theta)}
        return np.array([values[name] for name in self.equations.parameters])

    @functools.cached_property
    def own(self) -> tuple[str, ...]:
        """The parameters of which records have values of their own."""
        return tuple(dict.fromkeys(k.parameter for k in self.coordinates if k.record))

    def conditions(self, theta: Array, s: PreparedSegment) -> Mapping[str, float]:
        """Return the known conditions of a record, its own values at some coordinates included."""
        if not self.own:
            return s.conditions
        pairs = zip(self.coordinates, theta.tolist(), strict=True)
        return {**{k.parameter: k.value(x) for k, x in pairs if k.record == s.source}, **s.conditions}

    def under(self, p: Array, conditions: Mapping[str, float]) -> Array:
        """Return all parameters with those that are known of a record."""
        if not conditions:
            return p
        values = zip(self.equations.parameters, p.tolist(), strict=True)
        return np.array([conditions.get(name, value) for name, value in values])

    def to_coordinates(self, D: Array, s: PreparedSegment) -> Array:
        """Return derivatives (T, ny, k) to the free parameters of the equations as those to the coordinates: of a value
        that another record has, 0.
        """
        if not self.own or not len(D):
            return D
        free = self.equations.free
        found = np.zeros((*D.shape[:2], len(self.coordinates)))
        for i, k in enumerate(self.coordinates):
            if k.record in ("", s.source):
                found[:, :, i] = D[:, :, free.index(k.parameter)]
        return found

    def sensors(self, p: Array) -> tuple[Array, Array, Array]:
        """Return gain, offset and delay of every channel (ny,) among all parameters."""
        gain, offset, delay = p[len(self.model.trace.parameters) :].reshape(3, -1)
        return gain, offset, delay

    def model_at(self, theta: Array) -> Model:
        """Return the model with the values of some coordinates, of records' own values their mean; what its sensors add
        is not part of it.
        """
        pars, values = declared(self.model), dict[str, list[float]]()
        for k, x in zip(self.coordinates, theta.tolist(), strict=True):
            values.setdefault(k.parameter, []).append(k.value(x))
        means = {n: float(np.mean(v)) for n, v in values.items() if n not in self.label}
        return self.model.with_parameters({n: pars[n].nearest(v) for n, v in means.items()})

    def elsewhere(self, problem: Problem, theta: Array, fitted: Collection[str]) -> tuple[Candidate, Array]:
        """Return the candidate and coordinates for other records: what was ``fitted`` to records of some sources, or is
        shared, is held; what others have of their own is free, from the mean of those.
        """
        kept, pairs = list[tuple[Coordinate, float]](), list(zip(self.coordinates, theta.tolist(), strict=True))
        for k, x in pairs:
            kept += [(replace(k, low=x, high=x), x)] if not k.record or k.record in fitted else []
        for name in self.own:
            those = [(k, x) for k, x in pairs if k.parameter == name]
            mean = float(np.mean([x for _, x in those]))
            new = [(i, s) for i, s in _asking(problem, name) if s not in fitted]
            kept += [(replace(those[0][0], name=f"{name}@+{i}", record=s), mean) for i, s in new]
        values = {**self.values, **{k.name: k.value(x) for k, x in kept}}
        return replace(self, coordinates=tuple(k for k, _ in kept), values=values), np.array([x for _, x in kept])

    def slopes(self, theta: Array) -> Array:
        """Return d parameter / d coordinate of every coordinate."""
        return np.array([k.slope(x) for k, x in zip(self.coordinates, theta.tolist(), strict=True)])

    @property
    def bounds(self) -> tuple[Array, Array]:
        """The least and the largest coordinates."""
        return np.array([k.low for k in self.coordinates]), np.array([k.high for k in self.coordinates])

    def start(self, known: Mapping[str, float] | None = None) -> Array:
        """Return the coordinates of the values that the candidate starts from, or of those that are ``known``."""
        values = {**self.values, **(known or {})}
        return np.array([c.theta(values[c.name]) for c in self.coordinates])


def _base_coordinates(problem: Problem, model: Model) -> list[Coordinate]:
    """Return the base parameters that may move: those that are neither frozen nor exactly 0, with priors; records' own
    values of one, as many as records tell nothing of it.
    """
    base, pars, result = problem.base, declared(problem.base), []
    for name, nominal in numbers(base).items():
        key, _, short = name.rpartition(".")
        spread = KNOWN_EFFECT if key else model.tolerance_of(name)
        whole = bool(key) and declared_name(short) in EFFECTS[base.effects[key].type].whole_orders
        own = name in base.per_record
        if (nominal == 0.0 and not own) or whole or not spread or name not in model.trace.parameters:
            continue
        par, unit = pars[name], abs(nominal)
        if nominal == 0.0:
            unit = problem.scale.of(par.unit)
            k = Coordinate(name, False, unit, par.low / unit, par.high / unit, 0.0, np.inf)
        elif nominal > 0 and par.low >= 0:
            k = Coordinate(name, True, unit, -20.0, 20.0, 0.0, spread)
        else:
            k = Coordinate(name, False, unit, par.low / unit, par.high / unit, np.sign(nominal), spread)
        result += [replace(k, name=f"{name}@{i}", record=s) for i, s in _asking(problem, name)] if own else [k]
    return result


def _asking(problem: Problem, name: str) -> list[tuple[int, str]]:
    """Return number, from 1, and source of every record of which a parameter is not known."""
    numbered = enumerate(dict.fromkeys(s.source for s in problem.segments), 1)
    known = {s.source for s in problem.segments if name in s.conditions}
    return [(i, source) for i, source in numbered if source not in known]


def _effect_coordinates(problem: Problem, model: Model, key: str) -> list[Coordinate]:
    """Return the parameters of a new effect that a fit moves; positive ones by their logarithm."""
    use = model.effects[key]
    effect, result = EFFECTS[use.type], []
    for name, value in use.parameters.items():
        par, full, order = effect.pars()[name], f"{key}.{name}", declared_name(name) in effect.order_names()
        if declared_name(name) in effect.held or par.structural or full not in model.trace.parameters:
            continue
        if order and problem.turns:
            continue  # a whole number
        if (par.positive and not order) or (effect.floating and par.low >= 0.0 and value > 0.0):
            reach = MAX_LOG_LOAD_CHANGE if par.positive and effect.floating else 12.0
            result.append(Coordinate(full, True, value, -reach, reach, 0.0, SHAPE))
        else:
            unit = 1.0 if order else problem.scale.of(par.unit)  # an order comes from a scan
            low, high = effect.within.get(name, (par.low, par.high))
            high = min(high, problem.max_wave_order) if order else high
            result.append(Coordinate(full, False, unit, low / unit, high / unit, 0.0, np.inf))
    return result


def _sensor_coordinate(problem: Problem, name: str) -> Coordinate:
    kind, _, channel = name.partition(".")
    if kind == "sensor_gain":
        return Coordinate(name, True, 1.0, -MAX_LOG_SENSOR_GAIN, MAX_LOG_SENSOR_GAIN, 0.0, MAX_LOG_SENSOR_GAIN / 2)
    if kind == "sensor_delay":
        return Coordinate(name, False, problem.scale.step, 0.0, 1.0 / problem.scale.step, 0.0, np.inf)
    unit = float(problem.noise[problem.channels.index(channel)])
    return Coordinate(name, False, unit, -1e9, 1e9, 0.0, np.inf)


def candidate(
    problem: Problem, model: Model, added: tuple[str, ...], sensors: Mapping[str, float] | None = None
) -> Candidate:
    """Return a candidate: base parameters, effects ``added`` and ``sensors`` (``sensor_gain.speed``: start) free."""
    sensors = sensors or {}
    coordinates = _base_coordinates(problem, model)
    for key in added:
        coordinates += _effect_coordinates(problem, model, key)
    coordinates += [_sensor_coordinate(problem, name) for name in sensors]
    eq = equations(model.structure, problem.channels, tuple(dict.fromkeys(k.parameter for k in coordinates)))
    known = ((c, problem.base.sensors[c]) for c in problem.channels)
    shown = {f"sensor_{what}.{c}": getattr(s, what) for c, s in known for what in ("gain", "offset", "delay")}
    values = {**{name: model.value(name) for name in model.trace.parameters}, **shown, **sensors}
    values |= {k.name: values[k.parameter] for k in coordinates if k.record}
    return Candidate(model, eq, tuple(coordinates), values, (*added, *sensors))


__all__ = ["Candidate", "Coordinate", "candidate"]
