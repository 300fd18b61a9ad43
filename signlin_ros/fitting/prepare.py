"""Records made ready: what is fitted to, what is held out, informative stretches of what is long, and wrong signs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from signlin_ros.errors import RecordError
from signlin_ros.fitting.candidate import Candidate
from signlin_ros.fitting.derived import MAX_UNTOLD_LAG, lag, without_derived
from signlin_ros.fitting.fit import Fit
from signlin_ros.fitting.following import follow_records
from signlin_ros.fitting.problem import Problem, looks, prepare, stretch_of
from signlin_ros.fitting.settled import reads_before, with_settled
from signlin_ros.follow.data import measured_channels
from signlin_ros.follow.segments import (
    LEAST_SAMPLES,
    MIN_SHARED_SAMPLES,
    PreparedSegment,
    check_moving,
    constant_inputs,
    moves,
    pieces,
    prepared_segment,
    spread,
    told_spread,
    with_measured_position,
)
from signlin_ros.follow.tracking import mean
from signlin_ros.model import Model
from signlin_ros.noise import sensor_noise
from signlin_ros.records import ModelData

MAX_FIT_SAMPLES, FIT_SEGMENTS = 20_000, 10
"""Most samples that are fitted to, in so many stretches: more only make standard errors too small."""
MOST_FOLDS = 6
"""Most parts of the records that are held out in turn."""
CONDITIONS = 3
"""Least number of conditions that are held out in turn."""
MAX_REVERSED_RATIO = 0.5
"""Share of what is left without (RMS, geometric mean) that a reversed signal leaves, if its sign is in doubt."""


def held_out(data: Sequence[ModelData]) -> tuple[list[ModelData], list[ModelData]]:
    """Return the first two thirds of every record, and the last third; raise `RecordError` where that is too little."""
    first = [d.part(0, len(d) * 2 // 3) for d in data]
    last = [d.part(len(d) * 2 // 3) for d in data]
    if not any(whole.measured for whole in data):
        return first, last  # `prepared` tells what is not measured
    for whole, part in zip(data, last, strict=True):
        if len(part) < LEAST_SAMPLES:
            needed = f"at least {3 * LEAST_SAMPLES} are needed, or {LEAST_SAMPLES} and a validation record"
            raise RecordError(f"{whole.source}: {len(whole)} samples, of which the last third is held out; {needed}")
    if not any(moves(part, tuple(part.measured)) for part in last):
        why = "nothing moves in the last third, which is held out; give a validation record"
        raise RecordError(f"{data[0].source}: {why}")
    return first, last


def prepared(model: Model, first: Sequence[ModelData], second: Sequence[ModelData]) -> tuple[Problem, Problem]:
    """Return the problems of training data and of unseen ones; raises `RecordError` where they tell too little."""
    model, acting, settled = with_settled(with_measured_position(model, [*first, *second]), [*first, *second])
    first, second = ([acting(one) for one in side] for side in (first, second))
    data = [*first, *second]
    channels = measured_channels(model, data)
    if reads_before(model, data):
        channels = tuple(c for c in channels if c not in model.plant.algebraic(model.parameters)) or channels
    check_moving(data, channels)
    (known, notes), (unseen, more) = _cut(first, channels), _cut(second, channels)
    own = without_derived(model, [*known, *unseen], channels)
    if model.plant.closed_loop and model.plant.position in channels:
        own = (model.plant.position,)
        left = [c for c in channels if c not in own]
        notes += tuple(
            f"{c} is what the servo computed of its position: a run starts from it, nothing else" for c in left
        )
    else:
        notes += tuple(_derived(model, data, c) for c in channels if c not in own)
    notes += (*settled, *constant_inputs(model, data))
    problem = replace(prepare(model, known, own), notes=notes, parts=tuple(known))
    segments = tuple(prepared_segment(problem.base, problem.channels, part) for part in unseen)
    noise, other = (sensor_noise([(s.t, s.y) for s in one]) for one in (problem.segments, segments))
    rest = replace(problem, segments=segments, noise=other, notes=more, parts=tuple(unseen))
    return _thinned(replace(problem, noise=noise)), _thinned(rest)


def held_in_turn(model: Model, data: Sequence[ModelData]) -> tuple[Problem, Problem]:
    """Return the problem of all records, and the same with ``folds``: which of them are held out together, in turn.

    Those of each condition are, where at least `CONDITIONS` are known: what is left tells how they differ. Else each
    record is. A loop settles: the last third of a record says less than another record.
    """
    if len(data) < 2:
        needed = "a servo is judged by whole records that no fit saw: give two at least, or one and a validation record"
        raise RecordError(f"{data[0].source}: one record only; {needed}")
    problem, _ = prepared(model, data, data)
    known = [tuple(sorted(s.conditions.items())) for s in problem.segments]
    groups = known if len(set(known)) >= CONDITIONS else [s.source for s in problem.segments]
    kinds = list(dict.fromkeys(groups))
    folds = [tuple(i for i, own in enumerate(groups) if own in kinds[k::MOST_FOLDS]) for k in range(MOST_FOLDS)]
    return problem, replace(problem, folds=tuple(fold for fold in folds if fold), notes=())


def _thinned(problem: Problem) -> Problem:
    """Return a problem on stretches of long records, spread evenly."""
    sizes = [s.t.size for s in problem.segments]
    used = spread(sizes, problem.base.plant.closed_loop)
    told = told_spread([s.source for s in problem.segments], sizes, used)
    if not told:
        return problem
    segments = tuple(stretch_of(problem, problem.segments[i], first, n) for i, first, n in used)
    parts = tuple(problem.parts[i].part(first, first + n) for i, first, n in used)
    return replace(problem, segments=segments, parts=parts, notes=(*problem.notes, told))


def _derived(model: Model, data: Sequence[ModelData], channel: str) -> str:
    """Return the note on a channel that was computed from the position, and how late it is."""
    late, step = lag(model, data), float(np.median(np.diff(data[0].t)))
    more = f", and lags {late:.2g} s behind it" if late > MAX_UNTOLD_LAG * step else ""
    return f"{channel} was computed from {model.plant.position}{more}: it tells nothing more"


def _cut(data: Sequence[ModelData], channels: tuple[str, ...]) -> tuple[list[ModelData], tuple[str, ...]]:
    """Return the pieces of records without gaps, and the notes on what is left out of them: records of less than
    `MIN_SHARED_SAMPLES` too, if the others have `LEAST_SAMPLES` together.
    """
    kept = [d for d in data if len(d) >= MIN_SHARED_SAMPLES]
    count = sum(map(len, kept))
    if count < LEAST_SAMPLES:
        told = (
            f"{len(data[0])} samples" if len(data) == 1 else f"{count} samples in runs of at least {MIN_SHARED_SAMPLES}"
        )
        way = "sample faster, or give several records, which are fitted together"
        raise RecordError(f"{data[0].source}: {told}; at least {LEAST_SAMPLES} are needed: {way}")
    lost = [f"{d.source}: {len(d)} samples are left out" for d in data if len(d) < MIN_SHARED_SAMPLES]
    found = [pieces(d, channels) for d in kept]
    return [part for parts, _ in found for part in parts], (*lost, *(note for _, notes in found for note in notes))


def stretched(problem: Problem) -> Problem:
    """Return a problem on stretches of long records: half spread evenly, half where the model is most wrong."""
    if problem.samples <= MAX_FIT_SAMPLES or problem.base.plant.closed_loop:
        return problem
    size = MAX_FIT_SAMPLES // FIT_SEGMENTS
    places = [(s, first) for s in problem.segments for first in range(0, max(s.t.size - size, 0) + 1, size)]
    parts = [stretch_of(problem, s, first, size) for s, first in places]
    runs = [run.innovation for _, run in looks(problem.base, parts, problem.channels, problem.observer_gains[1])]
    wrong = np.argsort([-np.mean(mean(left**2) / problem.noise**2) for left in runs]).tolist()
    even = np.linspace(0, len(parts) - 1, FIT_SEGMENTS // 2).astype(int).tolist()
    chosen = list(dict.fromkeys([*even, *wrong]))[:FIT_SEGMENTS]
    return replace(problem, segments=tuple(parts[i] for i in sorted(chosen)))


def reversed_signal(problem: Problem, base: Fit, final: Fit) -> str:
    """Return the input or channel, an input first, with whose sign reversed the model as given, not fitted, leaves at
    most half as much, and less than what was found for it: a plug the wrong way round is no effect, which only imitates
    it.
    """
    given, as_given = base.candidate, base.candidate.start()
    tried = ((_left(problem, given, as_given, segments), name) for name, segments in _with_one_reversed(problem))
    least, name = min(tried, default=(np.inf, ""))
    if not least < MAX_REVERSED_RATIO * _left(problem, given, as_given, problem.segments):
        return ""
    return name if least < _left(problem, final.candidate, final.theta, problem.segments) else ""


def _with_one_reversed(problem: Problem) -> Iterator[tuple[str, list[PreparedSegment]]]:
    inputs, channels = problem.base.inputs, problem.channels
    for name, sign in zip(inputs, 1.0 - 2.0 * np.eye(len(inputs)), strict=True):
        yield name, [replace(s, u=s.u * sign) for s in problem.segments]
    for name, sign in zip(channels, 1.0 - 2.0 * np.eye(len(channels)), strict=True) if len(channels) > 1 else ():
        starts = [s.start | {n: -v for n, v in s.start.items() if n == name} for s in problem.segments]
        yield name, [replace(s, y=s.y * sign, start=x) for s, x in zip(problem.segments, starts, strict=True)]


def _left(problem: Problem, c: Candidate, theta: NDArray[np.float64], segments: Sequence[PreparedSegment]) -> float:
    """Return the RMS of what a model leaves of records at the middle gain, in multiples of the noise."""
    found = follow_records(problem, c, theta, problem.observer_gains[1], False, segments)
    if found is None:
        return np.inf
    mean = np.nanmean(np.concatenate(found[0]) ** 2, axis=0) / problem.noise**2
    return float(np.exp(0.5 * np.mean(np.log(mean + 1e-300))))


__all__ = ["held_in_turn", "held_out", "prepared", "reversed_signal", "stretched"]
