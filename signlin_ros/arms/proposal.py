"""From an estimate to a model file: effects, motors' inertias, couplings, payload, and a URDF whose bodies exist."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from signlin_ros.arms.consistent import POSITIVE, consistent, existing
from signlin_ros.arms.fit import CoefficientEstimate
from signlin_ros.arms.keys import GAIN, Key
from signlin_ros.arms.laws import BY_EFFECT, WORKED_OUT
from signlin_ros.arms.search import State
from signlin_ros.arms.study import Study
from signlin_ros.effects import find_effect
from signlin_ros.model.arm import ArmModel
from signlin_ros.model.arm_file import Coupling, Payload
from signlin_ros.plants.arm import MOTOR_INERTIA, parted
from signlin_ros.recording.arm import MAX_UNNAMED_SPEED
from signlin_ros.robots.write import with_inertias

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Proposal:
    """A model and the text of the URDF that it goes with."""

    model: ArmModel
    urdf: str


def proposal(study: Study, state: State, estimate: CoefficientEstimate) -> Proposal:
    """Return the model that an estimate says, the robot's bodies made consistent where the file asks for that."""
    model, robot = study.model, study.robot
    estimate, bodies = _bodies(study, state, estimate)
    values = dict(zip(estimate.design.names, estimate.theta.tolist(), strict=True))
    urdf = with_inertias(model.urdf, robot, bodies)
    motors = state.rows.pieces[0].motors[: robot.n]
    content = {
        **{k: v for k, v in model.to_dict().items() if k not in robot.names and k != "couplings"},
        **_couplings(study, motors),
        **_payload(study, values),
        **_ranges(study, state, values),
        "robot": urdf,
    }
    for i, name in enumerate(robot.names):
        content[name] = _section(study, state, values, i, parted(motors))
    return Proposal(ArmModel.from_dict(content, model.source, model.folder), urdf)


def _bodies(study: Study, state: State, estimate: CoefficientEstimate) -> tuple[CoefficientEstimate, Array]:
    """Return an estimate, and the bodies (10 n,) of its links beside what they carry; they exist where the file asks.

    A payload is written as a point, so its links are what is left beside the inertia of that.
    """
    start, carried = study.robot.pi, study.carried
    asked, found = study.model.arm.consistent, estimate
    for _ in range(CONSISTENT_ROUNDS if "payload.m" in estimate.design.names else 1):
        found = replace(estimate, theta=consistent(estimate, start, carried + state.point(found), asked))
    for key in (key for key, _ in state.terms if key.law == GAIN):
        found = _as_it_is(found, key.at)
    bodies = found.pi - carried - state.point(found)
    return found, existing(bodies) if asked else bodies


def _as_it_is(estimate: CoefficientEstimate, i: int) -> CoefficientEstimate:
    """Return an estimate in which what a joint has of its own fits its effort as it was recorded, bodies as they are.

    That is of an effort which hardly shows what acts, whose gain no file holds.
    """
    names = np.array(estimate.design.names)
    gains = np.char.endswith(names, GAIN)
    own = np.char.startswith(names, f"{i}.") & ~gains
    rows, theta = estimate.rows.joint == i, estimate.theta.copy()
    X, beside = estimate.design.known[rows], ~own & ~gains
    least = np.where([name.endswith(POSITIVE) for name in names[own]], 0.0, -np.inf)
    left = estimate.rows.y[rows] - X[:, beside] @ theta[beside]
    theta[own] = lsq_linear(X[:, own], left, (least, np.inf)).x
    return replace(estimate, theta=theta)


CONSISTENT_ROUNDS = 3
"""Times that links are made consistent beside a payload, which moves a little with them."""


def placed(proposal: Proposal, output: str | Path) -> tuple[str, str, Path]:
    """Return the text of the model file and of its URDF, and the URDF's path: beside the file, of the same name."""
    path = Path(output).with_suffix(".urdf")
    model = proposal.model.placed_in(Path(output).parent)
    return replace(model, arm=replace(model.arm, robot=path.name)).to_yaml(), proposal.urdf, path


def _couplings(study: Study, motors: Array) -> dict[str, object]:
    """Return the couplings of the file, and one for each that was found."""
    known = dict(study.model.arm.written().get("couplings", {}))
    before = study.model.arm_plant.motors
    for j in (j for j in parted(motors) if not np.array_equal(motors[j], before[j])):
        pair = sorted(np.flatnonzero(motors[j]).tolist())
        names = tuple(study.names[i] for i in pair)
        rows = motors[np.ix_(pair, pair)]
        known[f"{names[0]}_{names[1]}"] = {
            "joints": list(names),
            "position": Coupling(names, tuple(rows.ravel())).position,
        }
    return (
        {"couplings": {k: {**v, "position": [float(x) for x in v["position"]]} for k, v in known.items()}}
        if known
        else {}
    )


def _payload(study: Study, values: dict[str, float]) -> dict[str, object]:
    """Return the payload of the file with what was found of it."""
    if "payload.m" not in values:
        return {}
    before = study.model.arm.payload or Payload(study.payload_link)
    m = before.m + values["payload.m"]
    moment = before.m * np.array(before.com) + [values[f"payload.{n}"] for n in ("mx", "my", "mz")]
    com = moment / m if m > 0.0 else np.zeros(3)
    return {"payload": {"on": before.on, "m": max(m, 0.0), "com": [float(v) for v in com]}}


