"""A second program for servos: the equations once more, integrated by another method, and logs made of them.

Time stepping of Moreau and Jean with steps of 25 µs: friction takes as much of the momentum as it can, and holds what
it can hold [Acary and Brogliato, Numerical Methods for Nonsmooth Dynamical Systems, 2008, ch. 10]. Nothing of
signlin_ros is used.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
FINE, STEP, DURATION = 2.5e-5, 0.005, 6.0
"""Steps of the integration and of the log, and how long a log is, in s."""
COUNT = 2 * np.pi / 4096
"""Step of the encoder in rad."""
LAWS = {
    "coulomb_friction": {"mu": 0.03},
    "stribeck_friction": {"mu": 0.012, "excess": 0.04, "v_s": 0.3},
    "load_dependent_friction": {"kappa_d": 0.2, "kappa_e": 0.1},
    "asymmetric_viscous_friction": {"b_p": 0.016, "b_n": 0.0},
    "constant_load": {"F0": 0.04},
    "linear_stiffness": {"k": 0.12},
    "cogging_torque": {"A": 0.05, "N": 12.0, "phi": 0.7},
    "input_delay": {"T": 0.02},
    "input_deadzone": {"d": 0.03},
    "dahl_presliding": {"F_c": 0.04, "sigma": 2.0},
}
"""What may be hidden, with values."""


@dataclass(frozen=True)
class Servo:
    """Numbers of a servo in SI units, its friction, and a hidden law."""

    K_t: float = 0.35
    R: float = 3.3
    J: float = 0.002
    length: float = 0.1
    duty_per_error: float = 0.00288
    vin: float = 7.4
    b: float = 0.006
    mu: float = 0.008
    law: str = ""
    values: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Log:
    """t (T,) s, goal and position (T,) rad, speed (T,) rad/s as the encoder shows it; gain and mass of the bench."""

    t: Array
    goal: Array
    position: Array
    speed: Array
    kp: float
    mass: float


def trajectory(kind: int, t: Array, rng: np.random.Generator) -> Array:
    """Return a goal position (T,): two sines, a chirp of steps, lift and lower, steps held for random times."""
    a, f = rng.uniform(0.7, 1.3), rng.uniform(0.8, 1.2)
    if kind == 0:
        return np.asarray(a * np.sin(2 * f * t) + 0.5 * np.sin(7 * f * t))
    if kind == 1:
        return np.asarray(a * np.sin(1.2 * f * t**2) * np.sign(np.sin(1.7 * f * t)))
    if kind == 2:
        return np.asarray(a * np.clip(2 * np.abs((t / 3 * f) % 2 - 1) - 0.5, 0.0, 1.0) * np.pi / 2)
    held = rng.uniform(-1.3, 1.3, 40)
    return np.asarray(held[np.minimum((t / rng.uniform(0.25, 0.6)).astype(int), 39)])


def logs(servo: Servo, bench: list[tuple[float, float]], seed: int) -> list[Log]:
    """Return a log for each gain and mass (kg) of a bench."""
    rng, n = np.random.default_rng(seed), round(DURATION / FINE)
    every, t = round(STEP / FINE), FINE * np.arange(n)
    times = t[::every]
    goals = np.array([trajectory(k % 4, times, rng) for k in range(len(bench))])
    q, v = _run(servo, np.repeat(goals, every, axis=1), np.array(bench), n, every)
    shown = COUNT * np.round(q / COUNT)
    speed = np.round(v / 0.024) * 0.024
    return [Log(times, *rows, *one) for *rows, one in zip(goals, shown, speed, bench, strict=True)]


def _run(s: Servo, goal: Array, bench: Array, n: int, every: int) -> tuple[Array, Array]:
    """Return positions and speeds (records, T) at the samples."""
    kp, mass = bench.T
    p, law = s.values, s.law
    moved, weight = s.J + mass * s.length**2, mass * 9.80665 * s.length
    late = round(p["T"] / FINE) if law == "input_delay" else 0
    q, v, z = goal[:, 0].copy() * 0.0, np.zeros(len(kp)), np.zeros(len(kp))
    Q, V = np.zeros((len(kp), n // every)), np.zeros((len(kp), n // every))
    for k in range(n):
        if k % every == 0:
            Q[:, k // every], V[:, k // every] = q, v
        error = goal[:, max(k - late, 0)] - q
        if law == "input_deadzone":
            error = np.sign(error) * np.maximum(np.abs(error) - p["d"], 0.0)
        duty = np.clip(s.duty_per_error * kp * error, -1.0, 1.0)
        drive = s.K_t * (duty * s.vin - s.K_t * v) / s.R
        external = -weight * np.sin(q)
        smooth = drive + external - s.b * v
        dry = s.mu
        if law == "coulomb_friction":
            dry = dry + p["mu"]
        elif law == "stribeck_friction":
            dry = dry + p["mu"] + p["excess"] * np.exp(-((v / p["v_s"]) ** 2))
        elif law == "load_dependent_friction":
            dry = dry + p["kappa_d"] * np.abs(drive) + p["kappa_e"] * np.abs(external)
        elif law == "asymmetric_viscous_friction":
            smooth = smooth - np.where(v > 0, p["b_p"], p["b_n"]) * v
        elif law == "constant_load":
            smooth = smooth + p["F0"]
        elif law == "linear_stiffness":
            smooth = smooth - p["k"] * q
        elif law == "cogging_torque":
            smooth = smooth - p["A"] * np.sin(p["N"] * q + p["phi"])
        elif law == "dahl_presliding":
            smooth = smooth - p["sigma"] * z
            z = z + FINE * (v - p["sigma"] * np.abs(v) * z / p["F_c"])
        free = v + FINE * smooth / moved
        held = FINE * dry / moved
        v = np.sign(free) * np.maximum(np.abs(free) - held, 0.0)
        q = q + FINE * v
    return Q, V
