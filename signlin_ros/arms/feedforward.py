"""What an engineer sets for each joint of an arm: feed-forward of friction, and gains of a position loop.

u = (rigid body + motor inertia) + friction(speed): the rigid body is computed by the controller from the URDF, friction
is a table that stands here, in the unit that the joint's controller commands.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from signlin_ros.console import table
from signlin_ros.control.constants import Constants
from signlin_ros.control.designs import default_tuning
from signlin_ros.control.lqr import Weights, pid_gains
from signlin_ros.effects import find_effect
from signlin_ros.mathops import NumpyMath
from signlin_ros.model.arm import ArmModel
from signlin_ros.model.uses import EffectUse, is_sensor
from signlin_ros.par import as_law_sees
from signlin_ros.plants.arm import GAIN_PARAMETER, MOTOR_INERTIA
from signlin_ros.recording.arm import MAX_UNNAMED_SPEED
from signlin_ros.robots import inverse_dynamics, mass_matrix

Array = NDArray[np.float64]
SHARES = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0)
"""Shares of a joint's largest speed at which its friction is listed."""
ABOVE_REST_SHARE = 1e-9
"""Share of the largest speed that stands for just above standstill."""


@dataclass
class _MotorAtSpeeds:
    """What an effect sees of a joint's motor at T speeds: at rest in its position, under one load."""

    position: Array
    velocity: Array
    external_force: Array
    drive_force: Array


def friction(model: ArmModel, i: int, velocity: Array, load: float, position: float = 0.0) -> Array:
    """Return the effort (T,) in N·m (N) that the effects of a joint take at velocities (T,) under a load.

    Effects with a state of their own, and those of sensors, are left out.
    """
    found = np.zeros(velocity.shape)
    filled = np.full(velocity.shape, load)
    motor = _MotorAtSpeeds(np.full(velocity.shape, position), velocity, -filled, filled)
    for use in _own(model, i):
        if not _skipped(use):
            pars = find_effect(use.type, "effects").pars()
            values = as_law_sees(pars, {**dict.fromkeys(pars, 0.0), **use.parameters})
            with np.errstate(all="ignore"):
                found = found - find_effect(use.type, "effects")().force(NumpyMath(), motor, values)
    return np.asarray(np.broadcast_to(found, velocity.shape), dtype=float)


def _own(model: ArmModel, i: int) -> list[EffectUse]:
    return [use for key, use in model.effects.items() if key.partition(".")[0] == model.robot.names[i]]


def _skipped(use: EffectUse) -> bool:
    return is_sensor(use) or bool(find_effect(use.type, "effects").states)


def gains_content(model: ArmModel, at: Mapping[str, float], period: float, **wishes: float | None) -> dict[str, Any]:
    """Return feed-forward and gains of all joints as the JSON object of schemas/arm_gains.json.

    at : states at which gravity and inertia are taken, 0 where not named. period : s between updates. wishes : `delay`
    in s, `speed` the largest of all joints, `bandwidth` in rad/s.
    """
    x = np.array([at.get(name, 0.0) for name in model.states])
    n = model.robot.n
    delay = period if wishes.get("delay") is None else float(wishes["delay"] or 0.0)
    bandwidth = wishes.get("bandwidth")
    weights = default_tuning(period, delay).weights if bandwidth is None else Weights(bandwidth)
    q = x[None, :n]
    gravity = inverse_dynamics(model.robot, q, 0.0 * q, 0.0 * q)[0]
    motors = np.array([model.parameters[f"{name}.{MOTOR_INERTIA}"] for name in model.robot.names])
    P = model.arm_plant.motors
    inertia = np.diag(mass_matrix(model.robot, q)[0] + P.T @ np.diag(motors) @ P)
    joints = {
        name: _joint(model, i, (float(x[i]), float(gravity[i]), float(inertia[i])), wishes.get("speed"), weights)
        for i, name in enumerate(model.robot.names)
    }
    left = [key for key, use in model.effects.items() if _skipped(use)]
    notes = [f"{', '.join(left)}: not in the tables (a state of its own, or a sensor)"] if left else []
    notes += [f"{name}: {_DRIVES}" for name, own in joints.items() if _drives(own)]
    if model.arm.couplings:
        notes.append("coupled joints: tables are of the motors, inertia and gravity of the joints")
    return {
        "model": model.source,
        "at": dict(zip(model.states[:n], x[:n].tolist(), strict=True)),
        "period": period,
        "delay": delay,
        "bandwidth": weights.bandwidth,
        "joints": joints,
        "notes": notes,
    }


