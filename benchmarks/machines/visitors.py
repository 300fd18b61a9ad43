"""Machines of kinds that the diagnosis was not built with: servos, fluid power, vehicles, ropes, smart materials."""

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


@njit
def _servo(t: float, y: Array, u: float, p: Any, rate: Array, dry: Array) -> None:
    """A position servo whose loop sees no error up to a dead band; u is the goal."""
    gain, band, supply, R, K, J, weight, mu = p
    e = u - y[Q]
    e = np.sign(e) * max(abs(e) - band, 0.0)
    duty = min(max(gain * e, -1.0), 1.0)
    rate[Q] = y[V]
    rate[V] = (K * (duty * supply - K * y[V]) / R - weight * np.sin(y[Q])) / J
    dry[V] = mu / J


def _servo_log(folder: Path, rng: np.random.Generator, p: tuple[float, ...], friction: str) -> None:
    write_model(
        folder,
        f"""
plant: servo
parameters: {{K_t: 0.34, R: 3.6, J: 0.0021, mass: 0.3, length: 0.1, kp: 400.0, duty_per_error: 0.0029, vin: 7.4}}
effects:
  viscous_friction: {{b: 0.004}}{friction}
sign_scale: 0.0
operating_range: {{position: 1.6, goal_position: 1.6, speed: 12.0}}
update_period: 0.05
tolerance: {{K_t: 0.2, R: 0.2, J: 0.2}}
frozen: [mass, length, kp, duty_per_error, vin]
signals: {{goal_position: "goal [deg]", position: "present [deg]"}}
""",
    )
    for name, high, low in (("training", 0.9, 0.2), ("validation", 1.3, 0.35)):
        t = times(20.0, 0.002)
        goal = filtered(steps(rng, t, -high, high, low, 3.0 * low), 3.0, 0.002)
        run = simulate(_servo, (float(goal[0]), 0.0), goal, 0.002, p, rng, step=STEP)
        at = run.at(0.01)
        columns = {"time [s]": run.t[at], "goal [deg]": np.degrees(run.u[at])}
        write_table(
            folder / f"{name}.csv", {**columns, "present [deg]": np.degrees(counted(run.y[at, Q], 1.534e-3))}, 3
        )


def _servo_values(band: float, mu: float) -> tuple[float, ...]:
    """Return what a servo of the bench is: gain, band, supply, R, K_t, inertia, weight, friction."""
    return (1.16, band, 7.4, 3.5, 0.35, 0.0019 + 0.3 * 0.01, 0.3 * G * 0.1, mu)


@machine(
    1901,
    Truth(
        "the dead band of an RC servo, 1.7 degrees either way; goal and position alone were recorded",
        right=("input_deadzone",),
        part=("coulomb_friction", "stribeck_friction"),
        values={"input_deadzone.d": (0.03, 0.2)},
    ),
)
def rc_servo(folder: Path, rng: np.random.Generator) -> None:
    _servo_log(folder, rng, _servo_values(0.03, 0.012), "\n  coulomb_friction: {mu: 0.012}")


@machine(
    1902,
    Truth(
        "Coulomb friction of a position servo; goal and position alone were recorded",
        right=("coulomb_friction",),
        part=("stribeck_friction", "load_dependent_friction"),
        values={"coulomb_friction.mu": (0.025, 0.2)},
    ),
)
def goal_servo(folder: Path, rng: np.random.Generator) -> None:
    _servo_log(folder, rng, _servo_values(0.0, 0.025), "")


@machine(1903, Truth("nothing", right=("adequate",)))
def sound_servo(folder: Path, rng: np.random.Generator) -> None:
    _servo_log(folder, rng, _servo_values(0.0, 0.012), "\n  coulomb_friction: {mu: 0.0125}")


@njit
def _axis(t: float, y: Array, u: float, p: Any, rate: Array, dry: Array) -> None:
    """A mass with a spring, a load, dry friction with a share that goes with the effort, and waves along the way."""
    m, c, k, load, mu, share, wave, order, excess, v_s = p
    rate[Q] = y[V]
    rate[V] = (u + load - c * y[V] - k * y[Q] - wave * np.sin(order * y[Q] + 0.4)) / m
    dry[V] = (falling(y[V], mu, excess, v_s) + share * abs(u)) / m


