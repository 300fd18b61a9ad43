"""A URDF with other inertial parameters, those of a joint's body in its link and none in what is fixed to that; or with
friction in its joints.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from signlin_ros.robots.inertia import inertia_matrix, moved
from signlin_ros.robots.urdf import Robot

Array = NDArray[np.float64]


def with_inertias(text: str, robot: Robot, pi: Array) -> str:
    """Return the text of a URDF in which the bodies of a robot have the parameters pi (10 n,)."""
    root = ET.fromstring(text, parser=ET.XMLParser(target=ET.TreeBuilder(insert_comments=True)))
    carried = {link: joint for link, (joint, _, _) in robot.frames.items() if joint >= 0}
    own = {joint.link: body for joint, body in zip(robot.joints, pi.reshape(robot.n, -1), strict=True)}
    for link in root.findall("link"):
        name = str(link.get("name"))
        if name not in carried:
            continue
        for old in link.findall("inertial"):
            link.remove(old)
        if name in own:
            link.insert(0, _inertial(own[name]))
    ET.indent(root)
    return '<?xml version="1.0"?>\n' + ET.tostring(root, encoding="unicode") + "\n"


def with_dynamics(text: str, values: Mapping[str, tuple[float, float]]) -> str:
    """Return the text of a URDF in which joints have a damping (N·m·s/rad, N·s/m) and a dry friction (N·m, N)."""
    root = ET.fromstring(text, parser=ET.XMLParser(target=ET.TreeBuilder(insert_comments=True)))
    for joint in root.findall("joint"):
        if joint.get("name") not in values:
            continue
        for old in joint.findall("dynamics"):
            joint.remove(old)
        damping, friction = values[str(joint.get("name"))]
        ET.SubElement(joint, "dynamics", damping=repr(damping), friction=repr(friction))
    ET.indent(root)
    return '<?xml version="1.0"?>\n' + ET.tostring(root, encoding="unicode") + "\n"


def _inertial(pi: Array) -> ET.Element:
    m = float(pi[0])
    centre = pi[1:4] / m if m > 0.0 else np.zeros(3)
    about = inertia_matrix(moved(pi, np.eye(3), -centre))
    element = ET.Element("inertial")
    ET.SubElement(element, "origin", xyz=" ".join(repr(float(v)) for v in centre), rpy="0 0 0")
    ET.SubElement(element, "mass", value=repr(m))
    names = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    values = about[np.triu_indices(3)]
    ET.SubElement(element, "inertia", {name: repr(float(v)) for name, v in zip(names, values, strict=True)})
    return element


__all__ = ["with_dynamics", "with_inertias"]
