"""Axes and slides: what moves along a way, or turns, under a force or torque that is recorded."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numba import njit

from benchmarks.machines.rig import (
    RPM,
    Array,
    Truth,
    counted,
    filtered,
    machine,
    moves,
    multisine,
    noisy,
    position_loop,
    rate_of,
    rounded,
    simulate,
    speed_loop,
    steps,
    times,
    write_model,
    write_table,
)

Q, V = 0, 1


@njit
def _axis(t: float, y: Array, u: float, p: Any, rate: Array, dry: Array) -> None:
    """A mass with viscous and dry friction and a constant force."""
    m, c, mu, load = p
    rate[Q] = y[V]
    rate[V] = (u + load - c * y[V]) / m
    dry[V] = mu / m


@machine(
    1201,
    Truth(
        "the weight of a vertical axis and Coulomb friction; torque in % of the rated one, speed in rpm",
        right=("constant_load+coulomb_friction",),
        part=("constant_load", "coulomb_friction", "stribeck_friction", "load_dependent_friction"),
        values={"constant_load.F0": (-0.42, 0.1), "coulomb_friction.mu": (0.11, 0.15)},
    ),
)
def vertical_servo_axis(folder: Path, rng: np.random.Generator) -> None:
    write_model(
        folder,
        """
plant: mass_spring_damper
axis: rotary                       # at the motor's shaft: kg m2, N m, rad
parameters: {m: 0.00052, c: 0.0009, k: 0.0}
sign_scale: 0.0
operating_range: {displacement: 200.0, velocity: 250.0}
update_period: 0.02
signals: {force: "0.0127 * Torque_pct", velocity: "Speed_rpm [rpm]"}   # rated torque: 1.27 N m
""",
    )
    for name, high, speed in (("training", 150.0, 200.0), ("validation", 90.0, 120.0)):
        t = times(16.0, 0.0005)
        wanted = moves(rng, t, 0.0, high, speed, 2500.0)
        c = (Q, V, 25.0, 0.05, 1.5, 0.0005, 3.8, 2 * np.pi / 131072)
        start = (float(wanted[0]), 0.0)
        run = simulate(_axis, start, wanted, 0.0005, (0.000535, 0.00093, 0.11, -0.42), rng, position_loop, c)
        at = run.at(0.004)
        torque = filtered(noisy(rng, run.u / 0.0127, 0.3), 400.0, 0.0005)
        speed_seen = filtered(rate_of(counted(run.y[:, Q], 2 * np.pi / 131072), 0.0005), 250.0, 0.0005)
        columns = {
            "Time": run.t[at],
            "Torque_pct": rounded(torque[at], 0.1),
            "Speed_rpm": rounded(RPM * speed_seen[at], 0.1),
        }
        write_table(folder / f"{name}.csv", columns, 4, ";")


@njit
def _slide(t: float, y: Array, u: float, p: Any, rate: Array, dry: Array) -> None:
    m, c, mu, gap, k_s = p
    rate[Q] = y[V]
    stop = k_s * (max(y[Q] - gap, 0.0) - max(-y[Q] - gap, 0.0))
    rate[V] = (u - c * y[V] - stop) / m
    dry[V] = mu / m


@machine(
    1202,
    Truth(
        "elastic stops at both ends of a pneumatic slide",
        right=("hard_stop",),
        part=("cubic_stiffness",),
        values={"hard_stop.gap": (0.08, 0.05), "hard_stop.k_s": (9000.0, 0.25)},
    ),
)
def pneumatic_slide(folder: Path, rng: np.random.Generator) -> None:
    write_model(
        folder,
        """
plant: mass_spring_damper
axis: linear
parameters: {m: 3.2, c: 22.0, k: 0.0}
effects:
  coulomb_friction: {mu: 11.0}
sign_scale: 0.0
operating_range: {displacement: 0.1, velocity: 1.0}
update_period: 0.02
signals:                           # bore 25 mm, both chambers
  force: "49.09 * (pA - pB)"       # N for bar
  displacement: "x [mm]"
