"""SDFormat: a model of two links and a joint with damping, friction and a linear spring."""

from __future__ import annotations

from pathlib import Path
from xml.sax.saxutils import quoteattr

from signlin_ros.export.base import Array, Exported, ExportedDrive, NotRunError, Target
from signlin_ros.export.urdf import comment, plain
from signlin_ros.model import Model


class Sdf(Target):
    """An SDF 1.10 file."""

    name, suffix, engine = "sdf", ".sdf", "none"

    def write(self, model: Model, out: Path, drive: ExportedDrive) -> Exported:
        """Write the file; what drives the joint is for a plugin and lost."""
        parts, holds, lost = plain(model)
        spring = [line for line in lost if line.startswith("linear_stiffness:")]
        lost = [line for line in lost if line not in spring]
        holds += ["linear_stiffness: spring_stiffness"] if spring else []
        lost.append(f"what {model.inputs[0]} does: SDF has no actuator (a plugin commands force or position)")
        J = repr(parts.inertia)
        load = parts.load or {"mass": "0.001" if parts.hinge else J, "pos": "0 0 0"}
        dynamics = {"damping": parts.damping[0], "friction": parts.frictionloss, "spring_reference": 0.0}
        dynamics["spring_stiffness"] = parts.stiffness[0]
        inner = "".join(f"<{name}>{value!r}</{name}>" for name, value in dynamics.items())
        axis = "0 1 0" if parts.load else "0 0 1"
        text = "\n".join(
            [
                '<?xml version="1.0"?>',
                comment(model, "A joint for SDF: damping in N·m·s/rad (N·s/m), friction in N·m (N).", lost),
                '<sdf version="1.10">',
                f"  <model name={quoteattr(model.plant.name)}>",
                '    <link name="base"/>',
                '    <link name="rotor">',
                f"      <inertial><pose>{load['pos']} 0 0 0</pose><mass>{load['mass']}</mass>",
                f"        <inertia><ixx>{J}</ixx><iyy>{J}</iyy><izz>{J}</izz></inertia></inertial>",
                "    </link>",
                '    <joint name="fixed" type="fixed"><parent>world</parent><child>base</child></joint>',
                f'    <joint name="joint" type="{"revolute" if parts.hinge else "prismatic"}">',
                "      <parent>base</parent><child>rotor</child>",
                f"      <axis><xyz>{axis}</xyz><dynamics>{inner}</dynamics></axis>",
                "    </joint>",
                "  </model>",
                "</sdf>",
                "",
            ]
        )
        out.write_text(text, encoding="utf-8")
        return Exported((out,), tuple(holds), tuple(lost))

    def run(self, exported: Exported, model: Model, drive: ExportedDrive) -> dict[str, Array]:
        """Say why it is not run."""
        raise NotRunError("Gazebo has no Python package to run it with")


TARGET = Sdf()

__all__ = ["TARGET", "Sdf"]
