"""A URDF with other inertial parameters, those of a joint's body in its link and none in what is fixed to that; or with
friction in its joints.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from signlin_ros.robots.inertia import inertia_matrix, moved
from signlin_ros.robots.urdf import Robot, locked_at, origin_of

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


def with_zeros(text: str, offsets: Mapping[str, float]) -> str:
    """Return the text of a URDF in which joints stand by some rad (m) farther at every position, and as far at limits.

    A joint's origin is turned about its axis, or moved along it; limits of the position are moved back.
    """
    root = ET.fromstring(text, parser=ET.XMLParser(target=ET.TreeBuilder(insert_comments=True)))
    for joint in root.findall("joint"):
        if joint.get("name") not in offsets:
            continue
        offset = offsets[str(joint.get("name"))]
        (R, p), (turned, along) = origin_of(joint), locked_at(joint, offset)
        for old in joint.findall("origin"):
            joint.remove(old)
        joint.insert(0, ET.Element("origin", xyz=_written(p + R @ along), rpy=_written(roll_pitch_yaw(R @ turned))))
        for limit in joint.findall("limit"):
            for end in ("lower", "upper"):
                if limit.get(end) is not None:
                    limit.set(end, repr(float(str(limit.get(end))) - offset))
    ET.indent(root)
    return '<?xml version="1.0"?>\n' + ET.tostring(root, encoding="unicode") + "\n"


def roll_pitch_yaw(R: Array) -> Array:
    """Return roll, pitch and yaw (3,) of a rotation matrix (3, 3)."""
    pitch = np.arctan2(-R[2, 0], np.hypot(R[0, 0], R[1, 0]))
    if np.hypot(R[0, 0], R[1, 0]) < UPRIGHT:
        return np.array([np.arctan2(-R[1, 2], R[1, 1]), pitch, 0.0])
    return np.array([np.arctan2(R[2, 1], R[2, 2]), pitch, np.arctan2(R[1, 0], R[0, 0])])


UPRIGHT = 1e-9
"""Cosine of a pitch below which only the difference of roll and yaw is known."""


def _written(values: Array) -> str:
    return " ".join(repr(float(v)) for v in values)


def _inertial(pi: Array) -> ET.Element:
    m = float(pi[0])
    centre = pi[1:4] / m if m > 0.0 else np.zeros(3)
    about = inertia_matrix(moved(pi, np.eye(3), -centre))
    element = ET.Element("inertial")
    ET.SubElement(element, "origin", xyz=_written(centre), rpy="0 0 0")
    ET.SubElement(element, "mass", value=repr(m))
    names = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    values = about[np.triu_indices(3)]
    ET.SubElement(element, "inertia", {name: repr(float(v)) for name, v in zip(names, values, strict=True)})
    return element


__all__ = ["with_dynamics", "with_inertias", "with_zeros"]
