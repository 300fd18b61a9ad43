"""A spring with hysteresis."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from signlin_ros.effects.base import Effect
from signlin_ros.par import Par

MIN_ELASTIC_SHARE = 0.02
"""Share of the stiffness that may stay elastic where a loop is all but Dahl's."""
MAX_GAMMA_RATIO = 10.0
"""Ratio of gamma to beta, either way, beyond which a loop has no width to speak of."""


LOOP_POWERS = (1.0, 2.0, 3.0)
"""Powers that are tried."""
LOOP_SHAPES = (0.6, -0.6)
"""Shapes of the loop that are tried, gamma as a share of beta: a branch that softens, and one that hardens."""
LOOP_YIELDS = (4.0, 1.5, 0.3)
"""Displacements over D from which on a loop that is tried yields: late, within the travel, and early in it."""


class BoucWenHysteresis(Effect):
    """A spring with hysteresis.

    k q becomes alpha k q + (1 - alpha) D k h, with
    h' = [lambda v - beta |v| |h|^(n-1) h - gamma v |h|^n] / D.   [Bouc 1967; Wen 1976; paper eqs. (34)-(36)]
    """

    name = "bouc_wen_hysteresis"
    equation = "k q -> alpha k q + (1 - alpha) D k h, h' = [lambda v - beta |v| |h|^(n-1) h - gamma v |h|^n] / D"
    finding = "the residual {F} against the {Q} is a loop: {alpha:.2f} of the stiffness stays elastic, the rest yields"
    experiment = "cycle slowly between two positions, with several amplitudes"
    command = "sines that grow"
    states = {"h": "-"}
    family = "dry friction"
    contains = ("linear_stiffness",)

    alpha = Par("-", nominal=0.5, high=1.0, doc="share of the stiffness that stays elastic")
    D = Par("Q", nominal=1.0, positive=True, doc="yield displacement")
    lambda_ = Par("-", nominal=1.0, low=-1e6, high=1e6, doc="initial slope of the loop")
    beta = Par("-", nominal=0.5, low=-1e6, high=1e6, doc="width of the loop")
    gamma = Par("-", nominal=0.5, low=-1e6, high=1e6, doc="shape of the loop")
    n = Par("-", nominal=1.0, low=1.0, high=50.0, structural=True, doc="sharpness of yielding")
    k = Par("F/Q", nominal=1.0, free_standing=True, doc="stiffness, where the plant has no spring of its own")
    neutral = {"alpha": 1.0}
    telling = ("alpha",)
    together = ("beta", "gamma")  # without them it is a spring, and what h begins with a constant load
    held = {"lambda": 1.0, "D": None}
    within = {"beta": (0.0, 1e6)}  # a loop takes energy, and does not give any
    start = tuple(
        {"alpha": 0.5, "D": 0.3, "beta": beta, "gamma": share * beta, "n": n, "k": 1.0}
        for n in LOOP_POWERS
        for share in LOOP_SHAPES
        for beta in (yields**-n / (1.0 + abs(share)) for yields in LOOP_YIELDS)
    )

    @classmethod
    def after(cls, simple: str, p: Mapping[str, float]) -> list[dict[str, float]]:
        """Return loops of the width and the first slope of Dahl's, which are the same with n = 1 and gamma = 0; and
        such of which a spring is the part that stays elastic, having yielded early.
        """
        if simple == "linear_stiffness" and p["k"] > 0:
            elastic = [{"alpha": alpha, "k": p["k"] / alpha} for alpha in (0.05, 0.3)]
            loops = [{"beta": beta, "gamma": beta / 2, "n": n} for beta in (1.0, 6.0) for n in (1.0, 2.0)]
            return [{**part, **loop} for part in elastic for loop in loops]
        if simple != "dahl_presliding" or min(p["F_c"], p["sigma"]) <= 0:
            return []
        loop = {"D": p["F_c"] / p["sigma"], "lambda": 1.0, "beta": 0.9, "gamma": 0.1}
        return [
            {**loop, "n": n, "alpha": alpha, "k": p["sigma"] / (1 - alpha)} for n in (1.0, 2.0) for alpha in (0.1, 0.6)
        ]

    @classmethod
    def nearby(cls, p: Mapping[str, float]) -> list[dict[str, float]]:
        """Return loops that bend as far, with the same shares of beta and gamma, but more or less sharply."""
        size = p["beta"] + abs(p["gamma"])  # of the branch that bends most: one that hardens does not yield
        if size <= 0:
            return []
        return [{**p, "n": n, **{k: p[k] * size ** (n / p["n"] - 1) for k in ("beta", "gamma")}}
                for n in LOOP_POWERS if n != p["n"]]  # fmt: skip

    @classmethod
    def instead(cls, others: Mapping[str, Mapping[str, float]]) -> dict[str, float]:
        if set(others) != {"dahl_presliding", "linear_stiffness"}:
            return {}
        F_c, sigma = (others["dahl_presliding"][n] for n in ("F_c", "sigma"))
        elastic = others["linear_stiffness"]["k"]
        if min(F_c, sigma, elastic) <= 0:
            return {}
        k, D = elastic + sigma, F_c / sigma
        return {"alpha": elastic / k, "k": k, "D": D, "lambda": 1.0, "beta": 1.0, "gamma": 0.0, "n": 1.0}

    @classmethod
    def simpler(cls, p: Mapping[str, float]) -> dict[str, dict[str, float]]:
        if "k" in p and p["alpha"] > 1 - MIN_ELASTIC_SHARE:
            return {"linear_stiffness": {"k": p["alpha"] * p["k"]}}
        if (
            "k" not in p
            or p["n"] != 1.0
            or p["alpha"] > MIN_ELASTIC_SHARE
            or not abs(p["gamma"]) < 5 * MIN_ELASTIC_SHARE * p["beta"]
        ):
            return {}
        k = (1 - p["alpha"]) * p["k"] * p["lambda"]
        return {"dahl_presliding": {"F_c": p["D"] * k / p["beta"], "sigma": k}}

    @classmethod
    def plausible(cls, p: Mapping[str, float]) -> bool:
        """Refuse a loop without width: it takes no energy, and is an elastic spring that hardens or softens."""
        return abs(p["gamma"]) <= MAX_GAMMA_RATIO * p["beta"]

    @classmethod
    def parts(cls, p: Mapping[str, float]) -> list[dict[str, dict[str, float]]]:
        """Return the springs that a loop without width is: they harden where h would run off to infinity."""
        if p["gamma"] >= -MAX_GAMMA_RATIO * p["beta"] or "k" not in p:
            return []
        run_off = p["D"] * math.pi / 2 * (abs(p["gamma"]) + p["beta"]) ** (-1.0 / p["n"])
        spring = {"linear_stiffness": {"k": p["k"]}}
        stop, cubic = {"gap": run_off, "k_s": 3.0 * p["k"]}, {"k3": p["k"] / run_off**2}
        return [{**spring, "hard_stop": stop}, {**spring, "cubic_stiffness": cubic}]

    def force(self, m: Any, x: Any, p: Any) -> Any:
        return -self.spring(m, x, p, p.k) if hasattr(p, "k") else 0

    def spring(self, m: Any, x: Any, p: Any, k: Any) -> Any:
        return p.alpha * k * x.position + (1 - p.alpha) * p.D * k * x.own.h

    def rates(self, m: Any, x: Any, p: Any) -> dict[str, Any]:
        v, h = x.velocity, x.own.h
        loop = p.beta * m.abs(v) * m.signed_power(h, p.n) + p.gamma * v * m.abs_power(h, p.n)
        return {"h": (p.lambda_ * v - loop) / p.D}
