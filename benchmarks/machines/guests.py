"""Machines of further kinds: servos of ticks and pulses, dampers and mounts on a rig, axes with two encoders."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numba import njit
from scipy.signal import lfilter

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
NOTHING = Truth("nothing", right=("adequate",))


@njit
def _servo(t: float, y: Array, u: float, p: Any, rate: Array, dry: Array) -> None:
    """A position servo; u is the goal, or what its firmware's profile makes of it."""
    gain, supply, R, K, J, weight, mu, k, middle = p
    duty = min(max(gain * (u - y[Q]), -1.0), 1.0)
    rate[Q] = y[V]
    rate[V] = (K * (duty * supply - K * y[V]) / R - weight * np.sin(y[Q]) - k * (y[Q] - middle)) / J
    dry[V] = mu / J


def _servo_model(goal: str, position: str, effects: str, mass: float = 0.3) -> str:
    return f"""
plant: servo
parameters: {{K_t: 0.42, R: 4.1, J: 0.0024, mass: {mass}, length: 0.12, kp: 1.0, duty_per_error: 1.5, vin: 6.0}}
effects:
  viscous_friction: {{b: 0.004}}{effects}
sign_scale: 0.0
operating_range: {{position: 1.6, goal_position: 1.6, speed: 10.0}}
update_period: 0.05
tolerance: {{K_t: 0.2, R: 0.2, J: 0.2, duty_per_error: 0.2}}
frozen: [mass, length, kp, vin]
signals: {{goal_position: "{goal}", position: "{position}"}}
"""


def _servo_runs(
    folder: Path, rng: np.random.Generator, p: tuple[float, ...], columns: tuple[str, str],
    ticks: tuple[float, float], zero: tuple[float, float], fastest: float = 1e9,
) -> None:  # fmt: skip
    """Write goals and positions in ticks of some radians about a zero; ``fastest``: the profile's speed, rad/s."""
    for name, high, low in (("training", 0.8, 0.25), ("validation", 1.2, 0.4)):
        t = times(24.0, 0.002)
        goal = filtered(steps(rng, t, -high, high, low, 3.0 * low), 4.0, 0.002)
        goal = np.round(goal / ticks[0]) * ticks[0]
        followed = _limited(goal, fastest * 0.002)
        run = simulate(_servo, (float(goal[0]), 0.0), followed, 0.002, p, rng, step=STEP)
        at = run.at(0.01)
        shown = (goal[at] / ticks[0] + zero[0], np.floor(run.y[at, Q] / ticks[1] + zero[1]))
        write_table(folder / f"{name}.csv", {"time_ms": 1e3 * run.t[at], columns[0]: shown[0], columns[1]: shown[1]}, 0)


@njit
def _limited(goal: Array, most: float) -> Array:
    out = goal.copy()
    for k in range(1, out.size):
        out[k] = out[k - 1] + min(max(goal[k] - out[k - 1], -most), most)
    return out


PULSE = np.pi / 2000.0
"""Radians for a microsecond of a pulse."""
SERVO = (1.55, 6.0, 4.0, 0.43, 0.0023 + 0.3 * 0.12**2, 0.3 * G * 0.12)
"""Gain, supply, R, K_t, inertia and weight of the servo that was built; further: friction, spring, its rest."""


@machine(2001, NOTHING)
def pulse_servo(folder: Path, rng: np.random.Generator) -> None:
    goal, position = f"{PULSE:.9f} * (pulse_us - 1500)", "0.004602 * (adc - 512)"
    write_model(folder, _servo_model(goal, position, "\n  coulomb_friction: {mu: 0.03}"))
    _servo_runs(folder, rng, (*SERVO, 0.0305, 0.0, 0.0), ("pulse_us", "adc"), (PULSE, 0.004602), (1500.0, 512.0))


TICK = np.radians(0.24)
"""Radians for a tick of a bus servo of 1000 ticks in 240 degrees."""


