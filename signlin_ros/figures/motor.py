"""Figure 4: the motor from rest through a reversal; non-smooth, conventional linear, and the proposed model."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from signlin_ros import plotting
from signlin_ros.figures.shared import Array, options, rms
from signlin_ros.linearization import Linearizer
from signlin_ros.model import Model
from signlin_ros.predict import without_dry_friction
from signlin_ros.simulation import Trajectory, simulate

MOTOR_VOLTAGE, MOTOR_HALF, MOTOR_STEP = 2.0, 3.0, 0.005
"""+2 V for 3 s, then -2 V for 3 s; sampled every 5 ms."""


@dataclass(frozen=True)
class MotorRuns:
    """Fig. 4: the model, times (T,) in s, runs by name, and which samples (T,) lie in the valid range of sign_j."""

    model: Model
    t: Array
    runs: Mapping[str, Trajectory]
    valid: NDArray[np.bool_]


def run_motor() -> MotorRuns:
    """Simulate the motor: exact, f_j, A_k from the start and from the midpoint of each period, and no friction."""
    model = Model.load("dc_motor")
    t: Array = MOTOR_STEP * np.arange(round(2 * MOTOR_HALF / MOTOR_STEP) + 1, dtype=float)
    u = np.where(t < MOTOR_HALF - MOTOR_STEP / 2, MOTOR_VOLTAGE, -MOTOR_VOLTAGE)[:, None]
    runs = {
        "exact": simulate(model, t, u),
        "smooth": simulate(model, t, u, kind="smooth"),
        "start": simulate(model.with_options(operating_point="start"), t, u, kind="piecewise"),
        "midpoint": simulate(model.with_options(operating_point="midpoint"), t, u, kind="piecewise"),
        "no_friction": simulate(without_dry_friction(model), t, u),
    }
    start = model.with_options(operating_point="start")
    return MotorRuns(model, t, runs, Linearizer(start).batch(runs["exact"].x, u).in_valid_range)


def motor_numbers(motor: MotorRuns) -> dict[str, Any]:
    """Return the numbers of Fig. 4: speed after 3 s, RMS error of the speed over the whole run, valid range."""
    exact = motor.runs["exact"]["speed"]
    middle = int(np.searchsorted(motor.t, MOTOR_HALF - MOTOR_STEP / 2))
    others = {name: run["speed"] for name, run in motor.runs.items() if name != "exact"}
    updates = np.arange(0, motor.t.size, max(1, round(motor.model.update_period / MOTOR_STEP)))
    unit = motor.model.units["speed"]
    return {
        **options(motor.model),
        "input": {"voltage": MOTOR_VOLTAGE, "unit": "V", "reversal": {"value": MOTOR_HALF, "unit": "s"}},
        "duration": {"value": float(motor.t[-1]), "unit": "s"},
        "speed_at_reversal": {"unit": unit, **{n: float(r["speed"][middle]) for n, r in motor.runs.items()}},
        "speed_rmse": {"unit": unit, **{name: rms(speed - exact) for name, speed in others.items()}},
        "updates_in_valid_range": {"count": int(motor.valid[updates].sum()), "of": int(updates.size)},
    }


MOTOR_CURVES = {
    "exact": ("non-smooth (28)", plotting.EXACT_COLOUR, "-"),
    "no_friction": ("conventional linear, without friction (29)", plotting.BARE, "-."),
    "start": ("proposed (33)", plotting.START_COLOUR, "-"),
    "midpoint": ("the same from the predicted midpoint", plotting.MIDPOINT, "--"),
}


def draw_motor(path: Path, motor: MotorRuns) -> None:
    """Draw Fig. 4: the speed and its error, with the input below."""
    exact = motor.runs["exact"]["speed"]
    with plotting.canvas(path, 7.6, 6.0) as figure:
        speed, error, voltage = figure.subplots(3, 1, sharex=True, height_ratios=(3, 2, 0.8))
        for name, (label, colour, dash) in MOTOR_CURVES.items():
            run = motor.runs[name]["speed"]
            speed.plot(motor.t, run, color=colour, ls=dash, label=label, lw=2.2 if name == "exact" else 1.4)
            if name != "exact":
                error.plot(motor.t, run - exact, color=colour, ls=dash)
        for axes in (speed, error):
            plotting.shade(axes, motor.t, ~motor.valid, "outside the valid range of sign$_j$")
        voltage.step(motor.t, motor.runs["exact"]["voltage"], color=plotting.EXACT_COLOUR, where="post")
        period = motor.model.update_period
        speed.set(ylabel="speed  [rad/s]", title=f"DC motor, j = {motor.model.sign_order}, update every {period:g} s")
        error.set(ylabel="error of speed  [rad/s]")
        voltage.set(ylabel="voltage  [V]", xlabel="time  [s]", xlim=(0, motor.t[-1]), ylim=(-3, 3))
        plotting.legend_above(figure, speed, 2)
