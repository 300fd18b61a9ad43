"""A robot out of a URDF: moving joints in a tree, each with the rigid body that it carries.

Fixed joints are merged, and so are joints that are not asked for, at the positions where they are locked. A joint that
mimics another one is refused where it would have to move, and so is a base that floats.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from signlin_ros.errors import ModelError, choices, suggest
from signlin_ros.robots.inertia import TEN, about_centre, least_eigenvalue, moved, skew

Array = NDArray[np.float64]
MOVING_JOINTS = ("revolute", "continuous", "prismatic")
"""Types of joints that have one degree of freedom."""
FREE_JOINTS = ("floating", "planar")
"""Types of joints that have more."""
ROTATION_TOLERANCE = 1e-13
"""How far an entry of a rotation may be from a whole number, by rounding."""
INCONSISTENT = 1e-9
"""Part of the largest eigenvalue by which a pseudo-inertia may be negative, by rounding."""


@dataclass(frozen=True, eq=False)
class Joint:
    """A moving joint: its place in the parent's frame, its axis, and the body that it carries.

    ``parent`` is the index of the moving joint before it, -1 the base; R (3, 3) and p (3,) place its frame in the
    parent's; ``axis`` (3,) in its own; ``pi`` (10,) are the parameters of its body (`signlin_ros.robots.inertia`).
    """

    name: str
    link: str
    parent: int
    R: Array
    p: Array
    axis: Array
    prismatic: bool
    pi: Array
    limits: tuple[tuple[str, float], ...] = ()

    @property
    def effort_unit(self) -> str:
        """Unit of the force or torque along the joint."""
        return "N" if self.prismatic else "N·m"

    @property
    def position_unit(self) -> str:
        """Unit of the joint's position."""
        return "m" if self.prismatic else "rad"


@dataclass(frozen=True, eq=False)
class Robot:
    """A tree of joints, in the order of whoever asked for them, and gravity (3,) in the frame of the base.

    ``sequence`` has their places, parents first. ``frames`` says of every link which joint carries it, and how it
    stands in that joint's frame.
    """

    name: str
    joints: tuple[Joint, ...]
    gravity: Array
    frames: Mapping[str, tuple[int, Array, Array]]
    sequence: tuple[int, ...]

    @property
    def n(self) -> int:
        """Number of joints that move."""
        return len(self.joints)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the joints."""
        return tuple(joint.name for joint in self.joints)

    @property
    def pi(self) -> Array:
        """The inertial parameters (10 n,) of all bodies."""
        return np.concatenate([joint.pi for joint in self.joints])

    def with_pi(self, pi: Array) -> Robot:
        """Return the robot with other inertial parameters (10 n,)."""
        bodies = np.asarray(pi, dtype=float).reshape(-1, TEN)
        return replace(self, joints=tuple(replace(j, pi=b) for j, b in zip(self.joints, bodies, strict=True)))

    def with_body(self, link: str, pi: Array) -> Robot:
        """Return the robot with one more body (10,), given in the frame of a link."""
        at, R, t = self.frame(link)
        if at < 0:
            raise ModelError(f"payload.on: {link!r} does not move; there are: {choices(self.moving_links)}")
        joints = list(self.joints)
        joints[at] = replace(joints[at], pi=joints[at].pi + moved(pi, R, t))
        return replace(self, joints=tuple(joints))

    def frame(self, link: str) -> tuple[int, Array, Array]:
        """Return which joint carries a link, and the rotation and translation of its frame in the joint's."""
        if link not in self.frames:
            raise ModelError(
                f"payload.on: no link {link!r}; there are: {choices(self.frames)}{suggest(link, self.frames)}"
            )
        return self.frames[link]

    @property
    def moving_links(self) -> tuple[str, ...]:
        """Names of the links that a moving joint carries."""
        return tuple(name for name, (at, _, _) in self.frames.items() if at >= 0)

    def inconsistent(self) -> dict[str, float]:
        """Return the joints whose body cannot exist, and the smallest eigenvalue of its pseudo-inertia."""
        found = {}
        for joint in self.joints:
            least = least_eigenvalue(joint.pi)
            if least < -INCONSISTENT * max(np.abs(joint.pi).max(), 1e-12):
                found[joint.name] = least
        return found


