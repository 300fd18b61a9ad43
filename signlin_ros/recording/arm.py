"""The trace of an arm: effects recorded joint by joint, and the rigid body beside them, kept in parts.

Every effect sees its joint's motor: ``x.position``, ``x.velocity``, ``x.drive_force`` (what its input exerts) and
``x.external_force``, what gravity, centrifugal and Coriolis forces exert on it.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from signlin_ros.errors import ModelError
from signlin_ros.mathops import Recorder, Surface
from signlin_ros.par import Namespace, as_law_sees
from signlin_ros.plants.arm import GAIN_PARAMETER, MOTOR_INERTIA, ArmPlant, parted
from signlin_ros.recording.asking import asked
from signlin_ros.recording.trace import EffectSlot, Structure, Trace, resolve_unit
from signlin_ros.robots.recorded import Factors, Recorded

MAX_UNNAMED_SPEED, STRONGEST = np.pi, 100.0
"""Largest speed (rad/s, m/s) and effort of a joint whose URDF names none."""


@dataclass(frozen=True)
class ArmParts:
    """The equations of an arm before they are put together; effects act in coordinates P (K, n) times the joints'.

    ``M`` (n, n) with the motors' inertias, ``bias`` (n); ``needed`` (n) is M a + bias at the symbols ``a``. Effects
    exert ``forces`` (K) there and ``rates`` are of their own states, both with ``surfaces`` in the symbols
    ``angle``, ``speed``, ``drive``, ``load`` (K each), which stand for ``P q``, ``P v``, ``drives`` and ``loads``.
    ``acting`` (n, n) turns efforts at the inputs into those on the joints, ``driven`` (K, n) into what effects see.
    """

    M: ca.SX
    bias: ca.SX
    a: ca.SX
    needed: ca.SX
    forces: ca.SX
    rates: ca.SX
    surfaces: tuple[Surface, ...]
    angle: ca.SX
    speed: ca.SX
    drive: ca.SX
    load: ca.SX
    drives: ca.SX
    loads: ca.SX
    P: NDArray[np.float64]
    acting: NDArray[np.float64]
    driven: NDArray[np.float64]


@dataclass
class _Motor:
    """What an effect sees of its joint's motor."""

    position: ca.SX
    velocity: ca.SX
    drive_force: ca.SX
    external_force: ca.SX
    own: Namespace = field(default_factory=lambda: Namespace({}))


