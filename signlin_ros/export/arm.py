"""Arms as files for other tools: their rigid body, and as much of each joint's friction as the tool has a law for."""

from __future__ import annotations

import importlib.util
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from signlin_ros.errors import InputError, ModelError
from signlin_ros.export.base import Array, Exported, ExportedDrive, NotRunError, Target, heading
from signlin_ros.linearization import Linearizer
from signlin_ros.model import Model
from signlin_ros.model.arm import ArmModel
from signlin_ros.model.uses import is_sensor
from signlin_ros.plants.arm import GAIN_PARAMETER, MOTOR_INERTIA, parted
from signlin_ros.robots import mass_matrix
from signlin_ros.robots.inertia import inertia_matrix, moved
from signlin_ros.robots.urdf import Joint
from signlin_ros.robots.write import with_dynamics, with_inertias

LASTS, HOLD_STEP = 2.0, 0.005
"""Seconds of the motion that an exported arm is run on, and from one value of its efforts to the next."""
RUN_TRAVEL = {False: 0.25, True: 0.02}
"""How far a joint goes to either side of the middle of that motion: rad, m of a prismatic joint."""
SLOWEST_TONE, FASTER = 0.5, 0.1
"""Hz of the first joint, and how much faster each next one is."""
DRIVEN = f"the efforts of a smooth motion of {LASTS:g} s from the initial state, by inverse dynamics"
MUJOCO_STEP = 1e-3
"""Step of MuJoCo in s."""
REFUSED_TARGETS = {
    "c": "writes drives of one mass",
    "fmu": "writes drives of one mass",
    "do-mpc": "writes drives of one mass; casadi holds an arm",
    "sympy": "formulas of several joints fill pages; casadi holds them",
    "sdf": "holds one joint; urdf holds an arm",
    "bam": "is of servos",
    "isaaclab": "is of one actuator; urdf holds an arm's damping and friction",
}
"""Why a target does not take arms."""


def arm_target(name: str, own: Target) -> Target:
    """Return the target of arms by its name; raise `InputError` for one that holds none."""
    if name in REFUSED_TARGETS:
        raise InputError(f"--to {name}: does not take an arm ({REFUSED_TARGETS[name]}); arms: {', '.join(_TAKEN)}")
    return {"urdf": ArmUrdf(), "mjcf": ArmMjcf()}.get(name, own)


_TAKEN = ("casadi", "mjcf", "python-control", "urdf")


def motion_drive(model: ArmModel) -> ExportedDrive:
    """Return efforts that move all joints smoothly from the initial state, friction included."""
    t, n = np.arange(0.0, LASTS, HOLD_STEP), model.robot.n
    _check_inertia(model)
    x0, linear = np.array(model.x0), Linearizer(model)
    size = np.array([_travel(joint, float(x0[i])) for i, joint in enumerate(model.robot.joints)])
    w = 2.0 * np.pi * (SLOWEST_TONE + FASTER * np.arange(n))
    angle = w * t[:, None]
    q, v, a = size * (1.0 - np.cos(angle)), size * w * np.sin(angle), size * w**2 * np.cos(angle)
    x = np.tile(x0, (t.size, 1))
    x[:, :n] += q
    x[:, n : 2 * n] = v
    found = linear.batch(x, np.zeros((t.size, n)))
    free = (np.einsum("tij,tj->ti", found.A, x) + found.c)[:, n : 2 * n]
    u = np.linalg.solve(found.B[:, n : 2 * n], (a - free)[..., None])[..., 0]
    x0[n : 2 * n] = 0.0
    return ExportedDrive(t, u, t, x0)


def _check_inertia(model: ArmModel) -> None:
    """Raise `ModelError` where a joint carries no inertia: nothing then says how it accelerates."""
    plant, n = model.arm_plant, model.robot.n
    motors = np.array([model.parameters[f"{name}.{MOTOR_INERTIA}"] for name in model.robot.names])
    M = mass_matrix(model.robot, np.array(model.x0)[None, :n])[0] + plant.motors.T @ np.diag(motors) @ plant.motors
    values, vectors = np.linalg.eigh(M)
    if values[0] <= MIN_EXPORTED_INERTIA * values[-1]:
        name = model.robot.names[int(np.argmax(np.abs(vectors[:, 0])))]
        said = f"{name} carries no inertia; give it a motor_inertia, or refine the model first"
        raise ModelError(f"{model.source}: {said}")


