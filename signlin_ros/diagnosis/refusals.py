"""Why an effect is not what is missing, however much it lowers the error."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import islice

import numpy as np
from scipy.stats import chi2, norm

from signlin_ros.diagnosis.findings import NEEDED
from signlin_ros.diagnosis.fit import Fit, fit
from signlin_ros.diagnosis.judge import any_structure
from signlin_ros.diagnosis.problem import Problem
from signlin_ros.diagnosis.rank import FEW, Ranked, roughness
from signlin_ros.diagnosis.scan import finest
from signlin_ros.effects import find_effect
from signlin_ros.effects.base import Effect
from signlin_ros.model import Model

NOTHING, NEEDLESS = (0.1, 1e-2, 1e-6), 0.1
"""What a parameter is held at in turn, as shares of its value, to see if it is needed, and the share of an effect's
gain that one must make without which it is another effect."""
REAL = 3.0
"""Standard errors by which an added effect must differ from nothing."""
SLIGHT = 1e-3
"""Share of the driving force, or of the largest input, beneath which an effect is not worth a name."""

HELD = 10.0
"""Breakaway friction beyond so many times what drives (RMS): nothing would ever move against it."""
PERIODS, OTHERS, INDIFFERENT = 20.0, (0.9, 1.1, 0.8, 1.2, 1.37), (0.5, 0.65)
"""A wave of which the motion covers so many periods is no wave if waves with its order multiplied by these explain so
much of what it explains: fine waves of any order hold what is slow, as friction does. Where structure is left, one of
the first two is enough; where a wave leaves noise alone, each of them must: the least had 0.73 and more where there was
no wave, 0.06 and 0.52 where there was one."""
FLAT = 0.3
"""Travel in m of what slides, as a part of 2 pi, beneath which one sine of the position is no weight of an arm."""
REPEATED = 0.75
"""Periods that a motion must cover for a wave to be seen, where it leaves nothing but noise."""
BRIEF, LONG = 0.1, 0.15
"""Part of the time between two samples beneath which a delay is not worth a name, and part of a record beyond which one
imitates something else: what was before the record explains what it cannot."""


def refusal(problem: Problem, r: Ranked, before: Ranked) -> tuple[str, str] | None:
    """Return which effect added to ``before`` is not what it is called, and why ("" if its parameters say so)."""
    if not plausible(problem, r):
        return r.label, ""
    if not _real(problem, r, before):
        return r.label, f"its parameters do not differ from nothing by {REAL:g} standard errors"
    unknown = _undetermined(r)
    if unknown:
        return unknown
    slight = _negligible(problem, r, before)
    if slight:
        return slight, f"it would be less than {100 * SLIGHT:g} % of what drives"
    wave = _unrepeated(problem, r) or _of_any_order(problem, r, before)
    if wave:
        return wave
    if _instant(problem, r, before):
        return r.label, f"it would be less than {BRIEF:g} of the time between two samples"
    if _delay(r, before) > LONG * problem.scale.duration:
        return r.label, f"it would be more than {100 * LONG:g} % of the record, and leave little of it to tell by"
    if _endless(problem, r, before):
        return r.label, "it would swing without end, as a force does that goes with the time, whatever moves"
    if _follows(problem, r, before):
        return r.label, "a model without it explains as much where its motion is corrected as quickly"
    spare = _needless(problem, r, before)
    return spare and (spare[0], f"without its {spare[1]} it explains nearly as much")


def plausible(problem: Problem, r: Ranked) -> bool:
    """Tell whether the parameters of all that was added are those of the effects, not of what they imitate."""
    model = r.fit.fitted()
    added = [use for key, use in model.effects.items() if key not in problem.base.effects]
    most = HELD * max(problem.scale.force, problem.scale.inertia * problem.scale.acceleration)
    effects = [(find_effect(use.type, "effects"), use.parameters) for use in added]
    return all(
        e.plausible(p) and sum(abs(p[n]) for n in e.breakaway) <= most and not _flat(problem, e) for e, p in effects
    )


def _flat(problem: Problem, effect: type[Effect]) -> bool:
    """Tell whether an effect is one sine of a length of which the motion covers next to nothing: a load and a spring.

    What turns has a weight however little it turns.
    """
    low, high = problem.stretch
    linear = problem.base.plant.position_unit == "m" and not problem.rotary
    return effect.angular and not effect.periodic and linear and high - low < FLAT


def sound(problem: Problem, r: Ranked) -> bool:
    """Tell whether all that was added could be what it is called: its parameters are possible, its waves repeat."""
    values = r.fit.parameters()
    waves = [seen >= REPEATED and values[name] <= finest(problem) for _, name, seen in _waves(problem, r)]
    return plausible(problem, r) and all(waves)


def _is_essential(model: Model, parameter: str) -> bool:
    """Tell whether a parameter of a model, ``key.name``, is essential to its effect."""
    key, _, name = parameter.partition(".")
    return key in model.effects and name in find_effect(model.effects[key].type, "effects").essential


def _endless(problem: Problem, r: Ranked, before: Ranked) -> bool:
    """Tell whether what was added to ``before`` must swing with less damping than anything real has."""
    f, model, values = r.fit, r.fit.fitted(), dict[str, float]()
    for key in _added(r, before):
        use = model.effects[key]
        damped = find_effect(use.type, "effects").damped(use.parameters)
        values |= {f"{key}.{name}": value for name, value in damped.items()}
    found = _holding(problem, f, values, 10) if values else None
    return found is not None and found.cost - f.cost > NEEDED


def _holding(problem: Problem, f: Fit, values: Mapping[str, float], steps: int) -> Fit | None:
    """Return a fit with some parameters held at values, the rest fitted again."""
    start, held = f.theta.copy(), list(f.candidate.coordinates)
    for i, k in enumerate(held):
        if k.name in values:
            start[i] = k.theta(values[k.name])
            held[i] = replace(k, low=start[i], high=start[i])
    return fit(problem, replace(f.candidate, coordinates=tuple(held)), f.gains, start, steps, f.filter)


def _follows(problem: Problem, r: Ranked, before: Ranked) -> bool:
    """Tell whether a load that floats gains no more than what an observer of ``before`` gains that is wide awake.

    The filter that corrects the load may follow what noise in the input does to the motion.
    """
    enough = roughness(r.fit)
    awake = fit(problem, before.fit.candidate, problem.levels[0], before.fit.theta, 6, r.fit.filter) if enough else None
    return awake is not None and awake.cost - r.fit.cost < enough


def _needless(problem: Problem, r: Ranked, before: Ranked) -> tuple[str, str] | None:
    """Return an effect that was added to ``before``, and a parameter essential to it that the fit hardly needs.

    What an effect gains may be what a filter gains that corrects its own states, whatever the effect. Where nothing but
    noise is left, the parameter must do no more than how such a filter works differs by.
    """
    f, known = r.fit, {k.name for k in before.fit.candidate.coordinates}
    c, added = f.candidate, [i for i, k in enumerate(f.candidate.coordinates) if k.name not in known]
    essential = [i for i in added if _is_essential(c.model, c.coordinates[i].name)]
    start = fit(problem, before.fit.candidate, f.gains, before.fit.theta, 2, f.filter) if essential else None
    for i in essential:
        gained = start.cost - f.cost if start else np.inf
        least = NEEDLESS * gained if any_structure(f.innovations, problem.white(f.gains)) else roughness(f)
        if any(cost - f.cost < max(NEEDED, least) for cost in _without(problem, f, i)):
            key, _, name = c.coordinates[i].name.partition(".")
            return c.model.effects[key].type, name
    return None


def _without(problem: Problem, f: Fit, i: int) -> Iterator[float]:
    """Yield ever smaller costs of a fit with its coordinate i held at nearly nothing.

    It is made less by degrees, and the effect's first starts are tried too: contacts that are very stiff, suddenly or
    already, throw a filter off.
    """
    c, theta, least = f.candidate, f.theta, np.inf
    k, key = c.coordinates[i], c.coordinates[i].name.partition(".")[0]
    effect = find_effect(c.model.effects[key].type, "effects")
    usual = [{f"{key}.{n}": v for n, v in one.items()} for one in effect.starts(problem.scale)[:FEW]]
    for share, values in [*((share, {}) for share in NOTHING), *((NOTHING[-1], values) for values in usual)]:
        none = k.theta(share * k.value(float(f.theta[i])))
        held = tuple(replace(o, low=none, high=none) if j == i else o for j, o in enumerate(c.coordinates))
        start = np.array([o.theta(values[o.name]) if o.name in values else x for o, x in zip(held, theta, strict=True)])
        start[i] = none
        found = fit(problem, replace(c, coordinates=held), f.gains, start, 10, f.filter)
        if found and found.cost < least:
            theta, least = found.theta, found.cost
            yield least


def _negligible(problem: Problem, r: Ranked, before: Ranked) -> str:
    """Return an effect added to ``before`` whose forces (or what it takes from the input) are beneath notice, whatever
    their significance: in so fine a fit it stands in for the shape of a sensor's noise, or for a filter's; or "".
    """
    values, model = r.fit.parameters(), r.fit.candidate.model
    for key in _added(r, before):
        use = model.effects[key]
        pars = find_effect(use.type, "effects").pars()
        units = {n: p.unit for n, p in pars.items() if f"{key}.{n}" in values and p.unit[:1] in ("F", "U")}
        level = {n for n, unit in units.items() if unit in ("F", "U")} or set(units)
        sizes = [abs(values[f"{key}.{n}"]) / problem.scale.of(units[n]) for n in level]
        if sizes and max(sizes) < SLIGHT:
            return use.type
    return ""


def _added(r: Ranked, before: Ranked | None = None) -> list[str]:
    """Return the keys of the effects that were added to ``before``, or to the base."""
    model, known = r.fit.candidate.model, before.effects if before else ()
    return [k for k in r.fit.candidate.label if k in model.effects and model.effects[k].type not in known]


def _waves(problem: Problem, r: Ranked, before: Ranked | None = None) -> list[tuple[str, str, float]]:
    """Return the waves that were added to ``before``: key, parameter of the order, periods that the motion covers."""
    values, model, (low, high) = r.fit.parameters(), r.fit.candidate.model, problem.stretch
    orders = [(k, n) for k in _added(r, before) for n in find_effect(model.effects[k].type, "effects").periodic[:1]]
    return [(k, f"{k}.{n}", values[f"{k}.{n}"] * (high - low) / (2 * np.pi)) for k, n in orders]


def _unrepeated(problem: Problem, r: Ranked) -> tuple[str, str] | None:
    """Return an added effect that is said to repeat where the motion covers less than one period, and how much of it:
    any smooth force is a part of some wave, and a large part of one only to the noise if it is one; or one whose
    periods are finer than the position is known. One that was added before counts: it may have become another curve.
    """
    for key, name, seen in _waves(problem, r):
        if r.fit.parameters()[name] > finest(problem):
            return r.fit.candidate.model.effects[key].type, ""
        if seen < REPEATED or (seen < 1.0 and any_structure(r.fit.innovations, problem.white(r.fit.gains))):
            why = f"the motion covers {seen:.0%} of what would be its period: nothing shows that it repeats"
            return r.fit.candidate.model.effects[key].type, why
    return None


def _of_any_order(problem: Problem, r: Ranked, before: Ranked) -> tuple[str, str] | None:
    """Return a fine wave added to ``before`` that waves of quite other orders do as well as, and that this is so.

    What moves slowly rests in its valleys: it stands in for friction that holds more than the model's.
    """
    f, start = r.fit, None
    for key, name, seen in _waves(problem, r, before):
        if seen < PERIODS:
            continue
        start = start or fit(problem, before.fit.candidate, f.gains, before.fit.theta, 6, f.filter)
        if start and _as_good_at_others(problem, f, name, start.cost):
            why = "a wave of any other order explains nearly as much: it holds what moves slowly, as friction does"
            return f.candidate.model.effects[key].type, why
    return None


def _as_good_at_others(problem: Problem, f: Fit, name: str, without: float) -> bool:
    """Tell whether a wave does as well with other orders (``name``: of the order); ``without``: the cost without it."""
    gained = max(without - f.cost, 1e-300)
    order = f.parameters()[name]
    fits = (_holding(problem, f, {name: times * order}, 8) for times in OTHERS)
    shares = ((without - other.cost) / gained if other else 0.0 for other in fits)
    if any_structure(f.innovations, problem.white(f.gains)):
        return any(share > INDIFFERENT[0] for share in islice(shares, 2))
    return all(share > INDIFFERENT[1] for share in shares)


def _instant(problem: Problem, r: Ranked, before: Ranked) -> bool:
    """Tell whether the effect that was added last is a delay that nobody would notice."""
    return _delay(r, before, np.inf) < BRIEF * problem.scale.step


def _delay(r: Ranked, before: Ranked, none: float = 0.0) -> float:
    """Return the largest delay of the effect that was added last, in s; ``none`` if it is no delay."""
    units = {par.unit for par in find_effect(r.label, "effects").pars().values()}
    if units != {"s"} or r.label in before.effects:
        return none
    return max((v for n, v in r.fit.parameters().items() if n.partition(".")[0] == r.label), default=none)


def _phases(model: Model) -> set[str]:
    """Return the parameters of a model, ``key.name``, that say where a force is, not how large: orders and phases."""
    found = set()
    for key, use in model.effects.items():
        effect = find_effect(use.type, "effects")
        found |= {f"{key}.{n}" for n in (*effect.turning[1:], *effect.periodic[:1])}
    return found


def _real(problem: Problem, r: Ranked, before: Ranked) -> bool:
    """Tell whether the amplitudes of what was added differ together from nothing, by `REAL` standard errors.

    A parameter that acts in steps, as a delay in whole samples, has no standard error: its evidence decides alone.
    """
    known = {c.name for c in before.fit.candidate.coordinates}
    covariance = np.linalg.pinv(r.fit.hessian, hermitian=True)
    coordinates = r.fit.candidate.coordinates
    added = [i for i, c in enumerate(coordinates) if c.name not in known]
    gains = [i for i in added if coordinates[i].name.startswith("sensor_gain.")]
    if any(abs(r.fit.theta[i]) > 0.98 * coordinates[i].high for i in gains):
        return False  # no sensor is that wrong: it stands in for something else
    where = _phases(r.fit.candidate.model)
    free = [i for i in added if not coordinates[i].log or coordinates[i].name.startswith("sensor_")]
    free = [i for i in free if coordinates[i].name not in where]
    steps = r.fit.candidate.equations.delaying if problem.scale.imposed else frozenset()
    amplitudes = [i for i in free if r.fit.hessian[i, i] > 0.0 and coordinates[i].name not in steps]
    a, spread = r.fit.theta[amplitudes], covariance[np.ix_(amplitudes, amplitudes)]
    wald = float(a @ np.linalg.pinv(spread, hermitian=True) @ a)
    return not amplitudes or wald > chi2.ppf(2 * norm.cdf(REAL) - 1, len(amplitudes))


def vague(f: Fit, key: str) -> list[str]:
    """Return the parameters of an effect (its key) that a fit knows no better than to their own size."""
    spread = np.sqrt(np.abs(np.diag(np.linalg.pinv(f.hessian, hermitian=True))))
    found = []
    for k, x, own in zip(f.candidate.coordinates, f.theta.tolist(), spread.tolist(), strict=True):
        owner, _, name = k.name.partition(".")
        if owner == key and own > (1.0 if k.log else abs(x)):
            found.append(name)
    return found


def _undetermined(r: Ranked) -> tuple[str, str] | None:
    """Return an added effect of which a parameter that tells it from simpler ones is not known to better than its own
    size, and that this is so; one that was added before counts too, with others it may have become vague. Without such
    parameters of its own it is judged by all, where there are several, but for orders and phases: what they say
    together another effect says with fewer.
    """
    c, where = r.fit.candidate, _phases(r.fit.candidate.model)
    for key in _added(r):
        effect = find_effect(c.model.effects[key].type, "effects")
        unknown = [n for n in vague(r.fit, key) if f"{key}.{n}" not in where]
        telling = [n for n in unknown if n in effect.telling]
        if telling:
            return (
                effect.name,
                f"its {telling[0]}, which tells it from simpler effects, is known no better than to its size",
            )
        free = [k.name for k in c.coordinates if k.name.partition(".")[0] == key and k.name not in where]
        if not effect.telling and 1 < len(unknown) == len(free):
            return effect.name, "none of its parameters is known to better than its own size"
    return None


__all__ = ["plausible", "refusal", "sound", "vague"]
