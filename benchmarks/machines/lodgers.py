"""Machines with small imperfections beside what they hide: firmware's loops, drives' logs, valves, rudders, reels."""

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
    moves,
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

Q, V = 0, 1
G = 9.80665
STEP = 1e-4
"""Of the integration, s; axes of some kilograms need no finer one."""
LATE = ("input_delay", "sensor_delay")
"""Every controller holds its command for a tick, and every filter of a channel makes it late."""


@njit
def tracking(r: float, y: Array, z: Array, memory: Array, c: Any) -> float:
    """Follow a position by PID with a filtered derivative, and the torque of the reference's acceleration ahead.

    c is (position, K_p, K_i, K_d, the derivative's share of a new value, tick, limit, encoder's step, inertia).
    """
    position, K_p, K_i, K_d, share, tick, limit, count, inertia = c
    q = np.floor(y[int(position)] / count) * count
    if memory[3] == 0.0:
        memory[1], memory[3], memory[4] = q, 1.0, r
    rate = (r - memory[4]) / tick
    ahead = inertia * (rate - memory[5]) / tick
    memory[2] += share * (rate - (q - memory[1]) / tick - memory[2])
    memory[1], memory[4], memory[5] = q, r, rate
    u = K_p * (r - q) + K_d * memory[2] + memory[0] + ahead
    if abs(u) < limit:
        memory[0] += K_i * tick * (r - q)
    return min(max(u, -limit), limit)


def smooth(x: Array, cutoff: float, tick: float) -> Array:
    """Return a profile without corners, as a drive with a jerk limit makes it."""
    return filtered(filtered(x, cutoff, tick), cutoff, tick)


def logged(run: Run, rng: np.random.Generator, period: float, began: float = 0.0, lost: float = 0.0) -> Any:
    """Return the ticks that a log has: of some period, from a time (s) on, a share of the rows lost."""
    at = run.at(period)
    at = at[run.t[at] >= began]
    return at[rng.random(len(at)) >= lost]


# Servos of which goal and position were recorded


@njit
def _firmware(t: float, y: Array, u: float, p: Any, rate: Array, dry: Array) -> None:
    """A servo under its firmware's PID; y is position, speed, integral, filtered speed, goal of the profile."""
    gain, ki, kd, lag, profile, supply, R, K, J, weight, mu, wave = p
    goal = u if profile == 0.0 else y[4]
    e = goal - y[Q]
    asked = gain * e + ki * y[2] - kd * y[3]
    duty = min(max(asked, -1.0), 1.0)
    rate[Q] = y[V]
    rate[V] = (K * (duty * supply - K * y[V]) / R - weight * np.sin(y[Q]) - wave * np.sin(8.0 * y[Q] + 0.5)) / J
    rate[2] = e if asked == duty else 0.0
    rate[3] = (y[V] - y[3]) / lag
    rate[4] = 0.0 if profile == 0.0 else (u - y[4]) / profile
    dry[V] = mu / J


def _servo(
    folder: Path, rng: np.random.Generator, values: str, effects: str, p: tuple[float, ...], tick: float,
    zero: float, period: float, cutoff: float,
) -> None:  # fmt: skip
    """Write file and logs of a servo; goals and positions in ticks of some radians about a zero."""
    write_model(
        folder,
        f"""
plant: servo
parameters: {{K_t: 0.42, R: 4.1, J: 0.0024, kp: 1.0, duty_per_error: 1.5, vin: 6.0, {values}}}
effects:
  viscous_friction: {{b: 0.004}}{effects}
sign_scale: 0.0
operating_range: {{position: 1.6, goal_position: 1.6, speed: 10.0}}
update_period: 0.05
tolerance: {{K_t: 0.2, R: 0.2, J: 0.2, duty_per_error: 0.2}}
frozen: [kp, vin]
signals: {{goal_position: "{tick:.9f} * (goal - {zero:g})", position: "{tick:.9f} * (pos - {zero:g})"}}
""",
    )
    for name, low, high, shortest in (("training", -0.9, 0.7, 0.4), ("validation", -0.7, 1.2, 0.6)):
        t = times(30.0, 0.002)
        goal = rounded(smooth(steps(rng, t, low, high, shortest, 3.0 * shortest), cutoff, 0.002), tick)
        first = float(goal[0])
        run = simulate(_firmware, (first, 0.0, 0.0, 0.0, first), goal, 0.002, p, rng, step=STEP)
        at = logged(run, rng, period, 1.5)
        columns = {"ms": 1e3 * run.t[at], "goal": goal[at] / tick + zero}
        write_table(folder / f"{name}.csv", {**columns, "pos": np.floor(run.y[at, Q] / tick + zero)}, 0)


