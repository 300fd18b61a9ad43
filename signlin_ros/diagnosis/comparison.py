"""How good a model is on measurements: three scores kept apart, what is left in the residual, and where it fails.

``free_run``: the exact simulation from an estimated start, ``windowed``: windows of the horizon, each from a state
estimated before it, ``inverse``: the effort that the measured motion should have taken.
"""

from __future__ import annotations

import html
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import NDArray

from signlin_ros.comparison.inverse import Efforts, InverseError
from signlin_ros.comparison.locate import Region, by_direction, locate
from signlin_ros.comparison.missing import Missing, missing
from signlin_ros.comparison.residuals import ResidualTest, residual_test
from signlin_ros.comparison.scores import Score, follows_nothing, score, unfollowed
from signlin_ros.diagnosis.criteria import DEFAULT_CRITERIA
from signlin_ros.diagnosis.dataset import Dataset, Records, dataset_of
from signlin_ros.diagnosis.evidence import Evidence, evidence_beside, refitted_evidence
from signlin_ros.diagnosis.input_hold import asks_hold, at_noise
from signlin_ros.diagnosis.output_error import FitCache, estimator_of
from signlin_ros.diagnosis.progress import Progress
from signlin_ros.diagnosis.results import FirstRows
from signlin_ros.diagnosis.rows import first_rows
from signlin_ros.errors import InputError, joined
from signlin_ros.follow.data import Segment, as_list, measured_channels, stretches, unit_asked
from signlin_ros.follow.freerun import FreeRun, free_run
from signlin_ros.follow.observer import OBSERVER_TRUSTS, Observer
from signlin_ros.follow.outliers import without_outliers
from signlin_ros.follow.segments import pieces
from signlin_ros.follow.tracking import mean_square
from signlin_ros.lazy import drawn_by, frame
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


@dataclass(frozen=True)
class ChannelScores:
    """A measured channel: unit, ``sigma`` of its sensor's noise, by which all verbs tell errors, ``noise`` with the
    colour that what the model leaves tells of it, and what its predictions are worth (None: see the notes).
    """

    unit: str
    sigma: float
    noise: Noise
    free_run: Score | None
    windowed: Score | None

    def to_json(self) -> dict[str, Any]:
        """Return the channel as the contract writes it, with the noise's colour and step."""
        noise = {"noise": self.sigma, "noise_correlation": self.noise.rho, "quantum": self.noise.quantum}
        scores = {"free_run": self.free_run, "windowed": self.windowed}
        return {"unit": self.unit, **noise, **{name: s.to_json() if s else None for name, s in scores.items()}}


@dataclass(frozen=True, eq=False)
class Traces:
    """A stretch as measured and as predicted, (T, channels) each, NaN where there is nothing; ``states`` (T, n): causal
    estimates of an observer; ``residual``: innovations of one that trusts the model.
    """

    source: str
    t: Array
    u: Array
    measured: Array
    free: Array
    windowed: Array
    states: Array
    residual: Array


