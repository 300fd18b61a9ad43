"""Dry and viscous friction that comes nearest to a law which a target has no element for."""

from __future__ import annotations

import numpy as np
from scipy.optimize import nnls

from signlin_ros.engine.tape import Tape
from signlin_ros.export.base import Array
from signlin_ros.export.functions import DRIVES, exact_rates, without
from signlin_ros.model import Model
from signlin_ros.simulation import Trajectory

MIN_SLIDING_SPEED = 0.02
"""Speeds below this part of the largest tell nothing of a sliding force."""


def nearest_friction(model: Model, key: str, path: Trajectory) -> tuple[float, float]:
    """Return mu and b >= 0 of mu sign(v) + b v nearest (least squares) to an effect's force along a run."""
    force, speed = _force(model, key, path), path[model.plant.velocity]
    moving = np.abs(speed) > MIN_SLIDING_SPEED * np.abs(speed).max()
    rows = -np.column_stack([np.sign(speed), speed])[moving]
    found, _ = nnls(rows, force[moving])
    return float(found[0]), float(found[1])


def _force(model: Model, key: str, path: Trajectory) -> Array:
    """Return the force (T,) that an effect adds to the moving mass."""
    bare = without(model, key)
    columns = {name: path[name] for name in (*model.states, *model.inputs)}
    return _inertia(model) * (_acceleration(model, columns) - _acceleration(bare, columns))


def _inertia(model: Model) -> float:
    moved = getattr(model.plant, "moved", None)
    if moved is not None:
        return float(moved(model.parameters))
    return float(model.parameters[DRIVES[model.plant.name][0]])


def _acceleration(model: Model, columns: dict[str, Array]) -> Array:
    """Return the derivative of the speed (T,) at states and inputs by name."""
    row = model.states.index(model.plant.velocity)
    points = [columns[name] for name in (*model.states, *model.inputs)]
    return np.asarray(Tape.of(exact_rates(model)).batch([*points, *model.p])[row])


__all__ = ["nearest_friction"]
