"""Stages and slides of machine tools, laboratories and buildings."""

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
    falling,
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
def _waves(t: float, y: Array, u: float, p: Any, rate: Array, dry: Array) -> None:
    """A mass with friction, one wave along the way and a spring."""
    m, c, mu, A, N, phi, k = p
    rate[Q] = y[V]
    rate[V] = (u - c * y[V] - A * np.sin(N * y[Q] + phi) - k * y[Q]) / m
    dry[V] = mu / m


@machine(
    1401,
    Truth(
        "cogging of a gimbal's motor, 42 periods a turn",
        right=("cogging_torque", "torque_ripple"),
        values={"cogging_torque.A": (0.012, 0.15), "cogging_torque.N": (42.0, 0.01)},
    ),
)
def gimbal(folder: Path, rng: np.random.Generator) -> None:
    write_model(
        folder,
        """
plant: mass_spring_damper
axis: rotary
parameters: {m: 0.0006, c: 0.0004, k: 0.0}
effects:
  coulomb_friction: {mu: 0.006}
sign_scale: 0.0
operating_range: {displacement: 3.0, velocity: 10.0}
update_period: 0.02
signals: {force: "0.068 * iq", displacement: "angle [deg]"}
""",
    )
    for name, speed in (("training", 4.0), ("validation", 7.0)):
        t = times(20.0, 0.0005)
        wanted = moves(rng, t, -2.2, 2.2, speed, 60.0)
        c = (Q, V, 25.0, 0.03, 0.6, 0.0005, 0.2, 2 * np.pi / 65536)
        p = (0.00062, 0.00041, 0.0061, 0.012, 42.0, 0.8, 0.0)
        run = simulate(_waves, (float(wanted[0]), 0.0), wanted, 0.0005, p, rng, position_loop, c)
        at = run.at(0.004)
        columns = {"t": run.t[at], "iq": noisy(rng, run.u[at] / 0.068, 0.01)}
        columns |= {"angle [deg]": np.degrees(counted(run.y[at, Q], 2 * np.pi / 65536))}
        write_table(folder / f"{name}.csv", columns, 4)


@machine(
    1402,
    Truth(
        "cogging over the magnets' pitch of a linear motor (24 mm), and the pull of its cable chain, like a spring",
        right=("cogging_torque+linear_stiffness",),
        part=("cogging_torque", "linear_stiffness", "torque_ripple"),
        values={"cogging_torque.A": (6.5, 0.15), "cogging_torque.N": (261.8, 0.01), "linear_stiffness.k": (28.0, 0.25)},
    ),
)
def linear_motor(folder: Path, rng: np.random.Generator) -> None:
    write_model(
        folder,
        """
plant: mass_spring_damper
axis: linear
parameters: {m: 5.5, c: 12.0, k: 0.0}
effects:
  coulomb_friction: {mu: 8.0}
sign_scale: 0.0
operating_range: {displacement: 0.3, velocity: 1.0}
update_period: 0.02
signals: {force: "38.5 * Iq", displacement: "pos [um]"}
""",
    )
    for name, speed in (("training", 0.4), ("validation", 0.7)):
        t = times(20.0, 0.0005)
        wanted = moves(rng, t, -0.28, 0.28, speed, 6.0)
        c = (Q, V, 30.0, 400.0, 9000.0, 0.0005, 150.0, 1e-6)
        p = (5.7, 11.5, 8.2, 6.5, 2 * np.pi / 0.024, 0.5, 28.0)
        run = simulate(_waves, (float(wanted[0]), 0.0), wanted, 0.0005, p, rng, position_loop, c)
        at = run.at(0.004)
        columns = {"time [s]": run.t[at], "Iq [A]": rounded(noisy(rng, run.u[at] / 38.5, 0.01), 0.002)}
        write_table(folder / f"{name}.csv", {**columns, "pos [um]": 1e6 * counted(run.y[at, Q], 1e-6)}, 4)


@njit
def _sticking(t: float, y: Array, u: float, p: Any, rate: Array, dry: Array) -> None:
    m, c, mu, excess, v_s, load = p
    rate[Q] = y[V]
    rate[V] = (u + load - c * y[V]) / m
    dry[V] = falling(y[V], mu, excess, v_s) / m


