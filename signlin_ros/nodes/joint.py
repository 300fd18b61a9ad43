"""What a joint's position, velocity and effort mean for a model, without ROS."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from signlin_ros.model import Model

Array = NDArray[np.float64]


def measured_states(model: Model, joint: Mapping[str, float]) -> dict[str, float]:
    """Return a model's states from a joint's position, velocity and effort.

    The effort of a motor is K_t i, so it gives the current; elsewhere it is an input or an output.
    """
    if model.plant.name == "arm":
        return {name: value for name, value in joint.items() if name in model.states}
    names = {"position": model.plant.position, "velocity": model.plant.velocity}
    found = {name: joint[field] for field, name in names.items() if field in joint and name in model.states}
    if "current" in model.states and "effort" in joint:
        found["current"] = joint["effort"] / model.parameters["K_t"]
    return found


def effort_input(model: Model, joint: Mapping[str, float]) -> float | None:
    """Return a joint's effort where it is the model's only input (a mass that a force drives); None elsewhere.

    A motor's input is a voltage, of which its effort, K_t i, tells nothing at once.
    """
    return joint.get("effort") if model.inputs == (model.plant.effort,) else None


def joint_values(model: Model, states: Mapping[str, float], u: Array) -> dict[str, float]:
    """Return position, velocity and effort as far as states (by name) and input u (m,) tell them.

    Effort is K_t i of a motor with a current, the input force of a mass; nothing where neither is there.
    """
    known = {**dict(zip(model.inputs, u.tolist(), strict=True)), **states}
    names = {"position": model.plant.position, "velocity": model.plant.velocity}
    found = {field: known[name] for field, name in names.items() if name in known}
    if "current" in states:
        found["effort"] = model.parameters["K_t"] * states["current"]
    elif model.plant.effort in known:
        found["effort"] = known[model.plant.effort]
    return found
