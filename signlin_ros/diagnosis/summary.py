"""The report of a verdict: the `Diagnosis` with its ranking, ladder, parameters and verdicts."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from operator import attrgetter

from signlin_ros.diagnosis.discrimination import Doubts, doubts_of
from signlin_ros.diagnosis.evidence import WHOLE_EFFORT, Evidence
from signlin_ros.diagnosis.findings import findings_of
from signlin_ros.diagnosis.output_error import FittedModel
from signlin_ros.diagnosis.output_error.fitted import held
from signlin_ros.diagnosis.proposal import rounded, yaml_of
from signlin_ros.diagnosis.results import Diagnosis, ParameterEstimate, RankingEntry
from signlin_ros.diagnosis.rivals import rivals
from signlin_ros.diagnosis.rows import first_rows, force_left, force_percent, row
from signlin_ros.diagnosis.verdict import Verdict
from signlin_ros.diagnosis.wording import closed_loops, phrases, verdicts
from signlin_ros.diagnosis.wording.planned_rivals import told as rivals_told
from signlin_ros.diagnosis.wording.reasons import REASONS
from signlin_ros.effects import EFFECTS, find_effect, kin_of
from signlin_ros.errors import InputError
from signlin_ros.fitting.settled import restored


def summary_of(evidence: Evidence, verdict: Verdict) -> Diagnosis:
    """Return the diagnosis that reports a verdict."""
    dataset, doubts = evidence.dataset, doubts_of(evidence, verdict.selection.rivals, verdict.final)
    ladder = tuple(row(evidence, f, force_left(evidence, f, verdict.final)) for f in verdict.steps)
    ranking = _ranking(evidence, verdict, doubts)
    model = rounded(restored(verdict.final.model, dataset.given), verdict.final.parameters)
    base, parameters = (_parameters(evidence, f) for f in (verdict.base, verdict.final))
    findings = findings_of(evidence, verdict, model, {*base, *parameters})
    return Diagnosis(
        verdict=verdict.label,
        sentence=" ".join(
            filter(
                None,
                (
                    verdicts.sentence(evidence, verdict),
                    rivals_told(evidence, verdict.selection.rivals, verdict.final, doubts),
                ),
            )
        ),
        base=base,
        parameters=parameters,
        ranking=ranking,
        ladder=ladder,
        model=model,
        range=dict(dataset.training.ranges),
        noise=dataset.noise,
        experiments=_experiments(evidence, verdict, ranking),
        notes=(
            *dataset.training.notes,
            *dataset.validation.notes,
            *verdicts.remarks(evidence, verdict),
            *closed_loops.remarks(evidence, verdict),
        ),
        yaml=yaml_of(model, parameters, findings),
        given=first_rows(evidence).given,
        horizon=dataset.horizon,
        findings=findings,
        rivals=rivals(evidence, verdict),
        given_model=restored(dataset.model, dataset.given).to_yaml(),
    )


def _parameters(evidence: Evidence, f: FittedModel) -> dict[str, ParameterEstimate]:
    """Return the parameters of a fit; with those that are held at what the force tells."""
    return (held(evidence.output_error.training, f.model, f.parameters) if evidence.contradicted else {}) | f.parameters


# -------------------------------------------------------------------- ranking


def _ranking(evidence: Evidence, verdict: Verdict, doubts: Doubts) -> tuple[RankingEntry, ...]:
    """Return a row for every effect: those of the proposal, the others by their validation error, what does not apply.

    Which effects have a row does not depend on the course of the search; numbers are those of each one's best fit.
    """
    single, laws = _fitted_alone(evidence), evidence.laws
    ties = {e: _ties(evidence, verdict, e) for e in verdict.names}
    tied = {t: e for e, names in ties.items() for t in names}
    others, untried, absent = list[RankingEntry](), list[RankingEntry](), list[RankingEntry]()
    for name in (n for n in EFFECTS if n not in verdict.names):
        if name in verdict.selection.dropped:
            others.append(RankingEntry(name, "rejected", why=verdict.selection.dropped[name]))
        elif name in single:
            others.append(_other(evidence, verdict, name, single[name]))
        elif name in laws:
            others.append(_by_force(evidence, verdict, name))
        elif name in evidence.output_error.candidates and not verdict.selection.asked:
            kind = others if name in tied else untried
            kind.append(RankingEntry(name, "rejected", why=_not_fitted(evidence, verdict, name)))
        elif not _applies(evidence, name):
            absent.append(RankingEntry(name, "not_applicable", why=phrases.not_applicable(evidence.dataset.plant.name)))
    others = [_beside(e, tied[e.effect]) if e.effect in tied else e for e in others]
    levels = dict.fromkeys(tied, 0.0) | {name: f.log_mse for name, f in single.items()}
    others.sort(key=lambda e: (e.status != "ambiguous", levels.get(e.effect, math.inf)))
    return (*(_named(evidence, verdict, e, ties[e], doubts) for e in verdict.names), *others, *untried, *absent)


def _fitted_alone(evidence: Evidence) -> dict[str, FittedModel]:
    """Return the best fit of every effect that was fitted by itself; a sensor's on the channel where it is best."""
    fits = [f for f in evidence.cache.best.values() if len(f.effects) == 1]
    return {f.effects[0]: f for f in sorted(fits, key=attrgetter("log_mse"), reverse=True)}


