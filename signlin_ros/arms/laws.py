"""What an arm may lack, as columns of a regression: effects of the catalogue in each joint, and laws of the robot.

A column is the force of an effect's own `force` with one parameter 1 and the others 0: no law is written twice. The
load that friction depends on is that of the model, never the measured effort: |effort| sign(v) is the effort itself
wherever friction is most of it, and "explains" anything, on validation data too.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from signlin_ros.arms.piece import ArmSegment, RegressionRows
from signlin_ros.effects import find_effect
from signlin_ros.par import as_law_sees
from signlin_ros.robots import Robot, inverse_dynamics
from signlin_ros.robots.inertia import TEN, moved

Array = NDArray[np.float64]
SHAPE_VALUES = 6
"""Values of a parameter that does not enter linearly, of which each is tried."""
POWERS = (0.3, 0.4, 0.5, 0.6, 0.7, 0.8)
"""Powers of a velocity that are tried."""
ZERO_STEP, MIN_EFFORT_SHARE = 1e-3, 1e-6
"""rad (m) by which a position is moved to see what that needs; part of all efforts that is none."""
MIN_SHAPE_SHARE, MAX_SHAPE_SHARE = 0.01, 0.5
"""The smallest and the largest of them, as a part of the joint's largest velocity."""


@dataclass(frozen=True)
class JointLaw:
    """An effect as what is added to a joint: the parameter that enters linearly, one that does not, and its kin.

    ``base`` is the effect that it contains, whose place it takes; ``positive``: of one sign only; ``loaded``: it
    depends on the load.
    """

    effect: str
    linear: str
    shape: str = ""
    base: str = ""
    positive: bool = True
    loaded: bool = False


BASIC = (
    JointLaw("viscous_friction", "b"),
    JointLaw("coulomb_friction", "mu"),
    JointLaw("constant_load", "F0", positive=False),
)
"""What everybody puts in each joint, beside its motor's inertia."""
EXTRA = (
    JointLaw("stribeck_friction", "excess", "v_s", base="coulomb_friction"),
    JointLaw("cubic_viscous_friction", "b3", base="viscous_friction", positive=False),
    JointLaw("asymmetric_viscous_friction", "b_p", base="viscous_friction", positive=False),
    JointLaw("load_dependent_friction", "kappa_e", loaded=True),
    JointLaw("linear_stiffness", "k"),
)
"""What may be missing beyond that."""
ASKED = (JointLaw("power_law_friction", "c", "a", base="viscous_friction"),)
"""What is not searched for among others: near standstill it looks like dry friction that sets in gradually
(`signlin_ros.arms.forms`).
"""
BY_EFFECT = {law.effect: law for law in (*EXTRA, *ASKED)}
"""The laws beyond basic friction by their effects."""
WORKED_OUT = frozenset(law.effect for law in (*BASIC, *EXTRA, *ASKED))
"""Effects that a fit works out anew; others stay as the file has them."""


class Loads:
    """What the rigid body of a model exerts on the joints at every sample of some pieces, and its motors' efforts.

    ``friction``: the laws of friction beside it, as place, law, shape and coefficient; ``own``: what a record's own
    payload adds to the inertial parameters (10 n,), by the record's name.
    """

    def __init__(
        self,
        robot: Robot,
        pi: Array,
        friction: Sequence[tuple[int, JointLaw, float, float]] = (),
        own: Mapping[str, Array] | None = None,
    ) -> None:
        self.robot, self.pi, self.friction, self.own = robot, pi, friction, own or {}
        self._known: dict[int, Array] = {}

    def of(self, piece: ArmSegment) -> Array:
        """Return forces and torques of the rigid body (T, K) where effects act."""
        if id(piece) not in self._known:
            pi = self.pi + self.own.get(piece.run.source, 0.0)
            found = inverse_dynamics(self.robot, piece.q, piece.v, piece.a, pi)
            n = self.robot.n
            parted = [int(np.flatnonzero(row)[0]) for row in piece.motors[n:]]
            self._known[id(piece)] = np.concatenate([found @ np.linalg.inv(piece.motors[:n]), found[:, parted]], axis=1)
        return self._known[id(piece)]


@dataclass
class _MotorLaw:
    """What an effect sees of a joint's motor at T samples."""

    position: Array
    velocity: Array
    external_force: Array
    drive_force: Array


