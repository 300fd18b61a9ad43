"""Two estimates, one rule of agreement: which effects both of them can stand for.

The equation-error estimate goes first; the output-error estimate confirms by simulation, and adds what no force shows.
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
from signlin_ros.diagnosis.single_laws import complete, fit_every_law, fit_families, settled
from signlin_ros.effects import EFFECTS
from signlin_ros.errors import SignlinError

if TYPE_CHECKING:
    from signlin_ros.diagnosis.discrimination import RefittedRival


@dataclass(frozen=True, eq=False)
class Selection:
    """A model that both estimates support.

    ``chosen``: that model; ``conflict``: in words why the estimates differ, empty where they agree; ``asked``: the
    effect that `add` was asked for; ``untold``: why validation data do not tell of what was chosen before, where the
    model without it took its place (a key of `REASONS`); ``dropped``: effects that were chosen beside others and tell
    nothing, and why; ``rivals`` of a plan, refitted.
    """

    chosen: FittedModel
    conflict: str = ""
    asked: str = ""
    untold: str = ""
    dropped: Mapping[str, str] = field(default_factory=dict)
    rivals: tuple[RefittedRival, ...] = ()


def select_model(evidence: Evidence) -> Selection:
    """Return the model that both estimates support: of what is as good, that with the fewest effects; before more than
    noise is left, what leaves it by itself.
    """
    if evidence.force:
        starts = {n: evidence.force.values(f, n) for n, f in evidence.laws.items() if np.any(f.theta[f.spans[n]])}
        evidence = replace(evidence, motion=replace(evidence.motion, starts=starts))
    final, conflict = _stood_for(evidence)
    final = fewest(evidence, final)
    conflict = conflict.format(listed(final.effects))
    options = [] if settled(evidence, final) else fit_every_law(evidence, final)
    options += [] if complete(evidence, final) else fit_families(evidence, final)
    final = fewest(evidence, final) if options else final
    other = alone(evidence, final) or better(evidence, final, options)
    final = evidence.valued(fewest(evidence, other) if other else final)
    return Selection(evidence.base if final.implausible else final, "" if other else conflict)


def _stood_for(evidence: Evidence) -> tuple[FittedModel, str]:
    """Return the model to stand for, and why the estimates differ."""
    base, force = evidence.base, evidence.force
    first = _confirmed(evidence, force) if force and force.effects else None
    if first is not None and first.white:
        return _unless_turning(evidence, first), ""
    if first is not None and (whole := _by_itself(evidence, first)):
        return whole, ""
    if first is None and evidence.cache.tried:
        together = _together(evidence, evidence.cache.tried[0])
        if together is not None:
            return together, ""
    if first is None or not evidence.explains(first):
        path = evidence.motion.search(evidence.criteria.max_effects, _searched(evidence), partial(_by_itself, evidence))
        evidence.cache.keep(*(f for step in path for f in step))
        return _chosen(evidence, [first] if first else [], path[-1][0])
    found = _best_of(evidence, base, evidence.hidden, rival=first) or base
    beside = _best_of(evidence, first, evidence.hidden)
    return _chosen(evidence, [f for f in (first, beside) if f], found)


def _by_itself(evidence: Evidence, now: FittedModel) -> FittedModel | None:
    """Return the law that leaves noise by itself, of all that there are, before another one is sought beside one."""
    fit_every_law(evidence, now)
    return alone(evidence, now)


def _unless_turning(evidence: Evidence, first: FittedModel) -> FittedModel:
    """Return the model that explains force and motion, or one with an effect of an angle that nobody said is one, where
    that leaves noise, and surely less: for what the band leaves of it, a weight is a cubic spring.
    """
    turning = {n for n in evidence.hidden if EFFECTS[n].angular}
    other = _best_of(evidence, evidence.base, turning, rival=first) if turning else None
    better = (
        other
        and complete(evidence, other)
        and not evidence.raises(first, other)
        and not evidence.motion.refused(first, other)
    )
    return other if other and better else first


def _searched(evidence: Evidence) -> list[str] | None:
    """Return the effects among which the output-error estimate searches, None for all: what no force shows, waves, and
    laws that take away a visible part of a force that is seen; of a little one without a law, the first two.
    """
    force, share = evidence.force, evidence.percent(evidence.left(evidence.base))
    if force is None or not evidence.sees(evidence.base):
        return None
    small = share is not None and share < 100.0 * evidence.criteria.min_missing_share
    waves = {n for n, effect in EFFECTS.items() if effect.periodic}  # what passes its band is not all that there are
    names = evidence.hidden | waves | (set() if small and not force.effects else force.helpful)
    return sorted(names & evidence.motion.candidates)


def _together(evidence: Evidence, refused: FittedModel) -> FittedModel | None:
    """Return a model that the motion refuses with an effect beside it that no force shows, where both are needed."""
    motion, both = evidence.motion, _best_of(evidence, refused, evidence.hidden)
    if both is None or motion.refused(evidence.base, both):
        return None
    other = motion.fitted([n for n in both.effects if n not in refused.effects], both.model)
    evidence.cache.keep(other)
    return None if motion.refused(other, both) else both


def _best_of(
    evidence: Evidence, of: FittedModel, names: Iterable[str], rival: FittedModel | None = None
) -> FittedModel | None:
    """Return the simplest of the best steps beyond a model, beside a ``rival`` if there is one; None where none is."""
    if len(of.effects) >= evidence.criteria.max_effects:
        return None
    options = evidence.motion.extensions(of, sorted(evidence.motion.candidates.intersection(names)), rival)
    evidence.cache.keep(*options)
    return next(iter(evidence.motion.alike(of, options)), None)


def _chosen(evidence: Evidence, first: Sequence[FittedModel], second: FittedModel) -> tuple[FittedModel, str]:
    """Return the model to stand for, of what force (``first``) and motion (``second``) arrived at, and why not both."""
    base, force = evidence.base, evidence.force
    if not first:
        if force is not None and force.effects and _overruled(evidence, force, second):
            return base, _both(evidence, force, second)
        if second.effects and evidence.raises(base, second):
            told = f"would follow the motion, but {_leaves(second)} more force than the model as it is"
            return base, f"{listed(second.effects)} {told}"
        return second, ""
    now = first[0]
    for other in (*first[1:], second):
        if set(other.effects) != set(now.effects) and _beyond(evidence, now, other):
            now = other
    g = evidence.motion.gain(now, second)
    if now is not second and g.certainty >= evidence.criteria.min_t and g.share >= HALF and second.effects:
        told = f"would follow the motion better than {{}}, but {_leaves(second)} more force"
        return now, f"{listed(second.effects)} {told}"
    return now, ""


def _leaves(f: FittedModel) -> str:
    return "leaves" if len(f.effects) == 1 else "leave"


def _overruled(evidence: Evidence, force: EquationErrorResult, second: FittedModel) -> bool:
    """Tell whether laws that explain most of the force would give way to what explains neither it nor the motion."""
    before, own = force.base.error, evidence.left(second)
    explains = own is not None and float(np.mean(own)) < HALF * before
    return evidence.sees(evidence.base) and not second.white and force.fit.error < HALF * before and not explains


def _both(evidence: Evidence, force: EquationErrorResult, second: FittedModel) -> str:
    """Return the sentence of both estimates where the motion refuses the laws of the force."""
    after, shown = evidence.percent(force.fit.error), evidence.percent(evidence.left(evidence.base))
    before = "" if shown is None else f" in place of {shown:.3g} %"
    told = (
        f"by the force {listed(force.effects)} would leave {after:.3g} % {evidence.of_effort}{before}, but the motion"
    )
    other = f"; {listed(second.effects)} would follow it better" if second.effects else ""
    return f"{told} that they make is not the one that was measured{other}"


def _beyond(evidence: Evidence, now: FittedModel, other: FittedModel) -> bool:
    """Tell whether another model is to be stood for: nothing is worse for it, and it leaves noise, or surely less."""
    c, g = evidence.criteria, evidence.motion.gain(now, other)
    if (
        other.level > now.level
        or g.worsens(c.max_rise_t, c.visible_change)
        or evidence.rising(now, other, c.tie_t)
        or evidence.raises(now, other)
    ):
        return False
    if other.clean and evidence.leaves_noise(other) and not now.white:
        return True
    if g.certainty < c.min_t or not evidence.sees(now):
        return g.certainty >= c.min_t
    return set(other.effects) - set(now.effects) <= evidence.hidden or evidence.falls(now, other)


def _confirmed(evidence: Evidence, force: EquationErrorResult) -> FittedModel | None:
    """Return the proposal of the equation-error estimate, with the values of the motion or the force; None where it is
    refused.
    """
    c, motion, choice = evidence.criteria, evidence.motion, FamilyChoice(evidence, force)
    found = choice.simulated(force.fit)
    if found is None:
        return None
    stated = evidence.valued(found) if found.insignificant(c) else found
    known = stated is not found and motion.gain(evidence.base, stated).certainty >= c.min_t
    found = stated if known else found
    g = motion.gain(evidence.base, found)
    if g.certainty < (0.0 if evidence.explains(found) else c.min_validation_t) or g.worsens(
        c.max_rise_t, c.visible_change
    ):
        return None
    if not known and found.insignificant(c):
        plain = motion.plainer(found)
        evidence.cache.keep(*plain)
        sound = motion.alike(evidence.base, plain)
        if not sound:
            return None
        found = sound[0]
    return choice.in_all_band(choice.in_family(found))


# -------------------------------------------------------------------- how many effects


def fewest(evidence: Evidence, final: FittedModel) -> FittedModel:
    """Return the model with the fewest effects, and of these the fewest parameters, that is as good; what no force
    shows displaces nothing that one does, unless it leaves nothing but tested noise.
    """
    motion, several = evidence.motion, len(final.effects) > 1
    options = [
        f for f in evidence.cache.tried if (len(f.effects), f.size) < (len(final.effects), final.size) and f.effects
    ]
    options += _as_one(motion, final) if several else []
    for name in final.effects if several else ():
        with contextlib.suppress(SignlinError):
            options.append(motion.fitted([n for n in final.effects if n != name], final.model))
        motion.progress.check()
    evidence.cache.keep(*options)
    shown = evidence.left(final) is not None
    good = [f for f in options if not motion.refused(evidence.base, f) and motion.as_good(final, f)]
    good = [f for f in good if motion.refused(f, final) and not evidence.raises(final, f)]
    good = [f for f in good if not shown or evidence.left(f) is not None or (f.clean and evidence.leaves_noise(f))]
    return min(good, key=lambda f: (len(f.effects), f.size, f.level), default=final)


def alone(evidence: Evidence, final: FittedModel) -> FittedModel | None:
    """Return the effect that by itself leaves nothing but noise, where what both estimates arrived at leaves more."""
    if complete(evidence, final):
        return None
    motion, base = evidence.motion, evidence.base
    whole = [f for f in map(motion.best, evidence.single) if complete(evidence, f)]
    whole = [f for f in whole if not motion.refused(base, f) and not evidence.raises(base, f)]
    return _simplest(evidence, whole)


def better(evidence: Evidence, final: FittedModel, options: Sequence[FittedModel]) -> FittedModel | None:
    """Return the simplest of the best options of no more effects that leave surely less than a model."""
    motion, base, force = evidence.motion, evidence.base, evidence.force
    good = [f for f in map(motion.best, options) if len(f.effects) <= max(len(final.effects), 1)]
    good = [f for f in good if set(f.effects) != set(final.effects) and not motion.refused(base, f)]
    good = [
        f for f in good if not evidence.raises(base, f) and not motion.refused(final, f) and _beyond(evidence, final, f)
    ]
    return _simplest(
        evidence, [f for f in good if force is None or final.effects or not _overruled(evidence, force, f)]
    )


def _simplest(evidence: Evidence, options: Sequence[FittedModel]) -> FittedModel | None:
    """Return the simplest of the options that are as good as the best of them; None of none."""
    best = min(options, key=lambda f: f.level, default=None)
    as_good = [f for f in options if best and evidence.motion.as_good(best, f)]
    return min(as_good, key=lambda f: (len(f.effects), f.size, f.level), default=None)


def _as_one(motion: OutputErrorEstimator, final: FittedModel) -> list[FittedModel]:
    """Return models with one effect in place of two that it is about the same as, from their values and its starts."""
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
            model = model.with_effect(name, free_key(model, name), **completed(motion.problem, effect, values))
            found.append(motion.fitted((*kept, name), model))
        with contextlib.suppress(SignlinError):
            found += motion.extensions(motion.fitted(kept, final.model), [name])
        motion.progress.check()
    return [f for f in found if len(f.effects) < len(final.effects)]


__all__ = ["Selection", "alone", "fewest", "select_model"]
