"""A verdict in words: their numbers are those of the tables; what a step not taken would leave, and what shows that
more than the sensors' noise is noise all the same, are told as that.
"""

from __future__ import annotations

import numpy as np

from signlin_ros.comparison.scores import follows_nothing
from signlin_ros.diagnosis.blocks import MIN_DIVISOR
from signlin_ros.diagnosis.criteria import HALF
from signlin_ros.diagnosis.dataset import Dataset
from signlin_ros.diagnosis.evidence import Evidence
from signlin_ros.diagnosis.output_error import FittedModel
from signlin_ros.diagnosis.results import ParameterEstimate, listed
from signlin_ros.diagnosis.rows import force_left, force_percent, shown_percent
from signlin_ros.diagnosis.validation import freed
from signlin_ros.diagnosis.verdict import Verdict
from signlin_ros.diagnosis.wording import phrases
from signlin_ros.diagnosis.wording.reasons import REASONS
from signlin_ros.effects import EFFECTS, find_effect, kin_of
from signlin_ros.effects.base import SensorEffect, Shown
from signlin_ros.errors import joined
from signlin_ros.fitting.problem import Problem
from signlin_ros.model.numbers import declared
from signlin_ros.names import capitalised
from signlin_ros.par import gathered

NOTHING_MISSING = "Nothing is missing that this record could show"
LITTLE_MISSING = "What is missing is small, and no listed effect explains it"
LIKE_NOISE = "No listed effect shows to be missing, and what is left cannot be told from coloured noise"
MAX_TIMES_NOISE = 100
"""Times the sensors' noise above which the number tells no more."""
MAX_UNSURE_EFFECTS = 3
"""Most effects that are told where none is sure, the simplest."""
ONE_CYCLE = (
    "every swing of these records has the same stroke and pace: a force that goes with the speed and one that "
    "remembers the way look alike here; a record of another amplitude or frequency would tell them apart"
)
HELD_INPUTS = (
    "inputs are taken as held from their samples on; if these were measured, write `input_hold: centred` into the "
    "model file: then"
)
LEARN_HINT = "`signlin add learned_force` learns it as a curve"


def sentence(evidence: Evidence, verdict: Verdict) -> str:
    """Return the verdict in a few sentences, or what adding the effect that was asked for is worth."""
    if verdict.refused:
        return f"The record does not ask for {listed([verdict.selection.asked])}: {verdict.refused}."
    if verdict.selection.asked:
        what = falls(evidence, verdict, verdict.base, verdict.final)
        left = remainder(evidence, verdict) or (_structure(evidence, verdict) if verdict.reason else "")
        return f"With {listed([verdict.selection.asked])}, {what}.{left}"
    if verdict.reversed:
        return (
            f"With the sign of {verdict.reversed} reversed the model as it is follows this record much better: "
            "check that sign before anything else."
        )
    first = _first(verdict)
    inputs = _of_inputs(evidence, verdict)
    if verdict.label == "adequate":
        nothing = _how_little(evidence, verdict)
        return f"{first}{nothing}{_left_over(evidence, verdict)}.{_motion_left(evidence, verdict)}{inputs}"
    if verdict.label == "missing":
        what = falls(evidence, verdict, verdict.base, verdict.final)
        return f"{first}The model lacks {listed(verdict.names)}: {what}.{remainder(evidence, verdict)}{inputs}"
    return f"{first}{_unexplained(evidence, verdict)}"


def _how_little(evidence: Evidence, verdict: Verdict) -> str:
    """Return what an adequate model lacks: nothing, little, or much that looks like noise, as its numbers say."""
    final = verdict.final
    if evidence.near_any_noise(final) or not evidence.force_shows(final):
        return NOTHING_MISSING
    if not final.residual_is_noise:
        return LITTLE_MISSING
    large = (verdict.percent or 0.0) > evidence.criteria.missing_percent
    return LIKE_NOISE if large else NOTHING_MISSING


