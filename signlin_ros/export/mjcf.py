"""MJCF of MuJoCo: a joint and its actuator, with integrator and time step chosen by running it."""

from __future__ import annotations

import copy
from dataclasses import replace
from pathlib import Path

import numpy as np

from signlin_ros.effects import find_effect, origin
from signlin_ros.errors import ModelError, choices
from signlin_ros.export.base import (
    Array,
    Exported,
    ExportedDrive,
    NotRunError,
    Target,
    heading,
    ranges,
    refuse_imposed,
    refuse_sensors,
    table_of_parameters,
)
from signlin_ros.export.loss import reference
from signlin_ros.export.mjcf_laws import MJCF_LAWS, MJCF_PLANTS
from signlin_ros.export.mjcf_parts import LostError, MjcfParts, Setting, document
from signlin_ros.export.mjcf_run import run
from signlin_ros.export.nearest import nearest_friction
from signlin_ros.model import Model
from signlin_ros.model.uses import is_sensor
from signlin_ros.simulation import Trajectory

TIMESTEPS = (2e-3, 1e-3, 5e-4, 2e-4, 1e-4, 5e-5, 2e-5)
"""Steps in s that are tried, from MuJoCo's own on."""
INTEGRATORS = ("implicitfast", "Euler", "RK4")
MAX_GOOD_LOSS = 0.01
"""The first setting whose speed is off by no more than this part of its RMS is taken, else the best."""
TRAP = 0.05
"""A setting of the same step that is off by more than this is warned of in the file."""
MAX_BETTER_RATIO = 0.9
"""Another setting is better if its error is below this part of the best so far."""
STIFFER = (1.0, 10.0, 100.0)
"""Stiffness of bristles that stand for a sign, relative to the first choice."""


def parts_of(model: Model, travel: float, speed: float, bristle: float = 1.0) -> MjcfParts:
    """Return a model's plant and effects as MJCF has them; what it has no element for is in ``lost``.

    Raises `ModelError` for a plant that MJCF cannot hold.
    """
    refuse_imposed(model, "mjcf")
    if model.plant.name not in MJCF_PLANTS:
        raise ModelError(f"{model.source}: --to mjcf holds the plants {choices(MJCF_PLANTS)}; found {model.plant.name}")
    put, inertia = MJCF_PLANTS[model.plant.name]
    values = dict(model.parameters)
    own = values[inertia] if inertia else values["J"] + values["inertia"]
    parts = MjcfParts(bool(model.is_rotary), own, travel, speed, bristle=bristle)
    put(parts, values, model)
    for name, taken in model.plant.built_in.items():
        _put(parts, name, name, {n: values[n] for n in (*taken, "k") if n in values})
    for key, use in model.effects.items():
        if not is_sensor(use):
            spring = {"k": values["k"]} if "k" in values and use.type == "bouc_wen_hysteresis" else {}
            _put(parts, key, use.type, {**spring, **use.parameters})
    parts.lost += refuse_sensors(model)
    return parts


def _put(parts: MjcfParts, key: str, type: str, values: dict[str, float]) -> None:
    """Put one effect into the parts, or say why it is lost."""
    own = origin(find_effect(type, "effects"))
    if own != "the catalogue":
        parts.lost.append(
            f"{key}: a law of your own ({own}); MJCF has its own laws only (c, fmu and casadi hold yours)"
        )
        return
    if type not in MJCF_LAWS:
        parts.lost.append(f"{key}: MJCF has no element for it")
        return
    try:
        parts.holds.append(f"{key}: {MJCF_LAWS[type](parts, values, key)}")
    except LostError as error:
        parts.lost.append(f"{key}: {error}")
        parts.unheld.append(key)


class Mjcf(Target):
    """MJCF: joint, actuator and passive elements; MuJoCo runs it."""

    name, suffix, engine = "mjcf", ".xml", "mujoco"

    def write(self, model: Model, out: Path, drive: ExportedDrive) -> Exported:
        """Write the file; integrator, time step and free stiffnesses are those that run best on ``drive``."""
        ours = reference(model, drive)
        speed = ours[model.plant.velocity]
        where = model.plant.position
        path = ours[where] if where in model.states else np.cumsum(speed) * np.median(np.diff(drive.t))
        sizes = (float(np.std(path)) or 1.0, float(np.sqrt(np.mean(speed**2))))
        parts, setting, found = _best(model, sizes, drive, ours)
        said, settings = _said(model, parts, setting, found, drive, speed)
        text = document(model.plant.name, parts, setting, [*_comment(model, parts), *said])
        out.write_text(text, encoding="utf-8")
        return Exported((out,), (f"{model.plant.name}: {parts.kind}", *parts.holds), tuple(parts.lost), settings)

    def run(self, exported: Exported, model: Model, drive: ExportedDrive) -> dict[str, Array]:
        """Step it in MuJoCo."""
        parts = parts_of(model, 1.0, 1.0)
        return run(exported.files[0].read_text(encoding="utf-8"), parts, model, drive)