@machine(
    1403,
    Truth(
        "Stribeck friction of a plunger that sticks and slips at fractions of a millimetre a second",
        right=("stribeck_friction",),
        part=("coulomb_friction", "lugre_friction", "dahl_presliding"),
        values={"stribeck_friction.mu": (9.0, 0.15), "stribeck_friction.excess": (5.0, 0.4)},
    ),
)
def syringe_pump(folder: Path, rng: np.random.Generator) -> None:
    write_model(
        folder,
        """
plant: mass_spring_damper
axis: linear
parameters: {m: 1.8, c: 300.0, k: 0.0}
sign_scale: 0.0
operating_range: {displacement: 0.05, velocity: 0.01}
update_period: 0.05
signals: {force: "F_N", displacement: "x_um [um]"}
""",
    )
    for name, low, high in (("training", 1.5, 4.0), ("validation", 2.0, 5.0)):
        t = times(40.0, 0.001)
        speed = steps(rng, t, -1.0, 1.0, low, high)
        wanted = np.cumsum(np.sign(speed) * 0.006 * np.abs(speed) ** 2.5) * 0.001
        c = (Q, V, 12.0, 900.0, 4000.0, 0.001, 60.0, 5e-7)
        run = simulate(
            _sticking, (0.0, 0.0), wanted, 0.001, (1.85, 290.0, 9.0, 5.0, 0.0008, 0.0), rng, position_loop, c
        )
        at = run.at(0.01)
        columns = {"t": run.t[at], "F_N": noisy(rng, run.u[at], 0.15), "x_um": 1e6 * counted(run.y[at, Q], 5e-7)}
        write_table(folder / f"{name}.csv", columns, 3)


@njit
def _cylinder(t: float, y: Array, u: float, p: Any, rate: Array, dry: Array) -> None:
    m, b_p, b_n, mu = p
    rate[Q] = y[V]
    rate[V] = (u - (b_p if y[V] > 0 else b_n) * y[V]) / m
    dry[V] = mu / m


@machine(
    1404,
    Truth(
        "viscous friction of a hydraulic cylinder that is larger when it moves out",
        right=("asymmetric_viscous_friction",),
        part=("viscous_friction",),
    ),
)
def hydraulic_cylinder(folder: Path, rng: np.random.Generator) -> None:
    write_model(
        folder,
        """
plant: mass_spring_damper
axis: linear
parameters: {m: 120.0, c: 1500.0, k: 0.0}
effects:
  coulomb_friction: {mu: 260.0}
sign_scale: 0.0
operating_range: {displacement: 0.4, velocity: 0.5}
update_period: 0.05
signals:                                  # piston 50 mm, rod 28 mm
  force: "196.3 * p_A - 134.8 * p_B"      # N for bar
  displacement: "stroke [mm]"
""",
    )
    for name, tones in (("training", 6), ("validation", 9)):
        t = times(25.0, 0.001)
        wanted = 0.25 * multisine(rng, t, 1.0, 0.1, 0.9, tones)
        c = (Q, V, 8.0, 6000.0, 12000.0, 0.001, 9000.0, 1e-5)
        run = simulate(
            _cylinder, (float(wanted[0]), 0.0), wanted, 0.001, (124.0, 2900.0, 1450.0, 250.0), rng, position_loop, c
        )
        at = run.at(0.005, 0.0003, rng)
        force, p_B = filtered(run.u, 120.0, 0.001), 20.0 + 4.0 * np.sin(0.6 * run.t)
        columns = {"time [s]": run.t[at], "p_A": noisy(rng, ((force + 134.8 * p_B) / 196.3)[at], 0.04)}
        columns |= {"p_B": noisy(rng, p_B[at], 0.04), "stroke [mm]": 1e3 * counted(run.y[at, Q], 1e-5)}
        write_table(folder / f"{name}.csv", columns, 4)


@machine(
    1405,
    Truth(
        "the part of the car's weight that the counterweight does not balance",
        right=("constant_load",),
        values={"constant_load.F0": (-1450.0, 0.1)},
    ),
)
def elevator(folder: Path, rng: np.random.Generator) -> None:
    write_model(
        folder,
        """
plant: mass_spring_damper
axis: linear                      # at the rope: car, counterweight and sheave
parameters: {m: 2650.0, c: 140.0, k: 0.0}
effects:
  coulomb_friction: {mu: 420.0}
sign_scale: 0.0
operating_range: {displacement: 20.0, velocity: 2.0}
update_period: 0.1
signals: {force: "2.857 * torque_Nm", velocity: "v [m/s]", displacement: "h [m]"}   # sheave of 0.35 m
""",
    )
    for name, low, speed in (("training", 0.0, 1.6), ("validation", 5.0, 1.2)):
        t = times(60.0, 0.002)
        wanted = moves(rng, t, low, 18.0, speed, 0.8)
        c = (Q, V, 3.0, 9000.0, 9000.0, 0.002, 12000.0, 1e-4)
        p = (2730.0, 146.0, 400.0, 0.0, 1.0, -1450.0)
        run = simulate(_sticking, (float(wanted[0]), 0.0), wanted, 0.002, p, rng, position_loop, c, 2e-4)
        at = run.at(0.02)
        torque = rounded(filtered(noisy(rng, run.u / 2.857, 6.0), 30.0, 0.002), 1.0)
        columns = {"t [s]": run.t[at], "torque_Nm": torque[at], "v [m/s]": noisy(rng, run.y[at, V], 0.004)}
        write_table(folder / f"{name}.csv", {**columns, "h [m]": counted(run.y[at, Q], 1e-3)}, 4)


V2, Q2 = 2, 3


@njit
def _belt(t: float, y: Array, u: float, p: Any, rate: Array, dry: Array) -> None:
    m, c, mu, k, d, m2 = p
    belt = k * (y[Q] - y[Q2]) + d * (y[V] - y[V2])
    rate[Q], rate[V] = y[V], (u - c * y[V] - belt) / m
    rate[V2], rate[Q2] = belt / m2, y[V2]
    dry[V] = mu / m


