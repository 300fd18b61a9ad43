"""A record without gaps and the force that a model lacks along it: motion and effort through the same low-pass, as wide
as the noise of the inertial force allows. At rest, where the sign of the velocity is noise, dry friction has that of
the net force. In holes of a channel nothing is compared.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid
from scipy.interpolate import CubicSpline
from scipy.ndimage import binary_dilation, grey_opening

from signlin_ros.comparison.equations import SwitchedTape, force_equations, inertia, mass, with_measured
from signlin_ros.effects import find_effect
from signlin_ros.effects.base import Effect
from signlin_ros.filters import low_pass, sensor_noise, slope
from signlin_ros.follow.data import corrected
from signlin_ros.follow.tracking import driven, filled
from signlin_ros.model import Model
from signlin_ros.noise import derivative_noise
from signlin_ros.plants import Plant
from signlin_ros.records import ModelData
from signlin_ros.relative_lag import relative_lag

Array = NDArray[np.float64]

BANDS, MIN_CUTOFF_PERIODS = 0.12 * np.geomspace(1.0, 1e-3, 31), 8.0
"""Cut-offs that are tried, as parts of the sampling rate, the widest first; periods that a record must hold of one."""
LAW_BAND_RATIO, HIGHEST = 2.0, 0.4
"""How much wider the low-pass is that laws are driven through, at most at this part of the sampling rate."""
EDGE_PERIODS = 1.2
"""Periods of the cut-off that are left out at either end."""
SAMPLES_PER_PERIOD, COMPARED_PER_PERIOD, MAX_COMPARED_SAMPLES = 10.0, 2.5, 4000
"""Samples for a period of the cut-off with which laws are driven, and that are compared; most of these of a record."""
SLOWEST_POSITION_HZ, SLOWEST_PERIODS = 2.0, 10.0
"""Frequency in Hz, and its periods in a record, below which a velocity's sensor tells it better than a position's."""
MOVING_OVER_NOISE, MOVING_OVER_LARGEST = 3.0, 0.004
"""Slower than so many times its noise, or than this share of its largest, a velocity counts as rest."""
MAX_REST_SHARE = 0.15
"""Where more than this share of what the filter sees is rest, nothing is compared: friction there is any force."""
SHORTEST_REST, FEW_AT_REST = 0.04, 4
"""Rest in s, and its samples, from which on the net force tells the sign of dry friction,"""
REST_SHARES = (0.01, 0.9)
"""if such a share of the record is rest."""
ERROR_BLOCK, FEWEST_BLOCKS, MAX_ERROR_BLOCKS = 0.3, 10, 60
"""Length in s of a block for standard errors, and how many a record has, if each holds two periods."""
AT_ONCE, MIN_CHANNEL_SAMPLES = 2_000_000, 20
"""Most values that pass the low-pass at once; samples that a channel must have."""
MAX_STAMP_DISTANCE = 0.5
"""Most samples by which effort and motion may be stamped apart: more is a delay, and has a name."""
MIN_DRIVING_PART = 0.01
"""Part of the effort that drives at least: a drive that holds itself has none."""


@dataclass(frozen=True, eq=False)
class ForceSegment:
    """A record without gaps, on an even grid of T samples; names as in the model.

    ``values``: measured states (T,), with position and velocity in any case; ``u`` (T, m) as it acts at the samples;
    ``acceleration``, ``effort``, ``sign`` (T,): direction of motion, between -1 and 1 where it is not known; ``cutoff``
    in Hz; ``kept``: samples that are compared; ``conditions``: known of the record; ``noise``: standard deviation that
    the sensors give the missing force; ``lags``: channels that were brought forward to the time of the other, by s.
    """

    plant: type[Plant]
    t: Array
    step: float
    values: dict[str, Array]
    u: Array
    acceleration: Array
    effort: Array
    sign: Array
    cutoff: float
    kept: NDArray[np.intp]
    blocks: NDArray[np.intp]
    noise: float
    position_measured: bool
    conditions: Mapping[str, float] = field(default_factory=dict)
    lags: Mapping[str, float] = field(default_factory=dict)
    _known: dict[object, Array] = field(default_factory=dict, repr=False)

    @property
    def q(self) -> Array:
        """The position (T,)."""
        return self.values[self.plant.position]

    @property
    def v(self) -> Array:
        """The velocity (T,)."""
        return self.values[self.plant.velocity]

    @property
    def moves(self) -> bool:
        """Whether the direction of motion is known in more than a few samples."""
        return bool(np.mean(np.abs(self.sign) >= 1.0) > MAX_REST_SHARE)

    @cached_property
    def effort_nearby(self) -> Array:
        """The effort (T,) through a low-pass as wide as that of the motion: less noise than its samples have."""
        return low_pass(self.effort, min(LAW_BAND_RATIO * self.cutoff, HIGHEST / self.step), self.step)

    @property
    def late(self) -> Array:
        """What the effort (T,) changes by if it is stamped a sample late."""
        return slope(self.effort_nearby, self.step) * self.step

    def with_later_inputs(self, seconds: float) -> ForceSegment:
        """Return the piece with its inputs and effort later by some seconds, from its first sample on."""
        at = self.t - seconds
        u = np.column_stack([np.interp(at, self.t, one) for one in self.u.T])
        return replace(self, u=u, effort=np.interp(at, self.t, self.effort), _known={})

    def once(self, key: object, make: Callable[[], Array]) -> Array:
        """Return the result of ``make`` for the piece, computed when a key is first asked for."""
        if key not in self._known:
            self._known[key] = make()
        return self._known[key]

    def seen(self, values: Array) -> Array:
        """Return values (T, ...) through the low-pass at the samples that are compared."""
        parts = self.at_once(values.shape[1]) if values.ndim > 1 else []
        if len(parts) < 2:
            return low_pass(values, self.cutoff, self.step)[self.kept]
        return np.hstack([self.seen(values[:, part]) for part in parts])

    def at_once(self, columns: int) -> list[slice]:
        """Return so many columns (T,) in blocks that the low-pass takes at once: of a long record a few."""
        width = max(1, AT_ONCE // self.t.size)
        return [slice(at, at + width) for at in range(0, columns, width)]

    def states(self, model: Model, p: Array | None = None) -> Array:
        """Return the states (T, n) of a model, measured or carried along; ``p``: its parameters, by default its own."""
        known = {name: values for name, values in self.values.items() if name in model.states}
        follows = any("." not in name and name not in known for name in model.states)  # the input, as a current does
        return driven(model, self.t, self.u, known, 0.5 * self.step if follows else 0.0, p=p)

    def evaluated(self, model: Model, tape: SwitchedTape, x: Array, p: Array) -> Array:
        """Return a tape's outputs (outputs, T) at states x (T, n), with the direction of motion as far as known."""
        columns, velocity = [*x.T, *self.u.T, *p], model.plant.velocity
        names = [surface.name for surface in model.trace.surfaces]
        signs: list[Array | float] = [self.sign if name == velocity else 0.0 for name in names]
        for surfaces in [] if tape.surfaces is None else [tape.surfaces] * 2:
            values = zip(names, surfaces.batch([*columns, *signs]), strict=True)
            signs = [self.sign if name == velocity else np.sign(g) for name, g in values]
        result = tape.outputs.batch([*columns, *signs])
        return np.broadcast_to(result, (len(result), self.t.size))