@machine(
    2002,
    Truth(
        "a torsion spring beside the arm of a bus servo; goal and position in ticks alone were recorded",
        right=("linear_stiffness",),
        part=("gravity_load", "cubic_stiffness", "constant_load"),
        values={"linear_stiffness.k": (0.25, 0.25)},
    ),
)
def bus_servo(folder: Path, rng: np.random.Generator) -> None:
    of = f"{TICK:.9f} * ({{}} - 500)"
    write_model(
        folder, _servo_model(of.format("goal"), of.format("present"), "\n  coulomb_friction: {mu: 0.03}", mass=0.1)
    )
    p = (1.55, 6.0, 4.0, 0.43, 0.0023 + 0.1 * 0.12**2, 0.1 * G * 0.12, 0.0305, 0.25, 0.0)
    _servo_runs(folder, rng, p, ("goal", "present"), (TICK, TICK), (500.0, 500.0))


@machine(
    2003,
    Truth(
        "the profile of a servo's firmware, which lets the goal run no faster than 1.6 rad/s",
        right=("unexplained",),
        part=("input_delay", "input_saturation"),
        also=(),
    ),
)
def profile_servo(folder: Path, rng: np.random.Generator) -> None:
    of = "0.001533981 * ({} - 2048)"
    write_model(
        folder, _servo_model(of.format("goal_pos"), of.format("present_pos"), "\n  coulomb_friction: {mu: 0.03}")
    )
    step = 0.001533981
    _servo_runs(
        folder, rng, (*SERVO, 0.0305, 0.0, 0.0), ("goal_pos", "present_pos"), (step, step), (2048.0, 2048.0), 1.6
    )


def _element_model(c: str, k: str, effects: str = "", signals: str = "") -> str:
    listed = f"\neffects:\n  {effects}" if effects else ""
    signals = signals or 'displacement: "disp [mm]", velocity: "vel [m/s]", force: "force [kN]"'
    return f"""
plant: force_element
axis: linear
parameters: {{c: {c}, k: {k}}}{listed}
tolerance: {{c: 0.4, k: 0.3}}
sign_scale: 0.0
operating_range: {{displacement: 0.05, velocity: 1.0}}
update_period: 0.02
signals: {{{signals}}}
"""


def _swept(t: Array, tops: tuple[float, ...], low: float, high: float) -> Array:
    """Return sweeps between two frequencies (Hz), one after the other, each of an amplitude of its own (m)."""
    length = t[-1] / len(tops)
    part = np.minimum((t / length).astype(int), len(tops) - 1)
    s = t - part * length
    fades = np.clip(np.minimum(s, length - s) / 0.5, 0.0, 1.0)
    phase = 2 * np.pi * (low * s + 0.5 * (high - low) / length * s**2)
    return np.asarray(tops)[part] * fades**2 * (3.0 - 2.0 * fades) * np.sin(phase)


def _imposed(folder: Path, rng: np.random.Generator, force: Any, noise: float) -> None:
    """Write what a test rig records: sweeps at three amplitudes; ``force(t, x, v)`` in N, at 2 kHz."""
    for name, tops, high in (("training", (0.006, 0.015, 0.03), 3.0), ("validation", (0.01, 0.022), 4.0)):
        t = times(24.0, 0.0005)
        x = _swept(t, tops, 0.3, high)
        v = np.gradient(x, t)
        at = np.arange(0, len(t), 8)
        columns = {"time [s]": t[at], "disp [mm]": 1e3 * rounded(x[at], 2e-6), "vel [m/s]": noisy(rng, v[at], 0.002)}
        write_table(folder / f"{name}.csv", {**columns, "force [kN]": noisy(rng, 1e-3 * force(t, x, v)[at], noise)}, 6)


def _absorber(t: Array, x: Array, v: Array) -> Array:
    return np.where(v > 0, 1450.0, 620.0) * v + 34.0 * np.tanh(v / 0.002)


