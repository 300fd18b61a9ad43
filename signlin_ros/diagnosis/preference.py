"""Which of some fitted models both estimates prefer. Nothing is fitted here: these functions read `Evidence`."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from signlin_ros.diagnosis.criteria import HALF
from signlin_ros.diagnosis.equation_error.estimate import EquationErrorResult
from signlin_ros.diagnosis.evidence import Evidence
from signlin_ros.diagnosis.output_error import FittedModel
from signlin_ros.diagnosis.wording import phrases
from signlin_ros.effects import EFFECTS


def names_to_search(evidence: Evidence, proposal: FittedModel) -> list[str] | None:
    """Return the effects that the forward search tries beside a model, None for all.

    Where the force residual is above the noise: effects that act on no force, waves, and the laws that lower the force
    residual. Where that residual is small and no law was chosen, these laws are left out. Where the model has an effect
    that acts on no force, as a late sensor, forces were read from signals as they are without it, and count no more.
    """
    force, share = evidence.equation_error, evidence.percent_of_effort(evidence.force_mse(evidence.base))
    if force is None or not evidence.force_shows(evidence.base) or set(proposal.effects) & evidence.unseen_by_force:
        return None
    small = share is not None and share < evidence.criteria.missing_percent
    waves = {n for n, effect in EFFECTS.items() if effect.periodic}  # what passes its band is not all that there are
    names = evidence.unseen_by_force | waves | (set() if small and not force.effects else force.helpful)
    return sorted(names & evidence.output_error.candidates)


def preferred(evidence: Evidence, by_force: Sequence[FittedModel], by_motion: FittedModel) -> tuple[FittedModel, str]:
    """Return one of the models of the equation error and of the output error, and why they differ (empty if not)."""
    base, force = evidence.base, evidence.equation_error
    if not by_force:
        if force is not None and force.effects and contradicts_force(evidence, force, by_motion):
            after = evidence.percent_of_effort(force.fit.validation_mse)
            before, unit = evidence.percent_of_effort(evidence.force_mse(base)), evidence.of_effort
            return base, phrases.motion_refuses(force.effects, after, before, unit, by_motion.effects, force.changed())
        if by_motion.effects and evidence.force_rises(base, by_motion):
            return base, phrases.more_force_than_base(by_motion.effects)
        return by_motion, ""
    proposal = by_force[0]
    for other in (*by_force[1:], by_motion):
        if set(other.effects) != set(proposal.effects) and surpasses(evidence, proposal, other):
            proposal = other
    g = evidence.output_error.improvement(proposal, by_motion)
    surely = g.t_ratio >= evidence.criteria.min_t and g.mse_reduction >= HALF
    if proposal is not by_motion and surely and by_motion.effects:
        return proposal, phrases.more_force(by_motion.effects)
    return proposal, ""


def contradicts_force(evidence: Evidence, force: EquationErrorResult, model: FittedModel) -> bool:
    """Tell whether a model explains neither motion nor force, where laws explain most of the force."""
    left, half = evidence.force_mse(model), HALF * force.base.validation_mse
    explains = left is not None and float(np.mean(left)) < half
    found = evidence.force_shows(evidence.base) and force.fit.validation_mse < half
    return found and not model.white and not explains


def surpasses(evidence: Evidence, proposal: FittedModel, other: FittedModel) -> bool:
    """Tell whether ``other`` replaces the proposal: no error rises, and it leaves only noise or errs surely less."""
    c, g = evidence.criteria, evidence.output_error.improvement(proposal, other)
    if (
        other.log_mse > proposal.log_mse
        or g.worsens(c)
        or evidence.rising_channel(proposal, other, c.tie_t)
        or evidence.force_rises(proposal, other)
    ):
        return False
    if other.residual_is_noise and evidence.residual_is_white(other) and not proposal.white:
        return True
    if g.t_ratio < c.min_t or not evidence.force_shows(proposal):
        return g.t_ratio >= c.min_t
    more = set(other.effects) - set(proposal.effects)
    return more <= evidence.unseen_by_force or evidence.force_falls(proposal, other)


def sufficient_law(evidence: Evidence, proposal: FittedModel) -> FittedModel | None:
    """Return the simplest single effect that leaves only noise, where the proposal leaves more; None without one. What
    the proposal surely halves is no noise, whatever tests of it say.
    """
    if evidence.explains_to_noise(proposal):
        return None
    motion, base = evidence.output_error, evidence.base
    options = [f for f in map(motion.best, evidence.single_effect_fits) if evidence.explains_to_noise(f)]
    options = [f for f in options if not _surely_halves(evidence, f, proposal)]
    return simplest(evidence, [f for f in options if not motion.refusal(base, f) and not evidence.force_rises(base, f)])


def _surely_halves(evidence: Evidence, before: FittedModel, after: FittedModel) -> bool:
    """Tell whether a model surely errs less on validation data than another, by half of a channel's squared error."""
    g = evidence.output_error.improvement(before, after)
    return g.t_ratio >= evidence.criteria.min_t and bool(np.min(g.rmse_ratios) ** 2 < HALF)


