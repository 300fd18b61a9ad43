"""The stick-slip motor with SciPy's solve_ivp, as a careful user would write it. Shares no code with this package.

Each sample's held voltage is one segment. Within it the motor either slips in a known direction, where friction is a
smooth function and the event is w = 0, or it sticks, where only the current moves and the event is K_t i at the
breakaway level. Each solution starts with the step that the last one ended with, which saves SciPy's guess.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

Array = NDArray[np.float64]


@dataclass
class StickSlipMotor:
    """Simulates L i' = V - R i - K_m w, J w' = K_t i - B w - friction(w), friction set-valued at w = 0."""

    motor: Mapping[str, float]
    friction: Mapping[str, float]
    method: str = "DOP853"
    rtol: float = 1e-6
    atol: float = 1e-9

    def __post_init__(self) -> None:
        self.level = self.friction["mu"] + self.friction["excess"]
        self._slips = {direction: self._slip(direction) for direction in (-1.0, 1.0)}
        self._step = math.inf

    def _slip(self, direction: float) -> tuple[Callable[..., Any], Callable[..., Any]]:
        p, f = self.motor, self.friction
        R, L, K_t, K_m, B, J = (p[name] for name in ("R_a", "L_a", "K_t", "K_m", "B", "J"))
        mu, excess, v_s, exp = direction * f["mu"], direction * f["excess"], f["v_s"], math.exp

        def rates(_t: float, x: Array, voltage: float) -> list[float]:
            i, w = x.tolist()
            slow = w / v_s
            return [(voltage - R * i - K_m * w) / L, (K_t * i - B * w - mu - excess * exp(-slow * slow)) / J]

        def stops(_t: float, x: Array, voltage: float) -> float:
            return float(x[1])

        stops.terminal, stops.direction = True, -direction  # type: ignore[attr-defined]
        return rates, stops

    def _solve(self, rates: Any, event: Any, t: float, end: float, x: Any, voltage: float) -> Any:
        first = min(self._step, end - t)
        found = solve_ivp(
            rates,
            (t, end),
            x,
            method=self.method,
            events=event,
            args=(voltage,),
            first_step=first,
            rtol=self.rtol,
            atol=self.atol,
        )
        if len(found.t) > 2:  # the last step is cut at the end of the segment
            self._step = found.t[-2] - found.t[-3] if len(found.t) > 3 else found.t[1] - found.t[0]
        else:
            self._step = 2 * first
        return found

    def _stick(self, t: float, end: float, i: float, voltage: float) -> tuple[float, Array]:
        R, L, K_t, level = self.motor["R_a"], self.motor["L_a"], self.motor["K_t"], self.level

        def rates(_t: float, x: Array, voltage: float) -> list[float]:
            return [(voltage - R * x[0]) / L]

        def breaks(_t: float, x: Array, voltage: float) -> float:
            return abs(K_t * float(x[0])) - level

        breaks.terminal, breaks.direction = True, 1  # type: ignore[attr-defined]
        found = self._solve(rates, breaks, t, end, [i], voltage)
        return found.t[-1], np.array([found.y[0, -1], 0.0])

    def _direction(self, x: Array, voltage: float) -> float:
        """Return the way it slips, 1 or -1, or 0 if it sticks."""
        i, w = x.tolist()
        if w != 0.0:
            return math.copysign(1.0, w)
        beyond = abs(self.motor["K_t"] * i) / self.level - 1.0
        grows = i * (voltage - self.motor["R_a"] * i) > 0.0
        return math.copysign(1.0, i) if beyond > 1e-12 or (beyond > -1e-12 and grows) else 0.0

    def _sample(self, t: float, end: float, x: Array, voltage: float) -> Array:
        """Carry (i, w) from t to end with the voltage held, mode by mode."""
        while t < end:
            direction = self._direction(x, voltage)
            if direction == 0.0:
                t, x = self._stick(t, end, x[0], voltage)
                continue
            rates, stops = self._slips[direction]
            found = self._solve(rates, stops, t, end, x, voltage)
            t, x = found.t[-1], found.y[:, -1]
            if found.status == 1:
                x = np.array([x[0], 0.0])
        return x

    def run(self, t: Array, u: Array) -> Array:
        """Return (i, w) at times t (T,) from rest, the voltage u (T,) held from each time to the next; (T, 2)."""
        x, out = np.zeros(2), np.zeros((t.size, 2))
        self._step = math.inf
        for k in range(t.size - 1):
            out[k + 1] = x = self._sample(t[k], t[k + 1], x, float(u[k]))
        return out