def _not_fitted(evidence: Evidence, verdict: Verdict, name: str) -> str:
    """Return why an effect that no force shows was not fitted to the end."""
    if name in evidence.cache.searched.get((), ()):
        return phrases.TOO_LITTLE_AT_FIRST
    if evidence.explains_to_noise(verdict.final):
        return phrases.not_fitted(verdict.names)
    return phrases.LED_NOWHERE


def _applies(evidence: Evidence, name: str) -> bool:
    try:
        return evidence.dataset.model.with_effect(name, "tried").states is not None  # tracing tells
    except InputError:
        return False


def _ties(evidence: Evidence, verdict: Verdict, effect: str) -> tuple[str, ...]:
    """Return effects that are as good in the place of one, by force or motion, refused by neither and not surely worse
    by the motion.
    """
    force, motion, rest = evidence.equation_error, evidence.output_error, set(verdict.names) - {effect}
    found = set[str]()
    if force and set(force.effects) == set(verdict.names):
        found |= set(force.ties[effect])
    for f in evidence.cache.weighed:
        if not (rest < set(f.effects) and len(f.effects) == len(verdict.names) and effect not in f.effects):
            continue
        if motion.refusal(verdict.base, f) or not motion.refusal(f, verdict.final):
            found -= set(f.effects)
        elif evidence.force_rises(verdict.final, f) or (
            not evidence.dataset.plant.motion_is_imposed()
            and evidence.force_mse(f) is None
            and evidence.explains_force(verdict.final)
        ):
            continue
        elif motion.as_good(verdict.final, f):
            found |= set(f.effects) - rest
    return tuple(sorted(found - set(verdict.names)))


def _named(evidence: Evidence, verdict: Verdict, effect: str, ties: tuple[str, ...], doubts: Doubts) -> RankingEntry:
    """Return the entry of an effect that is proposed."""
    doubted = verdict.reason == "once" and effect in verdict.final.remembers
    doubted |= verdict.reason == "loop" and effect == verdict.loop
    doubted |= doubts.of(effect)
    doubted |= not verdicts.shown_falls(evidence, verdict, verdict.without[effect], verdict.final)
    open_ones = [r.effects for r in (*doubts.undecided, *doubts.near)]
    ties = tuple(sorted({*ties, *(n for effects in open_ones for n in effects if n not in verdict.names)}))
    doubted |= any(t not in kin_of(effect) for t in ties)  # a richer law of its family is no doubt
    status = "ambiguous" if doubted else "confirmed"
    if verdict.refused or (verdict.reason and REASONS[verdict.reason].rejects):
        status = "rejected"
    own, why = verdicts.own_parameters(verdict.final, effect), verdicts.why_named(evidence, verdict, effect)
    return RankingEntry(effect, status, own, row(evidence, verdict.final, None).validation, ties, why)


def _other(evidence: Evidence, verdict: Verdict, name: str, f: FittedModel) -> RankingEntry:
    """Return the entry of an effect that was fitted out by itself."""
    beyond = find_effect(name, "effects").only_beyond and evidence.output_error.refusal(verdict.base, f)
    status, own = "not_excited" if beyond else "rejected", verdicts.own_parameters(f, name)
    return RankingEntry(
        name, status, own, row(evidence, f, None).validation, why=verdicts.why_not(evidence, verdict, f)
    )


def _by_force(evidence: Evidence, verdict: Verdict, name: str) -> RankingEntry:
    """Return the entry of an effect that only the equation-error estimate tried."""
    force = evidence.equation_error
    assert force is not None  # noqa: S101  it tried the effect
    a = force_percent(evidence, verdict.base, verdict.final) or force.percent(force.base)
    b = force.percent(evidence.laws[name])
    why = phrases.by_force(b, a, evidence.of_effort, WHOLE_EFFORT)
    unseen = find_effect(name, "effects").only_beyond and b > (1.0 - evidence.criteria.visible_change) * a
    return (
        RankingEntry(name, "not_excited", why=f"{why}{_beyond(evidence)}")
        if unseen
        else RankingEntry(name, "rejected", why=why, force=b if b <= WHOLE_EFFORT else None)
    )


def _beside(e: RankingEntry, tied: str) -> RankingEntry:
    """Return the entry of what is as good as an effect that is named."""
    richer = e.effect in kin_of(tied)  # then that is named for being simpler
    why = phrases.as_good(tied, richer)
    return replace(e, status="rejected" if richer else "ambiguous", indistinguishable_from=(tied,), why=why)


def _beyond(evidence: Evidence) -> str:
    """Return between which positions the records tell of what shows only beyond them."""
    problem, plant = evidence.dataset.training, evidence.dataset.plant
    if plant.position not in problem.ranges:
        return ""
    unit = problem.shown(problem.units.get(plant.position, plant.position_unit))
    low, high = problem.ranges[plant.position]
    return phrases.may_act_beyond(low, high, unit)


def _experiments(evidence: Evidence, verdict: Verdict, ranking: Sequence[RankingEntry]) -> tuple[str, ...]:
    """Return the experiments that would decide between ties, and show the effects that this record cannot."""
    asked = {tie: True for e in ranking if e.effect in verdict.names for tie in e.indistinguishable_from}
    asked |= {e.effect: False for e in ranking if e.status == "not_excited" and e.effect not in asked}
    what = {n: find_effect(n, "effects").experiment for n in asked}
    found = tuple(phrases.experiment(tie, n, what[n]) for n, tie in asked.items() if what[n])
    return (*found, *closed_loops.experiments(evidence))


__all__ = ["summary_of"]
