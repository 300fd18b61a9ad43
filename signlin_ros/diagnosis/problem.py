"""A base model and its records, prepared for fitting: channels, noise, scales and the gains of the observer."""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from signlin_ros.diagnosis.data import Early, corrected, cut, driving, measured_channels, measured_parts, travelled
from signlin_ros.diagnosis.equations import equations, neutral_sensors
from signlin_ros.diagnosis.follow import kalman_gains
from signlin_ros.diagnosis.missing import per_force
from signlin_ros.diagnosis.outliers import without_outliers
from signlin_ros.diagnosis.tracking import Tracker
from signlin_ros.errors import RecordError, joined
from signlin_ros.model import Model
from signlin_ros.noise import STILL, fourth_difference_noise, moving, noise_level, white_noise
from signlin_ros.plants.dc_motor import quasi_static_current
from signlin_ros.records import ModelData
from signlin_ros.scale import Scale
from signlin_ros.trace import rotary_unit

Array = NDArray[np.float64]

SETTLED = 25.0
"""Variance of the initial state in variances of the measurement noise."""
LEAST_SAMPLES = 100
LOST, RARE = 3.0, 0.05
"""Standard deviations of the noise below which a velocity is not known, and up to which share of the samples those
where an imposed one is not are left out."""
EVEN = 0.5
"""A channel is shown in steps if more than this share of the distances between its values are the same."""
FEWEST, LONG, CHUNKS, LEAD = 2000, 6000, 4, 2000
"""Starts are searched on half of the samples, but on no fewer and no more than that, in so many stretches; and how many
samples before each tell what an effect remembers at its start."""
DOUBT = 3.0
"""Times the distance between an imposed state, put together from rates, and its measurements by which it may be off."""
SLOPES, CONFIDENT = (8, 12, 16, 24, 32, 48, 64, 96, 128, 192, 256), 2.0
"""Samples that the first velocity is taken from, and half the width of its confidence interval in standard errors."""


@dataclass(frozen=True)
class Segment:
    """One record: t (T,) s, u (T, m), y (T, ny) with NaN for missing, and where it starts, by state.

    ``whole``: whether what an effect remembers at the start is fitted; not so for stretches and windows of a record.
    ``inner``: whether it begins within a record. ``before``: what came before it, where that is followed too: there an
    effect took up what it remembers.
    ``early``: by how many s the input precedes its sample, see `signlin_ros.diagnosis.data.driving`. ``doubt``: by how
    much a state that is imposed and recorded may be off at the start, by its name.
    """

    t: Array
    u: Array
    y: Array
    start: dict[str, float]
    source: str
    whole: bool = True
    early: Early = 0.0
    inner: bool = False
    before: Segment | None = None
    doubt: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Gains:
    """Kalman gains (G, n, ny) for the states ``names``; ``tau`` is the observer's time constant in s.

    ``weights`` (G, ny): what the first innovations count, made uncertain as they are by the unknown initial state.
    ``spread`` (2, n): variances that a step adds to the states, and those that they start with; (2, 0): not known.
    """

    tau: float
    names: tuple[str, ...]
    values: Array
    weights: Array
    spread: Array = field(default_factory=lambda: np.zeros((2, 0)))

    def rows(self, states: tuple[str, ...]) -> Array:
        """Return the gains for a model with these states: an effect's own position or velocity moves with the
        plant's; its other states are not corrected.
        """
        result = np.zeros((self.values.shape[0], len(states), self.values.shape[2]))
        for i, name in enumerate(states):
            source = name if name in self.names else _twin(name, self.names)
            if source:
                result[:, i] = self.values[:, self.names.index(source)]
        return result


def _twin(name: str, known: Sequence[str]) -> str:
    """Return the plant's state that an effect's own state starts from and moves with, or an empty text."""
    inner = name.rpartition(".")[2]
    aliases = {"position": ("displacement", "position"), "velocity": ("velocity", "speed")}
    return next((k for k in aliases.get(inner, ()) if "." in name and k in known), "")


