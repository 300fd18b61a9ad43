"""The inverse model: the effort that the measured motion should have taken, beside the effort that was measured.

The convention of robotics [Gautier, Janot and Vandanjon, IEEE Trans. Control Systems Technology 21 (2013) 428]: the
position is differentiated by central differences after a zero-phase Butterworth low-pass of order 4, the measured and
the computed effort pass through the same low-pass and are decimated; what the filters see of the ends is left out.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation, binary_opening, uniform_filter1d
from scipy.signal import butter, decimate, sosfiltfilt

from signlin_ros.comparison.missing import inertia, per_force
from signlin_ros.effects import Effect, find_effect
from signlin_ros.errors import InputError
from signlin_ros.follow.data import SHORTEST, Stretch
from signlin_ros.follow.tracking import Tracker, driven, filled
from signlin_ros.model import Model
from signlin_ros.noise import Noise, derivative_noise

Array = NDArray[np.float64]
Kind = TypeVar("Kind", bound=np.generic)

NOISY = 0.05
"""The cut-off is lowered until the noise of the acceleration is worth no more than this share of the effort."""
STILL = 3.0
"""Slower than this many standard deviations of the derived velocity counts as standing."""
UNEVEN, LOST = 0.01, 5
"""Steps that differ by less than this share are even; so many missing samples in a row are interpolated, and around
longer holes nothing is compared."""
EDGE = 2
"""So many decimated samples are left out at either end."""


@dataclass(frozen=True)
class Inverse:
    """Effort as measured and as computed (K,) each, over all stretches, after filtering and decimation.

    ``name`` and ``unit`` of the effort; ``cutoff`` in Hz; ``decimation``: every so many samples are kept.
    """

    name: str
    unit: str
    cutoff: float
    decimation: int
    measured: Array
    computed: Array

    @property
    def rmse(self) -> float:
        """Root mean square of the error, in ``unit``."""
        return float(np.sqrt(np.mean((self.measured - self.computed) ** 2)))

    @property
    def relative_error_percent(self) -> float | None:
        """100 |tau - tauhat| / |tau|; None where there was no effort."""
        size = float(np.linalg.norm(self.measured))
        return 100.0 * float(np.linalg.norm(self.measured - self.computed)) / size if size > 0 else None

    def to_json(self) -> dict[str, float | str | int | None]:
        """Return the entry of the contract, with the filter that was used."""
        return {
            "unit": self.unit,
            "rmse": self.rmse,
            "relative_error_percent": self.relative_error_percent,
            "cutoff_hz": self.cutoff,
            "decimation": self.decimation,
        }


@dataclass(frozen=True)
class _Even:
    """A stretch on an even grid: t (T,), u (T, m) held, the measured channels by name (T,), the measured effort (T,);
    ``known`` (T,): 1 where no channel is missing for long.
    """

    t: Array
    u: Array
    values: dict[str, Array]
    effort: Array
    known: Array


@dataclass(frozen=True)
class Efforts:
    """The effort of records, as measured and as any model computes it from their motion, filtered and decimated alike:
    by a low-pass of order 4 at ``cutoff`` Hz, samples ``step`` s apart.

    ``name``: of the input, output or state that tells the effort; arrays (K,) are over all stretches, without their
    ends.
    """

    name: str
    cutoff: float
    step: float
    level: dict[str, Noise]
    even: tuple[_Even, ...]

    @classmethod
    def of(
        cls,
        model: Model,
        stretches: Sequence[Stretch],
        channels: tuple[str, ...],
        noise: Sequence[Noise],
        cutoff: float | None = None,
    ) -> Efforts | None:
        """Return the efforts of records; None where motion or effort is not known, or they are too short.

        ``cutoff`` in Hz; by default a tenth of the sampling rate, or less where the noise asks for it. Raises
        `InputError` if it is not below half the sampling rate.
        """
        effort = _effort_name(model, channels)
        if effort is None or not {model.plant.position, model.plant.velocity} & {*channels, *model.inputs}:
            return None
        step = float(np.median(np.concatenate([np.diff(s.t) for s in stretches])))
        even = [_even(model, s, channels, step, effort) for s in stretches]
        level = dict(zip(channels, noise, strict=True))
        if cutoff is None:
            measured = np.concatenate([e.effort for e in even])
            cutoff = _cutoff(model, level, step, float(np.sqrt(np.mean(measured**2))))
        if not 0 < cutoff < 0.5 / step:
            half = f"half the sampling rate, {0.5 / step:g} Hz"
            raise InputError(f"cutoff: found {cutoff:g} Hz; allowed: above 0 and below {half}")
        found = cls(effort, float(cutoff), step, level, tuple(even))
        long = tuple(e for e in even if e.t.size >= (2 * EDGE + 2) * found.every + SHORTEST)
        found = replace(found, even=long)
        return found if long and found.measured.size else None

    def inverse(self, model: Model, units: Mapping[str, str]) -> Inverse:
        """Return the effort computed from the motion by a model, beside the measured one; ``units`` of the record."""
        name, unit = self.name, units.get(self.name) or model.units[self.name]
        if name == "current":
            name, unit = "torque", model.plant.force_unit
        return Inverse(name, unit, self.cutoff, self.every, self.measured, self.computed(model))

    @property
    def every(self) -> int:
        """Every so many samples are kept."""
        return max(1, int(1 / (self.step * self.cutoff) + 1e-9))

    @cached_property
    def measured(self) -> Array:
        """The measured effort (K,)."""
        return self._thinned(lambda e: e.effort)

    def computed(self, model: Model) -> Array:
        """Return the effort (K,) that the motion takes according to a model of the same plant."""
        return self._thinned(lambda e: self._computed(model, e))

    def moving(self, model: Model) -> NDArray[np.bool_]:
        """Return where (K,) nothing stands within reach of the filter; everywhere if there is no state of velocity."""
        reach = np.ones(2 * self.every + 1, dtype=bool)
        standing = [(e, binary_dilation(self._motion(model, e)[2], reach)) for e in self.even]
        return np.concatenate([self._known(e, ~stands[:: self.every]) for e, stands in standing])

    def along(self, model: Model, name: str) -> Array | None:
        """Return a state or an input (K,), filtered like the efforts; None where the model has none of this name."""
        if name in model.inputs:
            return self._thinned(lambda e: e.u[:, model.inputs.index(name)])
        if name not in model.states:
            return None
        return self._thinned(lambda e: self._motion(model, e)[0][:, model.states.index(name)])

    def _passed(self, values: Array) -> Array:
        """Return values (T,) without what is faster than the cut-off, and without a phase shift."""
        return np.asarray(sosfiltfilt(butter(4, self.cutoff, fs=1 / self.step, output="sos"), values))

    def _thinned(self, shown: Callable[[_Even], Array]) -> Array:
        """Return what is shown (T,) of every stretch, filtered and decimated (K,)."""
        passed, every = ((e, self._passed(shown(e))) for e in self.even), self.every
        return np.concatenate([self._known(e, decimate(x, every) if every > 1 else x) for e, x in passed])

    def _known(self, e: _Even, values: NDArray[Kind]) -> NDArray[Kind]:
        """Return values after decimation without the ends of a stretch, and what is near long holes."""
        near = uniform_filter1d(e.known, 2 * EDGE * self.every + 1, mode="nearest")[:: self.every]
        return np.asarray(values[EDGE:-EDGE][near[EDGE:-EDGE] > 1 - 1e-9])

    def _computed(self, model: Model, e: _Even) -> Array:
        """Return the effort (T,) that the motion takes according to the model."""
        x, acceleration, standing = self._motion(model, e)
        if model.plant.velocity not in model.states:
            return _tracker(model, e.t, e.u, (self.name,)).outputs(x)[:, 0]
        row = model.states.index(model.plant.velocity)
        rate = _tracker(model, e.t, e.u, model.states).rate(x, row, acceleration, standing)
        return np.asarray(e.effort + (acceleration - rate) / per_force(model)[row])

    def _motion(self, model: Model, e: _Even) -> tuple[Array, Array, NDArray[np.bool_]]:
        """Return the states (T, n), the acceleration (T,), and where (T,) it stands as far as is known: of an imposed
        motion nowhere, and no acceleration is taken.
        """
        position, velocity = model.plant.position, model.plant.velocity
        motion = {k: v for k, v in e.values.items() if k in model.states}
        if velocity not in model.states:
            return driven(model, e.t, e.u, motion), np.zeros(e.t.size), np.zeros(e.t.size, dtype=bool)
        source, order, _ = _best_source(model, self.level, self.step, self.cutoff)
        motion |= {k: self._passed(motion[k]) for k in (position, velocity) if k in motion}
        if order == 2 or velocity not in motion:
            motion[velocity] = np.gradient(motion[position], e.t)
        acceleration = np.gradient(motion[velocity], e.t)
        noise = derivative_noise(self.level[source].effective, order - 1, self.cutoff, self.step)
        return driven(model, e.t, e.u, motion), acceleration, np.abs(motion[velocity]) <= STILL * noise


def _effort_name(model: Model, channels: tuple[str, ...]) -> str | None:
    """Return the input, output or state that tells the effort: a force, or a motor's current; None without one."""
    effort = model.plant.effort
    if effort in model.inputs or effort in channels:
        return effort
    return "current" if not effort and "current" in channels else None


