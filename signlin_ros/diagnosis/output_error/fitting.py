"""From starts to minima: many starts for a few steps at a high gain, the best of them onward to the lower ones."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from operator import attrgetter, itemgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from signlin_ros.diagnosis.blocks import MIN_DIVISOR
from signlin_ros.diagnosis.output_error.score import blocks_per_record, log_mse, windowed
from signlin_ros.diagnosis.output_error.trials import CandidateParts, Trial
from signlin_ros.effects import EFFECTS
from signlin_ros.fitting.candidate import Candidate
from signlin_ros.fitting.fit import Fit, fit, further
from signlin_ros.fitting.gains import ObserverGains
from signlin_ros.fitting.problem import Problem

Array = NDArray[np.float64]

MAX_STARTS, STARTS_KEPT = 6, 2
"""Starts that are tried where an effect has many, and how many of all go on to the next gain."""
FIRST_STEPS, MIDDLE_STEPS, LAST_STEPS = 2, 4, 10
"""Steps of a fit from a start, at the middle gain, and to the end."""
FOLLOW_STEPS, STARTS_FOLLOWED = 30, 3
"""Further steps of the best starts of an effect on a part of the records, and how many starts get them."""
SERIOUS, ANYWAY, FINISHED = 0.25, 3, 8
"""Share of the best candidate's gain that makes another worth a thorough fit; how many get one anyway, and at most."""
MIN_LIKELIHOOD_CHANGE = 1.0
"""Change of -2 log likelihood that is none: by so much it falls for each parameter that fits nothing but noise."""
AROUND, FREE_RUN_STARTS = 3.0, 64
"""Tolerances off nominal within which fits of free runs in a closed loop start, too, and how many do."""


@dataclass(frozen=True)
class Minimum:
    """A minimum: the fit at the gain whose windows are predicted best, the level of these errors, and the fit at the
    lowest gain, where most shows of what is missing.
    """

    fit: Fit
    log_mse: float
    low: Fit

    @classmethod
    def of(cls, problem: Problem, f: Fit, low: Fit) -> Minimum:
        """Return a fit and one at the lowest gain with the level of the first."""
        return cls(f, log_mse_of_windows(problem, f), low)


def log_mse_of_windows(problem: Problem, f: Fit) -> float:
    """Return the level of a fit's errors over windows, from its own observer."""
    return log_mse(windowed(problem, f.candidate, f.theta, f.gains), problem.noise)


def cheapest(fits: Iterable[Fit | None]) -> Fit | None:
    """Return the fit of the least objective; None where all diverged."""
    return min((f for f in fits if f), key=attrgetter("objective"), default=None)


def fit_over_gains(
    problem: Problem, c: Candidate, starts: Sequence[Array | None], check: Callable[[], None]
) -> Minimum | None:
    """Return a candidate fitted from the best start at all gains but the highest, one by one; ``check`` may raise."""
    tried = []
    for theta in starts:
        check()
        tried.append(fit(problem, c, problem.observer_gains[1], theta, MIDDLE_STEPS))
    if problem.base.plant.closed_loop and not c.label:
        tried += _from_around(problem, c, [f.theta for f in tried if f])
    best = cheapest(tried)
    if best is None:
        return None
    fits = [further(problem, best, LAST_STEPS)]
    for gains in problem.observer_gains[2:]:
        check()
        lower = fit(problem, c, gains, fits[-1].theta, 0)
        if lower is None:
            break
        same = abs(lower.objective - fits[-1].objective) < MIN_LIKELIHOOD_CHANGE  # a Kalman filter's gains are its own
        fits.append(lower if same else further(problem, lower, LAST_STEPS))
    found = min((Minimum.of(problem, f, fits[-1]) for f in fits), key=attrgetter("log_mse"))
    if found.fit is found.low:
        return found
    slow = fit(problem, c, found.low.gains, found.fit.theta, 0)  # on the way down a fit may lose what it had
    return replace(found, low=slow) if slow and slow.objective < found.low.objective else found


