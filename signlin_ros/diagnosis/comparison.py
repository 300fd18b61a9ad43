"""How good a model is on measurements: three scores kept apart, what is left in the residual, and where it fails.

``free_run``: the exact simulation from an estimated start, ``windowed``: windows of the horizon, each from a state
estimated before it, ``inverse``: the effort that the measured motion should have taken.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from signlin_ros.comparison.inverse import Efforts
from signlin_ros.comparison.locate import Region, by_direction, locate
from signlin_ros.comparison.missing import Missing, missing
from signlin_ros.comparison.residuals import ResidualTest, residual_test
from signlin_ros.comparison.scores import follows_nothing, score
from signlin_ros.diagnosis.compared import ChannelScores, Comparison, Traces, lost
from signlin_ros.diagnosis.criteria import DEFAULT_CRITERIA
from signlin_ros.diagnosis.dataset import Dataset, Records, dataset_of
from signlin_ros.diagnosis.evidence import Evidence, evidence_beside, refitted_evidence
from signlin_ros.diagnosis.input_hold import asks_hold, at_noise
from signlin_ros.diagnosis.output_error import FitCache, estimator_of
from signlin_ros.diagnosis.progress import Progress
from signlin_ros.diagnosis.results import FirstRows
from signlin_ros.diagnosis.rows import first_rows
from signlin_ros.errors import InputError
from signlin_ros.follow.data import Segment, as_list, measured_channels, stretches, unit_asked
from signlin_ros.follow.freerun import FreeRun, free_run
from signlin_ros.follow.observer import OBSERVER_TRUSTS, Observer
from signlin_ros.follow.outliers import without_outliers
from signlin_ros.follow.segments import pieces, spread, told_spread
from signlin_ros.follow.tracking import mean_square
from signlin_ros.model import Model
from signlin_ros.noise import Noise, noise_level, sensor_noise
from signlin_ros.predict import windows
from signlin_ros.records import ModelData
from signlin_ros.threads import one_thread

Array = NDArray[np.float64]

TRUSTING = 0.003
"""How much the observer behind the residual tests lets the model be wrong: structure must not be followed away."""
FOR_NOISE = (0.001, 0.003, 0.01, 0.03)
"""Observers whose residuals are asked for the colour of the noise."""
NO_SITUATION = "no situation that was looked at holds significantly more of the error than of the time"


def compare_efforts(model: Model, data: Records, cutoff: float | None = None) -> Efforts | None:
    """Return the efforts of records, cut at gaps and without outliers; None where they are not known."""
    records = as_list(data)
    channels = measured_channels(model, records)
    return Efforts.of(
        model, [part for r in records for part in pieces(r, channels)[0]], DEFAULT_CRITERIA.max_inertial_noise, cutoff
    )


@one_thread
def compare(
    model: Model,
    data: Records,
    horizon: float | None = None,
    cutoff: float | None = None,
    validation: Records | None = None,
    *,
    progress: Progress | Callable[[str], None] | None = None,
) -> Comparison:
    """Hold a model against one record or several, ``data``.

    The first rows are those of `diagnose` with the same ``data`` and ``validation``; they are found when they are asked
    for, which takes seconds. ``progress`` watches, a function is told what is done. ``horizon`` of the windowed
    prediction in s, by default the model's update period; ``cutoff`` of the inverse in Hz, by default that of
    `diagnose`. Raises `RecordError` where nothing that the model predicts is measured, `InputError` for a
    horizon or a cut-off that the sampling cannot serve.
    """
    records, watched = as_list(data), _watched(progress)
    seen, long = _spread(model, records)
    steps = np.concatenate([np.diff(record.t) for record in records])
    if model.asks_hold and steps.size:  # before anything is fitted
        _horizon(model, horizon, float(np.median(steps)))
    prepared = _as_diagnosed(model, data, validation)
    both = _how_inputs_act(prepared, watched)
    told = [both.dataset.hold_note] if both and both.dataset.hold_note else []
    model = model.with_options(input_hold=both.dataset.model.input_hold) if both else model
    watched.say("noise of the sensors")
    observer, notes = _observed(model, seen)
    units, horizon = dict(records[0].units), _horizon(model, horizon, observer.step)
    watched.say("free run from the start")
    free = _free(observer, notes)
    watched.say("prediction, window by window")
    window = _windowed(observer, horizon, notes)
    watched.say("what is missing")
    lacking, residuals = missing(observer, units), [run.innovation for run in observer.runs(observer.design(TRUSTING))]
    scored = _scored(observer, units, free, window, prepared.noise if isinstance(prepared, Dataset) else {})
    watched.say("where it fails")
    efforts = compare_efforts(model, seen, cutoff)
    effort, where = efforts.inverse(model, units) if efforts else None, locate(observer, lacking, units)

    def refit() -> FirstRows:
        if isinstance(prepared, InputError):
            raise prepared
        return first_rows(both or refitted_evidence(prepared, watched))

    return Comparison(
        model=model,
        channels=scored,
        inverse={effort.name: effort} if effort else {},
        where=where,
        residual_tests=_residual_tests(observer, residuals),
        horizon=horizon,
        samples=sum(len(record) for record in records),
        sources=tuple(record.source for record in records),
        notes=(*notes, *long, *told, *_remarks(observer, scored, lacking, where)),
        directions={m.name: by_direction(observer, m, units) for m in lacking if m.clear},
        units=units,
        traces=_traces(observer, free, window, residuals),
        missing=lacking,
        refit=refit,
    )


def _spread(model: Model, records: Sequence[ModelData]) -> tuple[list[ModelData], list[str]]:
    """Return long records as stretches, spread evenly, and the note on it."""
    sizes = [len(record) for record in records]
    used = spread(sizes, model.plant.closed_loop)
    told = told_spread([record.source for record in records], sizes, used)
    if not told:
        return list(records), []
    return [records[one.record].part(one.first, one.first + one.size) for one in used], [told]


def _as_diagnosed(model: Model, data: Records, validation: Records | None) -> Dataset | InputError:
    """Return the data set that `diagnose` makes of records, or why it cannot use them."""
    try:
        return dataset_of(model, data, validation)
    except InputError as error:
        return error


def _residual_tests(observer: Observer, residuals: Sequence[Array]) -> dict[str, ResidualTest]:
    """Return tests by channel of the innovations (T, ny) of every stretch."""
    inputs, channels = [s.u for s in observer.stretches], zip(observer.channels, observer.noise, strict=True)
    return {
        name: residual_test([e[:, j] for e in residuals], inputs, noise.rho) for j, (name, noise) in enumerate(channels)
    }


def _traces(
    observer: Observer, free: Sequence[FreeRun], window: Sequence[Array], residuals: Sequence[Array]
) -> tuple[Traces, ...]:
    """Return every stretch as measured and as predicted."""
    rows = zip(observer.stretches, free, window, observer.best_states, residuals, strict=True)
    return tuple(Traces(s.source, s.t, s.u, s.y, run.shown, ahead, x, left) for s, run, ahead, x, left in rows)


def _how_inputs_act(c: Dataset | InputError, progress: Progress) -> Evidence | None:
    """Return the model refitted with its inputs acting as the records show; None where that is said, or where what
    inputs that are held leave is noise.
    """
    if isinstance(c, InputError) or not asks_hold(c):
        return None
    progress.say("how the input acts")
    try:
        motion = estimator_of(c.training, c.validation, DEFAULT_CRITERIA, FitCache(), progress, 1)
        return None if at_noise(motion, motion.base.training_squares) else evidence_beside(c, motion).grounded()
    except InputError:
        return None  # first rows say why


def _watched(progress: Progress | Callable[[str], None] | None) -> Progress:
    """Return a watcher as a `Progress` that is told of stages without shares: `compare` knows of no share."""
    if progress is None or isinstance(progress, Progress):
        return progress or Progress()
    tell = progress
    return Progress(lambda stage, share: tell(stage))


def _horizon(model: Model, given: float | None, step: float) -> float:
    """Return the horizon in s, by default the update period; raise `InputError` where samples are too far apart."""
    horizon = model.update_period if given is None else given
    if 2 * step <= horizon < np.inf:
        return float(horizon)
    if given is not None:
        raise InputError(f"horizon: found {horizon:g} s; allowed: at least two samples, {2 * step:.3g} s")
    apart = f"the samples are {step:.3g} s apart, too far for the model's update_period of {horizon:g} s"
    raise InputError(f"{apart}{unit_asked(step)}; else give a horizon of at least two samples, {2 * step:.3g} s")


def _remarks(
    observer: Observer, channels: Mapping[str, ChannelScores], lacking: Sequence[Missing], where: Sequence[Region]
) -> list[str]:
    """Return notes on how the figures came about."""
    names = lost(channels)
    found = [follows_nothing(names)] if names else []
    if any(m.clear for m in lacking) and not where:
        found.append(NO_SITUATION)
    if not all(noise.even for noise in observer.noise):
        found.append("unevenly sampled: the noise, its colour and the residual tests are approximate")
    return found


def _observed(model: Model, records: Sequence[ModelData]) -> tuple[Observer, list[str]]:
    """Return the observers of the model, their noise from what they leave; and the notes on the records."""
    channels = measured_channels(model, records)
    cleaned, left_out = zip(*(without_outliers(record, channels) for record in records), strict=True)
    parts, notes = stretches(model, cleaned, channels)
    white = [_noise(parts, j, []) for j in range(len(channels))]
    observer = Observer(model, parts, channels, white)
    left = [[run.innovation for run in observer.runs(observer.design(trust))] for trust in FOR_NOISE]
    noise = [_noise(parts, j, left) for j in range(len(channels))]
    given = [f"{record.source}: {note}" for record in records for note in record.notes]
    return Observer(model, parts, channels, noise), [*given, *chain(*left_out), *notes]


def _noise(parts: list[Segment], j: int, residuals: list[list[Array]]) -> Noise:
    """Return the noise of channel j, from the longest stretch that has it."""
    k = int(np.argmax([np.isfinite(s.y[:, j]).sum() for s in parts]))
    return noise_level(parts[k].t, parts[k].y[:, j], [runs[k][:, j] for runs in residuals])


def _free(observer: Observer, notes: list[str]) -> list[FreeRun]:
    """Return the free run of every stretch; a run that fails is noted."""
    pairs = zip(observer.trackers, observer.rough, strict=True)
    runs = [free_run(tracker, x[0], observer.reach, observer.effective) for tracker, x in pairs]
    notes += [f"{s.source}: no free run: {run.why}" for s, run in zip(observer.stretches, runs, strict=True) if run.why]
    return runs


def _windowed(observer: Observer, horizon: float, notes: list[str]) -> list[Array]:
    """Return the channels (T, ny) predicted over windows, each from the observer whose states predict it best."""
    starts = [[first for first, _ in windows(s.t, horizon)] or [0] for s in observer.stretches]
    if not any(len(at) > 1 for at in starts):
        notes.append(f"no windowed prediction: the record is shorter than two windows of {horizon:g} s")
        return [np.full(s.y.shape, np.nan) for s in observer.stretches]
    tried = [_shown_in_windows(observer, observer.states(observer.design(trust)), starts) for trust in OBSERVER_TRUSTS]
    y = np.concatenate([s.y for s in observer.stretches])
    best = np.argmin([mean_square(y - np.concatenate(shown)) for shown in tried], axis=0)
    return [np.choose(best, parts) for parts in zip(*tried, strict=True)]


def _shown_in_windows(observer: Observer, states: list[Array], starts: list[list[int]]) -> list[Array]:
    """Return the channels (T, ny) predicted from states (T, n) at the starts; NaN in the first window."""
    shown = []
    for tracker, x, at in zip(observer.trackers, states, starts, strict=True):
        run = tracker.restarted(x, at)
        predicted = tracker.outputs(np.nan_to_num(run.state))
        predicted[~np.isfinite(run.state).all(axis=1)] = np.nan
        predicted[: at[1] + 1 if len(at) > 1 else len(x)] = np.nan
        shown.append(predicted)
    return shown


def _scored(
    observer: Observer, units: dict[str, str], free: list[FreeRun], window: list[Array], sigmas: Mapping[str, float]
) -> dict[str, ChannelScores]:
    """Return the channels with their scores; ``sigmas``: noise of their sensors, where that is known by now."""
    own = dict(zip(observer.channels, sensor_noise([(s.t, s.y) for s in observer.stretches]).tolist(), strict=True))
    sigmas = {**own, **sigmas}
    y = np.concatenate([s.y for s in observer.stretches])
    runs, windowed = np.concatenate([run.shown for run in free]), np.concatenate(window)
    failed, found = any(run.why for run in free), {}
    for j, (name, noise) in enumerate(zip(observer.channels, observer.noise, strict=True)):
        whole, ahead = (score(y[:, j], predicted[:, j], sigmas[name]) for predicted in (runs, windowed))
        found[name] = ChannelScores(units[name], sigmas[name], noise, None if failed else whole, ahead)
    return found


__all__ = ["compare", "compare_efforts"]
