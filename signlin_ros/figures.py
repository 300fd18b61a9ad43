"""Figures 1, 2, 4, 5 and 6 of the paper, drawn anew, with the numbers of 4 and 5 beside them.

Figure 3 is not among them. Every number comes from the shipped models `dc_motor` and `bouc_wen`; only the inputs,
which the model files do not hold, are set here. Figures 4 to 6 also show the operating point at the predicted midpoint.
Source: *Linearization Modeling for Non-smooth Dynamical Systems with Approximated Scalar Sign Function*.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from signlin_ros import plotting
from signlin_ros.errors import InputError
from signlin_ros.linearize import Linearizer
from signlin_ros.model import Model
from signlin_ros.predict import without_dry_friction
from signlin_ros.sign import sign_j, sign_j_slope, valid_surface
from signlin_ros.simulate import Trajectory, simulate

Array = NDArray[np.float64]
MOTOR_VOLTAGE, MOTOR_HALF, MOTOR_STEP = 2.0, 3.0, 0.005
"""Fig. 4: +2 V for 3 s, then -2 V for 3 s; sampled every 5 ms."""
FORCE, FORCE_RATE, OSCILLATOR_SPAN, OSCILLATOR_STEP = 1.0, 1.0, 40.0, 0.0125
"""Figs. 5 and 6: force in N, its rate in rad/s, length of the run and sampling in s."""
PERIODS = (0.4, 0.2, 0.1, 0.05, 0.025)
"""Update periods in s at which the order is observed."""


def _write(path: Path, text: str) -> None:
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise InputError(f"cannot write {path}: {error.strerror}") from error


def make_figures(directory: str | Path) -> dict[str, Any]:
    """Write the figures (PNG) and the numbers of figures 4 and 5 (JSON) to a folder; return what was written.

    Returns ``{"files": [...], "figure_4": numbers, "figure_5": numbers}``. Raises `MissingExtraError` without
    matplotlib, `InputError` where the folder cannot be written.
    """
    folder = Path(directory)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"cannot make {folder}: {error.strerror}") from error
    draw_sign(folder / "figure_1.png")
    draw_uses_of_sign(folder / "figure_2.png")
    motor, oscillator = run_motor(), run_oscillator()
    orders = errors_by_period(oscillator)
    draw_motor(folder / "figure_4.png", motor)
    draw_oscillator(folder / "figure_5.png", oscillator, orders)
    draw_loop(folder / "figure_6.png", oscillator)
    numbers = {"figure_4": motor_numbers(motor), "figure_5": oscillator_numbers(oscillator, orders)}
    for name, content in numbers.items():
        text = json.dumps(content, indent=2, allow_nan=False, ensure_ascii=False)
        _write(folder / f"{name}.json", text + "\n")
    return {"files": [str(f) for f in sorted(folder.glob("figure_*")) if f.suffix in (".png", ".json")], **numbers}


# -------------------------------------------------------------------- figures 1 and 2: sign_j


def draw_sign(path: Path) -> None:
    """Draw sign_j beside sign for several orders."""
    z = np.linspace(-3, 3, 1201)
    with plotting.canvas(path, 6.4, 3.4) as figure:
        axes = figure.subplots()
        axes.plot([-3, 0, 0, 3], [-1, -1, 1, 1], color=plotting.EXACT, lw=1.0, ls="--", label="sign")
        for order, colour in zip((2, 4, 10, 50), plotting.SEQUENCE, strict=True):
            axes.plot(z, sign_j(z, order), color=colour, label=f"sign$_j$, j = {order}")
        axes.set(xlabel="z = v / scale  [-]", ylabel="sign$_j$(z)  [-]", xlim=(-3, 3))
        axes.set_title("The rational approximation of sign (even j)")
        axes.legend(loc="lower right")


def draw_uses_of_sign(path: Path) -> None:
    """Draw |v| through sign_j, the friction coefficient that enters A, and where sign_j stops being a sign."""
    with plotting.canvas(path, 10.4, 3.5) as figure:
        magnitude, gain, reach = figure.subplots(1, 3)
        _draw_magnitude(magnitude)
        _draw_gain(gain)
        _draw_reach(reach)


def _draw_magnitude(axes: Any) -> None:
    v = np.linspace(-0.6, 0.6, 601)
    axes.plot(v, np.abs(v), color=plotting.EXACT, lw=1.0, ls="--", label="|v|")
    for order, colour in zip((2, 4, 10, 50), plotting.SEQUENCE, strict=True):
        axes.plot(v, v * sign_j(v, order), color=colour, label=f"j = {order}")
    axes.set(xlabel="v  [scale]", ylabel="v sign$_j$(v)  [scale]", title="|v| through sign$_j$", xlim=(-0.6, 0.6))
    axes.legend(loc="upper center", ncols=1)


def _draw_gain(axes: Any) -> None:
    v = np.logspace(-3, 1.2, 400)
    axes.loglog(v, 1 / v, color=plotting.EXACT, lw=1.0, ls="--", label="sign(v) / v")
    for order, colour in zip((10, 50), (plotting.SEQUENCE[2], plotting.SEQUENCE[3]), strict=True):
        axes.loglog(v, sign_j(v, order) / v, color=colour, label=f"secant, j = {order}")
        axes.loglog(v, sign_j_slope(v, order), color=colour, ls=":", label=f"slope, j = {order}")
    axes.set(xlabel="|v|  [scale]", ylabel="sign$_j$(v)/v and d sign$_j$/dv  [1/scale]", title="What enters A")
    axes.set(ylim=(0.03, 3000), xlim=(1e-3, 16))
    axes.legend(loc="upper right", fontsize=8)


def _draw_reach(axes: Any) -> None:
    z = np.logspace(-2, 2.3, 600)
    for order, colour, text in ((50, plotting.MIDPOINT, "even: falls off"), (51, plotting.START, "odd: overshoots")):
        s, good = sign_j(z, order), valid_surface(z, order)
        axes.semilogx(z, s, color=colour, ls=":")
        axes.semilogx(z[good], s[good], color=colour, lw=2.0, label=f"j = {order}, {text}")
    axes.axhline(1, color=plotting.EXACT, lw=1.0, ls="--")
    axes.axvline(50 / 3, color="#666666", lw=0.8)
    axes.text(50 / 3 * 0.9, 0.06, "valid up to\nz = j/3", ha="right", color="#444444")
    axes.set(xlabel="z = v / scale  [-]", ylabel="sign$_j$(z)  [-]", title="Where it stops being a sign")
    axes.set(ylim=(0, 2.2), xlim=(0.01, 200))
    axes.legend(loc="upper left")


# -------------------------------------------------------------------- figure 4: the motor


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
        **_options(motor.model),
        "input": {"voltage": MOTOR_VOLTAGE, "unit": "V", "reversal": {"value": MOTOR_HALF, "unit": "s"}},
        "duration": {"value": float(motor.t[-1]), "unit": "s"},
        "speed_at_reversal": {"unit": unit, **{n: float(r["speed"][middle]) for n, r in motor.runs.items()}},
        "speed_rmse": {"unit": unit, **{name: _rms(speed - exact) for name, speed in others.items()}},
        "updates_in_valid_range": {"count": int(motor.valid[updates].sum()), "of": int(updates.size)},
    }


def _options(model: Model) -> dict[str, Any]:
    return {
        "plant": model.plant.name,
        "parameters": model.parameters,
        "effects": {key: use.parameters for key, use in model.effects.items()},
        "sign_order": model.sign_order,
        "sign_scale": model.sign_scale,
        "linearization": model.linearization,
        "update_period": {"value": model.update_period, "unit": "s"},
    }


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


MOTOR_CURVES = {
    "exact": ("non-smooth motor", plotting.EXACT, "-"),
    "start": ("A$_k$ from the start of each period (paper)", plotting.START, "-"),
    "midpoint": ("A$_k$ from its predicted midpoint", plotting.MIDPOINT, "--"),
    "no_friction": ("friction-free motor", plotting.BARE, "-."),
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
        voltage.step(motor.t, motor.runs["exact"]["voltage"], color=plotting.EXACT, where="post")
        period = motor.model.update_period
        speed.set(ylabel="speed  [rad/s]", title=f"DC motor, j = {motor.model.sign_order}, update every {period:g} s")
        error.set(ylabel="error of speed  [rad/s]")
        voltage.set(ylabel="voltage  [V]", xlabel="time  [s]", xlim=(0, motor.t[-1]), ylim=(-3, 3))
        plotting.legend_above(figure, speed, 2)


# -------------------------------------------------------------------- figures 5 and 6: hysteresis


@dataclass(frozen=True)
class OscillatorRuns:
    """Figs. 5 and 6: the model, times (T,) in s, input (T, 1) in N, and runs by name."""

    model: Model
    t: Array
    u: Array
    runs: Mapping[str, Trajectory]

    def force(self, name: str) -> Array:
        """Return the restoring force (T,) of a run in N."""
        return restoring_force(self.model, self.runs[name])


def restoring_force(model: Model, run: Trajectory) -> Array:
    """Return alpha k q + (1 - alpha) D k h, (T,) in N."""
    alpha, D, k = (model.value(name) for name in ("alpha", "D", "k"))
    return np.asarray(alpha * k * run["displacement"] + (1 - alpha) * D * k * run["hysteresis"])


def run_oscillator() -> OscillatorRuns:
    """Simulate the Bouc-Wen oscillator under a sine: exact, f_j, and A_k from start and midpoint of each period."""
    model = Model.load("bouc_wen")
    t: Array = OSCILLATOR_STEP * np.arange(round(OSCILLATOR_SPAN / OSCILLATOR_STEP) + 1, dtype=float)
    u = FORCE * np.sin(FORCE_RATE * t)[:, None]
    runs = {"exact": simulate(model, t, u), "smooth": simulate(model, t, u, kind="smooth")}
    for point in ("start", "midpoint"):
        runs[point] = simulate(model.with_options(operating_point=point), t, u, kind="piecewise")
    return OscillatorRuns(model, t, u, runs)


def errors_by_period(oscillator: OscillatorRuns) -> dict[str, list[float]]:
    """Return the RMS error of the restoring force against f_j, in % of its deviation, for each of `PERIODS`."""
    truth, model = oscillator.force("smooth"), oscillator.model
    found: dict[str, list[float]] = {"start": [], "midpoint": []}
    for point, values in found.items():
        for period in PERIODS:
            other = model.with_options(operating_point=point, update_period=period)
            run = simulate(other, oscillator.t, oscillator.u, kind="piecewise")
            values.append(_percent(restoring_force(model, run), truth))
    return found


def observed_orders(errors: list[float]) -> list[float]:
    """Return the order in the update period between each of `PERIODS` and the next."""
    return [float(v) for v in np.diff(np.log(errors)) / np.diff(np.log(PERIODS))]


def _percent(values: Array, truth: Array) -> float:
    return 100 * _rms(values - truth) / float(truth.std())


def oscillator_numbers(oscillator: OscillatorRuns, errors: Mapping[str, list[float]]) -> dict[str, Any]:
    """Return the numbers of Fig. 5: RMS errors in % of the force's deviation, and orders in the update period."""
    exact = oscillator.force("exact")
    others = {name: _percent(oscillator.force(name), exact) for name in oscillator.runs if name != "exact"}
    return {
        **_options(oscillator.model),
        "input": {"amplitude": {"value": FORCE, "unit": "N"}, "rate": {"value": FORCE_RATE, "unit": "rad/s"}},
        "duration": {"value": OSCILLATOR_SPAN, "unit": "s"},
        "force_deviation": {"value": float(exact.std()), "unit": "N"},
        "force_rmse_against_exact": {"unit": "% of the standard deviation", **others},
        "force_rmse_against_smooth": {
            "unit": "% of the standard deviation",
            "update_period": {"unit": "s", "values": list(PERIODS)},
            **errors,
        },
        "observed_order": {"unit": "-", **{name: observed_orders(values) for name, values in errors.items()}},
    }


