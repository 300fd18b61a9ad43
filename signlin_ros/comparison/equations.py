"""A model's equations for what they lack: what a force acts on, what the effort does to it, what is moved."""

from __future__ import annotations

import functools
from collections.abc import Collection
from dataclasses import dataclass

import casadi as ca

from signlin_ros.engine.symbolic import symbolic
from signlin_ros.engine.tape import Tape
from signlin_ros.model import Model
from signlin_ros.plants import Plant
from signlin_ros.recording.trace import Structure, Trace, trace


def rate_of(t: Trace, plant: type[Plant]) -> ca.SX:
    """Return the expression that a force enters: the rate of the velocity, or the force of an imposed motion."""
    return t.y[0] if plant.motion_is_imposed() else t.f[t.states.index(plant.velocity)]


@dataclass(frozen=True, eq=False)
class SwitchedTape:
    """Expressions over x, u, p and the signs of the switching surfaces: ``outputs``, and those ``surfaces``, None where
    all of them are the velocity, whose sign a record tells.
    """

    outputs: Tape
    surfaces: Tape | None


@dataclass(frozen=True, eq=False)
class ForceEquations:
    """What a structure says of forces.

    ``rate``: what a force enters, see `rate_of`; ``effort_slopes``: its slope over the effort, None where that is the
    same however the plant moves; ``placed``: whether the force depends on the position, where an integral of the speed
    starts anywhere, and drifts.
    """

    rate: SwitchedTape
    effort_slopes: SwitchedTape | None
    placed: bool


@symbolic
@functools.lru_cache(maxsize=256)
def force_equations(structure: Structure) -> ForceEquations:
    """Return what a structure says of forces."""
    t, plant = trace(structure), structure.plant
    rate = rate_of(t, plant)
    return ForceEquations(tape_of(t, plant, rate), by_effort(t, plant, rate), _placed(t, plant, rate))


def _placed(t: Trace, plant: type[Plant], rate: ca.SX) -> bool:
    if plant.position not in t.states:
        return False
    others = [t.f[i] for i, n in enumerate(t.states) if n not in (plant.position, plant.velocity)]
    place = t.x[t.states.index(plant.position)]
    return any(ca.which_depends(ca.vertcat(rate, *others), place, 1, True))


def by_effort(t: Trace, plant: type[Plant], e: ca.SX) -> SwitchedTape | None:
    """Return slopes (k) over the effort, as a tape; None where they are the same however the plant moves."""
    if plant.motion_is_imposed():
        return None
    effort = plant.effort or "current"
    names, symbols = (t.states, t.x) if effort in t.states else (t.inputs, t.u)
    slopes = ca.jacobian(e, symbols[names.index(effort) if effort in names else 0])
    moving = ca.vertcat(t.x, t.u, *(s.symbol for s in t.surfaces))
    return tape_of(t, plant, slopes) if ca.depends_on(slopes, moving) else None


def tape_of(t: Trace, plant: type[Plant], e: ca.SX) -> SwitchedTape:
    """Return expressions (k) of a trace as a tape."""
    signs = ca.vertcat(*(s.symbol for s in t.surfaces)) if t.surfaces else ca.SX(0, 1)

    def tape(e: ca.SX) -> Tape:
        return Tape.of(ca.Function("force", [t.x, t.u, t.p, signs], [ca.densify(ca.cse(e))]))

    others = any(s.name != plant.velocity for s in t.surfaces)
    return SwitchedTape(tape(e), tape(ca.vertcat(*(s.g for s in t.surfaces))) if others else None)


def with_measured(model: Model, measured: Collection[str]) -> Model:
    """Return the model with a state for what follows at once, where that is ``measured``: then it is known, and its
    equation, the time constant in it, is not asked.
    """
    quick = [name for name, time in model.plant.settling_times(model.parameters).items() if time == 0.0]
    known = quick and measured and set(model.plant.algebraic(model.parameters)) <= set(measured)
    return model.with_parameters(dict.fromkeys(quick, 1.0)) if known else model


def bare(model: Model) -> Model:
    """Return the plant without any effect."""
    return model.without_effect(*model.effects)


def mass(model: Model) -> float:
    """Return the moving mass or inertia; -1 where a force is the output."""
    if model.plant.motion_is_imposed():
        return -1.0
    return model.plant.moved(model.parameters)


def inertia(model: Model) -> float:
    """Return the moving mass or inertia, 0 where the motion is imposed."""
    return 0.0 if model.plant.motion_is_imposed() else mass(model)


__all__ = [
    "ForceEquations",
    "SwitchedTape",
    "bare",
    "by_effort",
    "force_equations",
    "inertia",
    "mass",
    "rate_of",
    "tape_of",
    "with_measured",
]