@dataclass(frozen=True)
class Problem:
    """Everything that is the same for every candidate.

    ``base``: the model as given (a motor whose position is measured has it as a state). ``noise`` (ny): standard
    deviation of white noise on each channel, from fourth differences. ``levels``: gains from high to low.
    ``x_scale``: size of every state by name. ``units``: of what is measured, as the records have them. ``quanta``
    (ny): the steps in which it is shown, 0 for none.
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

    def observer(self, tau: float, noise: Array | None = None) -> Gains:
        """Return the gains of an observer with time constant tau (s), in a noise (ny) other than its own if given."""
        noise = self.noise if noise is None else noise
        known = _doubts(self.segments)
        return design(self.base, self.channels, noise, self.x_scale, self.scale.step, tau, known)

    @property
    def stretch(self) -> tuple[float, float]:
        """Smallest and largest position, about, where only a velocity is measured."""
        return self.ranges.get(self.base.plant.position, (0.0, self.scale.travel))

    @property
    def blur(self) -> float:
        """How small a motion is lost: in the steps or the noise of a measured position, in those of an imposed one."""
        if self.base.plant.position not in self.channels:
            return self.scale.blur
        at = self.channels.index(self.base.plant.position)
        return max(self.scale.blur, float(self.quanta[at]), float(self.noise[at]))

    @property
    def rotary(self) -> bool:
        """Whether a plant of forces and displacements stands for one of torques and angles."""
        return self.base.plant.position_unit == "m" and self.units.get(self.base.plant.position) == "rad"

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


def _still(channels: Sequence[str]) -> str:
    stay = "stays" if len(channels) == 1 else "stay"
    return f"nothing moves: nothing can be told from a record in which {joined(channels)} {stay} the same"


def moves(data: ModelData, channels: Sequence[str]) -> bool:
    """Tell whether any of the channels of a record ever moves."""
    measured = [data.measured[c][np.isfinite(data.measured[c])] for c in channels]
    return any(values.size and moving(values[:, None])[0] for values in measured)


def check_moving(data: Sequence[ModelData], channels: Sequence[str]) -> None:
    """Raise `RecordError` for a record in which nothing that is measured moves."""
    for record in data:
        if not moves(record, channels):
            raise RecordError(f"{record.source}: {_still(channels)}")


def constant_inputs(model: Model, data: Sequence[ModelData]) -> tuple[str, ...]:
    """Return notes on inputs that are the same all through a record: what they do is not told from a load."""
    notes, optional = [], model.plant.optional_inputs
    for record in data:
        for name, values in zip(model.inputs, record.u.T, strict=True):
            if name in optional or not values.size or np.ptp(values) > STILL * np.max(np.abs(values)):
                continue
            if values[0] == 0.0:
                why = "right where nothing drives, as in a free decay; else it was not recorded"
            else:
                why = "what it does cannot be told from a constant load"
            unit = f" {record.units.get(name, '')}".rstrip() if values[0] else ""
            notes.append(f"{record.source}: the {name} is {values[0]:.4g}{unit} from beginning to end: {why}")
    return tuple(notes)


def quanta(segments: Sequence[Segment]) -> Array:
    """Return the step (ny) in which every channel is shown, 0 where there is none."""
    found = []
    for values in np.concatenate([s.y for s in segments]).T:
        steps = np.diff(np.unique(values[np.isfinite(values)]))
        step = float(np.median(steps)) if steps.size > 2 else 0.0
        even = np.mean(np.abs(steps - step) < 0.01 * step) > EVEN
        found.append(step if even else 0.0)
    return np.array(found)


def with_measured_position(model: Model, data: Sequence[ModelData]) -> Model:
    """Return the model with its position as a state if the records have it."""
    if model.plant.position_optional and all(model.plant.position in d.measured for d in data):
        return model.with_options(with_position=True)
    return model


def segment(model: Model, channels: tuple[str, ...], data: ModelData) -> Segment:
    """Return one record as arrays, with the state that it starts from."""
    if data.t.size < LEAST_SAMPLES:
        raise RecordError(f"{data.source}: {data.t.size} samples; at least {LEAST_SAMPLES} are needed")
    y = np.ascontiguousarray(np.column_stack([data.measured[c] for c in channels]))
    held, known, early = driving(model, data)
    t, u = np.ascontiguousarray(data.t), np.ascontiguousarray(held)
    y = _without(y, _turned(model, data, u))
    start = {name: float(values[0]) for name, values in known.items()}
    doubt = {name: DOUBT * _apart(values, corrected(model, data, name)) for name, values in known.items()}
    return Segment(t, u, y, _start(model, channels, t, y) | start, data.source, early=early, doubt=doubt)


def _apart(values: Array, measured: Array) -> float:
    """Return how far values (T,) are from what was measured (T,): RMS, or at the start if more."""
    apart = (values - measured)[np.isfinite(measured)]
    return float(max(np.sqrt(np.mean(apart**2)), abs(apart[0])))


def _start(model: Model, channels: tuple[str, ...], t: Array, y: Array) -> dict[str, float]:
    """Return the measured states at the first sample, and a velocity from the first positions where need be."""
    start = {}
    for c, name in enumerate(channels):
        first = np.flatnonzero(np.isfinite(y[:, c]))[:1]
        if name in model.states:
            start[name] = float(y[first[0], c]) if first.size else 0.0
    position, velocity = model.plant.position, model.plant.velocity
    if position in start and velocity in model.states and velocity not in start:
        start[velocity] = _first_slope(t, y[:, channels.index(position)])
    return start


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
            before = _stretch(problem, s, slice(max(first - LEAD, 0), first + 1)) if first else None
            parts.append(replace(_stretch(problem, s, slice(first, first + size)), inner=first > 0, before=before))
    return replace(problem, segments=tuple(parts))


def _stretch(problem: Problem, s: Segment, part: slice) -> Segment:
    """Return a stretch of a record, from where that had led."""
    t, u, y = s.t[part], s.u[part], s.y[part]
    start = _start(problem.base, problem.channels, t, y) | _led_to(problem, s, part.start)
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
        there = np.isfinite(measured)
        if not there.any():
            return {}
        velocity = np.interp(t, t[there], measured[there])
    else:
        return {}
    return {plant.position: s.start.get(plant.position, 0.0) + float(travelled(t, velocity, early)[-1])}


def _first_slope(t: Array, values: Array) -> float:
    """Return the slope at the start of a noisy signal (T,), NaN where there is no sample.

    Straight lines through more and more samples, as long as their confidence intervals have a common point
    [Goldenshluger and Nemirovski 1997, Mathematical Methods of Statistics 6(2)].
    """
    there = np.flatnonzero(np.isfinite(values))
    noise = fourth_difference_noise(values)
    low, high, slope = -np.inf, np.inf, 0.0
    for count in SLOPES:
        if count > there.size:
            break
        at = t[there[:count]] - t[there[0]]
        centred = at - at.mean()
        square = float(centred @ centred)
        found = float(centred @ values[there[:count]]) / square
        reach = CONFIDENT * noise / np.sqrt(square)
        low, high = max(low, found - reach), min(high, found + reach)
        if low > high:
            break
        slope = found
    return slope


def pieces(data: ModelData, channels: tuple[str, ...]) -> tuple[list[ModelData], list[str]]:
    """Cut a record at its gaps in time, each piece from where the channels are measured; pieces that are too short are
    left out, if any is long enough. Returns notes on outliers, and on what is left out because it is not measured.
    """
    data, notes = without_outliers(data, channels)
    edges, late = measured_parts(data, channels, np.column_stack([data.measured[c] for c in channels]))
    parts = [data.part(first, last) for first, last in edges if last - first >= LEAST_SAMPLES]
    return parts or [data], [*notes, *late]


def bare(model: Model) -> Model:
    """Return the plant without any effect."""
    for key in list(model.effects):
        model = model.without_effect(key)
    return model


def linear_base(model: Model, channels: tuple[str, ...]) -> tuple[tuple[str, ...], Array, Array, Array]:
    """Return (states, A, B, C) of the bare plant at rest: what the observer is designed for."""
    plain = bare(model)
    eq = equations(plain.structure, channels, ())
    n, m, ny = eq.sizes[:3]
    point = np.concatenate([np.zeros(n + m), plain.p, neutral_sensors(ny), [0.0]])
    columns = eq.keep.batch([*point])[:, 0]
    A = columns[eq.places.J :][: n * n].reshape(n, n)
    C = columns[eq.places.h_x :][: ny * n].reshape(ny, n)
    moved = [eq.keep.batch([*(point + np.eye(point.size)[n + j])])[:n, 0] for j in range(m)]
    B = np.column_stack([f - columns[:n] for f in moved])
    return plain.states, A, B, C


def stepped(A: Array, B: Array, dt: float) -> tuple[Array, Array]:
    """Return the transition (n, n) of x' = A x + B u over dt, and what a unit of u (m), held for dt, adds (n, m)."""
    n, m = B.shape
    whole = expm(np.block([[A, B], [np.zeros((m, n + m))]]) * dt)
    return whole[:n, :n], whole[:n, n:]