def _even(model: Model, stretch: Stretch, channels: tuple[str, ...], step: float, effort: str) -> _Even:
    """Return a stretch on an even grid, inputs held and as late as the model says; as it is if it is even already."""
    t = stretch.t[0] + step * np.arange(int((stretch.t[-1] - stretch.t[0]) / step + 1e-6) + 1)
    if np.abs(np.diff(stretch.t) - step).max() <= UNEVEN * step:
        t = stretch.t
    measured = {c: y for c, y in zip(channels, stretch.y.T, strict=True) if np.isfinite(y).any()}
    values = {c: np.interp(t, stretch.t, filled(stretch.t, y)) for c, y in {**measured, **stretch.known}.items()}
    held = np.searchsorted(stretch.t + model.delay - stretch.early, t + 1e-9 * step, side="right") - 1
    u = stretch.u[np.maximum(held, 0)]
    wide = binary_opening(~np.isfinite(stretch.y), np.ones((LOST + 1, 1))).any(axis=1)
    tau = u[:, model.inputs.index(effort)] if effort in model.inputs else values[effort]
    tau = _torque(model, tau) if effort == "current" else tau
    return _Even(t, u, values, tau, np.interp(t, stretch.t, (~wide).astype(float)))


def _torque(model: Model, current: Array) -> Array:
    """Return the torque (T,) of a motor's current (T,), with every effect that changes the torque constant."""
    for key, use in model.effects.items():
        if find_effect(use.type, "effects").torque_constant is Effect.torque_constant:
            model = model.without_effect(key)
    x, speed = np.zeros((current.size, len(model.states))), model.states.index(model.plant.velocity)
    x[:, model.states.index("current")] = current
    still = _tracker(
        model, np.arange(current.size, dtype=float), np.zeros((current.size, len(model.inputs))), model.states
    )
    return np.asarray(still.linearized(x)[0][:, speed] / per_force(model)[speed])


