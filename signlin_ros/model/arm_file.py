"""What only the model file of an arm has: the robot, its couplings and payload, and a section for each joint."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from signlin_ros.errors import ModelError, choices, suggest
from signlin_ros.robots import Robot, read_urdf
from signlin_ros.robots.inertia import about_centre

KEYS = ("robot", "joints", "locked", "gravity", "inertia", "payload", "couplings")
"""Keys of the file beside those that every plant has and the joints' names."""
SECTION = ("effort", "parameters", "effects")
"""Keys of a joint's section."""
SIDES = ("motor", "link")
EARTH = (0.0, 0.0, -9.81)
INERTIA_TOLERANCE = 0.1
"""By how much masses, centres and inertias may be off, relative to their size, where the file does not say."""


@dataclass(frozen=True)
class Effort:
    """How a joint's effort is recorded: ``gain`` in N·m (N) per ``unit``, and on which side of the gear.

    ``delay``: seconds by which it is recorded later than the motion.
    """

    gain: float = 1.0
    unit: str = ""
    side: str = "motor"
    delay: float = 0.0


@dataclass(frozen=True)
class Coupling:
    """Motors that several joints share: their positions from those of the joints, row-major, in the joints' order."""

    joints: tuple[str, ...]
    position: tuple[float, ...]
    effort: str = "joint"

    @property
    def matrix(self) -> NDArray[np.float64]:
        """The matrix (k, k) with 1 on its diagonal: each motor counted in turns of its own joint."""
        rows = np.array(self.position).reshape(len(self.joints), -1)
        return np.asarray(rows / np.diag(rows)[:, None])

    def ratio(self, joint: str) -> float:
        """Return how often a joint's own motor turns for one turn of the joint, or one m."""
        at = self.joints.index(joint)
        return self.position[at * (len(self.joints) + 1)]


@dataclass(frozen=True)
class Payload:
    """A body on a link: mass in kg, centre of mass (3,) in m in the link's frame; how well each is known (std)."""

    on: str
    m: float = 0.0
    com: tuple[float, ...] = (0.0, 0.0, 0.0)
    tolerance: tuple[tuple[str, float], ...] = ()

    @property
    def free(self) -> bool:
        """Whether a fit may move it."""
        return any(value > 0.0 for _, value in self.tolerance)


@dataclass(frozen=True)
class ArmFile:
    """The part of a model file that describes the arm; all of it hashable.

    ``at_joint``: keys of effects that act on a joint where a coupling parts it from its motor.
    """

    robot: str
    joints: tuple[str, ...] = ()
    locked: tuple[tuple[str, float], ...] = ()
    gravity: tuple[float, ...] = EARTH
    tolerance: float = INERTIA_TOLERANCE
    consistent: bool = True
    payload: Payload | None = None
    couplings: tuple[tuple[str, Coupling], ...] = ()
    efforts: tuple[tuple[str, Effort], ...] = field(default=())
    at_joint: tuple[str, ...] = ()

    @property
    def is_text(self) -> bool:
        """Whether the robot is the text of a URDF, as ``/robot_description`` has it, and no file."""
        return self.robot.lstrip().startswith("<")

    def unloaded(self, folder: Path) -> Robot:
        """Return the robot of the URDF without the payload."""
        source = self.robot if self.is_text else folder / self.robot
        return read_urdf(source, self.joints or None, dict(self.locked), self.gravity)

    def loaded(self, robot: Robot) -> Robot:
        """Return the robot with the payload on it."""
        if self.payload is None:
            return robot
        body = about_centre(self.payload.m, self.payload.com, np.zeros((3, 3)))
        return robot.with_body(self.payload.on, body)

    def motors(self, names: Sequence[str]) -> NDArray[np.float64]:
        """Return the motors' coordinates from those of the joints (n, n)."""
        P = np.eye(len(names))
        for key, coupling in self.couplings:
            for name in coupling.joints:
                if name not in names:
                    raise ModelError(f"couplings.{key}.joints: no joint {name!r}; there are: {choices(names)}")
            at = [names.index(name) for name in coupling.joints]
            P[np.ix_(at, at)] = coupling.matrix
        return P

    def at_motor(self, names: Sequence[str]) -> tuple[bool, ...]:
        """Return of which joints the effort is that of the motor of a coupling."""
        own = {name for _, coupling in self.couplings if coupling.effort == "motor" for name in coupling.joints}
        return tuple(name in own for name in names)

    def written(self) -> dict[str, Any]:
        """Return the keys of the file that are not at their defaults, without the joints' sections."""
        found: dict[str, Any] = {"robot": self.robot}
        if self.joints:
            found["joints"] = list(self.joints)
        if self.locked:
            found["locked"] = dict(self.locked)
        if self.gravity != EARTH:
            found["gravity"] = list(self.gravity)
        if (self.tolerance, self.consistent) != (INERTIA_TOLERANCE, True):
            found["inertia"] = {"tolerance": self.tolerance, "consistent": self.consistent}
        if self.payload is not None:
            p = self.payload
            found["payload"] = {"on": p.on, "m": p.m, "com": list(p.com)}
            found["payload"] |= {"tolerance": dict(p.tolerance)} if p.tolerance else {}
        if self.couplings:
            found["couplings"] = {
                key: {
                    "joints": list(c.joints),
                    "position": list(c.position),
                    **({"effort": "motor"} if c.effort == "motor" else {}),
                }
                for key, c in self.couplings
            }
        return found