_DRIVES = "its friction would drive it at its largest speed, where no record told it: say operating_range"
"""What is said of a law that is used beyond where it holds."""


def _drives(joint: Mapping[str, Any]) -> bool:
    """Tell whether the friction of a joint, beside its constant load, acts with the motion at its largest speed."""
    last = joint["friction"][-1]
    return bool((last["forward"] - last["backward"]) * joint["gain"] < 0.0)


def _joint(
    model: ArmModel, i: int, here: tuple[float, float, float], speed: float | None, weights: Weights
) -> dict[str, Any]:
    joint, (position, load, inertia) = model.robot.joints[i], here
    gain = model.parameters[f"{joint.name}.{GAIN_PARAMETER}"]
    named = model.operating_range.get(f"{joint.name}.velocity") or dict(joint.limits).get("velocity", 0.0)
    most = speed or named or MAX_UNNAMED_SPEED
    speeds = most * np.array([*SHARES])
    both = np.concatenate([[ABOVE_REST_SHARE * most, -ABOVE_REST_SHARE * most], speeds, -speeds])
    taken = friction(model, i, both, load, position) / gain
    unloaded = friction(model, i, both[:2], 0.0, position) / gain
    k = len(SHARES)
    dry, offset = float(unloaded[0] - unloaded[1]) / 2.0, float(unloaded[0] + unloaded[1]) / 2.0
    ahead, back = taken[2 : 2 + k], taken[2 + k :]
    slope = float((ahead[-1] - back[-1] - (taken[0] - taken[1])) / (2.0 * most))
    constants = Constants(dry, slope, inertia / gain, 0.0, offset, 0.0)
    plain = pid_gains(constants, weights, position=True)
    unit = model.units[f"{joint.name}.effort"]
    table_ = [
        {"speed": float(v), "forward": float(a), "backward": float(b)}
        for v, a, b in zip(speeds, ahead, back, strict=True)
    ]
    return {
        "unit": unit,
        "speed_unit": f"{joint.position_unit}/s",
        "gain": gain,
        "kS": dry,
        "kV": slope,
        "kA": inertia / gain,
        "kG": load / gain,
        "offset": offset,
        "dry_here": float(taken[0] - taken[1]) / 2.0,
        "pid": {"K_p": plain.k_q, "K_i": plain.k_i, "K_d": plain.k_v},
        "friction": table_,
    }


def gains_text(c: Mapping[str, Any]) -> str:
    """Return gains of an arm as text: constants by joint, a position loop, and the friction table."""
    at = ", ".join(f"{name} {value:.3g}" for name, value in c["at"].items())
    head = (
        f"{c['model']}: at {at}; every {c['period']:g} s, delay {c['delay']:g} s, bandwidth {c['bandwidth']:.3g} rad/s"
    )
    rows = [["joint", "unit", "kS", "kS here", "kV", "kA here", "kG here", "offset", "K_p", "K_i", "K_d"]]
    for name, own in c["joints"].items():
        values = [own[k] for k in ("kS", "dry_here", "kV", "kA", "kG", "offset")]
        rows.append([name, own["unit"], *(f"{v:.4g}" for v in (*values, *own["pid"].values()))])
    shown = [["joint", *(f"{share:.0%}" for share in SHARES), "of"]]
    for name, own in c["joints"].items():
        of = f"{own['friction'][-1]['speed']:.3g} {own['speed_unit']}"
        shown += [[name, *(f"{row['forward']:.4g}" for row in own["friction"]), of]]
        shown += [["  backward", *(f"{row['backward']:.4g}" for row in own["friction"]), ""]]
    parts = [
        head,
        "feed-forward  u = rigid body of the URDF + motor inertia + friction; kS dry friction without a load, "
        "K of a position loop\n" + table(rows, right=range(2, 11)),
        "friction at shares of the largest speed, in the unit of the input, under the load here\n"
        + table(shown, right=range(1, 8)),
        "\n".join(c["notes"]),
    ]
    return "\n\n".join(part for part in parts if part)


__all__ = ["friction", "gains_content", "gains_text"]
