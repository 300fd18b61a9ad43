"""`diagnose`, `add` and `refine`: from what a search found to a verdict in words, a ladder and a model file."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from signlin_ros.diagnosis.data import as_list
from signlin_ros.diagnosis.derived import position_alone
from signlin_ros.diagnosis.disturbance import Disturbance
from signlin_ros.diagnosis.findings import NEEDED, Findings, sooner_or_later, structured
from signlin_ros.diagnosis.parameters import estimates
from signlin_ros.diagnosis.problem import Problem, driven_by_changes, driven_by_inputs
from signlin_ros.diagnosis.proposal import proposal, yaml_of
from signlin_ros.diagnosis.ranking import (
    PARTLY,
    change,
    driving,
    experiments,
    listed,
    ranking_of,
    rivals_of,
    too_little,
)
from signlin_ros.diagnosis.refusals import plausible
from signlin_ros.diagnosis.results import Diagnosis, Rung, Scores
from signlin_ros.diagnosis.runs import best_level, kind_of_score, scores
from signlin_ros.diagnosis.scores import follows_nothing, unfollowed
from signlin_ros.diagnosis.search import DEPTH, EXPLAINED, FURTHER, SURE, Progress, search
from signlin_ros.diagnosis.varying import Varying, unit_of
from signlin_ros.effects import find_effect
from signlin_ros.effects.base import SensorEffect
from signlin_ros.model import Model
from signlin_ros.records import ModelData

Array = NDArray[np.float64]

SEEN = 0.1
"""Excess over the noise, in squares, from which on something is missing on unseen data."""
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
another. A wave of so many periods is no such term; one of fewer is, where it leaves more than `ELSEWHERE`."""
DRIVEN = 0.99
"""Least share that must be explained where what is left is what noise in the input would leave: so is what is left of
a law outside the list that a listed one imitates by 97 or 98 %. Not of one effect where the record of the input shows
that noise."""
SHOWS_ELSEWHERE = (
    "elsewhere its error is {:.2g} times the noise: what is missing shows only there; fit it to that record too."
)
NOT_LISTED = "The residual has structure that no listed effect explains on data that the fit did not see."
TOLD = 0.02
"""Least size of what moves a machine at random, as a share of the driving force, that is told: coloured noise of
sensors that was not wholly recognised came to 0.3 and 0.8 %."""
DRIFTING = 100.0
"""A drift of a sensor that is less likely than a force by less than this in -2 log likelihood is told beside it: models
bend to either."""
WORSE = 1.2
"""Times the error of the model as it is that a proposal may leave when left alone."""
ALIKE = 0.2
"""Largest difference of the logarithms of factors that are called the same."""
WHOLE = 0.9995
"""A share from which on no digits are told."""


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
        why = findings.declined.get(effect, change(findings.final))
        return replace(found, sentence=f"{worth}: {why}.{rest}")
    return replace(found, sentence=f"{worth} on data that the fit did not see, {sure}.{rest}")


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
    the inputs for what moves the state, if that matters, or inputs that act sooner or later than the record tells; or
    on the position alone, if it is fine: a model that explains it explains its derivative.
    """
    known, unseen = as_list(data), _or_none(validation)

    def one(driven: Callable[[Problem], Problem | None] | None) -> Diagnosis:
        return describe(search(model, known, unseen, jobs, progress, depth, only, driven), whole=only is not None)

    first = one(None)
    f = first.findings
    if first.verdict != "unexplained" or f.reversed or f.along:
        return first
    second = one(driven_by_inputs) if driven_by_inputs(f.problem) else first
    if second.verdict == "unexplained" and sooner_or_later(f.problem, f.final.ranked.fit):
        third = one(driven_by_changes)
        g = third.findings
        second = third if not g.structured and sooner_or_later(g.problem, g.final.ranked.fit) else second
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


def describe(f: Findings, whole: bool = False) -> Diagnosis:
    """Return the diagnosis that follows from what a search found; what explains too little is not proposed, unless the
    ``whole`` path is wanted: nothing at all, or what explains only a part of what the first effect leaves, where that
    is enough. Of several effects together this is not said: they make many another law.
    """
    f = f if whole or not _faint(f) else f.first(1)
    kind = kind_of_score(f.problem)
    level = [best_level(f.unseen, f.steps[0].ranked.fit)] if kind == "windowed" else []
    told = _told(f, kind, level)
    if told.verdict == "unexplained" and not whole and len(f.steps) > 2 and len(f.steps[1].ranked.effects) == 1:
        first = _told(_first_alone(f), kind, level)
        told = first if first.verdict == "missing" else told
    f, ladder, verdict, explained, rest = told
    problem, unseen, noise = f.problem, f.unseen_noise, f.noise
    partly = explained if verdict == "unexplained" else None
    ranking = ranking_of(f, kind, unseen, level, partly)
    proposed = f if whole or not too_little(f, partly) else replace(f, steps=f.steps[:1])
    ladder, model, final = ladder[: len(proposed.steps)], proposal(proposed), proposed.final.ranked
    lost = [follows_nothing(names) for names in [_unfollowed(ladder[-1])] if names and verdict == "unexplained"]
    base = f.steps[0].ranked.fit
    names = [c.name for c in final.fit.candidate.coordinates]
    return Diagnosis(
        verdict=verdict,
        sentence=" ".join([*lost, _sentence(f, verdict, explained, rest)]),
        base=estimates(base, [c.name for c in base.candidate.coordinates], f),
        base_validation=ladder[0].validation,
        parameters=estimates(final.fit, names, f),
        ranking=ranking,
        ladder=ladder,
        model=model,
        range=dict(problem.ranges),
        noise=dict(zip(problem.channels, noise.tolist(), strict=True)),
        experiments=experiments(ranking),
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
    verdict = "unexplained" if verdict == "adequate" and _unfollowed(ladder[-1]) else verdict
    return _Told(f, ladder, verdict, explained, rest)


def _unfollowed(rung: Rung) -> list[str]:
    """Return the channels that a model follows neither on the data that it was fitted to nor on unseen data."""
    seen = unfollowed(rung.validation.channels)
    return [name for name in unfollowed(rung.estimation.channels) if name in seen]


def _first_alone(f: Findings) -> Findings:
    """Return the same with the first step only; why what comes after is not proposed is among what is declined."""
    first = f.first(2)
    known = first.final.ranked.effects
    why = {
        e: f"beside {listed(known)} it explains {100 * max(s.share, 0.0):.0f} % only of what is left, which is of "
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


def _explained(f: Findings) -> float:
    """Return the share of the missing motion on unseen data that the proposal explains.

    Where a proposal leaves nothing on the data that it was fitted to, or what noise in the input leaves, unseen motion
    that is lost for once, or wanders, is also followed with the middle gain. Nothing is explained by what leaves
    structure there and gains nothing here, where nothing is missing that unseen data show.
    """
    share = _share(f, f.held_out)
    if f.unaccounted:
        return 0.0 if f.final.certainty < SURE and not _shows(f) else share
    return max(share, _share(f, f.followed))


def _shows(f: Findings) -> bool:
    """Tell whether unseen data show at all that something is missing."""
    return any(bool((_excess(f, both[0]) > SEEN).any()) for both in (f.held_out, f.followed))


def _excess(f: Findings, left: Sequence[Array]) -> Array:
    """Return by what share of the noise what a model leaves of unseen data exceeds it, in squares, by channel (ny)."""
    return np.asarray(np.nanmean(np.concatenate(left) ** 2, axis=0) / f.unseen_noise**2 - 1.0)


def _share(f: Findings, both: tuple[tuple[Array, ...], tuple[Array, ...]]) -> float:
    before, after = _excess(f, both[0]), np.maximum(_excess(f, both[1]), 0.0)
    weight = (before > SEEN) & _told_by(f)
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
        return "unexplained" if f.unaccounted or f.along or _elsewhere(f, explained, rest) else "adequate"
    if f.along or _elsewhere(f, explained, rest):
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
    leave noise alone may be what they are called. So may a wave of which the record shows a period or two.

    The weight of an arm is no such curve, nor is a wave of many periods.
    """
    problem, r, curves, waves = f.problem, f.final.ranked.fit, 0, 0
    low, high = problem.stretch
    values, model = r.parameters(), r.candidate.model
    for key in (k for k in r.candidate.label if k in model.effects):
        kind = find_effect(model.effects[key].type, "effects")
        weight = kind.name == "gravity_load" and driving(problem) == "torque"
        seen = [values[f"{key}.{n}"] * (high - low) / (2 * np.pi) for n in kind.periodic[:1]]
        few = kind.shaped and not weight and all(periods < PERIODS for periods in seen)
        curves, waves = curves + few, waves + (few and bool(seen))
    if waves and f.unaccounted and rest > ELSEWHERE:
        return True
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
        beyond = f.driven_by_noise and (len(f.final.ranked.effects) > 1 or not f.noise_is_shown)
        return DRIVEN if beyond else EXPLAINED
    if f.driven_by_noise and rest <= ELSEWHERE:
        return DRIVEN
    return NEARLY_ALL[0] if f.driven_by_noise or 1.0 + rest < DETAIL else NEARLY_ALL[1]


