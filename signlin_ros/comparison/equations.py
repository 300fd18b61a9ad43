"""A model's equations for what they lack: what a force acts on, what the effort does to it, what is moved."""

from __future__ import annotations

import functools

import casadi as ca

from signlin_ros.engine.symbolic import symbolic
from signlin_ros.engine.tape import Tape
from signlin_ros.model import Model
from signlin_ros.plants import Plant
from signlin_ros.recording.trace import Structure, Trace, trace


def rate_of(t: Trace, plant: type[Plant]) -> ca.SX:
    """Return the expression that a force enters: the rate of the velocity, or the force of an imposed motion."""
    return t.y[0] if plant.motion_is_imposed() else t.f[t.states.index(plant.velocity)]


@symbolic
@functools.lru_cache(maxsize=256)
def rate_tape(structure: Structure) -> Tape:
    """Return the expression that a force enters, as a tape."""
    t = trace(structure)
    return tape_of(t, rate_of(t, structure.plant))


@symbolic
@functools.lru_cache(maxsize=256)
def arriving_tape(structure: Structure) -> Tape | None:
    """Return the slope of that over the effort, as a tape; None: see `by_effort`."""
    t = trace(structure)
    return by_effort(t, structure.plant, rate_of(t, structure.plant))


def by_effort(t: Trace, plant: type[Plant], e: ca.SX) -> Tape | None:
    """Return slopes (k) over the effort, as a tape; None where they are the same however the plant moves."""
    if plant.motion_is_imposed():
        return None
    effort = plant.effort or "current"
    names, symbols = (t.states, t.x) if effort in t.states else (t.inputs, t.u)
    slopes = ca.jacobian(e, symbols[names.index(effort) if effort in names else 0])
    moving = ca.vertcat(t.x, t.u, *(s.symbol for s in t.surfaces))
    return tape_of(t, slopes) if ca.depends_on(slopes, moving) else None


@symbolic
@functools.lru_cache(maxsize=256)
def depends_on_place(structure: Structure) -> bool:
    """Tell whether the force depends on the position: an integral of the speed starts anywhere, and drifts."""
    t, plant = trace(structure), structure.plant
    if plant.position not in t.states:
        return False
    others = [t.f[i] for i, n in enumerate(t.states) if n not in (plant.position, plant.velocity)]
    place = t.x[t.states.index(plant.position)]
    return any(ca.which_depends(ca.vertcat(rate_of(t, plant), *others), place, 1, True))


def tape_of(t: Trace, e: ca.SX) -> Tape:
    """Return expressions (k) of a trace as a tape of x, u, p and the surfaces' signs."""
    symbols = ca.vertcat(*(s.symbol for s in t.surfaces)) if t.surfaces else ca.SX(0, 1)
    return Tape.of(ca.Function("force", [t.x, t.u, t.p, symbols], [ca.densify(ca.cse(e))]))


@symbolic
@functools.lru_cache(maxsize=256)
def surfaces_tape(structure: Structure) -> Tape:
    """Return the switching surfaces, as a tape."""
    t = trace(structure)
    return tape_of(t, ca.vertcat(*(s.g for s in t.surfaces)))


def bare(model: Model) -> Model:
    """Return the plant without any effect."""
    for key in list(model.effects):
        model = model.without_effect(key)
    return model


def mass(model: Model) -> float:
    """Return the moving mass or inertia; -1 where a force is the output."""
    if model.plant.motion_is_imposed():
        return -1.0
    return model.plant.moved(model.parameters)


def inertia(model: Model) -> float:
    """Return the moving mass or inertia, 0 where the motion is imposed."""
    return 0.0 if model.plant.motion_is_imposed() else mass(model)


__all__ = [
    "arriving_tape",
    "bare",
    "by_effort",
    "depends_on_place",
    "inertia",
    "mass",
    "rate_of",
    "rate_tape",
    "surfaces_tape",
    "tape_of",
]