def _process_noise(model: Model, states: tuple[str, ...], sizes: dict[str, float], dt: float, tau: float) -> Array:
    """Return the variance added to every state in a step, for an observer with time constant tau.

    A measured state wanders by its noise in tau; a velocity whose position is measured by noise / tau in tau.
    """
    velocity, position = model.plant.velocity, model.plant.position
    wander = np.zeros(len(states))
    for i, name in enumerate(states):
        if name == position and velocity in states:
            continue
        own = [sizes[name] * dt / tau] if name in sizes else []
        if name == velocity and position in sizes and position in states:
            own.append(sizes[position] * dt / tau**2)
        if name == velocity and not own:
            own = [0.01 * sizes.get("fallback", 1.0) * dt / tau]
        wander[i] = min(own) if own else 0.0
    return np.diag(wander**2)


def _doubts(segments: Sequence[Segment]) -> dict[str, float]:
    """Return the states that are imposed and recorded, and by how much they may be off at the start of any record.

    An observer that were uncertain of more would hide a load in their zero.
    """
    return {name: max(s.doubt.get(name, np.inf) for s in segments) for name in segments[0].doubt}


def design(
    model: Model,
    channels: tuple[str, ...],
    noise: Array,
    sizes: dict[str, float],
    dt: float,
    tau: float,
    known: Mapping[str, float] | None = None,
) -> Gains:
    """Return the gains of an observer with time constant tau (s); it starts uncertain of all states, of those ``known``
    by no more than so much.
    """
    states, A, _, C = linear_base(model, channels)
    measured = {c: float(s) for c, s in zip(channels, noise, strict=True)}
    measured["fallback"] = sizes.get(model.plant.velocity, 1.0)
    Q = _process_noise(model, states, measured, dt, tau)
    first = {s: SETTLED * measured[s] ** 2 if s in measured else sizes.get(s, 1.0) ** 2 for s in states}
    P0 = np.diag([min(first[s], (known or {}).get(s, np.inf) ** 2) for s in states])
    return _kalman(states, expm(A * dt), C, Q, noise, P0, tau)


