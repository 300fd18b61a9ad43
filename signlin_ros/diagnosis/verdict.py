"""`diagnose`, `add` and `refine`: from what a search found to a verdict in words, a ladder and a model file."""

from __future__ import annotations

import re
from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from signlin_ros.diagnosis.data import arriving, as_list
from signlin_ros.diagnosis.derived import position_alone
from signlin_ros.diagnosis.findings import NEEDED, Findings, Step, structured
from signlin_ros.diagnosis.fit import Candidate, Fit, follow_records, seen_late
from signlin_ros.diagnosis.judge import correlations
from signlin_ros.diagnosis.problem import (
    Gains,
    Problem,
    Segment,
    added_keys,
    driven_by_inputs,
    input_noise,
    linear_base,
)
from signlin_ros.diagnosis.rank import Ranked, evidence_of
from signlin_ros.diagnosis.refusals import plausible, sound
from signlin_ros.diagnosis.results import Diagnosis, Entry, Estimate, Rung, Scores
from signlin_ros.diagnosis.scores import Score, score
from signlin_ros.diagnosis.search import CERTAIN, DEPTH, EXPLAINED, FURTHER, SIMPLE, SURE, TIE, Progress, search
from signlin_ros.effects import find_effect
from signlin_ros.effects.base import SensorEffect, Shown
from signlin_ros.errors import joined
from signlin_ros.model import Model
from signlin_ros.predict import windows
from signlin_ros.records import ModelData
from signlin_ros.trace import resolve_unit

Array = NDArray[np.float64]

PARTLY = 0.4
"""Least share of the missing motion that an effect explains which is named though structure remains."""
FAINT = 0.1
"""Least share that an effect explains of what a model leaves on unseen data which leaves nothing on its own."""
MOST = 6
"""Most effects that `refine` adds."""
REST = 0.15
"""Largest excess over the noise, as a share of it, of a model that lacks nothing else but a detail;"""
ELSEWHERE = 0.5
"""Largest excess over the noise, as a share of it, on unseen data where a model leaves nothing on its own."""
DETAIL, NEARLY_ALL = 10.0, (0.995, 0.999)
"""where more is left, as on a quiet record, where everything stands out, up to so many times the noise or beyond, the
shares of what was missing that must be explained."""
CURVES, PERIODS = 0.03, 3.0
"""Largest excess over the noise, as a share of it, of two curves over the position: beyond, they are the first terms of
another. A wave of so many periods is no such term."""
DRIVEN = 0.99
"""Least share that must be explained where what is left is what noise in the input would leave: so is what is left of
a law outside the list that a listed one imitates by 97 or 98 %."""
WORTH, NEARLY = 0.3, 0.05
"""Share of the squared error that a rival must take beside what was found before, to be spoken of as one, and how much
more what was found must take."""
NOT_LISTED = "The residual has structure that no listed effect explains on data that the fit did not see."
WORSE = 1.2
"""Times the error of the model as it is that a proposal may leave when left alone."""
ALIKE = 0.2
"""Largest difference of the logarithms of factors that are called the same."""
FAR = (0.2, 3.0)
"""A known effect's parameter moved far: by more than this share of it, and so many standard errors."""
FREED = (
    "without it known parameters are far from their values, and the error on unseen data differs by no more than their "
    "uncertainty makes"
)
"""What is said of an effect that is named for that, not for the error."""
WHOLE = 0.9995
"""A share from which on no digits are told."""
ORDINARY = 0.1
"""An effect is ordinary if its force is this share of the driving force: what a record should be able to show."""


def diagnose(
    model: Model,
    data: ModelData | Sequence[ModelData],
    validation: ModelData | Sequence[ModelData] | None = None,
    *,
    jobs: Executor | None = None,
    progress: Progress | None = None,
) -> Diagnosis:
    """Name the physical effects that a model lacks, or say that none fits, none is missing, or what cannot be told.

    data, validation: records in the model's terms (`signlin_ros.records.read_for_model`); without validation the last
    third of every record is held out. ``jobs``: where candidates are fitted (threads by default). Raises
    `RecordError` for records that cannot be used.
    """
    return _found(model, data, validation, jobs, progress)


def add(
    effect: str,
    model: Model,
    data: ModelData | Sequence[ModelData],
    validation: ModelData | Sequence[ModelData] | None = None,
    *,
    jobs: Executor | None = None,
    progress: Progress | None = None,
) -> Diagnosis:
    """Add an effect and fit it, whatever it is worth: the ranking has it alone, the ladder before and after.

    Arguments as in `diagnose`; raises `ModelError` for an unknown effect, `InputError` where it cannot be added.
    """
    found = _found(model, data, validation, jobs, progress, only=effect)
    findings, share = found.findings, _explained(found.findings)
    rest = " Structure remains: ask `diagnose` what else is missing." if findings.unaccounted else ""
    worth = f"{effect.replace('_', ' ')} explains {_percent(share)} of the missing motion"
    sure = f"by {min(findings.final.certainty, 99):.1f} standard errors"
    if not findings.beyond_doubt:
        worth = f"The record does not ask for {effect.replace('_', ' ')}"
        why = findings.declined.get(effect, _change(findings.final))
        return replace(found, sentence=f"{worth}: {why}.{rest}")
    return replace(found, sentence=f"{worth} on data that the fit did not see, {sure}.{rest}")


def _change(step: Step) -> str:
    """Return in words what a step does to the error on unseen data."""
    way = "falls" if step.certainty > 0 else "rises"
    return f"the error on unseen data {way} by {min(abs(step.certainty), 99):.1f} standard errors"