def _values(
    m: float, c: float, k: float = 0.0, load: float = 0.0, mu: float = 0.0, share: float = 0.0,
    wave: float = 0.0, order: float = 1.0, excess: float = 0.0, v_s: float = 1.0,
) -> tuple[float, ...]:  # fmt: skip
    return (m, c, k, load, mu, share, wave, order, excess, v_s)


def _axis_model(m: str, c: str, k: str, axis: str, spread: str, signals: str, effects: str = "") -> str:
    """Return a model file of a mass; ``spread``: its operating range."""
    listed = f"\neffects:\n  {effects}" if effects else ""
    return f"""
plant: mass_spring_damper
axis: {axis}
parameters: {{m: {m}, c: {c}, k: {k}}}{listed}
sign_scale: 0.0
operating_range: {{{spread}}}
update_period: 0.05
signals: {{{signals}}}
"""


@machine(
    1904,
    Truth(
        "a cylinder of unequal areas whose force was worked out with one area, and whose pressures sag together",
        right=("unexplained", "refused"),
        part=("constant_load",),
    ),
)
def differential_cylinder(folder: Path, rng: np.random.Generator) -> None:
    signals = 'force: "0.1963 * (pA - pB)", displacement: "s [mm]"'  # N for kPa, bore of 500 mm2 / 2.5
    effects = "coulomb_friction: {mu: 60.0}"
    write_model(
        folder, _axis_model("42.0", "600.0", "0.0", "linear", "displacement: 0.2, velocity: 0.5", signals, effects)
    )
    for name, speed in (("training", 0.25), ("validation", 0.35)):
        t = times(20.0, 0.001)
        wanted = moves(rng, t, -0.15, 0.15, speed, 1.5)
        c = (Q, V, 10.0, 3000.0, 6000.0, 0.001, 900.0, 1e-6)
        run = simulate(
            _axis, (float(wanted[0]), 0.0), wanted, 0.001, _values(44.0, 580.0, mu=63.0), rng, position_loop, c, STEP
        )
        at = run.at(0.005)
        supply = 5000.0 + 900.0 * np.sin(0.7 * run.t[at]) - 400.0 * np.abs(run.y[at, V]) / 0.25
        low = 0.45 * supply
        high = (run.u[at] + 0.1963 * 0.7 * low) / 0.1963
        columns = {"t [s]": run.t[at], "pA": noisy(rng, high, 4.0), "pB": noisy(rng, low, 4.0)}
        write_table(folder / f"{name}.csv", {**columns, "s [mm]": 1e3 * counted(run.y[at, Q], 1e-6)}, 4)


def _positioned(
    folder: Path, rng: np.random.Generator, values: tuple[float, ...], way: float, speeds: tuple[float, float],
    c: tuple[float, ...], columns: tuple[str, str], scales: tuple[float, float], noise: float, count: float,
    seconds: float = 16.0, acceleration: float = 8.0,
) -> None:  # fmt: skip
    """Write the logs of an axis that goes from point to point: force and position in the units of its columns."""
    for name, speed in zip(("training", "validation"), speeds, strict=True):
        t = times(seconds, 0.001)
        wanted = moves(rng, t, -way, way, speed, acceleration * speed)
        run = simulate(_axis, (float(wanted[0]), 0.0), wanted, 0.001, values, rng, position_loop, c, STEP)
        at = run.at(0.004)
        seen = noisy(rng, run.u[at], noise) / scales[0]
        shown = counted(run.y[at, Q], count) / scales[1]
        write_table(folder / f"{name}.csv", {"t [s]": run.t[at], columns[0]: seen, columns[1]: shown}, 6)


@machine(
    1905,
    Truth(
        "the torque of the cables of a camera gimbal, like a spring",
        right=("linear_stiffness",),
        part=("constant_load", "cubic_stiffness"),
        values={"linear_stiffness.k": (0.055, 0.15)},
    ),
)
def cabled_gimbal(folder: Path, rng: np.random.Generator) -> None:
    signals = 'force: "0.045 * iq", displacement: "yaw [deg]"'
    effects = "coulomb_friction: {mu: 0.008}"
    write_model(
        folder, _axis_model("0.0021", "0.0011", "0.0", "rotary", "displacement: 1.5, velocity: 4.0", signals, effects)
    )
    c = (Q, V, 15.0, 0.1, 0.6, 0.001, 0.4, 2 * np.pi / 2**16)
    values = _values(0.00224, 0.00104, k=0.055, mu=0.0083)
    _positioned(
        folder, rng, values, 1.2, (2.0, 3.0), c, ("iq", "yaw [deg]"), (0.045, np.pi / 180), 0.0004, 2 * np.pi / 2**16
    )


