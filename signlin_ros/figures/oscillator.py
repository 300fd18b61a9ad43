"""Figures 5 and 6: the oscillator with hysteresis, as loops and over time; beyond them, the order in the period."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from signlin_ros import plotting
from signlin_ros.figures.shared import Array, options, rms
from signlin_ros.model import Model
from signlin_ros.simulation import Trajectory, simulate

FORCE_AMPLITUDE, FORCE_RATE, OSCILLATOR_SPAN, OSCILLATOR_STEP = 1.0, 1.0, 40.0, 0.0025
"""The input sin t: force in N, its rate in rad/s; length of the run and sampling, for which it is held, in s."""
OBSERVED_PERIODS = (0.4, 0.2, 0.1, 0.05, 0.025)
"""Update periods in s at which the order is observed."""


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
    u = FORCE_AMPLITUDE * np.sin(FORCE_RATE * t)[:, None]
    runs = {"exact": simulate(model, t, u), "smooth": simulate(model, t, u, kind="smooth")}
    for point in ("start", "midpoint"):
        runs[point] = simulate(model.with_options(operating_point=point), t, u, kind="piecewise")
    return OscillatorRuns(model, t, u, runs)


def errors_by_period(oscillator: OscillatorRuns) -> dict[str, list[float]]:
    """Return the RMS error of the restoring force against f_j, in % of its deviation, for each of
    `OBSERVED_PERIODS`.
    """
    truth, model = oscillator.force("smooth"), oscillator.model
    found: dict[str, list[float]] = {"start": [], "midpoint": []}
    for point, values in found.items():
        for period in OBSERVED_PERIODS:
            other = model.with_options(operating_point=point, update_period=period)
            run = simulate(other, oscillator.t, oscillator.u, kind="piecewise")
            values.append(_percent(restoring_force(model, run), truth))
    return found


def observed_orders(errors: list[float]) -> list[float]:
    """Return the order in the update period between each of `OBSERVED_PERIODS` and the next."""
    return [float(v) for v in np.diff(np.log(errors)) / np.diff(np.log(OBSERVED_PERIODS))]


def _percent(values: Array, truth: Array) -> float:
    return 100 * rms(values - truth) / float(truth.std())


def oscillator_numbers(oscillator: OscillatorRuns, errors: Mapping[str, list[float]]) -> dict[str, Any]:
    """Return the numbers of Fig. 5: RMS errors in % of the force's deviation, and orders in the update period."""
    exact = oscillator.force("exact")
    others = {name: _percent(oscillator.force(name), exact) for name in oscillator.runs if name != "exact"}
    return {
        **options(oscillator.model),
        "input": {"amplitude": {"value": FORCE_AMPLITUDE, "unit": "N"}, "rate": {"value": FORCE_RATE, "unit": "rad/s"}},
        "duration": {"value": OSCILLATOR_SPAN, "unit": "s"},
        "largest": _largest(oscillator),
        "force_deviation": {"value": float(exact.std()), "unit": "N"},
        "force_rmse_against_exact": {"unit": "% of the standard deviation", **others},
        "force_rmse_against_smooth": {
            "unit": "% of the standard deviation",
            "update_period": {"unit": "s", "values": list(OBSERVED_PERIODS)},
            **errors,
        },
        "observed_order": {"unit": "-", **{name: observed_orders(values) for name, values in errors.items()}},
    }


def _largest(oscillator: OscillatorRuns) -> dict[str, Any]:
    run, units = oscillator.runs["exact"], oscillator.model.units
    names = ("displacement", "hysteresis")
    return {name: {"value": float(np.abs(run[name]).max()), "unit": units[name]} for name in names}


CURVES = {
    "exact": ("non-smooth (38)", plotting.EXACT_COLOUR, "-"),
    "start": ("proposed (43)", plotting.START_COLOUR, "-"),
    "midpoint": ("the same from the predicted midpoint", plotting.MIDPOINT, "--"),
}


def draw_loops(path: Path, oscillator: OscillatorRuns) -> None:
    """Draw Fig. 5: restoring force against displacement, for the proposed model and for the predicted midpoint."""
    with plotting.canvas(path, 9.0, 4.6) as figure:
        both = figure.subplots(1, 2, sharex=True, sharey=True)
        for axes, name in zip(both, ("start", "midpoint"), strict=True):
            for curve in ("exact", name):
                label, colour, dash = CURVES[curve]
                q, R = oscillator.runs[curve]["displacement"], oscillator.force(curve)
                axes.plot(q, R, color=colour, ls=dash, label=label, lw=2.0 if curve == "exact" else 0.8)
            axes.set(xlabel="displacement s  [m]", title=f"update every {oscillator.model.update_period:g} s")
            axes.legend(loc="lower right")
        both[0].set(ylabel="restoring force R  [N]")


def draw_time(path: Path, oscillator: OscillatorRuns) -> None:
    """Draw Fig. 6: displacement and restoring force over time; below each, how far off the linear models are."""
    quantities = {
        "displacement s  [m]": lambda name: oscillator.runs[name]["displacement"],
        "restoring force R  [N]": oscillator.force,
    }
    with plotting.canvas(path, 9.0, 7.4) as figure:
        panels = figure.subplots(4, 1, sharex=True, height_ratios=(2, 1, 2, 1))
        for (label, values), axes, error in zip(quantities.items(), panels[::2], panels[1::2], strict=True):
            for name, (text, colour, dash) in CURVES.items():
                axes.plot(oscillator.t, values(name), color=colour, ls=dash, label=text, lw=1.2 + (name == "exact"))
                if name != "exact":
                    error.plot(oscillator.t, values(name) - values("exact"), color=colour, lw=1.1)
            axes.set(ylabel=label)
            error.set(ylabel=f"error  {label[-3:]}")
        panels[-1].set(xlabel="time  [s]", xlim=(0, oscillator.t[-1]))
        figure.align_ylabels()
        plotting.legend_above(figure, panels[0], 3)


def draw_order(path: Path, errors: Mapping[str, list[float]]) -> None:
    """Draw how the error of the restoring force falls with the update period, for both operating points."""
    with plotting.canvas(path, 5.0, 4.2) as figure:
        axes = figure.subplots()
        for name, colour, order in (("start", plotting.START_COLOUR, 1), ("midpoint", plotting.MIDPOINT, 2)):
            axes.loglog(OBSERVED_PERIODS, errors[name], "o-", color=colour, ms=4, label=name)
            guide = errors[name][-1] * (np.array(OBSERVED_PERIODS) / OBSERVED_PERIODS[-1]) ** order
            axes.loglog(OBSERVED_PERIODS, guide, color=colour, lw=0.8, ls=":", label=f"order {order}")
        axes.set(xlabel="update period  [s]", ylabel="RMS error of R against f$_j$  [% of its deviation]")
        axes.set_xticks(OBSERVED_PERIODS, [f"{p:g}" for p in OBSERVED_PERIODS], minor=False)
        axes.set_xticks([], minor=True)
        axes.legend(loc="lower right")
