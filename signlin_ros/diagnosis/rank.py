"""All effects compete: starts, fits of singles, then of what can be added to the best of them."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from signlin_ros.diagnosis.fit import Candidate, Filter, Fit, candidate, fit, further, likelihood
from signlin_ros.diagnosis.judge import any_structure
from signlin_ros.diagnosis.narrow import Each, deepened, narrowed, tuned, widened
from signlin_ros.diagnosis.problem import Gains, Problem, added_keys
from signlin_ros.diagnosis.scan import periodic_starts
from signlin_ros.effects import EFFECTS, load_entry_points
from signlin_ros.effects.base import Effect, SensorEffect
from signlin_ros.errors import ModelError
from signlin_ros.model import Model

Array = NDArray[np.float64]

PRICE = 10.0
"""What an effect must gain in -2 log likelihood on top of ln n for each of its parameters."""
CLOSE = 50.0
"""Difference in -2 log likelihood to the best at the middle gain within which a rugged effect is fitted thoroughly."""
LATE = (1.5, 5.0)
"""Delays of a sensor that a fit starts from, in samples."""
FRONT = 4
"""How many of the best singles are taken for what they contain."""
FEW = 3
"""Starts of an effect with many that are tried where a few must do."""
MOST_STARTS = 6
"""Starts that are descended from: those most likely after two steps."""
CONSISTENT = (2.0, 4.0)
"""Largest residual, in multiples of white noise, of a model that is followed by a filter which takes it to be right:
with own states that the filter corrects, at the lowest gain, and else."""
AWAKE = 3.0
"""Time constant in samples of an observer that is wide awake: with half as many, or as the search has otherwise, half
of the records of a valve that sticks most of the time were lost."""
WANDERS, WORTHWHILE = (0.2, 0.05, 0.02, 0.01, 0.005), 0.02
"""By how much a floating load may wander, and what another one must gain in -2 log likelihood for every measurement."""
SERIOUS = 0.25
"""Share of the best candidate's gain at the middle gain that makes another one worth a thorough fit, as long as any
is"""
MUCH, BEHIND = 1000.0, 200.0
"""much at all; and by how much less another one may gain where the best leaves nothing but noise."""

STRAINED = 60.0
"""What the priors may cost, in -2 log likelihood, of a model that needs no second opinion: beyond, known parameters may
be bent so that a wrong effect fits."""
GRADES = (0.5, 0.25, 0.1)
"""Steps in which a power is changed."""


@dataclass(frozen=True)
class Trial:
    """An effect that may be missing: its name, the key or the sensors that it adds, and what it is added to."""

    effect: str
    added: tuple[str, ...] = ()
    sensors: dict[str, float] = field(default_factory=dict)
    starts: tuple[dict[str, float], ...] = ()


@dataclass(frozen=True)
class Ranked:
    """A set of effects, fitted at several gains.

    ``fit`` is the one of highest likelihood: at the lowest gain where the model is right, since only noise is left
    there; at a higher one where it is not, since what is missing is then best carried by the observer. ``low`` is the
    fit at the lowest gain. ``evidence``: -2 log likelihood of ``fit``, priced.
    """

    effects: tuple[str, ...]
    sensors: tuple[str, ...]
    fit: Fit
    low: Fit
    evidence: float

    @property
    def label(self) -> str:
        """The last effect added."""
        return self.effects[-1] if self.effects else ""


def ranked(problem: Problem, effects: tuple[str, ...], sensors: tuple[str, ...], fits: Sequence[Fit]) -> Ranked | None:
    """Return fits of one model, from high to low gain, as one entry; None if it was not followed to the lowest."""
    fits = trusted(problem, fits)
    if not fits or fits[-1].gains is not problem.levels[-1]:
        return None
    best = min((f for f in fits if f.gains is not problem.levels[0]), key=cost_of)
    return Ranked(effects, sensors, best, fits[-1], evidence(problem, best, len(effects)))


def consistent(problem: Problem, f: Fit, strict: bool = False) -> bool:
    """Tell whether most of what a fit leaves is of the size of the noise, as a Kalman filter for it takes it to be.

    ``strict``: as at the lowest gain.
    """
    close = f.candidate.floating and (strict or f.gains is problem.levels[-1])
    left, most = np.concatenate(f.innovations), CONSISTENT[0] if close else CONSISTENT[1]
    return bool((np.nanmedian(np.abs(left), axis=0) < most * norm.ppf(0.75) * problem.white(f.gains)).all())


def trusted(problem: Problem, fits: Sequence[Fit]) -> Sequence[Fit]:
    """Return fits; those that an extended Kalman filter followed, but not to the noise, with the common observer.

    A filter that takes a model to be right lets it borrow what it lacks from the states that are corrected.
    """
    if not fits or not fits[-1].candidate.filtered or consistent(problem, fits[-1]):
        return fits
    return unfiltered(problem, fits[-1], [f.gains for f in fits])


def unfiltered(problem: Problem, f: Fit, levels: Sequence[Gains]) -> list[Fit]:
    """Return fits of a model as the common observer follows it, from where its fit under a Kalman filter arrived."""
    return descend(problem, replace(f.candidate, alert=False), f.theta, levels, 4, f.filter)


def roughness(f: Fit) -> float:
    """Return what does not count in -2 log likelihood: where a load floats, by how much the filter's own working
    differs from one local minimum to the next.
    """
    floats = f.candidate.filtered and f.candidate.floating
    return WORTHWHILE * float(f.count.sum()) if floats else 0.0


def calmed(problem: Problem, f: Fit) -> Fit:
    """Return a fit of a model with a load that floats, with as much wandering as makes it most likely; others as they
    are.

    With too much, the filter borrows from the load's motion what its parameters lack; with too little, it is sure of
    what it has lost.
    """
    first, now, enough = f, f.candidate.wander, roughness(f)
    if not enough:
        return f
    for choice in ([w for w in WANDERS if w < now], [w for w in WANDERS[::-1] if w > now]):
        for wander in choice if f is first else ():
            again = fit(problem, replace(f.candidate, wander=wander), f.gains, f.theta, 10, f.filter)
            if again is None or f.cost - again.cost < enough:
                break
            f = again
    return f


def descend(
    problem: Problem, c: Candidate, theta: Array | None, levels: Sequence[Gains], steps: int, filter: Filter | None
) -> list[Fit]:
    """Fit from one gain to the next; ends where the model diverges. The filter counts at the lowest gain."""
    fits: list[Fit] = []
    for gains in levels:
        found = fit(problem, c, gains, theta, steps, filter if gains is problem.levels[-1] else None)
        if found is None:
            return fits
        fits.append(found)
        theta = found.theta
    return fits


def applicable(problem: Problem) -> tuple[list[Trial], list[str]]:
    """Return what can be tried on the base model, and the effects that do not apply to its plant."""
    load_entry_points()
    trials, outside = [], []
    for name, effect in EFFECTS.items():
        if not effect.proposed:
            continue
        if any(use.type == name for use in problem.base.effects.values()) and not effect.periodic:
            continue
        of_sensor = issubclass(effect, SensorEffect)
        found = _sensor_trials(problem, name) if of_sensor else _effect_trials(problem, name, effect)
        trials += found
        if not found:
            outside.append(name)
    return trials, outside


def _effect_trials(problem: Problem, name: str, effect: type[Effect]) -> list[Trial]:
    plant = problem.base.plant
    if (effect.plants and plant.name not in effect.plants) or name in plant.built_in:
        return []
    if problem.scale.imposed and effect.input is not Effect.input:
        return []  # what is imposed is measured, not commanded
    starts = _starts(problem, effect)
    if not starts:
        return []
    try:
        model = problem.base.with_effect(name, key=_key(problem.base, name), **starts[0])
        _ = model.trace
    except ModelError:
        return []
    return [Trial(name, (_key(problem.base, name),), {}, tuple(starts))]


def _key(model: Model, name: str) -> str:
    key, number = name, 2
    while key in model.effects:
        key, number = f"{name}_{number}", number + 1
    return key


def _starts(problem: Problem, effect: type[Effect]) -> list[dict[str, float]]:
    """Return complete sets of parameters to start from."""
    starts = effect.starts(problem.scale)
    if effect.periodic:
        scanned = [dict(zip(effect.periodic, found, strict=True)) for found in periodic_starts(problem, problem.base)]
        starts = [{**one, **found} for one in starts for found in scanned]
    pars = effect.pars()
    spring = problem.base._has_spring
    complete = []
    for one in starts:
        values = {n: v for n, v in one.items() if not (pars[n].free_standing and spring)}
        values.update({n: v for n, v in effect.held.items() if v is not None})
        complete.append({n: pars[n].nearest(v) for n, v in values.items()})
    return complete


def rescanned(problem: Problem, trial: Trial, before: Ranked) -> Trial:
    """Return a trial with orders and phases as they show in what was fitted before; others as they are."""
    effect = EFFECTS[trial.effect]
    if not effect.periodic:
        return trial
    pars, found = effect.pars(), periodic_starts(problem, before.fit.fitted())
    values = [{n: pars[n].nearest(v) for n, v in zip(effect.periodic, one, strict=True)} for one in found]
    return replace(trial, starts=tuple({**trial.starts[0], **one} for one in values) or trial.starts)


def _sensor_trials(problem: Problem, name: str) -> list[Trial]:
    late = [steps * problem.scale.step for steps in LATE]
    starts = {"sensor_gain": [1.0], "sensor_delay": late}.get(name, [0.0])
    shown = [c for c in problem.channels if c in problem.base.states or name != "sensor_delay"]
    return [Trial(name, (), {f"{name}.{c}": start}, ({},)) for c in shown for start in starts]


def extended(problem: Problem, before: Ranked | None, trial: Trial, start: dict[str, float]) -> Candidate:
    """Return the candidate that adds a trial, at one of its starts, to what was fitted before."""
    model = before.fit.fitted() if before else problem.base
    sensors = {n: before.fit.parameters()[n] for n in before.sensors} if before else {}
    added = tuple(e for e in before.fit.candidate.label if e in model.effects) if before else ()
    for key in trial.added:
        model = model.with_effect(trial.effect, key=key, **start)
    c = candidate(problem, model, added + trial.added, {**sensors, **trial.sensors})
    return replace(_from_nominal(problem, c), wander=before.fit.candidate.wander if before else c.wander)


def strain(f: Fit) -> float:
    """Return what the priors cost: large where known parameters had to move far to imitate what is missing."""
    pairs = zip(f.candidate.coordinates, f.theta, strict=True)
    return float(sum(((x - c.prior) / c.spread) ** 2 for c, x in pairs))


def _from_nominal(problem: Problem, c: Candidate) -> Candidate:
    """Return the candidate with the base parameters at nominal: the base-only fit has run off to imitate effects."""
    values = dict(c.values)
    for name, value in problem.base.parameters.items():
        if name in values:
            values[name] = value
    for key, use in problem.base.effects.items():
        for name, value in use.parameters.items():
            if f"{key}.{name}" in values:
                values[f"{key}.{name}"] = value
    return replace(c, values=values)


def free_parameters(problem: Problem, f: Fit) -> int:
    """Return how many free parameters a fit has beyond those of the base model."""
    base = base_names(problem)
    return sum(1 for c in f.candidate.coordinates if c.name not in base)


def evidence(problem: Problem, f: Fit, effects: int) -> float:
    """Return -2 log likelihood + prior + p ln n + a price for every effect; p counts what is not a base parameter."""
    return f.cost + free_parameters(problem, f) * float(np.log(f.count.sum())) + PRICE * effects


def base_names(problem: Problem) -> set[str]:
    """Return the names of the parameters of the base model and of its effects."""
    known = {f"{key}.{n}" for key, use in problem.base.effects.items() for n in use.parameters}
    return set(problem.base.parameters) | known


def assess(problem: Problem, filter: Filter | None) -> Ranked | None:
    """Fit the base model and return it with its evidence; None if it diverges."""
    return ranked(
        problem, (), (), descend(problem, candidate(problem, problem.base, ()), None, problem.levels, 10, filter)
    )


def _climb(problem: Problem, trial: Trial) -> list[tuple[Fit, Fit]]:
    """Search at high gain from all starts of a trial, and follow the best to the middle gain; best pair first."""
    if not trial.starts:
        return []
    high, middle = problem.levels[:2]
    short = problem.short
    candidates = [extended(problem, None, trial, start) for start in trial.starts]
    first = [f for f in (fit(short, c, high, None, 2) for c in candidates) if f]
    first = sorted(first, key=cost_of)[:MOST_STARTS]
    first = sorted((further(short, f, 2) for f in first), key=cost_of)
    if EFFECTS[trial.effect].states:  # a high gain says little of what is remembered
        direct = [f for f in (fit(short, c, middle, None, 4) for c in candidates) if f]
        first = [*sorted(direct, key=cost_of)[:1], *first]
    second = ((g, fit(problem, g.candidate, middle, g.theta, 8)) for g in first)
    found = itertools.islice(((g, f) for g, f in second if f), 2)
    kept = ((f if g.gains is middle else g, f) for g, one in found for f in trusted(problem, [one]))
    return sorted(kept, key=_pair_cost)


def _bred(problem: Problem, trial: Trial, each: Each) -> list[tuple[Fit, Fit]]:
    """Search at the middle gain from the best of many starts; best pair first."""
    middle = problem.levels[1]
    first, starts = extended(problem, None, trial, trial.starts[0]), list(trial.starts)
    if len(starts) > MOST_STARTS:
        starts = narrowed(problem.short, first, starts, trial.added[0], middle, each)
    candidates = [extended(problem, None, trial, start) for start in starts]
    found = [f for f in each(lambda c: fit(problem, c, middle, None, 10), candidates) if f]
    kept = [f for one in each(lambda f: trusted(problem, [f]), found) for f in one]
    return [(f, f) for f in sorted(kept, key=cost_of)]


def _unstuck(problem: Problem, trial: Trial, each: Each) -> list[tuple[Fit, Fit]]:
    """Search with an observer that is wide awake from the best of many starts: where motion sticks and slips, minima at
    lower gains are so many that a fit must be at the end of its way before it descends. Best pair first.
    """
    (high, middle), short, first = problem.levels[:2], problem.short, extended(problem, None, trial, trial.starts[0])
    awake = problem.observer(AWAKE * problem.scale.step)
    starts = narrowed(short, first, trial.starts, trial.added[0], awake, each)
    tried = each(lambda s: descend(short, extended(problem, None, trial, s), None, (awake, high), 6, None), starts)
    best = min((fits[-1] for fits in tried if len(fits) == 2), key=cost_of, default=None)
    found = best and fit(problem, best.candidate, high, best.theta, 20)
    lower = found and fit(problem, found.candidate, middle, found.theta, 10)
    return [(found, f) for f in trusted(problem, [lower])] if found and lower else []


def _climbed(problem: Problem, trials: Sequence[Trial], run: Executor) -> list[list[tuple[Fit, Fit]]]:
    """Return for each trial what a search from its starts finds; best pairs first.

    Those with own states and many starts are begun first: what takes long must not be waited for.
    """
    rugged = {i for i, t in enumerate(trials) if t.starts and EFFECTS[t.effect].rugged}
    plain = sorted(set(range(len(trials))) - rugged, key=lambda i: _effort(trials[i]), reverse=True)
    begun = run.map(functools.partial(_climb, problem), [trials[i] for i in plain])
    found = {i: _bred(problem, trials[i], run.map) for i in sorted(rugged)}
    found.update(zip(plain, begun, strict=True))
    return [found[i] for i in range(len(trials))]


def _effort(trial: Trial) -> tuple[bool, int]:
    """Return what tells how long a trial takes."""
    return bool(EFFECTS[trial.effect].states), len(trial.starts)


def without(problem: Problem, r: Ranked, effect: str) -> Ranked | None:
    """Return what was fitted without one of its effects, fitted again from there; None if that diverges."""
    c, effects, sensors = _reduced(problem, r, effect)
    low = problem.levels[-1]
    levels = [r.fit.gains, low] if r.fit.gains is not low else [low]
    return ranked(problem, effects, sensors, descend(problem, c, None, levels, 10, r.low.filter))


def remainder(problem: Problem, r: Ranked, effect: str) -> Ranked | None:
    """Return what was fitted without one of its effects, all else as it was; None if that diverges."""
    c, effects, sensors = _reduced(problem, r, effect)
    found = fit(problem, c, r.fit.gains, c.start(r.fit.parameters()), 0)
    return Ranked(effects, sensors, found, found, evidence(problem, found, len(effects))) if found else None


def _reduced(problem: Problem, r: Ranked, effect: str) -> tuple[Candidate, tuple[str, ...], tuple[str, ...]]:
    """Return the candidate that is left without one effect of what was fitted, its effects and its sensors."""
    model = r.fit.fitted()
    for key in added_keys(problem, model, effect):
        model = model.without_effect(key)
    values = r.fit.parameters()
    sensors = {n: values[n] for n in r.sensors if n.partition(".")[0] != effect}
    added = tuple(e for e in r.fit.candidate.label if e in model.effects)
    c = replace(candidate(problem, model, added, sensors), wander=r.fit.candidate.wander)
    return c, tuple(e for e in r.effects if e != effect), tuple(sensors)


def _pair_cost(pair: tuple[Fit, Fit]) -> float:
    return pair[1].cost


def _warmer(
    problem: Problem, trials: Sequence[Trial], climbed: list[list[tuple[Fit, Fit]]], near: float, run: Executor
) -> list[list[tuple[Fit, Fit]]]:
    """Let effects that extend another one (a subclass of its class) also start from where that one arrived, if its cost
    is below ``near``.
    """
    fits = {t.effect: c[0][1] for t, c in zip(trials, climbed, strict=True) if t.added and _reached(c) < near}
    again = [_warm(trial, fits) for trial in trials]
    more = _climbed(problem, again, run)
    return [sorted([*old, *new], key=_pair_cost) for old, new in zip(climbed, more, strict=True)]


def _reached(climbed: Sequence[tuple[Fit, Fit]]) -> float:
    """Return the least objective at the middle gain, infinite if there is none."""
    return climbed[0][1].cost if climbed else np.inf


def _told(problem: Problem, climbed: Sequence[Sequence[tuple[Fit, Fit]]]) -> list[Sequence[tuple[Fit, Fit]]]:
    """Return what was climbed to, without loads that float and leave more than noise: a filter can explain anything."""
    return [c for c in climbed if not c or not roughness(c[0][1]) or consistent(problem, c[0][1], True)]


def _near(problem: Problem, reference: float, climbed: Sequence[Sequence[tuple[Fit, Fit]]]) -> float:
    """Return the objective at the middle gain below which an effect may still be what is missing: if the best one gains
    much on the base model's ``reference`` and leaves nothing but noise, not far above it; else infinite.
    """
    best = min(climbed, key=_reached, default=())
    if not best or not reference - _reached(best) >= MUCH:
        return np.inf
    if any_structure(best[0][1].innovations, problem.white(best[0][1].gains)):
        return np.inf
    return _reached(best) + BEHIND


def _warm(trial: Trial, fits: Mapping[str, Fit]) -> Trial:
    """Return a trial that starts from where simpler effects arrived; without starts where there is no such effect."""
    effect, starts = EFFECTS[trial.effect], []
    for simple, found in fits.items():
        values = _values(found, simple)
        pars, first = effect.pars(), trial.starts[0]
        after = effect.after(simple, values)
        starts += [first | {n: pars[n].nearest(v) for n, v in one.items() if n in first} for one in after]
        if effect in _children(simple):
            starts += [
                {n: pars[n].nearest(v) for n, v in {**start, **_stiffer(values, factor)}.items()}
                for start in trial.starts[:FEW]
                for factor in (1, 3)
            ]
    if effect.rugged:
        starts = [s for s in starts if min(s.values()) > 0.0]
    return replace(trial, starts=tuple(starts))


def _values(f: Fit, key: str) -> dict[str, float]:
    """Return the free parameters of an effect, as fitted."""
    return {n.partition(".")[2]: v for n, v in f.parameters().items() if n.startswith(f"{key}.")}


def extends(name: str) -> list[str]:
    """Return the effects that an effect extends: what it is a subclass of."""
    return [n for n in EFFECTS if EFFECTS[name] in _children(n)]


def _children(name: str) -> list[type[Effect]]:
    parent = EFFECTS[name]
    return [e for e in EFFECTS.values() if e is not parent and issubclass(e, parent)]


def _stiffer(values: dict[str, float], factor: float) -> dict[str, float]:
    return {n: v * factor if n == "k" else v for n, v in values.items()}


def cost_of(f: Fit) -> float:
    """Return the objective of a fit."""
    return f.cost


def _descend(
    problem: Problem, trial: Trial, climbed: list[tuple[Fit, Fit]], serious: bool, each: Each = map
) -> Ranked | None:
    """Fit a trial at the lower gains, thoroughly if it is a ``serious`` candidate."""
    best: Ranked | None = None
    for high, middle in climbed[: 2 if serious else 1]:
        if best is not None and middle.cost > climbed[0][1].cost + 50.0:
            break
        levels = problem.levels[2:] if serious else problem.levels[-1:]
        upper = _settled(problem, trial, middle, each) if serious else middle
        lower = descend(problem, upper.candidate, upper.theta, levels, 10 if serious else 2, None)
        if serious and lower:
            lower[-1] = _settled(problem, trial, lower[-1], each)
        if lower and EFFECTS[trial.effect].floating:
            lower[-1] = calmed(problem, lower[-1])
        found = ranked(problem, (trial.effect,), tuple(trial.sensors), [high, upper, *lower])
        if found and (best is None or found.evidence < best.evidence):
            best = found
    return best


def _settled(problem: Problem, trial: Trial, found: Fit, each: Each) -> Fit:
    """Return a fit of an effect with many local minima in the deepest that is found nearby; others as they are."""
    effect = EFFECTS[trial.effect]
    if effect.rugged:
        return deepened(problem, found, trial.added[0], each)
    if effect.periodic:
        order, _, phase = (f"{trial.added[0]}.{n}" for n in effect.periodic)
        return tuned(problem, found, order, phase)
    return found


def compete(problem: Problem, base: Ranked, trials: Sequence[Trial], run: Executor) -> list[Ranked]:
    """Return every trial alone on the base model, fitted, best evidence first.

    Only those that explain a fair part of what the best explains at the middle gain are fitted thoroughly at the low;
    where that leaves nothing but noise, those that explain nearly all of it. Rugged effects start from a few
    points; see `searched`.
    """
    many = [EFFECTS[t.effect].rugged or EFFECTS[t.effect].sticking for t in trials]
    trials = [replace(t, starts=t.starts[:FEW]) if m else t for t, m in zip(trials, many, strict=True)]
    middle = fit(problem, base.fit.candidate, problem.levels[1], None, 10)
    reference = middle.cost if middle else np.inf
    climbed = _climbed(problem, trials, run)
    climbed = _warmer(problem, trials, climbed, _near(problem, reference, _told(problem, climbed)), run)
    told = _told(problem, climbed)
    near, most = _near(problem, reference, told), reference - min(map(_reached, told), default=reference)
    fair = min(near, reference - min(SERIOUS * most, 1e9)) if most >= MUCH else np.inf
    serious = [_reached(c) < fair and not EFFECTS[t.effect].rugged for t, c in zip(trials, climbed, strict=True)]
    work = [(t, c, s) for t, c, s in zip(trials, climbed, serious, strict=True) if c]
    found = run.map(lambda w: _descend(problem, *w), work)
    return sorted((r for r in found if r is not None), key=evidence_of)


def deeper(problem: Problem, r: Ranked, each: Each) -> Ranked:
    """Return the fit of a single effect, gone on from to a deeper minimum nearby if there is one."""
    if r.sensors:
        return r
    key = r.fit.candidate.label[-1]
    return _better(problem, r, _afloat(problem, deepened(problem, r.fit, key, each), each))


def afloat(problem: Problem, r: Ranked, each: Each) -> Ranked:
    """Return the fit of a single effect with a load that floats, gone on from to a deeper minimum further away if there
    is one; others as they are.
    """
    if r.sensors or not roughness(r.fit):
        return r
    return _better(problem, r, _afloat(problem, r.fit, each))


def _afloat(problem: Problem, f: Fit, each: Each) -> Fit:
    """Return a fit of a load that floats as an extended Kalman filter follows it, if it does so to the noise: with a
    play far from where a search arrived, if that is deeper, and as much wandering as makes it most likely.

    A filter that corrects the load is content with a play much too small.
    """
    c, key = f.candidate, f.candidate.label[-1]
    effect = EFFECTS[c.model.effects[key].type]
    if not effect.floating:
        return f
    awake = f if c.alert else fit(problem, replace(c, alert=True), f.gains, f.theta, 10, f.filter)
    if awake is None or not consistent(problem, awake):
        return f
    for name in effect.essential:
        awake = widened(problem, awake, f"{key}.{name}", each)
    return calmed(problem, awake)


def _better(problem: Problem, r: Ranked, best: Fit) -> Ranked:
    """Return a set of effects with a fit that was gone on to, if its evidence is no worse."""
    if best is r.fit:
        return r
    low = best if best.gains is problem.levels[-1] else fit(problem, best.candidate, problem.levels[-1], best.theta, 10)
    found = ranked(problem, r.effects, r.sensors, [best, low]) if low else None
    return r if found is None or found.evidence > r.evidence else found


def sharpened(problem: Problem, r: Ranked, filter: Filter, each: Each) -> Ranked:
    """Return the fit of a single effect with its powers between those that it was started from, where that gains what
    one more parameter must.
    """
    for name in EFFECTS[r.label].graded:
        f = _regraded(problem, r, name, each)
        fits = descend(problem, f.candidate, f.theta, problem.levels[1:], 10, filter) if f else []
        other = ranked(problem, r.effects, r.sensors, fits)
        if other and other.evidence < r.evidence - PRICE - np.log(other.fit.count.sum()):
            r = other
    return r


def _regraded(problem: Problem, r: Ranked, name: str, each: Each) -> Fit | None:
    """Return the best fit of a single effect at the middle gain with a power near to its own."""
    key, middle, (low, high) = r.fit.candidate.label[-1:], problem.levels[1], EFFECTS[r.label].graded[name]
    values = r.fit.fitted().effects[key[0]].parameters

    def at(power: float) -> Fit | None:
        c = extended(problem, None, Trial(r.label, key), {**values, name: power})
        return fit(problem, c, middle, c.start(r.fit.parameters()), 8)

    best = values[name]
    found = {best: at(best)}
    for step in GRADES:
        beside = [p for p in (round(best - step, 2), round(best + step, 2)) if low <= p <= high and p not in found]
        found |= zip(beside, each(at, beside), strict=True)
        best = min(found, key=lambda power: np.inf if (f := found[power]) is None else f.cost)
    return found[best]


def simplified(problem: Problem, trials: Sequence[Trial], found: Sequence[Ranked], run: Executor) -> list[Ranked]:
    """Return fits of single effects, the simpler ones also started from where richer ones arrived that contain them."""
    known = {t.effect: t for t in trials if t.added}
    jobs = []
    for r in found[:FRONT]:
        richer = EFFECTS[r.label]
        values = {**{n: par.nominal for n, par in richer.pars().items()}, **_values(r.fit, r.label)}
        parents = [n for n in extends(r.label) if n in known]
        wanted = {n: {k: values[k] for k in EFFECTS[n].pars()} for n in parents} if r.label in known else {}
        wanted |= richer.simpler(values) if r.label in known else {}
        jobs += [(replace(known[n], starts=(p,)), r.fit) for n, p in wanted.items() if n in known]
    again = run.map(lambda job: _started(problem, *job), jobs)
    return _best_of_each([*found, *(r for r in again if r)])


def _started(problem: Problem, trial: Trial, richer: Fit) -> Ranked | None:
    """Return a trial fitted from its start, with the base parameters of a richer fit."""
    c = extended(problem, None, trial, trial.starts[0])
    theta = c.start({n: v for n, v in richer.parameters().items() if n in problem.base.parameters})
    return ranked(problem, (trial.effect,), (), descend(problem, c, theta, problem.levels[1:], 10, None))


def _best_of_each(found: Sequence[Ranked]) -> list[Ranked]:
    """Return the best fit of every set of effects, best first."""
    best = {(r.effects, r.sensors): r for r in sorted(found, key=evidence_of, reverse=True)}
    return sorted(best.values(), key=evidence_of)


def searched(problem: Problem, trials: Sequence[Trial], found: Sequence[Ranked], run: Executor) -> list[Ranked]:
    """Return what `compete` found, with rugged effects, and those that stick, searched from all their starts."""
    if not found:
        return []
    rugged = [t for t in trials if EFFECTS[t.effect].rugged]
    sticking = [t for t in trials if EFFECTS[t.effect].sticking]
    climbed = [*_climbed(problem, rugged, run), *(_unstuck(problem, t, run.map) for t in sticking)]
    first, middle = min(found, key=evidence_of).fit, problem.levels[1]
    limit = likelihood(problem, first.candidate, first.theta, middle) + CLOSE
    pairs = [(t, c) for t, c in zip([*rugged, *sticking], climbed, strict=True) if c and c[0][1].cost < limit]
    again = [_descend(problem, *pair, True, run.map) for pair in pairs]
    return _best_of_each([*found, *(r for r in again if r)])


class _Weighed(Protocol):
    @property
    def evidence(self) -> float: ...


def evidence_of(found: _Weighed) -> float:
    """Return the evidence of what was fitted, less being better."""
    return found.evidence


__all__ = [
    "STRAINED",
    "Ranked",
    "Trial",
    "afloat",
    "applicable",
    "assess",
    "base_names",
    "calmed",
    "compete",
    "cost_of",
    "deeper",
    "descend",
    "evidence_of",
    "extends",
    "free_parameters",
    "ranked",
    "remainder",
    "rescanned",
    "roughness",
    "searched",
    "sharpened",
    "simplified",
    "strain",
    "trusted",
    "unfiltered",
    "without",
]