INERTIA = 0.0023 + 0.3 * 0.12**2
WEIGHT = 0.3 * G * 0.12
FINE, COARSE = 0.001533981, 0.005061455
"""Radians of a tick: 4096 in a turn, 1024 in 300 degrees."""


@machine(
    2101,
    Truth(
        "Coulomb friction of a PD servo with S-shaped goals, in ticks of 0.29 degrees at 50 Hz",
        right=("coulomb_friction",),
        part=("stribeck_friction", "load_dependent_friction"),
        also=(*LATE, "cogging_torque", "torque_ripple"),
        values={"coulomb_friction.mu": (0.05, 0.2)},
    ),
)
def coarse_servo(folder: Path, rng: np.random.Generator) -> None:
    p = (1.55, 0.0, 0.045, 0.004, 0.0, 6.0, 4.0, 0.43, INERTIA, WEIGHT, 0.05, 0.004)
    _servo(folder, rng, "kd: 0.03, mass: 0.3, length: 0.12", "", p, COARSE, 512.0, 0.02, 2.5)


@machine(
    2102,
    Truth(
        "the weight of what a PI servo carries; its file knows the inertia and no mass",
        right=("gravity_load", "cogging_torque"),
        part=("linear_stiffness", "cubic_stiffness", "constant_load"),
        also=LATE,
        values={"gravity_load.A": (WEIGHT, 0.15)},
    ),
)
def carrying_servo(folder: Path, rng: np.random.Generator) -> None:
    p = (1.55, 1.3, 0.0, 0.004, 0.0, 6.0, 4.0, 0.43, INERTIA, WEIGHT, 0.0305, 0.003)
    _servo(folder, rng, "ki: 0.85, inertia: 0.0043", "\n  coulomb_friction: {mu: 0.03}", p, FINE, 2048.0, 0.01, 4.0)


@machine(2103, Truth("nothing", right=("adequate",), also=(*LATE, "cogging_torque", "torque_ripple")))
def sound_profile_servo(folder: Path, rng: np.random.Generator) -> None:
    p = (1.55, 0.0, 0.045, 0.004, 0.083, 6.0, 4.0, 0.43, INERTIA, WEIGHT, 0.0305, 0.004)
    values = "kd: 0.03, profile_time: 0.08, mass: 0.3, length: 0.12"
    _servo(folder, rng, values, "\n  coulomb_friction: {mu: 0.03}", p, FINE, 2048.0, 0.02, 8.0)


# Axes of which effort and position or speed were recorded


@njit
def _axis(t: float, y: Array, u: float, p: Any, rate: Array, dry: Array) -> None:
    """A mass with a spring, a load, friction, waves along the way and gusts in time."""
    m, c, k, load, mu, excess, v_s, share, wave, order, gust = p
    wind = gust * (np.sin(2.9 * t) + np.sin(1.13 * t + 1.0) + 0.6 * np.sin(4.7 * t + 2.0))
    rate[Q] = y[V]
    rate[V] = (u + load + wind - c * y[V] - k * y[Q] - wave * np.sin(order * y[Q] + 0.4)) / m
    dry[V] = (falling(y[V], mu, excess, v_s) + share * abs(u)) / m


