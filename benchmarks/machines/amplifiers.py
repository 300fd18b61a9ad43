"""What lies before the machine, or changes with its warmth: buses, valves, windings, oil."""

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
    late,
    machine,
    moves,
    multisine,
    noisy,
    position_loop,
    rate_of,
    rounded,
    simulate,
    steps,
    times,
    write_model,
    write_table,
)

Q, V = 0, 1


@njit
def _plain(t: float, y: Array, u: float, p: Any, rate: Array, dry: Array) -> None:
    m, c, mu = p
    rate[Q], rate[V] = y[V], (u - c * y[V]) / m
    dry[V] = mu / m


@machine(
    1801,
    Truth(
        "a bus that hands the commanded torque on 18 ms late",
        right=("input_delay",),
        part=("sensor_delay",),
        values={"input_delay.T": (0.018, 0.2)},
    ),
)
def late_bus(folder: Path, rng: np.random.Generator) -> None:
    write_model(
        folder,
        """
plant: mass_spring_damper
axis: rotary
parameters: {m: 0.021, c: 0.05, k: 0.0}
effects:
  coulomb_friction: {mu: 0.2}
sign_scale: 0.0
operating_range: {displacement: 30.0, velocity: 40.0}
update_period: 0.05
signals: {force: "cmd_torque [N.m]", displacement: "pos [rad]", velocity: "vel [rad/s]"}
""",
    )
    for name, low, high in (("training", 0.15, 0.6), ("validation", 0.25, 0.9)):
        t = times(20.0, 0.001)
        command = steps(rng, t[::5], -2.0, 2.0, low, high).repeat(5)
        run = simulate(_plain, (0.0, 0.0), late(command, 18), 0.001, (0.0217, 0.048, 0.194), rng)
        at = run.at(0.005)
        speed = filtered(rate_of(counted(run.y[:, Q], 2 * np.pi / 2**18), 0.001), 250.0, 0.001)
        columns = {
            "t": run.t[at],
            "cmd_torque [N.m]": command[at],
            "pos [rad]": counted(run.y[at, Q], 2 * np.pi / 2**18),
        }
        write_table(folder / f"{name}.csv", {**columns, "vel [rad/s]": speed[at]}, 5)


@njit
def _overlap(t: float, y: Array, u: float, p: Any, rate: Array, dry: Array) -> None:
    m, c, mu, d = p
    rate[Q], rate[V] = y[V], (max(u - d, 0.0) - max(-u - d, 0.0) - c * y[V]) / m
    dry[V] = mu / m


@machine(
    1802,
    Truth(
        "the overlap of a proportional valve: nothing flows for small commands",
        right=("input_deadzone",),
        part=("coulomb_friction",),
        values={"input_deadzone.d": (110.0, 0.15)},
    ),
)
def valve_overlap(folder: Path, rng: np.random.Generator) -> None:
    write_model(
        folder,
        """
plant: mass_spring_damper
axis: linear                       # the valve's opening acts like a force on a well damped piston
parameters: {m: 60.0, c: 1900.0, k: 0.0}
effects:
  coulomb_friction: {mu: 40.0}
sign_scale: 0.0
operating_range: {displacement: 0.5, velocity: 0.6}
update_period: 0.05
signals: {force: "120.0 * valve_V", displacement: "x [mm]"}
""",
    )
    for name, tones in (("training", 7), ("validation", 10)):
        t = times(25.0, 0.001)
        u = multisine(rng, t, 1100.0, 0.1, 3.0, tones)
        run = simulate(_overlap, (0.0, 0.0), u, 0.001, (62.0, 1830.0, 41.0, 110.0), rng, step=1e-4)
        at = run.at(0.005, 0.0001, rng)
        columns = {
            "t": run.t[at],
            "valve_V": rounded(run.u[at] / 120, 0.005),
            "x [mm]": noisy(rng, 1e3 * run.y[at, Q], 0.02),
        }
        write_table(folder / f"{name}.csv", columns, 4)


