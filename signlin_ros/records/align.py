"""Signals with stamps of their own, put on one time base: inputs held, measurements interpolated where stamps
differ.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping

import numpy as np
import numpy.typing as npt

from signlin_ros.errors import RecordError

from .clean import spacing
from .table import Series, Signal

Array = npt.NDArray[np.float64]

HOLE = 3.0
"""No interpolation across a hole of more than this many median steps: the samples in it are missing (NaN)."""
_COMMAND = re.compile(r"/(?:\w*_)?(?:input|cmd|command)s?(?:_\w*)?\.")


def looks_held(series: Series) -> bool:
    """Whether a bag's topic is a command by its name (``/input``, ``/cmd``, ``/motor/voltage_cmd``), so that
    it is held.
    """
    return _COMMAND.search(series.label) is not None


def named(series: Mapping[str, Series], base: str) -> str:
    """The name of the series meant by `base`: a signal's name or path, or a topic, whose first signal it then
    is.
    """
    for name, one in series.items():
        if base in (name, one.label, *one.names) or one.label.startswith(f"{base}."):
            return name
    raise RecordError(f"no signal or topic {base!r} to take the time from; it has {', '.join(series)}")


def align(
    series: Mapping[str, Series], held: Collection[str], base: str | None = None
) -> tuple[Array, dict[str, Signal], list[str]]:
    """All series at one set of stamps.

    Parameters
    ----------
    series : name -> series.
    held : the names of inputs, held between samples; NaN before their first.
    base : whose stamps to use; None: those of the fastest signal that is not held.

    Returns
    -------
    t : (T,) s
    signals : name -> Signal (T,)
    notes : what was held and what was interpolated, and how even the stamps are.
    """
    chosen = base or _fastest(series, held)
    t = series[chosen].t
    if t.size < 2:
        raise RecordError(f"only {t.size} message for {series[chosen].label!r}; at least 2 are needed")
    signals, moved = {}, {True: [], False: []}  # type: dict[str, Signal], dict[bool, list[str]]
    for name, one in series.items():
        if np.array_equal(one.t, t):
            values = one.values
        else:
            values = hold(one, t) if name in held else interpolate(one, t)
            moved[name in held].append(name)
        signals[name] = Signal(values, one.unit, one.label)
    return t, signals, [*_moved(moved, chosen), *spacing(t, lambda i: f"t = {t[i]:.6g} s")]


def hold(series: Series, t: Array) -> Array:
    """Zero-order hold of a series at the times t (T,); NaN before its first sample."""
    index = np.searchsorted(series.t, t, side="right") - 1
    return np.where(index < 0, np.nan, series.values[np.maximum(index, 0)])


def interpolate(series: Series, t: Array) -> Array:
    """Linear interpolation at the times t (T,); NaN outside the series, and inside a hole of more than `HOLE`
    steps.
    """
    there = np.isfinite(series.values)
    knots, values = series.t[there], series.values[there]
    if not knots.size:
        return np.full(t.shape, np.nan)
    result = np.interp(t, knots, values, left=np.nan, right=np.nan)
    after = np.searchsorted(knots, t, side="left").clip(1, max(knots.size - 1, 1))
    if knots.size > 1:
        wide = knots[after] - knots[after - 1] > HOLE * series.step
        inside = (t > knots[after - 1]) & (t < knots[after])
        result[wide & inside] = np.nan
    return result


def _fastest(series: Mapping[str, Series], held: Collection[str]) -> str:
    """The name with the smallest median step; a signal that is held counts only where there is no other."""
    free = [name for name in series if name not in held and series[name].t.size > 1]
    return min(free or series, key=lambda name: series[name].step)


def _moved(moved: Mapping[bool, list[str]], base: str) -> list[str]:
    notes = []
    if moved[True]:
        notes.append(f"held between samples, at the stamps of {base!r}: {', '.join(moved[True])}")
    if moved[False]:
        notes.append(f"interpolated linearly, at the stamps of {base!r}: {', '.join(moved[False])}")
    return notes