def _rest(f: Findings) -> float:
    """Return by what share of the noise the error of the proposal exceeds it on unseen data, in the worst channel."""
    last = np.concatenate(f.held_out[1])
    return float(np.max(np.sqrt(np.nanmean(last**2, axis=0)) / f.unseen_noise)) - 1.0


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
    share = f"{_percent(explained)} of the missing motion is explained on data that the fit did not see"
    if not _shows(f):
        share = "data that the fit did not see hardly show that it is missing, and show no harm"
    return f"The model lacks {_either(f, effects)}: {share}.{rest}"


def _unexplained(f: Findings, explained: float, over: float) -> str:
    if f.reversed:
        return (
            f"With the sign of {f.reversed} reversed the model as it is follows this record much better: "
            "check that sign before anything else."
        )
    effects = f.final.ranked.effects
    share = f"{listed(effects)} {'explains' if len(effects) == 1 else 'explain'}" if effects else ""
    before = (
        f"{share[:1].upper()}{share[1:]} {_percent(explained)} of the missing motion on data that the fit did not see"
    )
    worth = bool(effects) and explained >= 0.01
    if f.varying:
        varies = f"{f.varying.what} varies along the way, which no listed effect does"
        return f"{f'{before}, but {varies}' if worth else varies.capitalize()}: {_waves(f, f.varying)}."
    if effects and explained == 0.0:
        return NOT_LISTED
    imitated = _imitated(f, before, over)
    if imitated:
        return imitated
    if _elsewhere(f, explained, over):
        known = f"{share} what is missing" if effects and f.beyond_doubt else "nothing is missing"
        return f"{known[0].upper()}{known[1:]} where the model was fitted, but {SHOWS_ELSEWHERE.format(1.0 + over)}"
    if effects and not f.unaccounted:
        only = f"{share} only {_percent(explained)} of the missing motion on data that the fit did not see"
        return f"{only[0].upper()}{only[1:]}; {_noise_in_input(f)}."
    rest = f"{before}; what remains has structure that no listed effect explains." if worth else NOT_LISTED
    if f.at_random and f.at_random.force > TOLD * f.problem.scale.force:
        return f"{rest} {_wandering(f, f.at_random)}"
    return rest


