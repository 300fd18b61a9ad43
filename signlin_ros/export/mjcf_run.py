"""MuJoCo on an exported file: stepped with an input, the states read back."""

from __future__ import annotations

import importlib.util
from typing import Any

import numpy as np

from signlin_ros.export.base import Array, ExportedDrive, NotRunError
from signlin_ros.export.mjcf_parts import MjcfParts
from signlin_ros.model import Model


def run(text: str, parts: MjcfParts, model: Model, drive: ExportedDrive) -> dict[str, Array]:
    """Return the states (T,) by name of a file stepped from the drive's first sample to its last.

    Raises `NotRunError` without mujoco; NaN from where it diverges on.
    """
    if importlib.util.find_spec("mujoco") is None:
        raise NotRunError('mujoco is not installed (pip install "signlin_ros[export]")')
    import mujoco
    import mujoco.rollout

    mujoco.set_mju_user_warning(_quiet)
    try:
        mj = mujoco.MjModel.from_xml_string(text)
    except ValueError as error:
        raise NotRunError(f"MuJoCo {mujoco.__version__} does not load it: {error}") from error
    data = mujoco.MjData(mj)
    _start(mujoco, mj, data, parts, model, drive)
    step = mj.opt.timestep
    count = int(np.ceil((drive.t[-1] - drive.t[0]) / step - 1e-9))
    times = drive.t[0] + step * np.arange(count + 1)
    control = np.zeros((1, count, mj.nu))
    control[0, :, : len(model.inputs) if mj.nu >= len(model.inputs) else 1] = (
        drive.input_at(times[:-1])[:, : mj.nu] * parts.control
    )
    spec = mujoco.mjtState.mjSTATE_FULLPHYSICS
    initial = np.zeros(mujoco.mj_stateSize(mj, spec))
    mujoco.mj_getState(mj, data, initial, spec)
    states, _ = mujoco.rollout.rollout(mj, data, initial[None], control)
    rows = np.vstack([initial, states[0]])
    broken = np.flatnonzero(np.diff(rows[:, 0]) < 0.5 * step)  # a step back in time: it was reset
    if broken.size:
        rows[broken[0] + 1 :] = np.nan
    return _named(mj, parts, model, times, rows, drive.t)


def _quiet(message: str) -> None:
    """Take MuJoCo's warnings: a run that diverges is told by its numbers."""


def _start(mujoco: Any, mj: Any, data: Any, parts: MjcfParts, model: Model, drive: ExportedDrive) -> None:
    """Set the state at the drive's first sample; bristles and currents too."""
    start = dict(zip(model.states, drive.x0, strict=True))
    data.qpos[0] = start.get(model.plant.position, 0.0)
    data.qvel[0] = start.get(model.plant.velocity, 0.0)
    for key in model.effects:
        if mj.nq > 1 and f"{key}.position" in start:
            data.qpos[1] = start[f"{key}.position"] - data.qpos[0]
            data.qvel[1] = start[f"{key}.velocity"] - data.qvel[0]
    if "current" in start and mj.actuator_actnum[0]:
        data.act[mj.actuator_actadr[0] + mj.actuator_actnum[0] - 1] = start["current"] * parts.control
    if parts.delay:
        buffer = int(mj.actuator_history[0, 0])
        times = -mj.opt.timestep * np.arange(buffer, 0, -1)
        first = np.full((buffer, 1), drive.u[0, 0] * parts.control)
        mujoco.mj_initCtrlHistory(mj, data, 0, times, first)


def _named(mj: Any, parts: MjcfParts, model: Model, times: Array, rows: Array, wanted: Array) -> dict[str, Array]:
    """Return the states by our names at the wanted times."""
    q = 1
    columns = {model.plant.position: rows[:, q], model.plant.velocity: rows[:, q + mj.nq]}
    if mj.nq > 1:
        for key in model.effects:
            columns |= {f"{key}.position": rows[:, q] + rows[:, q + 1]}
            columns |= {f"{key}.velocity": rows[:, q + mj.nq] + rows[:, q + mj.nq + 1]}
    if "current" in model.states and mj.actuator_actnum[0]:
        act = q + mj.nq + mj.nv + int(mj.actuator_actadr[0] + mj.actuator_actnum[0]) - 1
        columns["current"] = rows[:, act] / parts.control
    with np.errstate(all="ignore"):
        return {n: np.interp(wanted, times, v) for n, v in columns.items() if n in model.states}


__all__ = ["run"]
