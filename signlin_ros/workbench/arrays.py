"""Curves for the page: few enough points to be drawn at once, none of the peaks lost, as base64 of float64."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from signlin_ros.errors import MissingExtraError

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

MAX_CURVE_POINTS = 5000
"""No curve that is sent has more points."""
HOLES = 200
"""So many holes of a curve are kept as holes when it is thinned."""


def encoded(values: Array) -> dict[str, str]:
    """Return float64 values (N,) as little-endian bytes in base64, which the page decodes without parsing."""
    return {"f8": base64.b64encode(np.ascontiguousarray(values, dtype="<f8").tobytes()).decode("ascii")}


def window(t: Array, first: float | None, last: float | None) -> slice:
    """Return the samples of t (T,) from ``first`` to ``last`` s, and one beyond at either side."""
    low = 0 if first is None else max(int(np.searchsorted(t, first)) - 1, 0)
    high = t.size if last is None else min(int(np.searchsorted(t, last, side="right")) + 1, t.size)
    return slice(low, max(high, low + 1))


def thinned(t: Array, curves: Sequence[Array], points: int = MAX_CURVE_POINTS) -> Indices:
    """Return the samples to draw, the same for all curves (T,) of a picture: at most ``points``, peaks and holes kept.

    Largest triangles among the extremes of every bin [Van Der Donckt et al., MinMaxLTTB, IEEE VIS 2023].
    """
    most = min(points, MAX_CURVE_POINTS)
    if t.size <= most:
        return np.arange(t.size)
    holes = np.unique(np.concatenate([_holes(y) for y in curves]))
    each = max((most - holes.size) // max(len(curves), 1), 10)
    return np.unique(np.concatenate([holes, *(_chosen(t, y, each) for y in curves)]))


def _chosen(t: Array, y: Array, count: int) -> Indices:
    try:
        from tsdownsample import MinMaxLTTBDownsampler
    except ImportError as error:
        raise MissingExtraError("The workbench", "web") from error
    good = np.isfinite(y)
    filled = y if good.all() else np.where(good, y, 0.0)
    sampler: Any = MinMaxLTTBDownsampler
    found = sampler().downsample(*map(np.ascontiguousarray, (t, filled)), n_out=count)
    return np.asarray(found, dtype=np.intp)


def _holes(y: Array) -> Indices:
    """Return the first sample of every hole of a curve, so that a line is not drawn across it."""
    lost = ~np.isfinite(y)
    if not lost.any():
        return np.empty(0, dtype=np.intp)
    begins = np.flatnonzero(lost & ~np.concatenate([[False], lost[:-1]]))
    return np.asarray(begins[:HOLES], dtype=np.intp)


def picture(
    t: Array, curves: dict[str, Array], span: Sequence[float | None], points: int = MAX_CURVE_POINTS
) -> dict[str, Any]:
    """Return t and curves (T,) by name between two times as the page takes them, thinned together."""
    part = window(t, *span)
    inside = {name: np.asarray(y[part], dtype=float) for name, y in curves.items()}
    at = thinned(t[part], list(inside.values()), points)
    return {"t": encoded(t[part][at]), "curves": {name: encoded(y[at]) for name, y in inside.items()}}


__all__ = ["MAX_CURVE_POINTS", "encoded", "picture", "thinned", "window"]