@machine(
    2004,
    Truth(
        "a shock absorber that is more than twice as stiff in rebound as in compression",
        right=("asymmetric_viscous_friction",),
        part=("viscous_friction", "coulomb_friction", "constant_load"),
    ),
)
def shock_absorber(folder: Path, rng: np.random.Generator) -> None:
    write_model(folder, _element_model("900.0", "0.0", "coulomb_friction: {mu: 30.0}"))
    _imposed(folder, rng, _absorber, 0.003)


@machine(2005, NOTHING)
def sound_absorber(folder: Path, rng: np.random.Generator) -> None:
    effects = "coulomb_friction: {mu: 33.0}\n  asymmetric_viscous_friction: {b_p: 830.0, b_n: 10.0}"
    write_model(folder, _element_model("600.0", "0.0", effects))
    _imposed(folder, rng, _absorber, 0.003)


@machine(
    2006,
    Truth(
        "the coil current of a magneto-rheological damper, which is stepped within the record and changes its level",
        right=("unexplained",),
        part=("coulomb_friction", "dahl_presliding", "bouc_wen_hysteresis", "lugre_friction"),
    ),
)
def stepped_coil(folder: Path, rng: np.random.Generator) -> None:
    write_model(folder, _element_model("800.0", "0.0"))
    current = rng.uniform(0.0, 1.5, 40)

    def force(t: Array, x: Array, v: Array) -> Array:
        return 780.0 * v + (90.0 + 420.0 * current[(t / 0.9).astype(int)]) * np.tanh(v / 0.006)

    _imposed(folder, rng, force, 0.004)


@njit
def _coupled(t: float, y: Array, u: float, p: Any, rate: Array, dry: Array) -> None:
    """Two bodies and a coupling between them with a play of half width gap, which damps in contact only."""
    m, c, mu, k, d, load, gap, load_mu = p
    rate[0], rate[2] = y[1], y[3]
    apart = y[0] - y[2]
    beyond = np.sign(apart) * max(abs(apart) - gap, 0.0)
    through = k * beyond + (d * (y[1] - y[3]) if abs(apart) >= gap else 0.0)
    rate[1], rate[3] = (u - c * y[1] - through) / m, through / load
    dry[1], dry[3] = mu / m, load_mu / load


def _both_ends(
    folder: Path, rng: np.random.Generator, p: tuple[float, ...], c: tuple[float, ...],
    counts: tuple[float, float], torque: float, speeds: tuple[float, float],
) -> None:  # fmt: skip
    for name, speed in zip(("training", "validation"), speeds, strict=True):
        t = times(20.0, 0.001)
        wanted = moves(rng, t, -6.0, 6.0, speed, 6.0 * speed)
        start = float(wanted[0])
        run = simulate(_coupled, (start, 0.0, start, 0.0), wanted, 0.001, p, rng, position_loop, c, 5e-5)
        at = run.at(0.002)
        columns = {"t": run.t[at], "M_Nm": noisy(rng, run.u[at], torque)}
        columns |= {"motor_deg": np.degrees(counted(run.y[at, 0], counts[0]))}
        write_table(folder / f"{name}.csv", {**columns, "load_deg": np.degrees(counted(run.y[at, 2], counts[1]))}, 5)


def _both_model(effects: str, far: str) -> str:
    return f"""
plant: mass_spring_damper
axis: rotary
parameters: {{m: 0.0009, c: 0.0016, k: 0.0}}
effects:
  {effects}
tolerance: 0.2
sign_scale: 0.0
operating_range: {{displacement: 6.5, velocity: 20.0}}
update_period: 0.02
signals: {{force: "M_Nm", displacement: "motor_deg", {far}: "load_deg"}}
"""


@machine(
    2007,
    Truth(
        "Coulomb friction of the motor's side of a belt axis with an encoder at both ends; its file knows the belt",
        right=("coulomb_friction",),
        part=("stribeck_friction", "load_dependent_friction"),
        values={"coulomb_friction.mu": (0.031, 0.15)},
    ),
)
def belt_both_ends(folder: Path, rng: np.random.Generator) -> None:
    write_model(folder, _both_model("compliant_load: {k: 9.0, c: 0.004, J: 0.002}", "compliant_load.position"))
    p = (0.00095, 0.0015, 0.031, 8.4, 0.0045, 0.0022, 0.0, 0.0)
    c = (Q, V, 18.0, 0.05, 0.4, 0.001, 1.2, 2 * np.pi / 65536)
    _both_ends(folder, rng, p, c, (2 * np.pi / 65536, 2 * np.pi / 65536), 0.002, (9.0, 14.0))