""",
    )
    for name, tones in (("training", 6), ("validation", 9)):
        t = times(20.0, 0.001)
        force = filtered(multisine(rng, t, 75.0, 0.25, 2.5, tones), 8.0, 0.001)
        run = simulate(_slide, (0.0, 0.0), force, 0.001, (3.3, 21.4, 11.4, 0.08, 9000.0), rng)
        at = run.at(0.005, 0.0002, rng)
        base = 3.5 + 0.4 * np.sin(0.9 * run.t)
        columns = {"t [s]": run.t[at], "pA": noisy(rng, (base + force / 98.18)[at], 0.006)}
        columns |= {"pB": noisy(rng, (base - force / 98.18)[at], 0.006), "x [mm]": 1e3 * counted(run.y[at, Q], 5e-6)}
        write_table(folder / f"{name}.csv", columns, 4)


@njit
def _table(t: float, y: Array, u: float, p: Any, rate: Array, dry: Array) -> None:
    J, c, mu, A, q0 = p
    rate[Q] = y[V]
    rate[V] = (u - c * y[V] - A * np.sin(y[Q] - q0)) / J
    dry[V] = mu / J


@machine(
    1203,
    Truth(
        "the weight of an unbalanced table; its angle begins anew after a turn",
        right=("gravity_load", "cogging_torque"),
        part=("torque_ripple",),
        values={"gravity_load.A": (0.9, 0.1)},
    ),
)
def unbalanced_table(folder: Path, rng: np.random.Generator) -> None:
    write_model(
        folder,
        """
plant: mass_spring_damper
axis: rotary
parameters: {m: 0.085, c: 0.06, k: 0.0}
effects:
  coulomb_friction: {mu: 0.35}
sign_scale: 0.0
operating_range: {displacement: 6.3, velocity: 8.0}
update_period: 0.05
signals: {force: "torque [N.m]", displacement: "angle [deg]"}
""",
    )
    for name, low, high in (("training", 0.8, 2.5), ("validation", 1.5, 4.0)):
        t = times(25.0, 0.001)
        wanted = filtered(steps(rng, t, -7.0, 7.0, low, high), 3.0, 0.001)
        c = (V, 1.2, 6.0, 0.001, 6.0, 0.02)
        run = simulate(_table, (0.5, 0.0), wanted, 0.001, (0.088, 0.0585, 0.36, 0.9, 0.4), rng, speed_loop, c)
        at = run.at(0.005)
        angle = np.degrees(counted(run.y[at, Q], 2 * np.pi / 16384)) % 360.0
        columns = {"time_s": run.t[at], "torque [N.m]": noisy(rng, run.u[at], 0.02), "angle [deg]": angle}
        write_table(folder / f"{name}.csv", columns, 3)


@machine(
    1204,
    Truth(
        "Coulomb friction that had fallen by a third when the second record was made of the warm machine",
        right=("coulomb_friction",),
        part=("stribeck_friction",),
        values={"coulomb_friction.mu": (10.0, 0.35)},
    ),
)
def warmed_up(folder: Path, rng: np.random.Generator) -> None:
    write_model(
        folder,
        """
plant: mass_spring_damper
axis: linear
parameters: {m: 14.0, c: 45.0, k: 0.0}
sign_scale: 0.0
operating_range: {displacement: 0.3, velocity: 0.5}
update_period: 0.05
signals: {force: "F [N]", displacement: "x [m]"}
""",
    )
    for name, mu, tones in (("training", 12.0, 7), ("validation", 8.0, 10)):
        t = times(20.0, 0.001)
        wanted = 0.12 * multisine(rng, t, 1.0, 0.15, 1.5, tones)
        c = (Q, V, 12.0, 500.0, 2000.0, 0.001, 120.0, 1e-6)
        run = simulate(_axis, (float(wanted[0]), 0.0), wanted, 0.001, (14.5, 43.0, mu, 0.0), rng, position_loop, c)
        at = run.at(0.005, 0.0001, rng)
        columns = {"t": run.t[at], "F [N]": noisy(rng, run.u[at], 0.4), "x [m]": counted(run.y[at, Q], 1e-6)}
        write_table(folder / f"{name}.csv", columns, 6)


@machine(
    1205,
    Truth(
        "Coulomb friction, in a log of 10 Hz",
        right=("coulomb_friction",),
        part=("stribeck_friction",),
        values={"coulomb_friction.mu": (140.0, 0.15)},
    ),
)
def ten_hertz_log(folder: Path, rng: np.random.Generator) -> None:
    write_model(
        folder,
        """
plant: mass_spring_damper
axis: linear
parameters: {m: 900.0, c: 350.0, k: 0.0}
sign_scale: 0.0
operating_range: {displacement: 3.0, velocity: 0.8}
update_period: 0.5
signals: {force: "drive force [N]", velocity: "v [m/s]"}
""",
    )
    for name, tones in (("training", 7), ("validation", 11)):
        t = times(180.0, 0.01)
        force = multisine(rng, t, 800.0, 0.02, 0.35, tones)
        run = simulate(_axis, (0.0, 0.0), force, 0.01, (930.0, 338.0, 140.0, 0.0), rng, step=5e-4)
        at = run.at(0.1)
        columns = {"t [s]": run.t[at], "drive force [N]": run.u[at], "v [m/s]": noisy(rng, run.y[at, V], 0.003)}
        write_table(folder / f"{name}.csv", columns, 4)
