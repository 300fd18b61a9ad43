"""What a judgement says: the `Diagnosis` with its ranking, ladder, parameters and words."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from signlin_ros.diagnosis import closed_loop, messages
from signlin_ros.diagnosis.discrimination import told, undecided
from signlin_ros.diagnosis.evidence import WHOLE_EFFORT
from signlin_ros.diagnosis.output_error import FittedModel
from signlin_ros.diagnosis.output_error.fitted import held
from signlin_ros.diagnosis.proposal import rounded, yaml_of
from signlin_ros.diagnosis.results import Diagnosis, ParameterEstimate, RankingEntry, listed
from signlin_ros.diagnosis.rivals import rivals
from signlin_ros.diagnosis.verdict import REASONS, Verdict
from signlin_ros.effects import EFFECTS, find_effect
from signlin_ros.errors import InputError


def summary_of(j: Verdict) -> Diagnosis:
    """Return the diagnosis that a judgement amounts to."""
    w, case = j.evidence, j.case
    ladder, ranking = tuple(w.row(f, j.left(f)) for f in j.steps), _ranking(j)
    model = rounded(j.final.model, j.final.parameters)
    return Diagnosis(
        verdict=j.verdict,
        sentence=" ".join(filter(None, (messages.sentence(j), told(w, j.final)))),
        base=_parameters(j, j.base),
        parameters=_parameters(j, j.final),
        ranking=ranking,
        ladder=ladder,
        model=model,
        range=dict(case.problem.ranges),
        noise=case.noise,
        experiments=_experiments(j, ranking),
        notes=(*case.problem.notes, *case.unseen.notes, *messages.remarks(j), *closed_loop.remarks(j)),
        yaml=yaml_of(model, j),
        given=w.first_rows().given,
        horizon=case.horizon,
        findings=j,
        rivals=rivals(j),
        given_model=case.model.to_yaml(),
    )


def _parameters(j: Verdict, f: FittedModel) -> dict[str, ParameterEstimate]:
    """Return the parameters of a fit; with those that are held at what the force tells."""
    return (held(j.motion.problem, f.model, f.parameters) if j.evidence.contradicted else {}) | f.parameters


# -------------------------------------------------------------------- ranking


def _ranking(j: Verdict) -> tuple[RankingEntry, ...]:
    """Return every effect that competed, what is proposed first, with its status and why; then what does not apply."""
    single, laws = {f.effects[0]: f for f in j.evidence.single}, j.evidence.laws
    ties = {e: _ties(j, e) for e in j.names}
    tied = {t: e for e, names in ties.items() for t in names}
    others, absent = list[RankingEntry](), list[RankingEntry]()
    for name in (n for n in EFFECTS if n not in j.names):
        if name in j.dropped:
            others.append(RankingEntry(name, "rejected", why=j.dropped[name]))
        elif name in single:
            others.append(_other(j, name, single[name]))
        elif name in laws:
            others.append(_by_force(j, name))
        elif not _applies(j, name):
            absent.append(RankingEntry(name, "not_applicable", why=f"does not apply to {j.case.model.plant.name}"))
    others = [_beside(e, tied[e.effect]) if e.effect in tied else e for e in others]
    levels = dict.fromkeys(tied, 0.0) | {name: f.level for name, f in single.items()}
    others.sort(key=lambda e: (e.status != "ambiguous", levels.get(e.effect, math.inf)))
    return (*(_named(j, e, ties[e]) for e in j.names), *others, *absent)


def _applies(j: Verdict, name: str) -> bool:
    try:
        return j.case.model.with_effect(name, "tried").states is not None  # tracing tells
    except InputError:
        return False


def _ties(j: Verdict, effect: str) -> tuple[str, ...]:
    """Return what is as good in the place of an effect, by force or motion, refused by neither, and leaves no more."""
    w, force, rest, found = j.evidence, j.evidence.force, set(j.names) - {effect}, set[str]()
    if force and set(force.effects) == set(j.names):
        found |= set(force.search.ties(force.fit, effect))
    for f in w.tried:
        if not (rest < set(f.effects) and len(f.effects) == len(j.names) and effect not in f.effects):
            continue
        if j.motion.refused(j.base, f):
            found -= set(f.effects)
        elif w.raises(j.final, f) or (w.left(f) is None and w.explains(j.final)):
            continue
        elif j.motion.as_good(j.final, f) and j.motion.refused(f, j.final):
            found |= set(f.effects) - rest
    return tuple(sorted(found - set(j.names)))


def _named(j: Verdict, effect: str, ties: tuple[str, ...]) -> RankingEntry:
    """Return the entry of an effect that is proposed."""
    once = j.unexplained == "once" and effect in j.remembers
    once |= j.unexplained == "loop" and effect == j.loop
    open_ones = [r.effects for r in undecided(j.evidence, j.final)]
    once |= any(effect not in effects for effects in open_ones)
    ties = tuple(sorted({*ties, *(n for effects in open_ones for n in effects if n not in j.names)}))
    status = "ambiguous" if once or any(not _richer(t, effect) for t in ties) else "confirmed"
    if j.refused or (j.unexplained and REASONS[j.unexplained].rejects):
        status = "rejected"
    own, why = messages.own_parameters(j.final, effect), messages.why_named(j, effect)
    return RankingEntry(effect, status, own, j.evidence.row(j.final, None).validation, ties, why)


def _richer(a: str, b: str) -> bool:
    """Tell whether a is a richer law of b's family: then b is named for being simpler, and that is no doubt."""
    first, second = (find_effect(n, "effects") for n in (a, b))
    return bool(first.family) and first.family == second.family


