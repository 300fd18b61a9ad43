"""A base model and its records, prepared for fitting: channels, noise, scales and the gains of the observer."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from signlin_ros.comparison.equations import inertia
from signlin_ros.errors import RecordError
from signlin_ros.fitting.gains import ObserverGains, design, input_variances, time_constants, uncorrected
from signlin_ros.follow.data import Early, cut, measured_channels, travelled
from signlin_ros.follow.segments import (
    PreparedSegment,
    known_start,
    prepared_segment,
    quanta,
    stand_still,
    with_measured_position,
    without,
)
from signlin_ros.follow.tracking import TrackedRun, Tracker, filled
from signlin_ros.mathops import NumpyMath
from signlin_ros.model import Model
from signlin_ros.noise import moving, noise_level, quantum_of, white_floor, white_noise
from signlin_ros.plants import Plant
from signlin_ros.plants.dc_motor import quasi_static_current
from signlin_ros.recording.trace import rotary_unit
from signlin_ros.records import ModelData
from signlin_ros.scale import Scale

Array = NDArray[np.float64]
MAX_WAVE_STEP, LOST_OVER_NOISE = 4.0, 3.0
"""Largest N v dt of a wave that samples show, v being the RMS velocity; noises below which a velocity is lost."""
MIN_REVERSAL, PEAK_TO_PEAK = 0.01, 8.0
"""Part of its way by which a motion turns back at least; noise does at most by so many standard deviations."""
MIN_ROUNDED_STEPS = 10.0
"""Steps in the standard deviation of an input from which on it is a rounded one, and none that was set in levels."""
MIN_SEARCH_SAMPLES, MAX_SEARCH_SAMPLES, CHUNKS, LEADING_SAMPLES = 2000, 6000, 4, 2000
"""Starts are searched on half of the samples within these, in so many stretches; samples that lead to each."""


@dataclass(frozen=True)
class Problem:
    """Everything that is the same for every candidate: the model as given (``base``), with a measured position as a
    state; ``noise`` (ny), white; ``observer_gains``: from high to low; ``x_scale``: size of every state; ``units`` of
    the records; ``quanta`` (ny): steps in which a channel is shown, or 0; ``parts``: records without gaps, as given;
    ``folds``: of validation data that are known ones too, which segments are held out together, in turn;
    ``force_observers``: gains of what watches motion for a force that is missing, where ``observer_gains`` are of free
    runs; ``input_noise`` (m,): standard deviations by which inputs are not known; where they are not, the
    last observer is the slowest that allows for it.
    """

    base: Model
    channels: tuple[str, ...]
    segments: tuple[PreparedSegment, ...]
    noise: Array
    scale: Scale
    observer_gains: tuple[ObserverGains, ...]
    x_scale: dict[str, float]
    ranges: dict[str, tuple[float, float]] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)
    quanta: Array = field(default_factory=lambda: np.zeros(0))
    notes: tuple[str, ...] = ()
    parts: tuple[ModelData, ...] = ()
    folds: tuple[tuple[int, ...], ...] = ()
    force_observers: tuple[ObserverGains, ...] = ()
    input_noise: Array = field(default_factory=lambda: np.zeros(0))

    @property
    def plant(self) -> type[Plant]:
        """The plant of the base model."""
        return self.base.plant

    @property
    def allows_for_input_noise(self) -> bool:
        """Whether the last observer allows for noise of the inputs."""
        return bool(self.input_noise.any())

    def with_inputs_as_recorded(self) -> Problem:
        """Return the problem with inputs that are known: what looks like noise of theirs acts on the plant."""
        if not self.allows_for_input_noise:
            return self
        *gains, _ = self.observer_gains
        *watching, _ = self.force_observers
        return replace(
            self,
            observer_gains=tuple(gains),
            force_observers=tuple(watching),
            input_noise=np.zeros_like(self.input_noise),
        )

    @functools.cached_property
    def short(self) -> Problem:
        """The problem on some stretches of its records, evenly; what effects remember is forgotten where they start."""
        return replace(self, segments=tuple(replace(s, before=None) for s in self.led.segments))

    @functools.cached_property
    def led(self) -> Problem:
        """The same, where effects remember what was before each stretch: half as much again takes it."""
        most = min(max(MIN_SEARCH_SAMPLES, self.samples // 2), MAX_SEARCH_SAMPLES)
        if self.samples <= most:
            return self
        if self.plant.closed_loop:  # whole records: a run in a loop forgets where it began, but not at once
            count = max(1, round(most * len(self.segments) / self.samples))
            at = np.linspace(0, len(self.segments) - 1, count).round().astype(int).tolist()
            return replace(self, segments=tuple(self.segments[i] for i in dict.fromkeys(at)))
        chunks = CHUNKS if most > 2 * MIN_SEARCH_SAMPLES else CHUNKS // 2
        parts, size = [], most // chunks
        for s in self.segments:
            share = max(1, round(chunks * s.t.size / self.samples))
            firsts = np.linspace(0, max(s.t.size - size, 0), share).astype(int).tolist()
            parts += [stretch_of(self, s, first, size) for first in firsts]
        return replace(self, segments=tuple(parts))

    def acting(self, hold: str | float) -> Problem:
        """Return the problem with inputs that act as a model's ``input_hold`` may say."""
        base = self.base.with_options(input_hold=hold)
        more = (base.early - self.base.early) * self.scale.step
        return replace(self, base=base, segments=tuple(replace(s, early=s.early + more) for s in self.segments))

    @property
    def horizon(self) -> float:
        """Seconds over which motion is predicted: the update period, two samples at least, a quarter of the longest
        record at most; of a plant in a closed loop a whole record.
        """
        longest = max(float(s.t[-1] - s.t[0]) for s in self.segments)
        period = max(self.base.update_period, 2 * self.scale.step)
        return longest if self.plant.closed_loop else float(min(period, longest / 4))

    @property
    def position_range(self) -> tuple[float, float]:
        """Smallest and largest position, about, where only a velocity is measured."""
        return self.ranges.get(self.plant.position, (0.0, self.scale.travel))

    @functools.cached_property
    def reverses(self) -> bool:
        """Whether the motion of a record turns back, by more than noise and `MIN_REVERSAL` of its way: else nothing
        tells what remembers the way. Also where nothing is known of the way.
        """
        plant, found = self.plant, False
        for s in self.segments:
            if plant.motion_is_imposed() or not {plant.position, plant.velocity} & {*self.channels}:
                return True
            at = self.channels.index(plant.position if plant.position in self.channels else plant.velocity)
            measured = np.isfinite(s.y[:, at])
            x, t, noise = s.y[measured, at], s.t[measured], float(self.noise[at])
            if plant.position not in self.channels:
                x, noise = travelled(t, x), 0.0
            back = np.maximum.accumulate(x) - x if x[-1] > x[0] else x - np.minimum.accumulate(x)
            found |= bool(back.max() > MIN_REVERSAL * np.ptp(x) + PEAK_TO_PEAK * noise)
        return found

    @property
    def rotary(self) -> bool:
        """Whether a plant of forces and displacements stands for one of torques and angles."""
        return self.plant.position_unit == "m" and self.units.get(self.plant.position) == "rad"

    @property
    def max_wave_order(self) -> float:
        """The largest order of a wave over the position that samples can tell."""
        return MAX_WAVE_STEP / max(self.scale.velocity * self.scale.step, 1e-300)

    @property
    def turns(self) -> bool:
        """Whether the axis turns, so that what repeats over the position does so a whole number of times a turn."""
        return self.base.turns(self.parts[0].units if self.parts else self.units)

    def shown(self, unit: str) -> str:
        """Return a unit of the model as the records have it."""
        return rotary_unit(unit) if self.rotary else unit

    def unit_of(self, name: str) -> str:
        """Return the unit of a signal as the records have it; empty where it has none."""
        return self.shown(self.units.get(name, ""))

    @property
    def counts(self) -> Array:
        """Number of samples of every channel (ny,) that are not missing."""
        return np.asarray(sum(np.isfinite(s.y).sum(axis=0) for s in self.segments), dtype=float)

    @property
    def samples(self) -> int:
        """Number of samples in all records."""
        return sum(s.t.size for s in self.segments)


