"""A base model and its records, prepared for fitting: channels, noise, scales and the gains of the observer."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from signlin_ros.comparison.missing import inertia
from signlin_ros.errors import RecordError
from signlin_ros.fitting.gains import Gains, design, doubts, time_constants
from signlin_ros.follow.data import Early, cut, measured_channels, travelled
from signlin_ros.follow.segments import (
    Segment,
    known_start,
    quanta,
    segment,
    stand_still,
    with_measured_position,
    without,
)
from signlin_ros.follow.tracking import Tracker, filled
from signlin_ros.model import Model
from signlin_ros.noise import moving, noise_level, white_noise
from signlin_ros.plants.dc_motor import quasi_static_current
from signlin_ros.recording.trace import rotary_unit
from signlin_ros.records import ModelData
from signlin_ros.scale import Scale

Array = NDArray[np.float64]
FASTEST = 4.0
"""Largest N v dt of a wave, v being the RMS velocity: of faster ones hardly anything is left in a sample."""
LOST = 3.0
"""Standard deviations of the noise below which a velocity is not known."""
FEWEST, LONG, CHUNKS, LEAD = 2000, 6000, 4, 2000
"""Starts are searched on half of the samples, but on no fewer and no more than that, in so many stretches; and how many
samples before each tell what an effect remembers at its start."""


@dataclass(frozen=True)
class Problem:
    """Everything that is the same for every candidate.

    ``base``: the model as given (a motor whose position is measured has it as a state). ``noise`` (ny): standard
    deviation of white noise on each channel, from fourth differences. ``levels``: gains from high to low.
    ``x_scale``: size of every state by name. ``units``: of what is measured, as the records have them. ``quanta``
    (ny): the steps in which it is shown, 0 for none. ``parts``: the records without gaps, as they are given.
    """

    base: Model
    channels: tuple[str, ...]
    segments: tuple[Segment, ...]
    noise: Array
    scale: Scale
    levels: tuple[Gains, ...]
    x_scale: dict[str, float]
    ranges: dict[str, tuple[float, float]] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)
    quanta: Array = field(default_factory=lambda: np.zeros(0))
    notes: tuple[str, ...] = ()
    parts: tuple[ModelData, ...] = ()

    @functools.cached_property
    def short(self) -> Problem:
        """The problem on some stretches of its records, spread evenly, where it has many samples.

        What effects remember is forgotten at the start of each: good enough to see which way is down.
        """
        return replace(self, segments=tuple(replace(s, before=None) for s in self.led.segments))

    @functools.cached_property
    def led(self) -> Problem:
        """The same, where effects remember what was before each stretch: half as much again takes it."""
        return _shortened(self)

    @property
    def stretch(self) -> tuple[float, float]:
        """Smallest and largest position, about, where only a velocity is measured."""
        return self.ranges.get(self.base.plant.position, (0.0, self.scale.travel))

    @property
    def rotary(self) -> bool:
        """Whether a plant of forces and displacements stands for one of torques and angles."""
        return self.base.plant.position_unit == "m" and self.units.get(self.base.plant.position) == "rad"

    @property
    def fastest(self) -> float:
        """The largest order of a wave over the position that samples can tell."""
        return FASTEST / max(self.scale.velocity * self.scale.step, 1e-300)

    @property
    def turns(self) -> bool:
        """Whether the axis turns, so that what repeats over the position does so a whole number of times a turn."""
        return self.base.turns(self.units)

    def shown(self, unit: str) -> str:
        """Return a unit of the model as the records have it."""
        return rotary_unit(unit) if self.rotary else unit

    @property
    def samples(self) -> int:
        """Number of samples in all records."""
        return sum(s.t.size for s in self.segments)


def _shortened(problem: Problem) -> Problem:
    """Return the problem on some stretches of its records, spread evenly, where it has many samples."""
    most = min(max(FEWEST, problem.samples // 2), LONG)
    chunks = CHUNKS if most > 2 * FEWEST else CHUNKS // 2
    if problem.samples <= most:
        return problem
    parts = []
    size = most // chunks
    for s in problem.segments:
        share = max(1, round(chunks * s.t.size / problem.samples))
        for first in np.linspace(0, max(s.t.size - size, 0), share).astype(int).tolist():
            before = stretch_of(problem, s, slice(max(first - LEAD, 0), first + 1)) if first else None
            parts.append(replace(stretch_of(problem, s, slice(first, first + size)), inner=first > 0, before=before))
    return replace(problem, segments=tuple(parts))


def stretch_of(problem: Problem, s: Segment, part: slice) -> Segment:
    """Return a stretch of a record, from where that had led."""
    t, u, y = s.t[part], s.u[part], s.y[part]
    start = known_start(problem.base, problem.channels, t, y) | _led_to(problem, s, part.start)
    return Segment(t, u, y, start, s.source, False, cut(s.early, part))


def _led_to(problem: Problem, s: Segment, at: int) -> dict[str, float]:
    """Return the position, which is not measured itself, to which an imposed or measured velocity has led at a sample.

    What acts at some positions only is elsewhere in every stretch if each starts from the same.
    """
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


def first_look(model: Model, segments: Sequence[Segment], channels: tuple[str, ...], gains: Gains) -> list[Array]:
    """Return the states (T, n) of the base model held to every record by a high gain."""
    rows, wide = gains.rows(model.states), np.full(len(model.states), 1e9)
    result = []
    for s in segments:
        x0 = np.array([s.start.get(name, 0.0) for name in model.states])
        result.append(Tracker(model, s.t, s.u, s.y, channels, wide, s.early).run(x0, rows).state)
    return result


def prepare(model: Model, data: Sequence[ModelData], channels: tuple[str, ...] | None = None) -> Problem:
    """Prepare records (at least one) for fitting; raises `RecordError` where nothing is measured.

    ``channels``: what is compared, by default all that every record measures.
    """
    model = with_measured_position(model, data)
    channels = measured_channels(model, data) if channels is None else channels
    segments = tuple(_of_known_direction(model, segment(model, channels, d)) for d in data)
    dt = float(np.median(np.concatenate([np.diff(s.t) for s in segments])))
    duration = max(float(s.t[-1] - s.t[0]) for s in segments)
    everything, noise = np.concatenate([s.y for s in segments]), white_noise([s.y for s in segments])
    if not moving(everything).any():
        raise RecordError(f"{segments[0].source}: {stand_still(channels)}")
    sizes = {c: float(max(v, 1e-12)) for c, v in zip(channels, np.nanmax(np.abs(everything), axis=0), strict=True)}
    sizes = _guess_velocity(model, segments, channels, sizes)
    taus = time_constants(dt, duration, model.update_period)
    known = doubts(segments)
    look = first_look(model, segments, channels, design(model, channels, noise, sizes, dt, taus[0], known))
    X = np.concatenate(look)
    peaks = np.nanmax(np.abs(X), axis=0)
    x_scale = {name: float(max(peak, 1e-9)) for name, peak in zip(model.states, peaks, strict=True)}
    levels = tuple(design(model, channels, noise, x_scale, dt, tau, known) for tau in taus)
    scale = _scale(model, segments, channels, look, dt, duration)
    units = {**model.units, **data[0].units}
    return Problem(
        model, channels, segments, noise, scale, levels, x_scale, _ranges(model, segments, X), units, quanta(segments)
    )


def _guess_velocity(
    model: Model, segments: Sequence[Segment], channels: tuple[str, ...], sizes: dict[str, float]
) -> dict[str, float]:
    """Add the size of a velocity that is not measured: from the position, or from the input at the plant's gain."""
    name, position = model.plant.velocity, model.plant.position
    if name in sizes or name not in model.states:
        return sizes
    if position in channels:
        c = channels.index(position)
        slopes = [np.nanstd(np.gradient(s.y[:, c], s.t)) for s in segments]
        return {**sizes, name: float(max(slopes))}
    return {**sizes, name: 1.0}


