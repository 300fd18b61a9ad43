"""Rivals of a planned experiment: each refitted to the same records from its own values, held against what is named.

A right rival whose fit does not come back from a general start would lose to a wrong one. And a law that contains a
simpler one never loses by its error: it must lose at the smallest size that is of interest [Atkinson and Fedorov,
Biometrika 62 (1975) 57, doi:10.1093/biomet/62.1.57: nested models are discriminated at a least distance].
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from signlin_ros.diagnosis.evidence import Evidence
from signlin_ros.diagnosis.output_error import FittedModel
from signlin_ros.diagnosis.output_error.fitting import of_own
from signlin_ros.diagnosis.output_error.residual import residual_tests
from signlin_ros.diagnosis.selection import Selection
from signlin_ros.effects import EFFECTS
from signlin_ros.errors import InputError
from signlin_ros.fitting.fit import fit
from signlin_ros.model import Model

BOUND_SHARES = (0.25, 0.5, 1.0)
"""Parts of the smallest size of interest at which a richer law is asked for, the smallest that loses is told."""


@dataclass(frozen=True)
class PlannedRival:
    """A rival as a plan tells it: the ``effects`` beyond the model as given, ``starts``: models with values that a fit
    starts from, the estimate first; ``of_interest``: (least, most) by parameter, the size first, infinite where free.
    """

    effects: tuple[str, ...]
    starts: tuple[Model, ...]
    of_interest: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    @classmethod
    def of_json(cls, one: Mapping[str, Any]) -> PlannedRival:
        """Return an entry of ``rivals`` of a plan's file or of a diagnosis; raise `InputError` for what is none."""
        try:
            texts = one.get("starts") or [one["model"]]
            starts = tuple(Model.from_yaml(str(text), "rivals") for text in texts)
            sizes = {n: (_number(a, -np.inf), _number(b, np.inf)) for n, (a, b) in one.get("of_interest", {}).items()}
            return cls(tuple(map(str, one["effects"])), starts, sizes)
        except (KeyError, TypeError, ValueError) as error:
            raise InputError("rivals: an entry is no rival of signlin experiment or diagnose --json") from error

    def to_json(self) -> dict[str, Any]:
        """Return the mapping that `of_json` reads."""
        sizes = {n: [x if np.isfinite(x) else None for x in sides] for n, sides in self.of_interest.items()}
        return {"effects": list(self.effects), "starts": [m.to_yaml() for m in self.starts], "of_interest": sizes}


def _number(value: float | None, other: float) -> float:
    return other if value is None else float(value)


@dataclass(frozen=True, eq=False)
class RefittedRival:
    """A rival refitted to the records, ``best``; ``least``: with what it adds no smaller than is of interest, the same
    where nothing says what is; ``size``: the parameter that says so, ``stiff`` whether that is large where the rival
    adds nothing; ``at``: the rival with it held at a part of that size, None where it diverges; ``of_interest``: as
    it was planned.
    """

    effects: tuple[str, ...]
    best: FittedModel
    least: FittedModel
    size: str = ""
    stiff: bool = False
    at: Callable[[float], tuple[float, FittedModel | None]] = lambda share: (share, None)
    of_interest: Mapping[str, tuple[float, float]] = field(default_factory=dict)


def refitted(evidence: Evidence, rivals: Sequence[PlannedRival]) -> tuple[RefittedRival, ...]:
    """Return rivals refitted to the records of a diagnosis, and keep them among what was tried; without those that the
    model cannot have, or that diverge.
    """
    found = list[RefittedRival]()
    for rival in rivals:
        try:
            one = _refitted(evidence, rival)
        except InputError:
            continue
        found += [one] if one else []
    return tuple(found)


def _refitted(evidence: Evidence, rival: PlannedRival) -> RefittedRival | None:
    motion = evidence.output_error
    if not rival.effects:
        return RefittedRival((), evidence.base, evidence.base)
    if len(rival.effects) == 1 and EFFECTS[rival.effects[0]].states:  # what remembers has several minima
        evidence.cache.keep(*motion.extensions(evidence.base, list(rival.effects), share=0.0))
    best = motion.fitted_from(rival.effects, rival.starts)
    if best is None:
        return None
    evidence.cache.keep(best)
    if not rival.of_interest:
        return RefittedRival(rival.effects, best, best)
    size, (low, high) = next(iter(rival.of_interest.items()))
    starts, stiff = (best.model, *rival.starts), not np.isfinite(low)
    least = motion.fitted_from(rival.effects, starts, rival.of_interest)

    def at(share: float) -> tuple[float, FittedModel | None]:
        value = high / share if stiff else low * share
        held = {**rival.of_interest, size: (value, value)}
        return value, motion.fitted_from(rival.effects, starts, held)

    return RefittedRival(rival.effects, best, least or best, size, stiff, at, rival.of_interest)


