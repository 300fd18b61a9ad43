"""Machines that hide nothing: the model file has all that they have, some per cent off."""

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

I, W, Q = 0, 1, 2  # noqa: E741
NOTHING = Truth("nothing", right=("adequate",))


@njit
def _conveyor(t: float, y: Array, u: float, p: Any, rate: Array, dry: Array) -> None:
    R, L, K, B, J, mu = p
    rate[I] = (u - R * y[I] - K * y[W]) / L
    rate[W] = (K * y[I] - B * y[W]) / J
    rate[Q] = y[W]
    dry[W] = mu / J


@machine(1701, NOTHING)
def conveyor(folder: Path, rng: np.random.Generator) -> None:
    write_model(
        folder,
        """
plant: dc_motor
parameters: {R_a: 0.55, L_a: 0.0011, K_t: 0.11, K_m: 0.11, B: 0.0011, J: 0.0052}
effects:
  coulomb_friction: {mu: 0.16}
sign_scale: 0.0
operating_range: {current: 20.0, speed: 180.0}
update_period: 0.1
signals: {voltage: "U [V]", current: "I [A]", speed: "n [rpm]"}
""",
    )
    for name, low, high in (("training", 0.8, 2.0), ("validation", 1.2, 3.0)):
        t = times(24.0, 0.001)
        wanted = filtered(steps(rng, t, -150.0, 150.0, low, high), 2.0, 0.001)
        c = (W, 0.2, 1.0, 0.001, 24.0, 0.2)
        run = simulate(_conveyor, (0.0, 0.0, 0.0), wanted, 0.001, (0.57, 0.0011, 0.107, 0.00114, 0.0054, 0.154), rng,
                       speed_loop, c)  # fmt: skip
        at = run.at(0.005, 0.0001, rng)
        columns = {"t [s]": run.t[at], "U [V]": run.u[at], "I [A]": noisy(rng, run.y[at, I], 0.08)}
        write_table(folder / f"{name}.csv", {**columns, "n [rpm]": RPM * noisy(rng, run.y[at, W], 0.2)}, 4)


@njit
def _free(t: float, y: Array, u: float, p: Any, rate: Array, dry: Array) -> None:
    m, c, k, mu, load = p
    rate[0], rate[1] = y[1], (u + load - c * y[1] - k * y[0]) / m
    dry[1] = mu / m


@machine(1702, NOTHING)
def antenna(folder: Path, rng: np.random.Generator) -> None:
    write_model(
        folder,
        """
plant: mass_spring_damper
axis: rotary
parameters: {m: 48.0, c: 35.0, k: 0.0}
effects:
  coulomb_friction: {mu: 11.0}
  constant_load: {F0: -6.0}
sign_scale: 0.0
operating_range: {displacement: 3.0, velocity: 0.8}
update_period: 0.1
signals: {force: "torque [Nm]", displacement: "azimuth [deg]"}
""",
    )
    for name, speed in (("training", 0.5), ("validation", 0.7)):
        t = times(50.0, 0.002)
        wanted = moves(rng, t, -1.5, 1.5, speed, 0.6)
        c = (0, 1, 4.0, 300.0, 500.0, 0.002, 250.0, 2 * np.pi / 2**18)
        run = simulate(
            _free, (float(wanted[0]), 0.0), wanted, 0.002, (49.5, 33.8, 0.0, 11.6, -5.7), rng, position_loop, c, 1e-4
        )
        at = run.at(0.01)
        columns = {"t [s]": run.t[at], "torque [Nm]": noisy(rng, run.u[at], 0.3)}
        write_table(
            folder / f"{name}.csv",
            {**columns, "azimuth [deg]": np.degrees(counted(run.y[at, 0], 2 * np.pi / 2**18))},
            5,
        )


