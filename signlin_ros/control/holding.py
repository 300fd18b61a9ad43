"""Which bandwidth a design holds on a model's drive, with the period and the delays of its loop."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from signlin_ros.control.designs import CALM, Design, Task, Tuning, friction_free_part, jacobian, known
from signlin_ros.control.drive import NO_SLOT, Drive
from signlin_ros.control.margins import (
    LinearDrive,
    Margins,
    largest_bandwidth,
    loop_margins,
    refusal,
    rigid_drive,
    sampled_drives,
)
from signlin_ros.effects import find_effect
from signlin_ros.effects.backlash import Backlash
from signlin_ros.effects.compliant_load import CompliantLoad
from signlin_ros.errors import InputError
from signlin_ros.model import Model

Array = NDArray[np.float64]
RUNNING = 0.5
"""Share of the largest speed at which what hangs on a drive is linearized."""


def linear_drives(model: Model, task: Task) -> list[LinearDrive]:
    """Return what a loop is judged on: the drive with its friction while it moves, without it, and with its current.

    A load on a spring is linearized with the rest. A play is not: in contact it is the drive with its load, and
    that is among them.
    """
    whole, bare = known(model, task), known(model, task, bare=True)
    drives = [rigid_drive(c.kV, whole.kA, c.kP) for c in (whole, bare)]
    hanging = [find_effect(use.type, "effects") for use in model.effects.values()]
    hanging = [kind for kind in hanging if issubclass(kind, CompliantLoad)]
    if not hanging:
        return [*drives, _linearized(friction_free_part(model), task, moving=False)]
    if not any(issubclass(kind, Backlash) for kind in hanging):
        drives.append(_linearized(model, task, moving=True))
    return drives


def _linearized(model: Model, task: Task, moving: bool) -> LinearDrive:
    """Return the Jacobian of a model with a position: at rest, or with all of it at half of the largest speed."""
    drive = Drive.of(model, with_position=model.plant.name == "dc_motor")
    x = np.zeros(len(drive.model.states))
    if moving:
        speeds = [i for i, name in enumerate(drive.model.states) if i == drive.velocity or name.endswith(".velocity")]
        x[speeds] = RUNNING * task.speed
    A, B = jacobian(drive.model, x)
    return LinearDrive(A, B[:, :1], drive.position if drive.position != NO_SLOT else -1, drive.velocity)


def margins_at(design: Design, model: Model, task: Task, tuning: Tuning) -> Callable[[float], Margins]:
    """Return the margins of a design as a function of the bandwidth in rad/s; infinite where it has no gains."""
    drives = sampled_drives(linear_drives(model, task), task.period, task.delays)

    def found(bandwidth: float) -> Margins:
        tuned = replace(tuning, weights=replace(tuning.weights, bandwidth=bandwidth))
        try:
            rows = np.unique(design.law(model, task, tuned).gains, axis=0)
        except InputError:
            return Margins(np.inf, np.inf, task.delay)
        return loop_margins(drives, rows, task.period, task.position)

    return found


def holding(design: Design, model: Model, task: Task, tuning: Tuning, bandwidth: float = 0.0) -> Tuning:
    """Return a tuning whose bandwidth holds: the one asked for, or by default a calm one.

    bandwidth : rad/s; 0: 0.8 / (period + delay), or the largest that holds where that does not. Raises `InputError`
    with the largest that holds where the one asked for does not, or where none does.
    """
    margins = margins_at(design, model, task, tuning)
    wanted = bandwidth or CALM / (task.period + task.delay)
    found = margins(wanted)
    if not found.hold:
        largest = largest_bandwidth(margins, task.period, task.delay, wanted)
        if bandwidth or not largest:
            raise refusal(design.name, wanted, found, largest, task.period, task.delay)
        wanted = largest
    return replace(tuning, weights=replace(tuning.weights, bandwidth=wanted))


def calmed(design: Design, model: Model, task: Task, tuning: Tuning, bandwidth: float) -> Tuning:
    """Return `holding`, with the largest bandwidth that holds where the one asked for does not."""
    try:
        return holding(design, model, task, tuning, bandwidth)
    except InputError:
        return holding(design, model, task, tuning)


__all__ = ["calmed", "holding", "linear_drives", "margins_at"]