def _imitated(f: Findings, before: str, over: float) -> str:
    """Return in words what effects stand for that explain a part (``before``); empty where nothing is known of that."""
    effects = f.final.ranked.effects
    if effects and _outdone(f):
        found = f.singles[0].ranked.label
        more = f"{found.replace('_', ' ')} explains more with parameters that it cannot have"
        return f"{before}; {more}: {find_effect(found, 'effects').imitates}."
    if _of_another_shape(f, over):
        left = f"{1.0 + over:.3g} times the noise" if over > 0.0 else "structure"
        leave, they = ("leaves", "it stands") if len(effects) == 1 else ("leave", "they stand")
        return f"{before}, and {leave} {left}: {they} for one force over the position, of a shape that is not listed."
    return ""


def _waves(f: Findings, found: Varying) -> str:
    """Return in words how friction or inertia varies with the position."""
    unit = f.problem.shown(f.problem.base.plant.position_unit)
    turning = unit == "rad" and found.order >= 1.0
    waves = f"{found.order:.3g} waves a turn" if turning else f"a wave every {2 * np.pi / found.order:.3g} {unit}"
    return f"by ±{found.amplitude:.2g} {unit_of(f.problem, found.what)}, {waves}"


def _wandering(f: Findings, found: Disturbance) -> str:
    """Return in words what moves a model, where nothing that is known of the motion predicts it."""
    if found.rather > NEEDED:
        return f"It looks like a drift of the sensor of {found.drifting}: no force would leave that."
    name, unit = driving(f.problem), f.problem.shown(f.problem.base.plant.force_unit)
    last = f", lasting about {found.lasts:.2g} s at a time," if found.lasts > f.problem.scale.step else ""
    sensor = f"a drift of the sensor of {found.drifting}, " if found.rather > -DRIFTING else ""
    return (
        f"It looks like a {name} of about {found.force:.2g} {unit}{last} that no simple function of position, velocity "
        f"and input predicts: a load that was not recorded, {sensor}or a law that is not listed."
    )


