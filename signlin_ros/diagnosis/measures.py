"""What a model with some effects leaves of the missing force, and which effects bear on the effort itself."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from signlin_ros.comparison.piece import effort_gain
from signlin_ros.diagnosis.force.regression import APART, Fit
from signlin_ros.diagnosis.force.witness import Testimony
from signlin_ros.diagnosis.motion import Fitted
from signlin_ros.diagnosis.motion.trials import free_key
from signlin_ros.effects.base import Effect, SensorEffect
from signlin_ros.errors import joined
from signlin_ros.model import Model

Array = NDArray[np.float64]

HALF = 0.5
"""Part of the squared error that a model must take away for a difference of the witnesses to matter."""


def listed(names: Iterable[str]) -> str:
    """Return effects in words."""
    return joined([n.replace("_", " ") for n in names])


def freed(before: Fitted, after: Fitted) -> str:
    """Return the base parameter that is bent most without what was added, by a tolerance more; empty if none is."""
    first, last = before.off, after.off
    most = max(first, key=lambda n: abs(first[n]) - abs(last.get(n, 0.0)), default="")
    return most if most and abs(first[most]) > abs(last.get(most, 0.0)) + 1.0 else ""


def written_left(force: Testimony, f: Fitted) -> Array:
    """Return the mean squared force (blocks,) that a model leaves of unseen data, with the values that are written in
    it, in the size of the effort as given. Effort and motion may be stamped apart by half a sample.
    """
    r = force.search.r
    left = r.unseen.missing(f.model) * effort_gain(r.model, r.current) / effort_gain(f.model, r.current)
    late = r.unseen.X[:, -1]
    left = left - late * np.clip(float(late @ left) / max(float(late @ late), 1e-300), -APART, APART)
    return r.unseen.by_block(left)


def values(force: Testimony, fit: Fit, name: str) -> dict[str, float]:
    """Return the parameters of a law as a fit of the force witness has them."""
    return force.search.r.laws[name].parameters(dict(fit.members)[name], fit.theta[fit.spans[name]])


def with_laws(force: Testimony, fit: Fit) -> Model:
    """Return the model with the laws of a fit of the force witness, all values as found there."""
    r, model = force.search.r, force.search.r.model
    for name, _ in fit.members:
        model = model.with_effect(name, free_key(model, name), **values(force, fit, name))
    moved = zip(r.names[:-1], fit.theta, strict=False)
    return model.with_parameters({n: model.value(n) * (1 + theta) for n, theta in moved if n in model.parameters})


def changes_effort(effect: type[Effect]) -> bool:
    """Tell whether an effect changes the input, torque constant or a sensor: the effort would explain itself."""
    return issubclass(effect, SensorEffect) or _has(effect, "input", "delay", "torque_constant", "resistance")


def only_input(effect: type[Effect]) -> bool:
    """Tell whether an effect changes nothing but the input."""
    return _has(effect, "input", "delay") and not _has(effect, "force", "torque_constant")


def _has(effect: type[Effect], *parts: str) -> bool:
    """Tell whether an effect has one of some parts of an equation as its own."""
    return any(getattr(effect, part) is not getattr(Effect, part) for part in parts)


__all__ = ["HALF", "changes_effort", "freed", "listed", "only_input", "values", "with_laws", "written_left"]