def _first(verdict: Verdict) -> str:
    """Return the sentence on base parameters far from nominal, which comes before all others; empty if none is."""
    if not verdict.far:
        return ""
    parts = [f"{n} {phrases.ends_off(x)}" for n, x in verdict.far.items()]
    part = (
        ", which holds a part of what is missing"
        if verdict.holds_a_part
        else ", and the same is found with it held there"
    )
    return f"Check this first: {joined(parts)}{part if verdict.label == 'missing' else ''}. "


def _unexplained(evidence: Evidence, verdict: Verdict) -> str:
    why, said = verdict.reason, REASONS[verdict.reason].said
    if why == "conflict":
        conflict = verdict.selection.conflict
        return f"The two estimates differ: {conflict}. Nothing is confirmed.{remainder(evidence, verdict)}"
    if why == "lost":
        return follows_nothing(verdict.lost)
    there = further(evidence.dataset) if why == "elsewhere" else ""
    if verdict.names:
        what = falls(evidence, verdict, verdict.base, verdict.final)
        changes = (
            f"{'rises' if verdict.beside_given < 0 else 'falls'} by {abs(verdict.beside_given):.1f} standard errors"
        )
        loops, rest = (
            (family_of(verdict.loop, verdict.changing), remainder(evidence, verdict)) if why == "loop" else ("", "")
        )
        ends = {"there": f": {there}" if there else ".", "loops": loops, "rest": rest}
        said = said.format(v=verdict, falls=what, changes=changes, **ends)
        part = f" {'explains' if len(verdict.names) == 1 else 'explain'} a part"
        known = f"{capitalised(listed(verdict.names))}{'' if why == 'worse' else part}"
        return known + (said or f": {what}.{remainder(evidence, verdict) or _structure(evidence, verdict)}")
    if why == "elsewhere":
        differs = there or "what differs?"
        left = _left_over(evidence, verdict)
        return f"The model follows the data it was fitted to, and not the unseen ones{left}: {differs}"
    rest = remainder(evidence, verdict)
    none = f"Something is missing that no listed effect explains{'' if rest else _left_over(evidence, verdict)}"
    return f"{_unsure(evidence, verdict) or none}.{rest}"


def family_of(effect: str, changing: str) -> str:
    """Return in words the laws a loop may follow, and whether its force is ``changing`` along the records."""
    kin = kin_of(effect)
    names = [n for n, other in EFFECTS.items() if (n == effect or n in kin) and other.states]
    laws = f" ({', '.join(listed([n]) for n in names)} are laws of it)"
    if changing.startswith("loop"):
        return f"{laws} whose force changes slowly along the record, as that of what degrades"
    return f"{laws}, and which loop it is cannot be told"


def further(dataset: Dataset) -> str:
    """Return which signal of validation data goes furthest beyond known ones, by half their amplitude or more, if
    any.
    """
    known, unseen = (_reaches(problem) for problem in (dataset.training, dataset.validation))
    found = {}
    for name in known.keys() & unseen.keys():
        (low, high), (least, most) = known[name], unseen[name]
        if high > low:
            found[name] = 2.0 * max(low - least, most - high) / (high - low)
    name = max(sorted(found), key=lambda n: found[n], default="")
    if not name or found[name] < HALF:
        return ""
    unit = dataset.training.unit_of(name)
    (least, most), (low, high) = unseen[name], known[name]
    return f"there {name} goes from {least:.3g} to {most:.3g} {unit}, in those from {low:.3g} to {high:.3g} {unit}."


def _reaches(problem: Problem) -> dict[str, tuple[float, float]]:
    """Return the least and the largest value of every input and channel of the records of a problem."""
    parts = [part.measured | dict(zip(part.inputs, part.u.T, strict=True)) for part in problem.parts]
    columns = {n: np.concatenate([part[n] for part in parts]) for n in parts[0] if all(n in part for part in parts)}
    return {n: (float(np.nanmin(x)), float(np.nanmax(x))) for n, x in columns.items()}