def _values(
    m: float, c: float, k: float = 0.0, load: float = 0.0, mu: float = 0.0, excess: float = 0.0, v_s: float = 1.0,
    share: float = 0.0, wave: float = 0.0, order: float = 1.0, gust: float = 0.0,
) -> tuple[float, ...]:  # fmt: skip
    return (m, c, k, load, mu, excess, v_s, share, wave, order, gust)


def _model(
    values: str, axis: str, spread: str, signals: str, effects: str = "", tolerance: str = "0.15", update: float = 0.05
) -> str:
    listed = f"\neffects:\n  {effects}" if effects else ""
    return f"""
plant: mass_spring_damper
axis: {axis}
parameters: {{{values}}}{listed}
tolerance: {tolerance}
sign_scale: 0.0
operating_range: {{{spread}}}
update_period: {update}
signals: {{{signals}}}
"""


def _percent_drive(folder: Path, rng: np.random.Generator, levels: tuple[float, float], effects: str) -> None:
    """Write the logs of a drive that tells its torque in per cent of 2.39 N m, and its own filter's speed."""
    signals = 'force: "0.0239 * torque_pct", velocity: "n_act [rpm]"'
    write_model(folder, _model("m: 0.0020, c: 0.0011, k: 0.0", "rotary", "velocity: 160.0", signals, effects))
    for name, low, mu in (("training", 0.5, levels[0]), ("validation", 0.8, levels[1])):
        t = times(24.0, 0.001)
        wanted = smooth(steps(rng, t, -110.0, 150.0, low, 3.0 * low), 4.0, 0.001)
        p = _values(0.00212, 0.00104, mu=mu, excess=0.01, v_s=4.0, wave=0.02, order=6.0)
        run = simulate(_axis, (0.0, 0.0), wanted, 0.001, p, rng, speed_loop, (V, 0.12, 1.1, 0.001, 3.6, 0.2), STEP)
        at = logged(run, rng, 0.004, 1.7, 0.01)
        shown = filtered(noisy(rng, run.y[:, V], 0.4), 110.0, 0.001)[at]
        columns = {"t": run.t[at], "torque_pct": rounded(run.u[at] / 0.0239, 0.1)}
        write_table(folder / f"{name}.csv", {**columns, "n_act [rpm]": rounded(RPM * shown, 0.1)}, 3)


@machine(
    2104,
    Truth(
        "Coulomb friction of a drive, 20 % less in the second record; torque in per cent, rows lost, from full motion",
        right=("coulomb_friction",),
        part=("stribeck_friction", "load_dependent_friction"),
        also=(*LATE, "cogging_torque", "torque_ripple"),
        values={"coulomb_friction.mu": (0.2, 0.15)},
    ),
)
def percent_drive(folder: Path, rng: np.random.Generator) -> None:
    _percent_drive(folder, rng, (0.2, 0.16), "")


@machine(2105, Truth("nothing", right=("adequate",), also=(*LATE, "cogging_torque", "stribeck_friction")))
def sound_percent_drive(folder: Path, rng: np.random.Generator) -> None:
    _percent_drive(folder, rng, (0.2, 0.2), "coulomb_friction: {mu: 0.21}")