def _from_around(problem: Problem, c: Candidate, known: Sequence[Array]) -> list[Fit | None]:
    """Return fits from where base parameters are some tolerances off: a free run that sticks has many local minima.

    Starts are spread evenly [Halton, Numer. Math. 2 (1960) 84].
    """
    base = [i for i, k in enumerate(c.coordinates) if k.spread < 1.0]
    origin, reach = known[0] if known else c.start(), AROUND * np.array([c.coordinates[i].spread for i in base])
    starts = np.tile(origin, (FREE_RUN_STARTS if base else 0, 1))
    starts[:, base] += reach * (2.0 * qmc.Halton(len(base), scramble=False).random(len(starts)) - 1.0) if base else 0.0
    few = [fit(problem.short, c, problem.observer_gains[1], np.clip(x, *c.bounds), MIDDLE_STEPS) for x in starts]
    near = sorted((f for f in few if f), key=attrgetter("objective"))[:STARTS_KEPT]
    return [fit(problem, c, problem.observer_gains[1], f.theta, MIDDLE_STEPS) for f in near]


def cross_validated(problem: Problem, c: Candidate, theta: Array, folds: Sequence[Sequence[int]]) -> Array:
    """Return the squared errors (blocks, channels) of every record, each predicted by a fit to the records of the other
    folds [cross validation: Stone, J. R. Stat. Soc. B 36 (1974) 111]; what each record has of its own is fitted to it.
    """
    gains, parts, found = problem.observer_gains[-1], blocks_per_record(problem), dict[int, Array]()
    for fold in folds:
        others = tuple(s for i, s in enumerate(problem.segments) if i not in fold)
        f, fitted = fit(replace(problem, segments=others), c, gains, theta, LAST_STEPS), {s.source for s in others}
        for i in fold:
            one = replace(problem, segments=(problem.segments[i],))
            found[i] = windowed(one, *of_own(one, c, theta if f is None else f.theta, gains, fitted), gains, parts)
    return np.concatenate([found[i] for i in range(len(problem.segments))])


def of_own(
    problem: Problem, c: Candidate, theta: Array, gains: ObserverGains, fitted: Collection[str]
) -> tuple[Candidate, Array]:
    """Return a candidate that was ``fitted`` to records of some sources for others: what each of these is to have of
    its own is fitted to it, and nothing else.
    """
    if not c.own:
        return c, theta
    other, start = c.elsewhere(problem, theta, fitted)
    f = fit(problem, other, gains, start, LAST_STEPS)
    return other, start if f is None else f.theta


def window_squares(
    problem: Problem, unseen: Problem, c: Candidate, theta: Array, as_it_is: bool = False
) -> tuple[Array, Array]:
    """Return the squared errors (blocks, channels) of training and validation data over windows, of each channel from
    the observer that predicts its training data best: from one for all, a channel rose. Where records are held out in
    turn, parameters are fitted to the others each time, unless a model is taken ``as_it_is``.
    """
    levels = problem.observer_gains
    if unseen.folds:
        known = windowed(problem, c, theta, levels[0])
        return known, known if as_it_is else cross_validated(problem, c, theta, unseen.folds)
    known = np.array([windowed(problem, c, theta, gains) for gains in levels])
    own = np.argmin(np.nan_to_num(known).mean(axis=1), axis=0).tolist()
    fitted = {s.source for s in (unseen if as_it_is else problem).segments}
    left = {k: windowed(unseen, *of_own(unseen, c, theta, levels[k], fitted), levels[k]) for k in set(own)}
    pairs = list(enumerate(own))
    return np.column_stack([known[k, :, i] for i, k in pairs]), np.column_stack([left[k][:, i] for i, k in pairs])


