"""Machines of which no effect of the catalogue tells what they hide: nothing may be confirmed."""

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
    rounded,
    simulate,
    speed_loop,
    steps,
    times,
    write_model,
    write_table,
)

I, W, Q = 0, 1, 2  # noqa: E741


@njit
def _window(t: float, y: Array, u: float, p: Any, rate: Array, dry: Array) -> None:
    R, L, K, B, J, mu, more, way = p
    rate[I] = (u - R * y[I] - K * y[W]) / L
    rate[W] = (K * y[I] - B * y[W]) / J
    rate[Q] = y[W]
    dry[W] = (mu + more * min(max(y[Q] / way, 0.0), 1.0) ** 2) / J


@machine(
    1601,
    Truth(
        "friction of a window lift whose seals grip ever harder on the way up",
        right=("unexplained",),
    ),
)
def window_lift(folder: Path, rng: np.random.Generator) -> None:
    write_model(
        folder,
        """
plant: dc_motor
parameters: {R_a: 0.62, L_a: 0.0005, K_t: 0.031, K_m: 0.031, B: 0.00009, J: 0.00021}
effects:
  coulomb_friction: {mu: 0.05}
sign_scale: 0.0
operating_range: {current: 12.0, speed: 300.0, position: 400.0}
update_period: 0.05
signals: {voltage: "Um [V]", current: "Im [A]", position: "hall [rad]"}
""",
    )
    for name, speed in (("training", 160.0), ("validation", 220.0)):
        t = times(24.0, 0.001)
        wanted = moves(rng, t, 10.0, 390.0, speed, 900.0)
        c = (Q, W, 8.0, 0.05, 0.3, 0.001, 13.5, 2 * np.pi / 48)
        p = (0.6, 0.0005, 0.0318, 0.000087, 0.00022, 0.045, 0.12, 400.0)
        run = simulate(_window, (0.0, 0.0, float(wanted[0])), wanted, 0.001, p, rng, position_loop, c)
        at = run.at(0.005)
        columns = {"t": run.t[at], "Um [V]": rounded(run.u[at], 0.05), "Im [A]": noisy(rng, run.y[at, I], 0.06)}
        write_table(folder / f"{name}.csv", {**columns, "hall [rad]": counted(run.y[at, Q], 2 * np.pi / 48)}, 4)


@njit
def _gusts(t: float, y: Array, u: float, p: Any, rate: Array, dry: Array) -> None:
    """A tracker in the wind: its torque is a sum of tones that nobody recorded, in y[2:] phases."""
    J, c, mu, A = p
    gust = 0.0
    for k in range(2, y.size):
        f = 0.05 * 1.37 ** (k - 2)
        gust += A / (1.0 + 2.0 * f) * np.sin(6.2831853 * f * t + y[k])
        rate[k] = 0.0
    rate[0], rate[1] = y[1], (u - c * y[1] + gust + 1.5 * A) / J
    dry[1] = mu / J


@machine(
    1602,
    Truth(
        "gusts of the wind on a solar tracker, about a mean load",
        right=("unexplained",),
        part=("constant_load",),
    ),
)
def solar_tracker(folder: Path, rng: np.random.Generator) -> None:
    write_model(
        folder,
        """
plant: mass_spring_damper
axis: rotary
parameters: {m: 260.0, c: 900.0, k: 0.0}
effects:
  coulomb_friction: {mu: 75.0}
sign_scale: 0.0
operating_range: {displacement: 1.0, velocity: 0.1}
update_period: 0.2
signals: {force: "M_drive [Nm]", displacement: "elevation [deg]"}
""",
    )
    for name, speed in (("training", 0.05), ("validation", 0.08)):
        t = times(90.0, 0.005)
        wanted = moves(rng, t, 0.2, 1.2, speed, 0.1)
        start = (float(wanted[0]), 0.0, *rng.uniform(0, 2 * np.pi, 10))
        c = (0, 1, 3.0, 2600.0, 5000.0, 0.005, 800.0, 1e-5)
        run = simulate(_gusts, start, wanted, 0.005, (266.0, 870.0, 77.0, 32.0), rng, position_loop, c, 2e-4)
        at = run.at(0.02)
        columns = {"t [s]": run.t[at], "M_drive [Nm]": noisy(rng, run.u[at], 1.0)}
        write_table(folder / f"{name}.csv", {**columns, "elevation [deg]": np.degrees(counted(run.y[at, 0], 1e-5))}, 5)