@machine(
    2106,
    Truth(
        "the moment of the flow on a boat's rudder, like a spring; waves strike it",
        right=("linear_stiffness",),
        part=("gravity_load", "cubic_stiffness", "constant_load"),
        also=LATE,
        values={"linear_stiffness.k": (900.0, 0.1)},
    ),
)
def boat_rudder(folder: Path, rng: np.random.Generator) -> None:
    signals = 'force: "0.4 * dp_kPa", displacement: "rudder [deg]"'
    write_model(
        folder,
        _model("m: 60.0, c: 420.0, k: 0.0", "rotary", "displacement: 0.6, velocity: 0.2", signals,
               "coulomb_friction: {mu: 60.0}"),
    )  # fmt: skip
    for name, way, speed in (("training", 0.35, 0.1), ("validation", 0.5, 0.14)):
        t = times(60.0, 0.002)
        wanted = smooth(moves(rng, t, -way, way, speed, 4.0 * speed), 3.0, 0.002)
        p = _values(63.0, 410.0, k=900.0, mu=62.0, excess=4.0, v_s=0.01, gust=2.5)
        c = (Q, V, 6.0, 1500.0, 5000.0, 0.002, 900.0, 2 * np.pi / 2**14)
        run = simulate(_axis, (float(wanted[0]), 0.0), wanted, 0.002, p, rng, position_loop, c, 2e-4)
        at = logged(run, rng, 0.02, 4.0)
        columns = {"t [s]": run.t[at], "dp_kPa": noisy(rng, run.u[at] / 0.4, 3.0)}
        write_table(
            folder / f"{name}.csv", {**columns, "rudder [deg]": np.degrees(counted(run.y[at, Q], 2 * np.pi / 2**14))}, 4
        )


@machine(
    2107,
    Truth(
        "the torque of a harmonic drive's wave generator, twice a turn of the motor",
        right=("cogging_torque", "torque_ripple"),
        part=("coulomb_friction", "stribeck_friction"),
        also=(*LATE, "stribeck_friction", "load_dependent_friction"),
        values={"cogging_torque.A": (0.02, 0.15), "cogging_torque.N": (2.0, 0.001)},
    ),
)
def wave_generator(folder: Path, rng: np.random.Generator) -> None:
    signals = 'force: "0.118 * iq [A]", displacement: "motor_pos [rad]"'
    write_model(
        folder,
        _model("m: 1.2e-4, c: 5.5e-4, k: 0.0", "rotary", "displacement: 60.0, velocity: 60.0", signals,
               "coulomb_friction: {mu: 0.03}"),
    )  # fmt: skip
    for name, way, speed in (("training", 40.0, 30.0), ("validation", 60.0, 45.0)):
        t = times(20.0, 0.001)
        wanted = smooth(moves(rng, t, -way, way, speed, 8.0 * speed), 15.0, 0.001)
        p = _values(1.26e-4, 5.3e-4, load=-0.0006, mu=0.031, excess=0.001, v_s=2.0, share=0.012, wave=0.02, order=2.0)
        c = (Q, 1.2, 12.0, 0.012, 0.4, 0.001, 0.4, 2 * np.pi / 2**14, 1.2e-4)
        run = simulate(_axis, (float(wanted[0]), 0.0), wanted, 0.001, p, rng, tracking, c, 5e-5)
        at = logged(run, rng, 0.002, 0.9)
        columns = {"t [s]": run.t[at], "iq [A]": noisy(rng, run.u[at] / 0.118, 0.004)}
        write_table(folder / f"{name}.csv", {**columns, "motor_pos [rad]": counted(run.y[at, Q], 2 * np.pi / 2**14)}, 5)


@machine(
    2108,
    Truth(
        "the mean wind on an antenna, with weak gusts; the second record is made elsewhere in its range",
        right=("constant_load",),
        part=("coulomb_friction",),
        also=(*LATE, "stribeck_friction"),
        values={"constant_load.F0": (-120.0, 0.1)},
    ),
)
def windy_antenna(folder: Path, rng: np.random.Generator) -> None:
    signals = 'force: "11.8 * current_A", displacement: "az [deg]"'
    write_model(
        folder,
        _model("m: 92.0, c: 62.0, k: 0.0", "rotary", "displacement: 1.6, velocity: 0.4", signals,
               "coulomb_friction: {mu: 80.0}"),
    )  # fmt: skip
    for name, low, high, speed in (("training", -1.0, 0.2, 0.2), ("validation", 0.0, 1.4, 0.3)):
        t = times(40.0, 0.001)
        wanted = smooth(moves(rng, t, low, high, speed, 4.0 * speed), 6.0, 0.001)
        p = _values(95.0, 60.0, load=-120.0, mu=82.0, excess=3.0, v_s=0.02, gust=1.5)
        c = (Q, 9000.0, 20000.0, 2200.0, 0.2, 0.001, 600.0, 2 * np.pi / 2**20, 92.0)
        run = simulate(_axis, (float(wanted[0]), 0.0), wanted, 0.001, p, rng, tracking, c, STEP)
        at = logged(run, rng, 0.01, 2.0)
        columns = {"t": run.t[at], "current_A": noisy(rng, run.u[at] / 11.8, 0.15)}
        write_table(
            folder / f"{name}.csv", {**columns, "az [deg]": np.degrees(counted(run.y[at, Q], 2 * np.pi / 2**20))}, 5
        )


