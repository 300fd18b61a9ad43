"""Causal estimates of states that a record or a sensor does not hold."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from signlin_ros.engine.slopes import causal_slopes, slope_at_end
from signlin_ros.errors import InputError
from signlin_ros.model import Model
from signlin_ros.simulation import Stepper

Array = NDArray[np.float64]


class CausalDerivative:
    """The derivative now, from a parabola fitted to the samples of the last ``window`` seconds.

    Even and uneven samples alike; nothing of the future is used. ``delay`` is the lag at low frequencies in s: 0 for
    motions up to constant acceleration with the parabola (degree 2), half the window with a line (degree 1).
    White noise of standard deviation s on N samples dt apart gives about 14 s / (dt N^1.5) on the derivative with the
    parabola and 3.5 s / (dt N^1.5) with the line (Savitzky and Golay 1964, doi:10.1021/ac60214a047).
    """

    def __init__(self, window: float = 0.02, degree: int = 2, least: int = 5) -> None:
        if not (window > 0 and degree in (1, 2) and least > degree):
            raise InputError(f"window {window}, degree {degree}, least {least}: a positive window, degree 1 or 2")
        self.window, self.degree, self.least = window, degree, least
        self.delay = window / 2 if degree == 1 else 0.0
        self._samples: deque[tuple[float, float]] = deque()

    def reset(self) -> None:
        """Forget all samples, e.g. after time has jumped."""
        self._samples.clear()

    def update(self, t: float, value: float) -> float:
        """Take a sample at time t (s) and return the derivative there; 0 until there are enough samples."""
        if self._samples and t <= self._samples[-1][0]:
            raise InputError(f"time does not increase: {t} after {self._samples[-1][0]}")
        self._samples.append((t, value))
        while len(self._samples) > self.least and self._samples[0][0] < t - self.window:
            self._samples.popleft()
        count = len(self._samples)
        if count < 2:
            return 0.0
        data = np.array(self._samples).T.copy()
        return float(slope_at_end(data[0], data[1], min(self.degree, count - 1)))

    def all(self, t: ArrayLike, values: ArrayLike) -> Array:
        """Return the derivative (T,) at every time of a whole record, each from the past alone; NaN values skipped."""
        times, samples = np.asarray(t, dtype=float), np.asarray(values, dtype=float)
        good = np.isfinite(samples)
        slopes = np.zeros(int(good.sum()))
        causal_slopes(times[good], samples[good], self.window, self.degree, self.least, slopes)
        latest = np.maximum.accumulate(np.where(good, np.cumsum(good) - 1, -1))
        return np.where(latest >= 0, slopes[latest], 0.0) if slopes.size else np.zeros(times.size)


class StateEstimator:
    """The full state from the states that are measured, causally.

    A velocity that is not measured beside its position comes from a `CausalDerivative`; any other state that is not
    measured (presliding, hysteresis, temperature, a hidden load) is carried by the model itself, driven by the
    measured states and the input. Measured values are true ones: what a sensor adds is taken off before
    (`signlin_ros.sensors`).
    """

    def __init__(self, model: Model, measured: Iterable[str], rate: float = 0.0, window: float | None = None) -> None:
        self.model = model
        self.measured = tuple(model.canonical(name) for name in measured)
        position, velocity = model.plant.position, model.plant.velocity
        self._derive = velocity in model.states and velocity not in self.measured and position in self.measured
        self._filter = CausalDerivative(window or (max(0.008, 5.0 / rate) if rate > 0 else 0.02))
        covered = {*self.measured, *([velocity] if self._derive else [])}
        self.carried = tuple(name for name in model.states if name not in covered)
        self._stepper = Stepper(model)
        self._last: tuple[float, Array] | None = None

    def warm_up(self) -> StateEstimator:
        """Compile what an update needs, so that the first one is as quick as the others; returns itself, reset."""
        for t in (0.0, 1e-3, 2e-3):
            self.update(t, dict.fromkeys(self.measured, 0.0), np.zeros(len(self.model.inputs)))
        self.reset()
        return self

    @property
    def delay(self) -> float:
        """Lag of the derived velocity in s; 0 where nothing is derived."""
        return self._filter.delay if self._derive else 0.0

    def reset(self) -> None:
        """Start anew, e.g. after time has jumped."""
        self._filter.reset()
        self._stepper = Stepper(self.model)
        self._last = None

    def all(self, t: Array, measured: Mapping[str, Array], u: Array) -> Array:
        """Return the states (T, n) over a whole record: measured values (T,) by name, inputs (T, m)."""
        if self.carried:
            self.reset()
            names = list(measured)
            rows = zip(t, np.array([measured[name] for name in names]).T, u, strict=True)
            return np.array([self.update(when, dict(zip(names, row, strict=True)), held) for when, row, held in rows])
        values = {self.model.canonical(name): np.asarray(v, dtype=float) for name, v in measured.items()}
        if self._derive:
            values[self.model.plant.velocity] = self._filter.all(t, values[self.model.plant.position])
        return np.column_stack([values[name] for name in self.model.states])

    def update(self, t: float, measured: Mapping[str, float], u: ArrayLike) -> Array:
        """Return the state (n,) at time t (s) from measured values by name and the input u (m,) from t on."""
        index = self.model.states.index
        if self._last is not None and self.carried and t > self._last[0]:
            self._stepper.advance(t - self._last[0], self._last[1])
        x = self._stepper.x.copy()
        for name, value in measured.items():
            plain = self.model.canonical(name)
            if plain in self.measured and plain in self.model.states and np.isfinite(value):
                x[index(plain)] = value
        if self._derive and np.isfinite(x[index(self.model.plant.position)]):
            x[index(self.model.plant.velocity)] = self._filter.update(t, float(x[index(self.model.plant.position)]))
        self._stepper.x = x
        self._last = (t, np.asarray(u, dtype=float).reshape(-1))
        return np.array(x)
