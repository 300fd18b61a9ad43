"""The table and the figure of the demo."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from signlin_ros import plotting
from signlin_ros.demo.worth import Array, DemoRecord, Window, largest_difference, rms, typical
from signlin_ros.model import Model

SHOWN_COLUMNS = {"published": "published", "no friction": "no friction", "jacobian": "Jacobian", "exact": "exact model"}


def table(model: Model, record: DemoRecord, found: Mapping[str, Sequence[Window]]) -> str:
    """Return the table: RMS error of the predicted speed, and how many operating points lie in the valid range."""
    every = [window for each in found.values() for window in each]
    row = "  {:<18}{:>11}{:>13}{:>11}{:>13}{:>17}".format
    lines = [row("A_k from", *SHOWN_COLUMNS.values(), "in valid range")]
    for point, each in found.items():
        valid = sum(window.update.result.in_valid_range for window in each)
        errors, middle = ([f"{f(each, name):.3f}" for name in SHOWN_COLUMNS] for f in (rms, typical))
        lines.append(row(f"{point}, all", *errors, f"{valid} of {len(each)}"))
        lines.append(row(f"{point}, median", *middle, "").rstrip())
    limit = f"|speed| <= {model.sign_order * model.sign_scale / 3:.2f} rad/s"
    heard = f"{record.t.size} states in {record.t[-1]:.2f} s"
    return NOTES.format(
        period=model.update_period,
        rows="\n".join(lines),
        limit=limit,
        order=model.sign_order,
        heard=heard,
        difference=largest_difference(model, every),
    )


NOTES = """\
RMS error of the speed predicted over the next {period:g} s, in rad/s:
{rows}
published    A_k, B_k, c as received; here c = 0: x' = A_k x + B_k u
no friction  the same motor without its dry friction
Jacobian     affine, at the same state: its friction stands in c, not in A
exact model  the non-smooth motor itself, which no linear model can beat; above 0 only by lost timing
all: over every sample; median: of the predictions, one for each published model
In valid range: {limit} (sign_j, j = {order}). {heard}.
Largest difference between a published A_k, B_k, c and the library's own: {difference:g}."""
LABELS = {
    "start": ("A$_k$ from the start (paper)", plotting.START_COLOUR),
    "midpoint": ("A$_k$ from the predicted midpoint", plotting.MIDPOINT),
}


def draw(path: Path, model: Model, record: DemoRecord, found: Mapping[str, Sequence[Window]]) -> None:
    """Draw the speed with every prediction on it, the error of each, and the damping that A_k holds."""
    column = model.states.index(model.plant.velocity)
    with plotting.canvas(path, 8.6, 6.6) as figure:
        speed, error, damping = figure.subplots(3, 1, sharex=True, height_ratios=(3, 2, 1.6))
        speed.plot(record.t, record.x[:, column], color=plotting.EXACT_COLOUR, lw=2.4, label="plant (received)")
        bare = [(window.time, window.part, window.speeds["no friction"]) for window in found["start"]]
        _segments(speed, record, bare, plotting.BARE, "friction-free model")
        _dots(error, found["start"], "no friction", plotting.BARE)
        for point, (label, colour) in LABELS.items():
            each = [(window.time, window.part, window.speeds["published"]) for window in found[point]]
            _segments(speed, record, each, colour, f"{label}: next {model.update_period:g} s")
            _dots(error, found[point], "published", colour)
            at = [window.time for window in found[point]]
            values = [-window.update.result.A[column, column] for window in found[point]]
            damping.semilogy(at, values, ".-", color=colour, lw=0.8, ms=5)
        for axes in (speed, error, damping):
            limit = model.sign_order * model.sign_scale / 3
            plotting.shade(axes, record.t, np.abs(record.x[:, column]) > limit, "outside the valid range of sign$_j$")
        speed.set(ylabel="speed  [rad/s]", title="Live over ROS 2: what each published model predicts")
        error.set(ylabel="RMS error of each\nprediction  [rad/s]", yscale="log")
        damping.set(ylabel="-A$_k$[speed, speed]\n[1/s]", xlabel="time  [s]", xlim=(0, record.t[-1]))
        figure.align_ylabels()
        plotting.legend_above(figure, speed, 3)


def _segments(
    axes: Any, record: DemoRecord, each: Sequence[tuple[float, slice, Array]], colour: str, label: str
) -> None:
    for number, (_, part, values) in enumerate(each):
        axes.plot(record.t[part], values, color=colour, lw=1.3, label=label if number == 0 else None)


def _dots(axes: Any, each: Sequence[Window], name: str, colour: str) -> None:
    axes.plot([w.time for w in each], [rms([w], name) for w in each], ".-", color=colour, lw=0.8, ms=5)


__all__ = ["LABELS", "NOTES", "SHOWN_COLUMNS", "draw", "table"]