def force(effect: str, values: Mapping[str, Any], piece: ArmSegment, i: int, load: Array) -> Array:
    """Return the force (T,) of an effect on the motor i."""
    found = find_effect(effect, "effects")
    pars = as_law_sees(found.pars(), {**dict.fromkeys(found.pars(), 0.0), **values})
    velocity = piece.signs[i].velocity
    motor = _MotorLaw(piece.angle[:, i], velocity, -load[:, i], load[:, i])
    with np.errstate(all="ignore"):
        out = found().force(piece.signs[i], motor, pars)
    return np.asarray(np.broadcast_to(out, velocity.shape), dtype=float)


def column(law: JointLaw, shape: float, rows: RegressionRows, i: int, loads: Loads) -> Array:
    """Return the effort (N, 1) that one unit of a law needs: minus its force."""
    values = unit_of(law, shape)
    kept = (law.effect, law.linear, shape, i)
    if law.loaded:
        return rows.motor(i, lambda p: -force(law.effect, values, p, i, loads.of(p)))[:, None]
    if kept not in rows.known:
        nothing = np.zeros((1, len(rows.pieces[0].motors)))
        rows.known[kept] = rows.motor(i, lambda p: -force(law.effect, values, p, i, nothing))[:, None]
    return rows.known[kept]


@dataclass(frozen=True)
class KeptEffect:
    """An effect of the file on a motor that stays as it is: its place, its name and its parameters."""

    at: int
    effect: str
    parameters: Mapping[str, Any]

    def needed(self, piece: ArmSegment, load: Array) -> Array:
        """Return the effort (T,) that it needs of its motor under loads (T, K)."""
        return -force(self.effect, self.parameters, piece, self.at, load)


def kept_column(kept: Sequence[KeptEffect], rows: RegressionRows, loads: Loads) -> Array:
    """Return the effort (N, 1) that effects need which stay as the file has them."""

    def of(piece: ArmSegment) -> Array:
        load = loads.of(piece)
        acting = np.zeros(load.shape)
        for one in kept:
            acting[:, one.at] += one.needed(piece, load)
        return np.asarray((acting @ piece.motors)[:, :, None])

    return rows.whole(of)


def unit_of(law: JointLaw, shape: float) -> dict[str, float]:
    """Return the parameters of one unit of a law."""
    values: dict[str, float] = {law.linear: 1.0}
    if law.shape:
        values[law.shape] = shape
    if law.effect == "asymmetric_viscous_friction":
        values["b_n"] = -1.0  # beside viscous friction only the difference is new
    return values


def shapes(law: JointLaw, rows: RegressionRows, i: int) -> list[float]:
    """Return the values of a law's other parameter that are tried."""
    if not law.shape:
        return [0.0]
    if law.shape == "a":
        return list(POWERS)
    fastest = max(float(np.percentile(np.abs(p.speed[:, i]), 99)) for p in rows.pieces)
    noise = max(float(p.noise[i]) for p in rows.pieces)
    values: list[float] = np.geomspace(
        max(MIN_SHAPE_SHARE * fastest, 3.0 * noise), max(MAX_SHAPE_SHARE * fastest, 6.0 * noise), SHAPE_VALUES
    ).tolist()
    return values


def motor_inertia(rows: RegressionRows, i: int) -> Array:
    """Return the effort (N, 1) that one unit of a motor's inertia needs."""
    kept = ("motor_inertia", i)
    if kept not in rows.known:
        rows.known[kept] = rows.motor(i, lambda p: (p.a @ p.motors.T)[:, i])[:, None]
    return rows.known[kept]


# ---------------------------------------------------------------- laws of the robot


def payload(rows: RegressionRows, joint: int, R: Array, t: Array, size: int = 4) -> Array:
    """Return the effort (N, size) that a body on a link needs, by mass and first moments in the link's frame."""
    units = np.stack([moved(unit, R, t) for unit in np.eye(TEN)[:size]], axis=1)
    part = slice(TEN * joint, TEN * (joint + 1))
    return rows.Y[:, part] @ units


