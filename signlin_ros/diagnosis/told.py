"""What a judgement says: the `Diagnosis` with its ranking, ladder, parameters and words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

from signlin_ros.diagnosis import words
from signlin_ros.diagnosis.agreement import Agreed
from signlin_ros.diagnosis.cycles import one_cycle
from signlin_ros.diagnosis.first_rows import Rows
from signlin_ros.diagnosis.force.regression import Fit
from signlin_ros.diagnosis.judgement import Judgement
from signlin_ros.diagnosis.measures import of_effort
from signlin_ros.diagnosis.motion import Fitted
from signlin_ros.diagnosis.proposal import rounded, yaml_of
from signlin_ros.diagnosis.results import Diagnosis, Entry, Estimate
from signlin_ros.effects import EFFECTS, find_effect
from signlin_ros.errors import SignlinError
from signlin_ros.fitting.problem import Problem


@dataclass(frozen=True, eq=False)
class Findings:
    """The fits behind a diagnosis, for pictures and files."""

    judgement: Judgement

    @property
    def agreed(self) -> Agreed:
        """What both witnesses stand for."""
        return self.judgement.agreed

    @property
    def problem(self) -> Problem:
        """The records that were fitted to."""
        return self.agreed.motion.problem

    @property
    def unseen(self) -> Problem:
        """The records that were not."""
        return self.agreed.motion.unseen

    @cached_property
    def estimates(self) -> dict[str, Estimate]:
        """The parameters of the proposal."""
        return self.judgement.final.parameters


def told(j: Judgement, asked: str = "") -> Diagnosis:
    """Return the diagnosis that a judgement amounts to; ``asked``: the effect that `add` was asked for."""
    found, motion, rows = Findings(j), j.agreed.motion, Rows(j.agreed.motion, j.agreed.force)
    ladder, ranking = tuple(rows.of(f, j.agreed.percent(f)) for f in j.steps), _ranking(j, asked, rows)
    model = rounded(j.final.model, j.final.parameters)
    sentence = words.sentence(j) if not asked else _added(j, asked)
    return Diagnosis(
        verdict=_verdict(j, asked),
        sentence=sentence,
        base=j.agreed.base.parameters,
        base_validation=ladder[0].validation,
        parameters=j.final.parameters,
        ranking=ranking,
        ladder=ladder,
        model=model,
        range=dict(motion.problem.ranges),
        noise=rows.noise,
        experiments=_experiments(j, ranking),
        notes=(*motion.problem.notes, *motion.unseen.notes, *_repeated(j)),
        yaml=yaml_of(model, found),
        given=rows.as_it_is(motion.given),
        horizon=j.horizon,
        remainder=words.remainder(j).strip(),
        findings=found,
    )


def _repeated(j: Judgement) -> list[str]:
    """Return the note on what a motion that repeats one cycle cannot tell of the effects that are named."""
    note = one_cycle(j.case.model, (*j.case.known, *j.case.unseen)) if j.names else ""
    return [note] if note else []


def _refused(j: Judgement, asked: str) -> str:
    """Return why the records do not ask for what `add` was asked for; empty where they do."""
    return j.agreed.motion.refused(j.agreed.base, j.final) if asked else ""


def _verdict(j: Judgement, asked: str) -> str:
    """Return the verdict; that on the model as it is where what was asked for is worth nothing."""
    if not _refused(j, asked):
        return j.verdict
    base = j.agreed.base
    return replace(j, agreed=replace(j.agreed, final=base), final=base, steps=(base,)).verdict


def _added(j: Judgement, effect: str) -> str:
    """Return what adding an effect is worth."""
    name, why = effect.replace("_", " "), _refused(j, effect)
    what = words.falls(j, j.agreed.base, j.final)
    if why:
        return f"The record does not ask for {name}: {why}."
    return f"With {name}, {what}.{words.remainder(j)}"


# -------------------------------------------------------------------- ranking


def _ranking(j: Judgement, asked: str, rows: Rows) -> tuple[Entry, ...]:
    """Return every effect that competed, what is proposed first, with its status and why; then what does not apply."""
    single = {f.effects[0]: f for f in j.agreed.tried if len(f.effects) == 1}
    ties = {e: _ties(j, e) for e in j.names}
    entries = [_named(j, e, ties[e], asked, rows) for e in j.names]
    tied = {t: e for e, names in ties.items() for t in names}
    rest = [n for n in EFFECTS if n not in j.names and (n in single or n in _forces(j))]
    others = [_other(j, n, single.get(n), tied.get(n, ""), rows) for n in rest]
    others.sort(key=lambda e: (e.status != "ambiguous", e.evidence))
    absent = [Entry(n, "not_applicable", {}, None, (), f"does not apply to {j.case.model.plant.name}")
              for n in EFFECTS if n not in j.names and n not in rest and not _applies(j, n)]  # fmt: skip
    return (*entries, *others, *absent)


def _forces(j: Judgement) -> dict[str, Fit]:
    force = j.agreed.force
    return {next(iter(n)): f for n, f in force.search.models.items() if len(n) == 1} if force else {}


def _applies(j: Judgement, name: str) -> bool:
    try:
        j.case.model.with_effect(name, "tried").states  # noqa: B018  tracing tells
    except SignlinError:
        return False
    return True


def _ties(j: Judgement, effect: str) -> tuple[str, ...]:
    """Return what could as well stand in the place of an effect, by the force or by the motion, and is refused by
    neither: a richer law whose own parameter is unknown is none.
    """
    force, rest, motion = j.agreed.force, set(j.names) - {effect}, j.agreed.motion
    found = set()
    if force and set(force.effects) == set(j.names):
        found |= set(force.search.ties(force.fit, effect))
    for f in j.agreed.tried:
        if not (rest < set(f.effects) and len(f.effects) == len(j.names) and effect not in f.effects):
            continue
        if motion.refused(j.agreed.base, f):
            found -= set(f.effects)
        elif motion.gain(f, j.final).certainty < j.criteria.tie:
            found |= set(f.effects) - rest
    return tuple(sorted(found - set(j.names)))


def _named(j: Judgement, effect: str, ties: tuple[str, ...], asked: str, rows: Rows) -> Entry:
    own = words.own_parameters(j.final, effect)
    plain = [t for t in ties if not _richer(t, effect)]
    once = j.unexplained == "once" and effect in j.remembers
    status = "ambiguous" if plain or once else "confirmed"
    if j.unexplained in ("conflict", "worse", "given", "far", "reversed") or _refused(j, asked):
        status = "rejected"
    before = j.without(effect)
    g = j.agreed.motion.gain(before, j.final)
    scores = rows.of(j.final, None).validation
    return Entry(effect, status, own, scores, ties, words.why_named(j, effect), j.final.level, g.certainty)


def _richer(a: str, b: str) -> bool:
    """Tell whether a is a richer law of b's family: then b is named for being simpler, and that is no doubt."""
    first, second = (find_effect(n, "effects") for n in (a, b))
    return bool(first.family) and first.family == second.family