def stretch_of(problem: Problem, s: PreparedSegment, first: int, size: int) -> PreparedSegment:
    """Return a stretch of a record with what came before it, where effects take up what they remember."""
    before = _part(problem, s, max(first - LEADING_SAMPLES, 0), first + 1) if first else None
    return replace(_part(problem, s, first, first + size), inner=first > 0, before=before)


def _part(problem: Problem, s: PreparedSegment, first: int, last: int) -> PreparedSegment:
    """Return a part of a record, from where that had led."""
    part = slice(first, last)
    t, u, y = s.t[part], s.u[part], s.y[part]
    start = known_start(problem.base, problem.channels, t, y) | _led_to(problem, s, first)
    return PreparedSegment(t, u, y, start, s.source, False, cut(s.early, part), conditions=s.conditions)


def _led_to(problem: Problem, s: PreparedSegment, at: int) -> dict[str, float]:
    """Return the position, not measured itself, to which an imposed or measured velocity has led at a sample."""
    plant, t = problem.base.plant, s.t[: at + 1]
    early: Early = 0.0
    if plant.motion_is_imposed():
        velocity, early = s.u[: at + 1, problem.base.inputs.index(plant.velocity)], s.early
    elif plant.velocity in problem.channels and plant.position not in problem.channels:
        measured = s.y[: at + 1, problem.channels.index(plant.velocity)]
        if not np.isfinite(measured).any():
            return {}
        velocity = filled(t, measured)
    else:
        return {}
    return {plant.position: s.start.get(plant.position, 0.0) + float(travelled(t, velocity, early)[-1])}