def _unsure(evidence: Evidence, verdict: Verdict) -> str:
    """Return which effects alone take most of what is missing away, of a force that is seen too, but not surely; or
    one that would leave but noise, and of which the records hold too little; or that they hold too little altogether.
    """
    motion, c, found = evidence.output_error, evidence.criteria, dict[str, float]()
    if whole := evidence.unidentified(verdict.final):
        name, why = next(iter(whole.items()))
        return phrases.not_told(name, why)
    for f in sorted(evidence.single_effect_fits, key=lambda f: f.n_parameters):
        g = motion.improvement(verdict.base, f)
        certainty = motion.t_ratio(verdict.base, f)
        part = evidence.share_left(evidence.force_mse(f))
        if evidence.force_shows(verdict.base) and (part is None or part > HALF):
            continue
        if g.mse_reduction > HALF and 0.0 < certainty < c.min_t and not g.worsens(c):
            found[f.effects[0]] = certainty
    if not found:
        final = verdict.final
        untested = not verdict.names and final.white and not final.residual_is_noise and evidence.near_noise(final)
        return phrases.UNTESTED if untested else ""
    names = list(found)[:MAX_UNSURE_EFFECTS]
    surely = phrases.change(max(found[n] for n in names), c.min_t, "at most " if len(names) > 1 else "")
    told = " or ".join(listed([n]) for n in names)
    return phrases.too_little(f"{told} would take most of it away", surely)


def falls(evidence: Evidence, verdict: Verdict, before: FittedModel, after: FittedModel) -> str:
    """Return by how much the errors on validation data fall from one model to another: the force, and the motion."""
    parts = shown_falls(evidence, verdict, before, after)
    return f"on validation data {joined(parts)}" if parts else f"validation data hardly show it{freed(before, after)}"


def shown_falls(evidence: Evidence, verdict: Verdict, before: FittedModel, after: FittedModel) -> list[str]:
    """Return what falls on validation data from one model to another, by as much as a table shows."""
    parts = []
    a, b = (
        shown_percent(evidence, f, force_left(evidence, f, verdict.final)) for f in (before, after)
    )  # what no row shows is not told
    if a is not None and b is not None and b < (1 - evidence.criteria.visible_change) * a:
        parts.append(f"the missing force falls from {a:.3g} % to {b:.3g} % {evidence.of_effort}")
    return _errors_fall(evidence, before, after, parts)


def _errors_fall(evidence: Evidence, before: FittedModel, after: FittedModel, parts: list[str]) -> list[str]:
    problem, horizon = evidence.dataset.training, evidence.dataset.horizon
    for name, first, last in zip(problem.channels, before.validation_rmse, after.validation_rmse, strict=True):
        if last < (1 - evidence.criteria.visible_change) * first:
            verb, unit = "" if parts else "falls ", problem.unit_of(name)
            what = f"the error of {name} over {horizon:.3g} s {verb}from {first:.3g} to {last:.3g} {unit}"
            parts = [*parts, what.rstrip()]
    return parts


def remainder(evidence: Evidence, verdict: Verdict) -> str:
    """Return a sentence on the residual in per cent of the effort, and on the curve that would take it away."""
    noise = evidence.force_noise_percent
    if verdict.names and verdict.imposed is not None:
        return f" Over {evidence.dataset.horizon:.3g} s, {verdict.imposed:.3g} % of the spread of the force is left."
    if verdict.names and verdict.percent is None:
        return _motion_left(evidence, verdict)
    if verdict.percent is None or verdict.percent <= evidence.criteria.min_force_over_noise * noise:
        return ""
    left, curve = f" What is left is {verdict.percent:.3g} % {evidence.of_effort}", verdict.flexible
    if curve.visible and curve.percent < (1 - evidence.criteria.visible_change) * verdict.percent:
        if curve.along:
            return f"{left}; with {curve.along}, {curve.percent:.3g} % would be left."
        return f"{left}; a flexible curve would leave {curve.percent:.3g} %: {LEARN_HINT}."
    if verdict.changing:
        return f"{left}; most of it goes with a {verdict.changing} that changes slowly along the record."
    if noise == 0.0:
        return f"{left}."
    times = f"over {MAX_TIMES_NOISE}" if verdict.percent > MAX_TIMES_NOISE * noise else f"{verdict.percent / noise:.3g}"
    return f"{left}, {times} times what the sensors' noise makes of it."


