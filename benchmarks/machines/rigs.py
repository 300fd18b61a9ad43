"""Springs, dampers and valves on test rigs, and what swings on a spring."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numba import njit
from scipy.io import savemat

from benchmarks.machines.rig import (
    Array,
    Truth,
    counted,
    falling,
    filtered,
    given,
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

Q, V, Z = 0, 1, 2


@njit
def _bristle(t: float, y: Array, u: float, p: Any, rate: Array, dry: Array) -> None:
    """A mass on a spring with a hysteresis of Dahl's kind beside."""
    m, c, k, F_c, sigma = p
    rate[Q] = y[V]
    rate[V] = (u - c * y[V] - k * y[Q] - sigma * y[Z]) / m
    rate[Z] = y[V] - sigma * abs(y[V]) * y[Z] / F_c


@machine(
    1501,
    Truth(
        "hysteresis of the flexures of a voice coil, Dahl's law beside the spring",
        right=("dahl_presliding", "bouc_wen_hysteresis"),
        part=("coulomb_friction", "lugre_friction", "play_friction"),
        values={"dahl_presliding.F_c": (0.45, 0.2), "dahl_presliding.sigma": (2600.0, 0.35)},
    ),
)
def voice_coil(folder: Path, rng: np.random.Generator) -> None:
    write_model(
        folder,
        """
plant: mass_spring_damper
axis: linear
parameters: {m: 0.065, c: 1.1, k: 780.0}
sign_scale: 0.0
operating_range: {displacement: 0.005, velocity: 0.3}
update_period: 0.01
signals: {force: "7.4 * i", displacement: "x [mm]"}
""",
    )
    for name, low, high in (("training", 0.5, 25.0), ("validation", 0.8, 40.0)):
        u = multisine(rng, times(8.0, 0.0005), 3.2, low, high, 12)
        run = simulate(_bristle, (0.0, 0.0, 0.0), u, 0.0005, (0.067, 1.15, 800.0, 0.45, 2600.0), rng)
        at = run.at(0.002)
        columns = {"t": run.t[at], "i [A]": noisy(rng, run.u[at] / 7.4, 0.002)}
        write_table(folder / f"{name}.csv", {**columns, "x [mm]": noisy(rng, 1e3 * run.y[at, Q], 0.003)}, 5)


@njit
def _imposed(t: float, y: Array, u: float, p: Any, rate: Array, dry: Array) -> None:
    """A motion that is imposed, and the hysteresis that it works against."""
    F_c, sigma = p
    rate[Q] = u
    rate[V] = 0.0
    rate[Z] = u - sigma * abs(u) * y[Z] / F_c


@machine(
    1502,
    Truth(
        "the hysteresis of a magneto-rheological damper on a shaker, Dahl's law; a file of MATLAB",
        right=("dahl_presliding", "bouc_wen_hysteresis"),
        part=("coulomb_friction", "lugre_friction", "play_friction"),
        values={"dahl_presliding.F_c": (180.0, 0.1), "dahl_presliding.sigma": (160e3, 0.25)},
    ),
)
def mr_damper(folder: Path, rng: np.random.Generator) -> None:
    write_model(
        folder,
        """
plant: force_element
parameters: {c: 900.0, k: 0.0}
tolerance: {c: 0.5}
sign_scale: 0.0
operating_range: {displacement: 0.02, velocity: 0.3}
update_period: 0.02
signals: {displacement: "disp [mm]", velocity: "vel [mm/s]", force: "force [N]"}
""",
    )
    for name, low, high in (("training", 0.4, 5.0), ("validation", 0.6, 8.0)):
        t = times(12.0, 0.001)
        x = multisine(rng, t, 0.013, low, high, 7)
        run = simulate(
            _imposed, (x[0], 0.0, 0.0), np.append(np.diff(x) / 0.001, 0.0), 0.001, (180.0, 160e3), rng, given
        )
        force = filtered(820.0 * run.u + 160e3 * run.y[:, Z], 300.0, 0.001)
        at = run.at(0.002)
        values = {"time": run.t[at], "disp": 1e3 * run.y[at, Q], "vel": noisy(rng, 1e3 * run.u[at], 1.0)}
        savemat(folder / f"{name}.mat", {**values, "force": noisy(rng, force[at], 3.0)})