@njit
def _hot(t: float, y: Array, u: float, p: Any, rate: Array, dry: Array) -> None:
    R, L, K, B, J, mu, heat, cooling = p
    warm = R * (1.0 + 0.0039 * y[3])
    rate[0] = (u - warm * y[0] - K * y[1]) / L
    rate[1] = (K * y[0] - B * y[1]) / J
    rate[2] = y[1]
    rate[3] = (warm * y[0] * y[0] - y[3] / cooling) / heat
    dry[1] = mu / J


@machine(
    1803,
    Truth(
        "the winding of a motor that warms up by some 60 K",
        right=("thermal_resistance",),
        part=("torque_constant_saturation",),
    ),
)
def hot_winding(folder: Path, rng: np.random.Generator) -> None:
    write_model(
        folder,
        """
plant: dc_motor
parameters: {R_a: 1.6, L_a: 0.002, K_t: 0.06, K_m: 0.06, B: 0.0004, J: 0.0012}
effects:
  coulomb_friction: {mu: 0.05}
tolerance: {R_a: 0.03}
sign_scale: 0.0
operating_range: {current: 8.0, speed: 120.0}
update_period: 0.1
signals: {voltage: "V [V]", current: "I [A]", speed: "speed [rpm]"}
""",
    )
    for name, low, high in (("training", 0.5, 1.5), ("validation", 0.8, 2.2)):
        t = times(60.0, 0.001)
        u = steps(rng, t, -14.0, 14.0, low, high)
        p = (1.57, 0.0021, 0.0612, 0.00042, 0.00117, 0.052, 3.0, 12.0)
        run = simulate(_hot, (0.0,) * 4, u, 0.001, p, rng, step=5e-5)
        at = run.at(0.01)
        columns = {"t": run.t[at], "V [V]": run.u[at], "I [A]": noisy(rng, run.y[at, 0], 0.03)}
        write_table(folder / f"{name}.csv", {**columns, "speed [rpm]": RPM * noisy(rng, run.y[at, 1], 0.1)}, 4)


@njit
def _oil(t: float, y: Array, u: float, p: Any, rate: Array, dry: Array) -> None:
    m, c, mu, a, first, rise, tau = p
    kelvin = first + rise * (1.0 - np.exp(-t / tau)) - 20.0
    rate[Q], rate[V] = y[V], (u - c * y[V]) / m
    dry[V] = mu * np.exp(-a * kelvin) / m


@machine(
    1804,
    Truth(
        "dry friction that falls as the oil of a gear warms up; the oil's temperature was recorded",
        right=("temperature_dependent_friction",),
        part=("coulomb_friction",),
        values={"temperature_dependent_friction.mu": (6.0, 0.15)},
    ),
)
def warming_gear(folder: Path, rng: np.random.Generator) -> None:
    write_model(
        folder,
        """
plant: mass_spring_damper
axis: rotary
parameters: {m: 1.9, c: 1.4, k: 0.0}
sign_scale: 0.0
operating_range: {displacement: 3.0, velocity: 3.0}
update_period: 0.1
signals: {force: "tau [N.m]", displacement: "q [rad]"}
""",
    )
    for name, first, speed in (("training", 22.0, 1.5), ("validation", 35.0, 2.2)):
        t = times(60.0, 0.002)
        wanted = moves(rng, t, -2.5, 2.5, speed, 8.0)
        c = (Q, V, 10.0, 30.0, 90.0, 0.002, 60.0, 2 * np.pi / 2**17)
        p = (1.96, 1.34, 6.0, 0.016, first, 34.0, 25.0)
        run = simulate(_oil, (float(wanted[0]), 0.0), wanted, 0.002, p, rng, position_loop, c, 1e-4)
        at = run.at(0.02)
        oil = first + 34.0 * (1.0 - np.exp(-run.t[at] / 25.0))
        columns = {"t": run.t[at], "tau [N.m]": noisy(rng, run.u[at], 0.06)}
        columns |= {"q [rad]": counted(run.y[at, Q], 2 * np.pi / 2**17), "temperature [K]": rounded(oil, 0.1) + 273.15}
        write_table(folder / f"{name}.csv", columns, 5)
