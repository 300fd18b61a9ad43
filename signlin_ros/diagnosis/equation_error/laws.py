"""The catalogue's laws as regressors: what each changes of the missing force along the measured motion.

Nothing is written a second time. A law's column is the difference of the missing force without it and with it, from
the recorded equations. Which parameters are levels (the force is linear in them) and which give the shape follows from
the derivatives of those equations:

* a level enters the force linearly and no rate of an own state; it has a column of its own;
* of a law with own states, all parameters with a unit of force scale together: one column, one level;
* an amplitude with a phase (`Effect.turning`) has two columns, a quarter of a turn apart;
* everything else is shape: found on a grid made of the law's own starts, then refined.
"""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from signlin_ros.comparison.equations import SwitchedTape, by_effort, force_equations, mass, rate_of, tape_of
from signlin_ros.comparison.force_segment import ForceSegment, effort_unit
from signlin_ros.effects import EFFECTS, Effect, find_effect
from signlin_ros.engine.symbolic import symbolic
from signlin_ros.errors import SignlinError
from signlin_ros.model import Model
from signlin_ros.recording.trace import Structure, Trace, trace
from signlin_ros.scale import Scale

Array = NDArray[np.float64]
Shape = tuple[tuple[str, float], ...]
"""Names and values of the parameters that a law's columns depend on; those that scale a column are found by a fit."""

KEY = "candidate"
"""The key under which a law is tried in a model."""
GRID = 160
"""Most points of a law's grid."""
MEMORY_SHARES = (1.0, 0.2, 0.04)
"""What a law remembers may go back over a way that is so much shorter than its starts say."""


@dataclass(frozen=True)
class LawParts:
    """How the parameters of a law enter: ``levels`` each with a column; ``group``: those that scale together;
    ``amplitude`` and ``phase``: two columns; ``neutral``: the value at which the one level does nothing; ``shape``.
    """

    levels: tuple[str, ...]
    group: tuple[str, ...]
    turning: tuple[str, str] | tuple[()]
    neutral: float
    shape: tuple[str, ...]


@symbolic
@functools.lru_cache(maxsize=256)
def parts_of(structure: Structure) -> LawParts:
    """Return how the parameters of a law enter its force."""
    t, effect = trace(structure), next(s.effect for s in structure.slots if s.key == KEY)
    p, force = _symbols(t), rate_of(t, structure.plant)
    own = [t.f[i] for i, name in enumerate(t.states) if name.startswith(f"{KEY}.")]
    names = [n for n in p if n not in effect.turning]
    in_rates = {n for n in names if any(ca.jacobian(rate, p[n]).nnz() for rate in own)}
    nonlinear = {n for n in names if ca.jacobian(ca.jacobian(force, p[n]), p[n]).nnz()}
    forceful = {n: "F" in effect.pars()[n].unit.replace("·", "/").split("/")[0] for n in names}
    levels = [n for n in names if n not in in_rates | nonlinear]
    for a, b in itertools.combinations(list(levels), 2):
        if a in levels and b in levels and ca.jacobian(ca.jacobian(force, p[a]), p[b]).nnz():
            levels.remove(a if not forceful[a] else b)
    group = [n for n in names if own and n not in levels and forceful[n]]
    shape = [*(n for n in names if n not in levels and n not in group), *group[1:]]
    neutral = effect.neutral.get(levels[0], 0.0) if len(levels) == 1 else 0.0
    return LawParts(tuple(levels), tuple(group), effect.turning, neutral, tuple(shape))


@symbolic
@functools.lru_cache(maxsize=256)
def linear_parameters(structure: Structure) -> tuple[str, ...]:
    """Return the parameters of a model in which the rate is linear, by dotted name."""
    t = trace(structure)
    rate = rate_of(t, structure.plant)
    curved = [ca.jacobian(ca.jacobian(rate, t.p[i]), t.p[i]).nnz() for i in range(len(t.parameters))]
    return tuple(name for name, bent in zip(t.parameters, curved, strict=True) if not bent)


@symbolic
@functools.lru_cache(maxsize=256)
def columns_of(structure: Structure) -> SwitchedTape:
    """Return the change of the rate for unit levels of a law, a row for each of its columns."""
    t = trace(structure)
    return tape_of(t, structure.plant, _changes(t, structure))