@machine(
    1906,
    Truth(
        "the share of the platform's weight on a leg of a hexapod, and the dry friction of its screw",
        right=("constant_load+coulomb_friction",),
        part=("constant_load", "coulomb_friction", "load_dependent_friction"),
        values={"constant_load.F0": (-210.0, 0.1), "coulomb_friction.mu": (48.0, 0.15)},
    ),
)
def hexapod_leg(folder: Path, rng: np.random.Generator) -> None:
    signals = 'force: "118.0 * I", displacement: "length [mm]"'  # 118 N/A: motor, belt and screw
    write_model(folder, _axis_model("90.0", "420.0", "0.0", "linear", "displacement: 0.1, velocity: 0.3", signals))
    c = (Q, V, 15.0, 6000.0, 20000.0, 0.001, 1200.0, 1e-6)
    values = _values(97.0, 400.0, load=-210.0, mu=48.0)
    _positioned(folder, rng, values, 0.07, (0.15, 0.22), c, ("I", "length [mm]"), (118.0, 1e-3), 1.5, 1e-6)


@njit
def _shank(t: float, y: Array, u: float, p: Any, rate: Array, dry: Array) -> None:
    J, c, mu, A, q0 = p
    rate[Q], rate[V] = y[V], (u - c * y[V] - A * np.sin(y[Q] - q0)) / J
    dry[V] = mu / J


@machine(
    1907,
    Truth(
        "the weight of shank and foot that hang on the joint of a knee exoskeleton",
        right=("gravity_load", "cogging_torque", "linear_stiffness"),
        part=("cubic_stiffness", "constant_load"),
        values={"gravity_load.A": (7.4, 0.1)},
    ),
)
def knee_exoskeleton(folder: Path, rng: np.random.Generator) -> None:
    signals = 'force: "joint_torque [Nm]", displacement: "knee [deg]", velocity: "knee_rate [deg/s]"'
    effects = "coulomb_friction: {mu: 0.6}"
    write_model(
        folder, _axis_model("0.36", "0.5", "0.0", "rotary", "displacement: 1.6, velocity: 5.0", signals, effects)
    )
    for name, speed in (("training", 2.0), ("validation", 3.0)):
        t = times(20.0, 0.001)
        wanted = moves(rng, t, -0.2, 1.5, speed, 18.0)
        c = (Q, V, 14.0, 9.0, 40.0, 0.001, 40.0, 2 * np.pi / 2**14)
        run = simulate(
            _shank, (float(wanted[0]), 0.0), wanted, 0.001, (0.4, 0.46, 0.63, 7.4, 0.1), rng, position_loop, c
        )
        at = run.at(0.005)
        columns = {"t": run.t[at], "joint_torque [Nm]": noisy(rng, run.u[at], 0.03)}
        columns |= {"knee [deg]": np.degrees(counted(run.y[at, Q], 2 * np.pi / 2**14))}
        write_table(
            folder / f"{name}.csv", {**columns, "knee_rate [deg/s]": np.degrees(noisy(rng, run.y[at, V], 0.02))}, 4
        )


I, W = 0, 1  # noqa: E741


@njit
def _wheel(t: float, y: Array, u: float, p: Any, rate: Array, dry: Array) -> None:
    R, L, K, B, J, mu, load, drag = p
    rate[I] = (u - R * y[I] - K * y[W]) / L
    rate[W] = (K * y[I] - B * y[W] + load - drag * abs(y[W]) * y[W]) / J
    dry[W] = mu / J


def _motor_model(values: str, spread: str, signals: str) -> str:
    return f"""
plant: dc_motor
parameters: {{{values}}}
sign_scale: 0.0
operating_range: {{{spread}}}
update_period: 0.1
signals: {{{signals}}}
"""


