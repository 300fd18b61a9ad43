"""Models as files for other tools, run there, with what is lost on the way measured.

    result = export(Model.load("dc_motor"), "mjcf", "motor.xml")
    result = export(model, "fmu", "motor.fmu", data=read_for_model("run.csv", model))
    result.holds, result.lost, result.loss

A target is one file of this package and a line in `TARGETS`. Those that hold equations (c, fmu, casadi ...) are made
from the recorded equations; those that hold laws of their own (mjcf, bam ...) get the numbers of those laws, and the
difference is measured.
"""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from signlin_ros.errors import InputError, ModelError, choices, suggest
from signlin_ros.export.base import Array, Exported, ExportedDrive, Target
from signlin_ros.export.excitation import STATED, standard_excitation
from signlin_ros.export.loss import Loss, drive_of, measure
from signlin_ros.model import Model
from signlin_ros.model.arm import ArmModel
from signlin_ros.records import ModelData

TARGETS = {
    "mjcf": "mjcf",
    "c": "c",
    "fmu": "fmu",
    "python-control": "python_control",
    "casadi": "casadi_model",
    "do-mpc": "do_mpc_model",
    "sympy": "sympy_model",
    "urdf": "urdf",
    "sdf": "sdf",
    "bam": "bam",
    "isaaclab": "isaaclab",
}
"""Every target and the module that writes it."""


@dataclass(frozen=True)
class Export:
    """An exported model: where it stands, what it holds, what is lost, and the loss as measured on ``driven_by``."""

    target: str
    exported: Exported
    loss: Loss
    driven_by: str
    smooth: bool

    def content(self) -> dict[str, Any]:
        """Return the JSON of `signlin export`."""
        return {
            "target": self.target,
            "files": [str(path) for path in self.exported.files],
            "holds": list(self.exported.holds),
            "lost": list(self.exported.lost),
            "loss": {name: vars(channel) for name, channel in self.loss.channels.items()},
            "against": self.loss.against,
            "driven_by": self.driven_by,
            "settings": dict(self.exported.settings),
            "not_run": self.loss.not_run,
        }


def find_target(name: str) -> Target:
    """Return a target by its name; raise `InputError` for an unknown one."""
    if name not in TARGETS:
        raise InputError(f"--to {name}: unknown target; known: {choices(TARGETS)}{suggest(name, TARGETS)}")
    found: Target = importlib.import_module(f"{__name__}.{TARGETS[name]}").TARGET
    return found


def export(model: Model, target: str, out: str | Path, data: ModelData | None = None) -> Export:
    """Write a model for a target and measure there what is lost.

    The run is driven by a record's inputs, or by a stated standard excitation. Raises `InputError` for an unknown
    target or a path that cannot be written, `ModelError` for a model that the target cannot hold. What is known of the
    record (a gain, a mass) is in the file.
    """
    found, path = find_target(target), Path(out)
    if path.suffix != found.suffix:
        raise InputError(f"{path}: --to {target} writes {found.suffix}")
    if not path.parent.is_dir():
        raise InputError(f"{path}: there is no folder {path.parent}")
    if isinstance(model, ArmModel):
        return _arm_export(model, target, found, path, data)
    if model.plant.velocity not in (*model.states, *model.inputs):
        raise ModelError(f"{model.source}: export takes a drive of one moving mass; {model.plant.name} has several")
    if data is not None:
        model = model.under(data.conditions)
        if model.is_rotary is None and model.turns(data.units):
            model = model.with_options(axis="rotary")  # the units of the record say so
    drive = standard_excitation(model) if data is None else drive_of(model, data)
    exported, loss = _written(found, model, path, drive, None if data is None else data.measured)
    return Export(target, exported, loss, STATED if data is None else data.source, found.smooth)


def _arm_export(model: ArmModel, target: str, own: Target, path: Path, data: ModelData | None) -> Export:
    """Return the export of an arm, run on a stated motion: efforts of a record alone soon lead anywhere."""
    from signlin_ros.export.arm import DRIVEN, arm_target, motion_drive

    found = arm_target(target, own)
    if data is not None:
        raise InputError(f"--data: is not taken for an arm; the file is run on {DRIVEN}")
    exported, loss = _written(found, model, path, motion_drive(model))
    return Export(target, exported, loss, DRIVEN, found.smooth)


def _written(
    target: Target, model: Model, path: Path, drive: ExportedDrive, measured: Mapping[str, Array] | None = None
) -> tuple[Exported, Loss]:
    """Return the exported file, and its measured loss."""
    try:
        exported = target.write(model, path, drive)
    except OSError as error:
        raise InputError(f"cannot write {error.filename or path}: {error.strerror}") from error
    loss = measure(target, exported, model, drive, measured)
    if loss.diverges:
        why = "the run in the target diverges: the file is of no use as it is"
        exported = replace(exported, lost=(*exported.lost, why))
    return exported, loss


__all__ = ["TARGETS", "Export", "export", "find_target"]