def arm_file(mapping: Mapping[str, Any], folder: Path) -> tuple[ArmFile, Robot]:
    """Return the arm of a model file, and its robot without the payload; raise `ModelError` on any fault."""
    if "robot" not in mapping:
        raise ModelError("robot: missing; allowed: the URDF of the arm, relative to the model file")
    robot = mapping["robot"]
    if not isinstance(robot, str) or not robot:
        raise ModelError(f"robot: found {robot!r}; allowed: the name of a URDF, relative to the model file")
    inertia = _table(mapping.get("inertia"), "inertia", ("tolerance", "consistent"))
    consistent = inertia.get("consistent", True)
    if not isinstance(consistent, bool):
        raise ModelError(f"inertia.consistent: found {consistent!r}; allowed: true or false")
    gravity = mapping.get("gravity", EARTH)
    file = ArmFile(
        robot=robot,
        joints=_names(mapping.get("joints", ()), "joints"),
        locked=tuple(
            (name, _number(v, f"locked.{name}")) for name, v in _table(mapping.get("locked"), "locked").items()
        ),
        gravity=_numbers(gravity, "gravity", 3),
        tolerance=_number(inertia.get("tolerance", INERTIA_TOLERANCE), "inertia.tolerance", 0.0),
        consistent=consistent,
        payload=_payload(mapping.get("payload")),
        couplings=tuple(
            (str(k), _coupling(v, f"couplings.{k}")) for k, v in _table(mapping.get("couplings"), "couplings").items()
        ),
    )
    found = file.unloaded(folder)
    for name in found.names:
        if "." in name:
            raise ModelError(f"joints: {name!r}: a joint's name must not have a dot: ROS parts names there")
    return file, found


def effort_of(value: Any, where: str, own_unit: str) -> Effort:
    """Return how a joint's effort is recorded; ``own_unit`` is N·m, or N of a prismatic joint."""
    given = _table(value, where, ("gain", "unit", "side", "delay", "measured"))
    side = given.get("side", "motor")
    if side not in SIDES:
        raise ModelError(f"{where}.side: found {side!r}; allowed: {', '.join(SIDES)}")
    unit = given.get("unit", "A" if "gain" in given else own_unit)
    if unit != own_unit and "gain" not in given:
        raise ModelError(f"{where}.gain: missing; an effort in {unit} needs its {own_unit} per {unit}")
    gain = _number(given.get("gain", 1.0), f"{where}.gain")
    if gain == 0.0:
        raise ModelError(f"{where}.gain: found 0; allowed: a number other than 0, {own_unit} per {unit}")
    return Effort(gain, str(unit), side, _number(given.get("delay", 0.0), f"{where}.delay"))