@machine(
    1908,
    Truth(
        "rolling resistance and a slope under the wheel of a mobile robot; all at the motor's shaft",
        right=("coulomb_friction+constant_load",),
        part=("coulomb_friction", "constant_load", "stribeck_friction"),
        values={"coulomb_friction.mu": (0.019, 0.15), "constant_load.F0": (-0.011, 0.2)},
    ),
)
def robot_wheel(folder: Path, rng: np.random.Generator) -> None:
    values, spread = "R_a: 0.9, L_a: 0.0009, K_t: 0.034, K_m: 0.034, B: 2.0e-5, J: 1.9e-4", "current: 6.0, speed: 400.0"
    write_model(folder, _motor_model(values, spread, 'voltage: "u [V]", current: "i [A]", speed: "w [rpm]"'))
    for name, low, high in (("training", 0.6, 1.6), ("validation", 0.9, 2.4)):
        t = times(20.0, 0.001)
        wanted = filtered(steps(rng, t, -300.0, 300.0, low, high), 1.5, 0.001)
        p = (0.93, 0.0009, 0.0333, 2.1e-5, 2.05e-4, 0.019, -0.011, 0.0)
        run = simulate(_wheel, (0.0, 0.0), wanted, 0.001, p, rng, speed_loop, (W, 0.03, 0.15, 0.001, 18.0, 0.3), STEP)
        at = run.at(0.01)
        columns = {"t [s]": run.t[at], "u [V]": run.u[at], "i [A]": noisy(rng, run.y[at, I], 0.02)}
        write_table(folder / f"{name}.csv", {**columns, "w [rpm]": RPM * noisy(rng, run.y[at, W], 0.3)}, 4)


@machine(
    1909,
    Truth(
        "the detent torque of a hybrid stepper in current control, 200 periods a turn",
        right=("cogging_torque", "torque_ripple"),
        values={"cogging_torque.A": (0.022, 0.2), "cogging_torque.N": (200.0, 0.001)},
    ),
)
def stepper_detent(folder: Path, rng: np.random.Generator) -> None:
    signals = 'force: "0.19 * iq_A", displacement: "theta [rad]"'
    effects = "coulomb_friction: {mu: 0.012}"
    write_model(
        folder, _axis_model("2.9e-5", "1.2e-4", "0.0", "rotary", "displacement: 3.0, velocity: 12.0", signals, effects)
    )
    c = (Q, V, 20.0, 0.008, 0.15, 0.001, 0.4, 2 * np.pi / 2**17)
    values = _values(3.1e-5, 1.15e-4, mu=0.0125, wave=0.022, order=200.0)
    _positioned(
        folder, rng, values, 2.5, (3.0, 5.0), c, ("iq_A", "theta [rad]"), (0.19, 1.0), 0.0005, 2 * np.pi / 2**17, 20.0
    )


@machine(
    1910,
    Truth(
        "capstan friction of a tendon in its sheath: it takes 16 % of whatever is pulled",
        right=("load_dependent_friction",),
        part=("coulomb_friction", "viscous_friction"),
    ),
)
def tendon_drive(folder: Path, rng: np.random.Generator) -> None:
    signals = 'force: "tension [N]", displacement: "tip [mm]"'
    effects = "coulomb_friction: {mu: 1.1}"
    write_model(
        folder, _axis_model("1.3", "6.0", "85.0", "linear", "displacement: 0.2, velocity: 0.6", signals, effects)
    )
    c = (Q, V, 12.0, 60.0, 300.0, 0.001, 60.0, 5e-6)
    values = _values(1.38, 5.7, k=82.0, mu=1.15, share=0.16)
    _positioned(folder, rng, values, 0.15, (0.3, 0.45), c, ("tension [N]", "tip [mm]"), (1.0, 1e-3), 0.05, 5e-6)


@njit
def _piezo(t: float, y: Array, u: float, p: Any, rate: Array, dry: Array) -> None:
    m, c, k, alpha, A, beta, gamma = p
    rate[0] = y[1]
    rate[1] = (u - c * y[1] - k * y[0] - alpha * y[2]) / m
    rate[2] = A * y[1] - beta * abs(y[1]) * y[2] - gamma * y[1] * abs(y[2])


