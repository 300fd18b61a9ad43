"""The smallest size at which a richer law is of interest: the simpler one inside it could else never win."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from signlin_ros.fitting.candidate import Candidate
from signlin_ros.fitting.problem import Problem

MIN_SIZE_SHARE = 0.2
"""Part of the friction, or of a law's own larger term, that a smaller one must be to be of interest."""
MIN_VIBRATION_SAMPLES = 16.0
"""Samples in a period of the vibration on a bristle or a shaft that is soft enough to be of interest."""
MIN_FADING_SPEED, MAX_FADING_SPEED = 0.02, 0.25
"""Parts of the RMS speed between which is that up to which friction falls, if it is to be told from one that does not:
below, nobody sees it fall, beyond, it is lower everywhere."""

Values = Mapping[str, float]
Bound = Callable[[Problem, Values], float]


@dataclass(frozen=True)
class Size:
    """Bounds of the parameters of an effect between which it is of interest, by name; ``name``: the first of them, and
    ``stiff``: whether that is one that is large where the effect is nothing.
    """

    name: str
    stiff: bool
    bounds: Mapping[str, tuple[float, float]]

    @property
    def least(self) -> float:
        """The bound of the first parameter at which the effect is smallest."""
        low, high = self.bounds[self.name]
        return high if self.stiff else low


def _share_of(other: str) -> Bound:
    return lambda problem, v: MIN_SIZE_SHARE * abs(v[other])


def _breakaway(problem: Problem, v: Values) -> float:
    """Return the breakaway friction that is so much larger than the sliding one: else bristles are Dahl's."""
    return (1.0 + MIN_SIZE_SHARE) * abs(v["F_c"])


def _soft(problem: Problem, v: Values) -> float:
    """Return the stiffness on which the moving mass vibrates with `MIN_VIBRATION_SAMPLES` samples in a period."""
    return float(problem.scale.inertia * (2 * np.pi / (MIN_VIBRATION_SAMPLES * problem.scale.step)) ** 2)


def _play(problem: Problem, v: Values) -> float:
    """Return the play that a share of the driving force would close by its elasticity."""
    return MIN_SIZE_SHARE * problem.scale.force / max(v["k"], 1e-300)


def _speeds(share: float) -> Bound:
    return lambda problem, v: share * problem.scale.velocity


LARGE: Mapping[str, Mapping[str, Bound]] = {
    "stribeck_friction": {"excess": _share_of("mu"), "v_s": _speeds(MIN_FADING_SPEED)},
    "backlash": {"gap": _play},
    "lugre_friction": {"F_s": _breakaway, "v_s": _speeds(MIN_FADING_SPEED)},
    "load_dependent_friction": {"kappa_d": lambda problem, v: MIN_SIZE_SHARE * (v["kappa_d"] + v["kappa_e"])},
}
"""By effect: parameters that must be so large."""
SMALL: Mapping[str, Mapping[str, Bound]] = {
    "dahl_presliding": {"sigma": _soft},
    "lugre_friction": {"sigma0": _soft, "v_s": _speeds(MAX_FADING_SPEED)},
    "compliant_load": {"k": _soft},
    "stribeck_friction": {"v_s": _speeds(MAX_FADING_SPEED)},
}
"""And those that must be so small."""


SIZED = frozenset(LARGE) | frozenset(SMALL)
"""Effects that have a size of interest."""
FIRST: Mapping[str, tuple[str, ...]] = {"lugre_friction": ("sigma0",)}
"""Which of them is the size that is told, where it is not the first."""


def size_of(problem: Problem, c: Candidate, theta: np.ndarray[tuple[int], np.dtype[np.float64]]) -> Size | None:
    """Return the smallest size of interest of what a candidate adds last; None where its estimate is its size."""
    if problem.scale.imposed:
        return None
    free, named = [k.name for k in c.coordinates], {**c.values, **c.named(theta)}
    for key in reversed(c.label):
        kind = c.model.effects[key].type if key in c.model.effects else ""
        own = {n.rpartition(".")[2]: v for n, v in named.items() if n.startswith(f"{key}.")}
        least, most = LARGE.get(kind, {}), SMALL.get(kind, {})
        names = dict.fromkeys((*FIRST.get(kind, ()), *least, *most))
        bounds = {
            f"{key}.{n}": (
                least[n](problem, own) if n in least else -np.inf,
                most[n](problem, own) if n in most else np.inf,
            )
            for n in names
        }
        bounds = {n: b for n, b in bounds.items() if n in free}
        if bounds:
            first = next(iter(bounds))
            return Size(first, np.isinf(bounds[first][0]), bounds)
    return None


__all__ = ["Size", "size_of"]