FORCE_CURVES = {
    "exact": ("non-smooth oscillator", plotting.EXACT, "-"),
    "start": ("A$_k$ from the start of each period (paper)", plotting.START, "-"),
    "midpoint": ("A$_k$ from its predicted midpoint", plotting.MIDPOINT, "--"),
}


def draw_oscillator(path: Path, oscillator: OscillatorRuns, errors: Mapping[str, list[float]]) -> None:
    """Draw Fig. 5: the restoring force, its error, and how the error falls with the update period."""
    exact = oscillator.force("exact")
    with plotting.canvas(path, 10.4, 4.6) as figure:
        left, right = figure.subfigures(1, 2, width_ratios=(1.9, 1))
        force, error = left.subplots(2, 1, sharex=True)
        for name, (label, colour, dash) in FORCE_CURVES.items():
            run = oscillator.force(name)
            force.plot(oscillator.t, run, color=colour, ls=dash, label=label, lw=2.2 if name == "exact" else 1.4)
            if name != "exact":
                error.plot(oscillator.t, run - exact, color=colour, lw=1.1)
        period = oscillator.model.update_period
        force.set(ylabel="restoring force  [N]", title=f"Bouc-Wen oscillator, update every {period:g} s")
        error.set(ylabel="error  [N]", xlabel="time  [s]", xlim=(0, oscillator.t[-1]))
        _draw_order(right.subplots(), errors)
        left.align_ylabels()
        plotting.legend_above(figure, force, 3)