@machine(2008, NOTHING)
def screw_both_ends(folder: Path, rng: np.random.Generator) -> None:
    effects = "coulomb_friction: {mu: 0.03}\n  backlash: {k: 60.0, c: 0.02, J: 0.002, gap: 0.02}"
    write_model(folder, _both_model(effects, "backlash.position"))
    p = (0.00095, 0.0015, 0.031, 57.0, 0.021, 0.0021, 0.021, 0.0)
    c = (Q, V, 14.0, 0.05, 0.4, 0.001, 1.2, 2 * np.pi / 65536)
    _both_ends(folder, rng, p, c, (2 * np.pi / 65536, 2 * np.pi / 65536), 0.002, (9.0, 14.0))


@njit
def _pendulum(t: float, y: Array, u: float, p: Any, rate: Array, dry: Array) -> None:
    J, b, A, mu = p
    rate[Q], rate[V] = y[V], (-b * y[V] - A * np.sin(y[Q])) / J
    dry[V] = mu / J


def _swings(folder: Path, rng: np.random.Generator, mu: float, effects: str) -> None:
    write_model(
        folder,
        f"""
plant: mass_spring_damper
axis: rotary
parameters: {{m: 0.052, c: 0.0015, k: 0.0}}
effects:
  gravity_load: {{A: 1.27}}{effects}
tolerance: {{m: 0.1, c: 0.5}}
sign_scale: 0.0
operating_range: {{displacement: 1.5, velocity: 8.0}}
update_period: 0.02
signals: {{force: 0.0, displacement: "angle [deg]"}}
""",
    )
    for name, start in (("training", 1.1), ("validation", 1.4)):
        t = times(30.0, 0.001)
        run = simulate(_pendulum, (start, 0.0), np.zeros(len(t)), 0.001, (0.054, 0.0017, 1.29, mu), rng, step=STEP)
        at = run.at(0.01)
        shown = np.degrees(counted(run.y[at, Q], 2 * np.pi / 16384))
        write_table(folder / f"{name}.csv", {"t_ms": 1e3 * run.t[at], "angle [deg]": shown}, 4)


@machine(
    2009,
    Truth(
        "dry friction in the pivot of a pendulum that swings out freely; its encoder is all that was recorded",
        right=("coulomb_friction",),
        part=("stribeck_friction", "load_dependent_friction"),
        values={"coulomb_friction.mu": (0.006, 0.2)},
    ),
)
def free_pendulum(folder: Path, rng: np.random.Generator) -> None:
    _swings(folder, rng, 0.006, "")


@machine(2010, NOTHING)
def sound_pendulum(folder: Path, rng: np.random.Generator) -> None:
    _swings(folder, rng, 0.006, "\n  coulomb_friction: {mu: 0.0058}")


I, W = 0, 1  # noqa: E741


@njit
def _rotor(t: float, y: Array, u: float, p: Any, rate: Array, dry: Array) -> None:
    """A motor with its load; y[2] is the angle."""
    R, L, K, B, J, mu, load, drag, wave, order = p
    rate[I] = (u - R * y[I] - K * y[W]) / L
    rate[W] = (K * y[I] - B * y[W] + load - drag * abs(y[W]) * y[W] - wave * np.sin(order * y[2] + 0.8)) / J
    rate[2] = y[W]
    dry[W] = mu / J


def _motor_model(values: str, spread: str, signals: str, effects: str) -> str:
    return f"""
plant: dc_motor
parameters: {{{values}}}
effects:
  {effects}
tolerance: {{R_a: 0.1, B: 0.5, J: 0.1}}
sign_scale: 0.0
operating_range: {{{spread}}}
update_period: 0.05
signals: {{{signals}}}
"""


