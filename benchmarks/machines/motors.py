"""Motors driven by a voltage: on a bench, in a winch, from a battery."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numba import njit

from benchmarks.machines.rig import (
    RPM,
    Array,
    Run,
    Truth,
    counted,
    falling,
    filtered,
    machine,
    multisine,
    noisy,
    rate_of,
    rounded,
    simulate,
    speed_loop,
    staircase,
    steps,
    times,
    write_model,
    write_table,
)

I, W, Q = 0, 1, 2  # noqa: E741


@njit
def _motor(t: float, y: Array, u: float, p: Any, rate: Array, dry: Array) -> None:
    """A motor with friction that may fall with the speed."""
    R, L, K, B, J, mu, excess, v_s = p
    rate[I] = (u - R * y[I] - K * y[W]) / L
    rate[W] = (K * y[I] - B * y[W]) / J
    rate[Q] = y[W]
    dry[W] = falling(y[W], mu, excess, v_s) / J


@machine(
    1101,
    Truth(
        "Stribeck friction; only the voltage and an encoder of 2048 counts were recorded",
        right=("stribeck_friction",),
        part=("coulomb_friction", "lugre_friction"),
        values={"stribeck_friction.mu": (1.2e-3, 0.15), "stribeck_friction.excess": (1.0e-3, 0.4)},
    ),
)
def rotary_servo_unit(folder: Path, rng: np.random.Generator) -> None:
    write_model(
        folder,
        """
plant: dc_motor
parameters: {R_a: 8.4, L_a: 0.00116, K_t: 0.042, K_m: 0.042, B: 5.0e-6, J: 2.1e-5}
sign_scale: 0.0
operating_range: {current: 0.5, speed: 60.0}
update_period: 0.05
signals: {voltage: "u [V]", position: "theta [rad]"}
""",
    )
    p = (8.7, 0.00112, 0.0412, 5.2e-6, 2.2e-5, 1.2e-3, 1.0e-3, 1.5)
    count = 2 * np.pi / 2048
    for name, low, high in (("training", 0.3, 0.9), ("validation", 0.5, 1.4)):
        t = times(20.0, 0.002)
        u = steps(rng, t, -1.6, 1.6, low, high) + 0.5 * np.sin(2 * np.pi * 0.7 * t)
        run = simulate(_motor, (0.0, 0.0, 0.3), u, 0.002, p, rng)
        write_table(
            folder / f"{name}.csv", {"t [s]": run.t, "u [V]": run.u, "theta [rad]": counted(run.y[:, Q], count)}
        )


@njit
def _winch(t: float, y: Array, u: float, p: Any, rate: Array, dry: Array) -> None:
    R, L, K, B, J, load, kappa_d, kappa_e = p
    rate[I] = (u - R * y[I] - K * y[W]) / L
    rate[W] = (K * y[I] - load - B * y[W]) / J
    rate[Q] = y[W]
    dry[W] = (kappa_d * abs(K * y[I]) + kappa_e * load) / J


@machine(
    1102,
    Truth(
        "friction of a worm gear, which grows with the torque that it carries and with the weight",
        right=("load_dependent_friction",),
        part=("coulomb_friction", "load_dependent_stribeck"),
        values={"load_dependent_friction.kappa_d": (0.22, 0.25)},
    ),
)
def worm_winch(folder: Path, rng: np.random.Generator) -> None:
    write_model(
        folder,
        """
plant: dc_motor
parameters: {R_a: 0.36, L_a: 0.0009, K_t: 0.058, K_m: 0.058, B: 0.0004, J: 0.0011}
effects:
  constant_load: {F0: -0.245}
sign_scale: 0.0
operating_range: {current: 15.0, speed: 250.0}
update_period: 0.05
signals: {voltage: "U motor [V]", current: "I motor [A]", speed: "n [rpm]"}
""",
    )
    p = (0.37, 0.00088, 0.0587, 0.00041, 0.00114, 0.245, 0.22, 0.15)
    for name, low, high in (("training", 0.6, 1.6), ("validation", 0.9, 2.4)):
        t = times(24.0, 0.001)
        wanted = filtered(steps(rng, t, -180.0, 180.0, low, high), 2.0, 0.001)
        c = (W, 0.08, 0.5, 0.001, 24.0, 0.5)
        run = simulate(_winch, (0.0, 0.0, 0.0), wanted, 0.001, p, rng, speed_loop, c)
        at = run.at(0.005, 0.0002, rng)
        current = filtered(noisy(rng, run.y[:, I], 0.15), 200.0, 0.001)
        speed = rate_of(counted(run.y[:, Q], 2 * np.pi / 4000), 0.001, 5)
        columns = {"time [ms]": 1e3 * run.t[at], "U motor [V]": run.u[at], "I motor [A]": current[at]}
        write_table(folder / f"{name}.csv", {**columns, "n [rpm]": RPM * speed[at]}, 3)


@njit
def _battery_motor(t: float, y: Array, duty: float, p: Any, rate: Array, dry: Array) -> None:
    R, L, K, B, J, mu, full, inner = p
    rate[I] = (duty * (full - inner * duty * y[I]) - R * y[I] - K * y[W]) / L
    rate[W] = (K * y[I] - B * y[W]) / J
    rate[Q] = y[W]
    dry[W] = mu / J


@machine(
    1103,
    Truth(
        "Coulomb friction; duty cycle and the battery's voltage, which sags, were recorded",
        right=("coulomb_friction",),
        part=("stribeck_friction", "input_deadzone"),
        values={"coulomb_friction.mu": (0.028, 0.15)},
    ),
)
def battery_motor(folder: Path, rng: np.random.Generator) -> None:
    write_model(
        folder,
        """
