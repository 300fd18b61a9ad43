"""An Isaac Lab actuator configuration: BAM's where it holds more, else a PD drive with joint friction."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from signlin_ros.export.bam import bench_of, loop_of, numbers_of
from signlin_ros.export.bam_program import BAM_STEP, carried, inertia_and_weight
from signlin_ros.export.base import Array, Exported, ExportedDrive, Target
from signlin_ros.export.lines import number
from signlin_ros.export.python_text import docstring, loaded, names_of, numbers
from signlin_ros.model import Model


class IsaacLab(Target):
    """A Python file that defines ``CFG``; run by a program of the equations that Isaac Lab documents."""

    name, suffix, engine = "isaaclab", ".py", "a program of the published equations"

    def write(self, model: Model, out: Path, drive: ExportedDrive) -> Exported:
        """Write the file; `DATA` in it are the same numbers without Isaac Lab."""
        found, variant, holds, lost = numbers_of(model, self.name)
        loop = loop_of(model)
        p = model.parameters
        per_volt = p["K_t"] / p["R"] * p["vin"]
        simple = {
            "stiffness": per_volt * p["duty_per_error"] * p["kp"],
            "damping": per_volt * p["duty_per_error"] * p["kd"] + p["K_t"] ** 2 / p["R"],
            "effort_limit": per_volt * p["duty_limit"],
            "friction": found["friction_base"],
            "viscous_friction": found["friction_viscous"],
            "armature": found["armature"],
        }
        if p["kd"]:
            lost = [line for line in lost if not line.startswith("kd:")]
        bam = variant != "m1"
        data: dict[str, Any] = {**found, **loop, "variant": variant}
        if not bam:
            data = {**simple, "q_offset": p["q0"], "variant": "pd"}
        rows = [f"    {k!r}: {v!r}," if isinstance(v, str) else f"    {k!r}: {number(v)}," for k, v in data.items()]
        text = [
            docstring(model, "An actuator for Isaac Lab: CFG goes into ArticulationCfg.actuators."),
            numbers(model, smooth=False),
            names_of(model),
            "\n".join(["DATA = {  # SI units", *rows, "}", f"BENCH = {bench_of(model)!r}"]),
            _bam_cfg(found, loop) if bam else _implicit_cfg(simple),
        ]
        out.write_text("\n\n".join(text), encoding="utf-8")
        if not bam:
            lost.append("damping holds the back-EMF, K_t²/R: the effort limit clips it, too")
        return Exported(
            (out,), tuple(holds), tuple(lost), {"class": "BamActuatorCfg" if bam else "ImplicitActuatorCfg"}
        )

    def run(self, exported: Exported, model: Model, drive: ExportedDrive) -> dict[str, Array]:
        """Run the numbers of the file."""
        file = loaded(exported.files[0])
        data, ends = file["DATA"], file["BENCH"]
        late = ExportedDrive(drive.t, drive.u, drive.acts + model.delay, drive.x0)
        position, speed = carried(data, late, ends) if data["variant"] != "pd" else _pd(data, late, ends)
        return {"position": position, "speed": speed}


def _pd(p: dict[str, float], drive: ExportedDrive, ends: dict[str, float]) -> tuple[Array, Array]:
    """Return position and speed (T,) of a PD drive whose effort is limited, with dry and viscous friction."""
    inertia, weight = inertia_and_weight(p, ends)
    q, w = float(drive.x0[0]), float(drive.x0[1])
    found = np.empty((drive.t.size, 2))
    found[0] = q, w
    for k, span in enumerate(np.diff(drive.t).tolist()):
        count = max(1, math.ceil(span / BAM_STEP))
        h = span / count
        for goal in drive.input_at(drive.t[k] + h * np.arange(count))[:, 0].tolist():
            effort = p["stiffness"] * (goal - q) - p["damping"] * w
            effort = max(-p["effort_limit"], min(p["effort_limit"], effort))
            moving = effort - weight * math.sin(q - p["q_offset"]) - p["viscous_friction"] * w
            stopping = -inertia * w / h - moving
            w += h * (moving + max(-p["friction"], min(p["friction"], stopping))) / inertia
            q += h * w
        found[k + 1] = q, w
    return found[:, 0], found[:, 1]


def _implicit_cfg(simple: dict[str, float]) -> str:
    rows = {**simple, "effort_limit_sim": simple["effort_limit"], "dynamic_friction": simple["friction"]}
    del rows["effort_limit"]
    inner = "\n".join(f"        {name}={number(value)}," for name, value in rows.items())
    return _guarded(f'ImplicitActuatorCfg(\n        joint_names_expr=[".*"],\n{inner}\n    )', "ImplicitActuatorCfg")


def _bam_cfg(found: dict[str, float], loop: dict[str, float]) -> str:
    skipped = ("armature", "q_offset", "command_delay")
    inner = "\n".join(f"            {n!r}: {number(v)}," for n, v in found.items() if n not in skipped)
    given = [name for name in ("error_gain", "max_pwm", "max_current") if name in loop]
    more = "".join(f"\n            {name!r}: {number(loop[name])}," for name in given)
    text = (
        'BamActuatorCfg(\n        joint_names_expr=[".*"],\n'
        f"        kp_fw={number(loop['kp'])},\n        vin={number(loop['vin'])},\n"
        f"        armature={number(found['armature'])},\n"
        f"        parameter_overrides={{\n{inner}{more}\n        }},\n    )"
    )
    return _guarded(text, "BamActuatorCfg")


def _guarded(text: str, name: str) -> str:
    return (
        f"try:\n    from isaaclab.actuators import {name}\nexcept ImportError:  # the numbers can be read without it\n"
        f"    CFG = None\nelse:\n    CFG = {text}\n"
    )


TARGET = IsaacLab()

__all__ = ["TARGET", "IsaacLab"]