def _other(j: Judgement, name: str, f: Fitted | None, tied: str, rows: Rows) -> Entry:
    effect, tie = find_effect(name, "effects"), (tied,) if tied else ()
    if f is None:
        return _by_force(j, name, tie)
    own = words.own_parameters(f, name)
    scores = rows.of(f, None).validation
    why = f"as good on unseen data as {tied.replace('_', ' ')}" if tied else words.why_not(j, f)
    if tied and not _richer(name, tied):
        return Entry(name, "ambiguous", own, scores, tie, why, f.level)
    status = "not_excited" if effect.only_beyond and j.agreed.motion.refused(j.agreed.base, f) else "rejected"
    why += ", which is the simpler law" if tied else ""
    return Entry(name, status, own, scores, tie, why, f.level)


def _by_force(j: Judgement, name: str, tie: tuple[str, ...]) -> Entry:
    """Return the entry of an effect that only the force witness tried."""
    force, fit = j.agreed.force, _forces(j)[name]
    assert force is not None  # noqa: S101  it tried the effect
    a, b = j.agreed.percent(j.agreed.base) or force.percent(force.search.base), force.percent(fit)
    why = f"alone it leaves {b:.3g} % {of_effort(force)} on unseen data, the model without it {a:.3g} %"
    effect = find_effect(name, "effects")
    unseen = effect.only_beyond and b > (1.0 - j.criteria.alike) * a
    return Entry(
        name,
        "not_excited" if unseen else "rejected",
        {},
        None,
        tie,
        f"{why}{_beyond(j) if unseen else ''}",
        float("inf") if not tie else 0.0,
    )


def _beyond(j: Judgement) -> str:
    """Return between which positions the records tell of what shows only beyond them."""
    problem, name = j.agreed.motion.problem, j.agreed.motion.problem.base.plant.position
    if name not in problem.ranges:
        return ""
    unit = problem.shown(problem.units.get(name, problem.base.plant.position_unit))
    low, high = problem.ranges[name]
    return f"; the records move from {low:.3g} to {high:.3g} {unit}: it may act beyond"


def _experiments(j: Judgement, ranking: Sequence[Entry]) -> tuple[str, ...]:
    """Return what to record to decide between what ties, and to see what this record cannot show."""
    found: dict[str, Any] = {}
    for tie in (tie for e in ranking if e.effect in j.names for tie in e.indistinguishable_from):
        what = find_effect(tie, "effects").experiment
        if what:
            found[tie] = f"to decide on {tie.replace('_', ' ')}: {what}"
    for name in (e.effect for e in ranking if e.status == "not_excited"):
        what = find_effect(name, "effects").experiment
        if what:
            found.setdefault(name, f"to see {name.replace('_', ' ')}: {what}")
    return tuple(found.values())


__all__ = ["Findings", "told"]