@machine(
    1911,
    Truth(
        "hysteresis of a piezo stage, Bouc and Wen's law beside its flexures",
        right=("bouc_wen_hysteresis", "dahl_presliding"),
        part=("lugre_friction", "linear_stiffness"),
    ),
)
def piezo_stage(folder: Path, rng: np.random.Generator) -> None:
    signals = 'force: "6.0 * u_V", displacement: "x_um [um]"'  # 6 N/V: stiffness of the stack times its stroke
    write_model(folder, _axis_model("0.5", "90.0", "2.6e6", "linear", "displacement: 6.0e-5, velocity: 0.01", signals))
    for name, low, high in (("training", 2.0, 40.0), ("validation", 3.0, 60.0)):
        t = times(8.0, 0.0005)
        u = multisine(rng, t, 120.0, low, high, 6)
        run = simulate(_piezo, (0.0,) * 3, u, 0.0005, (0.53, 86.0, 2.5e6, 1.0, 6e5, 8e4, 2e4), rng, step=1e-5)
        at = run.at(0.001)
        columns = {"t [s]": run.t[at], "u_V": run.u[at] / 6.0, "x_um [um]": 1e6 * noisy(rng, run.y[at, 0], 4e-9)}
        write_table(folder / f"{name}.csv", columns, 5)


@njit
def _wire(t: float, y: Array, u: float, p: Any, rate: Array, dry: Array) -> None:
    """A wire that contracts with its temperature, late and with a loop; u heats it, in W."""
    m, c, k, C, loss, pull, width = p
    rate[2] = (u - loss * y[2]) / C
    middle = 45.0 if rate[2] > 0 else 45.0 - width
    rate[0] = y[1]
    rate[1] = (pull / (1.0 + np.exp(-(y[2] - middle) / 4.0)) - c * y[1] - k * y[0]) / m


@machine(
    1912,
    Truth(
        "a wire of a shape-memory alloy, mapped by its heating power as if that were a force",
        right=("unexplained", "refused"),
    ),
)
def memory_wire(folder: Path, rng: np.random.Generator) -> None:
    signals = 'force: "4.0 * P_W", displacement: "x [mm]"'
    write_model(folder, _axis_model("0.2", "4.0", "900.0", "linear", "displacement: 0.02, velocity: 0.02", signals))
    for name, low, high in (("training", 2.0, 6.0), ("validation", 3.0, 9.0)):
        t = times(120.0, 0.002)
        u = filtered(steps(rng, t, 0.2, 4.5, low, high), 1.0, 0.002)
        run = simulate(_wire, (0.0,) * 3, u, 0.002, (0.2, 8.0, 900.0, 0.12, 0.06, 14.0, 12.0), rng, step=5e-4)
        at = run.at(0.05)
        write_table(
            folder / f"{name}.csv",
            {"t [s]": run.t[at], "P_W": run.u[at], "x [mm]": 1e3 * noisy(rng, run.y[at, 0], 5e-6)},
            5,
        )


@machine(
    1913,
    Truth(
        "stiction of the packing of a control valve beside its spring; the positioner's pressure is the force",
        right=("stribeck_friction",),
        part=("coulomb_friction", "dahl_presliding", "lugre_friction"),
        values={"stribeck_friction.mu": (140.0, 0.15)},
    ),
)
def valve_positioner(folder: Path, rng: np.random.Generator) -> None:
    signals = 'force: "37.0 * p_kPa", displacement: "stem [mm]"'
    write_model(folder, _axis_model("3.5", "260.0", "52000.0", "linear", "displacement: 0.03, velocity: 0.05", signals))
    c = (Q, V, 8.0, 9000.0, 40000.0, 0.001, 3000.0, 1e-6)
    values = _values(3.8, 250.0, k=50500.0, mu=140.0, excess=90.0, v_s=0.003)
    _positioned(folder, rng, values, 0.018, (0.012, 0.02), c, ("p_kPa", "stem [mm]"), (37.0, 1e-3), 1.5, 1e-6, 24.0)


