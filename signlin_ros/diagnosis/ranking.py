"""The status of every effect that competed, and the reason in words."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from signlin_ros.diagnosis.findings import Findings, Step
from signlin_ros.diagnosis.parameters import added_parameters
from signlin_ros.diagnosis.problem import Problem
from signlin_ros.diagnosis.rank import Ranked, evidence_of
from signlin_ros.diagnosis.refusals import plausible, sound
from signlin_ros.diagnosis.results import Entry, Estimate, Scores
from signlin_ros.diagnosis.runs import scores
from signlin_ros.diagnosis.search import CERTAIN, SIMPLE, SURE, TIE
from signlin_ros.effects import find_effect
from signlin_ros.effects.base import SensorEffect, Shown
from signlin_ros.errors import joined

Array = NDArray[np.float64]

PARTLY = 0.4
"""Least share of the missing motion that an effect explains which is named though structure remains."""
WORTH, NEARLY = 0.3, 0.05
"""Share of the squared error that a rival must take beside what was found before, to be spoken of as one, and how much
more what was found must take."""
FREED = (
    "without it known parameters are far from their values, and the error on unseen data differs by no more than their "
    "uncertainty makes"
)
"""What is said of an effect that is named for that, not for the error."""
ORDINARY = 0.1
"""An effect is ordinary if its force is this share of the driving force: what a record should be able to show."""


def ranking_of(f: Findings, kind: str, noise: Array, level: Sequence[int], partly: float | None) -> tuple[Entry, ...]:
    """Return every effect that competed, what is proposed first, with its status and why; then what does not apply.

    ``partly``: the share that the proposal explains where the verdict is "unexplained", else None.
    """
    final = f.final.ranked
    best: dict[str, Step] = {}
    for s in f.singles:
        best.setdefault(s.ranked.label, s)
    rivals = {e: rivals_of(f, e) for e in final.effects}
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
            status = "rejected" if too_little(f, partly) else status
            left = 100 * (1 - partly)
            why += f"; but {f'{left:.0f}' if left > 10 else f'{left:.2g}'} % of the missing motion remains unexplained"
        if not f.beyond_doubt:
            status, why = "rejected", f"the record does not ask for it: {why}"
    elif any(effect in names for names in rivals.values()) and not (partly is not None and too_little(f, partly)):
        owner = next(e for e, names in rivals.items() if effect in names)
        status, tied = "ambiguous", (owner, *(n for n in rivals[owner] if n != effect))
        why = f"explains the record as well as {owner}: {sentence_of(effect, f.problem, parameters)}"
    else:
        status, why = _why_not(f, effect, step)
    return Entry(effect, status, parameters, validation, tied, why, gain, step.certainty)


def rivals_of(f: Findings, effect: str) -> list[str]:
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


def _instead_of(f: Findings, effect: str, rivals: dict[str, list[str]]) -> Ranked | None:
    """Return the proposal with an effect in place of the one that it ties with, if that was fitted."""
    final = set(f.final.ranked.effects)
    sets = [(final - {owner}) | {effect} for owner, names in rivals.items() if effect in names]
    return min((r for r in f.pairs if set(r.effects) in sets), key=evidence_of, default=None)


def too_little(f: Findings, partly: float | None) -> bool:
    """Tell whether what was added leaves most of what is missing unexplained; ``partly``: the share that it explains
    where the verdict is "unexplained", else None.
    """
    return partly is not None and (partly < PARTLY or f.final.certainty < CERTAIN)


def _why_named(f: Findings, effect: str, parameters: dict[str, Estimate], tied: tuple[str, ...]) -> str:
    step = next(s for s in f.steps if effect in s.ranked.effects)
    text = sentence_of(effect, f.problem, parameters)
    text += f"; {change(step) if step.gain > 0 or step is not f.final or not f.beyond_doubt else FREED}"
    if tied:
        text += f"; {listed(tied)} would explain this record as well"
    return text


def change(step: Step) -> str:
    """Return in words what a step does to the error on unseen data."""
    way = "falls" if step.certainty > 0 else "rises"
    return f"the error on unseen data {way} by {min(abs(step.certainty), 99):.1f} standard errors"


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
    final, named = f.final.ranked, listed(f.final.ranked.effects)
    values = {n: p.value for n, p in added_parameters(f, step.ranked, effect).items()}
    same = [n for n in find_effect(effect, "effects").simpler(values) if (n,) == final.effects]
    if same:
        return f"with these parameters it is nothing but {listed(same)}"
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
            takes = f"beside {listed(sorted(before))} it takes {100 * mine:.0f} % of the squared error"
            both = "both" if len(final) == 2 else "all of them"
            nothing = f", and beside {both} nothing that counts" if _tried_beside(f, effect) else ""
            return f"{takes}, {listed([other])} {100 * its:.0f} %{nothing}"
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
    size = f"{100 * ORDINARY:.0f} % of the driving {driving(f.problem)}"
    return f"at {size} it would not stand out of the noise of this record"


def experiments(ranking: Sequence[Entry]) -> tuple[str, ...]:
    """Return what to record so that ties are decided and what was not excited shows."""
    found = []
    for e in ranking:
        clause = find_effect(e.effect, "effects").experiment
        if clause and e.status == "ambiguous":
            found.append(f"to decide on {e.effect.replace('_', ' ')}: {clause}")
        elif clause and e.status == "not_excited":
            found.append(f"to see {e.effect.replace('_', ' ')}: {clause}")
    return tuple(found)


def sentence_of(effect: str, problem: Problem, parameters: dict[str, Estimate]) -> str:
    """Return what the record shows of an effect, as a sentence."""
    plant = problem.base.plant
    cls = find_effect(effect, "effects")
    if issubclass(cls, SensorEffect):
        name, found = next(iter(parameters.items()))
        return cls.shown_on(name.partition(".")[2], Shown(found.value, found.unit, found.std))
    values = {n.rpartition(".")[2]: Shown(p.value, p.unit, p.std) for n, p in parameters.items()}
    return cls.shown(values, driving(problem), plant.position, plant.velocity)


def driving(problem: Problem) -> str:
    """Return the word for what drives the plant."""
    return "torque" if problem.rotary or problem.base.plant.force_unit == "N·m" else "force"


def listed(names: Sequence[str]) -> str:
    """Return the names of effects in words: "a, b and c"."""
    return joined([n.replace("_", " ") for n in names])


__all__ = ["change", "driving", "experiments", "listed", "ranking_of", "rivals_of", "sentence_of", "too_little"]