class _Raw:
    """Even samples before any filter: ``t`` (T,) from 0 on, ``step`` in s, inputs ``u`` (T, m) as they act, channels'
    ``values`` (T,) and the ``noise`` of each; seconds (T,) from one measurement to the next, where they are ``apart``.
    """

    def __init__(self, model: Model, data: ModelData) -> None:
        self.model, self.plant, self.step = model, model.plant, float(np.median(np.diff(data.t)))
        t = data.t[0] + self.step * np.arange(int((data.t[-1] - data.t[0]) / self.step + 1e-6) + 1)
        names = _well_measured(data)
        self.inertia = inertia(model)
        self.t, self.u = t - t[0], np.column_stack([np.interp(t, data.t, c) for c in data.u.T])
        self.values = {n: np.interp(t, data.t, filled(data.t, corrected(model, data, n))) for n in names}
        self.noise = {n: sensor_noise(data.measured[n][np.isfinite(data.measured[n])]) for n in names}
        self.lags = self._lined_up(self.plant.position, self.plant.velocity)
        self.apart = np.max([_apart(data, n, t) for n in names], axis=0)
        if self.plant.velocity in model.inputs:
            self.values[self.plant.velocity] = v = self.u[:, model.inputs.index(self.plant.velocity)]
            self.noise.setdefault(self.plant.velocity, sensor_noise(v))
        else:
            stamped = 0.0 if data.acts is None else np.interp(t, data.t, data.acts - data.t) / self.step
            early = 0.5 if model.interpolates else model.early  # at a sample either has the sample's value
            late = 0.5 - early + stamped + model.delay / self.step
            self.u = np.column_stack([_acting(c, late) for c in self.u.T])

    def _lined_up(self, position: str, velocity: str) -> dict[str, float]:
        """Bring position and velocity to one time, and return by how many s which was late: the other is nearer to the
        truth, since no sensor is early. Less than a sample is none that is late, but a difference of neighbours.
        """
        if position not in self.values or velocity not in self.values:
            return {}
        lag = relative_lag(self.values[position], self.values[velocity], self.step)
        late, shift = (velocity, lag) if lag > -self.step else (position, -lag)
        if shift:
            k = np.arange(self.t.size)
            self.values[late] = CubicSpline(k, self.values[late])(np.clip(k + shift / self.step, 0, k[-1]))
        return {late: shift} if shift > self.step else {}

    @cached_property
    def effort(self) -> tuple[Array, float]:
        """The effort (T,), and the noise of its sensor, 0 for a command."""
        model, name = self.model, self.plant.effort or "current"
        if name in model.inputs:
            return self.u[:, model.inputs.index(name)], 0.0
        if name in self.values and name in (*model.states, *model.outputs):
            gain = effort_gain(model, True)
            return gain * self.values[name], gain * self.noise[name]
        return effort_gain(model, False) * self.u[:, 0], 0.0

    def inertial_force(self, cutoff: float) -> float:
        """Return the standard deviation of the inertial force below a cut-off in Hz."""
        return self.inertia * float(np.std(slope(self.motion(cutoff)[1], self.step)))

    def noises(self, cutoff: float) -> tuple[float, float]:
        """Return the noise of the inertial force and of the effort below a cut-off in Hz."""
        sources = ((self.plant.velocity, 1), (self.plant.position, 2))
        found = [derivative_noise(self.noise[n], k, cutoff, self.step) for n, k in sources if n in self.values]
        return self.inertia * min(found, default=0.0), self.effort[1] * float(np.sqrt(2 * cutoff * self.step))

    def motion(self, wide: float) -> tuple[Array, Array, float, float]:
        """Return position and velocity (T,) below ``wide`` Hz, the velocity's noise, and the seconds lost at the ends.
        Of both, each serves where it is quieter: across the frequency where their noises are the same.
        """
        position, velocity = self.plant.position, self.plant.velocity
        sq, sv = (self.noise.get(n, np.inf) for n in (position, velocity))
        across, step, lost = sv / (2 * np.pi * max(sq, 1e-12)), self.step, 0.0
        q = self.values.get(position)
        if q is None:
            q = cumulative_trapezoid(self.values[velocity], dx=step, initial=0.0)
        v = self.values[velocity] if across < wide else slope(low_pass(q, wide, step), step)
        if max(SLOWEST_POSITION_HZ, SLOWEST_PERIODS / self.t[-1]) < across < wide:
            v, lost = slope(low_pass(q, across, step), step) + v - low_pass(v, across, step), EDGE_PERIODS / across
        noise = min(sv, 2 * np.pi * wide * sq) * np.sqrt(2 * wide * step)
        return low_pass(q, wide, step), low_pass(v, wide, step), float(noise), lost


