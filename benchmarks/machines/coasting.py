"""What runs out or swings by itself."""

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
    noisy,
    rate_of,
    rounded,
    simulate,
    times,
    write_model,
    write_table,
)

Q, V = 0, 1


@njit
def _coasting(t: float, y: Array, u: float, p: Any, rate: Array, dry: Array) -> None:
    m, c, c2, mu, slope = p
    rate[Q] = y[V]
    rate[V] = (u + slope - c * y[V] - c2 * abs(y[V]) * y[V]) / m
    dry[V] = mu / m


@machine(
    1301,
    Truth(
        "drag of the air and Coulomb friction of the bearings of a flywheel that coasts down",
        right=("coulomb_friction+quadratic_drag",),
        part=("coulomb_friction", "quadratic_drag", "cubic_viscous_friction"),
        values={"quadratic_drag.c2": (2.4e-5, 0.2), "coulomb_friction.mu": (0.09, 0.2)},
    ),
)
def flywheel(folder: Path, rng: np.random.Generator) -> None:
    write_model(
        folder,
        """
plant: mass_spring_damper
axis: rotary
parameters: {m: 0.21, c: 0.0, k: 0.0}
sign_scale: 0.0
operating_range: {displacement: 1000.0, velocity: 300.0}
update_period: 0.5
signals: {force: 0.0, velocity: "n [rpm]"}       # the clutch is open
""",
    )
    for name, start in (("training", 290.0), ("validation", 215.0)):
        t = times(150.0, 0.01)
        run = simulate(_coasting, (0.0, start), np.zeros_like(t), 0.01, (0.206, 0.0, 2.4e-5, 0.09, 0.0), rng, step=5e-4)
        at = run.at(0.05)
        at = at[run.y[at, V] > 0.0]
        speed = filtered(rate_of(counted(run.y[:, Q], 2 * np.pi / 360), 0.01, 5), 5.0, 0.01)
        write_table(folder / f"{name}.csv", {"t [s]": run.t[at][10:], "n [rpm]": rounded(RPM * speed[at], 0.1)[10:]}, 3)


@machine(
    1302,
    Truth(
        "rolling resistance and drag of a vehicle that coasts down, in km/h at 5 Hz",
        right=("coulomb_friction+quadratic_drag",),
        part=("coulomb_friction", "quadratic_drag", "cubic_viscous_friction", "constant_load"),
        values={"quadratic_drag.c2": (0.43, 0.2), "coulomb_friction.mu": (190.0, 0.2)},
    ),
)
def vehicle_coast_down(folder: Path, rng: np.random.Generator) -> None:
    write_model(
        folder,
        """
plant: mass_spring_damper
axis: linear
parameters: {m: 1480.0, c: 0.0, k: 0.0}
tolerance: {m: 0.03}
sign_scale: 0.0
operating_range: {displacement: 2000.0, velocity: 35.0}
update_period: 1.0
signals: {force: 0.0, velocity: "speed_kmh [km/h]"}
""",
    )
    for name, start in (("training", 34.0), ("validation", 27.0)):
        t = times(120.0, 0.02)
        run = simulate(_coasting, (0.0, start), np.zeros_like(t), 0.02, (1510.0, 0.0, 0.43, 190.0, 0.0), rng, step=1e-3)
        at = run.at(0.2)
        at = at[run.y[at, V] > 1.0]
        speed = rounded(noisy(rng, 3.6 * run.y[at, V], 0.12), 0.01)
        write_table(folder / f"{name}.csv", {"time": run.t[at], "speed_kmh": speed}, 2)