def _structure(evidence: Evidence, verdict: Verdict) -> str:
    """Return in which channel the residual has structure; empty where tests find none."""
    left = [one for one in verdict.final.residual_tests if one.structured]
    if not left:
        return ""
    one = max(left, key=lambda one: one.over_noise)
    moves = one.dependent > evidence.criteria.max_dependent_share
    return phrases.no_noise(one.channel, moves)


def _motion_left(evidence: Evidence, verdict: Verdict) -> str:
    """Return by how many times its sensor's noise the worst channel errs, where one is not near that noise."""
    if evidence.near_noise(verdict.final):
        return ""
    times = (
        verdict.final.validation_rmse / np.maximum(list(evidence.dataset.noise.values()), MIN_DIVISOR)
    ).tolist()  # as the rows have it
    most, name = max(zip(times, evidence.dataset.training.channels, strict=True))
    alone = ": no other listed effect takes that away" if verdict.alone else ""
    return f" Over {evidence.dataset.horizon:.3g} s, {name} errs by {most:.3g} times its sensor's noise{alone}."


def _of_inputs(evidence: Evidence, verdict: Verdict) -> str:
    """Return that what is left is what noise of the inputs makes of the motion, where that is what lets it pass."""
    problem = evidence.dataset.training
    if not problem.allows_for_input_noise or not verdict.final.white or evidence.near_noise(verdict.final):
        return ""
    units = (problem.unit_of(name) for name in problem.base.inputs)
    sizes = zip(problem.base.inputs, problem.input_noise.tolist(), units, strict=True)
    noisy = [f"the {name} ({size:.2g} {unit})" for name, size, unit in sizes if size]
    return f" The residual is white once noise of {joined(noisy)} is allowed for."


def _left_over(evidence: Evidence, verdict: Verdict) -> str:
    if verdict.percent is None:
        return ": the residual is noise" if verdict.final.white else ""
    noise = evidence.force_noise_percent
    left = f"the force that is left is {verdict.percent:.3g} % {evidence.of_effort}, the sensors' noise {noise:.3g} %"
    if verdict.label != "adequate" or verdict.percent <= evidence.force_noise_percent:
        return f": {left}"
    if evidence.near_noise(verdict.final):
        return f": the motion is followed to about its sensors' noise; {left}"
    return f": {left}{_unpredictable(verdict, verdict.percent)}"


def _unpredictable(verdict: Verdict, percent: float) -> str:
    """Return why more than the sensors' noise counts as noise: nothing that is known predicts it."""
    if verdict.final.residual_is_noise:
        share = max(0.0, *(one.dependent for one in verdict.final.residual_tests))
        return f"; {100 * share:.1g} % of what the motion lacks goes with position, velocity, input or time"
    curve = verdict.flexible.percent
    return f"; a flexible curve would leave {curve:.3g} %" if curve < percent else "; no flexible curve takes it away"


# -------------------------------------------------------------------- of one effect


def remarks(evidence: Evidence, verdict: Verdict) -> list[str]:
    """Return sentences on doubts that the records leave of the effects that are named."""
    found = [ONE_CYCLE] if verdict.names and evidence.dataset.repeats_one_cycle else []
    if evidence.contradicted:
        own = ", ".join(
            f"{n} {p.value:.3g} {p.unit}" for n, p in evidence.contradicted.parameters.items() if p.note != "held"
        )
        left = evidence.percent_of_effort(evidence.force_mse_as_written(evidence.contradicted)) or 0.0
        found.append(
            f"the motion alone would have base parameters that the forces contradict ({own}: {left:.3g} % of the "
            "effort is left); they are held at what the force tells of them"
        )
    found += _risen(evidence, verdict)
    if verdict.sampled:
        found.append(
            f"{HELD_INPUTS} {joined(_errors_fall(evidence, verdict.final, verdict.sampled, []))} on validation data"
        )
    for key, waves in evidence.output_error.few_waves(verdict.final).items():
        found.append(
            f"the records hold {waves:.1f} periods of {key}: that it goes on to repeat beyond where they have been is "
            "assumed; a record over a longer way would show it"
        )
    return found