@symbolic
@functools.lru_cache(maxsize=256)
def loads_of(structure: Structure) -> SwitchedTape | None:
    """Return the slopes of these rows over the effort; None where the law does not follow it."""
    t = trace(structure)
    return by_effort(t, structure.plant, _changes(t, structure))


def _symbols(t: Trace) -> dict[str, ca.SX]:
    """Return the parameters of the law in a trace."""
    own = f"{KEY}."
    return {name.removeprefix(own): t.p[i] for i, name in enumerate(t.parameters) if name.startswith(own)}


def _changes(t: Trace, structure: Structure) -> ca.SX:
    parts, p, e = parts_of(structure), _symbols(t), rate_of(t, structure.plant)
    quiet = [(p[n], parts.neutral) for n in parts.levels] + [(p[n], 0.0) for n in parts.turning[:1]]

    def at(e: ca.SX, values: list[tuple[ca.SX, float]]) -> ca.SX:
        return ca.substitute(e, *(ca.vertcat(*column) for column in zip(*values, strict=True))) if values else e

    sign = -1.0 if parts.neutral else 1.0
    rows = [sign * at(ca.jacobian(e, p[n]), quiet) for n in parts.levels]
    if parts.group:
        rows.append(at(e, quiet) - at(e, [*quiet, *((p[n], 0.0) for n in parts.group)]))
    if parts.turning:
        amplitude, phase = parts.turning
        rows += [at(ca.jacobian(e, p[amplitude]), [*quiet, (p[phase], v)]) for v in (0.0, math.pi / 2)]
    return ca.vertcat(*rows)


@dataclass(frozen=True)
class LawRegressor:
    """An effect as a regressor beside a model: ``model`` has it under `KEY`, ``columns`` are made of its parts."""

    name: str
    model: Model
    parts: LawParts

    @property
    def effect(self) -> type[Effect]:
        """The effect's class."""
        return find_effect(self.name, "effects")

    @property
    def family(self) -> str:
        """The laws of which one at most is named: a family, or the law alone."""
        return self.effect.family or self.name

    def free(self, shape: Shape) -> int:
        """Return the number of parameters that a fit moves: what the law costs."""
        return len(self.positive(shape)) + len([n for n in self.parts.shape if n not in self.effect.held])

    def positive(self, shape: Shape) -> tuple[bool, ...]:
        """Return which columns have a coefficient that cannot be negative."""
        pars = self.effect.pars()
        levels = [pars[n].low >= 0.0 for n in self.parts.levels]
        return (*levels, *([True] if self.parts.group else []), *([False, False] if self.parts.turning else []))

    def columns(self, piece: ForceSegment, shape: Shape) -> Array:
        """Return the force (K, columns) of unit levels along a piece, through the low-pass at the compared samples."""
        return piece.once((self.name, shape), lambda: self._seen(piece, shape, columns_of))

    @property
    def follows_effort(self) -> bool:
        """Whether the law, in any shape, adds to the part of the effort that drives."""
        return loads_of(self.model.structure) is not None

    def loads(self, piece: ForceSegment, shape: Shape) -> Array:
        """Return the effort (K, columns) that unit levels add to the part that drives."""
        unit = effort_unit(self.model)
        return piece.once(("load", self.name, shape), lambda: self._seen(piece, shape, loads_of) / unit)

    def _seen(self, piece: ForceSegment, shape: Shape, what: Callable[[Structure], Any]) -> Array:
        """Return the outputs of a tape of the law times the mass (K, columns), through the low-pass."""
        changed = {f"{KEY}.{n}": v for n, v in shape if n in self.structural}
        known = {**piece.conditions, **changed}
        model = self.model.with_parameters(known) if known else self.model
        p = model.p.copy()
        for n, value in shape:
            if n not in self.structural:
                p[model.trace.parameters.index(f"{KEY}.{n}")] = value
        own = self.effect.states
        x = piece.states(model, p) if own else piece.once(model.states, lambda: piece.states(model))
        return piece.seen(np.asarray(mass(model) * piece.evaluated(model, what(model.structure), x, p).T))

    @functools.cached_property
    def structural(self) -> frozenset[str]:
        """Parameters that change the equations."""
        pars = self.effect.pars().items()
        return frozenset(n for n, p in pars if p.structural and not p.words and p.elements is None)

    def parameters(self, shape: Shape, coefficients: Array) -> dict[str, Any]:
        """Return the effect's parameters for a shape and the coefficients (columns) of its columns."""
        values = {**self.model.effects[KEY].parameters, **dict(shape)}
        c = list(coefficients)
        for n in self.parts.levels:
            level = c.pop(0)
            values[n] = self.parts.neutral - level if self.parts.neutral else level
        if self.parts.group:
            scale = c.pop(0)
            values |= {n: values[n] * scale for n in self.parts.group}
        if self.parts.turning:
            values |= dict(zip(self.parts.turning, _turned(*c), strict=True))
        pars = self.effect.pars()
        return {n: pars[n].nearest(v) for n, v in values.items()}