def rotation(rpy: Array) -> Array:
    """Return the rotation matrix (3, 3) of roll, pitch and yaw (3,)."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(rpy), np.sin(rpy)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def exact(a: Array) -> Array:
    """Return an array whose entries that are within `ROTATION_TOLERANCE` of a whole number are that number."""
    near = np.round(a)
    return np.asarray(np.where(np.abs(a - near) < ROTATION_TOLERANCE, near, a) + 0.0)


def read_urdf(
    source: str | Path,
    joints: Sequence[str] | None = None,
    locked: Mapping[str, float] | None = None,
    gravity: Sequence[float] = (0.0, 0.0, -9.81),
) -> Robot:
    """Return the robot of a URDF.

    Parameters
    ----------
    source : the file, or the text of one (as ``/robot_description`` has it).
    joints : the joints that move, in the order of the answer; without it all that can, in that of the tree.
    locked : positions (rad, m) of joints that do not move; 0 where none is given.
    gravity : (3,) m/s² in the frame of the base.

    Raises
    ------
    ModelError
        No such file, no URDF, a joint that is not there, that mimics another one, or more than one root.
    """
    text, name = _text(source)
    try:
        root = ET.fromstring(text)
    except ET.ParseError as error:
        raise ModelError(f"robot: {name}: not an XML file ({error})") from error
    if root.tag != "robot":
        raise ModelError(f"robot: {name}: the outermost element is <{root.tag}>; allowed: <robot>, a URDF")
    reader = _Reader(root, name, joints, dict(locked or {}))
    return reader.robot(np.asarray(gravity, dtype=float))


def _text(source: str | Path) -> tuple[str, str]:
    if isinstance(source, str) and source.lstrip().startswith("<"):
        return source, "robot_description"
    try:
        return Path(source).read_text(encoding="utf-8"), str(source)
    except (OSError, UnicodeDecodeError) as error:
        if str(source).startswith("/") and not Path(source).suffix and not Path(source).exists():
            said = "a node reads it from this topic; here a file is needed, e.g. written by ros2 topic echo --once"
            raise ModelError(f"robot: {source} is no file: {said}") from error
        raise ModelError(f"robot: {source}: {getattr(error, 'strerror', None) or error}") from error


class _Reader:
    """Walks the tree of a URDF from its root."""

    def __init__(
        self, root: ET.Element, source: str, joints: Sequence[str] | None, locked: Mapping[str, float]
    ) -> None:
        self.source, self.locked, self.title = source, locked, root.get("name", "robot")
        self.links = {str(link.get("name")): _body(link, source) for link in root.findall("link")}
        self.elements = [j for j in root.findall("joint") if j.find("parent") is not None]
        self.below: dict[str, list[ET.Element]] = {}
        for element in self.elements:
            self.below.setdefault(_end(element, "parent", source), []).append(element)
        can = {str(e.get("name")): e for e in self.elements if e.get("type") in MOVING_JOINTS}
        free = [n for n, e in can.items() if e.find("mimic") is None and n not in locked]
        self.moving = list(free if joints is None else joints)
        for name in (*self.moving, *locked):
            if name not in can:
                raise ModelError(
                    f"joints: {source} has no joint {name!r} that moves; it has: {choices(can)}{suggest(name, can)}"
                )
        for name in self.moving:
            self._check_mimic(name, can[name])
        if not self.moving:
            raise ModelError(f"robot: {source}: no joint moves")
        self.joints: list[Joint] = []
        self.frames: dict[str, tuple[int, Array, Array]] = {}

    def _check_mimic(self, name: str, element: ET.Element) -> None:
        mimic = element.find("mimic")
        if mimic is not None:
            other = mimic.get("joint")
            said = f"{name!r} mimics {other!r}: one motor moves both, which is not supported"
            raise ModelError(f"joints: {self.source}: {said}; leave it out of joints and it is locked")

    def robot(self, gravity: Array) -> Robot:
        """Return the robot."""
        children = {_end(e, "child", self.source) for e in self.elements}
        tops = [name for name in self.links if name not in children]
        if len(tops) != 1:
            raise ModelError(f"robot: {self.source}: found {len(tops)} root links ({choices(tops)}); allowed: one")
        self._walk(tops[0], -1, np.eye(3), np.zeros(3))
        lost = [name for name in self.moving if name not in [j.name for j in self.joints]]
        if lost:
            raise ModelError(f"robot: {self.source}: {', '.join(lost)} hang on no root link")
        for element in self.elements:
            mimic = element.find("mimic") if element.get("type") in MOVING_JOINTS else None
            if mimic is not None and mimic.get("joint") in self.moving and self._matters(element):
                own, other = element.get("name"), mimic.get("joint")
                said = f"{own!r} mimics {other!r}, which moves: one motor moves both, which is not supported"
                ways = f'leave {other!r} out, or say type="fixed" of {own!r} if what it carries is light'
                raise ModelError(f"joints: {self.source}: {said}; {ways} (a rod of a parallelogram)")
            if element.get("type") in FREE_JOINTS and self._matters(element):
                said = f"{element.get('name')!r} is {element.get('type')}: a base that moves freely is not supported"
                raise ModelError(f'robot: {self.source}: {said}; say type="fixed" if it was held')
        return self._in_order(gravity)

    def _in_order(self, gravity: Array) -> Robot:
        """Return the robot with its joints in the order that was asked for."""
        walked = [joint.name for joint in self.joints]
        place = {i: self.moving.index(name) for i, name in enumerate(walked)} | {-1: -1}
        joints = [self.joints[walked.index(name)] for name in self.moving]
        placed = tuple(replace(joint, parent=place[joint.parent]) for joint in joints)
        frames = {link: (place[at], R, t) for link, (at, R, t) in self.frames.items()}
        return Robot(self.title, placed, gravity, frames, tuple(place[i] for i in range(len(walked))))

    def _matters(self, element: ET.Element) -> bool:
        """Tell whether a joint hangs below one that moves, or one that moves below it."""
        child = _end(element, "child", self.source)
        return self.frames.get(child, (-1,))[0] >= 0 or self._carries(child)

    def _carries(self, link: str) -> bool:
        """Tell whether a joint that moves hangs below a link."""
        below = self.below.get(link, ())
        return any(e.get("name") in self.moving or self._carries(_end(e, "child", self.source)) for e in below)

    def _walk(self, link: str, at: int, R: Array, t: Array) -> None:
        """Add a link that stands at R, t in the frame of joint ``at``, and all that hangs on it."""
        if link not in self.links:
            raise ModelError(f"robot: {self.source}: a joint names the link {link!r}, which is not there")
        if link in self.frames:
            raise ModelError(f"robot: {self.source}: the link {link!r} has two parents: a loop is not supported")
        self.frames[link] = (at, R, t)
        if at >= 0:
            joint = self.joints[at]
            self.joints[at] = replace(joint, pi=joint.pi + moved(self.links[link], R, t))
        for element in self.below.get(link, ()):
            Rj, pj = origin_of(element)
            R2, t2 = exact(R @ Rj), R @ pj + t
            child, name = _end(element, "child", self.source), str(element.get("name"))
            if name in self.moving:
                self.joints.append(_joint(element, name, child, at, R2, t2, self.source))
                self._walk(child, len(self.joints) - 1, np.eye(3), np.zeros(3))
            else:
                R3, t3 = locked_at(element, self.locked.get(name, 0.0))
                self._walk(child, at, exact(R2 @ R3), R2 @ t3 + t2)


def _joint(element: ET.Element, name: str, link: str, at: int, R: Array, p: Array, source: str) -> Joint:
    limit = element.find("limit")
    given = {} if limit is None else {k: float(v) for k, v in limit.attrib.items()}
    body = np.zeros(TEN)
    return Joint(
        name, link, at, R, p, _axis(element, source), element.get("type") == "prismatic", body, tuple(given.items())
    )


def _axis(element: ET.Element, source: str = "") -> Array:
    found = element.find("axis")
    axis = np.array([1.0, 0.0, 0.0]) if found is None else _numbers(found.get("xyz"), 3)
    size = float(np.linalg.norm(axis))
    if size == 0.0:
        raise ModelError(f"robot: {source}: the axis of {element.get('name')!r} is 0 0 0")
    return exact(axis / size)


def locked_at(element: ET.Element, position: float) -> tuple[Array, Array]:
    """Return rotation and translation of a joint that is locked at a position."""
    if position == 0.0 or element.get("type") not in MOVING_JOINTS:
        return np.eye(3), np.zeros(3)
    axis = _axis(element)
    if element.get("type") == "prismatic":
        return np.eye(3), position * axis
    K = skew(axis)
    return np.eye(3) + math.sin(position) * K + (1.0 - math.cos(position)) * K @ K, np.zeros(3)


def origin_of(element: ET.Element | None) -> tuple[Array, Array]:
    """Return rotation (3, 3) and translation (3,) of an element's <origin>."""
    origin = None if element is None else element.find("origin")
    if origin is None:
        return np.eye(3), np.zeros(3)
    return exact(rotation(_numbers(origin.get("rpy"), 3))), _numbers(origin.get("xyz"), 3)


