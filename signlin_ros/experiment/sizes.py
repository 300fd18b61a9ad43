"""The smallest size at which a richer law is of interest: the simpler one inside it could else never win. Which it is
says the law itself (`Effect.of_interest`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from signlin_ros.effects import EFFECTS
from signlin_ros.effects.base import Effect
from signlin_ros.fitting.candidate import Candidate
from signlin_ros.fitting.problem import Problem


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


def is_sized(effect: str) -> bool:
    """Tell whether an effect says from which size on it is of interest."""
    return EFFECTS[effect].of_interest.__func__ is not Effect.of_interest.__func__  # type: ignore[attr-defined]


def size_of(problem: Problem, c: Candidate, theta: np.ndarray[tuple[int], np.dtype[np.float64]]) -> Size | None:
    """Return the smallest size of interest of what a candidate adds last; None where its estimate is its size."""
    if problem.scale.imposed:
        return None
    free, named = [k.name for k in c.coordinates], {**c.values, **c.named(theta)}
    for key in (key for key in reversed(c.label) if key in c.model.effects):
        effect = EFFECTS[c.model.effects[key].type]
        if not is_sized(effect.name):
            continue
        own = {n.rpartition(".")[2]: v for n, v in named.items() if n.startswith(f"{key}.")}
        told = {f"{key}.{n}": b for n, b in effect.of_interest(own, problem.scale).items()}
        bounds = {n: b for n, b in told.items() if n in free}
        if bounds:
            first = next(iter(bounds))
            return Size(first, bool(np.isinf(bounds[first][0])), bounds)
    return None


__all__ = ["Size", "is_sized", "size_of"]