def _error(model: Model, parts: MjcfParts, setting: Setting, drive: ExportedDrive, speed: Array) -> float:
    """Return how far a setting is off: RMS of the speed relative to that of our exact model; inf where it diverges."""
    result = run(document("trial", parts, setting, []), parts, model, drive)[model.plant.velocity]
    with np.errstate(all="ignore"):
        error = float(np.sqrt(np.mean((result - speed) ** 2) / np.mean(speed**2)))
    return error if np.isfinite(error) else np.inf


def _best(
    model: Model, sizes: tuple[float, float], drive: ExportedDrive, path: Trajectory
) -> tuple[MjcfParts, Setting, float | None]:
    """Return the first setting that is good, from the longest step on, else the best; None: it was not run."""
    tried = [parts_of(model, *sizes)]
    if tried[0].bristle_is_free:
        tried += [parts_of(model, *sizes, bristle=b) for b in STIFFER[1:]]
    tried += [_with_nearest(p, model, path) for p in tried if p.unheld]
    step, speed = float(np.median(np.diff(drive.t))), path[model.plant.velocity]
    best: tuple[float, MjcfParts, Setting] = (np.inf, tried[0], Setting("implicitfast", min(TIMESTEPS[0], step)))
    try:
        for timestep in TIMESTEPS:
            before = best[0]
            for integrator in INTEGRATORS:
                for parts in tried:
                    setting = Setting(integrator, min(timestep, step))
                    error = _error(model, parts, setting, drive, speed)
                    if error < MAX_BETTER_RATIO * best[0]:
                        best = (error, parts, setting)
                    if error <= MAX_GOOD_LOSS:
                        return parts, setting, error
            if before < np.inf and best[0] == before:
                break  # a shorter step is not worth its time
    except NotRunError:
        return tried[0], Setting("Euler", TIMESTEPS[3]), None
    return best[1], best[2], best[0]


def _with_nearest(parts: MjcfParts, model: Model, path: Trajectory) -> MjcfParts:
    """Return parts in which dry and viscous friction stand for what is not held, as they come nearest on this run."""
    found = copy.deepcopy(parts)
    for key in parts.unheld:
        if key not in model.effects:
            continue
        mu, b = nearest_friction(model, key, path)
        found.frictionloss += mu
        found.damping[0] += b
        if mu or b:
            found.lost.append(f"{key}: frictionloss {mu:.3g} and damping {b:.3g} stand for it, nearest on this run")
    return found


def _said(
    model: Model, parts: MjcfParts, setting: Setting, found: float | None, drive: ExportedDrive, speed: Array
) -> tuple[list[str], dict[str, str]]:
    """Return comments on the chosen setting, and on others that would be wrong without a warning."""
    settings = {
        "integrator": setting.integrator,
        "timestep in s": f"{setting.timestep:g}",
        "MuJoCo": f">= {parts.needs}",
    }
    if parts.control != 1.0:
        settings["ctrl"] = f"{parts.control:.8g} x {model.inputs[0]}"
    if found is None:
        return ["integrator and timestep were not tried: mujoco is not installed"], settings
    lines = [f"with {setting.integrator} at {setting.timestep:g} s the speed is {100 * found:.2g} % off (RMS)"]
    for other in INTEGRATORS:
        if other == setting.integrator:
            continue
        error = _error(model, parts, replace(setting, integrator=other), drive, speed)
        if error > max(TRAP, 2 * found):
            how = "diverges" if not np.isfinite(error) else f"is {100 * error:.0f} % off, without a warning"
            lines.append(f"keep this integrator: {other} at the same step {how}")
            settings[f"not {other}"] = how
    if setting.timestep < TIMESTEPS[0]:
        error = _error(model, parts, replace(setting, timestep=TIMESTEPS[0]), drive, speed)
        how = "diverges" if not np.isfinite(error) else f"is {100 * error:.2g} % off"
        lines.append(f"keep this step: {setting.integrator} at {TIMESTEPS[0]:g} s {how}")
    return lines, settings


def _comment(model: Model, parts: MjcfParts) -> list[str]:
    """Return the header comment of the file."""
    lines = heading(model, "A joint and its actuator for MuJoCo; for a robot of yours take joint, actuator and option.")
    lines.append(f"needs MuJoCo {parts.needs} or later; ctrl[0] is {model.inputs[0]}")
    lines += parts.notes
    lines += [f"held: {line}" for line in parts.holds] + [f"lost: {line}" for line in parts.lost]
    lines.append("numbers:")
    lines += [f"  {line}" for line in table_of_parameters(model)]
    known = ranges(model)
    if known:
        lines.append("ranges for randomisation (two standard deviations either way):")
        lines += [f"  {name}: {low:.6g} to {high:.6g}" for name, (low, high) in known.items()]
    return lines


TARGET = Mjcf()

__all__ = ["TARGET", "Mjcf", "parts_of"]