@njit
def _crane(t: float, y: Array, u: float, p: Any, rate: Array, dry: Array) -> None:
    """A trolley (position, velocity) with a load on a rope (angle, its rate): large angles."""
    m, c, mu, load, rope = p
    v, angle, spin = y[1], y[2], y[3]
    s, co = np.sin(angle), np.cos(angle)
    force = u - c * v + load * s * (rope * spin * spin + 9.81 * co)
    a = force / (m + load * s * s)
    rate[0], rate[1], rate[2] = v, a, spin
    rate[3] = -(a * co + 9.81 * s) / rope - 0.02 * spin
    dry[1] = mu / (m + load * s * s)


@machine(
    1603,
    Truth(
        "the load of a crane that swings below the trolley, up to 50 degrees; for small angles an elastic load",
        right=("unexplained", "compliant_load"),
        part=("backlash",),
    ),
)
def crane_trolley(folder: Path, rng: np.random.Generator) -> None:
    write_model(
        folder,
        """
plant: mass_spring_damper
axis: linear
parameters: {m: 4.2, c: 6.0, k: 0.0}
effects:
  coulomb_friction: {mu: 2.5}
sign_scale: 0.0
operating_range: {displacement: 2.0, velocity: 1.5}
update_period: 0.1
signals: {force: "F motor [N]", displacement: "trolley [mm]"}
""",
    )
    for name, low, high in (("training", 0.8, 2.0), ("validation", 1.2, 2.6)):
        t = times(40.0, 0.002)
        wanted = filtered(steps(rng, t, -0.7, 0.7, low, high), 1.2, 0.002)
        c = (1, 60.0, 40.0, 0.002, 80.0, 0.003)
        run = simulate(_crane, (0.0,) * 4, wanted, 0.002, (4.35, 5.8, 2.6, 2.4, 0.6), rng, speed_loop, c, 1e-4)
        at = run.at(0.01)
        columns = {"t": run.t[at], "F motor [N]": noisy(rng, run.u[at], 0.2)}
        write_table(folder / f"{name}.csv", {**columns, "trolley [mm]": 1e3 * counted(run.y[at, 0], 2e-5)}, 4)


@njit
def _preload(t: float, y: Array, u: float, p: Any, rate: Array, dry: Array) -> None:
    m, c, mu, fall, tau = p
    rate[0], rate[1] = y[1], (u - c * y[1]) / m
    dry[1] = mu * (1.0 - fall * (1.0 - np.exp(-t / tau))) / m


@machine(
    1604,
    Truth(
        "dry friction of a ball screw that falls to less than half within each record, as it warms up",
        right=("unexplained",),
    ),
)
def ball_screw_preload(folder: Path, rng: np.random.Generator) -> None:
    write_model(
        folder,
        """
plant: mass_spring_damper
axis: linear
parameters: {m: 85.0, c: 210.0, k: 0.0}
effects:
  coulomb_friction: {mu: 60.0}
tolerance: 0.1
sign_scale: 0.0
operating_range: {displacement: 0.3, velocity: 0.3}
update_period: 0.05
signals: {force: "F [N]", displacement: "x [mm]"}
""",
    )
    for name, speed in (("training", 0.15), ("validation", 0.22)):
        t = times(40.0, 0.001)
        wanted = moves(rng, t, -0.25, 0.25, speed, 1.0)
        c = (0, 1, 20.0, 3500.0, 20000.0, 0.001, 600.0, 1e-6)
        run = simulate(
            _preload, (float(wanted[0]), 0.0), wanted, 0.001, (87.0, 205.0, 62.0, 0.6, 12.0), rng, position_loop, c
        )
        at = run.at(0.01)
        columns = {"t [s]": run.t[at], "F [N]": noisy(rng, run.u[at], 0.8)}
        write_table(folder / f"{name}.csv", {**columns, "x [mm]": 1e3 * counted(run.y[at, 0], 1e-6)}, 4)


@njit
def _drives(t: float, y: Array, u: float, p: Any, rate: Array, dry: Array) -> None:
    J, c, mu, k, d, J2 = p
    belt = k * (y[0] - y[2]) + d * (y[1] - y[3])
    rate[0], rate[1] = y[1], (u - c * y[1] - belt) / J
    rate[2], rate[3] = y[3], belt / J2
    dry[1] = mu / J


