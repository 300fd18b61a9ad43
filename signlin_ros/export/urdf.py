"""URDF: a joint with damping and friction, its inertia and limits; run in MuJoCo, which reads URDF."""

from __future__ import annotations

import importlib.util
import tempfile
from pathlib import Path
from xml.sax.saxutils import quoteattr

from signlin_ros.export.base import Array, Exported, ExportedDrive, NotRunError, Target, heading, table_of_parameters
from signlin_ros.export.mjcf import parts_of
from signlin_ros.export.mjcf_parts import MjcfParts, tag
from signlin_ros.export.mjcf_run import run
from signlin_ros.model import Model

URDF_STEP = 1e-3
"""Step in s of the run."""


def plain(model: Model) -> tuple[MjcfParts, list[str], list[str]]:
    """Return a joint of which damping and dry friction are all, what it holds, and what is lost."""
    parts = parts_of(model, 1.0, 1.0)
    of_the_drive = ("sag:", "current_limit:", "profile_time:", "input ", "K_m")
    holds, lost = [f"{model.plant.name}: inertia"], [s for s in parts.lost if not s.startswith(of_the_drive)]
    for line in parts.holds:
        key = line.split(":")[0]
        what = line.split(": ", 1)[1]
        word = next((w for w in ("damping", "frictionloss") if what.startswith(w)), "")
        whole = "second" not in what and "third" not in what
        if word and whole:
            holds.append(f"{key}: {'friction' if word == 'frictionloss' else word}")
        else:
            lost.append(f"{key}: a joint's dynamics are damping and friction only")
    return parts, holds, lost


def comment(model: Model, what: str, lost: list[str]) -> str:
    """Return a comment with the numbers of a model and what is lost."""
    lines = heading(model, what) + [f"lost: {line}" for line in lost]
    lines += table_of_parameters(model)
    inner = "\n".join(f"  {line}" for line in lines).replace("--", "- -")
    return f"<!--\n{inner}\n-->"


class Urdf(Target):
    """A URDF file of two links and a joint."""

    name, suffix, engine = "urdf", ".urdf", "mujoco, with our actuator beside the file"

    def write(self, model: Model, out: Path, drive: ExportedDrive) -> Exported:
        """Write the file; what drives the joint is for a controller and lost."""
        parts, holds, lost = plain(model)
        lost.append(f"what {model.inputs[0]} does: URDF has no actuator (ros2_control commands effort or position)")
        kind = "continuous" if parts.hinge else "prismatic"
        J = repr(parts.inertia)
        load = parts.load or {"mass": "0.001" if parts.hinge else J, "pos": "0 0 0"}
        inertia = {"ixx": J, "iyy": J, "izz": J, "ixy": "0", "ixz": "0", "iyz": "0"}
        limit = '<limit lower="-1e3" upper="1e3" effort="1e6" velocity="1e6"/>' if kind == "prismatic" else ""
        dynamics = tag("dynamics", {"damping": repr(parts.damping[0]), "friction": repr(parts.frictionloss)})
        axis = "0 1 0" if parts.load else "0 0 1"
        text = "\n".join(
            [
                '<?xml version="1.0"?>',
                comment(model, "A joint for URDF: damping in N·m·s/rad (N·s/m), friction in N·m (N).", lost),
                f"<robot name={quoteattr(model.plant.name)}>",
                '  <link name="base"/>',
                '  <link name="rotor">',
                "    <inertial>",
                f"      {tag('origin', {'xyz': load['pos']})}{tag('mass', {'value': load['mass']})}",
                f"      {tag('inertia', inertia)}",
                "    </inertial>",
                "  </link>",
                f'  <joint name="joint" type="{kind}">',
                f'    <parent link="base"/><child link="rotor"/><axis xyz="{axis}"/>',
                f"    {limit}{dynamics}",
                "  </joint>",
                "</robot>",
                "",
            ]
        )
        out.write_text(text, encoding="utf-8")
        return Exported((out,), tuple(holds), tuple(lost))

    def run(self, exported: Exported, model: Model, drive: ExportedDrive) -> dict[str, Array]:
        """Load it in MuJoCo, put the actuator of our MJCF beside it, and step it."""
        if importlib.util.find_spec("mujoco") is None:
            raise NotRunError('mujoco is not installed (pip install "signlin_ros[export]")')
        parts, _, _ = plain(model)
        import mujoco

        loaded = mujoco.MjModel.from_xml_string(exported.files[0].read_text(encoding="utf-8"))
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "m.xml"
            mujoco.mj_saveLastXML(str(path), loaded)
            text = path.read_text(encoding="utf-8")
        motor = {k: v for k, v in parts.motor.items() if k not in ("lugre", "cogging", "thermal")}
        actuator = tag(parts.kind, {"name": "drive", "joint": "joint", **motor})
        down = f"0 0 {-parts.gravity!r}" if parts.gravity else "0 0 0"
        option = tag("option", {"timestep": repr(URDF_STEP), "integrator": "implicitfast", "gravity": down})
        text = text.replace("</mujoco>", f"{option}<actuator>{actuator}</actuator></mujoco>")
        parts.delay, parts.second = 0.0, None
        return run(text, parts, model, drive)


TARGET = Urdf()

__all__ = ["TARGET", "Urdf", "comment", "plain"]
