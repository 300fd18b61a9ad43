"""The inverse model: the effort that the measured motion should have taken, beside the effort that was measured.

The convention of robotics [Gautier, Janot and Vandanjon, IEEE Trans. Control Systems Technology 21 (2013) 428]: the
position is differentiated by central differences after a zero-phase Butterworth low-pass of order 4, the measured and
the computed effort pass through the same low-pass and are decimated; what the filters see of the ends is left out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
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
UNEVEN = 0.01
"""Steps that differ by less than this share are even."""
LOST = 5
"""So many missing samples in a row are interpolated; around longer holes nothing is compared."""
EDGE = 2
"""So many decimated samples are left out at either end."""


@dataclass(frozen=True)
class Inverse:
    """Effort as measured and as computed (K,) each, over all stretches, after filtering and decimation.

    ``name`` and ``unit`` of the effort; ``cutoff`` in Hz; ``decimation``: every so many samples are kept; ``t`` (K,) s.
    """

    name: str
    unit: str
    cutoff: float
    decimation: int
    t: Array
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
    """A stretch on an even grid: t (T,), u (T, m) held, the measured channels by name (T,); ``known`` (T,): where no
    channel is missing for long.
    """

    t: Array
    u: Array
    values: dict[str, Array]
    known: Array


def inverse(
    model: Model,
    stretches: Sequence[Stretch],
    channels: tuple[str, ...],
    noise: Sequence[Noise],
    units: dict[str, str],
    cutoff: float | None = None,
) -> Inverse | None:
    """Compare the effort computed from the motion with the measured one; None where one of them is not known.

    ``cutoff`` in Hz; by default a tenth of the sampling rate, or less where the noise asks for it. Raises `InputError`
    if it is not below half the sampling rate.
    """
    efforts = Efforts.of(model, stretches, channels, noise, cutoff)
    if efforts is None:
        return None
    name, unit = _name_and_unit(model, efforts.name, units)
    filtered, computed = efforts.filtered, efforts.computed(model)
    return Inverse(name, unit, filtered.cutoff, filtered.every, efforts.t, efforts.measured, computed)


@dataclass(frozen=True)
class Efforts:
    """The effort of records, as measured and as any model computes it from their motion, filtered and decimated alike.

    ``t`` and ``measured`` (K,) over all stretches; ``name``: of the input, output or state that tells the effort.
    """

    name: str
    filtered: _Filter
    level: dict[str, Noise]
    raw: tuple[tuple[_Even, Array], ...]
    t: Array
    measured: Array

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

        ``cutoff`` in Hz, see `inverse`. Raises `InputError` if it is not below half the sampling rate.
        """
        effort = _effort_name(model, channels)
        if effort is None or not {model.plant.position, model.plant.velocity} & {*channels, *model.inputs}:
            return None
        step = float(np.median(np.concatenate([np.diff(s.t) for s in stretches])))
        even = [_even(model, s, channels, step) for s in stretches]
        measured = [_measured_effort(model, e, effort) for e in even]
        level = dict(zip(channels, noise, strict=True))
        if cutoff is None:
            cutoff = _cutoff(model, level, step, float(np.sqrt(np.mean(np.concatenate(measured) ** 2))))
        if not 0 < cutoff < 0.5 / step:
            half = f"half the sampling rate, {0.5 / step:g} Hz"
            raise InputError(f"cutoff: found {cutoff:g} Hz; allowed: above 0 and below {half}")
        filtered = _Filter(float(cutoff), step)
        least = (2 * EDGE + 2) * filtered.every + SHORTEST
        raw = tuple((e, tau) for e, tau in zip(even, measured, strict=True) if e.t.size >= least)
        kept = [filtered.kept(e) for e, _ in raw]
        if not sum(k.sum() for k in kept):
            return None
        t = np.concatenate([filtered.sampled(e.t)[k] for (e, _), k in zip(raw, kept, strict=True)])
        taus = np.concatenate([filtered.thinned(tau)[k] for (_, tau), k in zip(raw, kept, strict=True)])
        return cls(effort, filtered, level, raw, t, taus)

    def computed(self, model: Model) -> Array:
        """Return the effort (K,) that the motion takes according to a model of the same plant."""
        parts = []
        for e, tau in self.raw:
            values = _computed_effort(model, e, tau, self.name, self.filtered, self.level)
            parts.append(self.filtered.thinned(values)[self.filtered.kept(e)])
        return np.concatenate(parts)

    def moving(self, model: Model) -> NDArray[np.bool_]:
        """Return where (K,) nothing stands within reach of the filter; everywhere if there is no state of velocity."""
        if model.plant.velocity not in model.states:
            return np.ones(self.t.size, dtype=bool)
        reach, parts = np.ones(2 * self.filtered.every + 1, dtype=bool), []
        for e, _ in self.raw:
            standing = binary_dilation(_motion(model, e, self.filtered, self.level)[2], reach)
            parts.append(self.filtered.sampled(standing)[self.filtered.kept(e)])
        return np.asarray(~np.concatenate(parts))

    def along(self, model: Model, name: str) -> Array | None:
        """Return a state or an input (K,), filtered like the efforts; None where the model has none of this name."""
        if name not in (*model.states, *model.inputs):
            return None
        parts = []
        for e, _ in self.raw:
            values = e.u[:, model.inputs.index(name)] if name in model.inputs else _state(model, e, self, name)
            parts.append(self.filtered.thinned(values)[self.filtered.kept(e)])
        return np.concatenate(parts)