@machine(
    1503,
    Truth(
        "stiction of a rotary valve's packing, which breaks away at 14 N m and slides at 8",
        right=("stribeck_friction",),
        part=("coulomb_friction", "lugre_friction"),
        values={"stribeck_friction.mu": (8.0, 0.15), "stribeck_friction.excess": (6.0, 0.4)},
    ),
)
def rotary_valve(folder: Path, rng: np.random.Generator) -> None:
    write_model(
        folder,
        """
plant: mass_spring_damper
axis: rotary
parameters: {m: 0.9, c: 6.0, k: 0.0}
sign_scale: 0.0
operating_range: {displacement: 1.6, velocity: 1.0}
update_period: 0.1
signals: {force: "actuator torque [N.m]", displacement: "stem [deg]"}
""",
    )
    for name, speed in (("training", 0.4), ("validation", 0.6)):
        t = times(40.0, 0.001)
        wanted = moves(rng, t, 0.1, 1.5, speed, 0.4)
        c = (Q, V, 4.0, 40.0, 90.0, 0.001, 60.0, 2 * np.pi / 65536)
        run = simulate(
            _valve, (float(wanted[0]), 0.0), wanted, 0.001, (0.93, 5.7, 8.0, 6.0, 0.08), rng, position_loop, c
        )
        at = run.at(0.01, 0.0004, rng)
        columns = {"t [s]": run.t[at], "actuator torque [N.m]": noisy(rng, run.u[at], 0.15)}
        write_table(
            folder / f"{name}.csv", {**columns, "stem [deg]": np.degrees(counted(run.y[at, Q], 2 * np.pi / 65536))}, 4
        )


@njit
def _valve(t: float, y: Array, u: float, p: Any, rate: Array, dry: Array) -> None:
    J, c, mu, excess, v_s = p
    rate[Q], rate[V] = y[V], (u - c * y[V]) / J
    dry[V] = falling(y[V], mu, excess, v_s) / J


@njit
def _stiffening(t: float, y: Array, u: float, p: Any, rate: Array, dry: Array) -> None:
    m, c, mu, k, k3 = p
    rate[Q], rate[V] = y[V], (u - c * y[V] - k * y[Q] - k3 * y[Q] ** 3) / m
    dry[V] = mu / m


@machine(
    1504,
    Truth(
        "a spring that stiffens, in the joint of an exoskeleton",
        right=("cubic_stiffness",),
        values={"cubic_stiffness.k3": (38.0, 0.15)},
    ),
)
def exoskeleton_joint(folder: Path, rng: np.random.Generator) -> None:
    write_model(
        folder,
        """
plant: mass_spring_damper
axis: rotary
parameters: {m: 0.3, c: 1.1, k: 42.0}
effects:
  coulomb_friction: {mu: 1.2}
sign_scale: 0.0
operating_range: {displacement: 0.8, velocity: 5.0}
update_period: 0.05
signals: {force: "tau_cmd", displacement: "q_deg [deg]", velocity: "qd_deg [deg/s]"}
""",
    )
    for name, tones in (("training", 7), ("validation", 10)):
        t = times(20.0, 0.001)
        run = simulate(_stiffening, (0.0, 0.0), multisine(rng, t, 45.0, 0.2, 3.5, tones), 0.001,
                       (0.31, 1.15, 1.25, 40.5, 38.0), rng)  # fmt: skip
        at = run.at(0.005)
        columns = {"timestamp": 1.7e9 + run.t[at], "tau_cmd": run.u[at]}
        columns |= {
            "q_deg": rounded(np.degrees(run.y[at, Q]), 0.02),
            "qd_deg": noisy(rng, np.degrees(run.y[at, V]), 0.8),
        }
        write_table(folder / f"{name}.csv", columns, 4)