def discriminated(evidence: Evidence, selection: Selection, rivals: Sequence[RefittedRival]) -> Selection:
    """Return a selection after the rivals of a plan were refitted, with more beside them where they need it."""
    selection = _displaced(evidence, selection, rivals)
    more = with_more(evidence, selection.chosen, rivals)
    return replace(_displaced(evidence, selection, more), rivals=(*rivals, *more))


def _displaced(evidence: Evidence, selection: Selection, rivals: Sequence[RefittedRival]) -> Selection:
    """Return a selection in which the simplest of the rivals that are surely better, or that are simpler and as good,
    takes the place of what was chosen, and then the estimates do not differ any more. Its parameters need not be known
    one by one, as those of a law must that nobody asked for: that simpler laws lose says that it is not nothing.
    """
    final = selection.chosen
    good = [
        one.best for one in rivals if len(one.effects) <= max(len(final.effects), 1) and _better(evidence, final, one)
    ]
    best = min(good, key=lambda f: f.log_mse, default=None)
    near = [f for f in good if best and (f is best or _no_worse(evidence, best, f))]
    near = near or [one.best for one in rivals if _as_good(evidence, final, one.best)]
    if not near:
        return selection
    return replace(selection, chosen=min(near, key=lambda f: (f.size, f.log_mse)), conflict="")


def with_more(evidence: Evidence, final: FittedModel, rivals: Sequence[RefittedRival]) -> tuple[RefittedRival, ...]:
    """Return the rivals with the effects beside them that a rival needs as well and no plan knew of: what is named
    first, as one of them. None where nothing is needed beside a rival, where that leaves more than noise, or where one
    of them cannot be refitted: then they were not all held against what is named.
    """
    known = {name for r in rivals for name in r.effects}
    more = tuple(name for name in final.effects if name not in known)
    own = set(final.effects) - set(more)
    if not more or not any(own and own == set(r.effects) for r in rivals) or leaves_structure(evidence, final):
        return ()
    others = [r for r in rivals if r.effects and not own <= set(r.effects)]
    found = refitted(evidence, [_planned_with(r, final, more) for r in others])
    return (RefittedRival(final.effects, final, final), *found) if len(found) == len(others) else ()


def _planned_with(rival: RefittedRival, final: FittedModel, more: Sequence[str]) -> PlannedRival:
    """Return a rival with some effects of another model beside it, as that has them; from its size of interest,
    too: by itself it may have become what no observer follows.
    """
    models = [rival.best.model, *([rival.least.model] if rival.least is not rival.best else [])]
    for key, use in final.model.effects.items():
        models = [
            m.with_effect(use.type, key, **use.parameters) if use.type in more and key not in m.effects else m
            for m in models
        ]
    return PlannedRival((*rival.effects, *more), tuple(models), rival.of_interest)


def _as_good(evidence: Evidence, final: FittedModel, f: FittedModel) -> bool:
    """Tell whether a rival is simpler than a model, as good, and surely better than the base."""
    if not f.effects or f.size >= final.size or f.implausible or not _no_worse(evidence, final, f):
        return False
    if evidence.force_rises(final, f) and not _is_noise_of_way(f):
        return False
    return evidence.output_error.t_ratio(evidence.base, f) >= evidence.criteria.min_t


def _no_worse(evidence: Evidence, best: FittedModel, f: FittedModel) -> bool:
    """Tell whether a model is as good as the best one, which is no sure step beyond it: what no table shows may be
    sure.
    """
    return evidence.output_error.as_good(best, f) and bool(evidence.output_error.refusal(f, best))


def _better(evidence: Evidence, final: FittedModel, one: RefittedRival) -> bool:
    """Tell whether a rival surely errs less than a model, and than the base, and nothing is worse for it."""
    f, c = one.best, evidence.criteria
    if set(one.effects) == set(final.effects) or not one.effects or f.implausible:
        return False
    if (
        evidence.output_error.improvement(final, f).worsens(c)
        or _raises(evidence, final, f)
        or _raises(evidence, evidence.base, f)
    ):
        return False
    return min(evidence.output_error.t_ratio(g, f) for g in (final, evidence.base)) >= c.min_t


def _raises(evidence: Evidence, before: FittedModel, after: FittedModel) -> bool:
    """Tell whether a model leaves more force than another one, as surely as its motion must be better."""
    if _is_noise_of_way(after):
        return False
    change = evidence.force_change(before, after)
    return change is not None and evidence.force_rises(before, after) and change.t_ratio <= -evidence.criteria.min_t