@machine(
    2109,
    Truth(
        "the preloaded spring that closes a control valve; its lift was recorded in per cent",
        right=("linear_stiffness+constant_load",),
        part=("linear_stiffness", "constant_load", "cubic_stiffness"),
        also=LATE,
        values={"linear_stiffness.k": (18000.0, 0.1)},
    ),
)
def spring_return(folder: Path, rng: np.random.Generator) -> None:
    signals = 'force: "0.031 * p_Pa", displacement: "0.0004 * lift_pct"'
    write_model(
        folder,
        _model("m: 6.0, c: 310.0, k: 0.0", "linear", "displacement: 0.04, velocity: 0.05", signals,
               "coulomb_friction: {mu: 88.0}"),
    )  # fmt: skip
    for name, low, high, speed in (("training", 0.004, 0.026, 0.02), ("validation", 0.012, 0.037, 0.03)):
        t = times(30.0, 0.001)
        wanted = smooth(moves(rng, t, low, high, speed, 6.0 * speed), 5.0, 0.001)
        p = _values(6.2, 300.0, k=18000.0, load=-600.0, mu=90.0, excess=8.0, v_s=0.002)
        c = (Q, 30000.0, 90000.0, 900.0, 0.2, 0.001, 2500.0, 1e-6, 6.0)
        run = simulate(_axis, (float(wanted[0]), 0.0), wanted, 0.001, p, rng, tracking, c, STEP)
        at = logged(run, rng, 0.01, 1.5)
        columns = {"t [s]": run.t[at], "p_Pa": noisy(rng, run.u[at] / 0.031, 60.0)}
        write_table(folder / f"{name}.csv", {**columns, "lift_pct": rounded(run.y[at, Q] / 0.0004, 0.01)}, 4)


@njit
def _upright(t: float, y: Array, u: float, p: Any, rate: Array, dry: Array) -> None:
    """A pendulum that stands on its joint, its angle counted from above."""
    J, c, A, mu, wave = p
    rate[Q], rate[V] = y[V], (u + A * np.sin(y[Q]) - c * y[V] - wave * np.sin(y[Q] * 12.0)) / J
    dry[V] = mu / J


@machine(
    2110,
    Truth(
        "the weight of a pendulum that is held upright by its joint, and leans up to 60 degrees",
        right=("gravity_load", "cogging_torque"),
        part=("linear_stiffness", "cubic_stiffness"),
        also=LATE,
        values={"gravity_load.A": (1.6, 0.1)},
    ),
)
def upright_pendulum(folder: Path, rng: np.random.Generator) -> None:
    signals = 'force: "0.02 * pwm", displacement: "theta_deg"'
    write_model(
        folder,
        _model("m: 0.07, c: 0.02, k: 0.0", "rotary", "displacement: 1.2, velocity: 4.0", signals,
               "coulomb_friction: {mu: 0.05}"),
    )  # fmt: skip
    for name, way, speed in (("training", 0.7, 1.2), ("validation", 1.0, 1.7)):
        t = times(24.0, 0.002)
        wanted = smooth(moves(rng, t, -way, way, speed, 6.0 * speed), 6.0, 0.002)
        c = (Q, 18.0, 40.0, 1.1, 0.4, 0.002, 4.0, 2 * np.pi / 2**13, 0.07)
        run = simulate(_upright, (float(wanted[0]), 0.0), wanted, 0.002, (0.073, 0.019, 1.6, 0.052, 0.015), rng,
                       tracking, c, STEP)  # fmt: skip
        at = logged(run, rng, 0.01, 1.0)
        columns = {"t_ms": 1e3 * run.t[at], "pwm": np.round(run.u[at] / 0.02)}
        write_table(
            folder / f"{name}.csv", {**columns, "theta_deg": np.degrees(counted(run.y[at, Q], 2 * np.pi / 2**13))}, 3
        )