@machine(
    1914,
    Truth(
        "the rope of a hoist, which weighs more the further the car is down, and what the counterweight leaves",
        right=("constant_load+linear_stiffness", "unexplained"),
        part=("constant_load", "linear_stiffness"),
        values={"constant_load.F0": (620.0, 0.15)},
    ),
)
def hoist_rope(folder: Path, rng: np.random.Generator) -> None:
    signals = 'force: "traction [kN]", displacement: "height [m]", velocity: "v [m/s]"'
    effects = "coulomb_friction: {mu: 260.0}"
    write_model(
        folder, _axis_model("2350.0", "180.0", "0.0", "linear", "displacement: 20.0, velocity: 3.0", signals, effects)
    )
    for name, speed in (("training", 2.0), ("validation", 2.6)):
        t = times(90.0, 0.002)
        wanted = moves(rng, t, -15.0, 15.0, speed, 0.9)
        c = (Q, V, 2.0, 9000.0, 8000.0, 0.002, 9000.0, 1e-4)
        values = _values(2510.0, 172.0, k=-38.0, load=620.0, mu=272.0)
        run = simulate(_axis, (float(wanted[0]), 0.0), wanted, 0.002, values, rng, position_loop, c, 2e-4)
        at = run.at(0.02)
        columns = {"t [s]": run.t[at], "traction [kN]": noisy(rng, 1e-3 * run.u[at], 0.006)}
        columns |= {"height [m]": counted(run.y[at, Q], 1e-4), "v [m/s]": noisy(rng, run.y[at, V], 0.002)}
        write_table(folder / f"{name}.csv", columns, 5)


@njit
def _bearing(t: float, y: Array, u: float, p: Any, rate: Array, dry: Array) -> None:
    J, c, mu, f = p
    rate[0] = (u - c * y[0] - f * np.sign(y[0]) * abs(y[0]) ** (2.0 / 3.0)) / J
    dry[0] = mu / J


@machine(
    1915,
    Truth(
        "the lubricant's drag of a preloaded spindle bearing, which grows with the speed to the power of 2/3",
        right=("power_law_friction", "unexplained"),
        part=("coulomb_friction", "viscous_friction", "stribeck_friction"),
    ),
)
def preloaded_spindle(folder: Path, rng: np.random.Generator) -> None:
    signals = 'force: "torque [N.m]", velocity: "n [rpm]"'
    effects = "coulomb_friction: {mu: 0.045}"
    write_model(
        folder,
        _axis_model("0.0031", "2.0e-5", "0.0", "rotary", "displacement: 1000.0, velocity: 900.0", signals, effects),
    )
    for name, low, high in (("training", 0.8, 2.2), ("validation", 1.2, 3.0)):
        t = times(30.0, 0.001)
        wanted = filtered(steps(rng, t, -800.0, 800.0, low, high), 1.0, 0.001)
        c = (0.0, 0.05, 0.2, 0.001, 6.0, 0.3)
        run = simulate(_bearing, (0.0,), wanted, 0.001, (0.0033, 2.1e-5, 0.047, 0.0021), rng, speed_loop, c, STEP)
        at = run.at(0.005)
        columns = {"t [s]": run.t[at], "torque [N.m]": noisy(rng, run.u[at], 0.004)}
        write_table(folder / f"{name}.csv", {**columns, "n [rpm]": RPM * noisy(rng, run.y[at, 0], 0.2)}, 4)


@njit
def _flexspline(t: float, y: Array, u: float, p: Any, rate: Array, dry: Array) -> None:
    J, c, mu, k, d, load = p
    rate[0], rate[2] = y[1], y[3]
    through = k * (y[0] - y[2]) + d * (y[1] - y[3])
    rate[1], rate[3] = (u - c * y[1] - through) / J, through / load
    dry[1] = mu / J