class _Filter:
    """A zero-phase Butterworth low-pass of order 4 at ``cutoff`` Hz, and a decimation by ``every``."""

    def __init__(self, cutoff: float, step: float) -> None:
        self.cutoff, self.step = cutoff, step
        self.every = max(1, int(1 / (step * cutoff) + 1e-9))
        self._sos = butter(4, cutoff, fs=1 / step, output="sos")

    def __call__(self, values: Array) -> Array:
        """Return values (T,) without what is faster than the cut-off, and without a phase shift."""
        return np.asarray(sosfiltfilt(self._sos, values))

    def thinned(self, values: Array) -> Array:
        """Return values (T,) filtered, decimated, and without their ends."""
        passed = self(values)
        return np.asarray((decimate(passed, self.every) if self.every > 1 else passed)[EDGE:-EDGE])

    def sampled(self, values: NDArray[Kind]) -> NDArray[Kind]:
        """Return values (T,) at the samples that are kept by `thinned`."""
        return values[:: self.every][EDGE:-EDGE]

    def kept(self, e: _Even) -> NDArray[np.bool_]:
        """Return which of the samples (K,) after decimation are not near long holes."""
        known = uniform_filter1d(e.known, 2 * EDGE * self.every + 1, mode="nearest") > 1 - 1e-9
        return np.asarray(self.sampled(known))


def _effort_name(model: Model, channels: tuple[str, ...]) -> str | None:
    """Return the input, output or state that tells the effort: a force, or a motor's current; None without one."""
    effort = model.plant.effort
    if effort in model.inputs or effort in channels:
        return effort
    return "current" if not effort and "current" in channels else None


def _name_and_unit(model: Model, effort: str, units: dict[str, str]) -> tuple[str, str]:
    if effort == "current":
        return "torque", model.plant.force_unit
    return effort, units.get(effort, model.units[effort])


def _even(model: Model, stretch: Stretch, channels: tuple[str, ...], step: float) -> _Even:
    """Return a stretch on an even grid, inputs held and as late as the model says; as it is if it is even already."""
    t = stretch.t[0] + step * np.arange(int((stretch.t[-1] - stretch.t[0]) / step + 1e-6) + 1)
    if np.abs(np.diff(stretch.t) - step).max() <= UNEVEN * step:
        t = stretch.t
    values = {c: np.interp(t, stretch.t, filled(stretch.t, stretch.y[:, i])) for i, c in enumerate(channels)
              if np.isfinite(stretch.y[:, i]).any()}  # fmt: skip
    values |= {name: np.interp(t, stretch.t, v) for name, v in stretch.known.items()}
    held = np.searchsorted(stretch.t + model.delay - stretch.early, t + 1e-9 * step, side="right") - 1
    known = np.interp(t, stretch.t, _known(stretch.y).astype(float))
    return _Even(t, stretch.u[np.maximum(held, 0)], values, known)


