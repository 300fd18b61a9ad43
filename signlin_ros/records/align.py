"""Signals with stamps of their own, put on one time base: measurements interpolated where stamps differ, inputs held.

An input acts from the stamp of its own message on, whatever the clock of the states says: `acting` finds one row of
inputs for every sample of the base, and from when each acts. A command that comes at most once from state to state is
kept exactly; where several fall between two states, their mean over time is.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from signlin_ros.errors import RecordError
from signlin_ros.records.clean import spacing
from signlin_ros.records.notes import Note
from signlin_ros.records.table import Series, Signal, at

Array = npt.NDArray[np.float64]

MAX_INTERPOLATED_STEPS = 3.0
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


@dataclass(frozen=True, eq=False)
class Aligned:
    """Signals (T,) at one set of stamps t (T,) s; ``acts`` (T,) s: from when the held ones act, None: from their sample
    on; ``notes``: what was held and what was interpolated, and how even the stamps are.
    """

    t: Array
    signals: dict[str, Signal]
    acts: Array | None
    notes: tuple[Note, ...]


def align(series: Mapping[str, Series], held: Collection[str], base: str | None = None) -> Aligned:
    """All series at one set of stamps.

    Parameters
    ----------
    series : name -> series.
    held : the names of inputs, held between samples; NaN before their first.
    base : whose stamps to use; None: those of the fastest signal that is not held.
    """
    chosen = base or _fastest(series, held)
    t = series[chosen].t
    if t.size < 2:
        raise RecordError(f"only {t.size} message for {series[chosen].label!r}; at least 2 are needed")
    apart = {name: one for name, one in series.items() if not np.array_equal(one.t, t)}
    commands = {name: one for name, one in apart.items() if name in held and one.t.size}
    acts, rows = acting(commands, t) if commands else (None, {})
    signals = {}
    for name, one in series.items():
        values = rows[name] if name in rows else one.values if name not in apart else interpolate(one, t)
        signals[name] = Signal(values, one.unit, one.label)
    moved = [name for name in apart if name not in commands]
    notes = (*_moved(list(commands), moved, chosen), *spacing(t, lambda i: at(t[i])))
    return Aligned(t, signals, acts, notes)


SAME_STAMP_SHARE = 5e-4
"""Stamps that differ by less than this share of a step are taken for the same."""


def acting(commands: Mapping[str, Series], t: Array) -> tuple[Array | None, dict[str, Array]]:
    """For every sample t (T,) one row of the held inputs, and from when it acts.

    A sample gets the switch that belongs to it, if there is just one. Row k acts from ``acts[k]`` to ``acts[k + 1]``
    and is what the command was then, or its mean over that time.

    Returns
    -------
    (acts, rows)
        (T,) s, None where all act from their samples on; name -> (T,), NaN before the first message.
    """
    steps = np.diff(t)
    switches = np.unique(np.concatenate([one.t for one in commands.values()]))
    near = _nearest(switches, t, steps)
    within = (near >= 0) & (near < t.size)
    count = np.bincount(near[within], minlength=t.size)
    acts = t.copy()
    alone = within & (count[near.clip(0, t.size - 1)] == 1)
    acts[near[alone]] = switches[alone]
    same = np.abs(acts - t) <= SAME_STAMP_SHARE * float(np.median(steps))
    if not same[0]:
        acts[0] = min(acts[0], t[0])  # nothing else can hold what is in force until the first row acts
    ends = np.append(acts[1:], max(t[-1], acts[-1]))
    inside = np.searchsorted(switches, ends, side="left") - np.searchsorted(switches, acts, side="right")
    rows = {}
    for name, one in commands.items():
        values = hold(one, acts)
        if one.t[0] > t[0] + SAME_STAMP_SHARE * float(np.median(steps)):
            values[0] = np.nan
        several = (inside > 0) & np.isfinite(values)
        rows[name] = np.where(several, _mean(one, acts, ends), values) if several.any() else values
    acts[same] = t[same]
    return (None if same.all() else acts), rows


def _nearest(switches: Array, t: Array, steps: Array) -> npt.NDArray[np.intp]:
    """The sample that every switch belongs to: within half a step of it, but for their usual distance."""
    beyond = np.minimum(switches - t[0], 0.0) / steps[0] + np.maximum(switches - t[-1], 0.0) / steps[-1]
    place = np.interp(switches, t, np.arange(t.size)) + beyond
    usual = float(np.angle(np.mean(np.exp(2j * np.pi * (place % 1.0))))) / (2 * np.pi) % 1.0
    usual -= usual > 0.499
    return np.asarray(np.floor(place - usual + 0.5), dtype=np.intp)


def _mean(one: Series, begins: Array, ends: Array) -> Array:
    """The means (T,) of a held series over times from `begins` to `ends` (T,)."""
    total = np.concatenate([[0.0], np.cumsum(one.values[:-1] * np.diff(one.t))])

    def integral(at: Array) -> Array:
        index = np.maximum(np.searchsorted(one.t, at, side="right") - 1, 0)
        return np.asarray(total[index] + one.values[index] * (at - one.t[index]))

    lengths = np.where(ends > begins, ends - begins, 1.0)
    return (integral(ends) - integral(begins)) / lengths


def hold(series: Series, t: Array) -> Array:
    """Zero-order hold of a series at the times t (T,); NaN before its first sample."""
    index = np.searchsorted(series.t, t, side="right") - 1
    return np.where(index < 0, np.nan, series.values[np.maximum(index, 0)])


def interpolate(series: Series, t: Array) -> Array:
    """Linear interpolation at the times t (T,); NaN outside the series, and inside a hole of more than
    `MAX_INTERPOLATED_STEPS` steps.
    """
    there = np.isfinite(series.values)
    knots, values = series.t[there], series.values[there]
    if not knots.size:
        return np.full(t.shape, np.nan)
    result = np.interp(t, knots, values, left=np.nan, right=np.nan)
    after = np.searchsorted(knots, t, side="left").clip(1, max(knots.size - 1, 1))
    if knots.size > 1:
        wide = knots[after] - knots[after - 1] > MAX_INTERPOLATED_STEPS * series.step
        inside = (t > knots[after - 1]) & (t < knots[after])
        result[wide & inside] = np.nan
    return result


def _fastest(series: Mapping[str, Series], held: Collection[str]) -> str:
    """The name with the smallest median step; a signal that is held counts only where there is no other."""
    free = [name for name in series if name not in held and series[name].t.size > 1]
    return min(free or series, key=lambda name: series[name].step)


def _moved(commands: list[str], moved: list[str], base: str) -> list[Note]:
    notes = []
    if commands:
        how = f"held from message to message, each from its own stamp on, beside the stamps of {base!r}"
        said = f"{how}: {', '.join(commands)}"
        notes.append(Note(said, "held", commands[0] if len(commands) == 1 else ""))
    if moved:
        said = f"interpolated linearly, at the stamps of {base!r}: {', '.join(moved)}"
        notes.append(Note(said, "interpolated", moved[0] if len(moved) == 1 else ""))
    return notes
