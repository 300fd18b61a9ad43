"""Arms in the nodes, without ROS: which joints are outside the valid range of sign_j, and which nodes take none."""

from __future__ import annotations

import functools

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from signlin_ros.compiled import scales
from signlin_ros.engine.symbolic import symbolic
from signlin_ros.errors import InputError
from signlin_ros.model import Model
from signlin_ros.recording.smooth import smooth_form
from signlin_ros.recording.trace import Structure
from signlin_ros.sign import valid_surface

Array = NDArray[np.float64]
TOPIC = "/"
"""How a robot is written that comes from a topic: ``/robot_description``."""


def outside(model: Model, x: Array, u: Array) -> list[str]:
    """Return the joints with a surface outside the valid range of sign_j at a state x (n,) and input u (m,)."""
    z = np.array(_arguments(model.structure, model.sign_order)(x, u, model.p, scales(model))).ravel()
    good = valid_surface(z, model.sign_order)
    names = [surface.name.partition(".")[0] for surface, one in zip(model.trace.surfaces, good, strict=True) if not one]
    return list(dict.fromkeys(names))


@symbolic
@functools.lru_cache(maxsize=16)
def _arguments(structure: Structure, order: int) -> ca.Function:
    """Return the arguments of all sign_j as a function of (x, u, p, scale)."""
    form = smooth_form(structure, order)
    t = form.trace
    found = ca.densify(ca.cse(ca.vertcat(*(s.z for s in form.signs)))) if form.signs else ca.DM(0, 1)
    return ca.Function("z", [t.x, t.u, t.p, form.scale], [found])


def refuse_arm(model: Model, node: str, instead: str) -> None:
    """Raise `InputError` where a node that does not take arms is given one; ``instead`` says the way out."""
    if model.plant.name == "arm":
        raise InputError(f"{node}: does not take an arm ({model.source}); {instead}")


__all__ = ["TOPIC", "outside", "refuse_arm"]
