"""What an exported model is driven with where there is no record: a stated standard excitation with reversals."""

from __future__ import annotations

import numpy as np

from signlin_ros.errors import SimulationError
from signlin_ros.export.base import Array, ExportedDrive
from signlin_ros.model import Model

EXCITATION_TIME, EXCITATION_STEP = 10.0, 0.005
"""s."""
SLOW_SINE, FAST = 1.0, 2.7
"""Hz of the two sines, the second half as large."""
STATED = (
    f"standard excitation: {EXCITATION_TIME:g} s, a (sin 2π {SLOW_SINE:g} t + 0.5 sin 2π {FAST:g} t), "
    f"held over {1000 * EXCITATION_STEP:g} ms"
)
TINY, SENSITIVE = 1e-5, 300.0
"""Of inputs that differ by this part, runs that differ by so many times more tell nothing of a target."""
FASTEST = 2.5e5
"""Rates in 1/s above which no fixed step of 10 µs or more is stable."""
COMMANDED_AMPLITUDE = 0.35
"""Size of the waves in rad where a position is commanded."""
EXCITATION_SIZES = tuple(base * 10.0**power for power in range(-3, 5) for base in (1.0, 2.0, 5.0))
MAX_STANDING_SHARE = 0.15
"""The excitation is large enough when the drive stands still for no more than this part of the time,"""
SCALES = 5.0
"""and goes this many scales of sign_j fast, or half of its operating range."""


def standard_excitation(model: Model) -> ExportedDrive:
    """Return two sines on the first input that reverse the motion some 20 times in 10 s, from the initial state.

    Their size is the smallest of 1, 2, 5 times a power of ten that keeps the drive moving, and fast enough to slide,
    or the largest that is of use (`_run`); a position is commanded half a radian each way.
    """
    t = np.arange(0.0, EXCITATION_TIME, EXCITATION_STEP)
    wave = np.sin(2 * np.pi * SLOW_SINE * t) + 0.5 * np.sin(2 * np.pi * FAST * t)
    if "goal_position" in model.inputs:
        return _on_first(model, t, COMMANDED_AMPLITUDE * wave)
    drive = _on_first(model, t, EXCITATION_SIZES[0] * wave)
    for size in EXCITATION_SIZES:
        larger = _on_first(model, t, size * wave)
        moves, inside = _run(model, larger)
        if not inside:
            return drive
        drive = larger
        if moves:
            return drive
    return drive


def _on_first(model: Model, t: Array, values: Array) -> ExportedDrive:
    u = np.zeros((t.size, len(model.inputs)))
    u[:, 0] = values
    for name, value in model.plant.unrecorded(model.parameters).items():
        if name in model.inputs:
            u[:, model.inputs.index(name)] = value
    return ExportedDrive(t, u, t, np.array(model.x0))


def _run(model: Model, drive: ExportedDrive) -> tuple[bool, bool]:
    """Tell whether the drive is fast enough and stands still for a small part of the time only, and whether its run is
    of use: it stays where sign_j stands for the sign, is not too stiff for any step, and does not multiply a small
    difference.
    """
    from signlin_ros.linearization import Linearizer
    from signlin_ros.simulation import simulate

    try:
        path = simulate(model, drive.t, drive.u, drive.x0)
        beside = simulate(model, drive.t, drive.u * (1 + TINY), drive.x0)
    except SimulationError:
        return False, False
    speed = np.abs(path[model.plant.velocity])
    linear = Linearizer(model.with_options(operating_point="start"), "jacobian").batch(path.x[::10], drive.u[::10])
    if not np.isfinite(linear.A).all() or np.abs(np.linalg.eigvals(linear.A)).max() > FASTEST:
        return False, False
    scales = SCALES / 10 if model.plant.built_in else SCALES  # a plant whose hysteresis is its own is meant for less
    fast = model.operating_range.get(model.plant.velocity, 0.0) / 2 or scales * (model.sign_scale or 0.2)
    moves = speed.max() >= fast and np.mean(speed < 0.02 * speed.max()) <= MAX_STANDING_SHARE
    size = np.sqrt(np.mean(path.x**2, axis=0)) + 1e-300
    grown = np.sqrt(np.mean((beside.x - path.x) ** 2, axis=0)) / size / TINY
    return bool(moves), bool(np.mean(linear.in_valid_range) > 0.99 and grown.max() < SENSITIVE)


__all__ = ["STATED", "standard_excitation"]