def likelihood_t(problem: Problem, f: Fit, covariances: Sequence[Array], index: tuple[int, ...]) -> float:
    """Return by how many standard errors coordinates of added effects differ from nothing, by how much the likelihood
    falls where they are held there [Wilks 1938, doi:10.1214/aoms/1177732360], which does not depend on their units. The
    scores' own variance allows for the residual's correlation.
    """
    c, theta, held = f.candidate, f.theta.copy(), list(f.candidate.coordinates)
    for i in index:
        kind = held[i].name.partition(".")[0]
        theta[i] = held[i].nothing(EFFECTS[c.model.effects[kind].type if kind in c.model.effects else kind])
        held[i] = replace(held[i], low=theta[i], high=theta[i])
    best = fit(problem, replace(c, coordinates=tuple(held)), f.gains, theta, MIDDLE_STEPS)
    if best is None:
        return np.inf
    scores = f.hessian @ covariances[-1] @ f.hessian
    correlated = max(1.0, *(float(scores[i, i] / max(f.hessian[i, i], MIN_DIVISOR)) for i in index))
    return float(np.sqrt(max(best.objective - f.objective, 0.0) / correlated))


class StartedFits:
    """What was fitted from some starts, for whoever asks for the same again, each time with candidates of their own."""

    def __init__(self) -> None:
        self._known: dict[tuple[Any, ...], tuple[Any, tuple[Candidate, ...], list[Fit | None]]] = {}

    def of(
        self,
        same: tuple[Any, ...],
        key: tuple[Any, ...],
        made: Callable[[], tuple[Sequence[Candidate], list[Fit | None]]],
    ) -> tuple[list[Candidate], list[Fit | None]]:
        """Return candidates and fits of them by a key and by objects that must be the ``same``, as they were made."""
        key = (*map(id, same), *key)
        if key not in self._known:
            candidates, fits = made()
            kept = _with_own_starts(candidates, fits)
            self._known[key] = (same, tuple(kept[0]), kept[1])  # objects that are kept keep their identity
            return list(candidates), fits
        _, candidates, fits = self._known[key]
        return _with_own_starts(candidates, fits)


def _with_own_starts(
    candidates: Sequence[Candidate], fits: Sequence[Fit | None]
) -> tuple[list[Candidate], list[Fit | None]]:
    """Return candidates, and fits of them, that nothing bears on which is fitted with the others."""
    own = {id(c): c.apart() for c in candidates}
    return [own[id(c)] for c in candidates], [f and replace(f, candidate=own[id(f.candidate)]) for f in fits]


def multi_start_fit(
    problem: Problem,
    before: Fit,
    trial: Trial,
    few: int = MAX_STARTS,
    follow_steps: int = 0,
    known: StartedFits | None = None,
) -> Fit | None:
    """Return the best fit of one more effect at the middle gain on a part of the records, from its first start and some
    of the others, with base parameters as given and as they were fitted before; then the best of these fits get so many
    more steps as ``follow_steps`` says. ``known``: what was fitted from some of these starts already.
    """
    remembers, (high, middle) = bool(trial.effect.states), problem.observer_gains[:2]
    slow = problem.base.plant.closed_loop and bool(
        trial.effect.periodic
    )  # what watches tells little of a wave's height
    few_steps, more = (MIDDLE_STEPS, 2 * LAST_STEPS) if slow else (FIRST_STEPS, MIDDLE_STEPS)
    short = problem.led if remembers else problem.short
    parts, fitted, label = CandidateParts.of(before), before.parameters(), before.candidate.label
    last = len(trial.starts) - 1
    at = dict.fromkeys([0, *np.linspace(min(1, last), last, min(few, last + 1)).astype(int).tolist()])
    added = {n: v for n, v in fitted.items() if n in label or n.partition(".")[0] in label}
    ways = [added, fitted] if label else [added]
    known, same, of = known or StartedFits(), (problem, before), (trial.name, *sorted(trial.inertia.items()))
    starts = [tuple(trial.starts[i].items()) for i in at]

    def begun(start: tuple[tuple[str, float], ...]) -> tuple[Sequence[Candidate], list[Fit | None]]:
        c = parts.extended(trial.name, dict(start), trial.inertia).candidate(problem)
        return [c], [fit(short, c, high, c.start(way), few_steps) for way in ways]

    def at_middle() -> tuple[Sequence[Candidate], list[Fit | None]]:
        pairs = [known.of(same, (*of, start), partial(begun, start)) for start in starts]
        candidates, first = [c for cs, _ in pairs for c in cs], [f for _, fits in pairs for f in fits]
        best = sorted((f for f in first if f), key=attrgetter("objective"))[:STARTS_KEPT]
        second = [_at_lower_gain(short, f, middle, more) for f in best]
        if remembers:  # a high gain says little of what is remembered
            second += [fit(short, c, middle, c.start(added), more) for c in candidates]
        return candidates, second

    _, second = known.of(same, (*of, "at the middle gain", *starts), at_middle)
    if follow_steps:  # a few steps tell little of what starts far away
        best = sorted((f for f in second if f), key=attrgetter("objective"))[:STARTS_FOLLOWED]
        second = [further(short, f, follow_steps) for f in best]
    return cheapest(second)


