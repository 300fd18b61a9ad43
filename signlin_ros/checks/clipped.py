"""Channels at the end of their range."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from signlin_ros.checks.base import Check, changed
from signlin_ros.checks.finding import Finding
from signlin_ros.checks.look import MIN_SAMPLES, Look
from signlin_ros.masks import ends_of_runs, of_runs

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Index = NDArray[np.intp]

RUN = 3
"""So many samples in a row at the limit are a run."""
MIN_SHARE_AT_LIMIT, MIN_SAMPLES_AT_LIMIT = 0.005, 5
"""Least share and number of samples in such runs."""
LIMIT_OVER_LARGEST = 0.5
"""The limit of an input is this share of its largest value, or more: nothing else is one."""
MAX_LEVEL_SHARE = 0.2
"""Distinct values, as a share of the samples, beneath which a signal has levels rather than limits."""
ABRUPT = 0.3
"""Steps into and out of the runs, as a share of what they are a few samples before."""
MIN_SENSOR_STEPS, STEP_TOLERANCE = 3, 0.1
"""So many steps between values at which a signal rests tell its sensor's, if all are multiples, to this part of one:
4 % are by chance."""
PACE = 0.1
"""Pace at which a limit is reached, as a share of the usual one (RMS): a drive that comes to rest has none."""

RUN_FRACTION, FADES = 8, 2.0
"""What turns smoothly is a quarter faster an eighth of the run before it is at the limit; so many times as fast, it
comes to rest there."""


class Clipped(Check):
    """A channel rests at its largest or smallest value, exactly, where it would have gone on.

    Test: runs of `RUN` equal values at an extreme of a signal that takes many values, entered at the pace that it has
    elsewhere, and so long that a smooth turn meanwhile goes on for more than a step of the sensor. With noise or digits
    beyond one step the chance of one such run is below 10^-6 a record; a drive that comes to rest at an extreme slows
    down before: where that would end its way long before a smooth turn has lasted as long as the run, it rests there.
    A limit that is known by then, of another record with the same columns or with the other sign, is one for every run
    at it, however it is entered.
    Cure: of a measured channel, samples at the limit are taken for missing (``blank_NAME``); an input acted as it was
    logged, and is only noted.
    """

    name = "clipped"

    def find(self, look: Look) -> Iterator[Finding]:
        """Yield a finding for each clipped channel."""
        yield from self._found(look, _known([look]))

    def find_each(self, looks: Sequence[Look]) -> list[list[Finding]]:
        """Return the findings in each record; the limits of a channel are those of all with the same columns."""
        known = _known(looks)
        return [list(self._found(look, known)) for look in looks]

    def _found(self, look: Look, known: Mapping[str, frozenset[float]]) -> Iterator[Finding]:
        for name in (*look.channels, *look.record.inputs):
            at = _at_limits(look, name, known[name]) if known[name] else None
            if at is None:
                continue
            values = look.of(name)
            percent, sides = 100.0 * float(at.mean()), np.unique(values[at])
            limits = " and ".join(f"{value:.4g}" for value in sides)
            where = f"at {limits} {look.unit(name)} for {percent:.2g} % of the time"
            if name not in look.channels:
                yield self.note(name, f"the {name} is at its limit, {where}")
                continue
            lies = "and the true values lie beyond"
            if name == look.position:
                if _stands(look, at) or _stands_elsewhere(values, at, look.quantum(name)):
                    continue
                lies = "a stop, or the end of its sensor's range: then the true values lie beyond"
            yield Finding(
                self.name,
                name,
                "offer",
                f"the {name} is clipped: it rests {where}, {lies}",
                cure=f"blank_{name}",
                remedy="samples at the limit are taken for missing",
                action=changed(name, lambda values, at=at: np.where(at, np.nan, values)),  # type: ignore[misc]
            )


def _known(looks: Sequence[Look]) -> dict[str, frozenset[float]]:
    """Return the limits of every channel and input that some records show, of both signs."""
    found: dict[str, frozenset[float]] = {}
    for name in {name for look in looks for name in (*look.channels, *look.record.inputs)}:
        sides = [
            (look.of(name), _at_limits(look, name))
            for look in looks
            if name in look.record.inputs or name in look.channels
        ]
        limits = np.concatenate([values[at] for values, at in sides if at is not None] or [np.zeros(0)])
        found[name] = frozenset((np.unique([limits, -limits])).tolist())
    return found


def _at_limits(look: Look, name: str, known: frozenset[float] = frozenset()) -> Mask | None:
    """Return where (T,) a channel or an input of a record is at its limits, or at some that are known."""
    measured = name in look.channels
    quantum, least = (look.quantum(name), 0.0) if measured else (0.0, LIMIT_OVER_LARGEST)
    return _clipped(look.of(name), quantum, least, known)


def _clipped(values: Array, quantum: float, least: float, known: frozenset[float] = frozenset()) -> Mask | None:
    """Return where (T,) values are clipped; None where they are not, or so rarely that it does not matter.

    ``least``: a limit is this share of the largest value, or more; ``known``: such as are limits anyway.
    """
    good = np.isfinite(values)
    if good.sum() < 5 * MIN_SAMPLES:
        return None
    filled = values if good.all() else np.interp(np.arange(values.size), np.flatnonzero(good), values[good])
    levels = np.unique(filled).size
    if quantum == 0.0 and levels < MAX_LEVEL_SHARE * _changing(filled):
        return None
    limits = [limit for limit in (filled.max(), filled.min()) if abs(limit) >= least * np.abs(filled).max()]
    steps = [max(quantum, _step(filled, limit)) for limit in limits]
    sides = [
        _long(filled == limit) if limit in known else _runs(filled, filled == limit, quantum, step)
        for limit, step in zip(limits, steps, strict=True)
    ]
    sides = [side for side in sides if side.any()]
    found = np.any(sides, axis=0) if sides else np.zeros(0, dtype=bool)
    return found if found.sum() >= max(MIN_SAMPLES_AT_LIMIT, MIN_SHARE_AT_LIMIT * values.size) else None


def _stands(look: Look, at: Mask) -> bool:
    """Tell whether a machine stands still where its position is at an extreme (T,), by the velocity that it has."""
    if look.velocity not in look.channels:
        return False
    v = look.of(look.velocity)
    return bool(np.nanmedian(np.abs(v[at] - np.nanmedian(v[at]))) < PACE * np.nanstd(v[~at]))


def _stands_elsewhere(values: Array, at: Mask, quantum: float) -> bool:
    """Tell whether values (T,) stand still as abruptly at other places, and more often, and only once at each limit
    (T,): dry friction holds a machine wherever it comes to rest, while a stop is met again and again.
    """
    still = np.concatenate([[False], np.diff(values) == 0.0])
    still[:-1] |= still[1:]
    begins, ends = ends_of_runs(_long(still & ~at))
    visits = ends_of_runs(at)[0].size
    if visits > np.unique(values[at]).size or begins.size <= visits:
        return False
    steps = [_step(values, float(limit)) for limit in np.unique(values[at])]
    return _is_abrupt(values, begins, ends, max(quantum, *steps))


def _changing(values: Array) -> int:
    """Return in how many samples values (T,) differ from the one before."""
    return int(np.count_nonzero(np.diff(values))) + 1


def _step(values: Array, limit: float) -> float:
    """Return the step of a sensor: the least change in its values (T,), or that between those at which they rest, the
    other extreme aside, if all are multiples of it: values that were smoothed or resampled in between.
    """
    changes = np.abs(np.diff(values))
    resting = np.unique(values[1:][changes == 0.0])
    other = values.min() if limit == values.max() else values.max()
    steps, least = np.diff(resting[resting != other]), float(changes[changes > 0.0].min(initial=np.inf))
    if steps.size < MIN_SENSOR_STEPS:
        return least
    step = float(np.median(steps[steps < 1.5 * steps.min()]))
    return max(step, least) if np.abs(steps / step - np.round(steps / step)).max() < STEP_TOLERANCE else least


def _hidden(values: Array, begins: Index, ends: Index) -> Array:
    """Return how far (k,) a parabola goes beyond values (T,) that stand still in runs (k,) of samples, by how far away
    the values are as many samples before and after: D = a (3 n / 2)^2 - a (n / 2)^2, and a (n / 2)^2 is hidden.
    """
    run = ends - begins
    before, after = np.maximum(begins - run, 0), np.minimum(ends - 1 + run, values.size - 1)
    aside = 0.5 * (np.abs(values[begins] - values[before]) + np.abs(values[begins] - values[after]))
    return np.asarray(aside / 8.0)


def _long(at: Mask) -> Mask:
    """Return the samples (T,) in runs of `RUN` and more."""
    begins, ends = ends_of_runs(at)
    long = ends - begins >= RUN
    return of_runs(at.size, begins[long], ends[long])


def _runs(values: Array, at: Mask, quantum: float, step: float) -> Mask:
    """Return which of the samples at a limit (T,) stand in runs that are entered at full pace, and in which a smooth
    turn would have gone on for more than a step of the sensor.
    """
    begins, ends = ends_of_runs(at)
    long = ends - begins >= RUN
    kept = np.zeros(values.size, dtype=bool)
    if not long.any():
        return kept
    begins, ends = begins[long], ends[long]
    inside = _inside(values, begins, ends)
    if not _is_abrupt(values, begins, ends, quantum) or _hidden(values, begins[inside], ends[inside]).max() <= step:
        return kept
    cut = ~_rests(values, begins, ends, step)
    if not cut[inside].any():
        return kept
    return of_runs(values.size, begins[cut], ends[cut])


def _inside(values: Array, begins: Index, ends: Index) -> Mask:
    """Return which runs (k,) of values (T,) have some before them and after them."""
    return (begins > 2) & (ends < values.size - 3)


def _is_abrupt(values: Array, begins: Index, ends: Index, quantum: float) -> bool:
    """Tell whether values (T,) enter and leave runs (k,) at the pace that they have elsewhere, half of them."""
    inside = _inside(values, begins, ends)
    if not inside.any():
        return False
    b, e = begins[inside], ends[inside]
    paces = np.concatenate([np.abs(values[b - 1] - values[b - 3]), np.abs(values[e] - values[e + 2])]) / 2
    last = np.concatenate([np.abs(values[b] - values[b - 1]), np.abs(values[e - 1] - values[e])])
    usual, pace, change = float(np.sqrt(np.mean((values[2:] - values[:-2]) ** 2))), np.median(paces), np.median(last)
    if pace <= max(3.0 * quantum, PACE * usual) or change < ABRUPT * 0.5 * pace:
        return False
    return bool(change <= 20.0 * max(pace, 1e-300))


def _rests(values: Array, begins: Index, ends: Index, step: float) -> Mask:
    """Return which runs (k,) of samples at a limit values (T,) reach ever more slowly, and then last, if for a step of
    the sensor beside it.

    A parabola beyond the limit has the pace v there and lasts 2 v / a: n / `RUN_FRACTION` samples before it goes at v
    + a n / `RUN_FRACTION`.
    """
    near = np.abs(values - values[begins[0]]) <= step * (1.0 + STEP_TOLERANCE)
    first, past = ends_of_runs(near)
    of = np.searchsorted(first, begins, side="right") - 1
    begins, ends = first[of], past[of]
    earlier = (ends - begins) // RUN_FRACTION
    told = (earlier >= RUN) & (begins - RUN - earlier >= 0)
    at = np.where(told, begins, RUN)
    before = np.where(told, begins - earlier, RUN)
    last, pace = np.abs(values[at - 1] - values[at - RUN]), np.abs(values[before - 1] - values[before - RUN])
    return np.asarray(told & (pace > FADES * last))