@machine(
    1916,
    Truth(
        "the compliance of a harmonic drive to its load; nominal is the motor's side, where the encoder is",
        right=("compliant_load",),
        part=("linear_stiffness",),
        values={"compliant_load.k": (2.6, 0.15), "compliant_load.J": (0.00062, 0.15)},
    ),
)
def harmonic_drive(folder: Path, rng: np.random.Generator) -> None:
    signals = 'force: "tau_mNm [mNm]", displacement: "motor [deg]"'
    effects = "coulomb_friction: {mu: 0.021}"
    write_model(
        folder,
        _axis_model("0.00031", "0.00042", "0.0", "rotary", "displacement: 10.0, velocity: 40.0", signals, effects),
    )
    for name, low, high in (("training", 0.4, 22.0), ("validation", 0.6, 28.0)):
        t = times(16.0, 0.001)
        u = multisine(rng, t, 0.28, low, high, 12)
        run = simulate(_flexspline, (0.0,) * 4, u, 0.001, (0.00033, 0.0004, 0.022, 2.6, 0.0012, 0.00062), rng)
        at = run.at(0.002)
        columns = {"t [s]": run.t[at], "tau_mNm [mNm]": noisy(rng, 1e3 * run.u[at], 0.4)}
        write_table(
            folder / f"{name}.csv", {**columns, "motor [deg]": np.degrees(counted(run.y[at, 0], 2 * np.pi / 16384))}, 5
        )


@njit
def _bike(t: float, y: Array, u: float, p: Any, rate: Array, dry: Array) -> None:
    m, c, roll, drag = p
    rate[0] = (u - c * y[0] - drag * abs(y[0]) * y[0]) / m
    dry[0] = roll / m


@machine(
    1917,
    Truth(
        "rolling resistance and drag of an electric bicycle that never reverses; thrust from the wheel's power, km/h",
        right=("coulomb_friction+quadratic_drag", "constant_load+quadratic_drag"),
        part=("quadratic_drag", "coulomb_friction", "constant_load"),
        values={"quadratic_drag.c2": (0.31, 0.2)},
    ),
)
def electric_bicycle(folder: Path, rng: np.random.Generator) -> None:
    signals = 'force: "M_wheel_Nm / 0.34", velocity: "speed [km/h]"'
    write_model(
        folder,
        _axis_model("102.0", "1.0", "0.0", "linear", "displacement: 3000.0, velocity: 14.0", signals).replace(
            "0.05", "0.5"
        ),
    )
    for name, low, high in (("training", 4.0, 12.0), ("validation", 6.0, 15.0)):
        t = times(240.0, 0.01)
        u = filtered(steps(rng, t, 8.0, 95.0, low, high), 0.5, 0.01)
        run = simulate(_bike, (4.0,), u, 0.01, (108.0, 1.05, 6.5, 0.31), rng, step=1e-3)
        at = run.at(0.2)
        columns = {"time_s": run.t[at], "M_wheel_Nm": noisy(rng, 0.34 * run.u[at], 0.15)}
        write_table(
            folder / f"{name}.csv", {**columns, "speed [km/h]": rounded(3.6 * noisy(rng, run.y[at, 0], 0.01), 0.01)}, 3
        )


@njit
def _laden(t: float, y: Array, u: float, p: Any, rate: Array, dry: Array) -> None:
    m, c, mu, piece = p
    load = m + piece * (np.floor(t / 3.0) % 5)
    rate[0], rate[1] = y[1], (u - c * y[1]) / load
    dry[1] = mu * load / m / load


@machine(
    1918,
    Truth(
        "pieces that are put on a conveyor and taken off it, every three seconds another load", right=("unexplained",)
    ),
)
def laden_conveyor(folder: Path, rng: np.random.Generator) -> None:
    signals = 'force: "F_belt [N]", velocity: "v [m/s]"'
    effects = "coulomb_friction: {mu: 55.0}"
    write_model(
        folder, _axis_model("64.0", "40.0", "0.0", "linear", "displacement: 50.0, velocity: 1.5", signals, effects)
    )
    for name, low, high in (("training", 0.7, 2.0), ("validation", 1.0, 2.6)):
        t = times(30.0, 0.001)
        wanted = filtered(steps(rng, t, -1.2, 1.2, low, high), 1.0, 0.001)
        run = simulate(
            _laden,
            (0.0, 0.0),
            wanted,
            0.001,
            (67.0, 38.0, 57.0, 14.0),
            rng,
            speed_loop,
            (1.0, 300.0, 900.0, 0.001, 900.0, 0.002),
            STEP,
        )
        at = run.at(0.01)
        write_table(
            folder / f"{name}.csv",
            {"t [s]": run.t[at], "F_belt [N]": noisy(rng, run.u[at], 0.6), "v [m/s]": noisy(rng, run.y[at, 1], 0.002)},
            4,
        )