def _apart(data: ModelData, name: str, t: Array) -> Array:
    """Return the seconds (T,) between the measurements of a channel around some times (T,), or to the only one."""
    there = data.t[np.isfinite(data.measured[name])]
    at = np.clip(np.searchsorted(there, t), 1, there.size - 1)
    return np.asarray(np.max([there[at] - there[at - 1], there[0] - t, t - there[-1]], axis=0))


def _acting(u: Array, late: float | Array) -> Array:
    """Return a held input (T,) as it acts at its samples: the mean of what is held before and after each."""
    if np.any(late != 0.5):
        k = np.arange(u.size)
        return np.asarray(np.interp(k - late, k, u))
    padded = np.concatenate([u[:1], u[:1], u, u[-1:]])
    return np.convolve(padded, np.array([-1.0, 13.0, 13.0, -1.0]) / 24, "valid")


def _well_measured(data: ModelData) -> list[str]:
    return [n for n, v in data.measured.items() if np.isfinite(v).sum() > MIN_CHANNEL_SAMPLES]


def recorded(model: Model, data: Sequence[ModelData]) -> set[str]:
    """Return the inputs, and what every one of some records measures."""
    return {*model.inputs, *set.intersection(*(set(_well_measured(d)) for d in data))}


def tells_force(model: Model, recorded: set[str]) -> bool:
    """Tell whether the motion that forces depend on is recorded, and what drives: in a plant's own loop nobody sees."""
    plant = model.plant
    if plant.closed_loop:
        return False
    placed = plant.position in recorded or not force_equations(model.structure).placed
    return placed and not recorded.isdisjoint((plant.position, plant.velocity))


