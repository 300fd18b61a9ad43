"""Model selection: the effects that the equation error and the output error both support.

`select_model` goes through these steps; each function returns a fitted model, or None where its condition fails.

| step | condition | the model after it |
|---|---|---|
| `_confirmed_by_simulation` | the equation error has laws; simulated, they lower the validation error | these laws |
| `_unless_angular` | it leaves a white residual | it, or one with an effect of an angle that is surely better |
| `_single_law_search` | it leaves more than noise | one law that leaves only noise by itself |
| `_with_unseen_effect` | the output error refused the laws | they, beside an effect that acts on no force |
| `OutputErrorEstimator.search` | none of these explains the force | the end of a forward search by simulation |
| `_resolved` | two models were found | the better one, or the base and why the estimates differ |
| `_released` | forces held the base; more than noise is left | a law beside a free base that leaves only noise |
| `smallest_as_good` | always | of what is as good, the fewest effects, then the fewest parameters |
| `single_effect_leaving_noise`, `better_option` | more than noise is left | a law by itself, or of one's family |
| `unidentified` | of a law that leaves but noise the records hold too little | the base: no other law is told for it |
| `Evidence.with_better_values` | always | the same effects, with parameters of the motion or of the force |
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import combinations, product
from typing import TYPE_CHECKING

import numpy as np

from signlin_ros.diagnosis.equation_error.estimate import EquationErrorResult
from signlin_ros.diagnosis.evidence import HALF, Evidence
from signlin_ros.diagnosis.family import FamilyChoice
from signlin_ros.diagnosis.output_error import FittedModel, OutputErrorEstimator
from signlin_ros.diagnosis.output_error.trials import completed, free_key
from signlin_ros.diagnosis.results import listed
from signlin_ros.diagnosis.single_laws import (
    explains_to_noise,
    fit_every_law,
    fit_families,
    needs_no_search,
    unidentified,
)
from signlin_ros.diagnosis.wording import phrases
from signlin_ros.effects import EFFECTS
from signlin_ros.errors import SignlinError

if TYPE_CHECKING:
    from signlin_ros.diagnosis.discrimination import RefittedRival


@dataclass(frozen=True, eq=False)
class Selection:
    """A model that both estimates support.

    ``chosen``: that model; ``conflict``: a sentence why the estimates differ, empty where they agree; ``asked``: the
    effect that `add` was asked for; ``untold``: where the base model took the place of a choice that validation data
    cannot decide on, the reason (a key of `REASONS`); ``dropped``: reasons by effect, of those that were chosen beside
    others and lower no error; ``rivals`` of a planned experiment, refitted.
    """

    chosen: FittedModel
    conflict: str = ""
    asked: str = ""
    untold: str = ""
    dropped: Mapping[str, str] = field(default_factory=dict)
    rivals: tuple[RefittedRival, ...] = ()


def select_model(evidence: Evidence) -> Selection:
    """Return the model that both estimates support; the steps are those of the table above."""
    if evidence.equation_error:  # fits by simulation start from what the force shows of each law, too
        starts = {
            n: evidence.equation_error.values(f, n) for n, f in evidence.laws.items() if np.any(f.theta[f.spans[n]])
        }
        evidence = replace(evidence, output_error=replace(evidence.output_error, starts=starts))
    final, conflict = _first_choice(evidence)
    final = smallest_as_good(evidence, final)
    conflict = conflict.format(listed(final.effects))  # `phrases.more_force` leaves their place open
    options = [] if needs_no_search(evidence, final) else fit_every_law(evidence, final)
    options += [] if explains_to_noise(evidence, final) else fit_families(evidence, final)
    options += [] if needs_no_search(evidence, final) else _released(evidence, final)
    final = smallest_as_good(evidence, final) if options else final
    other = single_effect_leaving_noise(evidence, final) or better_option(evidence, final, options)
    final = evidence.with_better_values(smallest_as_good(evidence, other) if other else final)
    if final.implausible or (not explains_to_noise(evidence, final) and unidentified(evidence)):
        return Selection(evidence.base, "" if other else conflict)
    return Selection(final, "" if other else conflict)


def _first_choice(evidence: Evidence) -> tuple[FittedModel, str]:
    """Return the first model that both estimates support, and why they differ (empty where they do not)."""
    base, force = evidence.base, evidence.equation_error
    first = _confirmed_by_simulation(evidence, force) if force and force.effects else None
    if first is not None and first.white:
        return _unless_angular(evidence, first), ""
    if first is not None and (whole := _single_law_search(evidence, first)):
        return whole, ""
    if first is None and evidence.cache.weighed:
        together = _with_unseen_effect(evidence, evidence.cache.weighed[0])
        if together is not None:
            return together, ""
    if first is None or not evidence.explains_force(first):
        path = evidence.output_error.search(
            evidence.criteria.max_effects, partial(_names_to_search, evidence), partial(_single_law_search, evidence)
        )
        evidence.cache.keep(*(f for step in path for f in step))
        return _resolved(evidence, [first] if first else [], path[-1][0])
    found = _best_extension(evidence, base, evidence.unseen_by_force, rival=first) or base
    beside = _best_extension(evidence, first, evidence.unseen_by_force)
    return _resolved(evidence, [f for f in (first, beside) if f], found)


def _single_law_search(evidence: Evidence, now: FittedModel) -> FittedModel | None:
    """Fit every law of the catalogue by itself, and return the one that leaves only noise; None where none does, or
    where a model ``now`` leaves no more.
    """
    if explains_to_noise(evidence, now):
        return None
    fit_every_law(evidence, now)
    return single_effect_leaving_noise(evidence, now)


def _unless_angular(evidence: Evidence, first: FittedModel) -> FittedModel:
    """Return ``first``, or a model with an effect of an angle where that leaves only noise and errs surely less.

    The equation error compares forces below a cut-off; there a weight looks like a cubic spring.
    """
    turning = {n for n in evidence.unseen_by_force if EFFECTS[n].angular}
    other = _best_extension(evidence, evidence.base, turning, rival=first) if turning else None
    better = (
        other
        and explains_to_noise(evidence, other)
        and not evidence.force_rises(first, other)
        and not evidence.output_error.refusal(first, other)
    )
    return other if other and better else first


def _names_to_search(evidence: Evidence, now: FittedModel) -> list[str] | None:
    """Return the effects that the forward search tries beside a model, None for all.

    Where the force residual is above the noise: effects that act on no force, waves, and the laws that lower the force
    residual. Where that residual is small and no law was chosen, these laws are left out. Where the model has an effect
    that acts on no force, as a late sensor, forces were read from signals as they are without it, and count no more.
    """
    force, share = evidence.equation_error, evidence.percent_of_effort(evidence.force_mse(evidence.base))
    if force is None or not evidence.force_shows(evidence.base) or set(now.effects) & evidence.unseen_by_force:
        return None
    small = share is not None and share < 100.0 * evidence.criteria.min_missing_share
    waves = {n for n, effect in EFFECTS.items() if effect.periodic}  # what passes its band is not all that there are
    names = evidence.unseen_by_force | waves | (set() if small and not force.effects else force.helpful)
    return sorted(names & evidence.output_error.candidates)


def _with_unseen_effect(evidence: Evidence, refused: FittedModel) -> FittedModel | None:
    """Return a refused model with an effect beside it that acts on no force, where the simulation needs both."""
    motion, both = evidence.output_error, _best_extension(evidence, refused, evidence.unseen_by_force)
    if both is None or motion.refusal(evidence.base, both):
        return None
    other = motion.fitted([n for n in both.effects if n not in refused.effects], both.model)
    evidence.cache.keep(other)
    return None if motion.refusal(other, both) else both


def _best_extension(
    evidence: Evidence, of: FittedModel, names: Iterable[str], rival: FittedModel | None = None
) -> FittedModel | None:
    """Return the simplest of the best extensions of a model by one effect, as good as a ``rival``; None without one."""
    if len(of.effects) >= evidence.criteria.max_effects:
        return None
    options = evidence.output_error.extensions(of, sorted(evidence.output_error.candidates.intersection(names)), rival)
    evidence.cache.keep(*options)
    return next(iter(evidence.output_error.as_good_as_best(of, options)), None)


def _resolved(evidence: Evidence, first: Sequence[FittedModel], second: FittedModel) -> tuple[FittedModel, str]:
    """Return one of the models of equation error (``first``) and output error (``second``), and why they differ."""
    base, force = evidence.base, evidence.equation_error
    if not first:
        if force is not None and force.effects and _contradicts_force(evidence, force, second):
            return base, _why_refused(evidence, force, second)
        if second.effects and evidence.force_rises(base, second):
            return base, phrases.more_force_than_base(second.effects)
        return second, ""
    now = first[0]
    for other in (*first[1:], second):
        if set(other.effects) != set(now.effects) and _surpasses(evidence, now, other):
            now = other
    g = evidence.output_error.improvement(now, second)
    if now is not second and g.t_ratio >= evidence.criteria.min_t and g.mse_reduction >= HALF and second.effects:
        return now, phrases.more_force(second.effects)
    return now, ""


def _contradicts_force(evidence: Evidence, force: EquationErrorResult, second: FittedModel) -> bool:
    """Tell whether a model explains neither motion nor force, where laws explain most of the force."""
    before, own = force.base.validation_mse, evidence.force_mse(second)
    explains = own is not None and float(np.mean(own)) < HALF * before
    return (
        evidence.force_shows(evidence.base)
        and not second.white
        and force.fit.validation_mse < HALF * before
        and not explains
    )


def _why_refused(evidence: Evidence, force: EquationErrorResult, second: FittedModel) -> str:
    """Return the sentence on both estimates where simulation refuses the laws that the force shows."""
    after, shown = (
        evidence.percent_of_effort(force.fit.validation_mse),
        evidence.percent_of_effort(evidence.force_mse(evidence.base)),
    )
    return phrases.motion_refuses(force.effects, after, shown, evidence.of_effort, second.effects)


def _surpasses(evidence: Evidence, now: FittedModel, other: FittedModel) -> bool:
    """Tell whether ``other`` replaces ``now``: no error rises, and it leaves only noise or errs surely less."""
    c, g = evidence.criteria, evidence.output_error.improvement(now, other)
    if (
        other.log_mse > now.log_mse
        or g.worsens(c.max_rise_t, c.visible_change)
        or evidence.rising_channel(now, other, c.tie_t)
        or evidence.force_rises(now, other)
    ):
        return False
    if other.residual_is_noise and evidence.residual_is_white(other) and not now.white:
        return True
    if g.t_ratio < c.min_t or not evidence.force_shows(now):
        return g.t_ratio >= c.min_t
    return set(other.effects) - set(now.effects) <= evidence.unseen_by_force or evidence.force_falls(now, other)


def _confirmed_by_simulation(evidence: Evidence, force: EquationErrorResult) -> FittedModel | None:
    """Return the laws of the equation error, fitted by simulation, with the better parameters; None where refused."""
    c, motion, choice = evidence.criteria, evidence.output_error, FamilyChoice(evidence, force)
    found = choice.simulated(force.fit)
    if found is None:
        return None
    stated = evidence.with_better_values(found) if found.insignificant(c) else found
    known = stated is not found and motion.improvement(evidence.base, stated).t_ratio >= c.min_t
    found = stated if known else found
    g = motion.improvement(evidence.base, found)
    if g.t_ratio < (0.0 if evidence.explains_force(found) else c.min_validation_t) or g.worsens(
        c.max_rise_t, c.visible_change
    ):
        return None
    if not known and found.insignificant(c):
        plain = motion.simplified(found)
        evidence.cache.keep(*plain)
        sound = motion.as_good_as_best(evidence.base, plain)
        if not sound:
            return None
        found = sound[0]
    return choice.in_all_band(choice.in_family(found))


# -------------------------------------------------------------------- how many effects


def smallest_as_good(evidence: Evidence, final: FittedModel) -> FittedModel:
    """Return the model with the fewest effects, then the fewest parameters, of those as good as ``final``.

    An effect that acts on no force replaces none that does, unless it leaves a residual that was tested as noise.
    """
    motion, several = evidence.output_error, len(final.effects) > 1
    options = [
        f
        for f in evidence.cache.weighed
        if (len(f.effects), f.n_parameters) < (len(final.effects), final.n_parameters) and f.effects
    ]
    options += _pairs_merged(motion, final) if several else []
    for name in final.effects if several else ():
        with contextlib.suppress(SignlinError):
            options.append(motion.fitted([n for n in final.effects if n != name], final.model))
        motion.progress.check()
    evidence.cache.keep(*options)
    shown = evidence.force_mse(final) is not None
    good = [f for f in options if not motion.refusal(evidence.base, f) and motion.as_good(final, f)]
    good = [f for f in good if motion.refusal(f, final) and not evidence.force_rises(final, f)]
    good = [
        f
        for f in good
        if not shown or evidence.force_mse(f) is not None or (f.residual_is_noise and evidence.residual_is_white(f))
    ]
    return min(good, key=lambda f: (len(f.effects), f.n_parameters, f.log_mse), default=final)


def _released(evidence: Evidence, final: FittedModel) -> list[FittedModel]:
    """Return the best single effect, and ``final``, with base parameters free that were held at what forces tell of
    them, where that leaves noise: forces were read beside the law that they found first.
    """
    if evidence.unheld is None:
        return []
    best = min(evidence.single_effect_fits, key=lambda f: f.log_mse, default=final)
    fits = [evidence.unheld.fitted(f.effects, f.model) for f in (best, final) if f.effects]
    found = [f for f in fits if explains_to_noise(evidence, f)]
    evidence.cache.best.update({f.kind: f for f in found})
    evidence.cache.keep(*found)
    return found


def single_effect_leaving_noise(evidence: Evidence, final: FittedModel) -> FittedModel | None:
    """Return the simplest single effect that leaves only noise, where ``final`` leaves more; None without one."""
    if explains_to_noise(evidence, final):
        return None
    motion, base = evidence.output_error, evidence.base
    whole = [f for f in map(motion.best, evidence.single_effect_fits) if explains_to_noise(evidence, f)]
    whole = [f for f in whole if not motion.refusal(base, f) and not evidence.force_rises(base, f)]
    return _simplest(evidence, whole)


def better_option(evidence: Evidence, final: FittedModel, options: Sequence[FittedModel]) -> FittedModel | None:
    """Return the simplest option of no more effects than ``final`` that errs surely less; None without one."""
    motion, base, force = evidence.output_error, evidence.base, evidence.equation_error
    good = [f for f in map(motion.best, options) if len(f.effects) <= max(len(final.effects), 1)]
    good = [f for f in good if set(f.effects) != set(final.effects) and not motion.refusal(base, f)]
    good = [f for f in good if not _alike_and_no_simpler(evidence, final, f)]
    good = [
        f
        for f in good
        if not evidence.force_rises(base, f) and not motion.refusal(final, f) and _surpasses(evidence, final, f)
    ]
    return _simplest(
        evidence, [f for f in good if force is None or final.effects or not _contradicts_force(evidence, force, f)]
    )


def _alike_and_no_simpler(evidence: Evidence, now: FittedModel, other: FittedModel) -> bool:
    """Tell whether ``other`` errs by what a table shows for ``now``, with no fewer effects and parameters: differences
    that no table shows may be of one sign in every block, as where both are the same law.
    """
    alike = evidence.output_error.improvement(now, other).falls_by_less(evidence.criteria.visible_change)
    simpler = (len(other.effects), other.n_parameters) < (len(now.effects), now.n_parameters)
    return alike and not simpler and (now.white or not other.white)


def _simplest(evidence: Evidence, options: Sequence[FittedModel]) -> FittedModel | None:
    """Return the simplest of the options that are as good as the best one; None where there is no option."""
    best = min(options, key=lambda f: f.log_mse, default=None)
    as_good = [f for f in options if best and evidence.output_error.as_good(best, f)]
    return min(as_good, key=lambda f: (len(f.effects), f.n_parameters, f.log_mse), default=None)


def _pairs_merged(motion: OutputErrorEstimator, final: FittedModel) -> list[FittedModel]:
    """Return models in which one effect replaces two whose sum it is (a loop: presliding and a spring)."""
    found, uses = list[FittedModel](), {use.type: use.parameters for use in final.model.effects.values()}
    for pair, (name, effect) in product(combinations(final.effects, 2), EFFECTS.items()):
        others = {n: uses.get(n, {}) for n in pair}
        values = effect.instead(others) if all(others.values()) and name not in final.effects else {}
        if not values:
            continue
        model, kept = final.model, tuple(n for n in final.effects if n not in pair)
        for key in [k for k, use in model.effects.items() if use.type in pair]:
            model = model.without_effect(key)
        with contextlib.suppress(SignlinError):
            model = model.with_effect(name, free_key(model, name), **completed(motion.training, effect, values))
            found.append(motion.fitted((*kept, name), model))
        with contextlib.suppress(SignlinError):
            found += motion.extensions(motion.fitted(kept, final.model), [name])
        motion.progress.check()
    return [f for f in found if len(f.effects) < len(final.effects)]


__all__ = ["Selection", "select_model", "single_effect_leaving_noise", "smallest_as_good"]