def _is_noise_of_way(f: FittedModel) -> bool:
    """Tell whether the force that a model leaves says nothing against it: it remembers the way and leaves but noise of
    the motion. The noise of the measured way drives its force.
    """
    return f.residual_is_noise and any(EFFECTS[name].states for name in f.effects)


def loses(evidence: Evidence, rival: FittedModel, final: FittedModel) -> bool:
    """Tell whether a rival surely errs more than what is named, of validation data, or errs more and leaves surely more
    force.
    """
    certainty = evidence.output_error.t_ratio(rival, final)
    return certainty >= evidence.criteria.min_t or (
        certainty >= evidence.criteria.tie_t and evidence.force_rises(final, rival)
    )


def undecided(evidence: Evidence, rivals: Sequence[RefittedRival], final: FittedModel) -> list[RefittedRival]:
    """Return the rivals that do not surely lose, at their smallest size of interest; but those that by themselves are
    no step beyond the base, and what contains all that is named.
    """
    open_ones = [r for r in _others(rivals, final) if not loses(evidence, r.least, final)]
    return [r for r in open_ones if r.size or not r.effects or not evidence.output_error.refusal(evidence.base, r.best)]


def _others(rivals: Sequence[RefittedRival], final: FittedModel) -> list[RefittedRival]:
    """Return the rivals that do not contain all that is named."""
    return [r for r in rivals if not set(final.effects) <= set(r.effects)]


@dataclass(frozen=True)
class Doubts:
    """Why what a planned experiment names is not confirmed: rivals that are as good (``undecided``); rivals that are
    ``near`` beside what it leaves itself; effects that it needs ``together``, where every rival was to be enough.
    """

    undecided: tuple[RefittedRival, ...] = ()
    near: tuple[RefittedRival, ...] = ()
    together: tuple[str, ...] = ()

    def of(self, effect: str) -> bool:
        """Tell whether one of the effects that are named is in doubt."""
        return bool(self.together) or any(effect not in r.effects for r in (*self.undecided, *self.near))


def doubts_of(evidence: Evidence, rivals: Sequence[RefittedRival], final: FittedModel) -> Doubts:
    """Return why what is named after a planned experiment is not confirmed.

    That a rival loses says that another is right only if one of them is. So what is named must be a rival, or a law
    that is enough by itself; two laws of which no rival has both, not even `with_more`, were not held against the other
    rivals with one of these beside them. And where more than noise is left, of the data of the fit or of validation
    data, that must be little beside what tells a rival apart: no more than the part of `Criteria.max_force_mse_left`.
    """
    if not rivals or not final.effects:
        return Doubts()
    open_ones = undecided(evidence, rivals, final)
    several = len(final.effects) > 1 and not any(set(final.effects) <= set(r.effects) for r in rivals)
    others = [r for r in _others(rivals, final) if r not in open_ones]
    near = [r for r in others if share_left(evidence, final, r.least) > evidence.criteria.max_force_mse_left]
    near = near if near and leaves_structure(evidence, final) else []
    return Doubts(tuple(open_ones), tuple(near), final.effects if several else ())


def share_left(evidence: Evidence, final: FittedModel, rival: FittedModel) -> float:
    """Return what a model leaves of validation data beyond the noise, as a part of what a rival leaves beyond it: of
    squared errors over windows, in units of the noise, of the channel that tells them apart best.
    """
    noise = evidence.output_error.validation.noise**2
    own, other = (np.maximum(f.validation_rmse**2 / noise - 1.0, 0.0) for f in (final, rival))
    told = other > own
    return float(np.min(own[told] / other[told])) if told.any() else np.inf


def leaves_structure(evidence: Evidence, f: FittedModel) -> bool:
    """Tell whether a model leaves more than noise: of the data that it was fitted to, or of validation data."""
    motion = evidence.output_error
    if not f.residual_is_noise or motion.validation.folds:
        return not f.residual_is_noise
    unseen, gains = motion.validation, motion.validation.observer_gains[-1]
    fitted_to = {s.source for s in motion.training.segments}
    candidate, theta = of_own(unseen, f.fit.candidate, f.fit.theta, gains, fitted_to)
    found = fit(unseen, candidate, gains, theta, 0)
    return found is None or any(one.structured for one in residual_tests(unseen, found, evidence.criteria))


__all__ = [
    "BOUND_SHARES",
    "Doubts",
    "PlannedRival",
    "RefittedRival",
    "discriminated",
    "doubts_of",
    "leaves_structure",
    "loses",
    "refitted",
    "share_left",
    "undecided",
    "with_more",
]