plant: dc_motor
parameters: {R_a: 0.45, L_a: 0.0004, K_t: 0.035, K_m: 0.035, B: 0.00008, J: 0.0006}
sign_scale: 0.0
operating_range: {current: 15.0, speed: 250.0}
update_period: 0.05
signals: {voltage: "0.01 * duty_pct * u_bat", speed: "rpm [rpm]"}
""",
    )
    for name, tones in (("training", 7), ("validation", 10)):
        t = times(25.0, 0.001)
        duty = rounded(multisine(rng, t, 0.8, 0.1, 4.0, tones), 0.01)
        p = (0.46, 0.0004, 0.0343, 0.000082, 0.00063, 0.028, 12.6, 0.11)
        run = simulate(_battery_motor, (0.0, 0.0, 0.0), duty, 0.001, p, rng)
        at = run.at(0.01, 0.0003, rng)
        bat = filtered(12.6 - 0.11 * duty * run.y[:, I], 40.0, 0.001)
        speed = rate_of(counted(run.y[:, Q], 2 * np.pi / 1440), 0.001, 10)
        columns = {
            "t_ms": 1e3 * run.t[at],
            "duty_pct": 100 * duty[at],
            "u_bat": rounded(noisy(rng, bat, 0.02), 0.01)[at],
        }
        write_table(folder / f"{name}.csv", {**columns, "rpm": RPM * speed[at]}, 2)


@machine(
    1104,
    Truth(
        "Stribeck friction, seen at a staircase of constant speeds",
        right=("stribeck_friction",),
        part=("coulomb_friction", "lugre_friction"),
        values={"stribeck_friction.mu": (0.021, 0.15), "stribeck_friction.excess": (0.02, 0.4)},
    ),
)
def speed_staircase(folder: Path, rng: np.random.Generator) -> None:
    write_model(
        folder,
        """
plant: dc_motor
parameters: {R_a: 1.15, L_a: 0.0018, K_t: 0.052, K_m: 0.052, B: 0.00012, J: 0.00045}
sign_scale: 0.0
operating_range: {current: 3.0, speed: 120.0}
update_period: 0.05
signals: {voltage: "voltage [V]", current: "current [mA]", speed: "speed [rad/s]"}
""",
    )
    p = (1.19, 0.0017, 0.0509, 0.000125, 0.00043, 0.021, 0.02, 6.0)
    up = [0.0, 1.0, 2.0, 4.0, 7.0, 11.0, 16.0, 25.0, 40.0, 70.0]
    stairs = {
        "training": [*up, *(-v for v in up)],
        "validation": [0.0, *(s * v * 1.3 for v in up[:0:-1] for s in (1, -1))],
    }
    for name, levels in stairs.items():
        t = times(30.0, 0.001)
        c = (W, 0.04, 1.2, 0.001, 12.0, 0.15)
        run = simulate(_motor, (0.0, 0.0, 0.0), staircase(t, levels), 0.001, p, rng, speed_loop, c)
        at = run.at(0.01)
        current = filtered(noisy(rng, run.y[:, I], 0.04), 100.0, 0.001)
        speed = filtered(noisy(rng, run.y[:, W], 0.15), 100.0, 0.001)
        columns = {"time [s]": run.t[at], "voltage [V]": run.u[at], "current [mA]": 1e3 * current[at]}
        write_table(folder / f"{name}.csv", {**columns, "speed [rad/s]": speed[at]}, 3)


@machine(
    1105,
    Truth(
        "Coulomb friction; the speed is what an encoder counted within the last 40 ms",
        right=("coulomb_friction", "coulomb_friction+sensor_delay"),
        part=("stribeck_friction", "sensor_delay", "input_delay"),
        values={"coulomb_friction.mu": (0.034, 0.15), "sensor_delay.speed": (0.02, 0.4)},
    ),
)
def counted_speed(folder: Path, rng: np.random.Generator) -> None:
    write_model(
        folder,
        """