MIN_EXPORTED_INERTIA = 1e-9
"""Part of the largest eigenvalue of a mass matrix below which the smallest one is nothing."""


def _travel(joint: Joint, at: float) -> float:
    """Return half the travel of a joint in its motion, to that side of its place on which its limits leave room."""
    limits = dict(joint.limits)
    low, high = limits.get("lower", -np.inf), limits.get("upper", np.inf)
    side = 1.0 if high - at >= at - low else -1.0
    room = max(high - at, at - low) if high > low else np.inf
    return side * min(RUN_TRAVEL[joint.prismatic], 0.4 * room)


@dataclass
class JointParts:
    """What a file holds of an arm: damping, dry friction and motor inertia in the places of effects (K,)."""

    damping: Array
    friction: Array
    armature: Array
    holds: list[str] = field(default_factory=list)
    lost: list[str] = field(default_factory=list)


def parts_of(model: ArmModel) -> JointParts:
    """Return damping, dry friction and motor inertia of a model by joint, and the losses."""
    plant, n = model.arm_plant, model.robot.n
    K = len(plant.places)
    parts = JointParts(np.zeros(K), np.zeros(K), np.zeros(K))
    parts.armature[:n] = [model.parameters[f"{name}.{MOTOR_INERTIA}"] for name in model.robot.names]
    for key, use in model.effects.items():
        i, p = plant.place_of(key), use.parameters
        if is_sensor(use):
            parts.lost.append(f"{key}: what a sensor shows; the file holds true values")
        elif use.type in _HELD:
            damping, friction, rest = _HELD[use.type]
            parts.damping[i] += np.mean([p[name] for name in damping]) if damping else 0.0
            parts.friction[i] += p[friction] if friction else 0.0
            whole = " and ".join(w for w, there in (("damping", damping), ("dry friction", friction)) if there)
            parts.holds.append(f"{key}: {whole}")
            if rest:
                parts.lost.append(f"{key}: {rest}")
        else:
            parts.lost.append(f"{key}: a joint there has damping and dry friction only")
    return parts


_HELD: dict[str, tuple[tuple[str, ...], str, str]] = {
    "viscous_friction": (("b",), "", ""),
    "coulomb_friction": ((), "mu", ""),
    "stribeck_friction": ((), "mu", "what is above Coulomb friction at low speed"),
    "cubic_viscous_friction": (("b",), "", "its cubic part"),
    "asymmetric_viscous_friction": (("b_p", "b_n"), "", "the difference of the directions"),
}
"""By effect: parameters that are damping, the one that is dry friction, and what is lost of it."""


def _urdf_text(model: ArmModel) -> str:
    arm = model.arm
    return arm.robot if arm.is_text else (model.folder / arm.robot).read_text(encoding="utf-8")


class ArmUrdf(Target):
    """The arm's own URDF with the friction of the model in it, and with its payload in the link that carries it."""

    name, suffix, engine = "urdf", ".urdf", "mujoco, with our efforts on the joints"

    def write(self, model: Model, out: Path, drive: ExportedDrive) -> Exported:
        """Write the file: damping and friction of every joint, all else as it was."""
        arm = _arm(model)
        parts = parts_of(arm)
        n = arm.robot.n
        text = _urdf_text(arm)
        if arm.arm.payload is not None and arm.arm.payload.m > 0.0:
            text = with_inertias(text, arm.robot, arm.robot.pi)
        pairs = zip(arm.robot.names, parts.damping[:n], parts.friction[:n], strict=True)
        values = {name: (float(b), float(mu)) for name, b, mu in pairs}
        out.write_text(with_dynamics(text, values), encoding="utf-8")
        lost = [*parts.lost, *_coupled(arm)]
        with_rotor = [name for name, a in zip(arm.robot.names, parts.armature, strict=False) if a > 0.0]
        if with_rotor:
            lost.append(f"motor inertia of {', '.join(with_rotor)}: URDF has none")
        if any(arm.parameters[f"{name}.{GAIN_PARAMETER}"] != 1.0 for name in arm.robot.names):
            lost.append("gains: a URDF's efforts are N·m (N)")
        return Exported((out,), ("rigid body, limits and meshes as they were", *parts.holds), tuple(lost))

    def run(self, exported: Exported, model: Model, drive: ExportedDrive) -> dict[str, Array]:
        """Load it in MuJoCo without meshes, and put the efforts on its joints."""
        arm = _arm(model)
        root = ET.fromstring(exported.files[0].read_text(encoding="utf-8"))
        for link in root.findall("link"):
            for drawn in [*link.findall("visual"), *link.findall("collision")]:
                link.remove(drawn)
        compiler = {"balanceinertia": "false", "fusestatic": "true", "discardvisual": "true"}
        ET.SubElement(ET.SubElement(root, "mujoco"), "compiler", compiler)
        return stepped(ET.tostring(root, encoding="unicode"), arm, drive)