def _tracker(model: Model, t: Array, u: Array, channels: tuple[str, ...]) -> Tracker:
    """Return what evaluates a model's equations under inputs u (T, m); nothing is measured."""
    return Tracker(model, t, u, np.zeros((t.size, len(channels))), channels, np.ones(len(model.states)))


def _best_source(model: Model, level: dict[str, Noise], step: float, cutoff: float) -> tuple[str, int, float]:
    """Return the channel that gives the acceleration with the least noise, how often it is differentiated, and that
    noise.
    """
    orders = {model.plant.position: 2, model.plant.velocity: 1}
    known = [(name, order) for name, order in orders.items() if name in level]
    found = [(name, order, derivative_noise(level[name].effective, order, cutoff, step)) for name, order in known]
    return min(found, key=lambda item: item[2])


def _cutoff(model: Model, level: dict[str, Noise], step: float, effort: float) -> float:
    """Return a cut-off in Hz: a tenth of the sampling rate, lowered where the acceleration would be noise."""
    highest = float(f"{0.1 / step:.3g}")
    if model.plant.velocity not in model.states:
        return highest
    mass = inertia(model)
    for cutoff in highest * np.geomspace(1.0, 0.1, 21):
        if mass * _best_source(model, level, step, cutoff)[2] <= NOISY * effort:
            return float(f"{cutoff:.3g}")
    return float(f"{0.1 * highest:.2g}")


__all__ = ["Efforts", "Inverse"]