@machine(2011, NOTHING)
def throttle_motor(folder: Path, rng: np.random.Generator) -> None:
    values = "R_a: 0.09, L_a: 0.0, K_t: 0.0071, K_m: 0.0071, B: 1.0e-6, J: 2.3e-5"
    effects = "quadratic_drag: {c2: 2.6e-7}\n  coulomb_friction: {mu: 0.004}"
    write_model(
        folder,
        _motor_model(values, "speed: 1600.0", 'voltage: "0.001 * (esc_us - 1000) * vbat_V", speed: "rpm"', effects),
    )
    for name, low, high in (("training", 0.4, 1.2), ("validation", 0.5, 1.6)):
        t = times(24.0, 0.001)
        pulse = np.round(1000.0 + 1000.0 * filtered(steps(rng, t, 0.25, 0.85, low, high), 5.0, 0.001))
        battery = 14.9 - 0.5 * t / 24.0
        p = (0.092, 2e-5, 0.0070, 1.1e-6, 2.4e-5, 0.0041, 0.0, 2.5e-7, 0.0, 1.0)
        run = simulate(_rotor, (0.0, 500.0, 0.0), 1e-3 * (pulse - 1000.0) * battery, 0.001, p, rng, step=1e-5)
        at = run.at(0.005)
        columns = {"time_us": 1e6 * run.t[at], "esc_us": pulse[at], "vbat_V": noisy(rng, battery[at], 0.003)}
        write_table(
            folder / f"{name}.csv", {**columns, "rpm": RPM * noisy(rng, run.y[at, W], 1.0)},
            {"time_us": 0, "esc_us": 0, "vbat_V": 3, "rpm": 1},
        )  # fmt: skip


@njit
def _braked(t: float, y: Array, u: float, p: Any, rate: Array, dry: Array) -> None:
    J, b, mu, excess, v_s = p
    rate[0] = (u - b * y[0]) / J
    dry[0] = falling(y[0], mu, excess, v_s) / J


@machine(
    2012,
    Truth(
        "a brake on a flywheel test bench whose torque rises as it slows down; runs from full speed to a stop",
        right=("stribeck_friction",),
        part=("coulomb_friction",),
        values={"stribeck_friction.mu": (21.0, 0.15), "stribeck_friction.excess": (13.0, 0.3)},
    ),
)
def brake_bench(folder: Path, rng: np.random.Generator) -> None:
    write_model(
        folder,
        """
plant: mass_spring_damper
axis: rotary
parameters: {m: 2.4, c: 0.05, k: 0.0}
tolerance: {m: 0.02, c: 0.5}
sign_scale: 0.0
operating_range: {velocity: 160.0, displacement: 3000.0}
update_period: 0.1
signals: {force: "drive_Nm", velocity: "n_rpm"}
""",
    )
    for name, top, every in (("training", 120.0, 22.0), ("validation", 150.0, 26.0)):
        t = times(3 * every, 0.002)
        drive = np.where(t % every < 0.4 * every, 21.0 + 0.05 * top + 2.4 * top / (0.38 * every), 0.0)
        run = simulate(_braked, (0.0,), drive, 0.002, (2.43, 0.055, 21.0, 13.0, 18.0), rng, step=STEP)
        at = run.at(0.02)
        columns = {"t_s": run.t[at], "drive_Nm": noisy(rng, drive[at], 0.05)}
        write_table(folder / f"{name}.csv", {**columns, "n_rpm": RPM * noisy(rng, run.y[at, 0], 0.05)}, 3)


@njit
def _coil(t: float, y: Array, u: float, p: Any, rate: Array, dry: Array) -> None:
    """A coil whose force falls towards the ends of its stroke; u is its current."""
    m, c, k, K, reach, mu = p
    rate[Q], rate[V] = y[V], (K * (1.0 - (y[Q] / reach) ** 2) * u - c * y[V] - k * y[Q]) / m
    dry[V] = mu / m


