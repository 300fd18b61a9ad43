"""A mass on a damper and a hysteretic spring."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from signlin_ros.effects.bouc_wen_hysteresis import BoucWenHysteresis
from signlin_ros.plants.mass_spring_damper import MassSpringDamper


class BoucWen(MassSpringDamper):
    """A mass on a damper and a hysteretic spring: `mass_spring_damper` with `bouc_wen_hysteresis`.

    m q'' + c q' + alpha k q + (1 - alpha) D k h = F,
    h' = [lambda v - beta |v| |h|^(n-1) h - gamma v |h|^n] / D.   [paper eqs. (34)-(36)]
    """

    name = "bouc_wen"
    equation = (
        "m q'' + c q' + alpha k q + (1 - alpha) D k h = F + effects,  "
        "h' = [lambda v - beta |v| |h|^(n-1) h - gamma v |h|^n] / D"
    )
    linearization = "optimal"
    zero_matters: ClassVar[tuple[str, ...]] = ()
    own_state_names = {"bouc_wen_hysteresis.h": "hysteresis"}
    built_in = {"bouc_wen_hysteresis": ("alpha", "D", "lambda", "beta", "gamma", "n")}

    alpha = BoucWenHysteresis.alpha
    D = BoucWenHysteresis.D
    lambda_ = BoucWenHysteresis.lambda_
    beta = BoucWenHysteresis.beta
    gamma = BoucWenHysteresis.gamma
    n = BoucWenHysteresis.n

    @classmethod
    def channels(cls, values: Mapping[str, float]) -> dict[str, str]:
        """Return those of `mass_spring_damper`, and the hysteresis."""
        return {**super().channels(values), "hysteresis": BoucWenHysteresis.states["h"]}
