"""Pictures of a comparison, one function each; every one returns a matplotlib figure in the house style.

Measured is black, the free run orange, the prediction over windows blue; bands are ± 2 standard errors that allow for
correlation in time. Write one to a file with `signlin_ros.plotting.save`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from signlin_ros.comparison import bands
from signlin_ros.comparison.missing import Missing
from signlin_ros.console import per_second
from signlin_ros.diagnosis.compared import Comparison, Traces
from signlin_ros.errors import InputError
from signlin_ros.noise import Noise
from signlin_ros.plotting import EXACT_COLOUR, JACOBIAN, MIDPOINT, SEQUENCE, START_COLOUR, legend_above, shade, styled
from signlin_ros.report import curves

Array = NDArray[np.float64]

SIGNAL_COLOUR, FREE_RUN_COLOUR, WINDOWED, LACKING, SENSOR_NOISE_COLOUR = (
    EXACT_COLOUR,
    START_COLOUR,
    MIDPOINT,
    JACOBIAN,
    "#666666",
)
LEAST_IN_MAP = 3
"""A field of the map with fewer samples stays empty."""
MAX_DRAWN_POINTS = 4000
"""At most so many dots or line segments are drawn of a signal."""
SEGMENT = 1024
SHADED_OVER_RMS = 1.5
"""Where no region stands out, stretches are shaded whose error is so many times its RMS."""
ENLARGED_PART = 0.12
"""The part of a stretch shown enlarged, around where the prediction is worst."""


# -------------------------------------------------------------------- measured and simulated


def measured_and_simulated(comparison: Comparison, stretch: int | None = None) -> Any:
    """Every channel over time, measured and predicted, the failing stretches shaded; at right the worst enlarged.

    ``stretch``: which of the stretches without a gap; by default the one with the largest error.
    """
    k = _worst_stretch(comparison) if stretch is None else stretch
    trace, names = comparison.traces[k], list(comparison.channels)
    failing, label = _failing(comparison, k)
    low, high = _worst_span(comparison, trace)
    with styled(9.5, 1.0 + 1.75 * len(names)) as figure:
        grid = figure.subplots(len(names), 2, sharex="col", squeeze=False, width_ratios=(3, 2))
        for j, (name, axes) in enumerate(zip(names, grid, strict=True)):
            for ax, part in zip(axes, (slice(0, None), slice(low, high)), strict=True):
                _channel(ax, trace, j, part, failing, label)
            axes[0].set_ylabel(f"{name} [{comparison.channels[name].unit}]")
        for ax in grid[-1]:
            ax.set_xlabel("time [s]")
        grid[0, 1].set_title("enlarged where the prediction is worst")
        legend_above(figure, grid[0, 0], 4)
    return figure


def _channel(ax: Any, trace: Traces, j: int, part: slice, failing: Array, label: str) -> None:
    t = trace.t[part]
    every = max(1, t.size // MAX_DRAWN_POINTS)
    y = trace.measured[part, j]
    size = float(np.nanmax(np.abs(y), initial=0.0)) or 1.0
    free = np.where(np.abs(trace.free[part, j]) < 3 * size, trace.free[part, j], np.nan)
    ax.plot(t[::every], y[::every], color=SIGNAL_COLOUR, lw=1.8, label="measured")
    ax.plot(t[::every], free[::every], color=FREE_RUN_COLOUR, lw=0.9, label="free run")
    ax.plot(t[::every], trace.windowed[part, j][::every], color=WINDOWED, lw=0.9, label="predicted over windows")
    if failing.any():
        shade(ax, t, failing[part], label)
    ax.set_xlim(t[0], t[-1])


def _windowed_error(comparison: Comparison, trace: Traces) -> Array:
    """Return the error of the windowed prediction (T,), over the channels, each in units of its RMS error."""
    sizes = [c.windowed.rmse if c.windowed and c.windowed.rmse > 0 else np.inf for c in comparison.channels.values()]
    return np.asarray(np.sum(np.nan_to_num((trace.measured - trace.windowed) / np.array(sizes)) ** 2, axis=1))


def _worst_stretch(comparison: Comparison) -> int:
    return int(np.argmax([_windowed_error(comparison, trace).mean() for trace in comparison.traces]))


def _worst_span(comparison: Comparison, trace: Traces) -> tuple[int, int]:
    """Return the first and last sample of the part of a stretch with the largest error."""
    count = max(int(ENLARGED_PART * trace.t.size), 2)
    sums = np.convolve(_windowed_error(comparison, trace), np.ones(count), mode="valid")
    first = int(np.argmax(sums))
    return first, first + count


def _failing(comparison: Comparison, k: int) -> tuple[Array, str]:
    """Return the samples to be shaded (T,) and what they are: the first region found, else where the error is large."""
    masked = [region for region in comparison.where if region.mask]
    if masked:
        return np.asarray(masked[0].mask[k]), masked[0].name
    error = _windowed_error(comparison, comparison.traces[k])
    count = max(1, int(comparison.horizon / np.median(np.diff(comparison.traces[k].t))))
    smooth = uniform_filter1d(error, count, mode="nearest")
    return np.asarray(smooth > SHADED_OVER_RMS**2 * error.mean()), f"error over {SHADED_OVER_RMS:g} times its RMS"


# -------------------------------------------------------------------- what is missing


def missing_against(
    comparison: Comparison,
    coordinates: Sequence[str] | None = None,
    candidates: Mapping[str, Mapping[str, tuple[Array, Array]]] | None = None,
) -> Any:
    """What is missing from the equations against velocity, position and current (or input), with confidence band.

    A position is shown modulo the period in which what is missing repeats, if it does. ``candidates``: curves (x, y)
    to lay over it, by coordinate and by label. Raises `InputError` where the record does not let it be told.
    """
    lacking = _main(comparison)
    names = _coordinates(comparison) if coordinates is None else [comparison.model.canonical(c) for c in coordinates]
    values = np.concatenate(lacking.values)
    block = bands.memory(values)
    with styled(3.3 * len(names) + 0.6, 3.3) as figure:
        for ax, name in zip(figure.subplots(1, len(names), sharey=True, squeeze=False)[0], names, strict=True):
            x, label = _folded(comparison, name)
            _scatter_and_band(ax, x, values, block, dense=name == comparison.model.plant.velocity)
            for i, (what, curve) in enumerate((candidates or {}).get(name, {}).items()):
                ax.plot(*curve, color=SEQUENCE[i % len(SEQUENCE)], lw=1.8, label=what)
            ax.set_xlabel(f"{label} [{_unit(comparison, name)}]")
        first = figure.axes[0]
        first.set_ylabel(f"missing {lacking.name} [{lacking.unit}]")
        legend_above(figure, first, 4)
    return figure


def missing_over_time(comparison: Comparison, stretch: int | None = None) -> Any:
    """What is missing from the equations over time, and what noise alone would make of it: what comes and goes by
    itself, swings on, or drifts, shows here and against no coordinate.

    ``stretch``: which of the stretches without a gap; by default the one with the largest error. Raises `InputError`
    where the record does not let it be told.
    """
    lacking = _main(comparison)
    k = _worst_stretch(comparison) if stretch is None else stretch
    t, values = comparison.traces[k].t, lacking.values[k]
    every = max(1, t.size // MAX_DRAWN_POINTS)
    with styled(9.5, 2.6) as figure:
        ax = figure.subplots()
        ax.axhspan(
            -2 * lacking.noise,
            2 * lacking.noise,
            color=SENSOR_NOISE_COLOUR,
            alpha=0.2,
            lw=0,
            label="noise, ± 2 deviations",
        )
        ax.plot(t[::every], values[::every], color=LACKING, lw=0.9, label="what is missing")
        ax.axhline(0.0, color=SENSOR_NOISE_COLOUR, lw=0.7)
        ax.set_xlim(t[0], t[-1])
        ax.set_xlabel("time [s]")
        ax.set_ylabel(f"missing {lacking.name} [{lacking.unit}]")
        legend_above(figure, ax, 2)
    return figure


def _scatter_and_band(ax: Any, x: Array, values: Array, block: int, dense: bool) -> None:
    every = max(1, x.size // MAX_DRAWN_POINTS)
    found = bands.band(x, values, block, dense_at_zero=dense)
    ax.plot(x[::every], values[::every], ".", color="#BBBBBB", ms=1.5, zorder=1, label="samples", rasterized=True)
    low, high = found.mean - found.two_errors, found.mean + found.two_errors
    ax.fill_between(found.at, low, high, color=LACKING, alpha=0.35, lw=0, label="mean ± 2 standard errors")
    ax.plot(found.at, found.mean, color=LACKING, lw=1.4)
    ax.axhline(0.0, color=SENSOR_NOISE_COLOUR, lw=0.7)
    span = np.quantile(values, [0.003, 0.997])
    margin = 0.25 * float(np.ptp(span)) or 1.0
    ax.set_ylim(span[0] - margin, span[1] + margin)


def _main(comparison: Comparison) -> Missing:
    """Return the largest missing term, over the typical size of its equation."""
    if not comparison.missing:
        raise InputError("what is missing cannot be told: the record does not measure enough")
    return max(comparison.missing, key=lambda m: (m.clear, m.rms / m.typical))


def _coordinates(comparison: Comparison) -> list[str]:
    """Return velocity, position, and current or the input, whichever what is missing goes with."""
    model = comparison.model
    first, known = model.inputs[0], (*model.states, *model.inputs)
    last = "current" if "current" in model.states and _main(comparison).name != first else first
    return [name for name in dict.fromkeys((model.plant.velocity, model.plant.position, last)) if name in known]


def _column(comparison: Comparison, name: str) -> Array:
    found = curves.column(comparison, name)
    if found is None:
        raise InputError(f"{name!r} is no state or input of {comparison.model.source}")
    return found


def _folded(comparison: Comparison, name: str) -> tuple[Array, str]:
    """Return a coordinate (N,) and what to call it: a position modulo the period that was found, if one was."""
    x = _column(comparison, name)
    period = max((region.period for region in comparison.where), default=0.0)
    if name != comparison.model.plant.position or period == 0.0:
        return x, name
    return np.mod(x, period), f"{name} modulo {period:.3g}"


def _unit(comparison: Comparison, name: str) -> str:
    if name in comparison.channels:
        return comparison.channels[name].unit
    model, plant = comparison.model, comparison.model.plant
    if name == plant.velocity and plant.position in comparison.channels:
        return per_second(comparison.channels[plant.position].unit)
    return comparison.units.get(name, model.units[name])


def error_map(comparison: Comparison, x: str | None = None, y: str | None = None, bins: int = 18) -> Any:
    """RMS of what is missing over two coordinates, by default velocity and position (or the input)."""
    lacking, names = _main(comparison), _coordinates(comparison)
    x, y = x or names[0], y or names[1 if len(names) > 1 else 0]
    columns = [_column(comparison, name) for name in (x, y)]
    values = np.concatenate(lacking.values)
    edges = [np.linspace(np.quantile(c, 0.002), np.quantile(c, 0.998), bins + 1) for c in columns]
    count, _, _ = np.histogram2d(columns[0], columns[1], bins=edges)
    squares, _, _ = np.histogram2d(columns[0], columns[1], bins=edges, weights=values**2)
    rms = np.sqrt(squares / np.where(count >= LEAST_IN_MAP, count, np.nan))
    with styled(5.6, 4.0) as figure:
        ax = figure.subplots()
        mesh = ax.pcolormesh(edges[0], edges[1], rms.T, cmap="viridis", vmin=0.0, vmax=float(np.nanquantile(rms, 0.99)))
        ax.grid(visible=False)
        ax.set_facecolor("#F2F2F2")
        ax.set_xlabel(f"{x} [{_unit(comparison, x)}]")
        ax.set_ylabel(f"{y} [{_unit(comparison, y)}]")
        ax.set_title("where it is grey, the record did not go")
        figure.colorbar(mesh, ax=ax, label=f"RMS of missing {lacking.name} [{lacking.unit}]")
    return figure


def hysteresis_loop(comparison: Comparison, stretch: int = 0) -> Any:
    """The force with which springs and friction resist, against position and against velocity: measured and model."""
    model, lacking = comparison.model, _main(comparison)
    force, computed = curves.internal_force(comparison, stretch)
    trace = comparison.traces[stretch]
    names = [n for n in (model.plant.position, model.plant.velocity) if n in (*model.states, *model.inputs)]
    every = max(1, trace.t.size // MAX_DRAWN_POINTS)
    with styled(3.6 * len(names) + 0.6, 3.5) as figure:
        for ax, name in zip(figure.subplots(1, len(names), sharey=True, squeeze=False)[0], names, strict=True):
            source, values = (model.states, trace.states) if name in model.states else (model.inputs, trace.u)
            x = values[:, source.index(name)]
            ax.plot(x[::every], force[::every], color=SIGNAL_COLOUR, lw=0.7, alpha=0.8, label="from the measurements")
            ax.plot(
                x[::every],
                computed[::every],
                color=FREE_RUN_COLOUR,
                lw=0.7,
                alpha=0.8,
                label="model at the same motion",
            )
            ax.set_xlabel(f"{name} [{_unit(comparison, name)}]")
        figure.axes[0].set_ylabel(f"resisting {lacking.name} [{lacking.unit}]")
        span = np.quantile(np.concatenate([force, computed]), [0.001, 0.999])
        figure.axes[0].set_ylim(span[0] - 0.1 * np.ptp(span), span[1] + 0.1 * np.ptp(span))
        legend_above(figure, figure.axes[0], 2)
    return figure


# -------------------------------------------------------------------- spectrum, ladder


def spectrum(comparison: Comparison) -> Any:
    """Spectra of each channel and of what an observer that trusts the model leaves of it, with the noise."""
    from scipy.signal import welch

    trace = comparison.traces[int(np.argmax([t.t.size for t in comparison.traces]))]
    rate = 1.0 / float(np.median(np.diff(trace.t)))
    with styled(3.2 * len(comparison.channels) + 0.6, 3.2) as figure:
        grid = figure.subplots(1, len(comparison.channels), squeeze=False)[0]
        for j, (ax, (name, channel)) in enumerate(zip(grid, comparison.channels.items(), strict=True)):
            y, left = trace.measured[:, j], trace.residual[:, j]
            for values, color, label in ((y, SIGNAL_COLOUR, "measured"), (left, WINDOWED, "residual")):
                there = values[np.isfinite(values)]
                if there.size > 1:
                    f, power = welch(there, rate, nperseg=min(there.size, SEGMENT))
                    ax.loglog(f[1:], np.sqrt(power[1:]), color=color, lw=1.0, label=label)
            f = np.geomspace(2 * rate / min(y.size, SEGMENT), rate / 2, 100)
            ax.loglog(
                f,
                np.sqrt(_noise_density(channel.noise, f, rate)),
                color=SENSOR_NOISE_COLOUR,
                ls="--",
                lw=1.2,
                label="noise",
            )
            ax.set_title(name)
            ax.set_xlabel("frequency [Hz]")
            ax.set_ylabel(f"[{channel.unit}/√Hz]")
        legend_above(figure, grid[0], 3)
    return figure


def _noise_density(noise: Noise, f: Array, rate: float) -> Array:
    """Return the one-sided spectral density of the noise at frequencies f in Hz."""
    colour = (1 - noise.rho**2) / np.abs(1 - noise.rho * np.exp(-2j * np.pi * f / rate)) ** 2
    return np.asarray(2 * noise.sigma**2 * colour / rate)


def ladder(steps: Sequence[tuple[str, float, float | None]], floor: float, quantity: str) -> Any:
    """The error from the base model to the noise floor: ``steps`` are (label, estimation, validation), top to bottom.

    ``floor``: the error that the noise alone leaves; ``quantity``: what the axis shows, with its unit.
    """
    with styled(6.4, 0.9 + 0.55 * len(steps)) as figure:
        ax = figure.subplots()
        rows = np.arange(len(steps))[::-1]
        estimation = [value for _, value, _ in steps]
        validation = [np.nan if value is None else value for _, _, value in steps]
        seen = np.isfinite(validation)
        ax.barh(rows + 0.18 * seen.any(), estimation, 0.36, color=SEQUENCE[0], label="data of the fit")
        if seen.any():
            ax.barh(rows - 0.18, validation, 0.36, color=MIDPOINT, label="data that the fit never saw")
        ax.axvline(floor, color=SENSOR_NOISE_COLOUR, ls="--", lw=1.2, label="noise")
        for row, (_, first, second) in zip(rows, steps, strict=True):
            shown = first if second is None else second
            ax.text(shown, row - 0.18 * (second is not None), f" {shown:.3g}", va="center", fontsize=8)
        ax.set_yticks(rows, [label for label, _, _ in steps])
        ax.set_xlabel(quantity)
        ax.set_xlim(0, 1.15 * max(*estimation, *np.nan_to_num(validation), floor))
        ax.grid(visible=False, axis="y")
        legend_above(figure, ax, 3)
    return figure


__all__ = [
    "error_map",
    "hysteresis_loop",
    "ladder",
    "measured_and_simulated",
    "missing_against",
    "missing_over_time",
    "spectrum",
]