def _other(j: Verdict, name: str, f: FittedModel) -> RankingEntry:
    """Return the entry of an effect that was fitted out by itself."""
    beyond = find_effect(name, "effects").only_beyond and j.motion.refused(j.base, f)
    status, own = "not_excited" if beyond else "rejected", messages.own_parameters(f, name)
    return RankingEntry(name, status, own, j.evidence.row(f, None).validation, why=messages.why_not(j, f))


def _by_force(j: Verdict, name: str) -> RankingEntry:
    """Return the entry of an effect that only the equation-error estimate tried."""
    w, force = j.evidence, j.evidence.force
    assert force is not None  # noqa: S101  it tried the effect
    a, b = j.percent_of(j.base) or force.percent(force.search.base), force.percent(w.laws[name])
    summary_of = f"{b:.3g} %" if b <= WHOLE_EFFORT else "more than all"
    why = f"by the force it would leave {summary_of} {w.of_effort} on validation data, the model without it {a:.3g} %"
    unseen = find_effect(name, "effects").only_beyond and b > (1.0 - j.criteria.alike) * a
    return (
        RankingEntry(name, "not_excited", why=f"{why}{_beyond(j)}")
        if unseen
        else RankingEntry(name, "rejected", why=why)
    )


def _beside(e: RankingEntry, tied: str) -> RankingEntry:
    """Return the entry of what is as good as an effect that is named."""
    why, richer = f"as good on validation data as {listed([tied])}", _richer(e.effect, tied)
    status, why = ("rejected", f"{why}, which is the simpler law") if richer else ("ambiguous", why)
    return replace(e, status=status, indistinguishable_from=(tied,), why=why)


def _beyond(j: Verdict) -> str:
    """Return between which positions the records tell of what shows only beyond them."""
    problem, plant = j.case.problem, j.case.model.plant
    if plant.position not in problem.ranges:
        return ""
    unit = problem.shown(problem.units.get(plant.position, plant.position_unit))
    low, high = problem.ranges[plant.position]
    return f"; the records move from {low:.3g} to {high:.3g} {unit}: it may act beyond"


def _experiments(j: Verdict, ranking: Sequence[RankingEntry]) -> tuple[str, ...]:
    """Return what to record to decide between what ties, and to see what this record cannot show."""
    asked = {tie: "to decide on" for e in ranking if e.effect in j.names for tie in e.indistinguishable_from}
    asked |= {e.effect: "to see" for e in ranking if e.status == "not_excited" and e.effect not in asked}
    what = {n: find_effect(n, "effects").experiment for n in asked}
    found = tuple(f"{why} {listed([n])}: {what[n]}" for n, why in asked.items() if what[n])
    return (*found, *closed_loop.experiments(j))


__all__ = ["summary_of"]