def _turned(a: float, b: float) -> tuple[float, float]:
    """Return amplitude and phase of two columns: -A sin(N q + phi), or -A sin(q - q0)."""
    return math.hypot(a, b), math.atan2(b, a)


@dataclass(frozen=True)
class Ripple(LawRegressor):
    """Several waves as one law: the columns of ``wave`` at each of the orders in its shape."""

    wave: LawRegressor

    def free(self, shape: Shape) -> int:
        """See `LawRegressor`."""
        return 3 * len(shape)

    def positive(self, shape: Shape) -> tuple[bool, ...]:
        """See `LawRegressor`."""
        return (False, False) * len(shape)

    def columns(self, piece: ForceSegment, shape: Shape) -> Array:
        """See `LawRegressor`."""
        return np.hstack([self.wave.columns(piece, (order,)) for order in shape])

    def parameters(self, shape: Shape, coefficients: Array) -> dict[str, Any]:
        """See `LawRegressor`."""
        amplitudes, phases = zip(*(_turned(a, b) for a, b in coefficients.reshape(-1, 2)), strict=True)
        return {"orders": [N for _, N in shape], "A": list(amplitudes), "phi": list(phases)}


def laws(model: Model, angular: bool, placed: bool = True) -> dict[str, LawRegressor]:
    """Return the laws that act as a force along a measured motion, and that a model may lack, by their names.

    ``placed``: whether the position was measured; ``angular``: whether something may go with its sine: the axis turns,
    or travels a whole period. Left to the output-error estimate: what changes an input or a sensor, hidden inertias.
    """
    found = {}
    for name, effect in EFFECTS.items():
        law = _law(model, name, effect) if angular or effect.periodic or not effect.turning else None
        if law is not None and (placed or not force_equations(law.model.structure).placed):
            found[name] = law
    wave = found.get("cogging_torque")
    return {**found, "torque_ripple": Ripple("torque_ripple", wave.model, wave.parts, wave)} if wave else found


def _law(model: Model, name: str, effect: type[Effect]) -> LawRegressor | None:
    forceful = effect.force is not Effect.force or effect.spring is not Effect.spring
    hidden = effect.resonant or effect.floating
    there = any(use.type == name for use in model.effects.values())
    if not (forceful and effect.proposed) or hidden or (there and not effect.periodic):
        return None
    try:
        wider = model.with_effect(name, KEY)
        if wider.inputs != model.inputs:  # the record lacks what it depends on
            return None
        parts = parts_of(wider.structure)
    except SignlinError:
        return None
    return LawRegressor(name, wider, parts) if parts.levels or parts.group or parts.turning else None


def grid(law: LawRegressor, scale: Scale) -> list[Shape]:
    """Return the shapes that are tried: those of the effect's own starts, each once; waves are scanned for."""
    if law.effect.periodic or isinstance(law, Ripple):
        return []
    ways = MEMORY_SHARES if law.effect.states else MEMORY_SHARES[:1]
    scales = [replace(scale, travel=scale.travel * way) for way in ways]
    points = list(dict.fromkeys(_reference(law, start) for s in scales for start in law.effect.starts(s)))
    return points[:: max(1, -(-len(points) // GRID))]


def _reference(law: LawRegressor, start: Mapping[str, float]) -> Shape:
    """Return a shape from a start: its group scaled so that the first of it is 1."""
    values: dict[str, Any] = {**law.model.effects[KEY].parameters, **start}
    group = law.parts.group
    if group:
        unit = values[group[0]] or 1.0
        values |= {n: values[n] / unit for n in group}
    names = (*law.parts.group[:1], *law.parts.shape, *sorted(law.structural))
    return tuple((n, float(f"{values[n]:.12g}")) for n in names)


__all__ = ["KEY", "LawParts", "LawRegressor", "Ripple", "Shape", "grid", "laws", "linear_parameters", "parts_of"]