@machine(1703, NOTHING)
def quarter_car(folder: Path, rng: np.random.Generator) -> None:
    write_model(
        folder,
        """
plant: mass_spring_damper
axis: linear
parameters: {m: 310.0, c: 1250.0, k: 19500.0}
sign_scale: 0.0
operating_range: {displacement: 0.08, velocity: 0.6}
update_period: 0.05
signals: {force: "actuator [kN]", displacement: "heave [mm]", velocity: "v [m/s]"}
""",
    )
    for name, low, high in (("training", 0.3, 6.0), ("validation", 0.5, 10.0)):
        u = multisine(rng, times(20.0, 0.001), 1900.0, low, high, 10)
        run = simulate(_free, (0.0, 0.0), u, 0.001, (322.0, 1290.0, 18900.0, 0.0, 0.0), rng, step=1e-4)
        at = run.at(0.005, 0.0001, rng)
        columns = {"t [s]": run.t[at], "actuator [kN]": noisy(rng, 1e-3 * run.u[at], 0.004)}
        columns |= {"heave [mm]": noisy(rng, 1e3 * run.y[at, 0], 0.05), "v [m/s]": noisy(rng, run.y[at, 1], 0.004)}
        write_table(folder / f"{name}.csv", columns, 5)


@njit
def _arm(t: float, y: Array, u: float, p: Any, rate: Array, dry: Array) -> None:
    J, c, mu, A = p
    rate[0], rate[1] = y[1], (u - c * y[1] - A * np.sin(y[0])) / J
    dry[1] = mu / J


@machine(1704, NOTHING)
def lifting_arm(folder: Path, rng: np.random.Generator) -> None:
    write_model(
        folder,
        """
plant: mass_spring_damper
axis: rotary
parameters: {m: 0.42, c: 0.6, k: 0.0}
effects:
  coulomb_friction: {mu: 0.9}
  gravity_load: {A: 8.2}
sign_scale: 0.0
operating_range: {displacement: 1.6, velocity: 4.0}
update_period: 0.05
signals: {force: "14.4 * i_q", displacement: "q [rad]", velocity: "qd [rad/s]"}
""",
    )
    for name, speed in (("training", 2.0), ("validation", 3.0)):
        t = times(20.0, 0.001)
        wanted = moves(rng, t, -1.4, 1.4, speed, 15.0)
        c = (0, 1, 12.0, 8.0, 40.0, 0.001, 40.0, 2 * np.pi / 2**17)
        run = simulate(_arm, (float(wanted[0]), 0.0), wanted, 0.001, (0.435, 0.57, 0.94, 7.9), rng, position_loop, c)
        at = run.at(0.004)
        speed_seen = filtered(rate_of(counted(run.y[:, 0], 2 * np.pi / 2**17), 0.001), 200.0, 0.001)
        columns = {"t": run.t[at], "i_q [A]": rounded(noisy(rng, run.u[at] / 14.4, 0.008), 0.001)}
        write_table(
            folder / f"{name}.csv",
            {**columns, "q [rad]": counted(run.y[at, 0], 2 * np.pi / 2**17), "qd [rad/s]": speed_seen[at]},
            6,
        )


@machine(1705, NOTHING)
def drum_brake_rig(folder: Path, rng: np.random.Generator) -> None:
    write_model(
        folder,
        """
plant: force_element
parameters: {c: 420.0, k: 15000.0}
effects:
  coulomb_friction: {mu: 95.0}
sign_scale: 0.0
operating_range: {displacement: 0.02, velocity: 0.3}
update_period: 0.02
signals: {displacement: "s [mm]", velocity: "v [mm/s]", force: "F [N]"}
""",
    )
    for name, low, high in (("training", 0.3, 3.0), ("validation", 0.5, 5.0)):
        t = times(16.0, 0.002)
        x = multisine(rng, t, 0.015, low, high, 7)
        v = np.gradient(x, 0.002)
        force = 430.0 * v + 14700.0 * x + 98.0 * np.sign(v)
        columns = {"t [s]": t, "s [mm]": noisy(rng, 1e3 * x, 0.005), "v [mm/s]": noisy(rng, 1e3 * v, 0.4)}
        write_table(folder / f"{name}.csv", {**columns, "F [N]": noisy(rng, force, 2.0)}, 4)
