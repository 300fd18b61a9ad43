"""The linear part of a model: what is left of its equations at rest."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from signlin_ros.engine.symbolic import symbolic
from signlin_ros.model import Model
from signlin_ros.recording.trace import Structure, trace

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Base:
    """x' = A x + B u + c, (n, n), (n, m), (n,): a model at rest, its switches in the middle; channels y = C x + D u + e
    of every state and output by name; ``states``: names of x. ``delay`` of the input in s.
    """

    A: Array
    B: Array
    c: Array
    rows: dict[str, tuple[Array, Array, float]]
    inputs: tuple[str, ...]
    states: tuple[str, ...]
    delay: float

    def seen_by(self, channels: Sequence[str]) -> Base:
        """Return the part that some channels show: the states that they depend on, and those that these depend on."""
        kept = np.any([(self.rows[name][0] != 0.0) for name in channels], axis=0)
        for _ in range(kept.size):
            kept = kept | np.any(self.A[kept] != 0.0, axis=0)
        rows = {name: (C[kept], D, e) for name, (C, D, e) in self.rows.items()}
        states = tuple(name for name, keep in zip(self.states, kept, strict=True) if keep)
        return replace(self, A=self.A[np.ix_(kept, kept)], B=self.B[kept], c=self.c[kept], rows=rows, states=states)

    @property
    def rates(self) -> Array:
        """The sizes of the poles (n,) in 1/s, 0 for what is integrated."""
        return np.asarray(np.abs(np.linalg.eigvals(self.A)), dtype=float)

    @property
    def slowest(self) -> float:
        """The rate of the slowest motion in 1/s, what is integrated aside; 0 where nothing else is there."""
        moving = self.rates[self.rates > 1e-6 * self.rates.max(initial=0.0)]
        return float(moving.min(initial=np.inf)) if moving.size else 0.0

    @property
    def times(self) -> Array:
        """How long each motion takes (n,), in s: its time constant or, where that is shorter, the period of its
        oscillation, which then tells the motion before it has died out; infinite for what does neither.
        """
        poles = np.linalg.eigvals(self.A)
        size = 1e-9 * np.abs(poles).max(initial=0.0)
        decay, turns = -poles.real, np.abs(poles.imag) / (2.0 * np.pi)
        rates = np.maximum(decay, turns)
        return np.asarray(np.divide(1.0, rates, out=np.full(poles.size, np.inf), where=rates > size), dtype=float)


@symbolic
@functools.lru_cache(maxsize=64)
def _linear_function(structure: Structure) -> ca.Function:
    """Return the function (x, u, p, s) -> A, B, f, C, D, y, as expressions of one structure."""
    t = trace(structure)
    signs = ca.vertcat(*(s.symbol for s in t.surfaces)) if t.surfaces else ca.SX(0, 1)
    g = ca.vertcat(*(s.g for s in t.surfaces)) if t.surfaces else ca.SX(0, 1)
    y = ca.densify(t.y)
    parts = [ca.jacobian(t.f, t.x), ca.jacobian(t.f, t.u), t.f, ca.jacobian(y, t.x), ca.jacobian(y, t.u), y, g]
    return ca.Function("base", [t.x, t.u, t.p, signs], [ca.densify(part) for part in parts])


def linear_base(model: Model) -> Base | None:
    """Return the linear part of a model; None where it is not finite."""
    function, n, m = _linear_function(model.structure), len(model.states), len(model.inputs)
    rest = np.zeros(n), np.zeros(m), model.p
    count = function.size1_in(3)
    surfaces = np.asarray(function(*rest, np.zeros(count))[6]).ravel()
    A, B, f, C, D, y, _ = (np.asarray(part, dtype=float) for part in function(*rest, np.sign(surfaces)))
    if not all(np.isfinite(part).all() for part in (A, B, f, C, D, y)):
        return None
    rows = {name: (np.eye(n)[i], np.zeros(m), 0.0) for i, name in enumerate(model.states)}
    given = zip(model.outputs if y.size else (), C, D, y.ravel(), strict=True)  # none are traced that are all states
    rows |= {name: (row, direct, float(value)) for name, row, direct, value in given if name not in model.states}
    return Base(A, B.reshape(n, m), f.ravel(), rows, model.inputs, model.states, model.delay)


__all__ = ["Base", "linear_base"]