def refine(
    model: Model,
    data: ModelData | Sequence[ModelData],
    validation: ModelData | Sequence[ModelData] | None = None,
    *,
    jobs: Executor | None = None,
    progress: Progress | None = None,
) -> Diagnosis:
    """Add effects until nothing confirmed is missing; the last of the notes says why it stopped."""
    found = _found(model, data, validation, jobs, progress, depth=MOST)
    return replace(found, notes=(*found.notes, _why_stopped(found)))


def _found(
    model: Model,
    data: ModelData | Sequence[ModelData],
    validation: ModelData | Sequence[ModelData] | None,
    jobs: Executor | None,
    progress: Progress | None,
    depth: int = DEPTH,
    only: str | None = None,
) -> Diagnosis:
    """Return the verdict on what a search found; where that stays unexplained, on what one found that takes noise in
    the inputs for what moves the state, if that matters; or on the position alone, if it is fine: a model that explains
    it explains its derivative.
    """
    known, unseen = as_list(data), _or_none(validation)

    def one(driven: bool) -> Diagnosis:
        return describe(search(model, known, unseen, jobs, progress, depth, only, driven), whole=only is not None)

    first = one(False)
    f = first.findings
    if first.verdict != "unexplained" or f.reversed:
        return first
    second = one(True) if driven_by_inputs(f.problem) else first
    still, count = second.verdict == "unexplained" and model.plant.velocity in f.problem.channels, len(known)
    fine = position_alone(model, [*known, *(unseen or [])]) if still else []
    if fine:
        second = _found(model, fine[:count], fine[count:] or None, jobs, progress, depth, only)
        why = f"{model.plant.velocity} was left out: with it nothing explains this record, and {model.plant.position}"
        second = replace(second, notes=(*second.notes, f"{why} tells the motion finely enough"))
    return first if second.verdict == "unexplained" else second


def _why_stopped(d: Diagnosis) -> str:
    added = len(d.ladder[-1].effects)
    if added >= MOST:
        return f"stopped after {MOST} effects"
    end = "the residual is noise"
    if d.findings.driven_by_noise:
        end = _noise_in_input(d.findings)
    elif d.findings.structured:
        end = "no other listed effect lowers the error on unseen data beyond doubt, though structure remains"
    return f"stopped after {added} effect{'' if added == 1 else 's'}: {end}"


def _or_none(data: ModelData | Sequence[ModelData] | None) -> list[ModelData] | None:
    return None if data is None else as_list(data)


# --------------------------------------------------------------------------- scores


def kind_of_score(problem: Problem) -> str:
    """Return ``free_run`` where the plant forgets its start, ``windowed`` where errors pile up (an integrator)."""
    _, A, _, _ = linear_base(problem.base, problem.channels)
    forgets = bool(A.size) and float(np.max(np.linalg.eigvals(A).real)) < -1.0 / problem.scale.duration
    return "free_run" if forgets else "windowed"