def _end(element: ET.Element, end: str, source: str) -> str:
    found = element.find(end)
    if found is None or not found.get("link"):
        raise ModelError(f"robot: {source}: joint {element.get('name')!r} has no {end} link")
    return str(found.get("link"))


def _numbers(text: str | None, count: int) -> Array:
    if not text:
        return np.zeros(count)
    try:
        values = np.array([float(v) for v in text.split()])
    except ValueError as error:
        raise ModelError(f"robot: {text!r} are no numbers (a xacro file has to be expanded first)") from error
    if values.size != count or not np.isfinite(values).all():
        raise ModelError(f"robot: found {text!r}; allowed: {count} finite numbers")
    return values


def _body(link: ET.Element, source: str) -> Array:
    """Return the ten parameters (10,) of a link in its own frame; 0 where it has no <inertial>."""
    inertial = link.find("inertial")
    if inertial is None:
        return np.zeros(TEN)
    R, xyz = origin_of(inertial)
    mass, inertia = inertial.find("mass"), inertial.find("inertia")
    if mass is None or inertia is None:
        raise ModelError(f"robot: {source}: <inertial> of link {link.get('name')!r} needs <mass> and <inertia>")
    i = {key: float(_numbers(inertia.get(key), 1)[0]) for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")}
    own = np.array([[i["ixx"], i["ixy"], i["ixz"]], [i["ixy"], i["iyy"], i["iyz"]], [i["ixz"], i["iyz"], i["izz"]]])
    return about_centre(float(_numbers(mass.get("value"), 1)[0]), xyz, R @ own @ R.T)


__all__ = [
    "MOVING_JOINTS",
    "ROTATION_TOLERANCE",
    "Joint",
    "Robot",
    "exact",
    "locked_at",
    "origin_of",
    "read_urdf",
    "rotation",
]