def _noise_in_input(f: Findings) -> str:
    return f"what is left looks like noise in the {f.problem.base.inputs[0] if f.in_input else driving(f.problem)}"


def _either(f: Findings, effects: Sequence[str]) -> str:
    """Return effects in words, each with what could as well stand in its place."""
    rivals = [rivals_of(f, e) for e in effects]
    whole = [e if not r else f"{e} (or {', '.join(r)})" for e, r in zip(effects, rivals, strict=True)]
    return listed(whole)


def _percent(share: float) -> str:
    """Return a share in percent, with as many digits as what it lacks to the whole needs; no record tells the whole."""
    if share >= WHOLE:
        return "more than 99.9 %"
    digits = max(int(np.ceil(-np.log10(100 * (1.0 - share)))), 0)
    return f"{100 * share:.{digits}f} %"


def _notes(f: Findings) -> tuple[str, ...]:
    notes = []
    for name, rho in zip(f.problem.channels, f.filter.rho, strict=True):
        if rho:
            notes.append(f"the noise of {name} is coloured (correlation {rho:.2f} from sample to sample)")
    if f.varying and not f.along:
        notes.append(f"{f.varying.what} varies a little along the way: {_waves(f, f.varying)}")
    return (*f.problem.notes, *f.unseen.notes, *notes, *_driven_note(f.problem), *_scale_note(f))


def _driven_note(problem: Problem) -> tuple[str, ...]:
    """Return that models were told apart by what they leave from one sample to the next, and why."""
    if not problem.driven:
        return ()
    name, told = problem.base.inputs[0], "models were told apart by what they leave from one sample to the next"
    if problem.levels[0].moved:
        return (f"the {name} acts sooner or later than the record tells, by a part of a step that differs: {told}",)
    noise = f"{problem.input_noise[0]:.2g} {problem.units.get(name, '')}".rstrip()
    why = f"the motion is recorded so finely that noise of {noise} in the {name} moves it more than its own noise"
    return (f"{why}: {told}",)


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
    what = f"{listed(names)} come out at {scale:.2g} times their nominal values, beyond their tolerances"
    return (f"{what}: so they do if the {effort} that was recorded is {scale:.2g} times the true one",)


__all__ = ["add", "describe", "diagnose", "refine"]