@machine(
    1406,
    Truth(
        "the elastic belt between motor and carriage; nominal is all that moves, the encoder is the motor's",
        right=("compliant_load",),
        part=("backlash",),
    ),
)
def belt_drive(folder: Path, rng: np.random.Generator) -> None:
    write_model(
        folder,
        """
plant: mass_spring_damper
axis: linear                      # at the belt
parameters: {m: 6.0, c: 9.0, k: 0.0}
effects:
  coulomb_friction: {mu: 7.0}
sign_scale: 0.0
operating_range: {displacement: 0.5, velocity: 1.5}
update_period: 0.05
signals: {force: "50.0 * M", displacement: "x_motor [mm]"}      # pulley of 20 mm
""",
    )
    for name, low, high in (("training", 0.3, 14.0), ("validation", 0.4, 20.0)):
        u = multisine(rng, times(16.0, 0.001), 90.0, low, high, 14)
        run = simulate(_belt, (0.0,) * 4, u, 0.001, (2.3, 8.6, 7.2, 9000.0, 9.0, 3.9), rng)
        at = run.at(0.004)
        columns = {
            "t [s]": run.t[at],
            "M [Nm]": noisy(rng, run.u[at] / 50, 0.01),
            "x_motor [mm]": 1e3 * counted(run.y[at, Q], 1e-5),
        }
        write_table(folder / f"{name}.csv", columns, 4)


@machine(
    1407,
    Truth(
        "dry friction of the bearings and the torsion bar of a steering column",
        right=("coulomb_friction+linear_stiffness",),
        part=("coulomb_friction", "linear_stiffness", "stribeck_friction", "dahl_presliding"),
        values={"coulomb_friction.mu": (0.55, 0.15), "linear_stiffness.k": (3.2, 0.15)},
    ),
)
def steering_column(folder: Path, rng: np.random.Generator) -> None:
    write_model(
        folder,
        """
plant: mass_spring_damper
axis: rotary
parameters: {m: 0.042, c: 0.12, k: 0.0}
sign_scale: 0.0
operating_range: {displacement: 1.5, velocity: 6.0}
update_period: 0.05
signals: {force: "hand torque [Nm]", displacement: "wheel angle [deg]"}
""",
    )
    for name, tones in (("training", 6), ("validation", 9)):
        t = times(25.0, 0.001)
        run = simulate(_waves, (0.0, 0.0), multisine(rng, t, 4.0, 0.15, 2.5, tones), 0.001,
                       (0.0432, 0.117, 0.55, 0.0, 1.0, 0.0, 3.2), rng)  # fmt: skip
        at = run.at(0.01)
        torque = filtered(noisy(rng, run.u, 0.03), 100.0, 0.001)
        columns = {"Time [s]": run.t[at], "hand torque [Nm]": torque[at]}
        write_table(folder / f"{name}.csv", {**columns, "wheel angle [deg]": rounded(np.degrees(run.y[at, Q]), 0.1)}, 3)


@machine(
    1408,
    Truth(
        "an amplifier that gives no more than 62 % of the torque that is commanded",
        right=("input_saturation",),
        values={"input_saturation.u_max": (1.86, 0.1)},
    ),
)
def weak_amplifier(folder: Path, rng: np.random.Generator) -> None:
    write_model(
        folder,
        """
plant: mass_spring_damper
axis: rotary
parameters: {m: 0.011, c: 0.02, k: 0.0}
effects:
  coulomb_friction: {mu: 0.12}
sign_scale: 0.0
operating_range: {displacement: 50.0, velocity: 60.0}
update_period: 0.05
signals: {force: "0.03 * torque_cmd_pct", velocity: "speed [1/min]"}
""",
    )
    for name, low, high in (("training", 0.3, 0.9), ("validation", 0.5, 1.3)):
        t = times(20.0, 0.001)
        wanted = filtered(steps(rng, t, -55.0, 55.0, low, high), 8.0, 0.001)
        c = (V, 0.2, 0.8, 0.001, 3.0, 0.1)
        run = simulate(_limited, (0.0, 0.0), wanted, 0.001, (0.0114, 0.0193, 0.118, 1.86), rng, speed_loop, c)
        at = run.at(0.005)
        speed = filtered(rate_of(counted(run.y[:, Q], 2 * np.pi / 20000), 0.001), 150.0, 0.001)
        columns = {"t [s]": run.t[at], "torque_cmd_pct": rounded(run.u[at] / 0.03, 0.1)}
        write_table(folder / f"{name}.csv", {**columns, "speed [1/min]": RPM * speed[at]}, 3)


@njit
def _limited(t: float, y: Array, u: float, p: Any, rate: Array, dry: Array) -> None:
    m, c, mu, most = p
    rate[Q] = y[V]
    rate[V] = (min(max(u, -most), most) - c * y[V]) / m
    dry[V] = mu / m