def _draw_order(axes: Any, errors: Mapping[str, list[float]]) -> None:
    for name, colour, order in (("start", plotting.START, 1), ("midpoint", plotting.MIDPOINT, 2)):
        axes.loglog(PERIODS, errors[name], "o-", color=colour, ms=4)
        guide = errors[name][-1] * (np.array(PERIODS) / PERIODS[-1]) ** order
        axes.loglog(PERIODS, guide, color=colour, lw=0.8, ls=":", label=f"order {order}")
    axes.set(xlabel="update period  [s]", ylabel="RMS error against f$_j$  [% of std]", title="Order")
    axes.set_xticks(PERIODS, [f"{p:g}" for p in PERIODS], minor=False)
    axes.set_xticks([], minor=True)
    axes.legend(loc="lower right")


def draw_loop(path: Path, oscillator: OscillatorRuns) -> None:
    """Draw Fig. 6: the restoring force against the displacement, and what of it is not the spring k q."""
    k = oscillator.model.value("k")
    with plotting.canvas(path, 9.0, 4.2) as figure:
        loop, rest = figure.subplots(1, 2)
        for name, (label, colour, dash) in FORCE_CURVES.items():
            q, force = oscillator.runs[name]["displacement"], oscillator.force(name)
            width = 2.0 if name == "exact" else 1.0
            loop.plot(q, force, color=colour, ls=dash, label=label, lw=width)
            rest.plot(q, force - k * q, color=colour, ls=dash, lw=width)
        loop.set(xlabel="displacement q  [m]", ylabel="restoring force  [N]", title="Hysteresis loop")
        rest.set(xlabel="displacement q  [m]", ylabel="restoring force - k q  [N]", title="The same less the spring")
        plotting.legend_above(figure, loop, 3)