class ArmMjcf(Target):
    """MJCF: a body for each joint, with damping, dry friction and motor inertia; motors with the model's gains."""

    name, suffix, engine = "mjcf", ".xml", "mujoco"

    def write(self, model: Model, out: Path, drive: ExportedDrive) -> Exported:
        """Write the file."""
        arm = _arm(model)
        parts = parts_of(arm)
        out.write_text(_document(arm, parts), encoding="utf-8")
        holds = ["rigid body with its payload, motor inertias, gains"]
        if arm.arm.couplings:
            holds.append("couplings: tendons that carry the motors' friction and inertia")
        return Exported((out,), (*holds, *parts.holds), tuple(parts.lost))

    def run(self, exported: Exported, model: Model, drive: ExportedDrive) -> dict[str, Array]:
        """Step it in MuJoCo."""
        return stepped(exported.files[0].read_text(encoding="utf-8"), _arm(model), drive)


def _arm(model: Model) -> ArmModel:
    assert isinstance(model, ArmModel)  # noqa: S101 - for the type checker
    return model


def _coupled(model: ArmModel) -> Iterator[str]:
    for key, coupling in model.arm.couplings:
        yield f"couplings.{key}: friction and inertia of motors that turn with {' and '.join(coupling.joints)}"


def _text(values: Any) -> str:
    return " ".join(repr(float(v)) for v in np.ravel(values))


def _document(model: ArmModel, parts: JointParts) -> str:
    """Return the text of the MJCF."""
    robot = model.robot
    root = ET.Element("mujoco", model=robot.name or "arm")
    said = [*heading(model, "An arm for MuJoCo."), *(f"lost: {line}" for line in parts.lost)]
    root.append(ET.Comment("\n  " + "\n  ".join(said).replace("--", "- -") + "\n"))
    ET.SubElement(root, "compiler", angle="radian")
    ET.SubElement(root, "option", timestep=repr(MUJOCO_STEP), integrator="implicitfast", gravity=_text(robot.gravity))
    bodies: dict[int, ET.Element] = {-1: ET.SubElement(root, "worldbody")}
    coupled = {i for i in range(robot.n) if np.count_nonzero(model.arm_plant.motors[:, i]) > 1}
    coupled |= set(parted(model.arm_plant.motors))
    for i in robot.sequence:
        joint = robot.joints[i]
        bodies[i] = _body(bodies[joint.parent], joint, None if i in coupled else (parts, i))
    if coupled:
        _tendons(root, model, parts, coupled)
    actuators = ET.SubElement(root, "actuator")
    for i, name in enumerate(robot.names):
        gear = repr(model.parameters[f"{name}.{GAIN_PARAMETER}"])
        place = {"tendon": f"{name}_motor"} if model.arm_plant.at_motor[i] else {"joint": name}
        ET.SubElement(actuators, "motor", {"name": name, "gear": gear, **place})
    ET.indent(root)
    return ET.tostring(root, encoding="unicode") + "\n"