def _kalman(states: tuple[str, ...], Ad: Array, C: Array, Q: Array, noise: Array, P0: Array, tau: float) -> Gains:
    """Return the gains of the Kalman filter of a discrete model, from what is known at the start on."""
    values = np.zeros((20_000, len(states), noise.size))
    variances = np.zeros((20_000, noise.size))
    used = kalman_gains(Ad, np.ravel(C), Q, noise**2, P0, values, variances)
    spread = np.array([np.diag(Q), np.diag(P0)])
    last = variances[used - 1]
    return Gains(tau, states, values[:used].copy(), np.sqrt(last / variances[:used]), spread)


def time_constants(dt: float, duration: float, horizon: float) -> tuple[float, ...]:
    """Return the observer's time constants from high to low gain in s; ``horizon``: over which the model is used.

    The first is for searching only; models are compared at the others, which are not shorter than the horizon.
    """
    high, low = 8 * dt, max(min(2.0, duration / 8), 16 * dt)
    middle = float(np.clip(max(np.sqrt(high * low), horizon), high, low))
    return (high, middle, float(np.sqrt(middle * low)), low)


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
        raise RecordError(f"{segments[0].source}: {_still(channels)}")
    sizes = {c: float(max(v, 1e-12)) for c, v in zip(channels, np.nanmax(np.abs(everything), axis=0), strict=True)}
    sizes = _guess_velocity(model, segments, channels, sizes)
    taus = time_constants(dt, duration, model.update_period)
    known = _doubts(segments)
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
    travel, inertia = float(np.nanmax(np.abs(position))), _inertia(model)
    return Scale(
        rms(force) if force.any() else rms(inertia * acceleration),  # what moves freely is driven by what it has stored
        travel if travel > 0 else 1.0,
        rms(velocity),
        rms(acceleration),
        current,
        float(np.max(np.abs(u[:, 0]))) or 1.0,
        dt,
        duration,
        inertia,
        _blur(model, segments[0]) * dt,
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
    return replace(s, y=_without(s.y, np.abs(s.u[:, model.inputs.index(model.plant.velocity)]) < blur))


def _turned(model: Model, data: ModelData, u: Array) -> NDArray[np.bool_]:
    """Return where (T,) an imposed velocity is so small that its correction in ``u`` (T, m) turned its direction."""
    if not model.plant.motion_is_imposed():
        return np.zeros(u.shape[0], dtype=bool)
    j = model.inputs.index(model.plant.velocity)
    return np.asarray(data.u[:, j] * u[:, j] < 0.0)


def _without(y: Array, unknown: NDArray[np.bool_]) -> Array:
    """Return measurements (T, ny) without those where something is unknown (T,), if that is rare."""
    return y if unknown.mean() > RARE or not unknown.any() else np.where(unknown[:, None], np.nan, y)


def _inertia(model: Model) -> float:
    """Return the inertia of the plant, 0 where it has none."""
    velocity = model.plant.velocity
    return abs(1.0 / float(per_force(model)[model.states.index(velocity)])) if velocity in model.states else 0.0


def _ranges(model: Model, segments: Sequence[Segment], X: Array) -> dict[str, tuple[float, float]]:
    """Return the smallest and largest value of every state and input that the records visit."""
    u = np.concatenate([s.u for s in segments])
    columns = {**{n: X[:, i] for i, n in enumerate(model.states)}, **{n: u[:, j] for j, n in enumerate(model.inputs)}}
    return {name: (float(np.nanmin(v)), float(np.nanmax(v))) for name, v in columns.items()}


__all__ = [
    "LEAST_SAMPLES",
    "Gains",
    "Problem",
    "Segment",
    "check_moving",
    "constant_inputs",
    "moves",
    "prepare",
]
