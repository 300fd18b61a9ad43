"""A model of an arm held against its records: rows to fit and unseen ones, and how good each step is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from signlin_ros.arms.data import ArmRun
from signlin_ros.arms.drift import Drift
from signlin_ros.arms.fit import CoefficientEstimate, fit, rigid
from signlin_ros.arms.laws import BASIC, WORKED_OUT, JointLaw, KeptEffect, force
from signlin_ros.arms.loaded import Loaded
from signlin_ros.arms.piece import ArmSegment, RegressionRows, chosen_band
from signlin_ros.arms.repeats import repeated
from signlin_ros.arms.search import State
from signlin_ros.arms.warmth import Warmth
from signlin_ros.effects import find_effect
from signlin_ros.errors import InputError
from signlin_ros.filters import sensor_noise
from signlin_ros.model.arm import ArmModel
from signlin_ros.plants.arm import MOTOR_INERTIA, places
from signlin_ros.robots import Joint, Robot, inverse_dynamics
from signlin_ros.robots.inertia import TEN, about_centre, moved

Array = NDArray[np.float64]
LINK_SIDE = "its effort is measured on the link's side of the gear: most friction is not in this torque"
"""What is said of a joint of which nothing but the rigid body is told."""
MAX_STEP_SHARE = 0.1
"""Part of an effort's spread from which on its steps are too coarse to tell friction from."""
MIN_JOINT_ROWS = 30
"""Rows that a joint needs."""
ROWS_BY_PURPOSE = {"to fit": "rows", "to validate with": "new"}
"""What the rows of a study are for."""
TURNED, SLID = 0.05, 0.005
"""Ranges below which a joint did not move: of an angle in rad, of a prismatic joint in m."""


@dataclass(eq=False)
class Study:
    """A model and its records: ``rows`` of the fit and ``new`` unseen ones, in one band (Hz).

    ``barred``: joints of which nothing is told, and why; ``link_side``: joints whose effort has little friction in it;
    ``warmth``, ``loaded``: by how much friction and payloads differ between records, where there are several;
    ``drift``: by how much friction changes within them; ``settling`` (n,): over what lengths it sets in.
    """

    model: ArmModel
    runs: tuple[Sequence[ArmRun], Sequence[ArmRun]]
    band: float
    rows: RegressionRows
    new: RegressionRows
    barred: dict[int, str] = field(default_factory=dict)
    link_side: dict[int, str] = field(default_factory=dict)
    warmth: Warmth | None = None
    drift: Drift | None = None
    loaded: Loaded | None = None
    settling: Array | None = None
    notes: list[str] = field(default_factory=list)

    @property
    def robot(self) -> Robot:
        """The robot without its payload."""
        assert self.model.unloaded is not None  # noqa: S101 - for the type checker
        return self.model.unloaded

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the joints."""
        return self.robot.names

    @property
    def carried(self) -> Array:
        """What the file's payload adds to the inertial parameters (10 n,)."""
        return self.model.robot.pi - self.robot.pi

    def of_all(self) -> Study:
        """Return the study of all rows: unseen ones are fitted to as well."""
        rows = RegressionRows([*self.rows.pieces, *self.new.pieces])
        return replace(self, rows=rows, new=rows)

    def with_motors(self, motors: Array) -> Study:
        """Return the study with another coupling."""
        rows, new = (_rows(self.robot, motors, runs, self.band, self.settling) for runs in self.runs)
        return replace(self, rows=rows, new=new)

    def with_settling(self, lengths: Array) -> Study:
        """Return the study of rows in which friction has set in, over some lengths (n,) after a reversal."""
        found = replace(self, settling=lengths, barred={}, link_side={}).with_motors(self.model.arm_plant.motors)
        _look(found)
        return found

    def state(self) -> State:
        """Return where a search starts: what the file has in each joint, and the friction that everybody puts in."""
        n = self.robot.n
        laws = [(i, law) for i in range(len(self.rows.pieces[0].motors)) for law in BASIC[: 3 if i < n else 2]]
        inertias = np.array([self.model.parameters[f"{name}.{MOTOR_INERTIA}"] for name in self.names])
        barred = frozenset(self.barred) | frozenset(self.link_side)
        where = self.payload_place
        silent = bool(self.link_side)
        return State(
            *(self.robot, self.rows, self.new, self.model.arm.tolerance, tuple(laws), inertias),
            payload_at=None if silent else where,
            barred=barred,
            behind=frozenset(self.link_side),
            kept=tuple(
                KeptEffect(self.model.arm_plant.place_of(key), use.type, use.parameters)
                for key, use in self.model.effects.items()
                if use.type not in WORKED_OUT
            ),
            carried=self.carried,
            tilts=not silent,
            spread=0.0 if self.warmth is None else self.warmth.spread,
            change=0.0 if self.drift is None else self.drift.size,
            lightest=None if self.loaded is None else self.loaded.lightest,
        )

    @property
    def payload_place(self) -> tuple[int, Array, Array]:
        """The joint that carries the payload, and rotation and translation of its link's frame in the joint's."""
        payload = self.model.arm.payload
        if payload is not None:
            return self.robot.frame(payload.on)
        parents = {joint.parent for joint in self.robot.joints}
        tip = [i for i in self.robot.sequence if i not in parents][-1]
        return tip, np.eye(3), np.zeros(3)

    @property
    def payload_link(self) -> str:
        """Name of that link."""
        payload = self.model.arm.payload
        return payload.on if payload is not None else self.robot.joints[self.payload_place[0]].link

    # ---------------------------------------------------------------- how good

    def as_given(self, rows: RegressionRows) -> Array:
        """Return the RMS effort residual (n,) of the file's rigid body."""
        return rows.by_joint(rows.y - rows.Y @ self.model.robot.pi)

    def rigid(self) -> CoefficientEstimate:
        """Return the rigid body refitted alone, near the URDF."""
        design = rigid(self.robot, self.model.arm.tolerance, self.rows, self.new, self.carried)
        return fit(design, self.rows, self.new)

    def left(self, model: ArmModel, rows: RegressionRows) -> Array:
        """Return the effort residual (N,) of a model, nothing of it fitted."""
        return np.asarray(rows.y - predicted(model, rows))


