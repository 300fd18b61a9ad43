"""Model selection: the effects that the equation error and the output error both support.

`select_model` goes through these steps; each function returns a fitted model, or None where its condition fails.

| step | condition | the model after it |
|---|---|---|
| `_confirmed_by_simulation` | the equation error has laws; simulated, they lower the validation error | these laws |
| `_unless_angular` | it leaves a white residual | it, or one with an effect of an angle that is surely better |
| `search_single_laws` | it leaves more than noise | one law that leaves only noise by itself |
| `_with_unseen_effect` | the output error refused the laws | they, beside an effect that acts on no force |
| `OutputErrorEstimator.search` | none of these explains the force | the end of a forward search by simulation |
| `preferred` | two models were found | the better one, or the base and why the estimates differ |
| `reduced` | always | of what is as good, the fewest effects, then the fewest parameters |
| `fit_alternatives` | more than noise is left, or of several laws | other laws in its place are fitted, to be weighed |
| `sufficient_law`, `better_option` | more than noise is left | a law by itself, or of one's family |
| `Evidence.with_better_values` | always | the same effects, with parameters of the motion or of the force |
| `Evidence.unidentified` | of a law that leaves but noise the records hold too little | the base: no other is told |
| `fit_sensor_errors` | the motion is imposed | the same; what ties with its laws is known |
| `fit_ties` | forces do not tell a law from another | the same; what the motion says of the other is known |
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import combinations, product
from typing import TYPE_CHECKING

import numpy as np

from signlin_ros.diagnosis.equation_error.estimate import EquationErrorResult
from signlin_ros.diagnosis.evidence import Evidence
from signlin_ros.diagnosis.family import FamilyChoice
from signlin_ros.diagnosis.output_error import FittedModel, OutputErrorEstimator
from signlin_ros.diagnosis.output_error.trials import completed, free_key
from signlin_ros.diagnosis.preference import (
    better_option,
    names_to_search,
    preferred,
    smallest_as_good,
    sufficient_law,
)
from signlin_ros.diagnosis.results import listed
from signlin_ros.diagnosis.single_laws import fit_alternatives, fit_sensor_errors, fit_ties, search_single_laws
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
    proposal, conflict = _first_choice(evidence)
    proposal = reduced(evidence, proposal)
    conflict = conflict.format(listed(proposal.effects))  # `phrases.more_force` leaves their place open
    options = fit_alternatives(evidence, proposal)
    proposal = reduced(evidence, proposal) if options else proposal
    other = sufficient_law(evidence, proposal) or better_option(evidence, proposal, options)
    proposal = reduced(evidence, other) if other else proposal
    proposal = evidence.with_better_values(proposal)
    if proposal.implausible or (not evidence.explains_to_noise(proposal) and evidence.unidentified(proposal)):
        proposal = evidence.base
    fit_sensor_errors(evidence, proposal)
    fit_ties(evidence, proposal)
    return Selection(proposal, "" if other else conflict)


def _first_choice(evidence: Evidence) -> tuple[FittedModel, str]:
    """Return the first model that both estimates support, and why they differ (empty where they do not)."""
    base, force = evidence.base, evidence.equation_error
    proposal = _confirmed_by_simulation(evidence, force) if force and force.effects else None
    if proposal is not None and proposal.white:
        return _unless_angular(evidence, proposal), ""
    if proposal is not None and (other := search_single_laws(evidence, proposal)):
        return other, ""
    if proposal is None and evidence.cache.weighed:  # the laws that were refused were the first to be weighed
        refused = evidence.cache.weighed[0]
        other = _with_unseen_effect(evidence, refused)
        if other is not None:
            return other, ""
    if proposal is None or not evidence.explains_force(proposal):
        path = evidence.output_error.search(
            evidence.criteria.max_effects, partial(names_to_search, evidence), partial(search_single_laws, evidence)
        )
        evidence.cache.keep(*(f for step in path for f in step))
        return preferred(evidence, [proposal] if proposal else [], path[-1][0])
    other = _best_extension(evidence, base, evidence.unseen_by_force, rival=proposal)
    more = _best_extension(evidence, proposal, evidence.unseen_by_force)
    return preferred(evidence, [f for f in (proposal, more) if f], other or base)


def _unless_angular(evidence: Evidence, proposal: FittedModel) -> FittedModel:
    """Return a proposal, or a model with an effect of an angle where that leaves only noise and errs surely less.

    The equation error compares forces below a cut-off; there a weight looks like a cubic spring.
    """
    names = [name for name in evidence.unseen_by_force if EFFECTS[name].angular]
    other = _best_extension(evidence, evidence.base, names, rival=proposal) if names else None
    if other is None or not evidence.explains_to_noise(other) or evidence.force_rises(proposal, other):
        return proposal
    return proposal if evidence.output_error.refusal(proposal, other) else other


def _with_unseen_effect(evidence: Evidence, refused: FittedModel) -> FittedModel | None:
    """Return a refused model with an effect beside it that acts on no force, where the simulation needs both."""
    motion, more = evidence.output_error, _best_extension(evidence, refused, evidence.unseen_by_force)
    if more is None or motion.refusal(evidence.base, more):
        return None
    other = motion.fitted([name for name in more.effects if name not in refused.effects], more.model)
    evidence.cache.keep(other)
    return None if motion.refusal(other, more) else more


def _best_extension(
    evidence: Evidence, of: FittedModel, names: Iterable[str], rival: FittedModel | None = None
) -> FittedModel | None:
    """Return the simplest of the best extensions of a model by one effect, as good as a ``rival``; None without one."""
    if len(of.effects) >= evidence.criteria.max_effects:
        return None
    options = evidence.output_error.extensions(of, sorted(evidence.output_error.candidates.intersection(names)), rival)
    evidence.cache.keep(*options)
    return next(iter(evidence.output_error.as_good_as_best(of, options)), None)


def _confirmed_by_simulation(evidence: Evidence, force: EquationErrorResult) -> FittedModel | None:
    """Return the laws of the equation error, fitted by simulation, with the better parameters; None where refused. One
    that the simulation makes something of that cannot be gives way to the best set without it.
    """
    while force.effects:
        choice = FamilyChoice(evidence, force)
        proposal = choice.simulated(force.fit)
        found = _confirmed(choice, proposal) if proposal else None
        if found is not None or proposal is None or not proposal.implausible:
            return found
        force = force.without({proposal.added[key].type for key in proposal.implausible})
    return None


def _confirmed(choice: FamilyChoice, proposal: FittedModel) -> FittedModel | None:
    """Return a set of laws that was fitted by simulation, with the better parameters; None where it is refused."""
    evidence, criteria, motion = choice.evidence, choice.evidence.criteria, choice.evidence.output_error
    proposal = choice.of_ties(proposal)
    other = evidence.with_better_values(proposal) if proposal.insignificant(criteria) else proposal
    stated = other is not proposal and motion.improvement(evidence.base, other).t_ratio >= criteria.min_t
    proposal = other if stated else proposal
    gain = motion.improvement(evidence.base, proposal)
    least = 0.0 if evidence.explains_force(proposal) else criteria.min_validation_t
    if gain.t_ratio < least or gain.worsens(criteria) or motion.unresolved(proposal):
        return None
    if not stated and proposal.insignificant(criteria):
        options = motion.simplified(proposal)
        evidence.cache.keep(*options)
        options = motion.as_good_as_best(evidence.base, options)
        if not options:
            return None
        proposal = options[0]
    return choice.in_all_band(choice.in_family(proposal))


# -------------------------------------------------------------------- how many effects


def reduced(evidence: Evidence, proposal: FittedModel) -> FittedModel:
    """Return the model with the fewest effects, then the fewest parameters, of those as good as a proposal: of what was
    weighed before, and of it with two effects merged or with one left out.
    """
    motion, several = evidence.output_error, len(proposal.effects) > 1
    options = [f for f in evidence.cache.weighed if f.effects and f.size < proposal.size]
    options += _pairs_merged(motion, proposal) if several else []
    for name in proposal.effects if several else ():
        with contextlib.suppress(SignlinError):
            options.append(motion.fitted([n for n in proposal.effects if n != name], proposal.model))
        motion.progress.check()
    evidence.cache.keep(*options)
    return smallest_as_good(evidence, proposal, options)


def _pairs_merged(motion: OutputErrorEstimator, final: FittedModel) -> list[FittedModel]:
    """Return models in which one effect replaces two whose sum it is (a loop: presliding and a spring)."""
    found, uses = list[FittedModel](), {use.type: use.parameters for use in final.model.effects.values()}
    for pair, (name, effect) in product(combinations(final.effects, 2), EFFECTS.items()):
        others = {n: uses.get(n, {}) for n in pair}
        values = effect.instead(others) if all(others.values()) and name not in final.effects else {}
        if not values:
            continue
        kept = tuple(n for n in final.effects if n not in pair)
        model = final.model.without_effect(*final.model.keys_of(*pair))
        with contextlib.suppress(SignlinError):
            model = model.with_effect(name, free_key(model, name), **completed(motion.training, effect, values))
            found.append(motion.fitted((*kept, name), model))
        with contextlib.suppress(SignlinError):
            found += motion.extensions(motion.fitted(kept, final.model), [name])
        motion.progress.check()
    return [f for f in found if len(f.effects) < len(final.effects)]


__all__ = ["Selection", "reduced", "select_model"]