def looks(
    model: Model, segments: Sequence[PreparedSegment], channels: tuple[str, ...], gains: ObserverGains
) -> list[tuple[Tracker, TrackedRun]]:
    """Return a tracker of every record, and the run of the base model under an observer."""
    rows, wide, result = gains.rows(model.states), np.full(len(model.states), 1e9), []
    for s in segments:
        tracker = Tracker(model.under(s.conditions), s.t, s.u, s.y, channels, wide, s.early)
        result.append((tracker, tracker.run(np.array([s.start.get(name, 0.0) for name in model.states]), rows)))
    return result


def prepare(model: Model, data: Sequence[ModelData], channels: tuple[str, ...] | None = None) -> Problem:
    """Prepare records for fitting, by default in all channels that they measure; raises `RecordError` without one."""
    model = with_known(with_measured_position(model, data), data)
    channels = measured_channels(model, data) if channels is None else channels
    segments = tuple(_of_known_direction(model, prepared_segment(model, channels, d)) for d in data)
    dt = float(np.median(np.concatenate([np.diff(s.t) for s in segments])))
    duration = max(float(s.t[-1] - s.t[0]) for s in segments)
    everything, noise = np.concatenate([s.y for s in segments]), white_noise([s.y for s in segments])
    if not moving(everything).any():
        raise RecordError(f"{segments[0].source}: {stand_still(channels)}")
    sizes = dict(zip(channels, np.maximum(np.nanmax(np.abs(everything), axis=0), 1e-12).tolist(), strict=True))
    sizes = _speed_of(model, segments, channels) | sizes
    taus = time_constants(dt, duration, model.update_period)
    # an observer that were uncertain of more of an imposed and recorded state would hide a load in its zero
    doubt = {} if model.plant.closed_loop else segments[0].doubt
    known = {name: max(s.doubt.get(name, np.inf) for s in segments) for name in doubt}
    white = dict(zip(channels, noise.tolist(), strict=True))
    pairs = looks(model, segments, channels, design(model, white, sizes, dt, taus[0], known))
    X, u = np.concatenate([run.state for _, run in pairs]), np.concatenate([s.u for s in segments])
    peaks = np.nanmax(np.abs(X), axis=0)
    x_scale = {name: float(max(peak, 1e-9)) for name, peak in zip(model.states, peaks, strict=True)}
    unknown = _unknown_of(u) * (not (model.plant.closed_loop or model.plant.motion_is_imposed()))
    levels = tuple(design(model, white, x_scale, dt, tau, known) for tau in taus)
    added = input_variances(model, channels, unknown, dt) if unknown.any() else np.zeros(1)
    if np.any(added > levels[-1].spread[0]):
        levels = (*levels, design(model, white, x_scale, dt, taus[-1], known, added))
    else:  # the slowest observer allows for it already
        unknown = np.zeros_like(unknown)
    observers, levels = levels, (uncorrected(model.states, len(channels)),) * 2 if model.plant.closed_loop else levels
    columns = dict(zip((*model.states, *model.inputs), (*X.T, *u.T), strict=True))
    ranges = {name: (float(np.nanmin(v)), float(np.nanmax(v))) for name, v in columns.items()}
    columns |= {c: y for c, y in zip(channels, everything.T, strict=True) if c == model.plant.effort}
    scale, units = _scale(model, segments, columns, dt, duration), {**model.units, **data[0].units}
    return Problem(
        model,
        channels,
        segments,
        noise,
        scale,
        levels,
        x_scale,
        ranges,
        units,
        quanta(segments),
        force_observers=observers,
        input_noise=unknown,
    )