@njit
def _guided(t: float, y: Array, u: float, p: Any, rate: Array, dry: Array) -> None:
    """A stage on balls, whose friction grows along a fraction of a millimetre (Dahl); y[2] is its force."""
    m, c, k, level, stiffness = p
    rate[Q], rate[V] = y[V], (u - c * y[V] - k * y[Q] - y[2]) / m
    rate[2] = stiffness * y[V] * (1.0 - y[2] / level * np.sign(y[V]))


@machine(
    2111,
    Truth(
        "friction of a stage's balls, which grows along 0.1 mm after each reversal",
        right=("dahl_presliding", "lugre_friction", "bouc_wen_hysteresis"),
        part=("coulomb_friction", "stribeck_friction", "play_friction"),
        also=(*LATE, "linear_stiffness"),
    ),
)
def ball_guides(folder: Path, rng: np.random.Generator) -> None:
    signals = 'force: "28.0 * i_A", displacement: "x_um"'
    write_model(
        folder,
        _model("m: 1.75, c: 9.0, k: 0.0", "linear", "displacement: 0.005, velocity: 0.04", signals, update=0.02),
    )
    for name, way, speed in (("training", 0.002, 0.02), ("validation", 0.003, 0.03)):
        t = times(14.0, 0.001)
        wanted = smooth(moves(rng, t, -way, way, speed, 20.0 * speed), 25.0, 0.001)
        c = (Q, 3.0e4, 3e5, 320.0, 0.4, 0.001, 40.0, 5e-8, 1.75)
        run = simulate(_guided, (float(wanted[0]), 0.0, 0.0), wanted, 0.001, (1.83, 8.6, 25.0, 4.0, 6.0e4), rng,
                       tracking, c, 2e-5)  # fmt: skip
        at = logged(run, rng, 0.002, 0.7)
        columns = {"t": run.t[at], "i_A": noisy(rng, run.u[at] / 28.0, 0.001)}
        write_table(folder / f"{name}.csv", {**columns, "x_um": 1e6 * counted(run.y[at, Q], 5e-8)}, 5)


@njit
def _cylinder(t: float, y: Array, u: float, p: Any, rate: Array, dry: Array) -> None:
    """A pneumatic cylinder whose chambers fill; y[2] is the force of its pressures, u what was asked for."""
    m, c, mu, fills = p
    rate[Q], rate[V], rate[2] = y[V], (y[2] - c * y[V]) / m, (u - y[2]) / fills
    dry[V] = mu / m


@machine(
    2112,
    Truth(
        "the chambers of a pneumatic cylinder, which fill within some 60 ms; the pressure asked for was recorded",
        right=("unexplained",),
        part=LATE,
        also=(),
    ),
)
def filling_chambers(folder: Path, rng: np.random.Generator) -> None:
    signals = 'force: "0.08 * p_set_kPa", displacement: "x_mm"'
    write_model(
        folder,
        _model("m: 3.9, c: 58.0, k: 0.0", "linear", "displacement: 0.2, velocity: 0.5", signals,
               "coulomb_friction: {mu: 9.0}"),
    )  # fmt: skip
    for name, way, speed in (("training", 0.12, 0.25), ("validation", 0.16, 0.35)):
        t = times(30.0, 0.002)
        wanted = smooth(moves(rng, t, -way, way, speed, 6.0 * speed), 4.0, 0.002)
        c = (Q, 160.0, 120.0, 25.0, 0.3, 0.002, 60.0, 1e-5, 0.0)
        run = simulate(_cylinder, (float(wanted[0]), 0.0, 0.0), wanted, 0.002, (4.1, 60.0, 9.3, 0.06), rng,
                       tracking, c, STEP)  # fmt: skip
        at = logged(run, rng, 0.01, 1.0)
        columns = {"t [s]": run.t[at], "p_set_kPa": run.u[at] / 0.08}
        write_table(folder / f"{name}.csv", {**columns, "x_mm": 1e3 * counted(run.y[at, Q], 1e-5)}, 3)