@machine(
    1605,
    Truth(
        "the speed sensor of two coupled drives shows no sign",
        right=("refused", "unexplained"),
    ),
)
def coupled_drives(folder: Path, rng: np.random.Generator) -> None:
    write_model(
        folder,
        """
plant: mass_spring_damper
axis: rotary
parameters: {m: 0.004, c: 0.011, k: 0.0}
tolerance: 0.1
sign_scale: 0.0
operating_range: {displacement: 50.0, velocity: 40.0}
update_period: 0.1
signals: {force: "0.12 * u", velocity: "z"}
""",
    )
    for name, low, high in (("training", 0.5, 1.8), ("validation", 0.8, 2.5)):
        t = times(30.0, 0.002)
        u = 0.12 * steps(rng, t, -3.0, 3.0, low, high)
        run = simulate(_drives, (0.0,) * 4, u, 0.002, (0.0023, 0.0105, 0.012, 0.9, 0.003, 0.0018), rng, step=1e-4)
        at = run.at(0.02)
        columns = {"t": run.t[at], "u": run.u[at] / 0.12, "z": np.abs(noisy(rng, run.y[at, 3], 0.15))}
        write_table(folder / f"{name}.csv", columns, 4)


@njit
def _generator(t: float, y: Array, u: float, p: Any, rate: Array, dry: Array) -> None:
    J, c, mu, power = p
    rate[0], rate[1] = y[1], (u - c * y[1] - power * y[1] / (y[1] * y[1] + 400.0)) / J
    dry[1] = mu / J


@machine(
    1606,
    Truth(
        "a generator that takes a constant power, so that its torque falls with the speed",
        right=("unexplained",),
    ),
)
def generator_load(folder: Path, rng: np.random.Generator) -> None:
    write_model(
        folder,
        """
plant: mass_spring_damper
axis: rotary
parameters: {m: 0.035, c: 0.009, k: 0.0}
effects:
  coulomb_friction: {mu: 0.2}
sign_scale: 0.0
operating_range: {displacement: 1000.0, velocity: 200.0}
update_period: 0.1
signals: {force: "torque", velocity: "rpm [rpm]"}
""",
    )
    for name, low, high in (("training", 1.0, 3.0), ("validation", 1.5, 4.0)):
        t = times(40.0, 0.002)
        wanted = filtered(steps(rng, t, 10.0, 190.0, low, high), 1.5, 0.002)
        c = (1, 0.4, 0.8, 0.002, 9.0, 0.15)
        run = simulate(_generator, (0.0, 20.0), wanted, 0.002, (0.036, 0.0087, 0.21, 95.0), rng, speed_loop, c, 1e-4)
        at = run.at(0.01)
        columns = {"t": run.t[at], "torque": filtered(noisy(rng, run.u, 0.03), 80.0, 0.002)[at]}
        write_table(folder / f"{name}.csv", {**columns, "rpm [rpm]": RPM * noisy(rng, run.y[at, 1], 0.15)}, 3)


@njit
def _clutch(t: float, y: Array, u: float, p: Any, rate: Array, dry: Array) -> None:
    """A motor that drives a flywheel through a clutch: a stiff bristle that slips."""
    J, c, J2, c2, most = p
    slip = y[1] - y[2]
    torque = most * np.tanh(slip / 0.05)
    rate[0], rate[1] = y[1], (u - c * y[1] - torque) / J
    rate[2] = (torque - c2 * y[2]) / J2


@machine(
    1607,
    Truth(
        "a clutch to a flywheel that slips at 1.6 N m; nominal is the motor's inertia alone",
        right=("unexplained",),
        part=("dahl_presliding", "compliant_load"),
    ),
)
def slipping_clutch(folder: Path, rng: np.random.Generator) -> None:
    write_model(
        folder,
        """
plant: mass_spring_damper
axis: rotary
parameters: {m: 0.02, c: 0.03, k: 0.0}
sign_scale: 0.0
operating_range: {displacement: 100.0, velocity: 60.0}
update_period: 0.05
signals: {force: "T [N.m]", velocity: "w [rad/s]"}
""",
    )
    for name, tones in (("training", 7), ("validation", 10)):
        u = multisine(rng, times(20.0, 0.001), 5.0, 0.2, 4.0, tones)
        run = simulate(_clutch, (0.0,) * 3, u, 0.001, (0.0206, 0.029, 0.09, 0.02, 1.6), rng)
        at = run.at(0.005)
        columns = {"t": run.t[at], "T [N.m]": noisy(rng, run.u[at], 0.02), "w [rad/s]": noisy(rng, run.y[at, 1], 0.1)}
        write_table(folder / f"{name}.csv", columns, 4)
