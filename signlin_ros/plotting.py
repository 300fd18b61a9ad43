"""The look of every picture: one style, colours that colour-blind readers tell apart, no display needed.

Colours: Okabe and Ito, Color Universal Design (2008). matplotlib is imported when the first picture is made.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from signlin_ros.errors import InputError, MissingExtraError

EXACT_COLOUR, START_COLOUR, MIDPOINT, BARE, JACOBIAN = "#000000", "#D55E00", "#0072B2", "#009E73", "#CC79A7"
"""The plant itself; the models built at the start and at the midpoint; without dry friction; the affine Jacobian."""
SEQUENCE = ("#56B4E9", "#E69F00", "#009E73", "#0072B2")
"""For curves that only count, e.g. several orders j."""
SHADE = "#E69F00"
_STYLE: Any = {
    "font.size": 9.0,
    "font.family": "DejaVu Sans",
    "axes.titlesize": 9.5,
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#DDDDDD",
    "grid.linewidth": 0.6,
    "lines.linewidth": 1.4,
    "legend.frameon": False,
    "legend.handlelength": 2.4,
    "savefig.dpi": 120,
}


@contextmanager
def styled(width: float, height: float) -> Iterator[Any]:
    """Yield an empty figure of that size in inches; what is drawn inside the ``with`` is in the house style.

    Raises `MissingExtraError` without matplotlib.
    """
    try:
        import matplotlib as mpl
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError as error:
        raise MissingExtraError("Drawing figures", "plot") from error
    with mpl.rc_context(_STYLE):
        figure = Figure(figsize=(width, height), layout="constrained")
        FigureCanvasAgg(figure)
        yield figure


def save(figure: Any, path: Path) -> None:
    """Write a figure to ``path`` as PNG; raise `InputError` where the file cannot be written."""
    try:
        figure.savefig(path, dpi=_STYLE["savefig.dpi"], metadata={"Software": None})
    except OSError as error:
        raise InputError(f"cannot write {path}: {error.strerror}") from error


@contextmanager
def canvas(path: Path, width: float, height: float) -> Iterator[Any]:
    """Yield an empty figure as `styled` does; `save` it to ``path`` at the end."""
    with styled(width, height) as figure:
        yield figure
        save(figure, path)


def legend_above(figure: Any, axes: Any, columns: int) -> None:
    """Put the legend of one plot above the whole figure, where it covers nothing; what looks alike stands once."""
    handles, labels = axes.get_legend_handles_labels()
    once = dict(zip(labels, handles, strict=True))
    figure.legend(list(once.values()), list(once), loc="outside upper left", ncols=columns)


def shade(axes: Any, t: Any, where: Any, label: str) -> None:
    """Shade the stretches of time t (T,) where ``where`` (T,) is true, over the whole height."""
    axes.fill_between(
        t, 0, 1, where=where, transform=axes.get_xaxis_transform(), color=SHADE, alpha=0.18, lw=0, label=label
    )


def trajectory_figure(trajectory: Any) -> Any:
    """Return a figure of a `signlin_ros.simulation.Trajectory`: inputs and outputs over time, one below the other."""
    names = list(dict.fromkeys((*trajectory.inputs, *trajectory.outputs)))
    with styled(7.0, 1.3 * len(names) + 0.6) as figure:
        rows = figure.subplots(len(names), 1, sharex=True, squeeze=False)[:, 0]
        for axes, name in zip(rows, names, strict=True):
            steps = "steps-post" if name in trajectory.inputs else "default"
            axes.plot(trajectory.t, trajectory[name], color=EXACT_COLOUR, drawstyle=steps)
            axes.set_ylabel(name)
        rows[-1].set_xlabel("t [s]")
    return figure
