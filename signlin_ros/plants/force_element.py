"""A damper or joint whose motion is imposed and whose force is measured."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from signlin_ros.par import Par
from signlin_ros.plants.base import Acting, Plant


class ForceElement(Plant):
    """A damper or joint whose motion is imposed and whose force is measured.

    q' = v (the input), force = c v + k q - (sum of effects): the force that is needed to move it.
    [Spencer et al. 1997, doi:10.1061/(ASCE)0733-9399(1997)123:3(230)]
    """

    name = "force_element"
    equation = "q' = v,  force = c v + k q - (sum of effects)"
    force_unit, position_unit, input_unit = "N", "m", "m/s"
    inputs = {"velocity": "m/s"}
    scaled_by_effort = ("c", "k")
    zero_matters = ("k",)
    outputs = {"force": "N"}

    c = Par("N·s/m", nominal=0.0, doc="viscous damping")
    k = Par("N/m", nominal=0.0, doc="stiffness")

    @classmethod
    def states(cls, values: Mapping[str, float]) -> dict[str, str]:
        """Return the displacement."""
        return {"displacement": "m"}

    def rates(self, m: Any, x: Any, u: Any, p: Any, act: Acting) -> dict[str, Any]:
        """Imposed motion, and the force that it takes."""
        x.velocity = u.velocity
        restoring = act.spring(p.k)
        return {
            "displacement": x.velocity,
            "force": p.c * x.velocity + restoring - act.force(None, -restoring),
        }