def study(model: ArmModel, known: Sequence[ArmRun], unseen: Sequence[ArmRun], band: float | None = None) -> Study:
    """Return a study of a model and its records in a band (Hz), chosen by the motion where none is given."""
    if band is None:
        band = chosen_band([*known, *unseen])
    slowest = max(run.step for run in (*known, *unseen))
    if not 0.0 < band < 0.4 / slowest:
        raise InputError(f"--band {band:g}: allowed: above 0 and below {0.4 / slowest:g} Hz, 0.4 of the rate")
    check_static(model)
    assert model.unloaded is not None  # noqa: S101 - for the type checker
    rows, new = (_rows(model.unloaded, model.arm_plant.motors, runs, band) for runs in (known, unseen))
    found = Study(model, (known, unseen), band, rows, new)
    _look(found)
    found.notes += repeated(known, unseen)
    return found


def _rows(
    robot: Robot, motors: Array, runs: Sequence[ArmRun], band: float, settling: Array | None = None
) -> RegressionRows:
    return RegressionRows([ArmSegment(robot, places(motors), run, band, settling) for run in runs])


def check_static(model: ArmModel) -> None:
    """Refuse effects with states of their own, which the equations of the effort do not tell."""
    for key, use in model.effects.items():
        if find_effect(use.type, "effects").states:
            said = "has a state of its own, and an arm is compared through its inverse dynamics; take it out"
            raise InputError(f"{model.source}: {key}: {said} (simulate and linearize take it)")


def least_range(joint: Joint) -> float:
    """Return the range in rad (m) below which a joint did not move."""
    return SLID if joint.prismatic else TURNED


def _look(study: Study) -> None:
    """Note what cannot be told, joint by joint."""
    for i, name in enumerate(study.names):
        tau = np.concatenate([run.tau[:, i] for run in study.runs[0]])
        q = np.concatenate([run.q[:, i] for run in study.runs[0]])
        quantum, unit = max(float(run.steps[i]) for run in study.runs[0]), study.robot.joints[i].effort_unit
        spread = float(np.std(tau))
        still = [side for side, rows in ROWS_BY_PURPOSE.items() if getattr(study, rows).counts[i] < MIN_JOINT_ROWS]
        if still or np.ptp(q) < least_range(study.robot.joints[i]):
            where = f" in the data {still[0]}" if len(still) == 1 else ""
            study.barred[i] = f"it hardly moves{where}: too few samples in motion to tell anything of it"
        elif quantum > MAX_STEP_SHARE * spread:
            study.barred[i] = (
                f"its effort comes in steps of {quantum:.2g} {unit}, its spread is {spread:.2g} {unit}: refused"
            )
        elif name in study.model.link_side:
            study.link_side[i] = LINK_SIDE


def unseen_noise(study: Study) -> Array:
    """Return the RMS noise of the measured efforts in the band (n,)."""
    found = []
    for i in range(study.robot.n):
        levels = [sensor_noise(run.tau[:, i]) * np.sqrt(2.0 * study.band * run.step) for run in study.runs[1]]
        found.append(float(np.sqrt(np.mean(np.square(levels)))))
    return np.array(found)


def predicted(model: ArmModel, rows: RegressionRows) -> Array:
    """Return the effort (N,) that a model needs for the motion of some rows: rigid body, motors, effects.

    Of an effort that is measured behind the gear the motor's inertia is no part.
    """
    plant, robot = model.arm_plant, model.robot
    behind = model.link_side
    given = [0.0 if name in behind else model.parameters[f"{name}.{MOTOR_INERTIA}"] for name in robot.names]
    inertias = np.array(given)

    def of(piece: ArmSegment) -> Array:
        body = inverse_dynamics(robot, piece.q, piece.v, piece.a)
        n, P = robot.n, plant.places
        parted = [int(np.flatnonzero(row)[0]) for row in P[n:]]
        load = np.concatenate([body @ np.linalg.inv(P[:n]), body[:, parted]], axis=1)
        own = piece if np.array_equal(piece.motors, P) else piece.coupled(P)
        acting = np.zeros(load.shape)
        for key, use in model.effects.items():
            i = plant.place_of(key)
            acting[:, i] += force(use.type, use.parameters, own, i, load)
        motors = ((piece.a @ P[:n].T) * inertias) @ P[:n]
        return np.asarray((body + motors - acting @ P)[:, :, None])

    return np.asarray(rows.whole(of)[:, 0])


def body_of(payload: tuple[float, Array], place: tuple[int, Array, Array], n: int) -> Array:
    """Return the change of the inertial parameters (10 n,) by a point mass: mass and first moment (3,) in its link."""
    joint, R, t = place
    found = np.zeros(TEN * n)
    m, h = payload
    pi = about_centre(m, h / m, np.zeros((3, 3))) if m > 0.0 else np.concatenate([[m], h, np.zeros(6)])
    found[TEN * joint : TEN * (joint + 1)] = moved(pi, R, t)
    return found


__all__ = ["JointLaw", "Study", "body_of", "check_static", "least_range", "predicted", "study", "unseen_noise"]