V2, Q2 = 2, 3


@njit
def _absorber(t: float, y: Array, u: float, p: Any, rate: Array, dry: Array) -> None:
    m, c, k, k2, c2, m2, gap = p
    way = y[Q] - y[Q2]
    inside = max(way - gap, 0.0) - max(-way - gap, 0.0)
    force = k2 * inside + (c2 * (y[V] - y[V2]) if abs(way) >= gap else 0.0)
    rate[Q], rate[V] = y[V], (u - c * y[V] - k * y[Q] - force) / m
    rate[V2], rate[Q2] = force / m2, y[V2]


@machine(
    1505,
    Truth(
        "a damping mass that knocks about in a gap of 3 mm on a spring-borne platform",
        right=("backlash",),
        part=("compliant_load",),
        values={"backlash.J": (1.6, 0.25), "backlash.gap": (0.003, 0.25)},
    ),
)
def loose_absorber(folder: Path, rng: np.random.Generator) -> None:
    write_model(
        folder,
        """
plant: mass_spring_damper
axis: linear
parameters: {m: 11.0, c: 14.0, k: 3600.0}
sign_scale: 0.0
operating_range: {displacement: 0.02, velocity: 0.4}
update_period: 0.02
signals: {force: "shaker force [N]", displacement: "x [mm]"}
""",
    )
    for name, low, high in (("training", 0.8, 6.0), ("validation", 1.0, 9.0)):
        u = multisine(rng, times(16.0, 0.001), 45.0, low, high, 10)
        run = simulate(_absorber, (0.0,) * 4, u, 0.001, (11.4, 14.5, 3520.0, 6000.0, 30.0, 1.6, 0.003), rng)
        at = run.at(0.004)
        columns = {"t [s]": run.t[at], "shaker force [N]": noisy(rng, run.u[at], 0.15)}
        write_table(folder / f"{name}.csv", {**columns, "x [mm]": noisy(rng, 1e3 * run.y[at, Q], 0.005)}, 4)


@njit
def _pendulum(t: float, y: Array, u: float, p: Any, rate: Array, dry: Array) -> None:
    J, c, k, c2 = p
    rate[Q], rate[V] = y[V], -(c * y[V] + k * y[Q] + c2 * abs(y[V]) * y[V]) / J


@machine(
    1506,
    Truth(
        "drag of a vane on a torsion pendulum that swings out freely; a file of MATLAB",
        right=("quadratic_drag",),
        part=("cubic_viscous_friction",),
        values={"quadratic_drag.c2": (0.0016, 0.15)},
    ),
)
def torsion_pendulum(folder: Path, rng: np.random.Generator) -> None:
    write_model(
        folder,
        """
plant: mass_spring_damper
axis: rotary
parameters: {m: 0.0125, c: 0.0004, k: 0.47}
sign_scale: 0.0
operating_range: {displacement: 2.5, velocity: 15.0}
update_period: 0.1
signals: {force: 0.0, displacement: "phi [deg]"}
""",
    )
    for name, start in (("training", 2.2), ("validation", 1.4)):
        t = times(40.0, 0.001)
        run = simulate(
            _pendulum, (start, 0.0), np.zeros_like(t), 0.001, (0.0122, 0.00041, 0.482, 0.0016), rng, step=1e-4
        )
        at = run.at(0.01)
        savemat(folder / f"{name}.mat", {"t": run.t[at], "phi": noisy(rng, np.degrees(run.y[at, Q]), 0.05)})