def _risen(evidence: Evidence, verdict: Verdict) -> list[str]:
    """Return which row rises with what leaves but noise, and why that is nothing against it."""
    base, final, problem = evidence.base, verdict.final, evidence.dataset.training
    if not verdict.names or not evidence.output_error.settles(base, final):
        return []
    channel = evidence.rising_channel(base, final, evidence.criteria.max_rise_t)
    if not channel:
        return []
    k, unit = problem.channels.index(channel), problem.unit_of(channel)
    rise = f"from {base.validation_rmse[k]:.3g} to {final.validation_rmse[k]:.3g} {unit}"
    why = "what is left of the training data is noise, so that is chance, or of parameters that they hardly tell"
    return [f"with {listed(verdict.names)} the error of {channel} on validation data rises {rise}: {why}"]


def shown(evidence: Evidence, f: FittedModel, effect: str) -> str:
    """Return a sentence on an effect as a record shows it, with the values of its fit."""
    cls, plant = find_effect(effect, "effects"), f.model.plant
    if issubclass(cls, SensorEffect):
        (channel, p), *_ = own_parameters(f, effect).items()
        return cls.shown_on(channel, Shown(p.value, p.unit, p.std))
    key = [k for k, use in f.model.effects.items() if use.type == effect][-1]
    units, values = {n: p.unit for n, p in declared(f.model).items()}, dict[str, Shown]()
    for n, value in f.model.effects[key].parameters.items():
        known = f.parameters.get(f"{key}.{n}") or ParameterEstimate(value, None, units.get(f"{key}.{n}", ""))
        values[n] = Shown(value, known.unit, known.std)
    force = "force" if plant.force_unit == "N" and not evidence.dataset.training.turns else "torque"
    return cls.shown(gathered(values), force, plant.position, plant.velocity)


def own_parameters(f: FittedModel, effect: str) -> dict[str, ParameterEstimate]:
    """Return the parameters of a fit that are an effect's, by their names in it (a sensor's by its channel)."""
    keys = {effect, *(key for key, use in f.model.effects.items() if use.type == effect)}
    return {n.partition(".")[2]: p for n, p in f.parameters.items() if n.partition(".")[0] in keys}


def why_named(evidence: Evidence, verdict: Verdict, effect: str) -> str:
    """Return why an effect of the proposal is named: what it does, and what is lost without it."""
    hurt = falls(evidence, verdict, verdict.without[effect], verdict.final)
    return f"{shown(evidence, verdict.final, effect)}; {hurt}{', with it' if len(verdict.names) > 1 else ''}"


def why_not(evidence: Evidence, verdict: Verdict, f: FittedModel) -> str:
    """Return why an effect that was tried alone is not named."""
    if why := evidence.output_error.refusal(verdict.base, f):
        return f"on validation data {why}" if why.startswith("the error of") else why
    a, b = force_percent(evidence, verdict.base, verdict.final), force_percent(evidence, f, verdict.final)
    if a is not None and b is not None and b > a:
        return f"it leaves {b:.3g} % {evidence.of_effort}, the model as it is {a:.3g} %"
    if verdict.names:
        return f"{listed(verdict.names)} {'leaves' if len(verdict.names) == 1 else 'leave'} less"
    return REASONS[verdict.selection.untold].untold if verdict.selection.untold else "the estimates differ on it"


__all__ = ["falls", "own_parameters", "remainder", "remarks", "sentence", "shown", "why_named", "why_not"]