@njit
def _hydraulic(t: float, y: Array, u: float, p: Any, rate: Array, dry: Array) -> None:
    """A vertical cylinder; its valve's flow falls with the load's pressure y[2], Pa; u is the valve's opening."""
    m, area, flow, leak, stiff, supply, weight, mu = p
    left = max(1.0 - np.sign(u) * y[2] / supply, 0.0)
    rate[Q], rate[V] = y[V], (area * y[2] - weight) / m
    rate[2] = stiff * (flow * u * np.sqrt(left) - area * y[V] - leak * y[2])
    dry[V] = mu / m


@machine(
    2113,
    Truth(
        "the flow of a hydraulic servo's valve, which falls with the pressure of the load: less up than down",
        right=("unexplained",),
        part=("asymmetric_viscous_friction", "load_dependent_friction", "constant_load"),
        also=(),
    ),
)
def loaded_valve(folder: Path, rng: np.random.Generator) -> None:
    signals = 'force: "50.0 * valve_pct", displacement: "s_mm"'
    write_model(
        folder,
        _model("m: 200.0, c: 1.0e4, k: 0.0", "linear", "displacement: 0.2, velocity: 0.4", signals,
               "constant_load: {F0: -1500.0}\n  coulomb_friction: {mu: 120.0}"),
    )  # fmt: skip
    for name, way, speed in (("training", 0.1, 0.1), ("validation", 0.14, 0.14)):
        t = times(30.0, 0.001)
        wanted = smooth(moves(rng, t, -way, way, speed, 6.0 * speed), 5.0, 0.001)
        p = (205.0, 1e-3, 5e-4, 1e-10, 1e13, 1e7, 1500.0, 125.0)
        c = (Q, 12.0, 10.0, 0.3, 0.3, 0.001, 1.0, 1e-6, 0.0)
        run = simulate(_hydraulic, (float(wanted[0]), 0.0, 1.5e6), wanted, 0.001, p, rng, tracking, c, 2e-5)
        at = logged(run, rng, 0.005, 2.0)
        columns = {"t [s]": run.t[at], "valve_pct": rounded(1e2 * run.u[at], 0.01)}
        write_table(folder / f"{name}.csv", {**columns, "s_mm": 1e3 * counted(run.y[at, Q], 1e-6)}, 3)


@njit
def _reel(t: float, y: Array, u: float, p: Any, rate: Array, dry: Array) -> None:
    """A reel that fills: its inertia grows with the time."""
    J, grows, c, mu = p
    rate[V] = (u - c * y[V]) / (J * (1.0 + grows * t))
    dry[V] = mu / (J * (1.0 + grows * t))


@machine(
    2114,
    Truth(
        "the paper on a reel, whose inertia grows by two thirds within a record",
        right=("unexplained",),
        also=(),
    ),
)
def paper_reel(folder: Path, rng: np.random.Generator) -> None:
    signals = 'force: "1.3 * i [A]", velocity: "w [rad/s]"'
    write_model(
        folder,
        _model("m: 0.1, c: 0.02, k: 0.0", "rotary", "velocity: 60.0", signals, "coulomb_friction: {mu: 0.4}", "0.3"),
    )
    for name, low in (("training", 0.8), ("validation", 1.2)):
        t = times(40.0, 0.001)
        wanted = smooth(steps(rng, t, 8.0, 55.0, low, 3.0 * low), 2.0, 0.001)
        c = (V, 2.5, 6.0, 0.001, 25.0, 0.05)
        run = simulate(_reel, (0.0, 30.0), wanted, 0.001, (0.085, 0.67 / 40.0, 0.021, 0.41), rng, speed_loop, c, STEP)
        at = logged(run, rng, 0.01, 1.5)
        columns = {"t [s]": run.t[at], "i [A]": noisy(rng, run.u[at] / 1.3, 0.03)}
        write_table(folder / f"{name}.csv", {**columns, "w [rad/s]": noisy(rng, run.y[at, V], 0.05)}, 4)


