"""What an exported file loses, measured: the target's engine beside our exact model and the measurement."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from signlin_ros.export.base import Array, Exported, ExportedDrive, NotRunError, Target
from signlin_ros.model import Model
from signlin_ros.records import ModelData
from signlin_ros.simulation import Trajectory, simulate


@dataclass(frozen=True)
class ChannelLoss:
    """RMS errors of one channel, in its unit.

    ``ours`` and ``target`` are against the measurement, or, without one, against our exact model (so ours is 0);
    ``difference`` is the target's against our exact model, and ``percent`` that of the channel's RMS.
    """

    unit: str
    ours: float
    target: float
    difference: float
    percent: float


@dataclass(frozen=True)
class Loss:
    """Channels by name; ``against`` says what ours and target are against, ``not_run`` why there is nothing."""

    channels: Mapping[str, ChannelLoss] = field(default_factory=dict)
    against: str = ""
    not_run: str = ""
    diverges: bool = False


EARLY_SAMPLES, EARLY_PART = 5, 0.1
"""Samples whose slope an unmeasured speed may begin with, and the part of a record that tells whether it does."""


def drive_of(model: Model, data: ModelData) -> ExportedDrive:
    """Return inputs and initial state of a record for a model; a state that is not measured begins as the model says.

    A speed that is not measured begins so, too, or as the measured position does: as the exact model follows it better.
    """
    t, start = np.asarray(data.t), np.array(model.x0)
    measured = {name: np.asarray(values) for name, values in data.measured.items() if name in model.states}
    for name, values in measured.items():
        good = values[np.isfinite(values)]
        if good.size:
            start[model.states.index(name)] = good[0]
    if data.x0 is not None:
        start = np.array(data.x0)
    acts = t if data.acts is None else np.asarray(data.acts)
    drive = ExportedDrive(t, np.asarray(data.u), acts, model.true_states(start))
    position, velocity = measured.get(model.plant.position), model.plant.velocity
    if position is None or data.x0 is not None or velocity not in model.states or velocity in measured:
        return drive
    early = np.flatnonzero(np.isfinite(position))[:EARLY_SAMPLES]
    if early.size < 2:
        return drive
    moving = start.copy()
    moving[model.states.index(velocity)] = np.polyfit(t[early], position[early], 1)[0]
    options = (drive, replace(drive, x0=model.true_states(moving)))
    return min(options, key=lambda one: _early_error(model, one, position))


def _early_error(model: Model, drive: ExportedDrive, position: Array) -> float:
    """Return the RMS error with which the exact model follows the begin of a measured position (T,)."""
    count = max(int(EARLY_PART * drive.t.size), 2)
    run = simulate(model, drive.t[:count], drive.u[:count], drive.x0, acts=drive.acts[:count])
    return _rms(run[model.plant.position] - position[:count])


def reference(model: Model, drive: ExportedDrive) -> Trajectory:
    """Return the run of our exact model."""
    return simulate(model, drive.t, drive.u, drive.x0, acts=drive.acts)


def measure(
    target: Target, exported: Exported, model: Model, drive: ExportedDrive, measured: Mapping[str, Array] | None = None
) -> Loss:
    """Run an exported file in its target and compare it with our exact model, and with what was measured."""
    try:
        found = target.run(exported, model, drive)
    except NotRunError as error:
        return Loss(not_run=str(error))
    ours = reference(model, drive)
    wanted = [n for n in (measured or {}) if n in model.states] or _motion(model)
    channels = {}
    for name in wanted:
        if name in found:
            channels[name] = _channel(model, name, ours[name], found[name], (measured or {}).get(name))
    against = "the measurement" if measured else "our exact model"
    good = {name: c for name, c in channels.items() if np.isfinite(c.target)}
    return Loss(good, against, diverges=len(good) < len(channels))


def _motion(model: Model) -> list[str]:
    if model.plant.name == "arm":
        return [name for name in model.states if name.rpartition(".")[2] in ("position", "velocity")]
    known = (model.plant.velocity, model.plant.position, "current")
    return [name for name in known if name in model.states]


def _channel(model: Model, name: str, ours: Array, found: Array, measured: Array | None) -> ChannelLoss:
    size, difference = _rms(ours), _rms(found - ours)
    if measured is None:
        return ChannelLoss(model.units[name], 0.0, difference, difference, 100 * difference / size if size else 0.0)
    errors = [_rms(model.sensors[name].show(values) - measured) for values in (ours, found)]
    return ChannelLoss(model.units[name], errors[0], errors[1], difference, 100 * difference / size if size else 0.0)


def _rms(values: Any) -> float:
    values = np.asarray(values, dtype=float)
    with np.errstate(all="ignore"):
        return float(np.sqrt(np.nanmean(values**2)) if np.isfinite(values).any() else np.nan)


__all__ = ["ChannelLoss", "Loss", "drive_of", "measure", "reference"]