@machine(
    1919,
    Truth(
        "the propeller of a quadrotor's motor; throttle times battery voltage, one direction",
        right=("quadratic_drag",),
        part=("coulomb_friction", "constant_load", "viscous_friction"),
        values={"quadratic_drag.c2": (1.9e-7, 0.15)},
    ),
)
def propeller_motor(folder: Path, rng: np.random.Generator) -> None:
    values = "R_a: 0.062, L_a: 1.8e-5, K_t: 0.0062, K_m: 0.0062, B: 1.0e-6, J: 1.5e-5"
    signals = 'voltage: "throttle * vbat", current: "amps [A]", speed: "rpm [rpm]"'
    write_model(folder, _motor_model(values, "current: 40.0, speed: 2200.0", signals))
    for name, low, high in (("training", 0.3, 0.9), ("validation", 0.4, 1.2)):
        t = times(16.0, 0.0005)
        throttle = filtered(steps(rng, t, 0.2, 0.9, low, high), 6.0, 0.0005)
        u = throttle * (15.8 - 0.4 * t / 16.0)
        p = (0.065, 1.8e-5, 0.0061, 1.1e-6, 1.62e-5, 0.0, 0.0, 1.9e-7)
        run = simulate(_wheel, (0.0, 400.0), u, 0.0005, p, rng, step=1e-5)
        at = run.at(0.004)
        columns = {"t": run.t[at], "throttle": throttle[at], "vbat": noisy(rng, 15.8 - 0.4 * run.t[at] / 16.0, 0.004)}
        columns |= {"amps [A]": noisy(rng, run.y[at, I], 0.15), "rpm [rpm]": RPM * noisy(rng, run.y[at, W], 1.5)}
        write_table(folder / f"{name}.csv", columns, 4)


@machine(1920, Truth("nothing", right=("adequate",)))
def sound_gantry(folder: Path, rng: np.random.Generator) -> None:
    signals = 'force: "F [N]", displacement: "x [mm]"'
    effects = "coulomb_friction: {mu: 31.0}\n  constant_load: {F0: -4.0}"
    write_model(
        folder, _axis_model("25.0", "130.0", "0.0", "linear", "displacement: 0.5, velocity: 1.0", signals, effects)
    )
    c = (Q, V, 14.0, 900.0, 4000.0, 0.001, 500.0, 1e-6)
    _positioned(
        folder,
        rng,
        _values(26.8, 122.0, load=-4.2, mu=33.0),
        0.4,
        (0.6, 0.9),
        c,
        ("F [N]", "x [mm]"),
        (1.0, 1e-3),
        0.5,
        1e-6,
    )


@njit
def _door(t: float, y: Array, u: float, p: Any, rate: Array, dry: Array) -> None:
    J, out, back, k, mu = p
    rate[Q], rate[V] = y[V], (u - (out if y[V] > 0 else back) * y[V] - k * y[Q]) / J
    dry[V] = mu / J


@machine(
    1921,
    Truth(
        "the closer of a door, whose oil resists opening less than closing",
        right=("asymmetric_viscous_friction",),
        part=("viscous_friction",),
    ),
)
def door_closer(folder: Path, rng: np.random.Generator) -> None:
    signals = 'force: "M [Nm]", displacement: "leaf [deg]"'
    effects = "coulomb_friction: {mu: 2.1}"
    write_model(
        folder, _axis_model("14.5", "18.0", "9.0", "rotary", "displacement: 1.6, velocity: 1.5", signals, effects)
    )
    for name, low, high in (("training", 0.08, 0.9), ("validation", 0.1, 1.3)):
        t = times(40.0, 0.002)
        u = multisine(rng, t, 42.0, low, high, 8)
        run = simulate(_door, (0.0, 0.0), u, 0.002, (15.3, 9.0, 27.0, 9.3, 2.2), rng, step=2e-4)
        at = run.at(0.02)
        write_table(
            folder / f"{name}.csv",
            {
                "t [s]": run.t[at],
                "M [Nm]": noisy(rng, run.u[at], 0.1),
                "leaf [deg]": np.degrees(counted(run.y[at, Q], 2 * np.pi / 2**15)),
            },
            4,
        )