@machine(
    2115,
    Truth("nothing", right=("adequate",), also=(*LATE, "linear_stiffness", "cogging_torque", "stribeck_friction")),
)
def sound_cable_stage(folder: Path, rng: np.random.Generator) -> None:
    signals = 'force: "52.0 * i_rms", displacement: "x [mm]"'
    write_model(
        folder,
        _model("m: 12.0, c: 38.0, k: 0.0", "linear", "displacement: 0.3, velocity: 0.8", signals,
               "coulomb_friction: {mu: 14.0}", "0.1"),
    )  # fmt: skip
    for name, low, high, speed in (("training", -0.2, 0.05, 0.5), ("validation", -0.05, 0.25, 0.7)):
        t = times(20.0, 0.001)
        wanted = smooth(moves(rng, t, low, high, speed, 10.0 * speed), 12.0, 0.001)
        p = _values(12.3, 37.0, k=3.0, mu=14.4, excess=0.5, v_s=0.01, wave=0.4, order=2 * np.pi / 0.03)
        c = (Q, 40000.0, 2e5, 1300.0, 0.3, 0.001, 250.0, 1e-6, 12.0)
        run = simulate(_axis, (float(wanted[0]), 0.0), wanted, 0.001, p, rng, tracking, c, 5e-5)
        at = logged(run, rng, 0.004, 0.8, 0.005)
        columns = {"t [s]": run.t[at], "i_rms": noisy(rng, run.u[at] / 52.0, 0.01)}
        write_table(folder / f"{name}.csv", {**columns, "x [mm]": 1e3 * counted(run.y[at, Q], 1e-6)}, 5)


@njit
def _hip(t: float, y: Array, u: float, p: Any, rate: Array, dry: Array) -> None:
    J, c, A, mu, share = p
    rate[Q], rate[V] = y[V], (u - c * y[V] - A * np.sin(y[Q])) / J
    dry[V] = (mu + share * abs(u)) / J


@machine(2116, Truth("nothing", right=("adequate",), also=(*LATE, "load_dependent_friction")))
def sound_quadruped_hip(folder: Path, rng: np.random.Generator) -> None:
    signals = 'force: "tau_cmd", displacement: "q", velocity: "qd"'
    write_model(
        folder,
        _model("m: 0.071, c: 0.1, k: 0.0", "rotary", "displacement: 1.0, velocity: 10.0", signals,
               "coulomb_friction: {mu: 0.4}\n  gravity_load: {A: 3.1}", "0.1", 0.02),
    )  # fmt: skip
    for name, way, low in (("training", 0.5, 0.15), ("validation", 0.7, 0.2)):
        t = times(20.0, 0.002)
        wanted = filtered(steps(rng, t, -way, way, low, 3.0 * low), 8.0, 0.002)
        c = (Q, 60.0, 0.0, 1.8, 0.5, 0.002, 12.0, 2 * np.pi / 2**14, 0.0)
        run = simulate(_hip, (float(wanted[0]), 0.0), wanted, 0.002, (0.073, 0.105, 3.15, 0.41, 0.012), rng,
                       tracking, c, STEP)  # fmt: skip
        at = logged(run, rng, 0.002, 1.1)
        columns = {"stamp": 1.7e9 + run.t[at], "tau_cmd": run.u[at], "q": counted(run.y[at, Q], 2 * np.pi / 2**14)}
        write_table(folder / f"{name}.csv", {**columns, "qd": noisy(rng, run.y[at, V], 0.05)}, 5)