def better_option(evidence: Evidence, proposal: FittedModel, options: Sequence[FittedModel]) -> FittedModel | None:
    """Return the simplest option of no more effects than the proposal that errs surely less; None without one."""
    motion, base, force = evidence.output_error, evidence.base, evidence.equation_error
    options = [f for f in map(motion.best, options) if len(f.effects) <= max(len(proposal.effects), 1)]
    options = [f for f in options if set(f.effects) != set(proposal.effects) and not motion.refusal(base, f)]
    options = [f for f in options if not _alike_and_no_simpler(evidence, proposal, f)]
    options = [
        f
        for f in options
        if not evidence.force_rises(base, f) and not motion.refusal(proposal, f) and surpasses(evidence, proposal, f)
    ]
    if force is not None and not proposal.effects:
        options = [f for f in options if not contradicts_force(evidence, force, f)]
    return simplest(evidence, options)


def _alike_and_no_simpler(evidence: Evidence, proposal: FittedModel, other: FittedModel) -> bool:
    """Tell whether ``other`` errs by what a table shows for a proposal, with no fewer effects and parameters:
    differences that no table shows may be of one sign in every block, as where both are the same law.
    """
    alike = evidence.output_error.improvement(proposal, other).falls_by_less(evidence.criteria.visible_change)
    return alike and other.size >= proposal.size and (proposal.white or not other.white)


def smallest_as_good(evidence: Evidence, proposal: FittedModel, options: Sequence[FittedModel]) -> FittedModel:
    """Return the option with the fewest effects, then the fewest parameters, of those as good as a proposal; that where
    there is none.

    An effect that acts on no force replaces none that does, unless it leaves a residual that was tested as noise.
    """
    motion, told = evidence.output_error, evidence.force_mse(proposal) is not None
    options = [f for f in options if not motion.refusal(evidence.base, f) and motion.as_good(proposal, f)]
    options = [f for f in options if motion.refusal(f, proposal) and not evidence.force_rises(proposal, f)]
    options = [
        f
        for f in options
        if not told or evidence.force_mse(f) is not None or (f.residual_is_noise and evidence.residual_is_white(f))
    ]
    return min(options, key=lambda f: (f.size, f.log_mse), default=proposal)


def simplest(evidence: Evidence, options: Sequence[FittedModel]) -> FittedModel | None:
    """Return the simplest of the options that are as good as the best one; None where there is no option."""
    best = min(options, key=lambda f: f.log_mse, default=None)
    as_good = [f for f in options if best and evidence.output_error.as_good(best, f)]
    return min(as_good, key=lambda f: (f.size, f.log_mse), default=None)


__all__ = [
    "better_option",
    "contradicts_force",
    "names_to_search",
    "preferred",
    "smallest_as_good",
    "sufficient_law",
    "surpasses",
]
