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
from signlin_ros.diagnosis.output_error.forward import forward_selection
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


def select_model(w: Evidence) -> Selection:
    """Return the model that both estimates support: of what is as good, that with the fewest effects; before more than
    noise is left, what leaves it by itself.
    """
    if w.force:
        starts = {n: w.force.values(f, n) for n, f in w.laws.items() if np.any(f.theta[f.spans[n]])}
        w = replace(w, motion=replace(w.motion, starts=starts))
    final, conflict = _stood_for(w)
    final = fewest(w, final)
    conflict = conflict.format(listed(final.effects))
    options = [] if settled(w, final) else fit_every_law(w, final)
    options += [] if complete(w, final) else fit_families(w, final)
    final = fewest(w, final) if options else final
    other = alone(w, final) or better(w, final, options)
    final = w.valued(fewest(w, other) if other else final)
    return Selection(w.base if final.implausible else final, "" if other else conflict)


def _stood_for(w: Evidence) -> tuple[FittedModel, str]:
    """Return the model to stand for, and why the estimates differ."""
    base, force = w.base, w.force
    first = _confirmed(w, force) if force and force.effects else None
    if first is not None and first.white:
        return _unless_turning(w, first), ""
    if first is not None and (whole := _by_itself(w, first)):
        return whole, ""
    if first is None and w.cache.tried:
        together = _together(w, w.cache.tried[0])
        if together is not None:
            return together, ""
    if first is None or not w.explains(first):
        path = forward_selection(w.motion, w.criteria.most, _searched(w), partial(_by_itself, w))
        w.cache.keep(*(f for step in path for f in step))
        return _chosen(w, [first] if first else [], path[-1][0])
    found = _best_of(w, base, w.hidden, rival=first) or base
    beside = _best_of(w, first, w.hidden)
    return _chosen(w, [f for f in (first, beside) if f], found)


def _by_itself(w: Evidence, now: FittedModel) -> FittedModel | None:
    """Return the law that leaves noise by itself, of all that there are, before another one is sought beside one."""
    fit_every_law(w, now)
    return alone(w, now)


def _unless_turning(w: Evidence, first: FittedModel) -> FittedModel:
    """Return what explains force and motion, or what goes with an angle that nobody said is one, where that leaves
    noise, and surely less: for what the band leaves of it, a weight is a cubic spring.
    """
    turning = {n for n in w.hidden if EFFECTS[n].angular}
    other = _best_of(w, w.base, turning, rival=first) if turning else None
    better = other and complete(w, other) and not w.raises(first, other) and not w.motion.refused(first, other)
    return other if other and better else first


def _searched(w: Evidence) -> list[str] | None:
    """Return the effects among which the output-error estimate searches, None for all: what no force shows, waves, and
    laws that take away a visible part of a force that is seen; of a little one without a law, the first two.
    """
    force, share = w.force, w.percent(w.left(w.base))
    if force is None or not w.sees(w.base):
        return None
    small = share is not None and share < 100.0 * w.criteria.large
    waves = {n for n, effect in EFFECTS.items() if effect.periodic}  # what passes its band is not all that there are
    names = w.hidden | waves | (set() if small and not force.effects else force.helpful)
    return sorted(names & w.motion.candidates)


def _together(w: Evidence, refused: FittedModel) -> FittedModel | None:
    """Return what the motion refuses by itself with an effect that no force shows beside it, if both are needed."""
    motion, both = w.motion, _best_of(w, refused, w.hidden)
    if both is None or motion.refused(w.base, both):
        return None
    other = motion.fitted([n for n in both.effects if n not in refused.effects], both.model)
    w.cache.keep(other)
    return None if motion.refused(other, both) else both


def _best_of(
    w: Evidence, of: FittedModel, names: Iterable[str], rival: FittedModel | None = None
) -> FittedModel | None:
    """Return the simplest of the best steps beyond a model, beside a ``rival`` if there is one; None where none is."""
    if len(of.effects) >= w.criteria.most:
        return None
    options = w.motion.extensions(of, sorted(w.motion.candidates.intersection(names)), rival)
    w.cache.keep(*options)
    return next(iter(w.motion.alike(of, options)), None)


def _chosen(w: Evidence, first: Sequence[FittedModel], second: FittedModel) -> tuple[FittedModel, str]:
    """Return the model to stand for, of what force (``first``) and motion (``second``) arrived at, and why not both."""
    base, force = w.base, w.force
    if not first:
        if force is not None and force.effects and _overruled(w, force, second):
            return base, _both(w, force, second)
        if second.effects and w.raises(base, second):
            told = f"would follow the motion, but {_leaves(second)} more force than the model as it is"
            return base, f"{listed(second.effects)} {told}"
        return second, ""
    now = first[0]
    for other in (*first[1:], second):
        if set(other.effects) != set(now.effects) and _beyond(w, now, other):
            now = other
    g = w.motion.gain(now, second)
    if now is not second and g.certainty >= w.criteria.certainty and g.share >= HALF and second.effects:
        told = f"would follow the motion better than {{}}, but {_leaves(second)} more force"
        return now, f"{listed(second.effects)} {told}"
    return now, ""