def _unknown_of(u: Array) -> Array:
    """Return the standard deviations (m,) by which inputs u (T, m) are not known: the noise of what was measured, or
    the rounding to a step, unless that is so large that somebody set the levels; 0 of a command.
    """
    columns = [values[np.isfinite(values)] for values in u.T]
    steps = np.array([quantum_of(values) for values in columns])
    rounded = np.where(np.nanstd(u, axis=0) >= MIN_ROUNDED_STEPS * steps, steps, 0.0)
    return np.asarray(np.maximum([white_floor(values) for values in columns], rounded / np.sqrt(12.0)))


def _speed_of(model: Model, segments: Sequence[PreparedSegment], channels: tuple[str, ...]) -> dict[str, float]:
    """Return the size of a velocity as the measured positions tell it; nothing where none is measured."""
    position, velocity = model.plant.position, model.plant.velocity
    if position not in channels or velocity not in model.states:
        return {}
    c = channels.index(position)
    return {velocity: float(max(np.nanstd(np.gradient(s.y[:, c], s.t)) for s in segments))}


def _scale(
    model: Model, segments: Sequence[PreparedSegment], columns: dict[str, Array], dt: float, duration: float
) -> Scale:
    """Return how large things are; ``columns`` (T,): states, inputs and a measured effort, record after record."""

    def rms(values: Array) -> float:
        size = float(np.sqrt(np.nanmean(np.square(values))))
        return size if size > 0 and np.isfinite(size) else 1.0

    u, velocity = columns[model.inputs[0]], columns[model.plant.velocity]
    parts = np.split(velocity, np.cumsum([s.t.size for s in segments])[:-1])
    acceleration = np.concatenate([np.gradient(v, s.t) for v, s in zip(parts, segments, strict=True)])
    position = columns.get(model.plant.position, np.cumsum(velocity) * dt)
    force, current, motor = columns.get("force", u), 1.0, model.parameters
    if model.plant.closed_loop:
        force = model.plant.driven(NumpyMath(), motor, position, acceleration)
        current = rms(force) / motor["K_t"]
        u = u - position
    elif "K_t" in motor:
        i = columns.get("current")
        if i is None:  # without inductance it follows from the voltage
            i = quasi_static_current(u, velocity, motor["K_m"], motor["R_a"])
        force, current = motor["K_t"] * i, rms(i)
    travel, largest, mass = float(np.nanmax(np.abs(position))), float(np.max(np.abs(u))), inertia(model)
    drive = rms(force) if force.any() else rms(mass * acceleration)  # what moves freely is driven by what it has stored
    sizes = (drive, travel or 1.0, rms(velocity), rms(acceleration), current, largest or 1.0)
    return Scale(*sizes, dt, duration, mass)


def with_known(model: Model, data: Sequence[ModelData]) -> Model:
    """Return the model with what is known of records frozen; what all of them agree on has its value there. What is to
    have a value for each record is frozen where every record states one.
    """
    names = dict.fromkeys(name for record in data for name in record.conditions)
    values = {n: {record.conditions.get(n, np.nan) for record in data} for n in names}
    model = model.with_parameters({n: next(iter(found)) for n, found in values.items() if len(found) == 1})
    asked = {n for n in model.per_record if any(n not in record.conditions for record in data)}
    frozen = (*model.frozen, *(n for n in names if n in model.parameters and n not in asked))
    return model.with_options(frozen=tuple(dict.fromkeys(frozen)))


def _of_known_direction(model: Model, s: PreparedSegment) -> PreparedSegment:
    """Return a record without samples where an imposed motion's direction is lost in noise, if they are rare."""
    if not model.plant.motion_is_imposed():
        return s
    v = s.u[:, model.inputs.index(model.plant.velocity)]
    return replace(s, y=without(s.y, np.abs(v) < LOST_OVER_NOISE * noise_level(s.t, v).sigma))


__all__ = ["Problem", "looks", "prepare", "stretch_of"]
