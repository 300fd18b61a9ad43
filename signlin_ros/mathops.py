"""The vocabulary ``m`` in which effects are written, and its three meanings.

An effect calls ``m.sign(v)``, ``m.abs(v)``, ``m.positive(x)`` ... and never asks what they return:

* `NumpyMath` evaluates: exact non-smooth values;
* `Recorder` evaluates nothing: it notes the switching surface g and returns a fresh symbol s, so that one trace
  serves the exact, the set-valued and the smooth right-hand side alike (``sign(g) -> s``, ``|g| -> g s``,
  ``max(g, 0) -> g (1 + s)/2``);
* `SympyMath` writes the equation for reports and docs.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from types import ModuleType
from typing import Any

import casadi as ca
import numpy as np

Word = Callable[[Any], Any]


@dataclass(frozen=True)
class Smooth:
    """A smooth function of one argument in the three vocabularies; SymPy is imported only where it is asked for."""

    numpy: Word
    casadi: Word
    sympy: Callable[[ModuleType], Word]


SMOOTH_FUNCTIONS = {
    "exp": Smooth(np.exp, ca.exp, lambda s: s.exp),
    "log1p": Smooth(np.log1p, ca.log1p, lambda s: lambda x: s.log(1 + x)),
    "sin": Smooth(np.sin, ca.sin, lambda s: s.sin),
    "cos": Smooth(np.cos, ca.cos, lambda s: s.cos),
    "tanh": Smooth(np.tanh, ca.tanh, lambda s: s.tanh),
    "asinh": Smooth(np.arcsinh, ca.asinh, lambda s: s.asinh),
    "sqrt": Smooth(np.sqrt, ca.sqrt, lambda s: s.sqrt),
}
"""Smooth functions of one argument, by their words."""


class Math:
    """What every vocabulary shares: derived words, written once. Those of `SMOOTH_FUNCTIONS` are set on each
    instance.
    """

    def sign(self, g: Any) -> Any:
        """The set-valued sign of g."""
        raise NotImplementedError

    def abs(self, g: Any) -> Any:
        """|g|, a continuous kink."""
        raise NotImplementedError

    def positive(self, g: Any) -> Any:
        """max(g, 0), a continuous kink."""
        raise NotImplementedError

    def contact(self, g: Any) -> Any:
        """1 where g > 0, else 0: a jump that can never stick."""
        raise NotImplementedError

    def abs_power(self, h: Any, n: float) -> Any:
        """|h|^n, for a known number n >= 1; below 1 only times sign(h), which takes the pole at 0 away."""
        raise NotImplementedError

    def signed_power(self, h: Any, n: float) -> Any:
        """|h|^(n-1) h, for a known number n >= 1."""
        raise NotImplementedError

    def clip(self, x: Any, limit: Any) -> Any:
        """X held within ±limit."""
        return x - self.positive(x - limit) + self.positive(-x - limit)

    def dead_zone(self, x: Any, half_width: Any) -> Any:
        """max(x - d, 0) - max(-x - d, 0)."""
        return self.positive(x - half_width) - self.positive(-x - half_width)

    def spline(self, x: Any, knots: Sequence[float], values: Sequence[Any]) -> Any:
        """The curve through ``values`` at ``knots`` (two or more numbers that rise), cubic between them, linear beyond.

        It is smooth (once differentiable), so that no surface is recorded, and rises and falls only where the values
        do.   [Fritsch and Butland 1984, doi:10.1137/0905021]
        """
        h = [high - low for low, high in pairwise(knots)]
        s = [(high - low) / step for (low, high), step in zip(pairwise(values), h, strict=True)]
        inner = [self._slope(*pair, *steps) for pair, steps in zip(pairwise(s), pairwise(h), strict=True)]
        slopes = [s[0], *inner, s[-1]]
        total = values[0] + slopes[0] * self._least(x - knots[0], 0.0) + slopes[-1] * self._largest(x - knots[-1], 0.0)
        for knot, step, secant, (first, last) in zip(knots, h, s, pairwise(slopes), strict=False):
            t = self._least(self._largest((x - knot) / step, 0.0), 1.0)
            total += step * t * (first + t * (3 * secant - 2 * first - last + t * (first + last - 2 * secant)))
        return total

    def _slope(self, before: Any, after: Any, h_before: float, h_after: float) -> Any:
        """Return the slope at a knot: a harmonic mean of the secants beside it, 0 where the curve turns."""
        w_before, w_after = 2 * h_after + h_before, h_after + 2 * h_before
        both = before * after
        mean = self._where(both, w_before * after + w_after * before, 1.0)
        return self._where(both, (w_before + w_after) * both / mean, 0.0)

    def _least(self, a: Any, b: float) -> Any:
        """The smaller of two; where they are equal it has the derivative of the first."""
        raise NotImplementedError

    def _largest(self, a: Any, b: float) -> Any:
        """The larger of two; where they are equal it has the derivative of the second."""
        raise NotImplementedError

    def _where(self, g: Any, a: Any, b: Any) -> Any:
        """``a`` where g > 0, else b."""
        raise NotImplementedError


VOCABULARY = tuple(sorted(name for name in {*SMOOTH_FUNCTIONS, *vars(Math)} if not name.startswith("_")))
"""What a vocabulary offers."""


class NumpyMath(Math):
    """Exact non-smooth values on NumPy arrays; sign(0) = 0."""

    sign, abs = map(staticmethod, (np.sign, np.abs))  # type: ignore[assignment]

    def __init__(self) -> None:
        vars(self).update({name: word.numpy for name, word in SMOOTH_FUNCTIONS.items()})

    def positive(self, g: Any) -> Any:
        return np.maximum(g, 0.0)

    def contact(self, g: Any) -> Any:
        return np.heaviside(g, 0.0)

    def _least(self, a: Any, b: float) -> Any:
        return np.minimum(a, b)

    def _largest(self, a: Any, b: float) -> Any:
        return np.maximum(a, b)

    def _where(self, g: Any, a: Any, b: Any) -> Any:
        return np.where(g > 0, a, b)

    def abs_power(self, h: Any, n: float) -> Any:
        return np.abs(h) ** n

    def signed_power(self, h: Any, n: float) -> Any:
        return np.abs(h) ** (n - 1) * h


@dataclass(frozen=True)
class Surface:
    """A switching surface g = 0 noted by the `Recorder`.

    ``kind`` is "switch" (a sign: jumps, can stick), "kink" (continuous) or "contact" (jumps, cannot stick).
    ``size`` is the largest |g| to expect, 0 where that is not known; ``label`` a name of its own.
    """

    symbol: ca.SX
    g: ca.SX
    kind: str
    label: str = ""
    size: float = 0.0

    @functools.cached_property
    def name(self) -> str:
        """The surface as text, e.g. ``speed`` or ``(displacement-hard_stop.gap)``."""
        return self.label or str(self.g)


@dataclass
class Recorder(Math):
    """Notes surfaces instead of evaluating signs; works on CasADi SX."""

    surfaces: list[Surface] = field(default_factory=list)

    def __post_init__(self) -> None:
        vars(self).update({name: word.casadi for name, word in SMOOTH_FUNCTIONS.items()})

    def _note(self, g: Any, kind: str) -> ca.SX:
        """Return the symbol that stands for sign(g): a known one for a known g or -g, else a fresh one."""
        g = ca.SX(g)
        if g.is_constant():
            return ca.SX(ca.sign(g))
        for surface in self.surfaces:
            if surface.kind == kind and ca.is_equal(surface.g, g, 12):
                return surface.symbol
            if surface.kind == kind and ca.is_equal(surface.g, -g, 12):
                return -surface.symbol
        symbol = ca.SX.sym(f"s{len(self.surfaces)}")
        self.surfaces.append(Surface(symbol, g, kind))
        return symbol

    def sign(self, g: Any) -> Any:
        return self._note(g, "switch")

    def abs(self, g: Any) -> Any:
        return g * self._note(g, "kink")

    def positive(self, g: Any) -> Any:
        return g * (1 + self._note(g, "kink")) / 2

    def contact(self, g: Any) -> Any:
        return (1 + self._note(g, "contact")) / 2

    def _least(self, a: Any, b: float) -> Any:
        return ca.fmin(a, b)

    def _largest(self, a: Any, b: float) -> Any:
        return ca.fmax(b, a)  # the order decides which derivative it has where they are equal

    def _where(self, g: Any, a: Any, b: Any) -> Any:
        return ca.if_else(g > 0, a, b)

    @staticmethod
    def _real_power(size: ca.SX, exponent: float) -> Any:
        """size^exponent for size >= 0, with derivative 0 at 0, where the formula of the power rule has a pole."""
        return ca.if_else(size != 0, ca.fabs(size), 1e-300) ** exponent

    def abs_power(self, h: Any, n: float) -> Any:
        s = self._note(h, "kink")
        if n != int(n):
            return self._real_power(h * s, n)
        return h ** int(n) * (s if int(n) % 2 else 1)

    def signed_power(self, h: Any, n: float) -> Any:
        s = self._note(h, "kink")
        if n != int(n):
            return self._real_power(h * s, n - 1) * h
        return h ** int(n) * (1 if int(n) % 2 else s)


class SympyMath(Math):
    """Writes the exact equation with SymPy."""

    def __init__(self) -> None:
        import sympy

        self._sympy = sympy
        vars(self).update({name: word.sympy(sympy) for name, word in SMOOTH_FUNCTIONS.items()})

    def sign(self, g: Any) -> Any:
        return self._sympy.sign(g)

    def abs(self, g: Any) -> Any:
        return self._sympy.Abs(g)

    def positive(self, g: Any) -> Any:
        return self._sympy.Max(g, 0)

    def contact(self, g: Any) -> Any:
        return self._sympy.Heaviside(g, 0)

    def _least(self, a: Any, b: float) -> Any:
        return self._sympy.Min(a, b)

    def _largest(self, a: Any, b: float) -> Any:
        return self._sympy.Max(a, b)

    def _where(self, g: Any, a: Any, b: Any) -> Any:
        return self._sympy.Piecewise((a, g > 0), (b, True))

    def abs_power(self, h: Any, n: float) -> Any:
        return self._sympy.Abs(h) ** n

    def signed_power(self, h: Any, n: float) -> Any:
        return self._sympy.Abs(h) ** (n - 1) * h
