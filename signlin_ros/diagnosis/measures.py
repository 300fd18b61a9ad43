"""What the two witnesses measure of a model, on unseen data: the force that it leaves, and what counts as noise."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from signlin_ros.diagnosis.criteria import Criteria
from signlin_ros.diagnosis.force.equations import depends_on_place
from signlin_ros.diagnosis.force.record import effort_gain
from signlin_ros.diagnosis.force.regression import APART, Fit
from signlin_ros.diagnosis.force.witness import Testimony
from signlin_ros.diagnosis.motion import Fitted, Motion
from signlin_ros.diagnosis.motion.trials import free_key
from signlin_ros.effects import EFFECTS, find_effect
from signlin_ros.effects.base import Effect, SensorEffect
from signlin_ros.model import Model

Array = NDArray[np.float64]

HALF = 0.5
"""Part of the squared error that a model must take away for a difference of the witnesses to matter."""


def percent(force: Testimony, left: Array) -> float:
    """Return squares (blocks,) as per cent of the effort (RMS)."""
    return 100.0 * float(np.sqrt(np.mean(left))) / max(force.search.r.unseen.effort, 1e-300)


def of_effort(force: Testimony | None) -> str:
    """Return in words what forces are told in per cent of."""
    free = force is not None and force.search.r.unseen.free
    return "of the inertial force" if free else "of the effort"


def written_left(force: Testimony, f: Fitted) -> Array:
    """Return the mean squared force (blocks,) that a model leaves of unseen data, with the values that are written in
    it, in the size of the effort as given. Effort and motion may be stamped apart by half a sample.
    """
    r = force.search.r
    left = r.unseen.missing(f.model) * effort_gain(r.model, r.current) / effort_gain(f.model, r.current)
    late = r.unseen.X[:, -1]
    left = left - late * np.clip(float(late @ left) / max(float(late @ late), 1e-300), -APART, APART)
    return r.unseen.by_block(left)


def leaves_noise(f: Fitted, criteria: Criteria) -> bool:
    """Tell whether a model leaves nothing but noise. Of a load that floats its residual says nothing, since a filter
    holds it to what is measured: its windows must be near the noise.
    """
    return f.white and (not _floats(f) or near_noise(f, criteria))


def _floats(f: Fitted) -> bool:
    return any(find_effect(name, "effects").floating for name in f.effects)


def is_shown_to_leave_noise(f: Fitted, criteria: Criteria) -> bool:
    """Tell whether a model leaves nothing but noise, and there are samples enough to have tested it."""
    return f.clean and leaves_noise(f, criteria)


def near_noise(f: Fitted, criteria: Criteria) -> bool:
    """Tell whether a model predicts every channel to about its sensor's noise: what is left then tells by itself
    whether the model is complete. Far above it any real drive lacks more than one thing.
    """
    return bool(np.all(np.sqrt(np.nanmean(f.unseen_squares, axis=0)) < criteria.near * f.noise))


def near_any_noise(motion: Motion, f: Fitted, criteria: Criteria) -> bool:
    """Tell whether a model is near the sensors' noise, or leaves noise, coloured maybe, and over the horizon errs by
    about as much, of known and of unseen data: what is missing gathers over the horizon, noise does not.
    """
    if near_noise(f, criteria):
        return True
    if not f.clean or _floats(f):
        return False
    own = criteria.near * np.maximum([one.over_noise for one in f.left], 1.0)
    pairs = ((f.known_squares, motion.problem.noise), (f.unseen_squares, motion.unseen.noise))
    return all(bool(np.all(np.sqrt(np.nanmean(squares, axis=0)) < own * noise)) for squares, noise in pairs)


def noise_percent(force: Testimony) -> float:
    """Return what the sensors' noise leaves of a force, in per cent of the effort (RMS)."""
    unseen = force.search.r.unseen
    return 100.0 * float(np.sqrt(unseen.noise)) / max(unseen.effort, 1e-300)


