"""Records of a small arm: a motion of sines, the efforts that it needs with friction by its formulas, noisy sensors."""

from pathlib import Path

import numpy as np

from signlin_ros.model import Model
from signlin_ros.robots import inverse_dynamics

SMALL = Path(__file__).parents[1] / "config/arm/small_arm.yaml"
STEP = 0.01


def reference(seed, duration, n):
    """Return positions, velocities and accelerations (T, n) of a motion of several sines, slow at first."""
    rng, t = np.random.default_rng(seed), np.arange(0.0, duration, STEP)
    q, v, a = (np.zeros((t.size, n)) for _ in range(3))
    for k in range(1, 7):
        w = 2 * np.pi * k * 0.11 * rng.uniform(0.9, 1.1, n)
        size, phase = rng.uniform(0.3, 0.8, n) / k**0.8, rng.uniform(0, 2 * np.pi, n)
        q += size * np.sin(w * t[:, None] + phase)
        v += size * w * np.cos(w * t[:, None] + phase)
        a -= size * w * w * np.sin(w * t[:, None] + phase)
    return t, q + [0.0, 0.4, -0.5][:n], v, a


def record(truth, seed, duration=24.0, noise=0.02):
    """Return t (T,), q, v, effort (T, n) of an arm on a given motion: friction as its formulas say, noisy sensors."""
    robot, P = truth.robot, truth.arm_plant.motors
    t, q, v, a = reference(seed, duration, robot.n)
    load, speed = inverse_dynamics(robot, q, v, a), v @ P.T
    inertias = np.array([truth.parameters[f"{name}.motor_inertia"] for name in robot.names])
    at_motor = (a @ P.T) * inertias
    for i, name in enumerate(robot.names):
        own = {use.type: use.parameters for key, use in truth.effects.items() if key.startswith(f"{name}.")}
        kappa = own.get("load_dependent_friction", {}).get("kappa_e", 0.0)
        level = own["coulomb_friction"]["mu"] + kappa * np.abs((load @ np.linalg.inv(P))[:, i])
        at_motor[:, i] += level * np.tanh(speed[:, i] / 2e-3) + own["viscous_friction"]["b"] * speed[:, i]
    u, rng = load + at_motor @ P, np.random.default_rng(seed + 1000)
    shown = [values + size * rng.normal(size=values.shape) for values, size in ((q, 1e-5), (v, 1e-3), (u, noise))]
    return t, *shown


def written(path, names, t, q, v, u):
    """Write a record as a table of columns JOINT.quantity; return its path."""
    units = {"position": "rad", "velocity": "rad/s", "effort": "N·m"}
    head = ["t [s]", *(f"{n}.{what} [{unit}]" for n in names for what, unit in units.items())]
    table = np.stack([q, v, u], axis=2).reshape(len(t), -1)
    np.savetxt(path, np.column_stack([t, table]), delimiter=",", header=",".join(head), comments="", fmt="%.7g")
    return str(path)


def small():
    """Return the model of the small arm that ships."""
    return Model.load(SMALL)