def _at_lower_gain(problem: Problem, f: Fit, gains: ObserverGains, steps: int) -> Fit | None:
    """Return a fit gone on with at a lower gain; where it diverges there, after it was gone on with at its own: what
    softens too much runs off, unless an observer holds it.
    """
    found = fit(problem, f.candidate, gains, f.theta, steps)
    return found or fit(problem, f.candidate, gains, further(problem, f, steps).theta, steps)


def screened(problem: Problem, of: Fit, fits: Sequence[Fit], rival: Fit | None, share: float | None) -> list[Fit]:
    """Return the fits that gain a ``share`` of what the best gains beyond one, on stretches, `SERIOUS` by default; some
    in any case, but where a ``rival`` is as good as these have to be.

    Fits with the same kind of observer are held against each other by likelihood. A Kalman filter, which follows a
    sensitive motion, leaves small innovations whatever the model: fits of two kinds by their errors over windows.
    """
    short, middle = problem.short, problem.observer_gains[1]
    base, other = (fit(short, one.candidate, middle, one.theta, LAST_STEPS) if one else None for one in (of, rival))
    if base is None:
        return sorted(fits, key=attrgetter("objective"))[:FINISHED]
    known, least = [f for f in (base, other) if f], SERIOUS if share is None else share
    is_alike = [all(f.candidate.filtered == one.candidate.filtered for one in known) for f in fits]
    alike = [(f.objective, f) for f, is_so in zip(fits, is_alike, strict=True) if is_so]
    kept = _serious(base.objective, [f.objective for f in known], alike, least, 0 if other else ANYWAY)
    if not all(is_alike):
        *lowest, level = (log_mse_of_windows(short, f) for f in (*known[1:], base))
        every = [(log_mse_of_windows(short, f), f) for f in fits]
        apart = [pair for pair, is_so in zip(every, is_alike, strict=True) if not is_so]
        kept += _serious(level, [*lowest, *(one for one, _ in every)], apart, least, 0 if other else 1)
    return kept[:FINISHED]


def _serious(
    base: float, others: Sequence[float], levels: Sequence[tuple[float, Fit]], share: float, anyway: int
) -> list[Fit]:
    """Return the fits whose level falls from that of a ``base`` by more than a ``share`` of the largest fall, to theirs
    or to ``others``, and ``anyway`` so many of the lowest.
    """
    ordered = sorted(levels, key=itemgetter(0))
    least = share * (base - min([base, *others, *(level for level, _ in ordered[:1])]))
    return [f for i, (level, f) in enumerate(ordered) if i < anyway or base - level >= least]


__all__ = [
    "FOLLOW_STEPS",
    "MAX_STARTS",
    "MIDDLE_STEPS",
    "Minimum",
    "StartedFits",
    "cheapest",
    "fit_over_gains",
    "likelihood_t",
    "multi_start_fit",
    "screened",
    "window_squares",
]
