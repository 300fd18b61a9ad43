"""The published equations of BAM as a program of its own: what an exported BAM file does.

A servo's firmware turns the error of the position into a duty, the motor turns it into a torque, and friction is what
it takes to stop within a step, within a budget that the motor's torque and the load make.
[Duclusaud et al., Extended friction models for the physics simulation of servo actuators, ICRA 2025, arXiv:2410.08650]
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from signlin_ros.export.base import Array, ExportedDrive

BAM_GRAVITY = 9.80665
BAM_STEP = 2e-4
"""Longest step in s."""


def inertia_and_weight(p: Mapping[str, float], ends: Mapping[str, float]) -> tuple[float, float]:
    """Return the inertia in kg·m² and the weight in N·m of a drive with a mass on an arm.

    ``p``: its numbers, with ``armature``; ``ends``: mass, length, arm_mass, inertia of the bench.
    """
    inertia = p["armature"] + ends["inertia"] + (ends["mass"] + ends["arm_mass"] / 3) * ends["length"] ** 2
    return inertia, (ends["mass"] + ends["arm_mass"] / 2) * BAM_GRAVITY * ends["length"]


def budget(p: Mapping[str, float], motor: float, load: float, speed: float) -> float:
    """Return the friction in N·m that can act against a motion, its viscous part aside."""
    width = p.get("dtheta_stribeck", 0.0)
    near = math.exp(-(abs(speed / width) ** p.get("alpha", 2.0))) if width else 0.0
    total = p["friction_base"] + near * p.get("friction_stribeck", 0.0)
    total += p.get("load_friction_base", 0.0) * abs(load - motor)
    total += abs(load * p.get("load_friction_external", 0.0) - motor * p.get("load_friction_motor", 0.0))
    sliding = load * p.get("load_friction_external_stribeck", 0.0) - motor * p.get("load_friction_motor_stribeck", 0.0)
    return total + near * abs(sliding)


def carried(p: Mapping[str, float], drive: ExportedDrive, ends: Mapping[str, float]) -> tuple[Array, Array]:
    """Return position and speed (T,) of a servo on an arm.

    ``p`` are the numbers of a BAM file, ``ends`` those of the bench: mass, length, arm_mass, inertia; the first input
    of ``drive`` is the goal.
    """
    inertia, weight = inertia_and_weight(p, ends)
    q, w = float(drive.x0[0]), float(drive.x0[1])
    found = np.empty((drive.t.size, 2))
    found[0] = q, w
    for k, span in enumerate(np.diff(drive.t).tolist()):
        count = max(1, math.ceil(span / BAM_STEP))
        h = span / count
        for goal in drive.input_at(drive.t[k] + h * np.arange(count))[:, 0].tolist():
            duty = max(-p["max_pwm"], min(p["max_pwm"], p["kp"] * p["error_gain"] * (goal - q)))
            current = (duty * p["vin"] - p["kt"] * w) / p["R"]
            if p.get("max_current"):
                current = max(-p["max_current"], min(p["max_current"], current))
            motor, load = p["kt"] * current, -weight * math.sin(q - p["q_offset"])
            most = budget(p, motor, load, w) + p["friction_viscous"] * abs(w)
            stopping = -inertia * w / h - motor - load
            w += h * (motor + load + max(-most, min(most, stopping))) / inertia
            q += h * w
        found[k + 1] = q, w
    return found[:, 0], found[:, 1]


__all__ = ["budget", "carried", "inertia_and_weight"]