def _known(y: Array) -> NDArray[np.bool_]:
    """Return where (T,) no column of y (T, channels) has lost more than `LOST` samples in a row."""
    lost = ~np.isfinite(y)
    wide = binary_opening(lost, np.ones((LOST + 1, 1)))
    return np.asarray(~wide.any(axis=1))


def _measured_effort(model: Model, e: _Even, effort: str) -> Array:
    if effort in model.inputs:
        return np.asarray(e.u[:, model.inputs.index(effort)])
    if effort == "current":
        return _torque(model, e.values["current"])
    return e.values[effort]


def _torque(model: Model, current: Array) -> Array:
    """Return the torque (T,) of a motor's current (T,), with every effect that changes the torque constant."""
    for key, use in model.effects.items():
        if find_effect(use.type, "effects").torque_constant is Effect.torque_constant:
            model = model.without_effect(key)
    x = np.zeros((current.size, len(model.states)))
    column = model.states.index("current")
    speed = model.states.index(model.plant.velocity)
    t, u = np.arange(current.size, dtype=float), np.zeros((current.size, len(model.inputs)))
    still = Tracker(model, t, u, x, model.states, np.ones(x.shape[1]))
    x[:, column] = current
    return np.asarray(still.linearized(x)[0][:, speed] / per_force(model)[speed])


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


def _computed_effort(
    model: Model,
    e: _Even,
    tau: Array,
    effort: str,
    low_pass: _Filter,
    level: dict[str, Noise],
) -> Array:
    """Return the effort (T,) that the motion takes according to the model."""
    channels = tuple(e.values)
    if model.plant.velocity not in model.states:
        known = {k: v for k, v in e.values.items() if k in model.states}
        x = driven(model, e.t, e.u, known)
        y = np.column_stack([e.values[effort]])
        return Tracker(model, e.t, e.u, y, (effort,), np.ones(len(model.states))).outputs(x)[:, 0]
    x, acceleration, standing = _motion(model, e, low_pass, level)
    row = model.states.index(model.plant.velocity)
    tracker = Tracker(model, e.t, e.u, np.zeros((e.t.size, len(channels))), channels, np.ones(len(model.states)))
    rate = tracker.rate(x, row, acceleration, standing)
    return np.asarray(tau + (acceleration - rate) / per_force(model)[row])


def _state(model: Model, e: _Even, efforts: Efforts, name: str) -> Array:
    """Return a state (T,) as it was measured, or as the model says from what was."""
    if model.plant.velocity in model.states:
        states = _motion(model, e, efforts.filtered, efforts.level)[0]
    else:
        states = driven(model, e.t, e.u, {k: v for k, v in e.values.items() if k in model.states})
    return states[:, model.states.index(name)]


def _motion(
    model: Model, e: _Even, low_pass: _Filter, level: dict[str, Noise]
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Return the states (T, n), the acceleration (T,), and where (T,) it stands as far as is known."""
    position, velocity = model.plant.position, model.plant.velocity
    known = {k: v for k, v in e.values.items() if k in model.states}
    source, order, _ = _best_source(model, level, low_pass.step, low_pass.cutoff)
    motion = {k: low_pass(v) if k in (position, velocity) else v for k, v in known.items()}
    if order == 2 or velocity not in motion:
        motion[velocity] = np.gradient(motion[position], e.t)
    acceleration = np.gradient(motion[velocity], e.t)
    noise = derivative_noise(level[source].effective, order - 1, low_pass.cutoff, low_pass.step)
    return driven(model, e.t, e.u, motion), acceleration, np.abs(motion[velocity]) <= STILL * noise


__all__ = ["Efforts", "Inverse", "inverse"]