def best_cutoff(model: Model, data: Sequence[ModelData], share: float) -> float:
    """Return the widest band in Hz in which noise stays below a ``share`` of the effort (of the inertial force where
    nothing drives), in the median of records.
    """
    return float(np.median([_cutoff(_Raw(with_measured(model, d.measured), d), share) for d in data]))


def _cutoff(raw: _Raw, share: float) -> float:
    lowest = MIN_CUTOFF_PERIODS / max(raw.t[-1], raw.step)
    tried = [f for f in BANDS / raw.step if f >= lowest] or [lowest]
    effort = float(np.std(raw.effort[0]))
    quiet = (f for f in tried if max(raw.noises(f)) < share * (effort or raw.inertial_force(f)))
    return float(next(quiet, tried[-1]))


def effort_gain(model: Model, current: bool) -> float:
    """Return the effort for a unit of what is measured of it: of a ``current``, or of what is put in."""
    K_t = model.parameters.get("K_t", 1.0)
    return K_t if current else K_t / model.parameters.get("R_a", 1.0)


def force_segment(model: Model, data: ModelData, cutoff: float) -> ForceSegment:
    """Return a record (without gaps) as the equation-error estimate sees it, with a low-pass at ``cutoff`` Hz."""
    model, plant = with_measured(model, data.measured), model.plant
    raw = _Raw(model, data)
    step, length = raw.step, raw.t[-1]
    wide = min(LAW_BAND_RATIO * cutoff, HIGHEST / step)
    q, v, noise, lost = raw.motion(wide)
    effort, u = raw.effort[0], raw.u
    sign, still = _direction(v, noise, effort - model.parameters.get("k", 0.0) * q, wide, step)
    every = max(1, int(1 / (SAMPLES_PER_PERIOD * cutoff * step)))
    kept = _kept(
        still, raw.apart > 1 / (COMPARED_PER_PERIOD * cutoff), cutoff, step, max(EDGE_PERIODS / cutoff, lost), every
    )
    block = max(min(ERROR_BLOCK, length / FEWEST_BLOCKS), 2.0 / cutoff, length / MAX_ERROR_BLOCKS)
    if every > 1:
        u, effort = low_pass(u, wide, step), low_pass(effort, wide, step)
    if plant.motion_is_imposed():
        u = u.copy()
        u[:, model.inputs.index(plant.velocity)] = v
    values = {n: low_pass(x, wide, step) for n, x in raw.values.items() if n == "current"}
    values |= {plant.position: q, plant.velocity: v}
    return ForceSegment(
        plant,
        raw.t[::every],
        step * every,
        {n: x[::every] for n, x in values.items()},
        u[::every],
        slope(v, step)[::every],
        effort[::every],
        sign[::every],
        cutoff,
        kept,
        np.unique((raw.t[kept * every] / block).astype(int), return_inverse=True)[1],
        float(np.hypot(*raw.noises(cutoff))),
        plant.position in raw.values,
        data.conditions,
        raw.lags,
    )