@machine(
    2013,
    Truth(
        "the force of a voice coil, which falls by a third towards the ends of its stroke",
        right=("unexplained",),
        part=("cubic_stiffness", "linear_stiffness", "torque_constant_saturation"),
        also=(),
    ),
)
def long_coil(folder: Path, rng: np.random.Generator) -> None:
    write_model(
        folder,
        """
plant: mass_spring_damper
axis: linear
parameters: {m: 0.21, c: 2.2, k: 95.0}
effects:
  coulomb_friction: {mu: 0.12}
sign_scale: 0.0
operating_range: {displacement: 0.02, velocity: 0.8}
update_period: 0.01
signals: {force: "11.5 * coil_A", displacement: "pos_um"}
""",
    )
    for name, low, high in (("training", 0.4, 18.0), ("validation", 0.6, 26.0)):
        t = times(16.0, 0.0005)
        u = multisine(rng, t, 0.42, low, high, 10)
        run = simulate(_coil, (0.0, 0.0), u, 0.0005, (0.218, 2.1, 97.0, 11.5, 0.026, 0.125), rng, step=5e-5)
        at = run.at(0.002)
        columns = {"t": run.t[at], "coil_A": noisy(rng, run.u[at], 0.0005)}
        write_table(folder / f"{name}.csv", {**columns, "pos_um": 1e6 * noisy(rng, run.y[at, Q], 2e-6)}, 5)


@machine(
    2014,
    Truth(
        "a rubber mount: a spring and a damper in series (35 ms) beside those of its file",
        right=("maxwell_element",),
        part=("linear_stiffness", "viscous_friction"),
        values={"maxwell_element.k": (26000.0, 0.05), "maxwell_element.tau": (0.035, 0.06)},
    ),
)
def rubber_mount(folder: Path, rng: np.random.Generator) -> None:
    write_model(folder, _element_model("260.0", "42000.0"))

    def force(t: Array, x: Array, v: Array) -> Array:
        a = np.exp(-0.0005 / 0.035)
        relaxed = lfilter([1.0 - a], [1.0, -a], v) * 0.035
        return 43000.0 * x + 250.0 * v + 26000.0 * relaxed

    _imposed(folder, rng, force, 0.006)


@njit
def _rope(v: Array, dt: float, k: float, share: float, F_y: float, n: float) -> Array:
    """Return the hysteretic force of a wire rope: Bouc and Wen's law with a rounded knee."""
    z, out = 0.0, np.empty_like(v)
    for j in range(v.size):
        h = z / F_y
        z += dt * k * share * v[j] * (1.0 - abs(h) ** n * (0.7 * np.sign(v[j] * h) + 0.3))
        out[j] = z
    return out


@machine(
    2015,
    Truth(
        "the hysteresis of a wire-rope isolator beside the spring of its file",
        right=("bouc_wen_hysteresis", "dahl_presliding"),
        part=("coulomb_friction", "lugre_friction", "pinching_hysteresis", "play_friction"),
    ),
)
def wire_rope(folder: Path, rng: np.random.Generator) -> None:
    write_model(folder, _element_model("60.0", "15000.0"))
    _imposed(folder, rng, lambda t, x, v: 15600.0 * x + 57.0 * v + _rope(v, 0.0005, 9e4, 1.0, 140.0, 1.4), 0.003)


@njit
def _mount(t: float, y: Array, u: float, p: Any, rate: Array, dry: Array) -> None:
    J, c, mu, wave, order, load = p
    rate[Q], rate[V] = y[V], (u + load - c * y[V] - wave * np.sin(order * y[Q] + 0.3)) / J
    dry[V] = mu / J


