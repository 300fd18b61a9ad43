"""The Bouc-Wen oscillator by hand: what a user without this package would write. Shares no code with it.

Equations: paper (34)-(36) with sign_j for every sign, |v| -> v s_v, and |h|^n, |h|^(n-1) h by the parity of n; the
optimal linearization (26)-(27), whose c is 0 because f(0) = 0.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class BoucWenByHand:
    """f_j and its optimal linearization, for one point or for many."""

    def __init__(self, parameters: Mapping[str, float], order: int, scale: float) -> None:
        self.p, self.order, self.scale = dict(parameters), order, scale
        self.n = int(parameters["n"])

    def sign(self, g: Any) -> Any:
        """sign_j as it stands in the paper, eq. (9)."""
        z = g / self.scale
        up, down = (1 + z) ** self.order, (1 - z) ** self.order
        return (up - down) / (up + down)

    def slope(self, g: Any) -> Any:
        """Its derivative: 4 j (1 - z²)^(j-1) / ((1 + z)^j + (1 - z)^j)²."""
        z, j = g / self.scale, self.order
        return 4 * j * (1 - z * z) ** (j - 1) / ((1 + z) ** j + (1 - z) ** j) ** 2 / self.scale

    def powers(self, h: Any, s: Any) -> tuple[Any, Any]:
        """|h|^(n-1) h and |h|^n."""
        odd = self.n % 2
        return h**self.n * (1 if odd else s), h**self.n * (s if odd else 1)

    def rhs(self, _t: float, x: Any, u: Any, _params: Any = None) -> Any:
        """F_j(x, u), the way that python-control wants it."""
        p = self.p
        q, v, h = float(x[0]), float(x[1]), float(x[2])
        signed, absolute = self.powers(h, self.sign(h))
        loop = p["beta"] * v * self.sign(v) * signed + p["gamma"] * v * absolute
        spring = p["alpha"] * p["k"] * q + (1 - p["alpha"]) * p["D"] * p["k"] * h
        return [v, (float(u[0]) - p["c"] * v - spring) / p["m"], (p["lambda"] * v - loop) / p["D"]]

    def rows(self, v: Any, h: Any) -> tuple[Any, Any, Any]:
        """The hysteresis row: f_3, df_3/dv, df_3/dh."""
        p, n = self.p, self.n
        sv, sh, dv, dh = self.sign(v), self.sign(h), self.slope(v), self.slope(h)
        signed, absolute = self.powers(h, sh)
        lower, odd = n * h ** (n - 1), n % 2
        d_signed = lower if odd else lower * sh + h**n * dh
        d_absolute = lower * sh + h**n * dh if odd else lower
        f = (p["lambda"] * v - p["beta"] * v * sv * signed - p["gamma"] * v * absolute) / p["D"]
        by_v = (p["lambda"] - p["beta"] * (sv + v * dv) * signed - p["gamma"] * absolute) / p["D"]
        by_h = -(p["beta"] * v * sv * d_signed + p["gamma"] * v * d_absolute) / p["D"]
        return f, by_v, by_h

    def linearize(self, x: Array) -> tuple[Array, Array]:
        """A_k (3, 3) and B_k (3, 1) at one point."""
        q, v, h = x.tolist()
        p = self.p
        f, by_v, by_h = self.rows(v, h)
        factor = (f - by_v * v - by_h * h) / (q * q + v * v + h * h)
        stiffness, hysteresis = p["alpha"] * p["k"], (1 - p["alpha"]) * p["D"] * p["k"]
        second = [-stiffness / p["m"], -p["c"] / p["m"], -hysteresis / p["m"]]
        third = [factor * q, by_v + factor * v, by_h + factor * h]
        return np.array([[0.0, 1.0, 0.0], second, third]), np.array([[0.0], [1 / p["m"]], [0.0]])

    def batch(self, x: Array) -> tuple[Array, Array]:
        """A_k (T, 3, 3) and B_k (T, 3, 1) at points x (T, 3)."""
        q, v, h = x.T
        p = self.p
        f, by_v, by_h = self.rows(v, h)
        factor = (f - by_v * v - by_h * h) / (q * q + v * v + h * h)
        A, B = np.zeros((len(x), 3, 3)), np.zeros((len(x), 3, 1))
        A[:, 0, 1], B[:, 1, 0] = 1.0, 1 / p["m"]
        A[:, 1] = np.array([-p["alpha"] * p["k"], -p["c"], -(1 - p["alpha"]) * p["D"] * p["k"]]) / p["m"]
        A[:, 2] = factor[:, None] * x
        A[:, 2, 1] += by_v
        A[:, 2, 2] += by_h
        return A, B