def gain(rows: RegressionRows, i: int, drives: Sequence[Array]) -> Array:
    """Return the effort (N, 1) that a gain of joint i off by one would add: what its motor exerts by the model."""
    found = []
    for piece, drive in zip(rows.pieces, drives, strict=True):
        values = piece.filtered(drive[:, i])
        found += [values[piece.moving[:, j]] * (i == j) for j in range(rows.n)]
    return np.concatenate(found)[:, None]


def delay(rows: RegressionRows, i: int, loads: Loads) -> Array:
    """Return the effort (N, 1) that a delay of one second of joint i's effort (-1: of all) adds.

    What the rigid body needs falls behind by its derivative times the delay. Friction does not speak: what sets in late
    after a reversal looks like a delay, and viscous friction that is late like another inertia of the motor.
    """
    n = loads.robot.n

    def of(piece: ArmSegment) -> Array:
        found = -np.gradient(loads.of(piece)[:, :n] @ piece.motors[:n], piece.step, axis=0)
        return np.asarray(found if i < 0 else found * (np.arange(n) == i))[:, :, None]

    return rows.whole(of)


def compliance(rows: RegressionRows, i: int, loads: Loads) -> Array:
    """Return the effort (N, 1) that a unit of compliance (rad per N·m) behind the motor of joint i needs.

    The link lags behind its motor by load times compliance; the derivative of the inverse dynamics along that.
    """
    robot, pi = loads.robot, loads.pi

    def of(piece: ArmSegment) -> Array:
        bend = inverse_dynamics(robot, piece.q, piece.v, piece.a, pi)[:, i]
        step = 1e-3 / max(float(np.abs(bend).max()), 1e-9)
        rate = np.gradient(bend, piece.step)
        moved = [values.copy() for values in (piece.q, piece.v, piece.a)]
        for values, change in zip(moved, (bend, rate, np.gradient(rate, piece.step)), strict=True):
            values[:, i] -= step * change
        before = inverse_dynamics(robot, piece.q, piece.v, piece.a, pi)
        return ((inverse_dynamics(robot, moved[0], moved[1], moved[2], pi) - before) / step)[:, :, None]

    return rows.whole(of)


def zero(rows: RegressionRows, i: int, pi: Array) -> Array:
    """Return the effort (N, 1) that the model needs more where joint i stands one rad (m) beyond what is recorded.

    pi : (10 n,) bodies as the model's file has them: those of a fit have been bent to do without. Nothing where it does
    not depend on that position, as at a first joint about gravity.
    """
    robot, step = rows.robot, ZERO_STEP

    def of(piece: ArmSegment) -> Array:
        sides = []
        for way in (step, -step):
            q = piece.q.copy()
            q[:, i] += way
            sides.append(inverse_dynamics(robot, q, piece.v, piece.a, pi))
        return np.asarray((sides[0] - sides[1]) / (2.0 * step))[:, :, None]

    found = rows.whole(of)
    seen = np.abs(found).max(initial=0.0) > MIN_EFFORT_SHARE * np.abs(rows.y).max(initial=0.0)
    return np.asarray(found if seen else np.zeros(found.shape))


def across_gravity(robot: Robot) -> tuple[Array, float]:
    """Return two directions (2, 3) across gravity, and how strong it is in m/s²."""
    down = float(np.linalg.norm(robot.gravity)) or 1.0
    return np.linalg.svd(robot.gravity[None, :] / down)[2][1:], down


def tilt(rows: RegressionRows, loads: Loads) -> Array:
    """Return the effort (N, 2) that a base tilted by one rad about x and about y would add."""
    robot, pi = loads.robot, loads.pi
    across, down = across_gravity(robot)

    def of(piece: ArmSegment) -> Array:
        columns = []
        for direction in across:
            rest = np.zeros_like(piece.q)
            tilted = replace(robot, gravity=down * direction)
            columns.append(inverse_dynamics(tilted, piece.q, rest, rest, pi))
        return np.stack(columns, axis=2)

    return rows.whole(of)


__all__ = [
    "ASKED",
    "BASIC",
    "BY_EFFECT",
    "EXTRA",
    "WORKED_OUT",
    "JointLaw",
    "KeptEffect",
    "Loads",
    "across_gravity",
    "column",
    "compliance",
    "delay",
    "force",
    "gain",
    "kept_column",
    "motor_inertia",
    "payload",
    "shapes",
    "tilt",
    "unit_of",
    "zero",
]