@machine(
    2016,
    Truth(
        "the worm of a telescope's mount, 180 turns for one of the axis: its torque waves; tracking and slews",
        right=("cogging_torque", "torque_ripple"),
        part=("coulomb_friction",),
        values={"cogging_torque.A": (0.9, 0.15), "cogging_torque.N": (180.0, 0.001)},
    ),
)
def telescope_mount(folder: Path, rng: np.random.Generator) -> None:
    write_model(
        folder,
        """
plant: mass_spring_damper
axis: rotary
parameters: {m: 21.0, c: 30.0, k: 0.0}
effects:
  coulomb_friction: {mu: 3.0}
tolerance: 0.15
sign_scale: 0.0
operating_range: {displacement: 1.6, velocity: 0.15}
update_period: 0.05
signals: {force: "torque [N.m]", displacement: "axis [arcsec]"}
""",
    )
    sidereal = 7.292e-5
    for name, speed in (("training", 0.06), ("validation", 0.09)):
        t = times(90.0, 0.001)
        slews = moves(rng, t, -0.7, 0.7, speed, 0.4 * speed)
        wanted = np.where(t < 30.0, slews, slews[30000]) + sidereal * t
        wanted[60000:] = wanted[60000] + (slews[60000:] - slews[60000]) + sidereal * (t[60000:] - t[60000])
        c = (Q, V, 6.0, 400.0, 900.0, 0.001, 40.0, 2 * np.pi / 2**26)
        run = simulate(_mount, (float(wanted[0]), 0.0), wanted, 0.001, (21.9, 28.0, 3.1, 0.9, 180.0, 0.0), rng,
                       position_loop, c, 2e-4)  # fmt: skip
        at = run.at(0.02)
        columns = {"t [s]": run.t[at], "torque [N.m]": noisy(rng, run.u[at], 0.03)}
        arc = np.degrees(counted(run.y[at, Q], 2 * np.pi / 2**26)) * 3600.0
        write_table(folder / f"{name}.csv", {**columns, "axis [arcsec]": arc}, 4)


@njit
def _blade(t: float, y: Array, u: float, p: Any, rate: Array, dry: Array) -> None:
    """The blade of a rotor that turns: its weight changes sides; gusts come on top."""
    J, c, mu, weight, turn, gust = p
    wind = gust * (np.sin(2.9 * t) + np.sin(1.13 * t + 1.0) + 0.6 * np.sin(4.7 * t + 2.0))
    rate[Q], rate[V] = y[V], (u - c * y[V] - weight * np.sin(turn * t) * np.cos(y[Q]) - wind) / J
    dry[V] = mu / J


@machine(
    2017,
    Truth(
        "gusts and the weight of a wind turbine's blade, which changes sides as the rotor turns; no azimuth recorded",
        right=("unexplained",),
        also=(),
    ),
)
def pitch_drive(folder: Path, rng: np.random.Generator) -> None:
    write_model(
        folder,
        """
plant: mass_spring_damper
axis: rotary
parameters: {m: 480.0, c: 900.0, k: 0.0}
effects:
  coulomb_friction: {mu: 350.0}
sign_scale: 0.0
operating_range: {displacement: 1.6, velocity: 0.25}
update_period: 0.05
signals: {force: "pitch_torque_kNm", displacement: "pitch_deg", velocity: "pitch_rate [deg/s]"}
""",
    )
    for name, speed in (("training", 0.1), ("validation", 0.14)):
        t = times(60.0, 0.001)
        wanted = moves(rng, t, 0.0, 0.5, speed, 5.0 * speed)
        c = (Q, V, 5.0, 9000.0, 15000.0, 0.001, 6000.0, 2 * np.pi / 2**18)
        run = simulate(_blade, (float(wanted[0]), 0.0), wanted, 0.001, (497.0, 870.0, 362.0, 600.0, 1.7, 110.0), rng,
                       position_loop, c, 2e-4)  # fmt: skip
        at = run.at(0.02)
        columns = {"t": run.t[at], "pitch_torque_kNm": noisy(rng, 1e-3 * run.u[at], 0.003)}
        columns |= {"pitch_deg": np.degrees(counted(run.y[at, Q], 2 * np.pi / 2**18))}
        write_table(
            folder / f"{name}.csv", {**columns, "pitch_rate [deg/s]": np.degrees(noisy(rng, run.y[at, V], 5e-4))}, 5
        )