def _payload(value: Any) -> Payload | None:
    if value is None:
        return None
    if isinstance(value, Mapping):  # YAML reads a bare `on` as true
        value = {"on" if key is True else key: item for key, item in value.items()}
    given = _table(value, "payload", ("on", "m", "com", "tolerance"))
    if not isinstance(given.get("on"), str):
        raise ModelError(f"payload.on: found {given.get('on')!r}; allowed: the name of a link")
    said = given.get("tolerance", {})
    table = {"m": said} if isinstance(said, (int, float)) else _table(said, "payload.tolerance", ("m", "com"))
    tolerance = tuple((n, _number(v, f"payload.tolerance.{n}", 0.0)) for n, v in table.items())
    com = _numbers(given.get("com", (0.0, 0.0, 0.0)), "payload.com", 3)
    return Payload(given["on"], _number(given.get("m", 0.0), "payload.m", 0.0), com, tolerance)


def _coupling(value: Any, where: str) -> Coupling:
    given = _table(value, where, ("joints", "position", "effort"))
    names = _names(given.get("joints", ()), f"{where}.joints")
    rows = given.get("position", ())
    flat = [x for row in rows for x in (row if isinstance(row, (list, tuple)) else [row])]
    if len(names) < 2:
        raise ModelError(f"{where}.joints: found {list(names)}; allowed: two joints or more")
    matrix = _numbers(flat, f"{where}.position", len(names) ** 2)
    square = np.array(matrix).reshape(len(names), -1)
    if (np.diag(square) == 0.0).any() or abs(np.linalg.det(square / np.diag(square)[:, None])) < 1e-6:
        raise ModelError(f"{where}.position: the motors do not move the joints independently: {square.tolist()}")
    effort = given.get("effort", "joint")
    if effort not in ("joint", "motor"):
        raise ModelError(f"{where}.effort: found {effort!r}; allowed: joint, motor")
    return Coupling(names, matrix, effort)


def _table(value: Any, where: str, known: Sequence[str] | None = None) -> dict[str, Any]:
    if value is None:
        return {}
    if not isinstance(value, Mapping):
        raise ModelError(f"{where}: found {value!r}; allowed: a mapping" + (f" of {choices(known)}" if known else ""))
    for key in value if known else ():
        if key not in (known or ()):
            raise ModelError(
                f"{where}.{key}: unknown key; known: {choices(known or ())}{suggest(str(key), known or ())}"
            )
    return {str(key): item for key, item in value.items()}


def _names(value: Any, where: str) -> tuple[str, ...]:
    if not isinstance(value, (list, tuple)) or not all(isinstance(item, str) for item in value):
        raise ModelError(f"{where}: found {value!r}; allowed: a list of names of joints")
    if len(set(value)) < len(value):
        raise ModelError(f"{where}: a name is given twice")
    return tuple(value)


def _number(value: Any, where: str, low: float = -math.inf) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value) or value < low:
        raise ModelError(
            f"{where}: found {value!r}; allowed: a finite number" + (f" from {low:g} on" if low > -math.inf else "")
        )
    return float(value)


def _numbers(value: Any, where: str, count: int) -> tuple[float, ...]:
    if hasattr(value, "tolist"):  # arrays, of ROS and of NumPy
        value = value.tolist()
    if not isinstance(value, (list, tuple)) or len(value) != count:
        raise ModelError(f"{where}: found {value!r}; allowed: {count} numbers")
    return tuple(_number(item, where) for item in value)


__all__ = ["KEYS", "SECTION", "ArmFile", "Coupling", "Effort", "Payload", "arm_file", "effort_of"]