def _kept(
    still: NDArray[np.bool_], hole: NDArray[np.bool_], cutoff: float, step: float, ends: float, every: int
) -> NDArray[np.intp]:
    """Return the samples, of ``every`` so many, that are compared: not near ends, holes, nor where it rests."""
    e = min(int(ends / step) + 1, still.size // 5)
    moving = low_pass(still.astype(float), min(cutoff, HIGHEST / step), step) < MAX_REST_SHARE
    if hole.any():
        moving &= ~binary_dilation(hole, iterations=e)
    moving[:e] = moving[-e:] = False
    if moving.mean() < MAX_REST_SHARE:
        moving[e:-e] = True
    apart = every * max(
        1, int(1 / (COMPARED_PER_PERIOD * cutoff * step * every)), -(-still.size // (MAX_COMPARED_SAMPLES * every))
    )
    chosen = np.arange(0, still.size, apart)
    return np.asarray(chosen[moving[chosen]] // every)


def _direction(v: Array, noise: float, net: Array, wide: float, step: float) -> tuple[Array, NDArray[np.bool_]]:
    """Return the sign of the velocity (T,), softened where noise hides it, and where (T,) it is at rest."""
    still = np.abs(v) < max(MOVING_OVER_NOISE * noise, MOVING_OVER_LARGEST * float(np.abs(v).max()))
    sign = np.clip(v / (2 * max(noise, 1e-12)), -1.0, 1.0)
    least = int(np.ceil(max(FEW_AT_REST, SHORTEST_REST / step)))
    rest = grey_opening(still.astype(np.int8), least, mode="constant") > 0
    if REST_SHARES[0] < rest.mean() < REST_SHARES[1]:
        pushing = low_pass(net, min(3 * wide, HIGHEST / step), step)
        sign = np.where(rest, np.clip(pushing / (np.quantile(np.abs(pushing[rest]), 0.97) + 1e-300), -1, 1), sign)
    return sign, still


def missing_force(model: Model, force_segment: ForceSegment) -> Array:
    """Return the force (T,) on the moving mass that a model lacks along a piece, before the low-pass."""
    model = with_measured(model, force_segment.values).under(force_segment.conditions)
    rate, inert = force_equations(model.structure).rate, mass(model)
    return _missing(model, force_segment, rate, force_segment.states(model)) * inert


def _missing(model: Model, piece: ForceSegment, rate: SwitchedTape, x: Array) -> Array:
    """Return the acceleration (T,) that a model lacks at states x (T, n); of an imposed motion the force, reversed."""
    measured = piece.effort if model.plant.motion_is_imposed() else piece.acceleration
    return np.asarray(measured - piece.evaluated(model, rate, x, model.p)[0])


def asked_effort(model: Model, force_segment: ForceSegment) -> Array:
    """Return the missing force (K,) as the effort that it asks for: more where friction follows the load, or where the
    model lets less of the input act: no effort explains itself.
    """
    model = with_measured(model, force_segment.values).under(force_segment.conditions)
    equations, inert = force_equations(model.structure), mass(model)
    x, effects = force_segment.states(model), model.effects.items()
    left = force_segment.seen(_missing(model, force_segment, equations.rate, x) * inert)
    own = [k for k, use in effects if find_effect(use.type, "effects").input is not Effect.input]
    if own and "current" not in force_segment.values:
        whole = model.without_effect(*own)
        before, after = (float(np.mean(_driven_by(m, force_segment) ** 2)) for m in (whole, model))
        return left / max(float(np.sqrt(min(after / max(before, 1e-300), 1.0))), MIN_DRIVING_PART)
    if equations.effort_slopes is None:
        return left
    slopes = force_segment.evaluated(model, equations.effort_slopes, x, model.p)[0]
    return left / np.maximum(force_segment.seen(slopes * inert / effort_unit(model)), MIN_DRIVING_PART)


def _driven_by(model: Model, force_segment: ForceSegment) -> Array:
    """Return the force (K,) that the input makes of the plant's motion, after what the model does to the input."""
    resting = replace(force_segment, u=np.zeros_like(force_segment.u), _known={})
    return force_segment.seen(missing_force(model, resting) - missing_force(model, force_segment))


def stamped(left: Array, late: Array) -> Array:
    """Return the force (K,) that is left where effort and motion are stamped as fits best; ``late`` (K,):
    `ForceSegment`.
    """
    apart = np.clip(float(late @ left) / max(float(late @ late), 1e-300), -MAX_STAMP_DISTANCE, MAX_STAMP_DISTANCE)
    return np.asarray(left - late * apart)


def effort_unit(model: Model) -> float:
    """Return the force for a unit of what `by_effort` takes as the effort."""
    return effort_gain(model, (model.plant.effort or "current") in model.states)


__all__ = [
    "MAX_STAMP_DISTANCE",
    "MIN_DRIVING_PART",
    "ForceSegment",
    "asked_effort",
    "best_cutoff",
    "effort_gain",
    "effort_unit",
    "force_segment",
    "missing_force",
    "recorded",
    "stamped",
    "tells_force",
]
