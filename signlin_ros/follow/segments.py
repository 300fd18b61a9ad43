"""Records cut and started as the output-error estimate follows them, and what in them moves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from signlin_ros.errors import RecordError, joined
from signlin_ros.follow.data import Early, corrected, driving, measured_parts
from signlin_ros.follow.outliers import without_outliers
from signlin_ros.model import Model
from signlin_ros.noise import STANDSTILL_SHARE, fourth_difference_noise, moving
from signlin_ros.records import ModelData

Array = NDArray[np.float64]
LEAST_SAMPLES = 100
"""A record needs so many samples."""
MIN_PART_SAMPLES, MIN_SHARED_SAMPLES = LEAST_SAMPLES // 2, LEAST_SAMPLES // 4
"""Its parts between gaps, or several records, need half of them, or a quarter, where they have as many only together:
what is simulated through a gap tells nothing.
"""
MIN_WHOLE_SHARE, MAX_STEP_DEVIATION, MAX_STEPS_APART, MIN_STEP = 0.95, 0.1, 50, 1e-9
"""A channel is shown in steps if this share of the distances between neighbouring values, of those up to so many steps,
are whole multiples of one, to so much of it; the least step, as a share of the range.
"""
VELOCITY_SAMPLES, CONFIDENT = (8, 12, 16, 24, 32, 48, 64, 96, 128, 192, 256), 2.0
"""Samples that the first velocity is taken from, and half the width of its confidence interval in standard errors."""
MAX_RATE_DISTANCE = 3.0
"""Times the distance between an imposed state, put together from rates, and its measurements by which it may be off."""
MIN_START_SPEED = 0.1
"""Least speed in rad/s of a servo by which one that nobody measured may be off where a record starts."""
MAX_UNKNOWN_DIRECTION = 0.05
"""Share of the samples up to which those where the direction of an imposed velocity is not known are left out."""


MAX_SAMPLES, MAX_STRETCHES = 400_000, 10
"""Most samples of the training, and of the validation data, that anything is computed of, in so many stretches: more
only make standard errors smaller than models are wrong."""


@dataclass(frozen=True)
class PreparedSegment:
    """One record: t (T,) s, u (T, m), y (T, ny) with NaN for missing, and where it starts, by state.

    ``whole``: whether what an effect remembers at the start is fitted; not so for stretches and windows of a record.
    ``inner``: whether it begins within a record. ``before``: what came before it, where that is followed too: there an
    effect took up what it remembers.
    ``early``: by how many s the input precedes its sample, see `signlin_ros.follow.data.driving`. ``doubt``: by how
    much a state may be off at the start, by name: one that is imposed and recorded, a servo's speed that nobody
    measured. ``conditions``: values of the model's parameters that are known of the record.
    """

    t: Array
    u: Array
    y: Array
    start: dict[str, float]
    source: str
    whole: bool = True
    early: Early = 0.0
    inner: bool = False
    before: PreparedSegment | None = None
    doubt: dict[str, float] = field(default_factory=dict)
    conditions: Mapping[str, float] = field(default_factory=dict)


def twin(name: str, known: Sequence[str]) -> str:
    """Return the plant's state that an effect's own state starts from and moves with, or an empty text."""
    inner = name.rpartition(".")[2]
    aliases = {"position": ("displacement", "position"), "velocity": ("velocity", "speed")}
    return next((k for k in aliases.get(inner, ()) if "." in name and k in known), "")


class Stretch(NamedTuple):
    """``size`` samples from ``first`` on of the record that is number ``record``."""

    record: int
    first: int
    size: int


def spread(sizes: Sequence[int], closed_loop: bool) -> list[Stretch]:
    """Return stretches of records of some sizes, spread evenly, `MAX_SAMPLES` together at most; whole records where
    these have no more, and of a plant in a closed loop: it is run from where its records begin.
    """
    total, size = sum(sizes), MAX_SAMPLES // MAX_STRETCHES
    if closed_loop or total <= MAX_SAMPLES:
        return [Stretch(i, 0, n) for i, n in enumerate(sizes)]
    places = [Stretch(i, first, min(size, n - first)) for i, n in enumerate(sizes) for first in range(0, n, size)]
    places = [one for one in places if one.size >= min(LEAST_SAMPLES, sizes[one.record])]
    at = np.linspace(0, len(places) - 1, int(MAX_SAMPLES * len(places) / sum(one.size for one in places)))
    return [places[k] for k in at.round().astype(int)]


def told_spread(sources: Sequence[str], sizes: Sequence[int], used: Sequence[Stretch]) -> str:
    """Return that stretches of records are used, in words; empty where all of them are."""
    total, some = sum(sizes), sum(one.size for one in used)
    if some == total:
        return ""
    names = joined(list(dict.fromkeys(sources)))
    return f"{names}: of {total:,} samples {some:,} are used, in {len(used)} stretches spread evenly"


def stand_still(channels: Sequence[str]) -> str:
    """Return in words that nothing moves."""
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
            raise RecordError(f"{record.source}: {stand_still(channels)}")


def constant_inputs(model: Model, data: Sequence[ModelData]) -> tuple[str, ...]:
    """Return notes on inputs that are the same all through a record: what they do is not told from a load."""
    notes, optional = [], model.plant.optional_inputs
    for record in data:
        for name, values in zip(model.inputs, record.u.T, strict=True):
            if name in optional or not values.size or np.ptp(values) > STANDSTILL_SHARE * np.max(np.abs(values)):
                continue
            if values[0] == 0.0:
                why = "right where nothing drives, as in a free decay; else it was not recorded"
            else:
                why = "what it does cannot be told from a constant load"
            unit = f" {record.units.get(name, '')}".rstrip() if values[0] else ""
            notes.append(f"{record.source}: the {name} is {values[0]:.4g}{unit} from beginning to end: {why}")
    return tuple(notes)


def quanta(segments: Sequence[PreparedSegment]) -> Array:
    """Return the step (ny) in which every channel is shown, 0 where there is none."""
    every = np.concatenate([s.y for s in segments])
    return np.array([_step_shown(np.unique(values[np.isfinite(values)])) for values in every.T])


def _step_shown(values: Array) -> float:
    """Return the step between values (n,) in order, which a wide motion need not fill; 0 where there is none."""
    steps = np.diff(values)
    steps = steps[steps > MIN_STEP * (values[-1] - values[0])] if steps.size else steps
    if steps.size < 2:
        return 0.0
    step = float(np.median(steps[steps < 1.5 * steps.min()]))
    times = steps[steps < MAX_STEPS_APART * step] / step
    whole = np.abs(times - np.round(times)) < MAX_STEP_DEVIATION
    return step if whole.mean() > MIN_WHOLE_SHARE and 2 * times.size > steps.size else 0.0


def with_measured_position(model: Model, data: Sequence[ModelData]) -> Model:
    """Return the model with its position as a state if the records have it."""
    if model.plant.position_optional and all(model.plant.position in d.measured for d in data):
        return model.with_options(with_position=True)
    return model


def prepared_segment(model: Model, channels: tuple[str, ...], data: ModelData) -> PreparedSegment:
    """Return one record as arrays, with the state that it starts from."""
    y = np.ascontiguousarray(np.column_stack([data.measured[c] for c in channels]))
    held, known, early = driving(model, data)
    t, u = np.ascontiguousarray(data.t), np.ascontiguousarray(held)
    y = without(y, _turned(model, data, u))
    start = {name: float(values[0]) for name, values in known.items()}
    doubt = {name: MAX_RATE_DISTANCE * _apart(values, corrected(model, data, name)) for name, values in known.items()}
    start = known_start(model, channels, t, y) | start
    if model.plant.closed_loop:  # a free run starts from what was measured, whatever it is compared with
        first = {n: float(data.measured[n][0]) for n in model.states if n in data.measured}
        start |= {n: x for n, x in first.items() if np.isfinite(x)}
        speed = model.plant.velocity
        doubt |= (
            {} if np.isfinite(first.get(speed, np.nan)) else {speed: max(abs(start.get(speed, 0.0)), MIN_START_SPEED)}
        )
    return PreparedSegment(t, u, y, start, data.source, early=early, doubt=doubt, conditions=data.conditions)


def _apart(values: Array, measured: Array) -> float:
    """Return how far values (T,) are from what was measured (T,): RMS, or at the start if more."""
    apart = (values - measured)[np.isfinite(measured)]
    return float(max(np.sqrt(np.mean(apart**2)), abs(apart[0])))


def known_start(model: Model, channels: tuple[str, ...], t: Array, y: Array) -> dict[str, float]:
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


def _first_slope(t: Array, values: Array) -> float:
    """Return the slope at the start of a noisy signal (T,), NaN where there is no sample.

    Straight lines through more and more samples, as long as their confidence intervals have a common point
    [Goldenshluger and Nemirovski 1997, Mathematical Methods of Statistics 6(2)].
    """
    there = np.flatnonzero(np.isfinite(values))
    noise = fourth_difference_noise(values)
    low, high, slope = -np.inf, np.inf, 0.0
    for count in VELOCITY_SAMPLES:
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
    """Cut a record at its gaps in time, each piece from where the channels are measured. Pieces of less than
    `LEAST_SAMPLES` are left out, or where none has as many those of less than `MIN_PART_SAMPLES`, or
    `MIN_SHARED_SAMPLES`, if the others have as many together. Returns notes on outliers, and on what is left out.
    """
    data, notes = without_outliers(data, channels)
    edges, late = measured_parts(data, channels, np.column_stack([data.measured[c] for c in channels]))
    sizes = [last - first for first, last in edges]
    allowed = (LEAST_SAMPLES, MIN_PART_SAMPLES, MIN_SHARED_SAMPLES)
    least = next((n for n in allowed if sum(size for size in sizes if size >= n) >= LEAST_SAMPLES), 0)
    if not least:
        through = f"{data.source}: the parts between its gaps are too short to be taken by themselves"
        return [data], [*notes, *late, *([through] if len(edges) > 1 else [])]
    parts = [data.part(first, last) for first, last in edges]
    lost = [f"{p.source}: {len(p)} samples at t = {p.t[0]:.6g} s are left out" for p in parts if 0 < len(p) < least]
    return [part for part in parts if len(part) >= least], [*notes, *late, *lost]


def _turned(model: Model, data: ModelData, u: Array) -> NDArray[np.bool_]:
    """Return where (T,) an imposed velocity is so small that its correction in ``u`` (T, m) turned its direction."""
    if not model.plant.motion_is_imposed():
        return np.zeros(u.shape[0], dtype=bool)
    j = model.inputs.index(model.plant.velocity)
    return np.asarray(data.u[:, j] * u[:, j] < 0.0)


def without(y: Array, unknown: NDArray[np.bool_]) -> Array:
    """Return measurements (T, ny) without those where something is unknown (T,), if that is rare."""
    return y if unknown.mean() > MAX_UNKNOWN_DIRECTION or not unknown.any() else np.where(unknown[:, None], np.nan, y)


__all__ = [
    "LEAST_SAMPLES",
    "MIN_PART_SAMPLES",
    "MIN_SHARED_SAMPLES",
    "PreparedSegment",
    "check_moving",
    "constant_inputs",
    "known_start",
    "moves",
    "pieces",
    "prepared_segment",
    "quanta",
    "stand_still",
    "twin",
    "with_measured_position",
    "without",
]
