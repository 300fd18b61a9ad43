"""A mass on a spring and a damper; with k = 0 a free drive, rotary or linear."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

from signlin_ros.par import Par
from signlin_ros.plants.base import Acting, Plant


class MassSpringDamper(Plant):
    """A mass on a spring and a damper; with k = 0 a free drive, rotary or linear.

    m q'' + c q' + k q = F + effects.   [Newton 1687; paper eq. (34) without hysteresis]
    """

    name = "mass_spring_damper"
    equation = "m q'' + c q' + k q = F + effects"
    force_unit, position_unit, input_unit = "N", "m", "N"
    inputs = {"force": "N"}
    inertia_parameter = "m"
    scaled_by_effort = ("m", "c", "k")
    zero_matters: ClassVar[tuple[str, ...]] = ("k",)

    m = Par("kg", nominal=1.0, positive=True, doc="mass or inertia")
    c = Par("N·s/m", nominal=0.6, doc="viscous damping")
    k = Par("N/m", nominal=40.0, doc="stiffness; 0: a free drive")

    @classmethod
    def states(cls, values: Mapping[str, float]) -> dict[str, str]:
        """Return displacement and velocity."""
        return {"displacement": "m", "velocity": "m/s"}

    def rates(self, m: Any, x: Any, u: Any, p: Any, act: Acting) -> dict[str, Any]:
        """Newton's second law."""
        restoring = act.spring(p.k)
        total = u.force - p.c * x.velocity - restoring + act.force(u.force, -restoring)
        return {"displacement": x.velocity, "velocity": total / p.m}