def _body(parent: ET.Element, joint: Joint, own: tuple[JointParts, int] | None) -> ET.Element:
    """Return the body of a joint with its inertia; ``own``: friction and motor inertia of the joint itself."""
    x, y, z, w = Rotation.from_matrix(joint.R).as_quat()
    body = ET.SubElement(parent, "body", name=joint.link, pos=_text(joint.p), quat=_text([w, x, y, z]))
    m = float(joint.pi[0])
    centre = joint.pi[1:4] / m if m > 0.0 else np.zeros(3)
    I = inertia_matrix(moved(joint.pi, np.eye(3), -centre))  # noqa: E741 - the field's letter
    full = _text([I[0, 0], I[1, 1], I[2, 2], I[0, 1], I[0, 2], I[1, 2]])
    ET.SubElement(body, "inertial", pos=_text(centre), mass=repr(max(m, MIN_EXPORTED_MASS)), fullinertia=full)
    limits = dict(joint.limits)
    more = {}
    if limits.get("upper", 0.0) > limits.get("lower", 0.0):
        more["range"] = _text([limits["lower"], limits["upper"]])
    if own is not None:
        parts, i = own
        values = {"damping": parts.damping[i], "frictionloss": parts.friction[i], "armature": parts.armature[i]}
        more |= {name: repr(float(value)) for name, value in values.items()}
    kind = "slide" if joint.prismatic else "hinge"
    ET.SubElement(body, "joint", {"name": joint.name, "type": kind, "axis": _text(joint.axis), **more})
    return body


MIN_EXPORTED_MASS = 1e-6
"""kg of a body that has no mass: MuJoCo takes no moving body without."""


def _tendons(root: ET.Element, model: ArmModel, parts: JointParts, coupled: set[int]) -> None:
    """Add the motors of a coupling as tendons, and the friction of joints that are parted from theirs."""
    names, tendons = model.robot.names, ET.SubElement(root, "tendon")
    for k, row in enumerate(model.arm_plant.places):
        if k < len(names) and k not in coupled:
            continue
        called = f"{names[k]}_motor" if k < len(names) else f"{names[int(np.flatnonzero(row)[0])]}_joint"
        values = {"damping": parts.damping[k], "frictionloss": parts.friction[k], "armature": parts.armature[k]}
        more = {name: repr(float(value)) for name, value in values.items()}
        tendon = ET.SubElement(tendons, "fixed", {"name": called, **more})
        for i in np.flatnonzero(row):
            ET.SubElement(tendon, "joint", joint=names[int(i)], coef=repr(float(row[i])))


def stepped(text: str, model: ArmModel, drive: ExportedDrive) -> dict[str, Array]:
    """Return the states (T,) by name of a file stepped in MuJoCo, efforts held; NaN from where it diverges on.

    Motors of the file are driven where it has any, else the joints. Raises `NotRunError` without mujoco.
    """
    if importlib.util.find_spec("mujoco") is None:
        raise NotRunError('mujoco is not installed (pip install "signlin_ros[export]")')
    import mujoco

    try:
        mj = mujoco.MjModel.from_xml_string(text)
    except ValueError as error:
        raise NotRunError(f"MuJoCo {mujoco.__version__} does not load it: {error}") from error
    mj.opt.timestep, mj.opt.gravity[:] = MUJOCO_STEP, model.robot.gravity
    mj.opt.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    data, names = mujoco.MjData(mj), model.robot.names
    joints = [mujoco.mj_name2id(mj, mujoco.mjtObj.mjOBJ_JOINT, name) for name in names]
    q_at, v_at = mj.jnt_qposadr[joints], mj.jnt_dofadr[joints]
    n = len(names)
    data.qpos[q_at], data.qvel[v_at] = drive.x0[:n], drive.x0[n : 2 * n]
    gains = np.array([model.parameters[f"{name}.{GAIN_PARAMETER}"] for name in names])
    acting = np.where(np.array(model.arm_plant.at_motor)[None, :], model.arm_plant.motors.T, np.eye(n))
    found = np.full((drive.t.size, 2 * n), np.nan)
    every = max(1, round(float(np.median(np.diff(drive.t))) / MUJOCO_STEP))
    for k, u in enumerate(drive.u):
        found[k] = [*data.qpos[q_at], *data.qvel[v_at]]
        if mj.nu:
            data.ctrl[:] = u
        else:
            data.qfrc_applied[v_at] = acting @ (gains * u)
        mujoco.mj_step(mj, data, every)
        if data.time < (k + 0.5) * every * MUJOCO_STEP:  # a step back in time: it was reset
            break
    return {name: found[:, i] for i, name in enumerate(model.states[: 2 * n])}


__all__ = ["DRIVEN", "REFUSED_TARGETS", "ArmMjcf", "ArmUrdf", "arm_target", "motion_drive", "parts_of"]
