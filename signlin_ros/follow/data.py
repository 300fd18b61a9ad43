"""Records as the diagnosis takes them: read for a model, cut at gaps, freed of what the sensors add."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.signal import savgol_filter

from signlin_ros import units
from signlin_ros.apart import of_record, split
from signlin_ros.errors import RecordError
from signlin_ros.model import Model
from signlin_ros.recording.trace import TEMPERATURE
from signlin_ros.records import ModelData, Record
from signlin_ros.records.clean import gaps
from signlin_ros.records.files import read_unmapped
from signlin_ros.records.header import heading
from signlin_ros.simulation import interpolated

Array = NDArray[np.float64]
PathName = str | os.PathLike[str]
Early = float | Array
"""By how many s the rows of an input precede their samples: all alike, or each (T,); negative where they follow."""

MIN_SEGMENT_SAMPLES = 20
"""A stretch between gaps needs this many samples."""
STEP_UNITS = ((1e5, "ns"), (500.0, "us"), (0.5, "ms"))
"""Steps in s from which on a time is rather in another unit."""
DRIFT = 51
"""Samples over which an imposed velocity and displacement are held together."""


@dataclass(frozen=True, eq=False)
class Segment:
    """Samples without a gap: t (T,) s, u (T, m), y (T, channels) true values with NaN for missing samples.

    ``source`` names the record, ``record`` counts them from 0; ``first`` is where the stretch begins in it.
    ``known``: states (T,) that are imposed, ``early``: by how many s the input precedes its sample, one number or (T,);
    see `driving`. ``conditions``: values of the model's parameters that are known of the record.
    """

    t: Array
    u: Array
    y: Array
    source: str
    record: int
    first: int
    known: Mapping[str, Array] = field(default_factory=dict)
    early: Early = 0.0
    conditions: Mapping[str, float] = field(default_factory=dict)

    @property
    def step(self) -> float:
        """The median time between samples in s."""
        return float(np.median(np.diff(self.t)))


def load_records(
    model: Model, paths: PathName | Sequence[PathName], signals: Mapping[str, str] | None = None
) -> tuple[Model, list[ModelData]]:
    """Read one record or several for a model; a file in which the time begins anew holds several.

    A motor whose position is recorded gets it as a state, so that it is compared too; a temperature that is mapped, or
    recorded under that name in a unit of its own, becomes an input.
    """
    wider, data, _ = load_sides(model, [paths] if isinstance(paths, (str, os.PathLike)) else paths, (), signals)
    return wider, data


def load_sides(
    model: Model,
    known: Sequence[PathName],
    unseen: Sequence[PathName],
    signals: Mapping[str, str] | None = None,
) -> tuple[Model, list[ModelData], list[ModelData] | None]:
    """Read records to fit to and records for validation (None if there are none), as `load_records` does."""
    if any(split(key)[1] == TEMPERATURE for key in signals or {}):
        model = with_temperature(model)
    optional = model.plant.position_optional and model.plant.position not in model.states
    wider = model.with_options(with_position=True) if optional else model

    def read(model: Model) -> list[list[tuple[PathName, Record]]]:
        return [[(p, run) for p in paths for run in read_unmapped(p, model, signals)] for paths in (known, unseen)]

    def mapped(model: Model, sides: list[list[tuple[PathName, Record]]]) -> list[list[ModelData]]:
        return [[run.for_model(model, of_record(signals, path)) for path, run in side] for side in sides]

    first, second = mapped(wider, found := read(wider))
    if optional and not all(model.plant.position in d.measured for d in (*first, *second)):
        wider, (first, second) = model, mapped(model, found)  # a position is wanted in a file all the same
    if TEMPERATURE not in model.inputs and all(map(holds_temperature, (*first, *second))):
        wider = with_temperature(wider)
        first, second = mapped(wider, read(wider))
    return wider, first, second or None


def with_temperature(model: Model) -> Model:
    """Return the model with the temperature as an input."""
    given = TEMPERATURE in model.inputs
    return model if given else model.with_options(with_inputs=[*model.with_inputs, TEMPERATURE])


def holds_temperature(record: ModelData) -> bool:
    """Tell whether a record has a column of that name, in a unit of temperature, that nothing uses."""
    return any(h.matches(TEMPERATURE) and units.is_temperature(h.unit) for h in map(heading, record.unused))


def unit_asked(step: float) -> str:
    """Return a question after the unit of a time whose steps, taken as s, are that long; nothing where they may be."""
    unit = next((unit for least, unit in STEP_UNITS if step >= least), "")
    return f"; is the time in {unit}? Then name its column t [{unit}]" if unit else ""


def as_list(data: ModelData | Sequence[ModelData]) -> list[ModelData]:
    """Return one record or several as a list; raise `RecordError` if there is none."""
    found = [data] if isinstance(data, ModelData) else list(data)
    if not found:
        raise RecordError("at least one record is needed")
    return found


def measured_channels(model: Model, data: Sequence[ModelData]) -> tuple[str, ...]:
    """Return the states and outputs that every record measures; raise `RecordError` if there is none.

    The position of an imposed motion is not among them: no model explains it. See `driving`.
    """
    given = {model.plant.position} if model.plant.motion_is_imposed() else set()
    known = [c for c in dict.fromkeys((*model.states, *model.outputs)) if c not in given]
    found = tuple(c for c in known if all(np.isfinite(d.measured.get(c, np.nan)).any() for d in data))
    if not found:
        raise RecordError(f"{data[0].source}: nothing to compare with: none of {', '.join(known)} is measured")
    return found


def driving(model: Model, record: ModelData) -> tuple[Array, dict[str, Array], Early]:
    """Return the inputs (T, m) of a record without gaps, the states (T,) that they impose, and by how many s the inputs
    precede their samples: as the model's ``input_hold`` says, and each by what its own stamp does.

    A velocity that is imposed runs away from a displacement that was measured too, if its sensor has an offset: the
    slow part of the difference is taken out of it, but not what is proportional to it. That tells whether the velocity
    was held from sample to sample, as a simulated one is, or sampled from a motion that goes on in between: held, that
    would make the displacement half a step late, and a spring look like a damper of k step/2. It is taken from half a
    step before its sample to half a step after it, unless the model's ``input_hold`` says otherwise.
    """
    plant, t, u = model.plant, record.t, record.u
    step = float(np.median(np.diff(t)))
    if not plant.motion_is_imposed() or plant.position not in record.measured:
        return u, {}, _early(model, record)
    x = corrected(model, record, plant.position)
    there = np.isfinite(x)
    if np.count_nonzero(there) < DRIFT:
        return u, {}, model.early * step
    u, j = u.copy(), model.inputs.index(plant.velocity)
    apart = x - travelled(t, u[:, j])
    varying = u[:, j] - np.mean(u[:, j])  # a constant velocity tells nothing of it
    features = np.column_stack([varying, np.ones_like(t), t])
    late = np.linalg.lstsq(features[there], apart[there], rcond=None)[0][0]
    slow = np.interp(t, t[there], (apart - late * u[:, j])[there])
    apart = savgol_filter(slow, DRIFT, 1)
    u[:, j] += np.gradient(apart, t)
    early = model.early * step if not model.asks_hold or late < step / 4 else step / 2
    return u, {plant.position: apart[0] + travelled(t, u[:, j], early)}, early


def _early(model: Model, record: ModelData) -> Early:
    step = float(np.median(np.diff(record.t)))
    if record.acts is None or model.plant.motion_is_imposed():
        return model.early * step
    return model.early * step + record.t - record.acts


def travelled(t: Array, velocity: Array, early: Early = 0.0) -> Array:
    """Return how far (T,) a velocity (T,) that is held, from ``early`` s before its sample on, has led since the first
    one.
    """
    steps = np.diff(t)
    early = early[1 : t.size] if isinstance(early, np.ndarray) else early
    return np.concatenate([[0.0], np.cumsum(velocity[:-1] * steps + np.diff(velocity) * np.minimum(early, steps))])


def arriving(t: Array, u: Array, delay: Early) -> Array:
    """Return the means of a held input u (T, m) between samples (T - 1, m), as they arrive ``delay`` s later, all alike
    or each row (T,).
    """
    if isinstance(delay, np.ndarray):
        return _arriving_apart(t, u, t + delay)
    late = t - delay
    beyond = u[0] * np.minimum(late - t[0], 0.0)[:, None] + u[-1] * np.maximum(late - t[-1], 0.0)[:, None]
    at = np.column_stack([np.interp(late, t, travelled(t, column)) for column in u.T]) + beyond
    return np.asarray(np.diff(at, axis=0) / np.diff(t)[:, None])


def _arriving_apart(t: Array, u: Array, acts: Array) -> Array:
    """Return the means (T - 1, m) between samples of an input whose rows u (T, m) act from ``acts`` (T,) on."""
    total = np.concatenate([np.zeros((1, u.shape[1])), np.cumsum(u[:-1] * np.diff(acts)[:, None], axis=0)])
    index = np.maximum(np.searchsorted(acts, t, side="right") - 1, 0)
    until = total[index] + u[index] * (t - acts[index])[:, None]
    return np.asarray(np.diff(until, axis=0) / np.diff(t)[:, None])


def acting(model: Model, t: Array, u: Array, late: Early) -> tuple[Array, Array]:
    """Return rows of the inputs (K, m), and from when each acts (K,) until the next does, as ``input_hold`` says: u
    (T, m) from ``late`` s after its samples t (T,) on, or what lies between these on straight lines.
    """
    acts = np.asarray(t + late)
    return interpolated(u, acts) if model.interpolates else (u, acts)


def cut(early: Early, part: slice) -> Early:
    """Return the part of a value that belongs to a part of a record."""
    return early[part] if isinstance(early, np.ndarray) else early


def stretches(model: Model, data: Sequence[ModelData], channels: tuple[str, ...]) -> tuple[list[Segment], list[str]]:
    """Cut records at their gaps; returns the stretches, and notes on gaps and on what is too short to be used."""
    found, notes = [], []
    for number, record in enumerate(data):
        y = np.column_stack([corrected(model, record, name) for name in channels])
        parts, late = measured_parts(record, channels, y)
        if len(parts) > 1:
            after = "the gap" if len(parts) == 2 else f"each of {len(parts) - 1} gaps"
            notes.append(f"{record.source}: every run starts anew after {after} in time")
        notes += late
        for first, last in parts:
            part = slice(first, last)
            if last - first >= MIN_SEGMENT_SAMPLES and np.isfinite(y[part]).any():
                u, known, early = driving(model, record.part(first, last))
                own = record.conditions
                found.append(Segment(record.t[part], u, y[part], record.source, number, first, known, early, own))
            else:
                notes.append(f"{record.source}: {last - first} samples at t = {record.t[first]:.6g} s are left out")
    if not found:
        raise RecordError(f"{data[0].source}: fewer than {MIN_SEGMENT_SAMPLES} samples without a gap")
    return found, notes


def measured_parts(record: ModelData, channels: tuple[str, ...], y: Array) -> tuple[list[tuple[int, int]], list[str]]:
    """Cut a record at its gaps in time, each part from where the channels y (T, channels) are measured; returns first
    and last (exclusive) samples, and notes on what is left out because it is not measured.
    """
    parts, notes = [], []
    for begin, last in pairwise(gaps(record.t)):
        first = begin + _first_measured(y[begin:last])
        parts.append((first, last))
        if first > begin:
            notes.append(_begun_late(record, begin, first, channels))
    return parts, notes


def _first_measured(y: Array) -> int:
    """Return the sample from which on all channels of y (T, channels) are measured; where one begins only in the second
    half, that from which on any is.
    """
    there = np.isfinite(y)
    first = np.where(there.any(axis=0), there.argmax(axis=0), y.shape[0])
    return int(first.max() if first.max() <= y.shape[0] // 2 else first.min() % y.shape[0])


def _begun_late(record: ModelData, begin: int, first: int, channels: tuple[str, ...]) -> str:
    """Return the note on a part of a record that is taken from ``first`` on instead of from ``begin``."""
    late = [c for c in channels if not np.isfinite(record.measured[c][begin:first]).any()]
    what = ", ".join(late)
    return f"{record.source}: what is before t = {record.t[first]:.6g} s is left out: {what} is not measured there"


def corrected(model: Model, record: ModelData, name: str) -> Array:
    """Return the model's quantity (T,) behind a sensor: without its gain and offset, and at the right time."""
    sensor = model.sensors[name]
    values = np.asarray(sensor.true(record.measured[name]))
    if sensor.delay == 0.0:
        return values
    good = np.isfinite(values)
    moved = np.interp(record.t + sensor.delay, record.t[good], values[good], right=np.nan)
    lost = np.interp(record.t + sensor.delay, record.t, (~good).astype(float)) > 0
    return np.where(lost, np.nan, moved)


__all__ = [
    "MIN_SEGMENT_SAMPLES",
    "Early",
    "Segment",
    "acting",
    "arriving",
    "as_list",
    "corrected",
    "cut",
    "driving",
    "gaps",
    "load_records",
    "measured_channels",
    "measured_parts",
    "stretches",
    "travelled",
    "unit_asked",
]