def leaves_much(force: Testimony, before: Array, after: Array, criteria: Criteria) -> bool:
    """Tell whether more than a part of a missing force (mean squares by block) is left, beyond the sensors' noise."""
    noise = force.search.r.unseen.noise
    return float(np.mean(after)) - noise > criteria.part * max(float(np.mean(before)) - noise, 0.0)


def comparable(force: Testimony, f: Fitted) -> bool:
    """Tell whether the force that a model leaves can be compared with the base model's: not where the effort itself,
    or what is measured, is what was changed, nor where a load floats, which only an observer keeps where it is, nor
    where it depends on a position that was not measured, or has waves that its band does not hold; nor where an effect
    that the force witness cannot see leaves but noise of the motion.
    """
    effects = [find_effect(name, "effects") for name in acting(force, f)]
    if any(changes_effort(effect) or effect.floating for effect in effects):
        return False
    if set(f.effects) & not_seen(force) and f.white:
        return False
    if any(effect.periodic for effect in effects) and max(_orders(f)) > force.search.waves.finest:
        return False
    if any(effect.angular and not effect.periodic for effect in effects) and force.search.waves.finest < 1.0:
        return False  # a weight is a wave of order one
    return force.search.r.known.pieces[0].position_measured or not depends_on_place(f.model.structure)


def _orders(f: Fitted) -> list[float]:
    """Return the orders of the waves of a model."""
    found: list[float] = []
    for use in f.model.effects.values():
        for name in find_effect(use.type, "effects").periodic[:1]:
            found += np.atleast_1d(use.parameters[name]).tolist()
    return found


def changes_effort(effect: type[Effect]) -> bool:
    """Tell whether an effect changes the input, the torque constant, or what a sensor shows: the effort would explain
    itself.
    """
    return issubclass(effect, SensorEffect) or _has(effect, "input", "delay", "torque_constant", "resistance")


def acting(force: Testimony, f: Fitted) -> frozenset[str]:
    """Return the effects of a model that bear on the force: where the current is measured it is known what acts, be the
    voltage limited or late.
    """
    return frozenset(n for n in f.effects if not (force.search.r.current and only_input(find_effect(n, "effects"))))


def only_input(effect: type[Effect]) -> bool:
    """Tell whether an effect changes nothing but the input."""
    return _has(effect, "input", "delay") and not _has(effect, "force", "torque_constant")


def _has(effect: type[Effect], *parts: str) -> bool:
    """Tell whether an effect has one of some parts of an equation as its own."""
    return any(getattr(effect, part) is not getattr(Effect, part) for part in parts)


def not_seen(force: Testimony | None) -> set[str]:
    """Return the effects that the force witness cannot see."""
    return {n for n in EFFECTS if force is None or n not in force.search.r.laws}


def with_laws(force: Testimony, fit: Fit) -> Model:
    """Return the model with the laws of a fit of the force witness, all values as found there."""
    r, model = force.search.r, force.search.r.model
    for name, shape in fit.members:
        model = model.with_effect(
            name, free_key(model, name), **r.laws[name].parameters(shape, fit.theta[fit.spans[name]])
        )
    moved = zip(r.names[:-1], fit.theta, strict=False)
    return model.with_parameters({n: model.value(n) * (1 + theta) for n, theta in moved if n in model.parameters})


def heard(force: Testimony | None) -> dict[str, dict[str, float]]:
    """Return the values that the force witness found of every law by itself, if it does anything there."""
    found: dict[str, dict[str, float]] = {}
    if force is None:
        return found
    for fit in (f for names, f in force.search.models.items() if len(names) == 1):
        for name, shape in fit.members:
            levels = fit.theta[fit.spans[name]]
            found |= {name: force.search.r.laws[name].parameters(shape, levels)} if np.any(levels) else {}
    return found


__all__ = [
    "HALF",
    "acting",
    "changes_effort",
    "comparable",
    "heard",
    "is_shown_to_leave_noise",
    "leaves_much",
    "leaves_noise",
    "near_any_noise",
    "near_noise",
    "noise_percent",
    "not_seen",
    "of_effort",
    "percent",
    "with_laws",
    "written_left",
]