class ArmTracer:
    """Carries the symbols of one trace of an arm."""

    def __init__(self, structure: Structure) -> None:
        assert issubclass(structure.plant, ArmPlant)  # noqa: S101 - for the type checker
        self.structure, self.plant, self.robot = structure, structure.plant, structure.plant.robot
        self.m = Recorder()
        self.units = {**self.plant.states({}), **self.plant.inputs}
        self.q, self.v = ([ca.SX.sym(f"{name}.{of}") for name in self.robot.names] for of in ("position", "velocity"))
        self.symbols = dict(zip(self.plant.states({}), (*self.q, *self.v), strict=True))
        self.inputs = {name: ca.SX.sym(name) for name in self.plant.inputs}
        self.parameters = {name: ca.SX.sym(name) for name in self.plant.pars()}
        self.P, self.parted = self.plant.places, parted(self.plant.motors)
        self.angle, self.drive, self.load = (ca.SX.sym(name, len(self.P)) for name in ("angle", "drive", "load"))
        names = enumerate(self.robot.names)
        moves = [ca.SX.sym(f"{name}.motor_velocity") if i in self.parted else self.v[i] for i, name in names]
        self.speed = ca.vertcat(*moves, *(self.v[i] for i in self.parted))
        self.surfaces: list[Surface] = []

    def _of_joints(self, name: str) -> ca.SX:
        return ca.vertcat(*(self.parameters[f"{joint}.{name}"] for joint in self.robot.names))

    def _joint(self, slot: EffectSlot) -> int:
        return self.robot.names.index(slot.key.rpartition(".")[0])

    def _entries(self) -> list[tuple[EffectSlot, Any, Namespace, _Motor]]:
        """Return every effect with its parameters and its motor, its states declared."""
        found = []
        for slot in self.structure.slots:
            i = self.plant.place_of(slot.key)
            values: dict[str, Any] = dict(slot.structural)
            for name in slot.parameters:
                if name not in values:
                    full = f"{slot.key}.{name}"
                    values[name] = self.parameters[full] = ca.SX.sym(full)
            own = {}
            for name, unit in slot.effect.states.items():
                full = f"{slot.key}.{name}"
                own[name] = self.symbols[full] = ca.SX.sym(full)
                self.units[full] = resolve_unit(unit, self.plant)
            motor = _Motor(self.angle[i], self.speed[i], self.drive[i], self.load[i], Namespace(own))
            found.append((slot, slot.effect(), as_law_sees(slot.effect.pars(), values), motor))
        return found

    def _said(self, method: str, entry: tuple[EffectSlot, Any, Namespace, _Motor]) -> Any:
        """Return the recorded expression of an effect's method; the surfaces that it names are given sizes."""
        slot, effect, p, motor = entry
        known = len(self.m.surfaces)
        found = asked(effect, method, self.plant, self.m, motor, p)
        for k in range(known, len(self.m.surfaces)):
            self.m.surfaces[k] = self._sized(self.m.surfaces[k], slot, motor)
        return found

    def _sized(self, surface: Surface, slot: EffectSlot, motor: _Motor) -> Surface:
        """Return a surface with its name, and the largest value that the URDF's limits leave it."""
        joint = self.robot.joints[self._joint(slot)]
        limits = dict(joint.limits)
        of = {
            f"{joint.name}.velocity": (motor.velocity, limits.get("velocity") or MAX_UNNAMED_SPEED),
            f"{joint.name}.load": (motor.external_force, limits.get("effort") or STRONGEST),
            f"{joint.name}.drive": (motor.drive_force, limits.get("effort") or STRONGEST),
        }
        for name, (symbol, size) in of.items():
            if ca.is_equal(surface.g, symbol, 12):
                return replace(surface, label=name, size=size)
        return replace(surface, label=f"{slot.key}: {surface.g}")

    def run(self) -> Trace:
        """Return the trace, its parts kept."""
        robot, n = self.robot, self.robot.n
        body, q, v = Recorded(robot, self.q, self.v), ca.vertcat(*self.q), ca.vertcat(*self.v)
        own = ca.sparsify(ca.SX(self.plant.motors))
        motor = own.T @ ca.diag(self._of_joints(MOTOR_INERTIA)) @ own
        a = ca.SX.sym("a", n)
        needed = body.inverse(ca.vertsplit(a)) + motor @ a
        entries = self._entries()
        forces, rates = [ca.SX(0)] * len(self.P), []
        # friction may depend on external forces, which act on the motor as the rigid body does
        for external in (True, False):
            for entry in entries:
                if entry[0].effect.external == external:
                    i = self.plant.place_of(entry[0].key)
                    forces[i] = forces[i] + self._said("force", entry)
        for entry in entries:
            rates += list(self._said("rates", entry).values()) if entry[0].effect.states else []
        drives = self._drives(entries)
        acting = np.where(np.array(self.plant.at_motor)[None, :], self.plant.motors.T, np.eye(n))
        into = ca.sparsify(ca.DM(np.linalg.inv(self.plant.motors.T))) if self.parted else ca.DM.eye(n)
        loads = ca.vertcat(-(into @ body.bias), *(-body.bias[i] for i in self.parted))
        parts = ArmParts(
            M=body.M + motor,
            bias=body.bias,
            a=a,
            needed=needed,
            forces=ca.vertcat(*forces),
            rates=ca.vertcat(*rates),
            surfaces=tuple(self.m.surfaces),
            angle=self.angle,
            speed=self.speed,
            drive=self.drive,
            load=self.load,
            drives=drives,
            loads=loads,
            P=self.P,
            acting=acting,
            driven=np.concatenate([np.eye(n), np.eye(n)[self.parted]]),
        )
        return self._trace(parts, Factors(parts.M), q, v)

    def _drives(self, entries: list[tuple[EffectSlot, Any, Namespace, _Motor]]) -> ca.SX:
        """Return the effort of each input, after the effects on it."""
        found = list(self.inputs.values())
        for slot, effect, p, _ in entries:
            i = self._joint(slot)
            found[i] = asked(effect, "input", self.plant, self.m, found[i], p)
            if not ca.SX(asked(effect, "delay", self.plant, p)).is_zero():
                raise ModelError(f"{slot.key}: an arm has no delays")
        return self._of_joints(GAIN_PARAMETER) * ca.vertcat(*found)

    def _trace(self, parts: ArmParts, factors: Factors, q: ca.SX, v: ca.SX) -> Trace:
        names, P = tuple(self.symbols), ca.sparsify(ca.SX(parts.P))

        def whole(e: Any) -> ca.SX:
            return placed(parts, ca.SX(e), q, v)

        acting = ca.sparsify(ca.SX(parts.acting))
        effort = acting @ parts.drives + P.T @ whole(parts.forces) - parts.bias
        return Trace(
            states=names,
            inputs=tuple(self.inputs),
            outputs=names,
            units=self.units,
            parameters=tuple(self.parameters),
            x=ca.vertcat(*self.symbols.values()),
            u=ca.vertcat(*self.inputs.values()),
            p=ca.vertcat(*self.parameters.values()),
            f=ca.vertcat(v, factors.solve(effort), whole(parts.rates)),
            y=ca.SX(0, 1),
            delay=ca.SX(0),
            surfaces=tuple(replace(s, g=whole(s.g)) for s in parts.surfaces),
            parts=parts,
        )


def placed(parts: ArmParts, e: ca.SX, q: ca.SX, v: ca.SX) -> ca.SX:
    """Return an expression in the coordinates of the motors in those of the joints."""
    P = ca.sparsify(ca.SX(parts.P))
    return ca.substitute(
        e,
        ca.vertcat(parts.angle, parts.speed, parts.drive, parts.load),
        ca.vertcat(P @ q, P @ v, ca.sparsify(ca.SX(parts.driven)) @ parts.drives, parts.loads),
    )


__all__ = ["ArmParts", "ArmTracer", "placed"]