def _leaves(f: FittedModel) -> str:
    return "leaves" if len(f.effects) == 1 else "leave"


def _overruled(w: Evidence, force: EquationErrorResult, second: FittedModel) -> bool:
    """Tell whether laws that explain most of the force would give way to what explains neither it nor the motion."""
    before, own = force.base.error, w.left(second)
    explains = own is not None and float(np.mean(own)) < HALF * before
    return w.sees(w.base) and not second.white and force.fit.error < HALF * before and not explains


def _both(w: Evidence, force: EquationErrorResult, second: FittedModel) -> str:
    """Return what both estimates say where the motion refuses what the force shows, beside the row of the base."""
    after, shown = w.percent(force.fit.error), w.percent(w.left(w.base))
    before = "" if shown is None else f" in place of {shown:.3g} %"
    told = f"by the force {listed(force.effects)} would leave {after:.3g} % {w.of_effort}{before}, but the motion"
    other = f"; {listed(second.effects)} would follow it better" if second.effects else ""
    return f"{told} that they make is not the one that was measured{other}"


def _beyond(w: Evidence, now: FittedModel, other: FittedModel) -> bool:
    """Tell whether another model is to be stood for: nothing is worse for it, and it leaves noise, or surely less."""
    c, g = w.criteria, w.motion.gain(now, other)
    if other.level > now.level or g.worsens(c.worse, c.alike) or w.rising(now, other, c.tie) or w.raises(now, other):
        return False
    if other.clean and w.leaves_noise(other) and not now.white:
        return True
    if g.certainty < c.certainty or not w.sees(now):
        return g.certainty >= c.certainty
    return set(other.effects) - set(now.effects) <= w.hidden or w.falls(now, other)


def _confirmed(w: Evidence, force: EquationErrorResult) -> FittedModel | None:
    """Return what the equation-error estimate proposes, with the values of the motion or the force; None where it is
    refused.
    """
    c, motion, choice = w.criteria, w.motion, FamilyChoice(w, force)
    found = choice.simulated(force.fit)
    if found is None:
        return None
    stated = w.valued(found) if found.insignificant(c) else found
    known = stated is not found and motion.gain(w.base, stated).certainty >= c.certainty
    found = stated if known else found
    g = motion.gain(w.base, found)
    if g.certainty < (0.0 if w.explains(found) else c.least) or g.worsens(c.worse, c.alike):
        return None
    if not known and found.insignificant(c):
        plain = motion.plainer(found)
        w.cache.keep(*plain)
        sound = motion.alike(w.base, plain)
        if not sound:
            return None
        found = sound[0]
    return choice.in_all_band(choice.in_family(found))


# -------------------------------------------------------------------- how many effects


def fewest(w: Evidence, final: FittedModel) -> FittedModel:
    """Return the model with the fewest effects, and of these the fewest parameters, that is as good; what no force
    shows displaces nothing that one does, unless it leaves nothing but tested noise.
    """
    motion, several = w.motion, len(final.effects) > 1
    options = [f for f in w.cache.tried if (len(f.effects), f.size) < (len(final.effects), final.size) and f.effects]
    options += _as_one(motion, final) if several else []
    for name in final.effects if several else ():
        with contextlib.suppress(SignlinError):
            options.append(motion.fitted([n for n in final.effects if n != name], final.model))
        motion.progress.check()
    w.cache.keep(*options)
    shown = w.left(final) is not None
    good = [f for f in options if not motion.refused(w.base, f) and motion.as_good(final, f)]
    good = [f for f in good if motion.refused(f, final) and not w.raises(final, f)]
    good = [f for f in good if not shown or w.left(f) is not None or (f.clean and w.leaves_noise(f))]
    return min(good, key=lambda f: (len(f.effects), f.size, f.level), default=final)


def alone(w: Evidence, final: FittedModel) -> FittedModel | None:
    """Return the effect that by itself leaves nothing but noise, where what both estimates arrived at leaves more."""
    if complete(w, final):
        return None
    motion, base = w.motion, w.base
    whole = [f for f in map(motion.best, w.single) if complete(w, f)]
    whole = [f for f in whole if not motion.refused(base, f) and not w.raises(base, f)]
    return _simplest(w, whole)


def better(w: Evidence, final: FittedModel, options: Sequence[FittedModel]) -> FittedModel | None:
    """Return the simplest of the best options of no more effects that leave surely less than a model."""
    motion, base, force = w.motion, w.base, w.force
    good = [f for f in map(motion.best, options) if len(f.effects) <= max(len(final.effects), 1)]
    good = [f for f in good if set(f.effects) != set(final.effects) and not motion.refused(base, f)]
    good = [f for f in good if not w.raises(base, f) and not motion.refused(final, f) and _beyond(w, final, f)]
    return _simplest(w, [f for f in good if force is None or final.effects or not _overruled(w, force, f)])


def _simplest(w: Evidence, options: Sequence[FittedModel]) -> FittedModel | None:
    """Return the simplest of the options that are as good as the best of them; None of none."""
    best = min(options, key=lambda f: f.level, default=None)
    as_good = [f for f in options if best and w.motion.as_good(best, f)]
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
