"""Pictures of a diagnosis, one function each; every one returns a matplotlib figure in the house style.

Measured is black, the base model orange, the proposal blue; bands are ± 2 standard errors that allow for correlation in
time. Write one to a file with `signlin_ros.plotting.save`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from signlin_ros.diagnosis.compared import Comparison
from signlin_ros.diagnosis.effect_evidence import EffectEvidence, Explanation
from signlin_ros.diagnosis.results import Diagnosis, LadderRow
from signlin_ros.names import AS_GIVEN, REFITTED_ROW, SENSOR_NOISE_ROW, printed_name
from signlin_ros.plotting import BARE, EXACT_COLOUR, JACOBIAN, MIDPOINT, SEQUENCE, START_COLOUR, legend_above, styled

Array = NDArray[np.float64]

MEASURED_COLOUR, BASE_COLOUR, PROPOSAL, FORWARD, BACKWARD, NOISE_COLOUR = (
    EXACT_COLOUR,
    START_COLOUR,
    MIDPOINT,
    JACOBIAN,
    BARE,
    "#666666",
)
MAX_DOTS = 4000
"""At most so many dots of a signal are drawn."""
ZOOM_PART = 0.05
"""The part of a stretch shown enlarged, around where the base model is worst."""
RANGE_MARGIN = 0.5
"""By so much of its own range a picture is widened for what is beside it."""
MAX_DRAWN_RATIO = 3.0
"""Predictions further away than so many times the size of what is measured are not drawn."""


def words(effects: Sequence[str]) -> str:
    """Return the names of effects as one says them."""
    return " + ".join(printed_name(e) for e in effects)


# -------------------------------------------------------------------- ladder


def ladder(d: Diagnosis) -> Any:
    """The error of every channel on validation data, from the model as given to the proposal, and the noise floor
    below.
    """
    channels, rungs = list(d.ladder[0].validation.channels), [*([d.given] if d.given else []), *d.ladder]
    labels = [
        *([AS_GIVEN] if d.given else []),
        REFITTED_ROW,
        *(f"+ {words(_added(a, b))}" for a, b in zip(d.ladder, d.ladder[1:], strict=False)),
    ]
    with styled(9.5, 1.25 + 0.42 * (len(labels) + 1)) as figure:
        grid = figure.subplots(1, len(channels), sharey=True, squeeze=False)[0]
        for ax, name in zip(grid, channels, strict=True):
            _rungs(ax, rungs, name, d.findings.shown(d.model.units[name]) if d.findings else d.model.units[name])
        rows = np.arange(len(labels) + 1)[::-1]
        grid[0].set_yticks(rows, [*labels, SENSOR_NOISE_ROW])
        ahead = "over whole records" if d.model.plant.closed_loop else f"over windows of {d.horizon:.3g} s"
        figure.supxlabel(f"RMS error of the prediction, {ahead}, data that the fit never saw", fontsize=9)
    return figure


def _added(before: LadderRow, after: LadderRow) -> list[str]:
    return [e for e in after.effects if e not in before.effects]


def _rungs(ax: Any, rungs: Sequence[LadderRow], name: str, unit: str) -> None:
    scores = [r.validation.channels[name] for r in rungs]
    ratio = scores[-1].rmse_over_noise
    noise = scores[-1].rmse / ratio if ratio else 0.0
    values = [min(s.rmse, 1e30) for s in scores] + [noise]
    rows = np.arange(len(values))[::-1]
    colors = [BASE_COLOUR, *[SEQUENCE[0]] * (len(scores) - 2), *[PROPOSAL] * (len(scores) > 1), "#BBBBBB"]
    ax.barh(rows, values, 0.62, color=colors)
    ax.axvline(noise, color=NOISE_COLOUR, ls="--", lw=1.0)
    for row, value, s in zip(rows, values, [*scores, None], strict=True):
        over = f"  ({s.rmse_over_noise:.3g}×)" if s and s.rmse_over_noise else ""
        ax.text(value, row, f" {value:.3g}{over}", va="center", fontsize=8)
    ax.set_xlim(0, 1.45 * max(values))
    ax.set_title(f"{name} [{unit}]")
    ax.locator_params(axis="x", nbins=5)
    ax.grid(visible=False, axis="y")


# -------------------------------------------------------------------- before and after


def before_and_after(before: Comparison, after: Comparison, stretch: int | None = None) -> Any:
    """Every channel as measured, as the base model and as the proposal predict it: all, enlarged where the base model
    is worst, and what either leaves.

    Both comparisons are with the same records. ``stretch``: which of the stretches without a gap, by default the one
    where the base model is worst.
    """
    errors = [_relative(before, k) for k in range(len(before.traces))]
    k = int(np.argmax([e.mean() for e in errors])) if stretch is None else stretch
    low, high = _worst(errors[k])
    names = list(before.channels)
    with styled(11.0, 1.0 + 1.75 * len(names)) as figure:
        grid = figure.subplots(len(names), 3, squeeze=False, width_ratios=(3, 2, 3))
        for j, (name, axes) in enumerate(zip(names, grid, strict=True)):
            t, y, lines = _lines(before, after, k, j)
            for ax, part in zip(axes, (slice(None), slice(low, high)), strict=False):
                _signals(ax, t[part], y[part], [line[part] for line in lines])
            _leftovers(axes[2], t, [y - line for line in lines], before.channels[name].sigma)
            axes[0].set_ylabel(f"{name} [{before.channels[name].unit}]")
        for ax, title in zip(grid[0], ("whole record", "enlarged", "measured minus predicted"), strict=True):
            ax.set_title(title)
        for ax in grid[-1]:
            ax.set_xlabel("time [s]")
        legend_above(figure, grid[0, 0], 3)
    return figure


def _relative(c: Comparison, k: int) -> Array:
    """Return the squared error (T,) over all channels, each in units of its noise."""
    trace = c.traces[k]
    sizes = np.array([max(channel.sigma, 1e-300) for channel in c.channels.values()])
    return np.asarray(np.sum(np.nan_to_num((trace.measured - trace.windowed) / sizes) ** 2, axis=1))


def _worst(error: Array) -> tuple[int, int]:
    count = max(int(ZOOM_PART * error.size), min(error.size, 20))
    first = int(np.argmax(np.convolve(error, np.ones(count), mode="valid")))
    return first, first + count


def _lines(before: Comparison, after: Comparison, k: int, j: int) -> tuple[Array, Array, list[Array]]:
    """Return time, measurement and both predictions of a channel (T,), as its sensor shows them."""
    name = list(before.channels)[j]
    columns = [(c, c.traces[k].windowed[:, list(c.channels).index(name)]) for c in (before, after)]
    lines = [_as_shown(c, name, column) for c, column in columns]
    trace = before.traces[k]
    return trace.t, _as_shown(before, name, trace.measured[:, j]), lines


def _as_shown(c: Comparison, name: str, values: Array) -> Array:
    return np.asarray(c.model.sensors[name].show(values)) if name in c.model.sensors else values


def _signals(ax: Any, t: Array, y: Array, lines: Sequence[Array]) -> None:
    every = max(1, t.size // MAX_DOTS)
    size = MAX_DRAWN_RATIO * float(np.nanmax(np.abs(y), initial=0.0)) or 1.0
    ax.plot(t[::every], y[::every], color=MEASURED_COLOUR, lw=1.8, label="measured")
    for line, color, label in zip(lines, (BASE_COLOUR, PROPOSAL), ("model as given", "proposal"), strict=True):
        ax.plot(t[::every], np.where(np.abs(line) < size, line, np.nan)[::every], color=color, lw=0.9, label=label)
    ax.set_xlim(t[0], t[-1])


def _leftovers(ax: Any, t: Array, errors: Sequence[Array], noise: float) -> None:
    every = max(1, t.size // MAX_DOTS)
    ax.axhspan(-2 * noise, 2 * noise, color="#DDDDDD", lw=0)
    for e, color in zip(errors, (BASE_COLOUR, PROPOSAL), strict=True):
        ax.plot(t[::every], e[::every], color=color, lw=0.7)
    size = float(np.nanquantile(np.abs(errors[0]), 0.998)) if np.isfinite(errors[0]).any() else 0.0
    ax.set_ylim(*(1.1 * max(size, 4 * noise) * np.array([-1, 1])))
    ax.set_xlim(t[0], t[-1])


# -------------------------------------------------------------------- evidence


def evidence_picture(e: EffectEvidence) -> Any:
    """What the motion lacks without the effect and what the effect makes of it; the same for its nearest rival; and
    what the two leave of the means.
    """
    shown = [x for x in (e.named, e.rival) if x is not None]
    means = not e.place.single
    with styled(11.0 if means else 9.5, 3.7) as figure:
        grid = figure.subplots(1, len(shown) + means, squeeze=False)[0]
        low, high = _span([x.measured for x in shown])
        for ax, x, head in zip(grid, shown, ("", "nearest rival: "), strict=False):
            _explained(ax, e, x)
            ax.set_ylim(low, high)
            name = words([x.effect]) if x.effect else "nothing in its place"
            ax.set_title(f"{head if x.effect else ''}{name}")
        if means:
            _left(grid[-1], shown, e.place.dense)
            grid[-1].set_title("measured means minus each curve")
        for ax in grid:
            ax.set_xlabel(e.place.label)
            if ax.get_xscale() == "linear":
                ax.locator_params(axis="x", nbins=6)
                ax.ticklabel_format(axis="x", scilimits=(-3, 5))
        grid[0].set_ylabel(f"{e.quantity} [{e.unit}]")
        legend_above(figure, grid[0], 5)
    return figure


def _span(parts: Sequence[Array]) -> tuple[float, float]:
    """Return limits that hold nearly all samples of the first part, and of the others if they are not much larger."""
    quantiles = np.array([np.nanquantile(p, [0.004, 0.996]) for p in parts])
    (low, high), size = quantiles[0], float(np.ptp(quantiles[0]))
    low, high = (
        max(quantiles[:, 0].min(), low - RANGE_MARGIN * size),
        min(quantiles[:, 1].max(), high + RANGE_MARGIN * size),
    )
    margin = 0.1 * float(high - low) or 1.0
    return float(low) - margin, float(high) + margin


def _explained(ax: Any, e: EffectEvidence, x: Explanation) -> None:
    every = max(1, e.place.x.size // MAX_DOTS)
    place = e.place.x
    ax.plot(
        place[::every],
        x.measured[::every],
        ".",
        color="#BBBBBB",
        ms=3.0 if e.place.single else 1.6,
        label="samples",
        rasterized=True,
    )
    ax.axhline(0.0, color=NOISE_COLOUR, lw=0.7)
    if e.place.single:
        ax.plot(place, x.computed, color=PROPOSAL, lw=1.6, label="the same, computed with the effect")
        return
    sides = ("backward", "forward") if len(x.found) == 2 else [""] * len(x.found)
    for side, found, curve in zip(sides, x.found, x.curve, strict=True):
        color = {"backward": BACKWARD, "forward": FORWARD, "": MEASURED_COLOUR}[side]
        label = "mean ± 2 standard errors" + (f", moving {side}" if side else "")
        bars = {"fmt": "o", "ms": 2.6, "lw": 1.0, "color": color, "ls": "none", "zorder": 3, "label": label}
        ax.plot(curve.at, curve.mean, color=PROPOSAL, lw=2.2, alpha=0.8)
        ax.errorbar(found.at, found.mean, found.two_errors, **bars)
    ax.plot([], [], color=PROPOSAL, lw=2.2, label="the same, computed with the effect")


def _left(ax: Any, shown: Sequence[Explanation], dense: bool) -> None:
    ax.axhline(0.0, color=NOISE_COLOUR, lw=0.7)
    for x, look in zip(shown, _LEFT, strict=False):
        for i, (found, curve) in enumerate(zip(x.found, x.curve, strict=True)):
            label = "" if i else (words([x.effect]) if x.effect else "nothing")
            left = found.mean - curve.mean
            ax.errorbar(found.at, left, found.two_errors, label=label, ls="none", lw=0.8, elinewidth=0.8, **look)
    low, high = _around(shown)
    ax.set_ylim(low, high + 0.25 * (high - low))  # room for the legend
    if dense:  # the bins are: near 0 is where dry friction decides
        ax.set_xscale("function", functions=(_signed_root, _signed_square))
        reach = max(float(np.max(np.abs(b.at), initial=0.0)) for x in shown for b in x.found)
        ticks = [float(f"{reach * part:.1g}") for part in (-1, -0.3, -0.03, 0, 0.03, 0.3, 1)]
        ax.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    ax.legend(fontsize=8, loc="upper right")


_LEFT: tuple[dict[str, Any], ...] = (
    {"fmt": "o", "ms": 3.2, "color": PROPOSAL, "zorder": 3},
    {"fmt": "s", "ms": 5.5, "color": BASE_COLOUR, "mfc": "none"},
)


def _signed_root(x: Array) -> Array:
    return np.asarray(np.sign(x) * np.sqrt(np.abs(x)))


def _signed_square(x: Array) -> Array:
    return np.asarray(np.sign(x) * np.square(x))


def _around(shown: Sequence[Explanation]) -> tuple[float, float]:
    """Return limits that hold nearly all of what is left, and the typical error."""
    left = [np.abs(b.mean - c.mean) for x in shown for b, c in zip(x.found, x.curve, strict=True)]
    typical = float(np.median(np.concatenate([b.two_errors for b in shown[0].found])))
    size = max(float(np.quantile(np.concatenate(left), 0.97)), 3 * typical) or 1.0
    return -1.2 * size, 1.2 * size


__all__ = ["before_and_after", "evidence_picture", "ladder", "words"]