@dataclass(frozen=True, eq=False)
class Comparison:
    """A model held against measurements; ``to_json`` is what `signlin compare --json` prints.

    By name: ``channels``, ``inverse`` (at most one), ``residual_tests``, ``directions`` (means of what is missing by
    direction of motion), ``units``. ``where``: regions in which the error is concentrated, the worst first; ``horizon``
    s; ``traces`` and ``missing`` (what the equations lack) of each stretch without a gap. ``refit`` finds first rows.
    """

    model: Model
    channels: dict[str, ChannelScores]
    inverse: dict[str, InverseError]
    where: tuple[Region, ...]
    residual_tests: dict[str, ResidualTest]
    horizon: float
    samples: int
    sources: tuple[str, ...]
    notes: tuple[str, ...]
    directions: dict[str, dict[str, dict[str, float]]]
    units: dict[str, str]
    traces: tuple[Traces, ...] = field(repr=False)
    missing: tuple[Missing, ...] = field(repr=False)
    refit: Callable[[], FirstRows] = field(repr=False)

    @cached_property
    def first_rows(self) -> FirstRows | None:
        """The model as given and its base refitted, when first asked for; None where `without_rows` says why."""
        return self._first_rows[0]

    @property
    def without_rows(self) -> str:
        """Why there are no first rows; empty where there are."""
        return self._first_rows[1]

    @cached_property
    def _first_rows(self) -> tuple[FirstRows | None, str]:
        try:
            return self.refit(), ""
        except InputError as error:
            return None, f"the model was not refitted: {error}"

    def to_frame(self) -> Any:
        """Return RMS errors of each channel as a pandas DataFrame, beside its unit and noise: of the free run, and over
        the horizon on training and validation data, as given and refitted: the numbers of every diagnosis. Where the
        model could not be refitted, `without_rows`, ``windowed`` stands in their place.
        """
        columns: dict[str, Any] = {
            "channel": list(self.channels),
            "unit": [c.unit for c in self.channels.values()],
            "noise": [c.sigma for c in self.channels.values()],
            "free_run": [_rmse(c.free_run) for c in self.channels.values()],
        }
        rows = self.first_rows
        if rows is None:
            return frame(columns | {"windowed": [_rmse(c.windowed) for c in self.channels.values()]}, index="channel")
        for name, row in (("given", rows.given), ("refitted", rows.refitted)):
            for data, scores in (("training", row.estimation), ("validation", row.validation)):
                columns[f"{data}_{name}"] = [_rmse(scores.channels.get(c)) for c in self.channels]
        return frame(columns, index="channel")

    plot = drawn_by("signlin_ros.report.pictures", "measured_and_simulated")

    def to_json(self) -> dict[str, Any]:
        """Return the JSON object of schemas/compare.json."""
        return {
            "channels": {name: c.to_json() for name, c in self.channels.items()},
            "inverse": {name: i.to_json() for name, i in self.inverse.items()},
            "where": [region.to_json() for region in self.where],
            "residual_tests": {name: t.to_json() for name, t in self.residual_tests.items()},
            "missing": {m.name: {**m.to_json(), **self.directions.get(m.name, {})} for m in self.missing},
            "horizon": self.horizon,
            "model": self.model.source,
            "data": list(self.sources),
            "samples": self.samples,
            "notes": [*self._told(), *([self.without_rows] if self.without_rows else [])],
            "first_rows": self.first_rows.to_json() if self.first_rows else None,
        }

    def _told(self) -> list[str]:
        """Return the notes; what the model follows once its numbers are refitted is not put down to the record."""
        names = lost(self.channels)
        after = self.first_rows.refitted.validation.channels if names and self.first_rows else {}
        fits = {name: after[name].fit_percent for name in names if name in after}
        if not fits or set(unfollowed({n: after[n] for n in fits})) or len(fits) < len(names):
            return list(self.notes)
        told = joined([f"{name} ({fit:.0f} % of fit)" for name, fit in fits.items() if fit is not None])
        kept = [note for note in self.notes if note != follows_nothing(names)]
        return [*kept, f"as given the model does not follow, refitted it does: {told}; its numbers are off"]

    def _repr_html_(self) -> str:
        from signlin_ros.console import compare_text

        return f"<pre>{html.escape(compare_text(self.to_json()))}</pre>"


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
    steps = np.concatenate([np.diff(record.t) for record in records])
    if model.asks_hold and steps.size:  # before anything is fitted
        _horizon(model, horizon, float(np.median(steps)))
    prepared = _as_diagnosed(model, data, validation)
    both = _how_inputs_act(prepared, watched)
    told = [both.dataset.told_hold] if both and both.dataset.told_hold else []
    model = model.with_options(input_hold=both.dataset.model.input_hold) if both else model
    watched.say("noise of the sensors")
    observer, notes = _observed(model, records)
    units, horizon = dict(records[0].units), _horizon(model, horizon, observer.step)
    watched.say("free run from the start")
    free = _free(observer, notes)
    watched.say("prediction, window by window")
    window = _windowed(observer, horizon, notes)
    watched.say("what is missing")
    lacking, residuals = missing(observer, units), [run.innovation for run in observer.runs(observer.design(TRUSTING))]
    scored = _scored(observer, units, free, window, prepared.noise if isinstance(prepared, Dataset) else {})
    watched.say("where it fails")
    efforts = compare_efforts(model, records, cutoff)
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
        notes=(*notes, *told, *_remarks(observer, scored, lacking, where)),
        directions={m.name: by_direction(observer, m, units) for m in lacking if m.clear},
        units=units,
        traces=_traces(observer, free, window, residuals),
        missing=lacking,
        refit=refit,
    )


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


def lost(channels: Mapping[str, ChannelScores]) -> list[str]:
    """Return the channels that the model follows neither freely nor over windows."""
    ahead = unfollowed({name: c.windowed for name, c in channels.items() if c.windowed})
    return [name for name in ahead if (free := channels[name].free_run) is None or unfollowed({name: free})]


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


def _rmse(found: Score | None) -> float:
    """Return the RMS error of a score, in the channel's unit; nan where there is none."""
    return np.nan if found is None else found.rmse


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


__all__ = ["ChannelScores", "Comparison", "Traces", "compare", "compare_efforts", "lost"]