def scores(problem: Problem, f: Fit, kind: str, noise: Array, levels: Sequence[int] = ()) -> Scores:
    """Score a fitted model on the records of a problem.

    The state at the start of a run is that of the observer: causal, from measurements before it. Windows start from
    that of the ``levels`` (all by default) whose states predict best, as in `compare`.
    """
    measured = [s.y for s in problem.segments]
    errors = [np.full_like(y, np.nan) for y in measured]
    low = problem.levels[-1]
    if kind == "free_run":
        values = np.concatenate([low.values[:200], np.zeros((1, *low.values.shape[1:]))])
        settle = Gains(low.tau, low.names, values, np.ones((0, len(problem.channels))))
        found = follow_records(problem, f.candidate, f.theta, settle, False)
        errors = found[0] if found else errors
        errors = [np.where(np.arange(e.shape[0])[:, None] >= min(200, e.shape[0] // 4), e, np.nan) for e in errors]
    else:
        tried = [_in_windows(problem, f, k) for k in levels or range(len(problem.levels))]
        errors = min(tried, key=_size, default=errors)
    y, e = np.concatenate(measured), np.concatenate(errors)
    result = {}
    for c, name in enumerate(problem.channels):
        found_score = score(y[:, c], y[:, c] - e[:, c], float(noise[c]))
        result[name] = found_score or Score(float("inf"), None, None)
    return Scores(kind, result)


def _in_windows(problem: Problem, f: Fit, level: int) -> list[Array]:
    """Return the errors (T, ny) of runs over windows of every record, started from the states at one of the gains; NaN
    where the model diverges.
    """
    found = follow_records(problem, f.candidate, f.theta, problem.levels[level], False)
    if found is None:
        return [np.full_like(s.y, np.nan) for s in problem.segments]
    return [_windowed(problem, f, s, E, X) for s, E, X in zip(problem.segments, found[0], found[2], strict=True)]


def _size(errors: Sequence[Array]) -> float:
    """Return the sum of the logarithms of the mean squares of errors (T, ny) over the channels; inf if unknown."""
    e = np.concatenate(errors)
    known = np.isfinite(e)
    if not known.any(axis=0).all():
        return np.inf
    return float(np.sum(np.log(np.nanmean(e**2, axis=0) + 1e-300)))


def _best_level(problem: Problem, f: Fit) -> int:
    """Return the gain whose states a model predicts best from, over windows."""
    return int(np.argmin([_size(_in_windows(problem, f, k)) for k in range(len(problem.levels))]))


def _windowed(problem: Problem, f: Fit, s: Segment, E: Array, X: Array) -> Array:
    """Return the errors (T, ny) of runs over windows of the update period, each started from X (T, n).

    As long as a late sensor shows what was before a window, that is known: innovations E (T, ny) count there.
    """
    errors = np.full_like(s.y, np.nan)
    lags = seen_late(problem, f.candidate, f.candidate.p(f.theta))[:, 0]
    steady, names = problem.levels[1].values[-1:], problem.levels[1].names
    candidate, theta, delay = _in_time(f)
    u, early = (_delayed(problem, s, delay), s.early if problem.scale.imposed else 0.0) if delay else (s.u, s.early)
    free = Gains(np.inf, names, np.zeros_like(steady), np.ones((0, steady.shape[2])))
    for first, last in windows(s.t, problem.base.update_period)[1:]:
        if s.t[first] - s.t[0] < delay:
            continue
        part = slice(first, last + 1)
        start = dict(zip(candidate.model.states, X[first], strict=True))
        window = Segment(s.t[part], u[part], s.y[part], start, "", False, early)  # from nothing but what was before
        run = follow_records(problem, candidate, theta, free, False, (window,))
        if run:
            errors[first + 1 : last + 1] = run[0][0][1:]
        for c, lag in enumerate(lags):
            known = slice(first + 1, min(last + 1, np.searchsorted(s.t, s.t[first] + lag)))
            errors[known, c] = E[known, c]
    return errors


def _in_time(f: Fit) -> tuple[Candidate, Array, float]:
    """Return a fitted candidate without its delay of the input, its coordinates, and the delay in s."""
    c, eq = f.candidate, f.candidate.equations
    kept = [k.name not in eq.delaying for k in c.coordinates]
    coordinates = tuple(k for k, keep in zip(c.coordinates, kept, strict=True) if keep)
    values = c.values | dict.fromkeys(eq.delaying, 0.0)
    return replace(c, coordinates=coordinates, values=values), f.theta[kept], max(float(eq.delay @ c.p(f.theta)), 0.0)


def _delayed(problem: Problem, s: Segment, delay: float) -> Array:
    """Return the input (T, m) of a record as it arrives: what it is at every sample where motion is imposed, else its
    means over the steps, the last sample held for one step more.
    """
    t, late = s.t, delay - s.early
    if problem.scale.imposed:
        return s.u[np.maximum(np.searchsorted(t + late, t, side="right") - 1, 0)]
    return arriving(np.append(t, 2 * t[-1] - t[-2]), np.vstack([s.u, s.u[-1:]]), late)


# --------------------------------------------------------------------------- parameters


def estimates(f: Fit, names: Sequence[str], findings: Findings) -> dict[str, Estimate]:
    """Return parameters with standard errors that allow for what correlation is left in the residual."""
    c, problem = f.candidate, findings.problem
    covariance = _covariance(f)
    units = {n.split(".", 1)[1]: p.unit for n, p in c.model.par_declarations().items()}
    fitted = {k.name: (i, k) for i, k in enumerate(c.coordinates)}
    p = dict(zip(c.equations.parameters, c.p(f.theta), strict=True))
    result = {}
    for name in names:
        if name in units:
            unit = resolve_unit(units[name], c.model.plant, problem.rotary)
        else:
            unit = _sensor_unit(problem, name)
        if name not in fitted:
            result[name] = Estimate(float(p[name] if name in p else c.model.value(name)), None, unit, "held")
            continue
        i, k = fitted[name]
        own = float(np.sqrt(max(covariance[i, i], 0.0)))
        std = own * abs(k.slope(float(f.theta[i])))
        told = f.hessian[i, i] > 0.0
        notes = [_note(k, float(f.theta[i]), own) if told else "values nearby fit as well"]
        if told and "." in name:
            notes.insert(0, _moved(float(p[name]), std, given(problem.base, name)))
        result[name] = Estimate(float(p[name]), std if told else None, unit, "; ".join(n for n in notes if n))
    return result


def _covariance(f: Fit) -> Array:
    """Return the covariance of the coordinates: of the data, widened for their correlation, and of the priors."""
    prior = np.diag([1.0 / k.spread**2 for k in f.candidate.coordinates])
    return np.asarray(np.linalg.pinv((f.hessian - prior) / _inflation(f) ** 2 + prior, hermitian=True))


def _note(k: Any, theta: float, std: float) -> str:
    if theta <= k.low + 1e-9 * abs(k.low) or theta >= k.high - 1e-9 * abs(k.high):
        return "at its bound"
    if np.isfinite(k.spread) and k.spread < 1.0 and abs(theta - k.prior) > 3 * k.spread:
        return f"{abs(theta - k.prior) / k.spread:.1f} standard deviations from its nominal value"
    if np.isfinite(k.spread) and k.spread < 1.0 and std > 0.95 * k.spread:
        return "not excited: the record says nothing beyond the tolerance"
    return ""


def given(base: Model, name: str) -> float | None:
    """Return a parameter as the base model has it, None where it has none of this name."""
    key, _, inner = name.rpartition(".")
    if not key:
        return base.parameters.get(inner)
    return base.effects[key].parameters.get(inner) if key in base.effects else None


def _moved(value: float, std: float, was: float | None) -> str:
    """Return what a known effect's parameter was, where it is no longer nearly that."""
    far = was is not None and abs(value - was) > max(FAR[0] * abs(was), FAR[1] * std)
    return f"was {was:g}" if far else ""


def _sensor_unit(problem: Problem, name: str) -> str:
    kind, _, channel = name.partition(".")
    return {"sensor_gain": "-", "sensor_delay": "s"}.get(kind, problem.units.get(channel, ""))


def _inflation(f: Fit) -> float:
    """Return by how much correlated residuals widen standard errors: sqrt(1 + 2 sum of correlations), at least 1."""
    worst = 1.0
    for c in range(f.innovations[0].shape[1]):
        r, _, _ = correlations([f.filter.apply(e)[:, c] for e in f.innovations], 50)
        positive = r[: int(np.argmax(r < 0.02)) or r.size] if (r < 0.02).any() else r
        worst = max(worst, 1.0 + 2.0 * float(np.sum(np.maximum(positive, 0.0))) if r[0] > 0.05 else 1.0)
    return float(np.sqrt(worst))


# --------------------------------------------------------------------------- words


def sentence_of(effect: str, problem: Problem, parameters: dict[str, Estimate]) -> str:
    """Return what the record shows of an effect, as a sentence."""
    plant = problem.base.plant
    cls = find_effect(effect, "effects")
    if issubclass(cls, SensorEffect):
        name, found = next(iter(parameters.items()))
        return cls.shown_on(name.partition(".")[2], Shown(found.value, found.unit, found.std))
    values = {n.rpartition(".")[2]: Shown(p.value, p.unit, p.std) for n, p in parameters.items()}
    return cls.shown(values, _drive(problem), plant.position, plant.velocity)


def _drive(problem: Problem) -> str:
    """Return the word for what drives the plant."""
    return "torque" if problem.rotary or problem.base.plant.force_unit == "N·m" else "force"


# --------------------------------------------------------------------------- the verdict


def describe(f: Findings, whole: bool = False) -> Diagnosis:
    """Return the diagnosis that follows from what a search found; what explains too little is not proposed, unless the
    ``whole`` path is wanted: nothing at all, or what explains only a part of what the first effect leaves, where that
    is enough. Of several effects together this is not said: they make many another law.
    """
    f = f if whole or not _faint(f) else f.first(1)
    kind = kind_of_score(f.problem)
    level = [_best_level(f.unseen, f.steps[0].ranked.fit)] if kind == "windowed" else []
    told = _told(f, kind, level)
    if told.verdict == "unexplained" and not whole and len(f.steps) > 2 and len(f.steps[1].ranked.effects) == 1:
        first = _told(_first_alone(f), kind, level)
        told = first if first.verdict == "missing" else told
    f, ladder, verdict, explained, rest = told
    problem, unseen, noise = f.problem, f.unseen_noise, f.noise
    partly = explained if verdict == "unexplained" else None
    ranking = _ranking(f, kind, unseen, level, partly)
    proposed = f if whole or not _too_little(f, partly) else replace(f, steps=f.steps[:1])
    ladder, model, final = ladder[: len(proposed.steps)], proposal(proposed), proposed.final.ranked
    base = f.steps[0].ranked.fit
    names = [c.name for c in final.fit.candidate.coordinates]
    return Diagnosis(
        verdict=verdict,
        sentence=_sentence(f, verdict, explained, rest),
        base=estimates(base, [c.name for c in base.candidate.coordinates], f),
        base_validation=ladder[0].validation,
        parameters=estimates(final.fit, names, f),
        ranking=ranking,
        ladder=ladder,
        model=model,
        range=dict(problem.ranges),
        noise=dict(zip(problem.channels, noise.tolist(), strict=True)),
        experiments=_experiments(ranking),
        notes=_notes(f),
        yaml=yaml_of(model, proposed),
        findings=f,
    )


class _Told(NamedTuple):
    """A verdict and what it is reached by: scores along the ladder, the share that is explained and the excess that is
    left over the noise.
    """

    findings: Findings
    ladder: tuple[Rung, ...]
    verdict: str
    explained: float
    rest: float


def _told(f: Findings, kind: str, level: Sequence[int]) -> _Told:
    """Return the verdict on a proposal; ``level``: the gain whose states the base model predicts best from over
    windows.
    """
    ladder = tuple(
        Rung(
            s.ranked.effects,
            scores(f.problem, s.ranked.fit, kind, f.noise),
            scores(f.unseen, s.ranked.fit, kind, f.unseen_noise, () if s.ranked.effects else level),
        )
        for s in f.steps
    )
    nothing = bool(f.reversed) or _alone_worse(ladder)
    explained = 0.0 if nothing else _explained(f)
    rest = min(_rest(f), ladder[-1].validation.over_noise - 1.0)
    verdict = "unexplained" if nothing else _verdict(f, ladder, explained, rest)
    return _Told(f, ladder, verdict, explained, rest)


def _first_alone(f: Findings) -> Findings:
    """Return the same with the first step only; why what comes after is not proposed is among what is declined."""
    first = f.first(2)
    known = first.final.ranked.effects
    why = {
        e: f"beside {_named(known)} it explains {100 * max(s.share, 0.0):.0f} % only of what is left, which is of "
        "another kind"
        for s in f.steps[2:]
        for e in s.ranked.effects
        if e not in known
    }
    return replace(first, declined={**why, **f.declined})


def _faint(f: Findings) -> bool:
    """Tell whether a proposal makes hardly a difference to unseen data where the model as it is leaves nothing but
    noise on its own: the best of two dozen effects by chance.
    """
    if len(f.steps) != 2 or f.structured or f.final.certainty > FURTHER:
        return False
    return _explained(f) < FAINT and not structured(f.problem, f.steps[0].ranked, f.filter)


def _too_little(f: Findings, partly: float | None) -> bool:
    """Tell whether what was added leaves most of what is missing unexplained; ``partly``: the share that it explains
    where the verdict is "unexplained", else None.
    """
    return partly is not None and (partly < PARTLY or f.final.certainty < CERTAIN)


def _explained(f: Findings) -> float:
    """Return the share of the missing motion on unseen data that the proposal explains.

    Where a proposal leaves nothing on the data that it was fitted to, or what noise in the input leaves, unseen motion
    that is lost for once, or wanders, is also followed with the middle gain.
    """
    share = _share(f, f.held_out)
    return share if f.unaccounted else max(share, _share(f, f.followed))


def _share(f: Findings, both: tuple[tuple[Array, ...], tuple[Array, ...]]) -> float:
    first, last = (np.concatenate(e) for e in both)
    noise = f.unseen_noise
    before = np.nanmean(first**2, axis=0) / noise**2 - 1.0
    after = np.maximum(np.nanmean(last**2, axis=0) / noise**2 - 1.0, 0.0)
    weight = (before > 0.1) & _told_by(f)
    if not weight.any():
        return 1.0
    shares = 1.0 - after[weight] / before[weight]
    return float(max(np.average(shares, weights=np.sqrt(before[weight])), 0.0))


def _told_by(f: Findings) -> NDArray[np.bool_]:
    """Return the channels (ny) by which a proposal is judged: those on which it is, where all that is missing is in
    sensors, and what is left in others is what noise in the input leaves; else all.
    """
    channels, final = f.problem.channels, f.final.ranked
    on = np.array([any(s.partition(".")[2] == c for s in final.sensors) for c in channels])
    only_sensors = bool(final.effects) and all(
        issubclass(find_effect(e, "effects"), SensorEffect) for e in final.effects
    )
    return on if only_sensors and f.driven_by_noise else np.ones(len(channels), dtype=bool)


def _beside(ladder: Sequence[Rung]) -> float:
    """Return the least share that the last rung explains of what those between the first and it left, in squares beyond
    the noise: a strong effect must not hide that what is added to it explains little.
    """
    last, shares = ladder[-1].validation.channels, [1.0]
    for rung in ladder[1:-1]:
        for name, one in rung.validation.channels.items():
            before, after = ((s.rmse_over_noise or 0.0) ** 2 - 1.0 for s in (one, last[name]))
            if before > 1.0:
                shares.append(1.0 - max(after, 0.0) / before)
    return max(min(shares), 0.0)


def _alone_worse(ladder: Sequence[Rung]) -> bool:
    """Tell whether the proposal, left alone, is worse than the model as it is in every channel, on the data that it was
    fitted to and on unseen data, or leaves all bounds: what held it is the observer.
    """
    first, last = ladder[0], ladder[-1]
    held = _bounded(first.validation) and not _bounded(last.validation)
    return held or (_worse(first.estimation, last.estimation) and _worse(first.validation, last.validation))


def _worse(before: Scores, after: Scores) -> bool:
    return all(after.channels[name].rmse > WORSE * one.rmse for name, one in before.channels.items())


def _bounded(s: Scores) -> bool:
    return all(np.isfinite(one.rmse) for one in s.channels.values())


def _verdict(f: Findings, ladder: Sequence[Rung], explained: float, rest: float) -> str:
    if len(f.steps) == 1 or not f.beyond_doubt:
        return "unexplained" if f.unaccounted or _elsewhere(f, explained, rest) else "adequate"
    if _elsewhere(f, explained, rest):
        return "unexplained"
    if f.unaccounted and rest > ELSEWHERE and _beside(ladder) < EXPLAINED:
        return "unexplained"
    if _of_another_shape(f, rest) or (f.unaccounted and _outdone(f)):
        return "unexplained"
    return "missing" if explained >= _enough(f, rest) or not f.structured else "unexplained"


def _elsewhere(f: Findings, explained: float, rest: float) -> bool:
    """Tell whether a proposal leaves noise where it was fitted, and is wrong on unseen data, of other motion."""
    good = bool(f.final.ranked.effects) and f.beyond_doubt and explained >= PARTLY
    return not f.structured and not good and rest > ELSEWHERE and not f.uncertain


def _of_another_shape(f: Findings, rest: float) -> bool:
    """Tell whether a proposal has several curves over the position: together they make nearly any other curve; two that
    leave noise alone may be what they are called.

    The weight of an arm is no such curve, nor is a wave of many periods.
    """
    problem, r, curves = f.problem, f.final.ranked.fit, 0
    low, high = problem.stretch
    values, model = r.parameters(), r.candidate.model
    for key in (k for k in r.candidate.label if k in model.effects):
        kind = find_effect(model.effects[key].type, "effects")
        weight = kind.name == "gravity_load" and _drive(problem) == "torque"
        seen = [values[f"{key}.{n}"] * (high - low) / (2 * np.pi) for n in kind.periodic[:1]]
        curves += kind.shaped and not weight and all(periods < PERIODS for periods in seen)
    return curves > 2 or (curves == 2 and rest > CURVES and not f.uncertain)


def _outdone(f: Findings) -> bool:
    """Tell whether the best effect alone beats the proposal, on unseen data too, with parameters that it cannot have,
    and what it imitates is known: that, and not the proposal, is nearer to what is missing.
    """
    best = f.singles[0] if f.singles else f.final
    if best.ranked.evidence >= f.final.ranked.evidence - NEEDED or plausible(f.problem, best.ranked):
        return False
    theirs, ours = (np.nanmean(np.concatenate(s.unseen) ** 2, axis=0) for s in (best, f.final))
    return find_effect(best.ranked.label, "effects").outdoes and float(np.sum(np.log(theirs / ours))) < 0.0


def _enough(f: Findings, rest: float) -> float:
    """Return the least share of the missing motion on unseen data that is enough, for what is left beyond the noise."""
    if rest <= REST or not f.structured:
        return DRIVEN if f.driven_by_noise and len(f.final.ranked.effects) > 1 else EXPLAINED
    if f.driven_by_noise and rest <= ELSEWHERE:
        return DRIVEN
    return NEARLY_ALL[0] if f.driven_by_noise or 1.0 + rest < DETAIL else NEARLY_ALL[1]


def _rest(f: Findings) -> float:
    """Return by what share of the noise the error of the proposal exceeds it on unseen data, in the worst channel."""
    last = np.concatenate(f.held_out[1])
    return float(np.max(np.sqrt(np.nanmean(last**2, axis=0)) / f.unseen_noise)) - 1.0


def _named(names: Sequence[str]) -> str:
    return joined([n.replace("_", " ") for n in names])


def _sentence(f: Findings, verdict: str, explained: float, over: float) -> str:
    """Return the verdict in words; ``over``: by what share of the noise the error of the proposal exceeds it."""
    effects = f.final.ranked.effects
    if verdict == "adequate":
        left = _noise_in_input(f) if f.structured else "the residual is noise"
        if over > ELSEWHERE and not f.structured:
            error = f"on unseen data its error is {1.0 + over:.2g} times that"
            left += f"; {error}, no more than the uncertainty of the fitted parameters makes there"
        return f"Nothing is missing that this record could show: {left}."
    if verdict == "unexplained":
        return _unexplained(f, explained, over)
    left = f", {1.0 + over:.2g} times the noise" if over > REST else ""
    rest = f" Some structure remains that no listed effect explains{left}." if f.unaccounted else ""
    if f.driven_by_noise:
        rest = f" {_noise_in_input(f).capitalize()}."
    return (
        f"The model lacks {_either(f, effects)}: {_percent(explained)} of the missing motion is explained on data that "
        f"the fit did not see.{rest}"
    )


def _unexplained(f: Findings, explained: float, over: float) -> str:
    if f.reversed:
        return (
            f"With the sign of {f.reversed} reversed the model as it is follows this record much better: "
            "check that sign before anything else."
        )
    effects = f.final.ranked.effects
    if effects and explained == 0.0:
        return NOT_LISTED
    share = f"{_named(effects)} {'explains' if len(effects) == 1 else 'explain'}" if effects else ""
    before = (
        f"{share[:1].upper()}{share[1:]} {_percent(explained)} of the missing motion on data that the fit did not see"
    )
    if effects and _outdone(f):
        found = f.singles[0].ranked.label
        more = f"{found.replace('_', ' ')} explains more with parameters that it cannot have"
        return f"{before}; {more}: {find_effect(found, 'effects').imitates}."
    if _of_another_shape(f, over):
        left = f"leave {1.0 + over:.3g} times the noise" if over > 0.0 else "leave structure"
        return f"{before}, and {left}: they stand for one force over the position, of a shape that is not listed."
    if _elsewhere(f, explained, over):
        known = f"{share} what is missing" if effects and f.beyond_doubt else "nothing is missing"
        known = f"{known[0].upper()}{known[1:]} where the model was fitted"
        elsewhere = f"elsewhere its error is {1.0 + over:.2g} times the noise"
        return f"{known}, but {elsewhere}: what is missing shows only there; fit it to that record too."
    if effects and not f.unaccounted:
        share = f"{share} only {_percent(explained)} of the missing motion on data that the fit did not see"
        return f"{share[0].upper()}{share[1:]}; {_noise_in_input(f)}."
    rest = f"{before}; what remains has structure that no listed effect explains."
    return rest if effects and explained >= 0.01 else NOT_LISTED


def _noise_in_input(f: Findings) -> str:
    return f"what is left looks like noise in the {f.problem.base.inputs[0]}"


def _either(f: Findings, effects: Sequence[str]) -> str:
    """Return effects in words, each with what could as well stand in its place."""
    rivals = [_rivals(f, e) for e in effects]
    whole = [e if not r else f"{e} (or {', '.join(r)})" for e, r in zip(effects, rivals, strict=True)]
    return _named(whole)


def _percent(share: float) -> str:
    """Return a share in percent, with as many digits as what it lacks to the whole needs; no record tells the whole."""
    if share >= WHOLE:
        return "more than 99.9 %"
    digits = max(int(np.ceil(-np.log10(100 * (1.0 - share)))), 0)
    return f"{100 * share:.{digits}f} %"


def _rivals(f: Findings, effect: str) -> list[str]:
    """Return what could stand in place of an effect of the proposal: as good by evidence, or nearly the same."""
    final = f.final.ranked
    others = set(final.effects) - {effect}
    options = [s.ranked for s in f.singles] if len(final.effects) == 1 else list(f.pairs)
    found = []
    for r in options:
        if set(r.effects) >= others and len(r.effects) == len(final.effects) and effect not in r.effects:
            new = (set(r.effects) - others).pop()
            if abs(r.evidence - final.evidence) < TIE and new not in found and sound(f.problem, r):
                found.append(new)
    values, cls = {n: p.value for n, p in added_parameters(f, final, effect).items()}, find_effect(effect, "effects")
    alike = [*cls.simpler(values), *(n for n in cls.blurred(values, f.problem.blur) if _as_good(f, n, effect))]
    alike += cls.single_channel_twins if len(f.problem.channels) == 1 else ()
    nearly = [n for n in alike if n not in (*found, *final.effects)]
    return found + [n for n in nearly if any(s.ranked.label == n for s in f.singles)]


def _as_good(f: Findings, effect: str, other: str) -> bool:
    """Tell whether an effect alone leaves hardly more than another one alone."""
    cost = {s.ranked.label: s.ranked.fit.cost for s in f.singles}
    most = SIMPLE * float(f.final.ranked.fit.count.max())
    return effect in cost and other in cost and cost[effect] - cost[other] < most


def _ranking(f: Findings, kind: str, noise: Array, level: Sequence[int], partly: float | None) -> tuple[Entry, ...]:
    final = f.final.ranked
    best: dict[str, Step] = {}
    for s in f.singles:
        best.setdefault(s.ranked.label, s)
    rivals = {e: _rivals(f, e) for e in final.effects}
    shown = {e: scores(f.unseen, step.ranked.fit, kind, noise, level) for e, step in best.items()}
    entries = [_entry(f, effect, step, shown[effect], rivals, partly) for effect, step in best.items()]
    entries.sort(key=lambda e: (_order(e, final.effects), -e.evidence))
    absent = [
        Entry(n, "not_applicable", {}, None, (), f"does not apply to {f.problem.base.plant.name}") for n in f.outside
    ]
    return (*entries, *absent)


def _order(e: Entry, proposed: tuple[str, ...]) -> int:
    if e.effect in proposed:
        return 0
    return 1 if e.status == "ambiguous" else 2


def _entry(
    f: Findings, effect: str, step: Step, validation: Scores, rivals: dict[str, list[str]], partly: float | None
) -> Entry:
    final = f.final.ranked
    r = final if effect in final.effects else _instead_of(f, effect, rivals) or step.ranked
    parameters = added_parameters(f, r, effect)
    gain = f.steps[0].ranked.evidence - step.ranked.evidence
    tied: tuple[str, ...] = ()
    if effect in final.effects:
        tied = tuple(rivals[effect])
        status = "ambiguous" if tied else "confirmed"
        why = _why_named(f, effect, parameters, tied)
        if partly is not None:
            status = "rejected" if _too_little(f, partly) else status
            left = 100 * (1 - partly)
            why += f"; but {f'{left:.0f}' if left > 10 else f'{left:.2g}'} % of the missing motion remains unexplained"
        if not f.beyond_doubt:
            status, why = "rejected", f"the record does not ask for it: {why}"
    elif any(effect in names for names in rivals.values()) and not (partly is not None and _too_little(f, partly)):
        owner = next(e for e, names in rivals.items() if effect in names)
        status, tied = "ambiguous", (owner, *(n for n in rivals[owner] if n != effect))
        why = f"explains the record as well as {owner}: {sentence_of(effect, f.problem, parameters)}"
    else:
        status, why = _why_not(f, effect, step)
    return Entry(effect, status, parameters, validation, tied, why, gain, step.certainty)


def _instead_of(f: Findings, effect: str, rivals: dict[str, list[str]]) -> Ranked | None:
    """Return the proposal with an effect in place of the one that it ties with, if that was fitted."""
    final = set(f.final.ranked.effects)
    sets = [(final - {owner}) | {effect} for owner, names in rivals.items() if effect in names]
    return min((r for r in f.pairs if set(r.effects) in sets), key=evidence_of, default=None)


def added_parameters(f: Findings, r: Any, effect: str) -> dict[str, Estimate]:
    """Return the parameters of an effect that was added, in a fit, by their names without its key."""
    model = r.fit.candidate.model
    keys = added_keys(f.problem, model, effect)
    names = [f"{key}.{n}" for key in keys for n in model.effects[key].parameters]
    names += [s for s in r.sensors if s.partition(".")[0] == effect]
    found = estimates(r.fit, names, f)
    return {n if n.startswith("sensor_") else n.partition(".")[2]: p for n, p in found.items()}


def _why_named(f: Findings, effect: str, parameters: dict[str, Estimate], tied: tuple[str, ...]) -> str:
    step = next(s for s in f.steps if effect in s.ranked.effects)
    text = sentence_of(effect, f.problem, parameters)
    text += f"; {_change(step) if step.gain > 0 or step is not f.final or not f.beyond_doubt else FREED}"
    if tied:
        text += f"; {_named(tied)} would explain this record as well"
    return text


def _why_not(f: Findings, effect: str, step: Step) -> tuple[str, str]:
    """Return status and reason of an effect that is not part of the proposal."""
    gain = f.steps[0].ranked.evidence - step.ranked.evidence
    final = f.final.ranked
    if gain <= 0 and (find_effect(effect, "effects").only_beyond or not _excited(f, step)):
        return "not_excited", _not_excited(f, effect)
    if effect in f.declined:
        return "rejected", f.declined[effect]
    second = _second_best(f, effect)
    if second:
        return "rejected", second
    if gain <= 0:
        return "rejected", "alone it does not lower the error by more than its parameters are worth"
    if not plausible(f.problem, step.ranked):
        return (
            "rejected",
            f"it fits only with parameters that it cannot have: {find_effect(effect, 'effects').imitates}",
        )
    if step.certainty <= SURE and step.gain <= 0:
        return "rejected", "it lowers the error on the data that it was fitted to and raises it on unseen data"
    if final.effects:
        return "rejected", _than_the_proposal(f, effect, step)
    return "rejected", f"lowers the error on unseen data by {step.certainty:.1f} standard errors only"


def _than_the_proposal(f: Findings, effect: str, step: Step) -> str:
    """Return how an effect alone compares with all that is proposed."""
    final, named = f.final.ranked, _named(f.final.ranked.effects)
    values = {n: p.value for n, p in added_parameters(f, step.ranked, effect).items()}
    same = [n for n in find_effect(effect, "effects").simpler(values) if (n,) == final.effects]
    if same:
        return f"with these parameters it is nothing but {_named(same)}"
    worse, both = step.ranked.evidence - final.evidence, "it" if len(final.effects) == 1 else "them"
    nothing = f", nothing beside {both}" if _tried_beside(f, effect) else ""
    if worse < 0.0:
        return f"explains hardly more than {named}, with more parameters or on unseen data less{nothing}"
    return f"explains less than {named} (evidence lower by {worse:.0f}){nothing}"


def _tried_beside(f: Findings, effect: str) -> bool:
    """Tell whether an effect was tried beside all that is proposed."""
    return any(set(b.others) == set(f.final.ranked.effects) for b in f.beside.get(effect, ()))


def _second_best(f: Findings, effect: str) -> str:
    """Return what is to be said of an effect that takes much beside what was found first, but less than what was found
    then; nothing of others.
    """
    final = set(f.final.ranked.effects)
    for other in sorted(final):
        before = final - {other}
        mine, its = (
            max((b.share for b in f.beside.get(name, ()) if set(b.others) == before), default=0.0)
            for name in (effect, other)
        )
        if WORTH < mine < its - NEARLY:
            takes = f"beside {_named(sorted(before))} it takes {100 * mine:.0f} % of the squared error"
            both = "both" if len(final) == 2 else "all of them"
            nothing = f", and beside {both} nothing that counts" if _tried_beside(f, effect) else ""
            return f"{takes}, {_named([other])} {100 * its:.0f} %{nothing}"
    return ""


def _excited(f: Findings, step: Step) -> bool:
    """Tell whether the record would have shown the effect at ordinary size.

    The curvature of the objective says by how much -2 log likelihood would change.
    """
    fitted, base = step.ranked.fit, {c.name for c in f.steps[0].ranked.fit.candidate.coordinates}
    added = [i for i, c in enumerate(fitted.candidate.coordinates) if c.name not in base]
    linear = [i for i in added if not fitted.candidate.coordinates[i].log]
    if not added:
        return True
    diagonal = np.diag(fitted.hessian)
    if not linear:
        return bool(max(diagonal[i] for i in added) > 1.0)
    rest = [i for i in range(diagonal.size) if i not in added]
    best = 0.0
    for i in linear:
        keep = [*rest, i]
        covariance = np.linalg.pinv(fitted.hessian[np.ix_(keep, keep)], hermitian=True)
        best = max(best, ORDINARY**2 / max(covariance[-1, -1], 1e-300))
    return best > 25.0


def _not_excited(f: Findings, effect: str) -> str:
    model, ranges = f.problem.base, f.problem.ranges
    where = find_effect(effect, "effects").shows_at_large
    name = {"position": model.plant.position, "input": model.inputs[0]}.get(where, "")
    if name in ranges:
        low, high = ranges[name]
        return f"the {name} stayed within {low:.3g} to {high:.3g} {f.problem.units[name]}: beyond it nothing is known"
    size = f"{100 * ORDINARY:.0f} % of the driving {_drive(f.problem)}"
    return f"at {size} it would not stand out of the noise of this record"


# --------------------------------------------------------------------------- the model that comes out


def proposal(f: Findings) -> Model:
    """Return the base model with the named effects and all fitted values, sensors included."""
    found = f.final.ranked.fit
    model, values = found.fitted(), found.parameters()
    model = model.with_parameters({n: float(f"{model.value(n):.6g}") for n in values if not n.startswith("sensor_")})
    for name in f.final.ranked.sensors:
        kind, _, channel = name.partition(".")
        model = model.with_effect(kind, None, **{channel: float(f"{values[name]:.6g}")})
    return model


def yaml_of(model: Model, f: Findings) -> str:
    """Return the model file, with comments of where the fitted values came from."""
    found = f.final.ranked.fit
    fitted = estimates(found, [c.name for c in found.candidate.coordinates], f)
    sources = ", ".join(dict.fromkeys(Path(s.source).name for s in f.problem.segments))
    lines = [f"# Fitted to {sources}; what follows ± is the standard error."]
    for line in model.to_yaml().splitlines():
        match = re.match(r"( *)([\w.]+):", line)
        key = match.group(2) if match else ""
        names = [n for n in fitted if (n.partition(".")[0] if "." in n else "parameters") == key]
        lines += [f"{match.group(1)}# {_origin(n, fitted[n], f.problem.base)}" for n in names if match]
        lines.append(line)
    return "\n".join(lines) + "\n"


def _origin(name: str, p: Estimate, base: Model) -> str:
    was = given(base, name)
    before = [f"was {was:g}"] if was is not None and not p.note.startswith("was ") else []
    return "; ".join([f"{name}: fitted, {p}", *before, *([p.note] if p.note else [])])


def _experiments(ranking: Sequence[Entry]) -> tuple[str, ...]:
    """Return what to record so that ties are decided and what was not excited shows."""
    found = []
    for e in ranking:
        clause = find_effect(e.effect, "effects").experiment
        if clause and e.status == "ambiguous":
            found.append(f"to decide on {e.effect.replace('_', ' ')}: {clause}")
        elif clause and e.status == "not_excited":
            found.append(f"to see {e.effect.replace('_', ' ')}: {clause}")
    return tuple(found)


def _notes(f: Findings) -> tuple[str, ...]:
    notes = []
    for name, rho in zip(f.problem.channels, f.filter.rho, strict=True):
        if rho:
            notes.append(f"the noise of {name} is coloured (correlation {rho:.2f} from sample to sample)")
    return (*f.problem.notes, *f.unseen.notes, *notes, *_driven_note(f.problem), *_scale_note(f))


def _driven_note(problem: Problem) -> tuple[str, ...]:
    """Return that models were told apart by what they leave from one sample to the next, and why."""
    if not problem.driven:
        return ()
    name = problem.base.inputs[0]
    noise = f"{input_noise(problem.segments)[0]:.2g} {problem.units.get(name, '')}".rstrip()
    why = f"the motion is recorded so finely that noise of {noise} in the {name} moves it more than its own noise"
    return (f"{why}: models were told apart by what they leave from one sample to the next",)


def _scale_note(f: Findings) -> tuple[str, ...]:
    """Return what to check where all parameters that a wrong scale of the input multiplies moved far, and alike."""
    model, fitted = f.problem.base, f.final.ranked.fit
    pairs = zip(fitted.candidate.coordinates, fitted.theta, strict=True)
    moved = {k.name: (x - k.prior, k.spread) for k, x in pairs if k.log}
    names = [n for n in model.plant.scaled_by_effort if model.parameters[n]]
    if len(names) < 2 or not set(names) <= set(moved):
        return ()
    logs = [moved[n][0] for n in names]
    far = all(abs(moved[n][0]) > 3 * moved[n][1] for n in names)
    if not far or np.ptp(logs) > ALIKE:
        return ()
    scale = float(np.exp(np.mean(logs)))
    effort = f.problem.channels[0] if f.problem.scale.imposed else model.inputs[0]
    what = f"{_named(names)} come out at {scale:.2g} times their nominal values, beyond their tolerances"
    return (f"{what}: so they do if the {effort} that was recorded is {scale:.2g} times the true one",)


__all__ = ["add", "added_parameters", "describe", "diagnose", "refine"]