def _ranges(study: Study, state: State, values: dict[str, float]) -> dict[str, object]:
    """Return the range of the velocities, with those recorded of joints whose friction would drive them at the URDF's.

    Friction that grows more slowly than speed is told where the record was; beyond, its cube takes over.
    """
    found = dict(study.model.operating_range)
    for key in (key for key, _ in state.terms if key.law == "cubic_viscous_friction" and key.at < study.robot.n):
        joint, b, b3 = study.robot.joints[key.at], values[f"{key.at}.viscous_friction.b"], values[f"{key.at}.{key.law}"]
        most = dict(joint.limits).get("velocity") or MAX_UNNAMED_SPEED
        if b + b3 * most**2 < 0.0:
            fastest = max(float(np.abs(piece.v[:, key.at]).max()) for piece in (*study.rows.pieces, *study.new.pieces))
            found.setdefault(f"{joint.name}.velocity", fastest)
    return {"operating_range": found} if found else {}


def _section(study: Study, state: State, values: dict[str, float], i: int, parted_: list[int]) -> dict[str, object]:
    """Return the section of a joint: its effort as it was, its motor's inertia, its effects."""
    name = study.names[i]
    before = study.model.to_dict().get(name, {})
    found: dict[str, object] = {key: before[key] for key in ("effort",) if key in before}
    inertia = max(values.get(f"{i}.motor_inertia", float(state.inertias[i])), 0.0)
    if inertia > 0.0:
        found["parameters"] = {MOTOR_INERTIA: inertia}
    effects = {k: v for k, v in before.get("effects", {}).items() if v.get("type", k) not in WORKED_OUT}
    places: list[tuple[int, str, dict[str, str]]] = [(i, "", {})]
    if i in parted_:
        places.append((len(study.names) + parted_.index(i), "joint_", {"at": "joint"}))
    for place, prefix, at in places:
        for effect, own in effects_at(state, values, place).items():
            more = {"type": effect} if prefix else {}
            effects[f"{prefix}{effect}"] = {**more, **own, **at}
    if effects:
        found["effects"] = effects
    return found


def effects_at(state: State, values: dict[str, float], place: int) -> dict[str, dict[str, float]]:
    """Return the effects in one place with their parameters, richer ones in the place of what they contain."""
    b, mu, load = (values.get(f"{place}.{name}", 0.0) for name in _BASIC)
    keys = [key for key, law in state.terms if law is not None and key.at == place]
    found: dict[str, dict[str, float]] = {}
    for key in keys:
        found[key.law] = _parameters(key, values[f"{key.at}.{key.law}"], b, mu)
    names = {key.law for key in keys}
    if not names & {"cubic_viscous_friction", "asymmetric_viscous_friction"} and b > 0.0:
        found["viscous_friction"] = {"b": b}
    if "stribeck_friction" not in names and mu > 0.0:
        found["coulomb_friction"] = {"mu": mu}
    if load:
        found["constant_load"] = {"F0": load}
    return {effect: _allowed(effect, own) for effect, own in found.items()}


_BASIC = ("viscous_friction.b", "coulomb_friction.mu", "constant_load.F0")


def _parameters(key: Key, value: float, b: float, mu: float) -> dict[str, float]:
    if key.law == "stribeck_friction":
        return {"mu": mu, "excess": value, "v_s": key.shape}
    if key.law == "cubic_viscous_friction":
        return {"b": b, "b3": value}
    if key.law == "power_law_friction":
        return {"c": value, "a": key.shape}
    if key.law == "asymmetric_viscous_friction":
        return {"b_p": b + value, "b_n": b - value}
    if key.law == "load_dependent_friction":
        return {"kappa_d": 0.0, "kappa_e": value}
    return {BY_EFFECT[key.law].linear: value}


def _allowed(effect: str, values: dict[str, float]) -> dict[str, float]:
    """Return parameters within the bounds of their declarations."""
    pars = find_effect(effect, "effects").pars()
    return {name: pars[name].nearest(value) for name, value in values.items()}


def basic_of(study: Study, estimate: CoefficientEstimate, i: int, names: Sequence[str]) -> dict[str, float]:
    """Return viscous and Coulomb friction, offset and motor's inertia of a joint, as its own velocity sees them.

    Viscous friction of a motor that turns with this joint, too, counts with it.
    """
    P = estimate.rows.pieces[0].motors
    values = dict(zip(estimate.design.names, estimate.theta.tolist(), strict=True))
    viscous = sum(float(P[k, i] ** 2) * values.get(f"{k}.viscous_friction.b", 0.0) for k in range(len(P)))
    coulomb = values.get(f"{i}.coulomb_friction.mu", 0.0)
    extra = [k for k in range(len(names), len(P)) if P[k, i]]
    coulomb += sum(values.get(f"{k}.coulomb_friction.mu", 0.0) for k in extra)
    inertia = values.get(f"{i}.motor_inertia", 0.0)
    return {
        "viscous": viscous,
        "coulomb": coulomb,
        "offset": values.get(f"{i}.constant_load.F0", 0.0),
        "motor_inertia": inertia,
    }


__all__ = ["Proposal", "basic_of", "effects_at", "placed", "proposal"]