def _scale(
    model: Model, segments: Sequence[Segment], channels: tuple[str, ...], look: list[Array], dt: float, duration: float
) -> Scale:
    def rms(values: Array) -> float:
        size = float(np.sqrt(np.nanmean(np.square(values))))
        return size if size > 0 and np.isfinite(size) else 1.0

    X, u = np.concatenate(look), np.concatenate([s.u for s in segments])
    column = {name: X[:, i] for i, name in enumerate(model.states)}
    velocity = column.get(model.plant.velocity, u[:, 0])
    parts = np.split(velocity, np.cumsum([s.t.size for s in segments])[:-1])
    acceleration = np.concatenate([np.gradient(v, s.t) for v, s in zip(parts, segments, strict=True)])
    position = column.get(model.plant.position)
    if position is None:
        position = np.cumsum(velocity) * dt
    motor = model.parameters if "K_t" in model.parameters else {}
    if motor and "current" not in column:  # without inductance it follows from the voltage
        column["current"] = quasi_static_current(u[:, 0], velocity, motor["K_m"], motor["R_a"])
    current = rms(column["current"]) if motor else 1.0
    force = u[:, 0]
    if motor:
        force = motor["K_t"] * column["current"]
    elif "force" in channels:
        force = np.concatenate([s.y[:, channels.index("force")] for s in segments])
    travel, mass = float(np.nanmax(np.abs(position))), inertia(model)
    return Scale(
        rms(force) if force.any() else rms(mass * acceleration),  # what moves freely is driven by what it has stored
        travel if travel > 0 else 1.0,
        rms(velocity),
        rms(acceleration),
        current,
        float(np.max(np.abs(u[:, 0]))) or 1.0,
        dt,
        duration,
        mass,
    )


def _blur(model: Model, s: Segment) -> float:
    """Return which imposed velocity is lost in its noise, 0 of other motions."""
    plant = model.plant
    if not plant.motion_is_imposed():
        return 0.0
    return LOST * noise_level(s.t, s.u[:, model.inputs.index(plant.velocity)]).sigma


def _of_known_direction(model: Model, s: Segment) -> Segment:
    """Return a record without what was measured where an imposed motion reverses: in its noise its direction is not
    known, and what is dry would be wrong by twice its force. Where that is no rare moment, everything is kept.
    """
    blur = _blur(model, s)
    if not blur:
        return s
    return replace(s, y=without(s.y, np.abs(s.u[:, model.inputs.index(model.plant.velocity)]) < blur))


def _ranges(model: Model, segments: Sequence[Segment], X: Array) -> dict[str, tuple[float, float]]:
    """Return the smallest and largest value of every state and input that the records visit."""
    u = np.concatenate([s.u for s in segments])
    columns = {**{n: X[:, i] for i, n in enumerate(model.states)}, **{n: u[:, j] for j, n in enumerate(model.inputs)}}
    return {name: (float(np.nanmin(v)), float(np.nanmax(v))) for name, v in columns.items()}


__all__ = ["LEAD", "Problem", "first_look", "prepare", "stretch_of"]