@njit
def _leg(t: float, y: Array, u: float, p: Any, rate: Array, dry: Array) -> None:
    """An orthosis and who wears it: he works with it, y[2] is his torque's phase, which wanders."""
    J, c, mu, A, own = p
    rate[Q] = y[V]
    rate[V] = (u + own * np.sin(y[2]) * (0.6 + 0.4 * np.sin(0.31 * t)) - c * y[V] - A * np.sin(y[Q])) / J
    rate[2] = 2.0 + 1.1 * np.sin(0.53 * t) + 0.8 * np.sin(1.7 * t)
    dry[V] = mu / J


@machine(
    2018,
    Truth("who wears the orthosis: his own torque, which nobody measured", right=("unexplained",), also=()),
)
def worn_orthosis(folder: Path, rng: np.random.Generator) -> None:
    write_model(
        folder,
        """
plant: mass_spring_damper
axis: rotary
parameters: {m: 0.42, c: 0.8, k: 0.0}
effects:
  coulomb_friction: {mu: 0.7}
  gravity_load: {A: 9.0}
tolerance: 0.15
sign_scale: 0.0
operating_range: {displacement: 1.6, velocity: 5.0}
update_period: 0.02
signals: {force: "actuator_torque", displacement: "hip_angle_deg"}
""",
    )
    for name, speed in (("training", 1.2), ("validation", 1.7)):
        t = times(30.0, 0.001)
        wanted = moves(rng, t, -0.4, 0.9, speed, 9.0)
        c = (Q, V, 12.0, 12.0, 50.0, 0.001, 60.0, 2 * np.pi / 2**14)
        run = simulate(_leg, (float(wanted[0]), 0.0, rng.uniform(0, 6.0)), wanted, 0.001, (0.44, 0.76, 0.73, 9.2, 4.0),
                       rng, position_loop, c, STEP)  # fmt: skip
        at = run.at(0.005)
        columns = {"timestamp": 1.7e9 + run.t[at], "actuator_torque": noisy(rng, run.u[at], 0.05)}
        write_table(
            folder / f"{name}.csv",
            {**columns, "hip_angle_deg": np.degrees(counted(run.y[at, Q], 2 * np.pi / 2**14))},
            4,
        )


@machine(
    2019,
    Truth(
        "the three strokes of a pump's plungers in every turn; it runs one way, against a pressure that its file knows",
        right=("cogging_torque", "torque_ripple"),
        part=("constant_load",),
        values={"cogging_torque.A": (0.09, 0.15), "cogging_torque.N": (3.0, 0.001)},
    ),
)
def plunger_pump(folder: Path, rng: np.random.Generator) -> None:
    values = "R_a: 0.42, L_a: 0.0011, K_t: 0.092, K_m: 0.092, B: 2.0e-4, J: 0.0026"
    effects = "constant_load: {F0: -0.52}\n  coulomb_friction: {mu: 0.05}"
    signals = 'voltage: "U_V", current: "I_A", speed: "n_rpm", position: "angle_rad"'
    write_model(folder, _motor_model(values, "current: 25.0, speed: 150.0, position: 2000.0", signals, effects))
    for name, low, high in (("training", 0.6, 1.6), ("validation", 0.9, 2.2)):
        t = times(16.0, 0.001)
        wanted = filtered(steps(rng, t, 25.0, 130.0, low, high), 1.5, 0.001)
        p = (0.43, 0.0011, 0.0915, 2.1e-4, 0.0027, 0.052, -0.53, 0.0, 0.09, 3.0)
        c = (W, 0.12, 0.6, 0.001, 30.0, 0.1)
        run = simulate(_rotor, (0.0, 60.0, 0.0), wanted, 0.001, p, rng, speed_loop, c, STEP)
        at = run.at(0.002)
        columns = {"t_s": run.t[at], "U_V": run.u[at], "I_A": noisy(rng, run.y[at, I], 0.05)}
        columns |= {"n_rpm": RPM * noisy(rng, run.y[at, W], 0.15)}
        write_table(folder / f"{name}.csv", {**columns, "angle_rad": counted(run.y[at, 2], 2 * np.pi / 4096)}, 4)
