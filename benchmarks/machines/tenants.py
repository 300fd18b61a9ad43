"""Machines of further laws: iron that saturates, plays of dampers and sensors, pinched joints, creep, brakes, pumps."""

from __future__ import annotations

import datetime as dt
from pathlib import Path
from typing import Any

import numpy as np
from numba import njit

from benchmarks.machines.lodgers import LATE, logged, smooth, tracking
from benchmarks.machines.rig import (
    RPM,
    Array,
    Run,
    Truth,
    counted,
    falling,
    filtered,
    late,
    machine,
    moves,
    multisine,
    noisy,
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
STEP = 1e-4
"""Of the integration, s; axes of some kilograms need no finer one."""
RIPPLE = ("cogging_torque", "torque_ripple")


def _model(
    plant: str, values: str, spread: str, signals: str, effects: str = "", tolerance: str = "0.15",
    update: float = 0.05, axis: str = "",
) -> str:  # fmt: skip
    listed = f"\neffects:\n  {effects}" if effects else ""
    axis = f"\naxis: {axis}" if axis else ""
    return f"""
plant: {plant}{axis}
parameters: {{{values}}}{listed}
tolerance: {tolerance}
sign_scale: 0.0
operating_range: {{{spread}}}
update_period: {update}
signals: {{{signals}}}
"""


# Logs that are no plain table


def _semicolons(path: Path, columns: dict[str, Array], t: Array, digits: int) -> None:
    """Write a table as a historian exports it: semicolons, decimal commas, dates with the time of day."""
    began = dt.datetime(2024, 3, 11, 6, 40)
    stamps = [(began + dt.timedelta(seconds=float(s))).strftime("%d.%m.%Y %H:%M:%S,%f")[:-3] for s in t]
    cells = [[f"{v:.{digits}f}".replace(".", ",") for v in column] for column in columns.values()]
    rows = [";".join(["Zeitstempel", *columns]), *map(";".join, zip(stamps, *cells, strict=True))]
    path.write_text("\r\n".join(rows) + "\r\n", encoding="latin-1")


def _with_preamble(path: Path, columns: dict[str, Array], units: list[str], digits: int) -> None:
    """Write a table as a test rig does: what was tested first, then names, units and numbers between tabs."""
    text = [[f"{v:.{digits}f}" for v in column] for column in columns.values()]
    head = ["Test rig 4", "Specimen:\tstrut 17/2", "Operator:\tMK", "Sample rate:\t500 Hz", ""]
    rows = [*head, "\t".join(columns), "\t".join(units), *map("\t".join, zip(*text, strict=True))]
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")


def _changes_only(path: Path, t: Array, columns: dict[str, Array], digits: int) -> None:
    """Write one row for each value that changed, as a telemetry database exports them."""
    rows = ["time,signal,value"]
    rows += [
        f"{s:.4f},{name},{v:.{digits}f}"
        for s, *values in zip(t, *columns.values(), strict=True)
        for name, v in zip(columns, values, strict=True)
    ]
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")


# Motors that are driven by a voltage


@njit
def _saturating(t: float, y: Array, u: float, p: Any, rate: Array, dry: Array) -> None:
    """A motor (current, speed, position) whose torque constant falls with the current."""
    R, L, K, kappa, B, J, mu = p
    rate[0] = (u - R * y[0] - K * y[1]) / L
    rate[1] = (K / (1.0 + kappa * y[0] ** 2) * y[0] - B * y[1]) / J
    rate[2] = y[1]
    dry[1] = mu / J


@machine(
    2201,
    Truth(
        "the iron of a motor, which saturates: at its peak current an ampere makes a third less torque",
        right=("torque_constant_saturation",),
        part=("input_saturation", "load_dependent_friction", "quadratic_drag"),
        also=(*LATE, "thermal_resistance"),
        values={"torque_constant_saturation.kappa": (0.5 / 40.0**2, 0.25)},
    ),
)
def iron_motor(folder: Path, rng: np.random.Generator) -> None:
    values = "R_a: 0.55, L_a: 0.0011, K_t: 0.061, K_m: 0.061, B: 1.2e-4, J: 9.0e-4"
    signals = 'voltage: "vbus_frac * 48.0", current: "i_meas [A]", speed: "w_rpm"'
    spread = "current: 40.0, speed: 300.0"
    write_model(folder, _model("dc_motor", values, spread, signals, "coulomb_friction: {mu: 0.03}"))
    for name, shortest in (("training", 0.12), ("validation", 0.2)):
        t = times(16.0, 0.0005)
        wanted = filtered(steps(rng, t, -260.0, 260.0, shortest, 4.0 * shortest), 20.0, 0.0005)
        p = (0.57, 0.00105, 0.0618, 0.5 / 40.0**2, 1.25e-4, 9.3e-4, 0.031)
        run = simulate(
            _saturating, (0.0, 0.0, 0.0), wanted, 0.0005, p, rng, speed_loop, (1, 0.06, 0.4, 0.0005, 14.0, 0.4)
        )
        at = logged(run, rng, 0.002, 0.4)
        speed = filtered(rate_of(counted(run.y[:, 2], 2 * np.pi / 8192), 0.0005), 120.0, 0.0005)
        columns = {"t": run.t[at], "vbus_frac": rounded(run.u[at] / 48.0, 1e-3)}
        columns |= {"i_meas [A]": rounded(noisy(rng, run.y[at, 0], 0.06), 0.02), "w_rpm": RPM * speed[at]}
        write_table(folder / f"{name}.csv", columns, 4)


@njit
def _wiping(t: float, y: Array, u: float, p: Any, rate: Array, dry: Array) -> None:
    """A wiper's motor (current, speed, crank's angle), one way round; its blade drags wherever the crank moves it."""
    R, L, K, B, J, mu, blade = p
    rate[0] = (u - R * y[0] - K * y[1]) / L
    rate[1] = (K * y[0] - B * y[1]) / J
    rate[2] = y[1]
    dry[1] = (mu + blade * abs(np.sin(y[2] + 0.4))) / J


@machine(
    2202,
    Truth(
        "the blade of a wiper: it drags wherever the crank moves it, not at its two dead points in every turn",
        right=(
            "cogging_torque+coulomb_friction", "torque_ripple+coulomb_friction", "cogging_torque+constant_load",
            "torque_ripple+constant_load",
        ),
        part=("cogging_torque", "torque_ripple", "coulomb_friction", "constant_load"),
        also=(*LATE, "stribeck_friction"),
    ),
)  # fmt: skip
def wiper(folder: Path, rng: np.random.Generator) -> None:
    values = "R_a: 0.5, L_a: 0.0008, K_t: 0.9, K_m: 0.9, B: 0.02, J: 0.03"
    signals = 'voltage: "KL53 [V]", current: "I_wiper [A]", position: "crank [deg]"'
    spread = "current: 8.0, speed: 8.0, position: 100.0"
    write_model(folder, _model("dc_motor", values, spread, signals))
    for name, shortest in (("training", 1.5), ("validation", 2.2)):
        t = times(30.0, 0.001)
        u = filtered(steps(rng, t, 5.0, 9.0, shortest, 2.0 * shortest), 8.0, 0.001)
        p = (0.52, 0.00083, 0.88, 0.0205, 0.031, 0.6, 2.0)
        run = simulate(_wiping, (0.0, 5.0, 0.2), u, 0.001, p, rng)
        at = logged(run, rng, 0.01, 0.5)
        columns = {"t [ms]": 1e3 * run.t[at], "KL53 [V]": rounded(noisy(rng, run.u[at], 0.02), 0.05)}
        columns |= {"I_wiper [A]": noisy(rng, run.y[at, 0], 0.05)}
        turned = np.degrees(counted(run.y[at, 2], 2 * np.pi / 4096)) % 360.0
        write_table(folder / f"{name}.csv", {**columns, "crank [deg]": turned}, 3)


@njit
def _spooled(t: float, y: Array, u: float, p: Any, rate: Array, dry: Array) -> None:
    """A winch's motor (current, speed, position); the weight's lever grows where the rope lies in a second layer."""
    R, L, K, B, J, mu, load, more, where = p
    lever = 1.0 + more / (1.0 + np.exp(-(y[2] - where) / 0.4))
    rate[0] = (u - R * y[0] - K * y[1]) / L
    rate[1] = (K * y[0] - B * y[1] - load * lever) / J
    rate[2] = y[1]
    dry[1] = mu / J


@machine(
    2203,
    Truth(
        "the second layer of rope on a winch's drum: from some angle on the weight has a lever that is a third longer",
        right=("unexplained",),
        part=("constant_load", "linear_stiffness", "cubic_stiffness", "hard_stop"),
        also=(),
    ),
)
def layered_winch(folder: Path, rng: np.random.Generator) -> None:
    values = "R_a: 0.8, L_a: 0.002, K_t: 0.21, K_m: 0.21, B: 0.002, J: 0.009"
    signals = 'voltage: "u_arm [V]", current: "i_arm [A]", position: "drum [rad]"'
    effects = "constant_load: {F0: -0.9}\n  coulomb_friction: {mu: 0.25}"
    write_model(folder, _model("dc_motor", values, "current: 15.0, speed: 40.0, position: 60.0", signals, effects))
    for name, way, speed in (("training", 40.0, 18.0), ("validation", 52.0, 24.0)):
        t = times(30.0, 0.001)
        wanted = smooth(moves(rng, t, 0.0, way, speed, 3.0 * speed), 4.0, 0.001)
        p = (0.82, 0.0019, 0.207, 0.0021, 0.0093, 0.26, 0.9, 0.33, 24.0)
        c = (2, 4.0, 3.0, 0.35, 0.3, 0.001, 24.0, 2 * np.pi / 4096, 0.0)
        run = simulate(_spooled, (4.3, 0.0, float(wanted[0])), wanted, 0.001, p, rng, tracking, c, 5e-5)
        at = logged(run, rng, 0.005, 1.0)
        columns = {
            "t [s]": run.t[at],
            "u_arm [V]": rounded(run.u[at], 0.02),
            "i_arm [A]": noisy(rng, run.y[at, 0], 0.05),
        }
        write_table(folder / f"{name}.csv", {**columns, "drum [rad]": counted(run.y[at, 2], 2 * np.pi / 4096)}, 4)


# Valves, pumps, axes of which effort and position or speed were recorded


@njit
def _packed(t: float, y: Array, u: float, p: Any, rate: Array, dry: Array) -> None:
    """A stem with a spring in a packing that sticks; y[2] is the force of the air, which follows the signal u."""
    m, c, k, rest, mu, excess, v_s, fills = p
    rate[Q], rate[V], rate[2] = y[V], (y[2] - rest - c * y[V] - k * y[Q]) / m, (u - y[2]) / fills
    dry[V] = falling(y[V], mu, excess, v_s) / m


@machine(
    2204,
    Truth(
        "stiction of a control valve's packing, which jumps by 3 % of its lift; a historian logged it at 10 Hz",
        right=("stribeck_friction",),
        part=("coulomb_friction", "dahl_presliding", "lugre_friction", "play_friction"),
        also=LATE,
    ),
)
def logged_valve(folder: Path, rng: np.random.Generator) -> None:
    signals = 'force: "0.02 * Antrieb_Pa", displacement: "Hub_mm"'
    spread = "displacement: 0.03, velocity: 0.02"
    write_model(
        folder,
        _model("mass_spring_damper", "m: 3.0, c: 3000.0, k: 60000.0", spread, signals, "constant_load: {F0: -800.0}"),
    )
    for name, low, high in (("training", 0.01, 0.1), ("validation", 0.015, 0.14)):
        t = times(240.0, 0.001)
        u = 1700.0 + multisine(rng, t, 700.0, low, high, 5)
        p = (3.1, 3100.0, 6.1e4, 800.0, 60.0, 45.0, 0.002, 0.05)
        run = simulate(_packed, (0.015, 0.0, float(u[0])), u, 0.001, p, rng, step=STEP)
        at = logged(run, rng, 0.1, 5.0)
        columns = {"Antrieb_Pa": noisy(rng, run.y[at, 2] / 0.02, 150.0), "Hub_mm": noisy(rng, 1e3 * run.y[at, Q], 0.01)}
        _semicolons(folder / f"{name}.csv", columns, run.t[at], 3)


@njit
def _metered(t: float, y: Array, u: float, p: Any, rate: Array, dry: Array) -> None:
    """A plunger; y[2] is the force of its chamber: the fluid is compressed up to the pressure that opens the valve."""
    m, c, mu, stiff, opens = p
    rate[Q], rate[V] = y[V], (u - c * y[V] - y[2]) / m
    further = stiff * y[V]
    full = y[2] >= opens and further > 0.0
    empty = y[2] <= 0.0 and further < 0.0
    rate[2] = 0.0 if full or empty else further
    dry[V] = mu / m


@machine(
    2205,
    Truth(
        "the pressure behind the check valves of a metering pump: it pushes back on the way out, beyond 0.1 mm, only",
        right=("coulomb_friction+constant_load", "dahl_presliding+constant_load", "play_friction+constant_load"),
        part=("coulomb_friction", "constant_load", "dahl_presliding", "lugre_friction"),
        also=LATE,
    ),
)
def metering_pump(folder: Path, rng: np.random.Generator) -> None:
    signals = 'force: "62.5 * iq", displacement: "plunger [mm]"'
    spread = "displacement: 0.02, velocity: 0.1"
    effects = "coulomb_friction: {mu: 12.0}"
    write_model(folder, _model("mass_spring_damper", "m: 5.0, c: 110.0, k: 0.0", spread, signals, effects))
    for name, way, speed in (("training", 0.012, 0.05), ("validation", 0.016, 0.07)):
        t = times(20.0, 0.001)
        wanted = smooth(moves(rng, t, 0.0, way, speed, 10.0 * speed), 12.0, 0.001)
        c = (Q, 60000.0, 6e5, 900.0, 0.3, 0.001, 300.0, 1e-6, 5.0)
        p = (5.2, 115.0, 12.4, 8e5, 80.0)
        run = simulate(_metered, (float(wanted[0]), 0.0, 0.0), wanted, 0.001, p, rng, tracking, c, 2e-5)
        at = logged(run, rng, 0.002, 0.8)
        columns = {"t [s]": run.t[at], "iq": noisy(rng, run.u[at] / 62.5, 0.01)}
        write_table(folder / f"{name}.csv", {**columns, "plunger [mm]": 1e3 * counted(run.y[at, Q], 1e-6)}, 4)


@njit
def _linear(t: float, y: Array, u: float, p: Any, rate: Array, dry: Array) -> None:
    """A linear motor's carriage: cogging over the magnets' pitch, and less of it, with a pull, towards the ends."""
    m, c, mu, wave, pitch, end, reach = p
    inside = 1.0 / (1.0 + (y[Q] / reach) ** 8)
    pull = end * (y[Q] / reach) ** 5
    rate[Q], rate[V] = y[V], (u - c * y[V] - wave * inside * np.sin(2 * np.pi / pitch * y[Q] + 0.7) - pull) / m
    dry[V] = mu / m


@machine(
    2206,
    Truth(
        "cogging of a linear motor, 32 mm, and the pull of the ends of its magnets' track",
        right=("cogging_torque", "torque_ripple"),
        part=("linear_stiffness", "cubic_stiffness", "hard_stop"),
        also=(*LATE, "cubic_stiffness", "hard_stop", "linear_stiffness"),
        values={"cogging_torque.A": (9.0, 0.2)},
    ),
)
def end_of_magnets(folder: Path, rng: np.random.Generator) -> None:
    signals = 'force: "38.0 * Iq", displacement: "pos"'
    body = _model(
        "mass_spring_damper", "m: 7.5, c: 22.0, k: 0.0", "displacement: 0.4, velocity: 0.8", signals,
        "coulomb_friction: {mu: 8.0}",
    )  # fmt: skip
    write_model(folder, body)
    for name, way, speed in (("training", 0.26, 0.4), ("validation", 0.32, 0.6)):
        t = times(24.0, 0.001)
        wanted = smooth(moves(rng, t, -way, way, speed, 8.0 * speed), 8.0, 0.001)
        c = (Q, 24000.0, 1e5, 800.0, 0.3, 0.001, 250.0, 1e-6, 7.5)
        p = (7.8, 21.0, 8.3, 9.0, 0.032, 12.0, 0.36)
        run = simulate(_linear, (float(wanted[0]), 0.0), wanted, 0.001, p, rng, tracking, c, 5e-5)
        at = logged(run, rng, 0.004, 1.0)
        columns = {"Iq": noisy(rng, run.u[at] / 38.0, 0.01), "pos": counted(run.y[at, Q], 1e-6)}
        _changes_only(folder / f"{name}.csv", run.t[at], columns, 6)


@njit
def _dragged(t: float, y: Array, u: float, p: Any, rate: Array, dry: Array) -> None:
    """A rotor with dry friction and an eddy-current brake, whose torque falls again beyond its critical speed."""
    J, c, mu, brake, critical = p
    rate[Q], rate[V] = y[V], (u - c * y[V] - 2.0 * brake * critical * y[V] / (critical**2 + y[V] ** 2)) / J
    dry[V] = mu / J


@machine(
    2207,
    Truth(
        "an eddy-current brake on a bearing rig, whose torque falls again beyond its critical speed",
        right=("unexplained",),
        part=("viscous_friction",),
        also=(),
    ),
)
def eddy_brake(folder: Path, rng: np.random.Generator) -> None:
    signals = 'force: "M_shaft [Nm]", velocity: "n [1/min]"'
    write_model(
        folder,
        _model("mass_spring_damper", "m: 0.02, c: 0.0012, k: 0.0", "velocity: 200.0", signals,
               "coulomb_friction: {mu: 0.08}", axis="rotary"),
    )  # fmt: skip
    for name, shortest in (("training", 0.8), ("validation", 1.2)):
        t = times(40.0, 0.001)
        wanted = smooth(steps(rng, t, -180.0, 180.0, shortest, 3.0 * shortest), 2.0, 0.001)
        p = (0.0206, 0.00125, 0.083, 0.9, 45.0)
        run = simulate(_dragged, (0.0, 0.0), wanted, 0.001, p, rng, speed_loop, (V, 0.25, 0.8, 0.001, 8.0, 0.1), STEP)
        at = logged(run, rng, 0.01, 1.0)
        speed = rate_of(counted(run.y[:, Q], 2 * np.pi / 16384), 0.001, 10)
        columns = {"t [s]": run.t[at], "M_shaft [Nm]": noisy(rng, run.u[at], 0.004), "n [1/min]": RPM * speed[at]}
        write_table(folder / f"{name}.csv", columns, 4)


@njit
def _slack(x: Array, half: float) -> Array:
    """Return what hangs behind a play of some half width and is taken along by either of its sides."""
    out = x.copy()
    for k in range(1, x.size):
        out[k] = min(max(out[k - 1], x[k] - half), x[k] + half)
    return out


@njit
def _spring_arm(t: float, y: Array, u: float, p: Any, rate: Array, dry: Array) -> None:
    J, c, k, mu = p
    rate[Q], rate[V] = y[V], (u - c * y[V] - k * y[Q]) / J
    dry[V] = mu / J


@machine(
    2208,
    Truth(
        "the linkage of a potentiometer, which has a play of 1.4 degrees; nothing but the sensor is behind it",
        right=("unexplained",),
        part=("backlash", "sensor_delay"),
        also=(),
    ),
)
def loose_sensor(folder: Path, rng: np.random.Generator) -> None:
    signals = 'force: "cmd_Nm", displacement: "pot [deg]"'
    write_model(
        folder,
        _model("mass_spring_damper", "m: 0.31, c: 1.1, k: 14.0", "displacement: 0.6, velocity: 3.0", signals,
               "coulomb_friction: {mu: 0.25}", axis="rotary"),
    )  # fmt: skip
    for name, low, high in (("training", 0.15, 1.5), ("validation", 0.2, 2.2)):
        t = times(40.0, 0.001)
        u = multisine(rng, t, 6.0, low, high, 7)
        run = simulate(_spring_arm, (0.0, 0.0), u, 0.001, (0.32, 1.05, 14.4, 0.26), rng, step=STEP)
        at = logged(run, rng, 0.01, 1.0)
        shown = np.degrees(_slack(run.y[:, Q], 0.5 * np.radians(1.4)))
        columns = {"t": run.t[at], "cmd_Nm": run.u[at], "pot [deg]": rounded(noisy(rng, shown[at], 0.03), 0.05)}
        write_table(folder / f"{name}.csv", columns, 4)


@njit
def _belt(t: float, y: Array, u: float, p: Any, rate: Array, dry: Array) -> None:
    m, c, mu, load = p
    rate[Q], rate[V] = y[V], (u - c * y[V] - load) / m
    dry[V] = mu / m


@machine(
    2209,
    Truth(
        "a flat belt that creeps by up to a tenth of its speed, the more, the harder it pulls; the driven end is seen",
        right=("unexplained",),
        part=("sensor_gain", "viscous_friction"),
        also=(),
    ),
)
def creeping_belt(folder: Path, rng: np.random.Generator) -> None:
    signals = 'force: "T_mot", velocity: "w_roller"'
    write_model(
        folder,
        _model("mass_spring_damper", "m: 0.08, c: 0.02, k: 0.0", "velocity: 60.0", signals,
               "coulomb_friction: {mu: 0.5}\n  constant_load: {F0: -0.8}", "0.08", axis="rotary"),
    )  # fmt: skip
    for name, shortest in (("training", 0.5), ("validation", 0.8)):
        t = times(30.0, 0.001)
        wanted = smooth(steps(rng, t, 5.0, 60.0, shortest, 3.0 * shortest), 3.0, 0.001)
        c = (V, 0.5, 1.5, 0.001, 9.0, 0.05)
        run = simulate(_belt, (0.0, 20.0), wanted, 0.001, (0.081, 0.0202, 0.505, 0.79), rng, speed_loop, c, STEP)
        pull = filtered(run.u, 60.0, 0.001)
        shown = run.y[:, V] * (1.0 - 0.1 * np.tanh(pull / 5.0))
        at = logged(run, rng, 0.005, 1.0)
        columns = {"t [s]": run.t[at], "T_mot": noisy(rng, run.u[at], 0.01), "w_roller": noisy(rng, shown[at], 0.03)}
        write_table(folder / f"{name}.csv", columns, 4)


@machine(
    2210,
    Truth(
        "Coulomb friction of an axis; the second record was made with a pallet that weighs a third of all that moves",
        right=("coulomb_friction",),
        part=("stribeck_friction", "load_dependent_friction"),
        also=LATE,
        values={"coulomb_friction.mu": (26.0, 0.15)},
    ),
)
def second_pallet(folder: Path, rng: np.random.Generator) -> None:
    signals = 'force: "F_cmd [N]", displacement: "x_act [mm]"'
    write_model(folder, _model("mass_spring_damper", "m: 20.0, c: 45.0, k: 0.0", "velocity: 1.2", signals))
    for name, m, speed in (("training", 20.6, 0.6), ("validation", 27.4, 0.6)):
        t = times(24.0, 0.001)
        wanted = smooth(moves(rng, t, -0.4, 0.4, speed, 6.0 * speed), 8.0, 0.001)
        c = (Q, 50000.0, 2e5, 1900.0, 0.3, 0.001, 500.0, 1e-6, 20.0)
        run = simulate(_belt, (float(wanted[0]), 0.0), wanted, 0.001, (m, 44.0, 26.0, 0.0), rng, tracking, c, STEP)
        at = logged(run, rng, 0.004, 1.0)
        columns = {"t": run.t[at], "F_cmd [N]": run.u[at], "x_act [mm]": 1e3 * counted(run.y[at, Q], 1e-6)}
        write_table(folder / f"{name}.csv", columns, 4)


# Dampers and joints on a rig that imposes the motion


@njit
def _yielding(v: Array, dt: float, p: Any) -> Array:
    """Return the force of Bouc and Wen's law, whose rate falls where the force is small (a joint that slips)."""
    stiff, most, n, slips, width = p
    out, z = np.empty_like(v), 0.0
    for k in range(v.size):
        h = z / most
        rate = stiff * v[k] * (1.0 - abs(h) ** n * (0.6 * np.sign(v[k] * h) + 0.4))
        z += dt * rate * (1.0 - slips * np.exp(-((h / width) ** 2)))
        out[k] = z
    return out


@machine(
    2211,
    Truth(
        "a bolted timber joint that yields, and slips where it carries little: its loops are pinched",
        right=("pinching_hysteresis",),
        part=("bouc_wen_hysteresis", "dahl_presliding", "play_friction", "lugre_friction"),
        also=("sensor_delay", "linear_stiffness"),
    ),
)
def timber_joint(folder: Path, rng: np.random.Generator) -> None:
    signals = 'displacement: "slip [mm]", force: "load [kN]"'
    write_model(
        folder,
        _model("force_element", "c: 20000.0, k: 250000.0", "displacement: 0.02, velocity: 0.02", signals),
    )
    for name, tops in (("training", (2.0, 4.0, 8.0, 12.0, 16.0)), ("validation", (3.0, 6.0, 10.0, 14.0))):
        t = times(40.0 * len(tops), 0.01)
        amplitude = 1e-3 * np.asarray(tops)[np.minimum((t / 40.0).astype(int), len(tops) - 1)]
        ramp = np.minimum((t % 40.0) / 4.0, 1.0) * np.minimum((40.0 - t % 40.0) / 4.0, 1.0)
        x = filtered(amplitude * ramp * np.sin(2 * np.pi * 0.1 * t), 0.8, 0.01)
        v = np.gradient(x, t)
        force = _yielding(v, 0.01, (3.0e6, 9000.0, 1.6, 0.85, 0.25)) + 260000.0 * x + 20000.0 * v
        at = np.arange(0, len(t), 5)
        columns = {"t [s]": t[at], "slip [mm]": noisy(rng, 1e3 * x[at], 0.005)}
        write_table(folder / f"{name}.csv", {**columns, "load [kN]": noisy(rng, 1e-3 * force[at], 0.03)}, 5)


@njit
def _foamed(x: Array, mu: float, stiff: float, half: float) -> Array:
    """Return the friction of foam that a rod takes along after a play: an elastic slider behind a slack."""
    foam, out, most = x[0], np.zeros_like(x), half + mu / stiff
    for k in range(1, x.size):
        foam = min(max(foam, x[k] - most), x[k] + most)
        apart = x[k] - foam
        out[k] = stiff * np.sign(apart) * max(abs(apart) - half, 0.0)
    return out


@machine(
    2212,
    Truth(
        "the friction of a washing machine's strut, whose foam sits in a play of 1.2 mm; no velocity was recorded",
        right=("play_friction",),
        part=("coulomb_friction", "dahl_presliding", "bouc_wen_hysteresis", "lugre_friction"),
        also=("sensor_delay",),
        values={"play_friction.F_c": (55.0, 0.15)},
    ),
)
def foam_strut(folder: Path, rng: np.random.Generator) -> None:
    signals = 'displacement: "Stroke", force: "Force"'
    write_model(
        folder,
        _model("force_element", "c: 60.0, k: 0.0", "displacement: 0.02, velocity: 0.5", signals, tolerance="0.4"),
    )
    for name, top in (("training", 0.009), ("validation", 0.013)):
        t = times(16.0, 0.0005)
        x = filtered(multisine(rng, t, top, 0.5, 6.0, 6), 40.0, 0.0005)
        force = _foamed(x, 55.0, 3.0e5, 0.0006) + 62.0 * np.gradient(x, t)
        at = np.arange(0, len(t), 4)
        columns = {"Time": t[at], "Stroke": 1e3 * rounded(x[at], 1e-6), "Force": noisy(rng, force[at], 0.8)}
        _with_preamble(folder / f"{name}.txt", columns, ["s", "mm", "N"], 4)


# A servo of which goal and position are all that is known


@njit
def _horned(t: float, y: Array, u: float, p: Any, rate: Array, dry: Array) -> None:
    """A servo under its firmware's P law, whose potentiometer shows another zero than its goal."""
    gain, supply, R, K, J, weight, mu, trim = p
    duty = min(max(gain * (u - y[Q] - trim), -1.0), 1.0)
    rate[Q], rate[V] = y[V], (K * (duty * supply - K * y[V]) / R - weight * np.sin(y[Q] + trim)) / J
    dry[V] = mu / J


@machine(
    2213,
    Truth(
        "the trim of a servo: it holds itself 3 degrees beside the goal that was sent",
        right=("input_offset", "sensor_offset"),
        part=("constant_load",),
        also=(*LATE, *RIPPLE),
    ),
)
def trimmed_servo(folder: Path, rng: np.random.Generator) -> None:
    values = "K_t: 0.42, R: 4.1, J: 0.0024, mass: 0.2, length: 0.12, kp: 1.0, duty_per_error: 6.0, vin: 7.4"
    signals = 'goal_position: "goal_deg", position: "pos_deg"'
    body = _model(
        "servo", values, "position: 1.6, goal_position: 1.6, speed: 10.0", signals,
        "viscous_friction: {b: 0.004}\n  coulomb_friction: {mu: 0.03}",
        "{K_t: 0.2, R: 0.2, J: 0.2, duty_per_error: 0.2}",
    )  # fmt: skip
    write_model(folder, f"{body}frozen: [mass, length, kp, vin]\n")
    for name, high, low in (("training", 0.9, 0.4), ("validation", 1.2, 0.6)):
        t = times(24.0, 0.002)
        goal = rounded(smooth(steps(rng, t, -high, high, low, 3.0 * low), 4.0, 0.002), np.radians(0.1))
        p = (6.2, 7.4, 4.0, 0.43, 0.0023 + 0.2 * 0.12**2, 0.2 * 9.80665 * 0.12, 0.031, np.radians(3.0))
        run = simulate(_horned, (float(goal[0]), 0.0), goal, 0.002, p, rng, step=STEP)
        at = logged(run, rng, 0.02, 1.0)
        shown = np.degrees(rounded(run.y[at, Q], 2 * np.pi / 4096))
        write_table(folder / f"{name}.csv", {"t": run.t[at], "goal_deg": np.degrees(goal[at]), "pos_deg": shown}, 2)


# Nothing hidden


@machine(2214, Truth("nothing", right=("adequate",), also=(*LATE, "torque_constant_saturation", "stribeck_friction")))
def sound_traction_motor(folder: Path, rng: np.random.Generator) -> None:
    values = "R_a: 0.12, L_a: 0.0006, K_t: 0.16, K_m: 0.16, B: 0.002, J: 0.06"
    signals = 'voltage: "0.01 * pwm_pct * ubat_V", current: "imot_A", speed: "nmot [rpm]"'
    write_model(
        folder,
        _model("dc_motor", values, "current: 80.0, speed: 200.0", signals, "coulomb_friction: {mu: 0.6}", "0.15"),
    )
    for name, tones in (("training", 6), ("validation", 9)):
        t = times(40.0, 0.001)
        u = multisine(rng, t, 30.0, 0.05, 2.0, tones)
        p = (0.124, 0.00058, 0.157, 0.02 / 80.0**2, 0.0021, 0.062, 0.61)
        run = simulate(_saturating, (0.0, 0.0, 0.0), u, 0.001, p, rng)
        at = logged(run, rng, 0.02, 1.0)
        supply = filtered(noisy(rng, 48.0 - 0.02 * np.abs(run.y[:, 0]), 0.1), 20.0, 0.001)
        speed = rate_of(counted(run.y[:, 2], 2 * np.pi / 256), 0.001, 10)
        columns = {"pwm_pct": rounded(1e2 * run.u[at] / supply[at], 0.1), "ubat_V": rounded(supply[at], 0.1)}
        columns |= {"imot_A": rounded(noisy(rng, run.y[at, 0], 0.2), 0.1), "nmot [rpm]": RPM * speed[at]}
        _semicolons(folder / f"{name}.csv", columns, run.t[at], 2)


@machine(2215, Truth("nothing", right=("adequate",), also=(*LATE, "linear_stiffness", *RIPPLE, "stribeck_friction")))
def sound_theodolite(folder: Path, rng: np.random.Generator) -> None:
    signals = 'force: "0.041 * i_mA / 1000", displacement: "hz_gon * 0.015707963"'
    body = _model(
        "mass_spring_damper", "m: 0.0042, c: 0.0035, k: 0.0", "displacement: 3.0, velocity: 2.0", signals,
        "coulomb_friction: {mu: 0.006}", "0.1", axis="rotary",
    )  # fmt: skip
    write_model(folder, body)
    for name, way, speed in (("training", 1.6, 1.2), ("validation", 2.4, 1.8)):
        t = times(30.0, 0.001)
        wanted = smooth(moves(rng, t, -way, way, speed, 4.0 * speed), 6.0, 0.001)
        c = (Q, 1.2, 4.0, 0.12, 0.3, 0.001, 0.08, 2 * np.pi / 2**19, 0.0042)
        p = (0.0043, 0.0034, 0.0061, 2e-5, 2 * np.pi / 11.0, 0.0, 3.0)
        run = simulate(_linear, (float(wanted[0]), 0.0), wanted, 0.001, p, rng, tracking, c, 5e-5)
        at = logged(run, rng, 0.01, 1.0)
        columns = {"i_mA": rounded(1e3 * run.u[at] / 0.041, 0.5), "hz_gon": counted(run.y[at, Q], 2 * np.pi / 2**19)}
        columns["hz_gon"] /= 0.015707963
        write_table(folder / f"{name}.csv", {"t_ms": 1e3 * run.t[at], **columns}, 4)


def _told(run: Run, at: Any, rng: np.random.Generator) -> dict[str, Array]:
    """Return what a shaker's front end records: of the force cell a tick late, of the laser at once."""
    shown = late(run.u, 1)
    return {"F_cell": noisy(rng, shown[at], 0.4), "x_laser": 1e6 * noisy(rng, run.y[at, Q], 2e-7)}


@machine(2216, Truth("nothing", right=("adequate",), also=(*LATE, "cubic_stiffness")))
def sound_isolator(folder: Path, rng: np.random.Generator) -> None:
    signals = 'force: "F_cell", displacement: "x_laser [um]"'
    body = _model(
        "mass_spring_damper", "m: 2.4, c: 38.0, k: 21000.0", "displacement: 0.004, velocity: 0.3", signals,
        tolerance="0.1", update=0.01,
    )  # fmt: skip
    write_model(folder, body)
    for name, low, high in (("training", 2.0, 40.0), ("validation", 3.0, 30.0)):
        t = times(12.0, 0.0005)
        u = multisine(rng, t, 30.0, low, high, 12)
        run = simulate(_spring_arm, (0.0, 0.0), u, 0.0005, (2.44, 37.0, 21300.0, 0.05), rng, step=5e-5)
        at = logged(run, rng, 0.001, 0.5)
        columns = _told(run, at, rng)
        shown = {"t [s]": run.t[at], "F_cell": columns["F_cell"], "x_laser [um]": columns["x_laser"]}
        write_table(folder / f"{name}.csv", shown, 4)