plant: dc_motor
parameters: {R_a: 0.9, L_a: 0.0012, K_t: 0.07, K_m: 0.07, B: 0.0002, J: 0.002}
sign_scale: 0.0
operating_range: {current: 5.0, speed: 90.0}
update_period: 0.1
signals: {voltage: "u", current: "i", speed: "n [rpm]"}
""",
    )
    p = (0.87, 0.0012, 0.0715, 0.00019, 0.00208, 0.034, 0.0, 1.0)
    for name, low, high in (("training", 0.4, 1.2), ("validation", 0.7, 1.9)):
        t = times(20.0, 0.001)
        run = simulate(_motor, (0.0, 0.0, 0.0), steps(rng, t, -7.0, 7.0, low, high), 0.001, p, rng)
        at = run.at(0.01)
        speed = rate_of(counted(run.y[:, Q], 2 * np.pi / 1000), 0.001, 40)
        columns = {"t": run.t[at], "u": run.u[at], "i": noisy(rng, run.y[at, I], 0.03)}
        write_table(folder / f"{name}.csv", {**columns, "n [rpm]": RPM * speed[at]}, 4)


W2, Q2 = 3, 4


@njit
def _coupled(t: float, y: Array, u: float, p: Any, rate: Array, dry: Array) -> None:
    """A motor, a coupling with play and a load; dry friction on the motor's side."""
    R, L, K, B, J, mu, k, c, J2, gap = p
    way = y[Q] - y[Q2]
    inside = max(way - gap, 0.0) - max(-way - gap, 0.0)
    torque = k * inside + (c * (y[W] - y[W2]) if abs(way) >= gap else 0.0)
    rate[I] = (u - R * y[I] - K * y[W]) / L
    rate[W] = (K * y[I] - B * y[W] - torque) / J
    rate[Q], rate[W2], rate[Q2] = y[W], torque / J2, y[W2]
    dry[W] = mu / J


COUPLED = """
plant: dc_motor
parameters: {R_a: 1.4, L_a: 0.002, K_t: 0.09, K_m: 0.09, B: 0.0003, J: 0.0005}
effects:
  coulomb_friction: {mu: 0.03}
sign_scale: 0.0
operating_range: {current: 6.0, speed: 90.0}
update_period: 0.05
signals: {voltage: "u [V]", current: "i [A]", position: "phi [deg]"}
"""


def _coupled_record(path: Path, run: Run, rng: np.random.Generator) -> None:
    at = run.at(0.004, 0.0001, rng)
    phi = np.degrees(counted(run.y[:, Q], 2 * np.pi / 8192))
    columns = {"t [s]": run.t[at], "u [V]": run.u[at], "i [A]": rounded(noisy(rng, run.y[at, I], 0.02), 0.005)}
    write_table(path, {**columns, "phi [deg]": phi[at]}, 4)


@machine(
    1106,
    Truth(
        "a load behind an elastic coupling; nominal is the inertia of the motor's side, where the encoder is",
        right=("compliant_load",),
        part=("backlash",),
        values={"compliant_load.k": (4.5, 0.15), "compliant_load.J": (0.0009, 0.15)},
    ),
)
def elastic_coupling(folder: Path, rng: np.random.Generator) -> None:
    write_model(folder, COUPLED)
    p = (1.43, 0.0019, 0.0885, 0.00031, 0.00052, 0.031, 4.5, 0.004, 0.0009, 0.0)
    for name, low, high in (("training", 0.1, 10.0), ("validation", 0.15, 20.0)):
        u = multisine(rng, times(16.0, 0.001), 9.0, low, high, 14)
        _coupled_record(folder / f"{name}.csv", simulate(_coupled, (0.0,) * 5, u, 0.001, p, rng), rng)


@machine(
    1107,
    Truth(
        "a load behind a coupling with play; nominal is the inertia of the motor's side, where the encoder is",
        right=("backlash",),
        part=("compliant_load",),
        values={"backlash.gap": (0.03, 0.25), "backlash.J": (0.0012, 0.2)},
    ),
)
def worn_coupling(folder: Path, rng: np.random.Generator) -> None:
    write_model(folder, COUPLED)
    p = (1.37, 0.0021, 0.0915, 0.00029, 0.00049, 0.0295, 60.0, 0.05, 0.0012, 0.03)
    for name, low, high in (("training", 0.1, 8.0), ("validation", 0.15, 12.0)):
        u = multisine(rng, times(16.0, 0.001), 9.0, low, high, 12)
        _coupled_record(folder / f"{name}.csv", simulate(_coupled, (0.0,) * 5, u, 0.001, p, rng), rng)