@machine(
    1507,
    Truth(
        "the weight of the washing in a drum, out of the middle",
        right=("gravity_load", "cogging_torque"),
        part=("torque_ripple",),
        values={"gravity_load.A": (2.4, 0.1)},
    ),
)
def washing_drum(folder: Path, rng: np.random.Generator) -> None:
    write_model(
        folder,
        """
plant: mass_spring_damper
axis: rotary                      # at the drum, belt 11 : 1
parameters: {m: 0.55, c: 0.11, k: 0.0}
effects:
  coulomb_friction: {mu: 1.1}
sign_scale: 0.0
operating_range: {displacement: 300.0, velocity: 20.0}
update_period: 0.05
signals: {t: "ms [ms]", force: "11 * torque_mNm [mN.m]", displacement: "drum_deg [deg]"}
""",
    )
    for name, low, high in (("training", 1.5, 4.0), ("validation", 2.5, 6.0)):
        t = times(40.0, 0.001)
        wanted = filtered(steps(rng, t, -9.0, 9.0, low, high), 1.0, 0.001)
        c = (V, 4.0, 9.0, 0.001, 25.0, 0.05)
        run = simulate(_drum, (0.2, 0.0), wanted, 0.001, (0.57, 0.107, 1.05, 2.4, 1.1), rng, speed_loop, c)
        at = run.at(0.01)
        torque = filtered(noisy(rng, run.u * 1e3 / 11, 15.0), 60.0, 0.001)
        columns = {"ms": 1e3 * run.t[at], "torque_mNm": rounded(torque[at], 1.0)}
        write_table(
            folder / f"{name}.csv", {**columns, "drum_deg": np.degrees(counted(run.y[at, Q], 2 * np.pi / 1056))}, 3
        )


@njit
def _drum(t: float, y: Array, u: float, p: Any, rate: Array, dry: Array) -> None:
    J, c, mu, A, q0 = p
    rate[Q], rate[V] = y[V], (u - c * y[V] - A * np.sin(y[Q] - q0)) / J
    dry[V] = mu / J


@machine(
    1508,
    Truth(
        "windage of a spindle, which grows with the square of the speed",
        right=("quadratic_drag",),
        part=("cubic_viscous_friction",),
        values={"quadratic_drag.c2": (1.1e-7, 0.15)},
    ),
)
def spindle(folder: Path, rng: np.random.Generator) -> None:
    write_model(
        folder,
        """
plant: mass_spring_damper
axis: rotary
parameters: {m: 0.0041, c: 0.00005, k: 0.0}
effects:
  coulomb_friction: {mu: 0.05}
sign_scale: 0.0
operating_range: {displacement: 10000.0, velocity: 2000.0}
update_period: 0.2
signals: {force: "4.8 * load_pct / 100", velocity: "S_act [rpm]"}
""",
    )
    for name, low, high in (("training", 2.0, 5.0), ("validation", 3.0, 7.0)):
        t = times(60.0, 0.002)
        wanted = filtered(steps(rng, t, 200.0, 1850.0, low, high), 0.6, 0.002)
        c = (V, 0.04, 0.05, 0.002, 4.5, 0.3)
        run = simulate(
            _windage, (0.0, 300.0), wanted, 0.002, (0.0042, 0.000052, 0.048, 1.1e-7), rng, speed_loop, c, 2e-4
        )
        at = run.at(0.02)
        load = filtered(noisy(rng, run.u / 0.048, 0.15), 40.0, 0.002)
        speed = rounded(noisy(rng, run.y[at, V] * 30 / np.pi, 2.0), 1.0)
        write_table(
            folder / f"{name}.csv", {"t": run.t[at], "load_pct": rounded(load[at], 0.1), "S_act [rpm]": speed}, 3
        )


@njit
def _windage(t: float, y: Array, u: float, p: Any, rate: Array, dry: Array) -> None:
    J, c, mu, c2 = p
    rate[Q], rate[V] = y[V], (u - c * y[V] - c2 * abs(y[V]) * y[V]) / J
    dry[V] = mu / J
